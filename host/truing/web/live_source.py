"""Where live samples come from: the board's status, asked at a modest rate, or its telemetry stream."""

from __future__ import annotations

from typing import Protocol

from truing.board_state import BoardStatus
from truing.device import Device
from truing.web.live_sample import LiveSample
from truing.web.pose import Pose

POLL_HZ = 30.0


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


def open_source(device: Device, rate_hz: float = POLL_HZ) -> LiveSource:
    """The best source that this board has."""
    return StatusSource(device, rate_hz)
