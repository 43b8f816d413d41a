"""Typed doors to numba for the simulation's functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile as part of whatever calls it; nothing of its own on disk, since it depends on the effects."""
    return cast(Function, numba.njit(nogil=True, error_model="numpy")(function))


def cached(function: Function) -> Function:
    """Compile, and keep the machine code in NUMBA_CACHE_DIR.

    `fastmath` stays off: it would change the treatment of denormals for the whole process.
    """
    return cast(Function, numba.njit(nogil=True, error_model="numpy", cache=True)(function))
