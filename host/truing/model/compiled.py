"""Typed decorators for the functions that numba compiles.

`fastmath` stays off: it would change the treatment of denormals for the whole process.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])
_njit: Any = numba.njit
# Without numba's reference counts (`_nrt=False`) calls that pass arrays cost half; nothing may be allocated.
_PLAIN = {"nogil": True, "error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}


def compiled(function: Function) -> Function:
    """Compile on first call, keep the machine code (`code_cache`), release the GIL; it may allocate."""
    return cast(Function, _njit(cache=True, nogil=True, error_model="numpy")(function))


def cached(function: Function) -> Function:
    """The same for what does not allocate."""
    return cast(Function, _njit(**_PLAIN, cache=True)(function))


def part(function: Function) -> Function:
    """Compile as part of whatever calls it, with nothing of its own on disk; it may not allocate."""
    return cast(Function, _njit(**_PLAIN, no_cpython_wrapper=True)(function))
