"""`truing trial --engine`: the same in a robot that a physics engine simulates."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App

if TYPE_CHECKING:
    from truing.trial.engines.driving import Mode


def refuse_board_options(*, plans: tuple[str, ...], core: bool, block: str) -> None:
    """Refuse what only a trial on the virtual board has."""
    if plans or core or block != "main":
        raise click.UsageError("--runs, --core and --block do not go with --engine.")


def engine_trial(
    app: App,
    engine: str,
    effect: str,
    seed: int,
    out: Path | None,
    *,
    weak: bool | None,
    mode: Mode | None,
    rate_hz: int | None,
) -> None:
    """Run one trial, and say what came of it."""
    from truing.trial.concealed import run_concealed
    from truing.trial.engines import load_engine
    from truing.trial.engines.asked import EngineAsked
    from truing.trial.engines.scoring import score
    from truing.workspace import out_folder

    load_engine(engine)
    folder = out or out_folder() / "trials" / f"{engine}-{effect.replace(',', '+')}-{seed}"
    for old in folder.glob("set/runs/*.csv"):
        old.unlink()
    asked = EngineAsked(effect, seed, weak=weak, engine=engine, mode=mode, rate_hz=rate_hz)
    with app.progress("driving") as progress:
        result = run_concealed(
            asked,
            folder / "set",
            tell=lambda shown: app.say(f"sealed answer, SHA-256: {shown}"),
            progress=progress,
        )
    scored = score(asked, result)
    app.emit(
        {
            "sha256": result.sha256,
            "verdict": result.first.diagnosis.to_json(),
            "answer": result.answer,
            "right": scored.right,
            "measured": scored.measured,
        }
    )
    app.say(f"verdict after {scored.seconds:.0f} s: {scored.verdict} {', '.join(scored.said)}".rstrip())
    hidden = [
        f"{each['means']}, {each['name']} (S = {each['strength']:.2f})" for each in result.answer["effects"]
    ]
    hidden += [f"{each['means']}, which the baseline's form follows" for each in result.answer["inside_form"]]
    told = "; ".join(hidden) or "nothing"
    app.say(f"the seal is intact; concealed in {result.answer['engine']} was: {told}")
    for name, entry in scored.measured["parameters"].items():
        app.say(f"  {name}: {entry['found']:.4g}, given {entry['expected']:.4g}")
    app.say("right" if scored.right else "not right")
    app.say(
        f"  without it a first-order model leaves {1e3 * scored.measured['healthy_mps']:.2f} mm/s "
        f"({100.0 * scored.measured['healthy_share']:.3f} % of full speed); driven: {scored.driving}"
    )
    app.say(f"  recordings: {folder / 'set'}")


def engine_campaign(
    app: App,
    engine: str,
    trials: int,
    seed: int,
    out: Path | None,
    *,
    jobs: int | None,
    scheduler: str | None,
    minutes: float | None,
    table: Path | None,
) -> None:
    """Run many, and print their page."""
    from truing.fleet.engine import open_engine
    from truing.trial.engines.campaign import run_engine_campaign
    from truing.trial.engines.proof import to_json
    from truing.workspace import out_folder

    folder = out or out_folder() / "trials" / f"{engine}-campaign-{seed}"
    with open_engine(jobs, scheduler) as cluster, app.progress(f"{trials} trials") as progress:
        scores = run_engine_campaign(
            engine, trials, seed, folder, progress, app.note, engine=cluster, minutes=minutes, table=table
        )
    app.emit(to_json(scores))
    app.say((folder / "results.md").read_text(encoding="utf-8"))
    app.say(f"written: {folder / 'results.md'}, {folder / 'results.json'}")
