"""`truing paper`: the paper's tests I to XVII beside its tables, and what both papers' numbers say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import click

from truing.cli.app import App
from truing.cli.options import board_options, json_option

if TYPE_CHECKING:
    from rich.table import Table

    from truing.identify.tables import PlainTable
    from truing.recording.run import RecordingSet
    from truing.studies.bakirci_tests import LevelComparison

Draw: TypeAlias = Callable[[Path], Path]
# Time constants from a level to rest, s, by test.
Endings: TypeAlias = dict[str, float | None]


@click.group(invoke_without_command=True)
@click.option(
    "--set",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    help="Recording set to add the 17 runs to.  [default: out/paper, written afresh]",
)
@click.option("--yes", is_flag=True, help="Do not ask before a real robot moves.")
@board_options
@click.pass_context
def command(ctx: click.Context, app: App, folder: Path | None, yes: bool) -> None:
    """Drive tests I to XVII of Bakirci 2023 one after the other; print Tables III and IV beside the paper's.

    Then say what the paper's linear model leaves out of its own gains, and which of its models carry over.
    The subcommands do parts of this alone, and replay the odometry error model of the other paper.

    \b
    Examples:
      truing paper
      truing paper --seed 7 --json
      truing paper gains
      truing paper mom
    """
    if ctx.invoked_subcommand is None:
        _replay(app, folder, yes)


def _replay(app: App, folder: Path | None, yes: bool) -> None:
    import shutil

    from truing.recording.reader import read_recording_set
    from truing.studies.bakirci_gains import study_gains
    from truing.studies.bakirci_models import study_models
    from truing.studies.tables import gain_sentences, gain_tables, model_sentences, model_tables
    from truing.workspace import out_folder

    if folder is None:
        folder = out_folder() / "paper"
        shutil.rmtree(folder, ignore_errors=True)
    paths = _drive(app, folder, yes)
    recordings = read_recording_set(folder)
    compared, endings = _compare(app, recordings, paths)
    with app.progress("explaining") as progress:
        gains_study = study_gains()
        progress(0.5)
        # A set that the user names may hold runs of other days: the models are those of this drive.
        driven = replace(
            recordings,
            runs=tuple(run for run in recordings if run.name in {path.stem for path in paths}),
        )
        models_study = study_models(driven, lambda share: progress(0.5 + 0.5 * share))
    app.emit(
        _levels_json(compared, endings)
        | {
            "runs": [str(path) for path in paths],
            "printed_gains": gains_study.to_json(),
            "models": models_study.to_json(),
        }
    )
    _show_levels(app, compared, endings)
    app.say(f"Gains in mm/s per % of effort, or m/s per m/s; time constants in s. The runs: {folder}")
    app.say()
    show(app, gain_tables(gains_study)[:1], gain_sentences(gains_study))
    show(app, model_tables(models_study), model_sentences(models_study))


def _drive(app: App, folder: Path, yes: bool) -> list[Path]:
    """Drive the tests; returns their runs' files."""
    from truing.cli.driving import drive_on, warn_and_ask
    from truing.plan import load_plan
    from truing.studies.bakirci_tests import PAPER_TESTS

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
    return paths


def _compare(
    app: App, recordings: RecordingSet, paths: Sequence[Path]
) -> tuple[list[LevelComparison], Endings]:
    """Identify the runs; returns each level beside the paper's, and the time constants to rest by test, s."""
    from truing.identify.identification import identify_set
    from truing.studies.bakirci_tests import PAPER_TESTS, compare, tau_to_zero_s

    with app.progress("identifying") as progress:
        result = identify_set(recordings, progress)
    runs = {run.name: run for run in result.runs}
    compared: list[LevelComparison] = []
    endings: Endings = {}
    for test, path in zip(PAPER_TESTS, paths, strict=True):
        compared += compare(test, runs[path.stem])
        endings[test.name] = tau_to_zero_s(test, runs[path.stem])
    return compared, endings


def _levels_json(compared: Sequence[LevelComparison], endings: Endings) -> dict[str, Any]:
    from truing.studies.bakirci_tests import gain_errors

    effort = gain_errors([c for c in compared if c.test.is_effort])
    velocity = gain_errors([c for c in compared if not c.test.is_effort])
    return {
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
    }


