"""`truing stream`: signals as they happen."""

from __future__ import annotations

import csv
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from truing.cli.app import App
from truing.cli.foxglove_options import foxglove_options, open_server, publisher
from truing.cli.options import board_options

if TYPE_CHECKING:
    from collections.abc import Callable

    from truing.board.signal_stream import Sample

DEFAULT = "speed_left,speed_right,effort_left,effort_right"


@click.command()
@click.option(
    "--signals", help=f"Which, separated by commas.  [default: {DEFAULT}; with --foxglove all of them]"
)
@click.option(
    "--rate", "rate_hz", type=click.IntRange(1, 200), default=200, show_default=True, help="Samples a second."
)
@click.option("--duration", "duration_s", type=float, help="Seconds to listen; left out: until Ctrl-C.")
@click.option("--csv", "path", type=click.Path(dir_okay=False, path_type=Path), help="File to write instead.")
@foxglove_options
@board_options
def command(
    app: App,
    signals: str | None,
    rate_hz: int,
    duration_s: float | None,
    path: Path | None,
    foxglove: str | None,
    floor_map: Path | None,
) -> None:
    """Write signals as CSV, one line a sample: device time, then each signal; or serve them to Foxglove.

    Signals: mode, faults, cmd_left, cmd_right, effort_left, effort_right, counts_left, counts_right,
    speed_left, speed_right, x, y, theta, battery.

    With --foxglove they go out over the Foxglove WebSocket protocol, with pose, map and faults, until
    Ctrl-C; --csv writes them beside it. A virtual board made here is then held to real time.

    \b
    Examples:
      truing --port /dev/ttyUSB0 stream --signals speed_left,battery --rate 200 --csv live.csv
      truing --port /dev/ttyUSB0 stream --foxglove --map room.yaml
    """
    from truing.board.signal_stream import SIGNALS

    names = list(SIGNALS) if foxglove and not signals else (signals or DEFAULT).split(",")
    names = [name.strip() for name in names]
    if foxglove:
        from truing.extras import require

        require("foxglove")
    with ExitStack() as stack:
        device = stack.enter_context(app.open_device())
        stream = stack.enter_context(device.stream(names, rate_hz))
        takers: list[Callable[[Sample], Any]] = []
        if path is not None:
            file = stack.enter_context(path.open("w", newline="", encoding="utf-8"))
            takers.append(_csv_writer(file, names))
        elif not foxglove and not app.as_json:
            takers.append(_csv_writer(sys.stdout, names))
        if foxglove:
            server = stack.enter_context(open_server(app, device, tuple(names), foxglove, floor_map))
            takers.append(publisher(app, server))
        wanted = None if duration_s is None else round(duration_s * rate_hz)
        count = 0
        try:
            for sample in stream:
                for take in takers:
                    take(sample)
                count += 1
                if wanted is not None and count + stream.lost >= wanted:
                    break
        except KeyboardInterrupt:
            pass
    app.emit({"samples": count, "lost": stream.lost, "rate_hz": rate_hz, "signals": names})
    app.note(f"{count} samples of {len(names)} signals at {rate_hz} Hz, {stream.lost} lost")


def _csv_writer(file: Any, names: list[str]) -> Callable[[Sample], Any]:
    writer = csv.writer(file)
    writer.writerow(["t_s", *names])
    return lambda sample: writer.writerow(
        [f"{sample.t_s:.3f}", *(f"{sample.values[name]:.6g}" for name in names)]
    )
