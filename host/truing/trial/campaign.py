"""Many concealed trials on all cores; each result is a line of a file, so that a campaign can go on later."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from truing.errors import TruingError
from truing.fleet.engine import Engine, ProcessPool
from truing.progress import Progress
from truing.recording.writer import replace_file
from truing.trial.concealed import Asked, TrialResult, run_concealed
from truing.trial.order import Block, Task, tasks
from truing.trial.results import to_json, to_markdown
from truing.trial.score import (
    IN_CATALOGUE,
    OUT_OF_CATALOGUE,
    Score,
    judge,
    judge_method,
    place_right,
    resolved,
)

if TYPE_CHECKING:
    from truing.diagnose.result import Diagnosis

MAX_MORE_RUNS = 2
TaskT = TypeVar("TaskT", bound=Task)
Run = Callable[[TaskT, Path], Score]


def run_campaign(
    trials: int,
    seed: int,
    folder: Path,
    progress: Progress,
    note: Callable[[str], None],
    *,
    engine: Engine | None = None,
    block: Block = "main",
    minutes: float | None = None,
    table: Path | None = None,
    run: Run[Task] | None = None,
) -> list[Score]:
    """Run the trials that `folder` does not hold yet, and write results.json and results.md there.

    Parameters
    ----------
    engine : where the trials run; a process for each core where None.
    minutes : no trial begins after so many minutes.
    table : the page goes here too.
    run : another way to run a trial than the product's.
    """
    wanted = tasks(trials, seed, block)
    scores = run_tasks(wanted, folder, progress, note, run or run_one, engine=engine, minutes=minutes)
    page = to_markdown(scores, trials=trials, seed=seed, block=block)
    write_results(folder, json.dumps(to_json(scores), indent=1), page, table)
    return scores


def run_tasks(
    wanted: Sequence[TaskT],
    folder: Path,
    progress: Progress,
    note: Callable[[str], None],
    run: Run[TaskT],
    *,
    engine: Engine | None = None,
    minutes: float | None = None,
) -> list[Score]:
    """Run the tasks that `folder` does not hold yet; return the scores of all that it holds then."""
    folder.mkdir(parents=True, exist_ok=True)
    store = folder / "trials.jsonl"
    done = read_scores(store)
    todo = [each for each in wanted if (each.effect, each.seed) not in done]
    began = time.monotonic()
    finished = len(wanted) - len(todo)
    progress(finished / len(wanted))

    def in_time() -> Iterator[TaskT]:
        for each in todo:
            if minutes is not None and time.monotonic() - began > 60.0 * minutes:
                return
            yield each

    task = partial(_run_in, run, folder.resolve())
    for ended in (engine or ProcessPool()).run(task, in_time()):
        finished += 1
        progress(finished / len(wanted))
        try:
            result = ended.value()
        except TruingError as error:
            note(f"trial {ended.item.effect}/{ended.item.seed}: {error.message}")
            continue
        done[result.effect, result.seed] = result
        with store.open("a", encoding="utf-8") as file:
            file.write(json.dumps(result.to_json()) + "\n")
    return [done[each.effect, each.seed] for each in wanted if (each.effect, each.seed) in done]


def _run_in(run: Run[TaskT], folder: Path, each: TaskT) -> Score:
    """Run a trial in the campaign's folder; in this order a process gets it as one argument."""
    return run(each, folder)


def write_results(folder: Path, results: str, page: str, table: Path | None) -> None:
    """Write results.json and results.md, and the page to `table` too."""
    replace_file(folder / "results.json", (results + "\n").encode())
    for path in (folder / "results.md", table):
        if path is not None:
            replace_file(path, page.encode())


def run_one(each: Task, folder: Path) -> Score:
    """Run and score one trial of a campaign."""
    place = folder / "sets" / f"{each.effect}-{each.seed}"
    shutil.rmtree(place, ignore_errors=True)
    asked = Asked(
        each.effect,
        each.seed,
        weak=each.weak,
        core=not each.on_board,
        more_runs=MAX_MORE_RUNS,
        judged=place / "judged",
    )
    try:
        result = run_concealed(asked, place / "set")
        return score(asked, result, place)
    finally:
        shutil.rmtree(place, ignore_errors=True)


