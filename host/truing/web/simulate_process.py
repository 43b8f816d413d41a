"""A process beside the view that reads and simulates runs: requests in, answers out, a line of JSON each.

Fitting and compiling would hold the view's own process, and with it the robot's brakes.
"""

from __future__ import annotations

import os
import sys
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import orjson

from truing.errors import TruingError

if TYPE_CHECKING:
    from truing.recording import Run


def answer(request: dict[str, Any]) -> dict[str, Any]:
    """What a page shows of a run: `compare` it with its simulations, `analyse` it, or write its `csv`; or of
    control inputs: `replay` them.
    """
    kinds = {"compare": _compared, "analyse": _analysed, "csv": _csv, "replay": _replayed}
    return kinds[request["kind"]](request)


def _compared(request: dict[str, Any]) -> dict[str, Any]:
    """Of `run` and `more` (paths), `model` (`ModelChoice.to_json`), `start` (x, y, theta)."""
    from truing.web.comparison import Comparison, compare
    from truing.web.comparison_view import shown
    from truing.web.error_model import ModelChoice
    from truing.web.pose import Pose
    from truing.web.run_library import baseline_of, plan_of_run

    start = Pose(*request["start"])
    found: list[Comparison] = []
    for name in (request["run"], *request["more"]):
        path = Path(name)
        run = _read(path)
        model = ModelChoice.of_json(request["model"]) if not found else None
        beside = partial(_set_of, path)
        found.append(compare(run, baseline_of(path), plan_of_run(run), model, start, whole=beside))
    return shown(found[0], found[1:])


def _read(path: Path) -> Run:
    """A run from disk; while a slider moves the file stays the same."""
    at = path.stat()
    return _read_version(path, at.st_mtime_ns, at.st_size)


@lru_cache(maxsize=64)
def _read_version(path: Path, _changed_ns: int, _size: int) -> Run:
    from truing.recording_reader import read_run

    return read_run(path)


def _set_of(path: Path) -> list[Run]:
    return [_read(one) for one in sorted(path.parent.glob("*.csv"))]


def _analysed(request: dict[str, Any]) -> dict[str, Any]:
    """Of `run`, the `signals` to draw, the `span` of the statistics, `linked` and `select`."""
    from truing.web.analysis_view import analysed
    from truing.web.run_library import baseline_of

    path = Path(request["run"])
    return analysed(
        _read(path),
        baseline_of(path),
        request["signals"],
        _span(request),
        linked=request["linked"],
        select=request["select"],
    )


def _csv(request: dict[str, Any]) -> dict[str, Any]:
    """Of `run`, `signals` and `span`."""
    from truing.web.analysis_view import csv_text
    from truing.web.run_library import baseline_of

    path = Path(request["run"])
    return {"text": csv_text(_read(path), baseline_of(path), request["signals"], _span(request))}


def _replayed(request: dict[str, Any]) -> dict[str, Any]:
    """Of `cycles` (v, omega, seconds), the `robot` (`known_robot`), the `model` and the `start`."""
    from truing.web.error_model import ModelChoice
    from truing.web.error_replay import thinned
    from truing.web.known_robot import robot_of
    from truing.web.plan_rollout import plan_rollout
    from truing.web.pose import Pose
    from truing.web.trajectory import Cycle

    known = robot_of(request["robot"])
    robot = ModelChoice.of_json(request["model"]).applied(known)
    cycles = [Cycle(*cycle) for cycle in request["cycles"]]
    return {"path": thinned(plan_rollout(cycles, known, robot, Pose(*request["start"])))}


def _span(request: dict[str, Any]) -> tuple[float, float] | None:
    span = request["span"]
    return None if span is None else (float(span[0]), float(span[1]))


def main() -> int:
    """Answer until the view is gone."""
    # What a library prints must not get between the answers.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    for line in sys.stdin.buffer:
        try:
            content = answer(orjson.loads(line))
        except TruingError as error:
            content = {"error": error.message, "next": error.next_step}
        except Exception as error:
            content = {"error": f"{type(error).__name__}: {error}", "next": ""}
        answers.write(orjson.dumps(content) + b"\n")
        answers.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
