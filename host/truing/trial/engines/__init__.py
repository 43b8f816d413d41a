"""Trials in physics engines that this project did not write: the engines by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from truing.errors import TruingError
from truing.extras import require

if TYPE_CHECKING:
    from truing.trial.engines.engine import Engine

ENGINES = ("mujoco",)


def load_engine(name: str) -> Engine[Any]:
    """Return an engine.

    Raises
    ------
    LibraryMissingError : the extra `engines` is not installed.
    """
    if name not in ENGINES:
        raise TruingError(f"{name}: no engine of that name", f"known: {', '.join(ENGINES)}")
    require("engines")
    from truing.trial.engines.mujoco_engine import MujocoEngine

    return MujocoEngine()
