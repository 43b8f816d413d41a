"""`truing stream`: signals as they happen."""

from __future__ import annotations

import csv
import sys
from contextlib import ExitStack
from pathlib import Path

import click

from truing.cli.app import App
from truing.cli.options import board_options

DEFAULT = "speed_left,speed_right,effort_left,effort_right"


@click.command()
@click.option("--signals", default=DEFAULT, show_default=True, help="Which, separated by commas.")
@click.option(
    "--rate", "rate_hz", type=click.IntRange(1, 200), default=200, show_default=True, help="Samples a second."
)
@click.option("--duration", "duration_s", type=float, help="Seconds to listen; left out: until Ctrl-C.")
@click.option("--csv", "path", type=click.Path(dir_okay=False, path_type=Path), help="File to write instead.")
@board_options
def command(app: App, signals: str, rate_hz: int, duration_s: float | None, path: Path | None) -> None:
    """Write signals as CSV, one line a sample: device time, then each signal.

    Signals: mode, faults, cmd_left, cmd_right, effort_left, effort_right, counts_left, counts_right,
    speed_left, speed_right, x, y, theta, battery.

    \b
    Example:
      truing --port /dev/ttyUSB0 stream --signals speed_left,battery --rate 200 --csv live.csv
    """
    names = [name.strip() for name in signals.split(",")]
    with ExitStack() as stack:
        device = stack.enter_context(app.open_device())
        stream = stack.enter_context(device.stream(names, rate_hz))
        file = (
            sys.stdout if path is None else stack.enter_context(path.open("w", newline="", encoding="utf-8"))
        )
        writer = csv.writer(file)
        if path is not None or not app.as_json:
            writer.writerow(["t_s", *names])
        wanted = None if duration_s is None else round(duration_s * rate_hz)
        count = 0
        try:
            for sample in stream:
                if path is not None or not app.as_json:
                    writer.writerow([f"{sample.t_s:.3f}", *(f"{sample.values[name]:.6g}" for name in names)])
                count += 1
                if wanted is not None and count + stream.lost >= wanted:
                    break
        except KeyboardInterrupt:
            pass
    app.emit({"samples": count, "lost": stream.lost, "rate_hz": rate_hz, "signals": names})
    app.note(f"{count} samples of {len(names)} signals at {rate_hz} Hz, {stream.lost} lost")
