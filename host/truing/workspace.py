"""Where things lie: the repository, its build results, and the folders that truing writes to.

An installed package has no repository: it carries the image, writes results into `out` in the current folder,
and keeps what can be made again in the user's cache.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from truing.errors import VirtualBoardError

_PACKAGE = Path(__file__).resolve().parent
# Where the wheel's build puts the image (host/hatch_build.py).
_PACKAGED_IMAGE = _PACKAGE / "built" / "truing-f405.elf"


def checkout() -> Path | None:
    """The repository's root: $TRUING_ROOT, or where this package lies; None where it is installed."""
    named = os.environ.get("TRUING_ROOT")
    if named:
        return Path(named)
    beside = _PACKAGE.parents[1]
    return beside if (beside / "CMakePresets.json").is_file() else None


def out_folder() -> Path:
    """Where results go unless the user says otherwise: $TRUING_OUT, or `out` (see above)."""
    named = os.environ.get("TRUING_OUT")
    return Path(named) if named else (checkout() or Path.cwd()) / "out"


def recording_folder(board_id: str | None) -> Path:
    """Where runs of a board go unless the user says otherwise; None: the virtual board."""
    return out_folder() / "recordings" / ("virtual" if board_id is None else f"board-{board_id[-8:]}")


def cache_folder() -> Path:
    """Where things lie that can be made again: in the repository, or a folder of the user's cache."""
    root = checkout()
    return root / ".cache" if root is not None else user_cache() / "truing"


def user_cache() -> Path:
    """The system's place for what a program can make again."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def partial_folder() -> Path:
    """Where unfinished downloads wait to be resumed."""
    return cache_folder() / "partial"


def image_path() -> Path:
    """The image that is flashed, and that virtual boards run: $TRUING_IMAGE, or the build's or wheel's."""
    named = os.environ.get("TRUING_IMAGE")
    root = checkout()
    built = _PACKAGED_IMAGE if root is None else root / "build/stm32f405/firmware/truing-f405.elf"
    path = Path(named) if named else built
    if not path.is_file():
        raise VirtualBoardError(f"{path}: there is no firmware image here", how_to_build())
    return path


def how_to_build() -> str:
    """What a user does who has no image or no native library: the next step of an error."""
    if checkout() is not None:
        return "`./run setup` builds it"
    return "install a wheel that holds it: `./run wheel` in a clone of the repository makes one (README.md)"


def recordings_folder() -> Path | None:
    """Real recordings: $TRUING_RECORDINGS, or `shared/recordings` beside the repository, if there."""
    named = os.environ.get("TRUING_RECORDINGS")
    root = checkout()
    candidates = [Path(named)] if named else [] if root is None else [recordings_beside(root)]
    return next((path for path in candidates if path.is_dir()), None)


def recordings_beside(root: Path) -> Path:
    """Where real recordings are looked for beside a repository."""
    return root.parent / "shared" / "recordings"
