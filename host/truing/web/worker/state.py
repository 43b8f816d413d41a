"""The board's state as the pages see it, and the request for a run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from truing.board.state import BoardStatus
from truing.link.handshake import BoardInfo
from truing.plan import Plan


@dataclass(frozen=True, slots=True)
class Task:
    """The board's present task besides manual driving: a plan, or the download of its log."""

    name: str
    stage: str
    progress: float = 0.0
    problem: str = ""
    saved: str = ""

    @property
    def is_over(self) -> bool:
        """Whether it ended, successfully or not."""
        return self.stage in ("done", "failed", "stopped")


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The board's state at one moment, as pages need it; immutable.

    Attributes
    ----------
    link : `connecting`, `connected` or `lost`.
    message : what happened to the link, as text.
    """

    link: str = "connecting"
    message: str = "connecting"
    next_step: str = ""
    info: BoardInfo | None = None
    status: BoardStatus | None = None
    task: Task | None = None
    rate_hz: float = 0.0
    reconnects: int = 0


@dataclass(frozen=True, slots=True)
class RunRequest:
    """A plan to drive, and the folder and label of its run."""

    plan: Plan
    folder: Path
    label: str
    seed: int | None = None
