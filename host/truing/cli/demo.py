"""`truing demo`: the whole chain once, on the virtual board, and the same numbers from a real recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from truing.cli.app import App
from truing.cli.options import board_options

if TYPE_CHECKING:
    from truing.identify.identification import Identification
    from truing.recording import RecordingSet

PLAN = "paper/XI"


@click.command()
@board_options
def command(app: App) -> None:
    """Boot the flashed image on the virtual board, drive the paper's test XI, fetch its log, identify, draw.

    Then identify a real recording in the same way: the first set under $TRUING_RECORDINGS, or under
    ../shared/recordings beside the repository.

    \b
    Examples:
      truing demo
      truing --port /dev/ttyUSB0 demo
    """
    import shutil

    from truing.cli.driving import drive_on, warn_and_ask
    from truing.plan import load_plan
    from truing.recording_reader import read_recording_set
    from truing.workspace import out_folder

    out = out_folder() / "demo"
    shutil.rmtree(out, ignore_errors=True)
    written: list[Path] = []
    plan = load_plan(PLAN)
    with app.open_device(lasting=False) as device:
        began = device.client.stream.now_s()
        app.note(
            f"board: {device.info.board_name}, firmware {device.info.firmware_version}, on {device.info.port}"
            + (", the image that is flashed, in virtual time" if app.is_virtual else "")
        )
        parameters = device.parameters()
        warn_and_ask(app, device, parameters, plan, ask=True)
        saved = drive_on(app, device, parameters, plan, out / "recordings", "paper_XI")
        took = device.client.stream.now_s() - began
    app.note(
        f"log {saved.fetched.log.log_id}: {len(saved.run)} records, {saved.fetched.report.bytes} bytes, "
        f"digest {saved.fetched.report.crc32:08x} as on the board; {took:.1f} s of the board's time"
    )
    written += [saved.path, saved.path.with_name(saved.path.stem + ".meta.json")]
    driven = read_recording_set(out / "recordings")
    app.say()
    app.say("The robot just driven")
    results: dict[str, Any] = {"run": saved.to_dict()}
    results["identification"] = _identify(app, driven, out, written).to_json()

    app.say()
    real = real_set()
    if isinstance(real, Path):
        app.say(f"A real robot: {real.name}")
        results["real"] = _identify(app, read_recording_set(real), out / "real", written).to_json()
        results["real"]["set"] = str(real)
    else:
        app.say(f"No real recording was identified: {real}")
        results["real"] = None

    results["written"] = [str(path) for path in written]
    app.emit(results)
    app.say()
    app.say("Written, pictures and pages first:")
    for path in sorted(written, key=lambda path: path.suffix not in (".png", ".html")):
        app.say(f"  {path}")


def real_set() -> Path | str:
    """The real recording set that the demo identifies, or why there is none."""
    import os

    from truing.workspace import recordings_folder, root

    folder = recordings_folder()
    if folder is None:
        named = os.environ.get("TRUING_RECORDINGS")
        if named:
            return f"TRUING_RECORDINGS names {named}, and there is no such folder"
        beside = root().parent / "shared" / "recordings"
        return f"TRUING_RECORDINGS is not set, and there is no {beside}"
    sets = sorted(path.parent for path in folder.rglob("runs") if any(path.glob("*.csv")))
    if not sets:
        return f"{folder} holds no recording set (a folder with runs/*.csv)"
    # A set with steps in it gives the same table as the robot just driven.
    return next((path for path in sets if _has_steps(path)), sets[0])


def _has_steps(folder: Path) -> bool:
    from truing.errors import TruingError
    from truing.identify.identification import identify_set
    from truing.recording_reader import read_recording_set

    try:
        return any(run.level_count for run in identify_set(read_recording_set(folder)).runs)
    except TruingError:
        return False


def _identify(app: App, recordings: RecordingSet, out: Path, written: list[Path]) -> Identification:
    from truing.identify.data_checks import summarise
    from truing.identify.identification import identify_set
    from truing.identify.output import save_identification
    from truing.identify.tables import result_tables, unstepped

    with app.progress("identifying") as progress:
        result = identify_set(recordings, progress)
    for line in summarise(result.findings):
        app.say(f"! {line}")
    for table in result_tables(result):
        app.show(table.to_rich())
    for line in unstepped(result):
        app.say(line)
    with app.progress("drawing") as progress:
        written += save_identification(recordings, result, out, progress)
    return result
