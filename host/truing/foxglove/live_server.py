"""A board's signals over the Foxglove WebSocket protocol, as they happen."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING, Self

from truing.errors import TruingError
from truing.extras import require
from truing.link.refusals import faults_in
from truing_protocol import FaultInfo, Mode

from .channels import Channels, Floor
from .recording_file import unit_of

if TYPE_CHECKING:
    from foxglove.websocket import ChannelView, Client, ServerListener

PORT = 8765
# A board's signal: the column of a run that holds it. A dashboard then serves live data and recordings.
COLUMNS = {
    "mode": "mode",
    "faults": "faults",
    "cmd_left": "cmd_left",
    "cmd_right": "cmd_right",
    "effort_left": "effort_left",
    "effort_right": "effort_right",
    "counts_left": "ticks_left",
    "counts_right": "ticks_right",
    "speed_left": "vel_left_mps",
    "speed_right": "vel_right_mps",
    "x": "x_m",
    "y": "y_m",
    "theta": "theta_rad",
    "battery": "battery_v",
}
_POSE = ("x", "y", "theta")
# Topics whose last message a client that comes later needs as well.
_STANDING = ("/map", "/robot", "/faults")


class LiveServer:
    """Serves samples until its `with` block ends.

    Parameters
    ----------
    signals : names out of `COLUMNS`, those that samples will hold.
    host, port : where clients connect; port 0 takes a free one.
    width_m : of the robot, for its picture.
    """

    def __init__(
        self,
        signals: tuple[str, ...],
        host: str = "127.0.0.1",
        port: int = PORT,
        *,
        floor: Floor | None = None,
        width_m: float | None = None,
    ) -> None:
        require("foxglove")
        import foxglove

        context = foxglove.Context()
        columns = ["t_s", *(COLUMNS[name] for name in signals)]
        self._channels = Channels(context, {name: unit_of(name) for name in columns}, width_m)
        self._floor = floor
        self._has_pose = all(name in signals for name in _POSE)
        self._faults: tuple[FaultInfo, ...] = ()
        # Filled by the server's own thread, emptied by the one that publishes.
        self._wanted: deque[str] = deque(_STANDING)
        self._offset_ns: int | None = None
        try:
            self._server = foxglove.start_server(
                name="truing", host=host, port=port, server_listener=_listener(self._wanted), context=context
            )
        except (RuntimeError, OSError) as error:
            raise TruingError(
                f"{host}:{port}: no server can be started there ({error})",
                "another program may have the port: give another one",
            ) from None
        self.url = f"ws://{host}:{self._server.port}"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()

    def publish(self, t_s: float, values: Mapping[str, float]) -> None:
        """Serve one sample: the board's time, s, and values by signal; its first is at the host's time."""
        device_ns = round(1e9 * t_s)
        if self._offset_ns is None:
            self._offset_ns = time.time_ns() - device_ns
        time_ns = device_ns + self._offset_ns
        row: dict[str, float | str] = {"t_s": t_s}
        row |= {COLUMNS[name]: value for name, value in values.items()}
        if "mode" in values:
            row["mode"] = Mode(int(values["mode"])).name.lower()
        self._channels.signals(time_ns, row)
        if self._has_pose:
            self._channels.pose(time_ns, *(values[name] for name in _POSE))
        if "faults" in values:
            self._publish_faults(time_ns, int(values["faults"]))
        self._publish_standing(time_ns, with_faults="faults" in values)

    def _publish_faults(self, time_ns: int, bits: int) -> None:
        faults = faults_in(bits)
        for fault in faults:
            if fault not in self._faults:
                self._channels.fault(time_ns, fault, gone=False)
        for fault in self._faults:
            if fault not in faults:
                self._channels.fault(time_ns, fault, gone=True)
        self._faults = faults

    def _publish_standing(self, time_ns: int, *, with_faults: bool) -> None:
        while self._wanted:
            topic = self._wanted.popleft()
            if topic == "/map" and self._floor is not None:
                self._channels.floor(time_ns, self._floor)
            elif topic == "/robot" and self._has_pose:
                self._channels.robot(time_ns)
            elif topic == "/faults" and with_faults:
                for fault in self._faults:
                    self._channels.fault(time_ns, fault, gone=False)
                if not self._faults:
                    self._channels.no_fault(time_ns)


def _listener(wanted: deque[str]) -> ServerListener:
    """Notes the standing topics that clients come to, so that their last message is written again."""
    from foxglove.websocket import ServerListener

    class Listener(ServerListener):
        def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002
            if channel.topic in _STANDING:
                wanted.append(channel.topic)

    return Listener()
