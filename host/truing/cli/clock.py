"""`truing clock`: how the board's clock relates to this computer's."""

from __future__ import annotations

import click

from truing.cli.app import App
from truing.cli.options import board_options, crystal_option


@click.command()
@click.option(
    "--seconds",
    type=click.FloatRange(0.2, 86_400),
    default=10.0,
    show_default=True,
    help="How long to measure: the drift's interval narrows with its power of 1.5.",
)
@crystal_option
@board_options
def command(app: App, seconds: float, crystal_ppm: float) -> None:
    """Relate the board's clock to this computer's: offset, drift, and how well both are known.

    Asks the board for its time a hundred times a second and draws a line through the quickest answers. The
    drift is against this computer's own clock, itself some ten ppm off where no time server keeps it.

    \b
    Examples:
      truing --port /dev/ttyUSB0 clock
      truing --port /dev/ttyUSB0 clock --seconds 60 --json
      truing clock --crystal-ppm 37               a virtual board with a crystal that is 37 ppm fast
    """
    from truing.clock.stamp import host_utc
    from truing.errors import TruingError

    if crystal_ppm and not app.is_virtual:
        raise TruingError(
            f"--crystal-ppm is for a virtual board made by this command, and --port is {app.port}",
            "give it to `truing board`",
        )
    app.crystal_ppm = crystal_ppm
    with app.open_device(lasting=False) as device:
        with app.progress("asking the board for its time") as progress:
            relation, lost = device.clock(seconds, progress)
        utc = host_utc(device.client.stream, relation.host_s)
    app.emit(relation.to_dict() | {"lost": lost, "host_utc": utc})
    low, high = relation.drift_ci95_ppm
    whose = "virtual time" if utc is None else "this computer's clock"
    when = utc or f"{relation.host_s:.6f} s of virtual time"
    app.say(
        f"offset       device time {relation.host_s + relation.offset_s:.6f} s "
        f"+- {relation.uncertainty_s(relation.host_s) * 1e3:.3f} ms was {when}"
    )
    app.say(
        f"drift        {relation.drift_ppm:+.3f} ppm against {whose}, 95 %: {low:+.3f} to {high:+.3f}; "
        f"{relation.drift_ppm * 0.0864:+.2f} s a day"
    )
    app.say(
        f"round trips  {relation.round_trips} of {relation.round_trips + lost} answered in "
        f"{relation.span_s:.1f} s, the quickest in {relation.shortest_s * 1e3:.2f} ms; {relation.used} used, "
        f"{relation.scatter_s * 1e6:.0f} us about the line"
    )
