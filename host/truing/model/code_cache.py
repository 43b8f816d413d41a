"""Where compiled code is kept between processes."""

from __future__ import annotations

import os
import tempfile
from functools import cache
from pathlib import Path

from truing.workspace import user_cache


def code_folder() -> Path:
    """NUMBA_CACHE_DIR where it is set, else a folder in the user's cache; a temporary one if neither can be.

    numba itself keeps machine code in NUMBA_CACHE_DIR, or beside the source that it was made of.
    """
    named = os.environ.get("NUMBA_CACHE_DIR")
    return Path(named) if named else _users_folder()


@cache
def _users_folder() -> Path:
    folder = user_cache() / "truing"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return _temporary_folder()
    return folder if os.access(folder, os.W_OK) else _temporary_folder()


def _temporary_folder() -> Path:
    return Path(_temporary().name)


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    """A folder that ends with this process, which holds it."""
    return tempfile.TemporaryDirectory(prefix="truing_")
