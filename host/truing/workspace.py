"""Where things lie: the repository, its build results, and the folders that truing writes to."""

from __future__ import annotations

import os
from pathlib import Path

from truing.errors import VirtualBoardError

_SETUP_NEXT = "`./run setup` builds it"


def root() -> Path:
    """The repository's root: $TRUING_ROOT, or where this package lies."""
    named = os.environ.get("TRUING_ROOT")
    return Path(named) if named else Path(__file__).resolve().parents[2]


def out_folder() -> Path:
    """Where results go unless the user says otherwise: $TRUING_OUT, or `out` in the repository."""
    named = os.environ.get("TRUING_OUT")
    return Path(named) if named else root() / "out"


def recording_folder(board_id: str | None) -> Path:
    """Where runs of a board go unless the user says otherwise; None: the virtual board."""
    return out_folder() / "recordings" / ("virtual" if board_id is None else f"board-{board_id[-8:]}")


def partial_folder() -> Path:
    """Where unfinished downloads wait to be resumed."""
    return root() / ".cache" / "partial"


def image_path() -> Path:
    """The image that is flashed, and that virtual boards run: $TRUING_IMAGE, or the build's."""
    named = os.environ.get("TRUING_IMAGE")
    path = Path(named) if named else root() / "build/stm32f405/firmware/truing-f405.elf"
    if not path.is_file():
        raise VirtualBoardError(f"{path}: there is no firmware image here", _SETUP_NEXT)
    return path


def recordings_folder() -> Path | None:
    """Real recordings: $TRUING_RECORDINGS, or `shared/recordings` beside the repository, if there."""
    named = os.environ.get("TRUING_RECORDINGS")
    candidates = [Path(named)] if named else [root().parent / "shared" / "recordings"]
    return next((path for path in candidates if path.is_dir()), None)
