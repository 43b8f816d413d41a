"""Trials in physics engines that this project did not write: the engines by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from truing.errors import TruingError
from truing.extras import require

if TYPE_CHECKING:
    from truing.trial.engines.engine import Engine

# Each with the extra that brings it.
_EXTRAS = {"mujoco": "engines", "pybullet": "bullet"}
ENGINES = tuple(_EXTRAS)


def load_engine(name: str) -> Engine[Any]:
    """Return an engine.

    Raises
    ------
    LibraryMissingError : its extra is not installed.
    """
    if name not in _EXTRAS:
        raise TruingError(f"{name}: no engine of that name", f"known: {', '.join(ENGINES)}")
    require(_EXTRAS[name])
    if name == "pybullet":
        from truing.trial.engines.pybullet_engine import BulletEngine

        return BulletEngine()
    from truing.trial.engines.mujoco_engine import MujocoEngine

    return MujocoEngine()