def score(asked: Asked, result: TrialResult, place: Path) -> Score:
    """Hold a trial's result against its opened answer, its judging runs and the truth.

    Parameters
    ----------
    place : holds `set`, and `judged` with the judging runs that the board let end, if any.
    """
    plain = verdict_score(asked, result, on_board=not asked.core)
    answer, first, hidden = result.answer, result.first.diagnosis, plain.hidden
    later = [(one.diagnosis.verdict, names_of(one.diagnosis)) for one in result.more]
    is_ambiguous = first.verdict == "ambiguous" and plain.named and plain.family in IN_CATALOGUE
    began = time.process_time()
    measured, methods = {}, {}
    if asked.judged is not None and any(asked.judged.glob("runs/*.csv")):
        # Loaded here, so that a trial without judging runs does without.
        from truing.trial.measure import measure
        from truing.trial.true_model import TrueModel

        figures = measure(TrueModel(place / "set", asked.judged, len(first.runs), answer), first)
        measured = asdict(figures)
        methods = {name: judge_method(said, plain.family, hidden) for name, said in figures.opinions.items()}
    return replace(
        plain,
        place_right=place_right(measured) if measured and plain.family in OUT_OF_CATALOGUE else None,
        later=tuple(f"{kind}: {', '.join(said)}" for kind, said in later),
        resolved=(bool(later) and resolved(later, hidden)) if is_ambiguous and asked.more_runs else None,
        scoring_cpu_s=time.process_time() - began,
        measured=measured,
        methods=methods,
    )


def verdict_score(asked: Asked, result: TrialResult, *, on_board: bool) -> Score:
    """Hold the first verdict against the opened answer, by its names alone."""
    answer, first = result.answer, result.first.diagnosis
    hidden = tuple(str(each["name"]) for each in answer["effects"])
    family, said = str(answer["family"]), names_of(first)
    worth = judge(first.verdict, said, family, hidden, sure_names_of(first))
    return Score(
        effect=asked.effect,
        seed=asked.seed,
        weak=asked.weak,
        family=family,
        hidden=hidden,
        strengths=tuple(float(each["strength"]) for each in answer["effects"]),
        driving=str(answer["driving"]),
        on_board=on_board,
        verdict=first.verdict,
        said=said,
        named=worth.named,
        named_alone=worth.named_alone,
        confidently_wrong=worth.confidently_wrong,
        right=worth.right,
        place_right=None,
        later=(),
        resolved=None,
        seconds=result.first.seconds,
        cpu_s=result.first.cpu_s,
        building_cpu_s=result.building_cpu_s,
        scoring_cpu_s=0.0,
        sha256=result.sha256,
        confidences=confidences_of(first),
    )


def names_of(diagnosis: Diagnosis) -> tuple[str, ...]:
    """The effects that a verdict names."""
    return tuple(dict.fromkeys(effect.name for effect in diagnosis.effects))


def confidences_of(diagnosis: Diagnosis) -> dict[str, float]:
    """Stated confidence in each effect that a verdict names, 0 to 1; the larger of both wheels."""
    out: dict[str, float] = {}
    for effect in diagnosis.effects:
        out[effect.name] = max(float(effect.confidence), out.get(effect.name, 0.0))
    return out


def sure_names_of(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Of the effects that a verdict names, those without an alternative."""
    sure = (effect.name for effect in diagnosis.effects if not effect.indistinguishable_from)
    return tuple(dict.fromkeys(sure))


def read_scores(store: Path) -> dict[tuple[str, int], Score]:
    """The trials that a campaign's file holds."""
    done: dict[tuple[str, int], Score] = {}
    if not store.exists():
        return done
    for line in store.read_text(encoding="utf-8").splitlines():
        try:
            one = Score.from_json(json.loads(line))
        except json.JSONDecodeError:
            continue  # the line that was being written when the campaign was stopped
        done[one.effect, one.seed] = one
    return done
