"""Many trials in an engine, resumable; sets that got a wrong verdict are kept with the answer beside."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

from truing.fleet.engine import Engine
from truing.progress import Progress
from truing.trial.campaign import Run, run_tasks, write_results
from truing.trial.concealed import TrialResult, run_concealed
from truing.trial.engines import load_engine
from truing.trial.engines.asked import EngineAsked
from truing.trial.engines.order import EngineTask, engine_tasks
from truing.trial.engines.proof import to_json, to_markdown
from truing.trial.engines.scoring import score
from truing.trial.score import Score

# Below this line a page holds what other commands proved.
OTHER_PROOF = "<!-- Below: other proof, which this command leaves as it stands. -->"


def run_engine_campaign(
    engine_name: str,
    trials: int,
    seed: int,
    folder: Path,
    progress: Progress,
    note: Callable[[str], None],
    *,
    engine: Engine | None = None,
    minutes: float | None = None,
    table: Path | None = None,
    run: Run[EngineTask] | None = None,
) -> list[Score]:
    """Run the trials that `folder` does not hold yet, and write results.json and results.md there.

    Parameters
    ----------
    engine : where the trials run; a process for each core where None.
    minutes : no trial begins after so many minutes.
    table : the page goes here too.
    run : another way to run a trial than the product's.
    """
    physics = load_engine(engine_name)
    wanted = engine_tasks(physics, trials, seed)
    scores = run_tasks(wanted, folder, progress, note, run or run_one, engine=engine, minutes=minutes)
    page = to_markdown(physics, scores, trials=trials, seed=seed, table=str(table or "PROOF.md"))
    if table is not None:
        page += other_proof(table)
    write_results(folder, json.dumps(to_json(scores), indent=1), page, table)
    return scores


def other_proof(table: Path) -> str:
    """The sections of a page that other commands write below this one's; they stay."""
    text = table.read_text(encoding="utf-8") if table.exists() else ""
    _, found, below = text.partition(f"\n{OTHER_PROOF}\n")
    return f"\n{OTHER_PROOF}\n{below}" if found else ""


def run_one(each: EngineTask, folder: Path) -> Score:
    """Run and score one trial of a campaign; its recordings stay where the verdict was not right."""
    name = f"{each.effect}-{each.seed}"
    place = folder / "sets" / name
    shutil.rmtree(place, ignore_errors=True)
    asked = EngineAsked(
        each.effect, each.seed, weak=each.weak, engine=each.engine, mode=each.mode, rate_hz=each.rate_hz
    )
    try:
        result = run_concealed(asked, place / "set")
        scored = score(asked, result)
        if not scored.right or scored.confidently_wrong:
            keep(result, place, folder / "not_right" / name)
        return scored
    finally:
        shutil.rmtree(place, ignore_errors=True)


def keep(result: TrialResult, place: Path, kept: Path) -> None:
    """Move a trial's recordings, and write the answer and the verdict beside them."""
    shutil.rmtree(kept, ignore_errors=True)
    kept.parent.mkdir(parents=True, exist_ok=True)
    shutil.move(place, kept)
    (kept / "answer.json").write_text(json.dumps(result.answer, indent=1) + "\n", encoding="utf-8")
    verdict = json.dumps(result.first.diagnosis.to_json(), indent=1)
    (kept / "verdict.json").write_text(verdict + "\n", encoding="utf-8")
