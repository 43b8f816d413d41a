"""What a user chooses of a virtual board."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True, slots=True)
class VirtualOptions:
    """How to make the virtual board of `--port sim`.

    Parameters
    ----------
    image : the firmware's ELF file; None takes the build's.
    robot : a TOML file of robot parameters that differ from the paper's robot; None for none.
    crystal_ppm : how much faster than marked the board's crystal is.
    """

    seed: int = 1
    image: Path | None = None
    robot: Path | None = None
    crystal_ppm: float = field(default=0.0, kw_only=True)
