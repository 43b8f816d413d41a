"""The loop of a helper process: requests in, answers out, one line of JSON each."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable
from typing import Any, TypeAlias

import orjson

from truing.errors import TruingError

Answer: TypeAlias = Callable[[dict[str, Any]], dict[str, Any]]


def answer_requests(answer: Answer) -> int:
    """Answer requests until standard input closes; errors are answers too."""
    # Output printed by libraries must not mix with the answers.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    for line in sys.stdin.buffer:
        try:
            content = answer(orjson.loads(line))
        except TruingError as error:
            content = {"error": error.message, "next": error.next_step}
        except Exception as error:
            content = {"error": f"{type(error).__name__}: {error}", "next": ""}
        content["peak_mb"] = _peak_mb()
        answers.write(orjson.dumps(content) + b"\n")
        answers.flush()
    return 0


def _peak_mb() -> float:
    """The largest resident set of this process so far, which it may keep; 0 where that is not known."""
    with contextlib.suppress(ImportError):
        import resource

        unit = 1024.0 * 1024.0 if sys.platform == "darwin" else 1024.0
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
    return 0.0
