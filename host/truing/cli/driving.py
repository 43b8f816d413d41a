"""What `run`, `step`, `demo` and `paper` do alike: warn, ask, drive, fetch, save."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from truing.cli.app import App
from truing.extras import require

if TYPE_CHECKING:
    from truing.board.device import Device
    from truing.board.run_saver import FetchedLog
    from truing.board.state import Parameter
    from truing.plan import Plan
    from truing.recording.run import Run

# Samples a second that Foxglove is served while a plan runs: the board keeps a second of them, and the host
# looks after a running plan at least four times as often.
SERVED_HZ = 100
# How long one of the board's answers is waited for, s, and how many of them at a time.
ANSWER_S, MAX_ANSWERS = 0.005, 20


@dataclass(frozen=True)
class SavedRun:
    """A run that has been driven, fetched and written."""

    path: Path
    run: Run
    fetched: FetchedLog
    plan: Plan

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        report = self.fetched.report
        return {
            "run": str(self.path),
            "plan": self.plan.name,
            "records": len(self.run),
            "log": self.fetched.log.to_dict(),
            "bytes": report.bytes,
            "asked_again_bytes": report.again_bytes,
            "seconds": report.seconds,
            "crc32": f"{report.crc32:08x}",
        }


def drive_and_save(
    app: App,
    plan: Plan,
    folder: Path | None,
    label: str,
    *,
    ask: bool,
    serve: tuple[str, Path | None] | None = None,
) -> SavedRun:
    """Open the board, drive the plan on it and add the run to a set.

    `serve`: where Foxglove finds it meanwhile (HOST:PORT), and the floor's map.
    """
    if serve is not None:
        require("foxglove")
    with app.open_device(lasting=False) as device, ExitStack() as stack:
        parameters = device.parameters()
        warn_and_ask(app, device, parameters, plan, ask=ask)
        beside = None if serve is None else _served(app, device, stack, *serve)
        return drive_on(app, device, parameters, plan, folder, label, beside=beside)


def _served(
    app: App, device: Device, stack: ExitStack, address: str, floor_map: Path | None
) -> Callable[[], None]:
    """Start serving all signals for as long as the stack lasts; what is returned passes on what has come."""
    from truing.board.signal_stream import SIGNALS
    from truing.cli.foxglove_options import open_server, publisher

    server = stack.enter_context(open_server(app, device, tuple(SIGNALS), address, floor_map))
    stream = stack.enter_context(device.stream(tuple(SIGNALS), SERVED_HZ))
    publish = publisher(app, server)

    def beside() -> None:
        # An answer holds a few samples: listen until the board has no more of them.
        for _ in range(MAX_ANSWERS):
            samples = stream.read(ANSWER_S)
            if not samples:
                break
            for sample in samples:
                publish(sample)

    return beside


def warn_and_ask(
    app: App, device: Device, parameters: dict[str, Parameter], plan: Plan, *, ask: bool
) -> None:
    """Say how much floor the plan needs and how fast it goes; ask a person before a real robot moves."""
    from truing.board.run_saver import motion_model
    from truing.errors import Interrupted
    from truing.floor import estimate_floor

    where = "virtual board" if app.is_virtual else device.info.board_name
    app.note(f"{plan.name} on {device.info.port} ({where}): {plan.title}")
    app.note(estimate_floor(plan, motion_model(parameters)).sentence())
    if ask and app.asks and not app.is_virtual and not click.confirm("The robot will move. Start?", err=True):
        raise Interrupted("not started: nothing has moved")


def drive_on(
    app: App,
    device: Device,
    parameters: dict[str, Parameter],
    plan: Plan,
    folder: Path | None,
    label: str,
    *,
    quiet: bool = False,
    beside: Callable[[], None] | None = None,
) -> SavedRun:
    """Drive a plan on a board that is open, fetch its log, add it to a set.

    From before the start until the log is here, Ctrl-C stops the wheels and ends the command.
    `quiet` leaves the progress to a caller who drives several plans; `beside` is called while it drives.
    """
    from truing.board.drive import Interrupts, drive
    from truing.board.run_saver import baseline_text, fetch_log, run_of, save_run
    from truing.workspace import recording_folder

    interrupts = Interrupts()
    with interrupts.caught(), device.client.interrupted_by(lambda: interrupts.requested):
        with app.progress("driving", shown=not quiet) as show:

            def progress(share: float) -> None:
                show(share)
                if beside is not None:
                    beside()

            driven = drive(device, plan, interrupts=interrupts, progress=progress, say=app.note)
        with app.progress("fetching", shown=not quiet) as show:
            fetched = fetch_log(device, driven.log_id, show)
    seed = app.seed if app.is_virtual else None
    run = run_of(device, fetched, label, parameters=parameters, plan=plan, seed=seed)
    folder = folder or recording_folder(None if app.is_virtual else device.info.board_id)
    name = "virtual" if app.is_virtual else device.info.board_name
    path = save_run(run, folder, label, baseline_text(name, parameters, fetched.log.rate_hz))
    return SavedRun(path, run, fetched, plan)
