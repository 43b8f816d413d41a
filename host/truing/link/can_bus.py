"""Ways onto a CAN bus: what a bus is to the host, and python-can's adapters."""

from __future__ import annotations

import contextlib
import errno
import time
from typing import Any, Protocol

from truing.errors import LinkClosed, PortError

_SEND_WAIT_S = 4.0  # as patient as the client: drivers count the time in which this process may not run
_FRAME_S = 0.0002  # one frame at 500 kbit/s


class CanBus(Protocol):
    """Frames with 11-bit ids to and from a bus, with a clock of its own."""

    @property
    def name(self) -> str:
        """Where it is, in the user's words."""

    @property
    def virtual(self) -> bool:
        """Whether its clock is virtual time."""

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame; raises `LinkClosed` when the adapter is gone."""

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """Return the next frame, waiting up to `timeout_s` for it; None when none came."""

    def sleep(self, seconds: float) -> None:
        """Let time pass."""

    def now_s(self) -> float:
        """Return the time, seconds from an arbitrary origin."""

    def close(self) -> None:
        """Release the adapter; closing twice is harmless."""


class AdapterBus:
    """An adapter that python-can drives.

    Parameters
    ----------
    interface, channel : python-can's names, as `socketcan` and `can0`, or `slcan` and `/dev/ttyACM0`.
    bit_rate : bit/s; a SocketCAN interface keeps the one that the system gave it.
    """

    virtual = False

    def __init__(self, interface: str, channel: str, bit_rate: int) -> None:
        import can

        self.name = f"can:{interface}:{channel}"
        # The wait is for boards that reset when their port is opened; adapters for CAN do not.
        slcan = interface == "slcan"
        more: dict[str, Any] = {"sleep_after_open": 0.0} if slcan else {}
        # What this driver takes for a frame may be a confirmation; in this time it looks on.
        self._shortest_wait_s = 0.001 if slcan else 0.0
        try:
            self._bus = can.Bus(interface=interface, channel=channel, bitrate=bit_rate, **more)
        except (can.CanError, OSError, ValueError, ImportError, NotImplementedError) as error:
            raise PortError(
                f"{self.name}: cannot be opened ({error})",
                "write can:INTERFACE:CHANNEL[@BITRATE][/NODE], for example can:socketcan:can0 or "
                "can:slcan:/dev/ttyACM0@1000000/1",
            ) from error

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame; an interface whose queue is full is waited for."""
        import can

        message = can.Message(arbitration_id=can_id, data=data, is_extended_id=False)
        deadline = time.monotonic() + _SEND_WAIT_S
        while True:
            try:
                self._bus.send(message, timeout=_SEND_WAIT_S)
                return
            except (can.CanError, OSError) as error:
                # SocketCAN queues ten frames by default and says so at once instead of waiting.
                full = getattr(error, "error_code", None) == errno.ENOBUFS
                if not full or time.monotonic() > deadline:
                    raise self._closed(error) from error
            time.sleep(_FRAME_S)

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """Return the next frame."""
        import can

        deadline = time.monotonic() + timeout_s
        while True:
            try:
                message = self._bus.recv(max(self._shortest_wait_s, deadline - time.monotonic()))
            except (can.CanError, OSError, TypeError) as error:
                raise self._closed(error) from error
            if message is None:
                return None
            if not (message.is_extended_id or message.is_remote_frame or message.is_error_frame):
                return message.arbitration_id, bytes(message.data)

    def sleep(self, seconds: float) -> None:
        """Wait; the adapter keeps what arrives."""
        time.sleep(max(seconds, 0.0))

    def now_s(self) -> float:
        """Return the host's monotonic clock."""
        return time.monotonic()

    def close(self) -> None:
        """Release the adapter."""
        with contextlib.suppress(Exception):  # a device that is gone says so in its adapter's own way
            self._bus.shutdown()

    def _closed(self, error: Exception) -> LinkClosed:
        return LinkClosed(
            f"{self.name}: the CAN bus is gone ({error})",
            "check the adapter, both 120 ohm resistors and the boards' power, then try again",
        )
