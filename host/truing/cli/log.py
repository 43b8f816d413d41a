"""`truing log`: the logs on the board."""

from __future__ import annotations

from pathlib import Path

import click

from truing.cli.app import App
from truing.cli.options import board_options


@click.group(no_args_is_help=True)
def command() -> None:
    """List, fetch and erase the board's logs.

    \b
    Examples:
      truing --port /dev/ttyUSB0 log list
      truing --port /dev/ttyUSB0 log fetch
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
        table.add_row(
            str(log.log_id),
            f"{log.start_s:.1f} s",
            f"{log.end_s - log.start_s:.1f}",
            f"{log.rate_hz} Hz",
            str(log.record_count),
            str(log.length),
            log.end.name.lower(),
            "no, its beginning is overwritten" if log.truncated else "yes",
        )
    app.show(table)


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
    from truing.clock_probe import ClockProbe
    from truing.clock_stamp import STAMP_S, clock_stamp
    from truing.drive import Interrupts
    from truing.recording_writer import replace_file
    from truing.run_saver import baseline_text, fetch_log, other_boots, run_of, save_run
    from truing.workspace import recording_folder

    interrupts = Interrupts()
    with app.open_device() as device, interrupts.caught():
        device.client.interrupted = lambda: interrupts.requested
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
    )
    if report.resumed_bytes:
        app.say(f"resumed: {report.resumed_bytes} of {report.bytes} bytes were here from the download before")
    app.say(
        f"log {fetched.log.log_id}: {len(run)} records, {report.bytes} bytes, "
        f"digest {report.crc32:08x} as on the board, {report.bytes_per_s / 1000:.1f} kB/s"
    )
    app.say(f"written: {path}")


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
