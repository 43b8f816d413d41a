"""Typed decorators for the functions that numba compiles.

`fastmath` stays off: it would change the treatment of denormals for the whole process.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

from truing.model.code_cache import code_folder

Function = TypeVar("Function", bound=Callable[..., Any])
_njit: Any = numba.njit
# Without numba's reference counts (`_nrt=False`) calls that pass arrays cost half; nothing may be allocated.
_PLAIN = {"nogil": True, "error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}


def compiled(function: Function) -> Function:
    """Compile on first call, keep the machine code (`code_cache`), release the GIL; it may allocate."""
    return _kept(function, nogil=True, error_model="numpy")


def cached(function: Function) -> Function:
    """The same for what does not allocate."""
    return _kept(function, **_PLAIN)


def part(function: Function) -> Function:
    """Compile as part of whatever calls it, with nothing of its own on disk; it may not allocate."""
    return cast(Function, _njit(**_PLAIN, no_cpython_wrapper=True)(function))


def _kept(function: Function, **options: Any) -> Function:
    """Compile, and keep the machine code in our folder; the place of a user's own functions stays.

    numba reads the place when it decorates a function, and writes beside the source where there is none.
    """
    settings: Any = numba.config
    before = settings.CACHE_DIR
    settings.CACHE_DIR = str(code_folder())
    try:
        return cast(Function, _njit(**options, cache=True)(function))
    finally:
        settings.CACHE_DIR = before
