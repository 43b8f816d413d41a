"""A package that can be called: `truing.diagnose` is a room of this package and a verb of its interface.

Importing any module of a room makes the room an attribute of `truing`, in place of a function of that name.
Both `truing.diagnose(recordings)` and `truing.diagnose.engine` hold where the room itself can be called.
"""

from __future__ import annotations

import inspect
import sys
from importlib import import_module
from types import ModuleType
from typing import Any


class CallablePackage(ModuleType):
    """A package whose call is that of the verb of its name in `truing.api`."""

    @property
    def _verb(self) -> Any:
        return getattr(import_module("truing.api"), self.__name__.rpartition(".")[2])

    @property
    def __signature__(self) -> inspect.Signature:
        return inspect.signature(self._verb)

    @property
    def __wrapped__(self) -> Any:
        return self._verb

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call the verb."""
        return self._verb(*args, **kwargs)


def make_callable(package: str) -> None:
    """Let a package be called as the verb of its name."""
    sys.modules[package].__class__ = CallablePackage
