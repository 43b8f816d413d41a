"""`truing demo`: the whole chain once, a real recording, and a concealed effect found and modelled."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from truing.cli.app import App
from truing.cli.options import board_options

if TYPE_CHECKING:
    from truing.identify.identification import Identification
    from truing.recording.run import RecordingSet

PLAN = "paper/XI"
# Of the diagnosis: verdict, what is missing, its numbers, where.
DEMO_SECTIONS = 5


@click.command()
@board_options
@click.option(
    "--only",
    type=click.Choice(["drive", "diagnose"]),
    help="Do one of the two parts alone: drive and identify, or diagnose a concealed effect.",
)
def command(app: App, only: str | None) -> None:
    """Boot the flashed image on the virtual board, drive the paper's test XI, fetch its log, identify, draw.

    Then identify a real recording in the same way: the first set under $TRUING_RECORDINGS, or under
    ../shared/recordings beside the repository.

    Last, another process conceals an effect in a virtual robot; its recordings are diagnosed, the sealed
    answer is opened, and the corrected simulation is judged on runs that it has not seen.

    \b
    Examples:
      truing demo
      truing demo --only diagnose
      truing --port /dev/ttyUSB0 demo
    """
    import os

    from truing.extras import require
    from truing.virtual.board import require_virtual_board
    from truing.workspace import out_folder

    require("plots")
    if only != "drive" or app.is_virtual:
        require_virtual_board()
    # Set before numpy is loaded: the diagnosis' matrices are small, and threads only get in the way.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    out = out_folder() / "demo"
    written: list[Path] = []
    results: dict[str, Any] = {}
    if only != "diagnose":
        results |= _drive_and_identify(app, out, written)
    if only != "drive":
        if results:
            app.say()
        results["concealed"] = _diagnose_concealed(app, out, written)
    results["written"] = [str(path) for path in written]
    app.emit(results)
    app.say()
    app.say("Written, pictures and pages first:")
    for path in sorted(written, key=lambda path: path.suffix not in (".png", ".html")):
        app.say(f"  {path}")


def _drive_and_identify(app: App, out: Path, written: list[Path]) -> dict[str, Any]:
    """Drive one plan on the board and identify it, then a real recording."""
    import shutil

    from truing.cli.driving import drive_on, warn_and_ask
    from truing.plan import load_plan
    from truing.recording.reader import read_recording_set

    shutil.rmtree(out, ignore_errors=True)
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
    return results


def _diagnose_concealed(app: App, out: Path, written: list[Path]) -> dict[str, Any]:
    """Conceal an effect in a virtual robot, find it, and judge the corrected simulation on unseen runs."""
    from truing.cli.diagnose import say_sections
    from truing.diagnose.present.corrected_model import corrected_model
    from truing.diagnose.present.text import effect_title, sections
    from truing.diagnose.simulation.warm import compile_once
    from truing.recording.baseline import read_baseline
    from truing.recording.writer import replace_file
    from truing.trial.demonstration import PLANS, SEED, demonstrate
    from truing.trial.demonstration_picture import save_demonstration

    folder = out / "concealed"
    compile_once(app.note)

    def seal_shown(sha256: str) -> None:
        app.say(f"  sealed answer, SHA-256: {sha256}")

    app.say(f"An effect is concealed in a virtual robot (seed {SEED}); another process keeps the answer")
    with app.progress("driving and diagnosing") as progress:
        shown = demonstrate(folder, tell=seal_shown, progress=progress)
    app.say(f"  diagnosed from {len(shown.diagnosis.runs)} runs: {', '.join(PLANS)}")
    app.say()
    say_sections(app, sections(shown.diagnosis)[:DEMO_SECTIONS])
    model = corrected_model(shown.diagnosis, read_baseline(folder / "set" / "baseline.toml"))
    replace_file(folder / "model.toml", model.to_toml().encode("utf-8"))
    opened = ", ".join(f"{effect_title(name)} (S = {strength:.1f})" for name, strength in shown.concealed)
    app.say("The seal is opened")
    app.say(f"  its SHA-256 is the one shown above; concealed was: {opened}")
    app.say(f"Error on {len(shown.unseen_runs)} runs of that robot that nothing was fitted to")
    app.say(
        f"  {1e3 * shown.given_mps:.1f} mm/s as given, {1e3 * shown.refitted_mps:.1f} with refitted numbers, "
        f"{1e3 * shown.model_mps:.1f} with what was found; the robot's noise is {1e3 * shown.noise_mps:.1f}"
    )
    app.say(f"  another effect: truing trial --core --seed {SEED + 1}")
    written += [save_demonstration(shown, out / "concealed.png"), folder / "model.toml"]
    return shown.to_json()


def real_set() -> Path | str:
    """The real recording set that the demo identifies, or why there is none."""
    import os

    from truing.workspace import checkout, recordings_beside, recordings_folder

    folder = recordings_folder()
    if folder is None:
        named = os.environ.get("TRUING_RECORDINGS")
        if named:
            return f"TRUING_RECORDINGS names {named}, and there is no such folder"
        root = checkout()
        beside = "" if root is None else f", and there is no {recordings_beside(root)}"
        return f"TRUING_RECORDINGS is not set{beside}"
    sets = sorted(path.parent for path in folder.rglob("runs") if any(path.glob("*.csv")))
    if not sets:
        return f"{folder} holds no recording set (a folder with runs/*.csv)"
    # A set with steps in it gives the same table as the robot just driven.
    return next((path for path in sets if _has_steps(path)), sets[0])


def _has_steps(folder: Path) -> bool:
    from truing.errors import TruingError
    from truing.identify.identification import identify_set
    from truing.recording.reader import read_recording_set

    try:
        return any(run.level_count for run in identify_set(read_recording_set(folder)).runs)
    except TruingError:
        return False


def _identify(app: App, recordings: RecordingSet, out: Path, written: list[Path]) -> Identification:
    from truing.cli.identify import show
    from truing.identify.identification import identify_set
    from truing.report.identification_files import save_identification

    with app.progress("identifying") as progress:
        result = identify_set(recordings, progress)
    show(app, result)
    with app.progress("drawing") as progress:
        written += save_identification(recordings, result, out, progress)
    return result
