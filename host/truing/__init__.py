"""truing: run a two-wheel robot, fetch its recordings, and find what its simulation leaves out.

Six verbs, loaded when they are used: `read`, `simulate`, `identify`, `fit`, `diagnose`, `export`
(docs/PYTHON.md).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from truing.api import diagnose, export, fit, identify, read, simulate

__version__ = "0.1.0"
__all__ = ["__version__", "diagnose", "export", "fit", "identify", "read", "simulate"]

# Verbs that are rooms too: the room can be called (callable_package.py).
_ROOMS = ("diagnose", "identify")


def __getattr__(name: str) -> Any:
    if name in _ROOMS:
        return import_module(f"truing.{name}")
    if name in __all__:
        return getattr(import_module("truing.api"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
