"""One typed decorator for the functions that numba compiles; their machine code is cached on disk."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile on first call, cache in NUMBA_CACHE_DIR, release the GIL.

    `fastmath` stays off: it would change the treatment of denormals for the whole process.
    """
    return cast(Function, numba.njit(cache=True, nogil=True, error_model="numpy")(function))
