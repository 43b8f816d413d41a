"""Where live samples come from: the board's status, asked at a modest rate, or its telemetry stream."""

from __future__ import annotations

from typing import Protocol

from truing.board_state import BoardStatus
from truing.device import Device
from truing.errors import LinkError, TruingError
from truing.web.live_sample import LiveSample
from truing.web.pose import Pose
from truing_protocol import Mode

POLL_HZ = 30.0
# Beside a stream: faults, the sequence's state and the log's are asked this often.
_STATUS_HZ = 15.0
_STREAMED = (
    "mode", "cmd_left", "cmd_right", "effort_left", "effort_right", "speed_left", "speed_right",
    "x", "y", "theta", "battery",
)  # fmt: skip


class LiveSource(Protocol):
    """Brings samples from a board that is open."""

    @property
    def rate_hz(self) -> float:
        """Samples in a second, as far as the link keeps up."""

    def poll(self, timeout_s: float) -> tuple[list[LiveSample], BoardStatus | None]:
        """Samples since the last call, waiting up to `timeout_s`, and the newest status if one came."""

    def commanded(self, wheels_mps: tuple[float, float] | None) -> None:
        """Tell what was asked of the wheels, for a source whose board does not say."""

    def close(self) -> None:
        """End what was begun on the board."""


class StatusSource:
    """Asks the board's status again and again."""

    def __init__(self, device: Device, rate_hz: float = POLL_HZ) -> None:
        self._device = device
        self._interval_s = 1.0 / rate_hz
        self._due = 0.0
        self._command: tuple[float, float] | None = None
        self.rate_hz = rate_hz

    def commanded(self, wheels_mps: tuple[float, float] | None) -> None:
        """Remember it for the samples to come."""
        self._command = wheels_mps

    def poll(self, timeout_s: float) -> tuple[list[LiveSample], BoardStatus | None]:
        """One status when its time has come."""
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
        """Nothing was begun."""


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
    """Takes the board's telemetry stream, and asks its status now and then."""

    def __init__(self, device: Device, rate_hz: float) -> None:
        self._device = device
        self._stream = device.stream(_STREAMED, round(rate_hz))
        self._status_due = 0.0
        self.rate_hz = float(self._stream.rate_hz)

    @property
    def lost(self) -> int:
        """Samples that the board had overwritten before they were taken."""
        return self._stream.lost

    def commanded(self, wheels_mps: tuple[float, float] | None) -> None:
        """The board itself says."""

    def poll(self, timeout_s: float) -> tuple[list[LiveSample], BoardStatus | None]:
        """What has arrived, and the status when its time has come."""
        samples = [_streamed(sample.values, sample.t_s) for sample in self._stream.read(timeout_s)]
        now = self._device.client.stream.now_s()
        if now < self._status_due:
            return samples, None
        self._status_due = now + 1.0 / _STATUS_HZ
        return samples, self._device.status()

    def close(self) -> None:
        """End the stream."""
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
    """The status at a picture's rate; the telemetry stream for more, where the board has one."""
    if rate_hz <= POLL_HZ:
        return StatusSource(device, rate_hz)
    try:
        return StreamSource(device, rate_hz)
    except LinkError:
        raise
    except TruingError:
        # Firmware from before the stream refuses it.
        return StatusSource(device, rate_hz)
