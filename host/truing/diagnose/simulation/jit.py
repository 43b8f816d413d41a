"""Typed doors to numba for the simulation's functions.

None of them may allocate: without numba's reference counts (`_nrt=False`) calls that pass arrays cost half.
`fastmath` stays off: it would change the treatment of denormals for the whole process.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])
_njit: Any = numba.njit
_OPTIONS = {"nogil": True, "error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}


def compiled(function: Function) -> Function:
    """Compile as part of whatever calls it; nothing of its own on disk, since it depends on the effects."""
    return cast(Function, _njit(**_OPTIONS, no_cpython_wrapper=True)(function))


def cached(function: Function) -> Function:
    """Compile for Python to call, and keep the machine code in NUMBA_CACHE_DIR if there is one."""
    return cast(Function, _njit(**_OPTIONS, cache="NUMBA_CACHE_DIR" in os.environ)(function))
