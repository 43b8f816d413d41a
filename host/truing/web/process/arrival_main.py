"""Process that checks one file dropped onto a page: the request in, the answer out, as lines of JSON."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path
from typing import Any

from truing.web.process.answers import answer_requests

# The board's thread, the pages and the virtual board have priority.
_NICENESS = 10


def answer(request: dict[str, Any]) -> dict[str, Any]:
    """Needs `name`, `part` (the file), the folders `dropped` and `diagnoses`, and the upload's `query`."""
    from truing.web.runs.arrivals import Wishes, store

    part, dropped, diagnoses = (Path(request[key]) for key in ("part", "dropped", "diagnoses"))
    return store(request["name"], part, dropped, diagnoses, Wishes.of_query(request["query"]))


def main() -> int:
    """Answer requests until standard input closes."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if hasattr(os, "nice"):
        os.nice(_NICENESS)
    _limit_memory()
    return answer_requests(answer)


def _limit_memory() -> None:
    """At most three quarters of the memory that is free: an error, and no machine that swaps."""
    with contextlib.suppress(ImportError, OSError, ValueError, AttributeError):
        import resource

        free = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_AVPHYS_PAGES")
        resource.setrlimit(resource.RLIMIT_DATA, (max(1 << 30, free * 3 // 4), resource.RLIM_INFINITY))


if __name__ == "__main__":
    sys.exit(main())
