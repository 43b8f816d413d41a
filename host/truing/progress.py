"""How a long computation reports how far it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

# Called with the share that is done, 0 to 1.
Progress: TypeAlias = Callable[[float], None]


def ignore_progress(share: float) -> None:
    """Report to nobody."""
    del share
