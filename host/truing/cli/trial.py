"""`truing trial`: a robot with an effect hidden in it, and whether the diagnosis finds it."""

from __future__ import annotations

from pathlib import Path

import click

from truing.cli.app import App, pass_app


@click.command()
@click.option(
    "--effect",
    default="random",
    show_default=True,
    help="What to hide: random, pair, outside, none, or effects by name (two with a comma between).",
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
@click.option("--workers", type=click.IntRange(1), help="Processes of a campaign.  [default: all cores]")
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
    workers: int | None,
    out: Path | None,
) -> None:
    """Hide an effect in a simulated robot, drive it, diagnose the recordings, then look what it was.

    Another process builds the robot. It shows the SHA-256 of its salted answer before anything moves, and
    gives the answer away only after the verdict.

    \b
    Examples:
      truing trial --effect random --seed 7
      truing trial --effect none --seed 3
      truing trial --campaign 100 --seed 1
    """
    from truing.workspace import out_folder

    if campaign is not None:
        _campaign(app, campaign, seed, out or out_folder() / "trials" / f"campaign-{seed}", workers)
        return
    from truing.trial.concealed import run_concealed
    from truing.trial.score import score

    folder = out or out_folder() / "trials" / f"{effect.replace(',', '+')}-{seed}"
    for old in (folder / "runs").glob("*.csv"):
        old.unlink()
    with app.progress("driving") as progress:
        result = run_concealed(
            effect,
            seed,
            folder,
            plans=plans,
            core=core,
            tell=lambda shown: app.say(f"sealed answer, SHA-256: {shown}"),
            progress=progress,
        )
    scored = score(
        effect,
        seed,
        result.verdict,
        result.answer,
        seconds=result.seconds,
        sha256=result.sha256,
        on_board=not core,
    )
    app.emit(
        {"sha256": result.sha256, "verdict": result.verdict, "answer": result.answer, "right": scored.right}
    )
    app.say(f"verdict after {result.seconds:.0f} s: {scored.verdict} {', '.join(scored.said)}".rstrip())
    hidden = ", ".join(
        f"{name} (S = {strength:.2f})" for name, strength in zip(scored.hidden, scored.strengths, strict=True)
    )
    app.say(f"the seal is whole; hidden was: {hidden or 'nothing'}")
    app.say("right" if scored.right else "not right")
    app.say(f"  recordings: {folder}")


def _campaign(app: App, trials: int, seed: int, folder: Path, workers: int | None) -> None:
    from truing.trial.campaign import run_campaign
    from truing.trial.score import to_json, to_markdown

    with app.progress(f"{trials} trials") as progress:
        scores = run_campaign(trials, seed, folder, progress, app.note, workers)
    app.emit(to_json(scores))
    app.say(to_markdown(scores))
    app.say(f"written: {folder / 'results.md'}, {folder / 'results.json'}")
