"""Process that reads and simulates runs: requests in, answers out, one line of JSON each.

In the view's own process, fitting and compiling would block the event loop and delay a stop command.
"""

from __future__ import annotations

import sys
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truing.errors import FileError
from truing.web.process.answers import answer_requests

if TYPE_CHECKING:
    from truing.recording.run import Run
    from truing.web.process.run_cache import RunCache


def answer(request: dict[str, Any]) -> dict[str, Any]:
    """Page content of a run (`compare` with its simulations, `analyse`, `csv`) or of control inputs
    (`replay`); a model as a file (`export`); feedforward from runs (`tuning_plans`,
    `learn`, `track`).
    """
    kinds = {
        "compare": _compare,
        "analyse": _analyse,
        "csv": _csv,
        "replay": _replay,
        "export": _export,
        "tuning_plans": _tuning_plans,
        "learn": _learn,
        "track": _track,
    }
    return kinds[request["kind"]](request)


def _compare(request: dict[str, Any]) -> dict[str, Any]:
    """Needs `run` and `more` (paths), `model` (`ModelChoice.to_json`), `start` (x, y, theta); `csv`."""
    from truing.web.models.comparison import Comparison, compare
    from truing.web.models.error_model import ModelChoice
    from truing.web.pose import Pose
    from truing.web.runs.library import baseline_of, plan_of_run
    from truing.web.views.comparison import comparison_content, comparison_csv

    start = Pose(*request["start"])
    found: list[Comparison] = []
    for name in (request["run"], *request["more"]):
        path = Path(name)
        run = _read(path)
        model = ModelChoice.of_json(request["model"]) if not found else None
        set_runs = partial(_set_of, path)
        found.append(compare(run, baseline_of(path), plan_of_run(run), model, start, set_runs=set_runs))
    if request.get("csv"):
        return {"text": comparison_csv(found[0])}
    return comparison_content(found[0], found[1:])


def _read(path: Path) -> Run:
    """A run from disk, cached while the file is unchanged."""
    try:
        return _runs().read(path)
    except OSError as error:
        raise FileError(path, f"cannot be read: {error.strerror}", "press Rescan") from None


@lru_cache(maxsize=1)
def _runs() -> RunCache:
    from truing.web.process.run_cache import RunCache

    return RunCache()


def _set_of(path: Path) -> list[Run]:
    return [_read(one) for one in sorted(path.parent.glob("*.csv"))]


def _analyse(request: dict[str, Any]) -> dict[str, Any]:
    """Needs `run`, the `signals` to draw, the `span` of the statistics, `marks`."""
    from truing.web.runs.library import baseline_of
    from truing.web.views.analysis import analysis_content

    path = Path(request["run"])
    return analysis_content(
        _read(path),
        baseline_of(path),
        request["signals"],
        _span(request),
        marks=[(float(first), float(last)) for first, last in request.get("marks", [])],
    )


def _csv(request: dict[str, Any]) -> dict[str, Any]:
    """Needs `run`, `signals` and `span`."""
    from truing.web.runs.library import baseline_of
    from truing.web.views.analysis import csv_text

    path = Path(request["run"])
    return {"text": csv_text(_read(path), baseline_of(path), request["signals"], _span(request))}


def _replay(request: dict[str, Any]) -> dict[str, Any]:
    """Needs `cycles` (v, omega, seconds), the `robot` (`known_robot`), the `model` and the `start`."""
    from truing.web.models.error_model import ModelChoice
    from truing.web.models.error_replay import thinned
    from truing.web.models.known_robot import robot_of
    from truing.web.models.plan_rollout import plan_rollout
    from truing.web.path.trajectory import Cycle
    from truing.web.pose import Pose

    known = robot_of(request["robot"])
    robot = ModelChoice.of_json(request["model"]).applied(known)
    cycles = [Cycle(*cycle) for cycle in request["cycles"]]
    return {"path": thinned(plan_rollout(cycles, known, robot, Pose(*request["start"])))}


def _export(request: dict[str, Any]) -> dict[str, Any]:
    """Needs `model` (path), `to` (kind) and `folder`."""
    from truing.web.process.export import export

    return export(Path(request["model"]), request["to"], Path(request["folder"]))


def _tuning_plans(_request: dict[str, Any]) -> dict[str, Any]:
    from truing.identify.feedforward import learning_plan, proof_plan

    plans = {plan.name: plan.to_dict() for plan in (proof_plan(), learning_plan())}
    for content in plans.values():
        content.pop("name", None)
    return {"plans": list(plans.items())}


def _learn(request: dict[str, Any]) -> dict[str, Any]:
    """Needs `run` (path) of the learning plan."""
    from truing.identify.feedforward import learn

    return {"parameters": learn(_read(Path(request["run"])))}


def _track(request: dict[str, Any]) -> dict[str, Any]:
    """Needs `run` (path) of the proof plan, and the board's `parameters`."""
    from truing.identify.feedforward import tracking

    return {"both_mps": tracking(_read(Path(request["run"])), request["parameters"]).both_mps}


def _span(request: dict[str, Any]) -> tuple[float, float] | None:
    span = request["span"]
    return None if span is None else (float(span[0]), float(span[1]))


def main() -> int:
    """Answer requests until standard input closes."""
    return answer_requests(answer)


if __name__ == "__main__":
    sys.exit(main())
