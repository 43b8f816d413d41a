"""Options that several subcommands share; they may stand before or after the subcommand's name."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from truing.cli.app import App

Command = TypeVar("Command", bound=Callable[..., Any])
POSITIVE = click.FloatRange(min=0.0, min_open=True)


def json_option(function: Command) -> Command:
    """`--json` after the subcommand, and the `App` as first argument."""

    @click.option("--json", "json_here", is_flag=True, help="Print the result as JSON.")
    @click.pass_context
    @functools.wraps(function)
    def wrapper(ctx: click.Context, /, *args: Any, json_here: bool, **kwargs: Any) -> Any:
        app = ctx.ensure_object(App)
        app.as_json = app.as_json or json_here
        return function(app, *args, **kwargs)

    return wrapper  # type: ignore[return-value]


def geometry_options(function: Command) -> Command:
    """`--counts-per-rev`, `--wheel-radius`, `--wheelbase`: what turns counts into metres, as `geometry`."""

    @click.option("--counts-per-rev", type=POSITIVE, help="Encoder counts per turn of a wheel.")
    @click.option("--wheel-radius", metavar="METRES", type=POSITIVE, help="Radius of the wheels.")
    @click.option("--wheelbase", metavar="METRES", type=POSITIVE, help="Distance between the wheels.")
    @functools.wraps(function)
    def wrapper(
        *args: Any,
        counts_per_rev: float | None,
        wheel_radius: float | None,
        wheelbase: float | None,
        **kwargs: Any,
    ) -> Any:
        from truing.recording.geometry import given_geometry

        return function(*args, geometry=given_geometry(counts_per_rev, wheel_radius, wheelbase), **kwargs)

    return wrapper  # type: ignore[return-value]


axis_option = click.option(
    "--axis",
    type=click.Choice(["rotation", "translation"]),
    help="The recordings are of one motor or axis: its numbers are in rad or m, and one side is computed.",
)


def virtual_options(function: Command) -> Command:
    """`--seed`, `--robot`, `--image`: which virtual board."""
    options = (
        click.option(
            "--seed", type=click.IntRange(min=0), help="Seed of a virtual board's noise.  [default: 1]"
        ),
        click.option(
            "--robot",
            type=click.Path(exists=True, dir_okay=False, path_type=Path),
            help="TOML file with what a virtual robot has other than the paper's robot.",
        ),
        click.option(
            "--image",
            type=click.Path(exists=True, dir_okay=False, path_type=Path),
            help="Firmware image (ELF) that a virtual board runs instead of the built one.",
        ),
    )
    for option in reversed(options):
        function = option(function)
    return function


crystal_option = click.option(
    "--crystal-ppm",
    type=click.FloatRange(-500, 500),
    default=0.0,
    show_default=True,
    metavar="PPM",
    help="How much faster than marked a virtual board's crystal is.",
)


def board_options(function: Command) -> Command:
    """`--port`, `--seed`, `--robot`, `--image` after the subcommand; `--json` and the `App` as well.

    What they say is put into the `App`, which opens the board.
    """

    @json_option
    @click.option("--port", "port_here", metavar="PORT", help="Where the board is, as `truing --port`.")
    @virtual_options
    @functools.wraps(function)
    def wrapper(
        app: App,
        /,
        *args: Any,
        port_here: str | None,
        seed: int | None,
        robot: Path | None,
        image: Path | None,
        **kwargs: Any,
    ) -> Any:
        app.port = port_here or app.port
        app.choose_virtual(seed, robot, image)
        return function(app, *args, **kwargs)

    return wrapper  # type: ignore[return-value]
