"""Sources of live samples: the board's status, polled at a moderate rate, or its telemetry stream."""

from __future__ import annotations

from typing import Protocol

from truing.board.device import Device
from truing.board.state import BoardStatus
from truing.errors import LinkError, TruingError
from truing.web.pose import Pose
from truing.web.worker.sample import LiveSample
from truing_protocol import Mode

POLL_HZ = 30.0
# While streaming, faults and the states of sequence and log are polled at this rate.
_STATUS_HZ = 15.0
_STREAMED = (
    "mode", "cmd_left", "cmd_right", "effort_left", "effort_right", "speed_left", "speed_right",
    "x", "y", "theta", "battery",
)  # fmt: skip


class LiveSource(Protocol):
    """Delivers samples from an open board."""

    @property
    def rate_hz(self) -> float:
        """Nominal samples per second, if the link keeps up."""

    def poll(self, timeout_s: float) -> tuple[list[LiveSample], BoardStatus | None]:
        """Samples since the last call, waiting up to `timeout_s`, and the newest status if one came."""

    def set_command(self, wheels_mps: tuple[float, float] | None) -> None:
        """Record the commanded wheel speeds, for a source whose board does not report them."""

    def close(self) -> None:
        """Stop what was started on the board."""


class StatusSource:
    """Polls the board's status."""

    def __init__(self, device: Device, rate_hz: float = POLL_HZ) -> None:
        self._device = device
        self._interval_s = 1.0 / rate_hz
        self._due = 0.0
        self._command: tuple[float, float] | None = None
        self.rate_hz = rate_hz

    def set_command(self, wheels_mps: tuple[float, float] | None) -> None:
        """Record it for the samples that follow."""
        self._command = wheels_mps

    def poll(self, timeout_s: float) -> tuple[list[LiveSample], BoardStatus | None]:
        """One status when it is due."""
        stream = self._device.client.stream
        wait = self._due - stream.now_s()
        if wait > timeout_s:
            stream.sleep(timeout_s)
            return [], None
        stream.sleep(max(0.0, wait))
        self._due = max(self._due + self._interval_s, stream.now_s())
        status = self._device.status()
        return [sample_of(status, self._command)], status

    def close(self) -> None:
        """Nothing to stop."""


def sample_of(status: BoardStatus, command: tuple[float, float] | None) -> LiveSample:
    """The sample in a status."""
    return LiveSample(
        t_s=status.uptime_s,
        odometry=Pose(status.x_m, status.y_m, status.theta_rad),
        speed_mps=status.speed_mps,
        effort=status.effort,
        command_mps=command,
        battery_v=status.battery_v,
    )


class StreamSource:
    """Reads the board's telemetry stream, and polls its status at a lower rate."""

    def __init__(self, device: Device, rate_hz: float) -> None:
        self._device = device
        self._stream = device.stream(_STREAMED, round(rate_hz))
        self._status_due = 0.0
        self.rate_hz = float(self._stream.rate_hz)

    @property
    def lost(self) -> int:
        """Samples that the board overwrote before they were read."""
        return self._stream.lost

    def set_command(self, wheels_mps: tuple[float, float] | None) -> None:
        """Not needed: the stream carries the command."""

    def poll(self, timeout_s: float) -> tuple[list[LiveSample], BoardStatus | None]:
        """Samples that have arrived, and the status when it is due."""
        samples = [_streamed(sample.values, sample.t_s) for sample in self._stream.read(timeout_s)]
        now = self._device.client.stream.now_s()
        if now < self._status_due:
            return samples, None
        self._status_due = now + 1.0 / _STATUS_HZ
        return samples, self._device.status()

    def close(self) -> None:
        """Stop the stream."""
        self._stream.close()


def _streamed(values: dict[str, float], t_s: float) -> LiveSample:
    in_speeds = Mode(int(values["mode"])) is Mode.VELOCITY
    return LiveSample(
        t_s=t_s,
        odometry=Pose(values["x"], values["y"], values["theta"]),
        speed_mps=(values["speed_left"], values["speed_right"]),
        effort=(values["effort_left"], values["effort_right"]),
        command_mps=(values["cmd_left"], values["cmd_right"]) if in_speeds else None,
        battery_v=values["battery"] or None,
    )


def open_source(device: Device, rate_hz: float = POLL_HZ) -> LiveSource:
    """Status polling up to the frame rate; for higher rates the telemetry stream, if the board has one."""
    if rate_hz <= POLL_HZ:
        return StatusSource(device, rate_hz)
    try:
        return StreamSource(device, rate_hz)
    except LinkError:
        raise
    except TruingError:
        # Firmware without the stream refuses the request.
        return StatusSource(device, rate_hz)
