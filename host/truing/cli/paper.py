"""`truing paper`: the paper's tests I to XVII, beside its Tables III and IV."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from truing.cli.app import App
from truing.cli.options import board_options

if TYPE_CHECKING:
    from rich.table import Table

    from truing.paper_tests import LevelComparison


@click.command()
@click.option(
    "--set",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    help="Recording set to add the 17 runs to.  [default: out/paper, written afresh]",
)
@click.option("--yes", is_flag=True, help="Do not ask before a real robot moves.")
@board_options
def command(app: App, folder: Path | None, yes: bool) -> None:
    """Drive tests I to XVII of Bakirci 2023 one after the other; print Tables III and IV beside the paper's.

    \b
    Examples:
      truing paper
      truing paper --seed 7 --json
    """
    import shutil

    from truing.cli.driving import drive_on, warn_and_ask
    from truing.identify.identification import identify_set
    from truing.paper_tests import PAPER_TESTS, compare, gain_errors, tau_to_zero_s
    from truing.plan import load_plan
    from truing.recording_reader import read_recording_set
    from truing.workspace import out_folder

    if folder is None:
        folder = out_folder() / "paper"
        shutil.rmtree(folder, ignore_errors=True)
    paths = []
    with app.open_device(lasting=False) as device:
        parameters = device.parameters()
        with app.progress("tests I to XVII") as progress:
            for number, test in enumerate(PAPER_TESTS):
                plan = load_plan(test.plan)
                if not app.is_virtual:
                    warn_and_ask(app, device, parameters, plan, ask=not yes)
                saved = drive_on(app, device, parameters, plan, folder, test.name, quiet=True)
                paths.append(saved.path)
                progress((number + 1) / len(PAPER_TESTS))
    recordings = read_recording_set(folder)
    with app.progress("identifying") as progress:
        result = identify_set(recordings, progress)
    runs = {run.name: run for run in result.runs}
    compared, endings = [], {}
    for test, path in zip(PAPER_TESTS, paths, strict=True):
        compared += compare(test, runs[path.stem])
        endings[test.name] = tau_to_zero_s(test, runs[path.stem])
    effort = gain_errors([c for c in compared if c.test.is_effort])
    velocity = gain_errors([c for c in compared if not c.test.is_effort])
    app.emit(
        {
            "levels": [
                {
                    "test": c.test.name,
                    "mode": c.test.mode,
                    "input": c.paper.input,
                    "gain": c.gain,
                    "gain_paper": c.paper.gain,
                    "tau_s": c.tau_s,
                    "tau_paper_s": c.paper.tau_s,
                }
                for c in compared
            ],
            "tau_to_zero_s": endings,
            "effort_gain_error": {"mean": effort.mean, "worst": effort.worst, "worst_at": effort.worst_level},
            "velocity_gain_error": {"mean": velocity.mean, "worst": velocity.worst},
            "runs": [str(path) for path in paths],
        }
    )
    app.show(_table_iii([c for c in compared if c.test.table == "III"], endings))
    app.show(_table_iv([c for c in compared if c.test.table == "IV"]))
    app.say(
        f"Effort mode, {effort.count} gains: {effort.mean:.2%} from the paper's on average, "
        f"{effort.worst:.2%} at worst (test {effort.worst_level})."
    )
    gains = [c.gain for c in compared if not c.test.is_effort and c.gain is not None]
    app.say(
        f"Velocity mode, {velocity.count} gains: {min(gains, default=0):.2f} to {max(gains, default=0):.2f} "
        "here, where the paper reads 1.01 to 1.08. The controller's integral action\nleaves no steady error "
        "against its own encoders; the paper does not say where its excess comes from, and the\ncontroller "
        "is not bent to match it."
    )
    app.say(f"Gains in mm/s per % of effort, or m/s per m/s; time constants in s. The runs: {folder}")


def _table_iii(levels: Sequence[LevelComparison], endings: dict[str, float | None]) -> Table:
    from rich.table import Table

    table = Table(title="Table III: one wheel, beside the paper", title_justify="left")
    for name in ("test", "mode"):
        table.add_column(name)
    for name in ("input", "gain", "paper", "error", "τ from 0", "paper", "τ to 0", "paper"):
        table.add_column(name, justify="right")
    for c in levels:
        table.add_row(
            c.test.name,
            c.test.mode,
            *_numbers(c),
            _seconds(endings[c.test.name]),
            _seconds(c.test.tau_to_zero_s),
        )
    return table


def _table_iv(levels: Sequence[LevelComparison]) -> Table:
    from rich.table import Table

    table = Table(title="Table IV: both wheels, beside the paper", title_justify="left")
    for name in ("test", "mode"):
        table.add_column(name)
    for name in ("input", "gain", "paper", "error", "τ", "paper"):
        table.add_column(name, justify="right")
    previous = ""
    for c in levels:
        if previous and c.test.name != previous:
            table.add_section()
        table.add_row("" if c.test.name == previous else c.test.name, c.test.mode, *_numbers(c))
        previous = c.test.name
    return table


def _numbers(c: LevelComparison) -> tuple[str, ...]:
    digits = 2 if c.test.is_effort else 3
    return (
        f"{c.paper.input:.0%}" if c.test.is_effort else f"{c.paper.input:.2f} m/s",
        "?" if c.gain is None else f"{c.gain:.{digits}f}",
        f"{c.paper.gain:.{digits}f}",
        "?" if c.gain_error is None else f"{c.gain_error:+.1%}",
        _seconds(c.tau_s),
        _seconds(c.paper.tau_s),
    )


def _seconds(value: float | None) -> str:
    return "?" if value is None else f"{value:.3f}"
