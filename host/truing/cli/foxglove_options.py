"""`--foxglove` and `--map`: serve what happens to Foxglove; shared by `stream` and `run`."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from truing.cli.app import App

if TYPE_CHECKING:
    from truing.board.device import Device
    from truing.board.signal_stream import Sample
    from truing.foxglove.live_server import LiveServer

Command = TypeVar("Command", bound=Callable[..., Any])
DEFAULT_ADDRESS = "127.0.0.1:8765"


def foxglove_options(function: Command) -> Command:
    """`--foxglove [HOST:PORT]` and `--map FILE.yaml`, as `foxglove` and `floor_map`."""

    @click.option(
        "--foxglove",
        metavar="[HOST:PORT]",
        is_flag=False,
        flag_value=DEFAULT_ADDRESS,
        help=f"Serve the signals to Foxglove over WebSocket.  [without an address: {DEFAULT_ADDRESS}]",
    )
    @click.option(
        "--map",
        "floor_map",
        metavar="FILE.yaml",
        type=click.Path(exists=True, dir_okay=False, path_type=Path),
        help="Map of the floor to show in Foxglove (the format of ROS's map_server).",
    )
    @functools.wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        return function(*args, **kwargs)

    return wrapper  # type: ignore[return-value]


def open_server(
    app: App, device: Device, signals: tuple[str, ...], address: str, floor_map: Path | None
) -> LiveServer:
    """Start the server and say where it is."""
    from truing.errors import TruingError
    from truing.foxglove.live_server import LiveServer

    host, colon, port = address.rpartition(":")
    if not colon or not host or not port.isdigit() or int(port) > 65535:
        raise TruingError(f"--foxglove {address}: no address", f"give HOST:PORT, such as {DEFAULT_ADDRESS}")
    server = LiveServer(signals, host, int(port), floor=_floor(floor_map), width_m=_width_m(device))
    app.note(f"Foxglove: open the connection {server.url} (Foxglove WebSocket)")
    return server


def publisher(app: App, server: LiveServer) -> Callable[[Sample], None]:
    """What serves a sample; those of a virtual board, which is faster than the clock, wait for their time."""
    begun: list[float] = []

    def publish(sample: Sample) -> None:
        if app.is_virtual:
            now = time.monotonic()
            begun.extend([now - sample.t_s] if not begun else [])
            time.sleep(max(begun[0] + sample.t_s - now, 0.0))
        server.publish(sample.t_s, sample.values)

    return publish


def _width_m(device: Device) -> float | None:
    wheelbase = device.parameters().get("wheelbase_m")
    return None if wheelbase is None else wheelbase.value


def _floor(path: Path | None) -> Any:
    if path is None:
        return None
    from truing.extras import require

    require("view")  # its map files are those of the view
    from truing.foxglove.channels import Floor
    from truing.web.world.map_file import read_world

    world = read_world(path)
    return Floor(world.occupied, world.resolution_m, world.origin_m)