def _show_levels(app: App, compared: Sequence[LevelComparison], endings: Endings) -> None:
    """Print Tables III and IV, and how far the gains are from the paper's."""
    from truing.studies.bakirci_tests import gain_errors

    app.show(_table_iii([c for c in compared if c.test.table == "III"], endings))
    app.show(_table_iv([c for c in compared if c.test.table == "IV"]))
    effort = gain_errors([c for c in compared if c.test.is_effort])
    app.say(
        f"Effort mode, {effort.count} gains: {effort.mean:.2%} from the paper's on average, "
        f"{effort.worst:.2%} at worst (test {effort.worst_level})."
    )
    velocity = [c for c in compared if not c.test.is_effort]
    gains = [c.gain for c in velocity if c.gain is not None]
    app.say(
        f"Velocity mode, {len(velocity)} gains: {min(gains, default=0):.2f} to {max(gains, default=0):.2f} "
        "here, where the paper reads 1.01 to 1.08. The controller's integral action\nleaves no steady error "
        "against its own encoders; the paper does not say where its excess comes from, and the\ncontroller "
        "is not bent to match it."
    )


def show(app: App, tables: Sequence[PlainTable], sentences: Sequence[str]) -> None:
    """Print tables and then what they mean."""
    for table in tables:
        app.show(table.to_rich())
    for line in sentences:
        app.say(line)
    app.say()


_OUT_OPTION = click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for the picture and for the tables as CSV.  [default: out/paper_study]",
)


def _publish(
    app: App,
    out: Path | None,
    name: str,
    figures: dict[str, Any],
    tables: Sequence[PlainTable],
    sentences: Sequence[str],
    draw: Draw,
) -> None:
    """Write the picture and the tables, and print a study."""
    from truing.recording.writer import replace_file
    from truing.report.png import save_table
    from truing.workspace import out_folder

    folder = out if out is not None else out_folder() / "paper_study"
    written = [draw(folder / f"{name}.png")]
    for number, table in enumerate(tables, start=1):
        path = folder / (f"{name}.csv" if number == 1 else f"{name}_{number}.csv")
        replace_file(path, table.to_csv().encode("utf-8"))
        written += [path, save_table(table, path.with_name(f"{path.stem}_table.png"))]
    app.emit(figures | {"written": [str(path) for path in written]})
    show(app, tables, sentences)
    for path in written:
        app.say(f"written: {path}")


@command.command()
@_OUT_OPTION
@json_option
def gains(app: App, out: Path | None) -> None:
    """Explain the 22 effort gains that the paper prints: friction, pivot scrub, supply, and what is left.

    No board is needed: the numbers are the paper's own.

    \b
    Example:
      truing paper gains
    """
    from truing.studies.bakirci_gains import study_gains
    from truing.studies.plots import save_gains
    from truing.studies.tables import gain_sentences, gain_tables

    study = study_gains()
    _publish(
        app,
        out,
        "gains",
        study.to_json(),
        gain_tables(study),
        gain_sentences(study),
        lambda path: save_gains(study, path),
    )


@command.command()
@_OUT_OPTION
@json_option
def mom(app: App, out: Path | None) -> None:
    """Replay the odometry error model of the MOM Simulator View paper against its own Table 2.

    \b
    Example:
      truing paper mom
    """
    from truing.studies.mom_odometry import study_mom
    from truing.studies.plots import save_mom
    from truing.studies.tables import mom_sentences, mom_tables

    study = study_mom()
    _publish(
        app,
        out,
        "mom",
        study.to_json(),
        mom_tables(study),
        mom_sentences(study),
        lambda path: save_mom(study, path),
    )


@command.command()
@click.option(
    "--runs",
    type=click.Path(path_type=Path),
    help="Recording set with tests XI, XV, XVI and XVII.  [default: out/paper, as `truing paper` leaves it]",
)
@_OUT_OPTION
@json_option
def models(app: App, runs: Path | None, out: Path | None) -> None:
    """Fit models on tests XI and XV as the paper does, and judge them on XVI and XVII.

    \b
    Examples:
      truing paper models
      truing paper models --runs out/recordings/board-1a2b3c4d
    """
    from truing.errors import IdentifyError
    from truing.recording.reader import read_recording_set
    from truing.studies.bakirci_models import study_models
    from truing.studies.plots import save_models
    from truing.studies.tables import model_sentences, model_tables
    from truing.workspace import out_folder

    folder = runs if runs is not None else out_folder() / "paper"
    if runs is None and not folder.is_dir():
        raise IdentifyError(
            f"{folder}: the paper's tests have not been driven", "drive them with `truing paper`"
        )
    recordings = read_recording_set(folder)
    with app.progress("fitting") as progress:
        study = study_models(recordings, progress)
    _publish(
        app,
        out,
        "models",
        study.to_json(),
        model_tables(study),
        model_sentences(study),
        lambda path: save_models(study, path),
    )


def _table_iii(levels: Sequence[LevelComparison], endings: Endings) -> Table:
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
