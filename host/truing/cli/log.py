"""`truing log`: the logs on the board."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from truing.cli.app import App
from truing.cli.options import board_options
from truing_protocol import LogEnd, LogTriggerState

if TYPE_CHECKING:
    from truing.board.log_trigger import LogTrigger
    from truing.board.state import BoardLog


@click.group(no_args_is_help=True)
def command() -> None:
    """List, fetch, arm and erase the board's logs.

    \b
    Examples:
      truing --port /dev/ttyUSB0 log list
      truing --port /dev/ttyUSB0 log fetch
      truing --port /dev/ttyUSB0 log arm --on fault --before 5 --after 2
      truing --port /dev/ttyUSB0 log erase
    """


@command.command("list")
@board_options
def list_(app: App) -> None:
    """List the logs that the board's memory still holds, oldest first.

    \b
    Example:
      truing --port /dev/ttyUSB0 log list
    """
    from rich.table import Table

    with app.open_device() as device:
        logs = device.logs()
    app.emit([log.to_dict() for log in logs])
    if not logs:
        app.say("The board holds no log.")
        return
    table = Table("log", "start", "seconds", "rate", "records", "bytes", "ended", "whole")
    for log in logs:
        less = "< " if log.truncated else ""  # the board counts from the opening on
        table.add_row(
            str(log.log_id),
            f"{log.start_s:.1f} s",
            f"{less}{log.end_s - log.start_s:.1f}",
            f"{log.rate_hz} Hz",
            f"{less}{log.record_count}",
            str(log.length),
            log.end.name.lower(),
            _whole(log),
        )
    app.show(table)


def _whole(log: BoardLog) -> str:
    if not log.truncated:
        return "yes"
    around = log.end is LogEnd.TRIGGERED
    return "what was to be kept around its trigger" if around else "no, its beginning is overwritten"


@command.command()
@click.argument("log_id", required=False, type=click.IntRange(1, 65_535), metavar="[LOG]")
@click.option(
    "--set",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    help="Recording set to add the run to.  [default: out/recordings/BOARD]",
)
@click.option("--name", default="log", show_default=True, help="What to call the run, after its number.")
@click.option(
    "--raw",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Keep the log's own bytes in this file as well.",
)
@board_options
def fetch(app: App, log_id: int | None, folder: Path | None, name: str, raw: Path | None) -> None:
    """Fetch a log (the newest by default) and add it to a recording set as its next run.

    A download that was cut short, by the cable or by Ctrl-C, goes on where it stopped.

    \b
    Examples:
      truing --port /dev/ttyUSB0 log fetch
      truing --port /dev/ttyUSB0 log fetch 3 --set my_robot --name reversals
    """
    from truing.board.drive import Interrupts
    from truing.board.run_saver import baseline_text, fetch_log, other_boots, run_of, save_run
    from truing.clock.probe import ClockProbe
    from truing.clock.stamp import STAMP_S, clock_stamp
    from truing.recording.writer import replace_file
    from truing.workspace import recording_folder

    interrupts = Interrupts()
    with (
        app.open_device() as device,
        interrupts.caught(),
        device.client.interrupted_by(lambda: interrupts.requested),
    ):
        for stale in other_boots(device):
            app.note(f"the board started anew since a download was cut: what had arrived is still in {stale}")
        probe = ClockProbe(device.client)
        probe.run(STAMP_S)
        with app.progress("fetching") as progress:
            fetched = fetch_log(device, log_id, progress)
        probe.run(STAMP_S)
        parameters = device.parameters()
        run = run_of(
            device,
            fetched,
            name,
            parameters=parameters,
            seed=app.seed if app.is_virtual else None,
            clock=clock_stamp(device.client.stream, probe),
        )
        folder = folder or recording_folder(device.info.board_id if not app.is_virtual else None)
        label = device.info.board_name
        path = save_run(run, folder, name, baseline_text(label, parameters, fetched.log.rate_hz))
        if raw is not None:
            replace_file(raw, fetched.data)
    report = fetched.report
    trigger = run.metadata.extra.get("trigger") if run.metadata is not None else None
    app.emit(
        {
            "run": str(path),
            "log": fetched.log.to_dict(),
            "records": len(run),
            "bytes": report.bytes,
            "resumed_bytes": report.resumed_bytes,
            "asked_again_bytes": report.again_bytes,
            "seconds": report.seconds,
            "crc32": f"{report.crc32:08x}",
        }
        | ({"trigger": trigger} if trigger else {})
    )
    if report.resumed_bytes:
        app.say(f"resumed: {report.resumed_bytes} of {report.bytes} bytes were here from the download before")
    app.say(
        f"log {fetched.log.log_id}: {len(run)} records, {report.bytes} bytes, "
        f"digest {report.crc32:08x} as on the board, {report.bytes_per_s / 1000:.1f} kB/s"
    )
    if trigger:
        app.say(f"triggered at {trigger['run_t_s']:.3f} s of the run: {_reason(trigger)}")
    app.say(f"written: {path}")


def _reason(trigger: dict[str, Any]) -> str:
    if trigger["faults"]:
        return ", ".join(trigger["faults"])
    return f"{trigger['signal']} came {trigger['edge']} {trigger['level']:g}: {trigger['value']:g}"


@command.command()
@click.option(
    "--on", type=click.Choice(["fault", "threshold"]), required=True, help="What makes it worth keeping."
)
@click.option("--signal", help="Of a threshold: which signal; `truing stream --help` lists them.")
@click.option("--above", type=float, help="Of a threshold: fires when the signal rises above this.")
@click.option("--below", type=float, help="Of a threshold: fires when the signal falls below this.")
@click.option(
    "--before",
    "before_s",
    type=float,
    default=5.0,
    show_default=True,
    help="Seconds to keep from before the trigger, rounded up to whole blocks of the log.",
)
@click.option(
    "--after",
    "after_s",
    type=float,
    default=2.0,
    show_default=True,
    help="Seconds to record after the trigger.",
)
@board_options
def arm(
    app: App,
    on: str,
    signal: str | None,
    above: float | None,
    below: float | None,
    before_s: float,
    after_s: float,
) -> None:
    """Record from now on, and keep what is around a trigger as a log to fetch.

    The board waits by itself, for hours. Meanwhile live drives leave no log of their own, and sequences are
    refused.

    \b
    Examples:
      truing --port /dev/ttyUSB0 log arm --on fault --before 5 --after 2
      truing --port /dev/ttyUSB0 log arm --on threshold --signal speed_left --above 0.5 --before 1 --after 1
      truing --port /dev/ttyUSB0 log arm --on threshold --signal battery --below 11.1
    """
    with app.open_device() as device:
        device.arm_log(on, before_s=before_s, after_s=after_s, signal=signal, above=above, below=below)
        _show(app, device.log_trigger_state())


@command.command()
@board_options
def state(app: App) -> None:
    """Show what the log is armed for, and what came of it.

    \b
    Example:
      truing --port /dev/ttyUSB0 log state
    """
    with app.open_device() as device:
        _show(app, device.log_trigger_state())


@command.command()
@board_options
def disarm(app: App) -> None:
    """End an armed log: without a trigger it is discarded, after one it is kept with what it has.

    \b
    Example:
      truing --port /dev/ttyUSB0 log disarm
    """
    with app.open_device() as device:
        before = device.log_trigger_state()
        device.disarm_log()
        trigger = device.log_trigger_state()
    app.emit(trigger.to_dict())
    if before.state is LogTriggerState.ARMED:
        app.say(f"log {before.log_id} discarded: {before.cause} never came")
    elif before.state is LogTriggerState.FIRED:
        app.say(f"log {before.log_id} ends here; `truing log fetch {before.log_id}` brings it")
    else:
        app.say("nothing was armed")


def _show(app: App, trigger: LogTrigger) -> None:
    app.emit(trigger.to_dict())
    app.say(_state(trigger))


def _state(trigger: LogTrigger) -> str:
    kept = f"{trigger.before_s:g} s before and {trigger.after_s:g} s after"
    if trigger.state is LogTriggerState.ARMED:
        return f"armed: log {trigger.log_id} waits for {trigger.cause}, and keeps {kept} it"
    if trigger.state is LogTriggerState.IDLE:
        return "idle: logs begin and end with sequences and live drives"
    what = ", ".join(fault.name for fault in trigger.faults) or trigger.cause
    when = f"triggered at device time {trigger.fired_s:.3f} s: {what}"
    text = f"{trigger.state.name.lower()}: log {trigger.log_id} {when}"
    if trigger.state is LogTriggerState.FIRED:
        return f"{text}; it records for {trigger.after_s:g} s after that"
    return f"{text}; `truing log fetch {trigger.log_id}` brings it"


@command.command()
@click.option("--yes", is_flag=True, help="Do not ask.")
@board_options
def erase(app: App, yes: bool) -> None:
    """Forget all logs on the board.

    \b
    Example:
      truing --port /dev/ttyUSB0 log erase
    """
    with app.open_device() as device:
        count = len(device.logs())
        if count and not yes and app.asks:
            click.confirm(f"Forget {count} logs on {device.info.port}?", abort=True, err=True)
        device.erase_logs()
    app.emit({"erased": count})
    app.say(f"{count} logs erased")
