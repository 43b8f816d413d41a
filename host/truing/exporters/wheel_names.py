"""Which of a model's driven joints is the left wheel, which the right one."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from truing.errors import FileError

_SIDES = {"left": "left", "l": "left", "right": "right", "r": "right"}


def side_of(name: str) -> str | None:
    """The side that a name says: `wheel_left`, `LeftWheel`, `axle_l`; None where it says none or both."""
    words = re.findall(r"[A-Z]?[a-z]+|[A-Z]+|\d+", name)
    found = {_SIDES[word.lower()] for word in words if word.lower() in _SIDES}
    return found.pop() if len(found) == 1 else None


def sides_of(path: Path, across: Mapping[str, float], names: tuple[str, str] | None) -> tuple[str, str]:
    """Names of the left and the right wheel's joint.

    Parameters
    ----------
    across : driven joints, and how far to the left each stands, m.
    names : left and right as the user gave them, or None to find them.
    """
    known = ", ".join(across) or "none"
    if names is not None:
        for name in names:
            if name not in across:
                raise FileError(path, f"no driven joint {name!r}; there are {known}")
        return names
    chosen = list(across)
    if len(chosen) > 2:
        wheels = [name for name in chosen if "wheel" in name.lower()]
        chosen = wheels if len(wheels) == 2 else [name for name in chosen if side_of(name)]
    sides = {side_of(name): name for name in chosen}
    if len(chosen) == 2 and {"left", "right"} <= sides.keys():
        return sides["left"], sides["right"]
    if len(chosen) == 2 and across[chosen[0]] != across[chosen[1]]:
        left, right = sorted(chosen, key=lambda name: -across[name])
        return left, right
    raise FileError(path, f"which two joints drive the wheels? There are {known}", "Give --joints LEFT,RIGHT")
