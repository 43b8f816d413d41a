"""`truing trial`: a robot with an effect concealed in it, and whether the diagnosis finds it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App, pass_app
from truing.cli.trial_engine import engine_campaign, engine_trial, refuse_board_options
from truing.trial.engines import ENGINES

if TYPE_CHECKING:
    from truing.trial.engines.driving import Mode
    from truing.trial.order import Block


@click.command()
@click.option(
    "--effect",
    default="random",
    show_default=True,
    help="What to conceal: random, pair, several, outside, intermittent, none, or effects by name, with "
    "commas between. In an engine: random, pair, outside, form, none, or the engine's names.",
)
@click.option(
    "--seed", type=click.IntRange(0), default=1, show_default=True, help="Decides all that is drawn."
)
@click.option(
    "--runs", "plans", multiple=True, metavar="PLAN", help="Drive this plan; more than once for more runs."
)
@click.option(
    "--core", is_flag=True, help="Run the controller's core alone instead of the flashed image: faster."
)
@click.option(
    "--campaign", type=click.IntRange(1), metavar="N", help="Run N trials on all cores; can be resumed."
)
@click.option(
    "--jobs",
    "--workers",
    "jobs",
    type=click.IntRange(1),
    help="Processes of a campaign.  [default: all cores]",
)
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Run a campaign on this Dask cluster, whose workers share the folder, tcp://HOST:8786.  [default: "
    "an embedded one, or without the extra [fleet] a pool]",
)
@click.option(
    "--strength", type=click.Choice(["weak", "full"]), help="S below 1, or 1 and more.  [default: drawn]"
)
@click.option(
    "--block",
    type=click.Choice(["main", "last", "several", "intermittent", "backlash"]),
    default="main",
    show_default=True,
    help="Trials of a campaign: seeds of `last` are for one evaluation, after all tuning; `several` conceals "
    "three and four effects at once, `intermittent` what no catalogue has and acts for some time only, "
    "`backlash` gear backlash.",
)
@click.option(
    "--minutes", type=click.FloatRange(0.0), help="A campaign begins no trial after so many minutes."
)
@click.option(
    "--table",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write a campaign's page to this file too.",
)
@click.option(
    "--engine",
    type=click.Choice(ENGINES),
    help="Conceal it in a robot that this physics engine simulates, with the engine's own means.",
)
@click.option(
    "--mode",
    type=click.Choice(["effort", "velocity", "mixed"]),
    help="With --engine: driven so.  [default: drawn]",
)
@click.option(
    "--rate", type=click.Choice(["20", "50", "200"]), help="With --engine: rows a second.  [default: drawn]"
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for recordings and results.  [default: out/trials/...]",
)
@pass_app
def command(
    app: App,
    effect: str,
    seed: int,
    plans: tuple[str, ...],
    core: bool,
    campaign: int | None,
    jobs: int | None,
    scheduler: str | None,
    strength: str | None,
    block: Block,
    minutes: float | None,
    table: Path | None,
    engine: str | None,
    mode: Mode | None,
    rate: str | None,
    out: Path | None,
) -> None:
    """Conceal an effect in a simulated robot, drive it, diagnose the recordings, then open the sealed answer.

    Another process builds the robot. It shows the SHA-256 of its salted answer before anything moves, and
    gives the answer away only after the verdict.

    \b
    Examples:
      truing trial --effect random --seed 7
      truing trial --effect none --seed 3
      truing trial --campaign 100 --seed 1
      truing trial --engine mujoco --effect joint_friction --mode effort --rate 50
      truing trial --engine mujoco --campaign 60 --seed 1
    """
    weak = None if strength is None else strength == "weak"
    if scheduler is not None and (campaign is None or jobs is not None):
        raise click.UsageError("--scheduler goes with --campaign, and without --jobs: a cluster has its own.")
    if engine is not None:
        refuse_board_options(plans=plans, core=core, block=block)
        if campaign is not None:
            engine_campaign(
                app, engine, campaign, seed, out, jobs=jobs, scheduler=scheduler, minutes=minutes, table=table
            )
        else:
            rate_hz = None if rate is None else int(rate)
            engine_trial(app, engine, effect, seed, out, weak=weak, mode=mode, rate_hz=rate_hz)
        return
    if mode is not None or rate is not None:
        raise click.UsageError("--mode and --rate go with --engine.")
    from truing.virtual.board import require_virtual_board
    from truing.workspace import out_folder

    require_virtual_board()
    if campaign is not None:
        folder = out or out_folder() / "trials" / f"campaign-{seed}{'' if block == 'main' else f'-{block}'}"
        _campaign(
            app, campaign, seed, folder,
            jobs=jobs, scheduler=scheduler, block=block, minutes=minutes, table=table,
        )  # fmt: skip
        return
    from truing.trial.campaign import score
    from truing.trial.concealed import Asked, run_concealed

    folder = out or out_folder() / "trials" / f"{effect.replace(',', '+')}-{seed}"
    for old in folder.glob("*/runs/*.csv"):
        old.unlink()
    asked = Asked(effect, seed, plans=plans, weak=weak, core=core, judged=folder / "judged")
    with app.progress("driving") as progress:
        result = run_concealed(
            asked,
            folder / "set",
            tell=lambda shown: app.say(f"sealed answer, SHA-256: {shown}"),
            progress=progress,
        )
    verdict = result.first.diagnosis.to_json()
    scored = score(asked, result, folder)
    app.emit(
        {
            "sha256": result.sha256,
            "verdict": verdict,
            "answer": result.answer,
            "right": scored.right,
            "measured": scored.measured,
        }
    )
    app.say(f"verdict after {scored.seconds:.0f} s: {scored.verdict} {', '.join(scored.said)}".rstrip())
    hidden = ", ".join(
        f"{name} (S = {size:.2f})" for name, size in zip(scored.hidden, scored.strengths, strict=True)
    )
    app.say(f"the seal is intact; concealed was: {hidden or 'nothing'}")
    app.say("right" if scored.right else "not right")
    app.say(f"  recordings: {folder / 'set'}; judging runs and truth: {folder / 'judged'}")


def _campaign(
    app: App,
    trials: int,
    seed: int,
    folder: Path,
    *,
    jobs: int | None,
    scheduler: str | None,
    block: Block,
    minutes: float | None,
    table: Path | None,
) -> None:
    from truing.fleet.engine import open_engine
    from truing.trial.campaign import run_campaign
    from truing.trial.results import to_json

    with open_engine(jobs, scheduler) as engine, app.progress(f"{trials} trials") as progress:
        scores = run_campaign(
            trials, seed, folder, progress, app.note, engine=engine, block=block, minutes=minutes, table=table
        )
    app.emit(to_json(scores))
    app.say((folder / "results.md").read_text(encoding="utf-8"))
    app.say(f"written: {folder / 'results.md'}, {folder / 'results.json'}")
