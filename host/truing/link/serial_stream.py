"""A serial port as a stream, opened for one host alone."""

from __future__ import annotations

import contextlib
import errno
import time

import serial

from truing.errors import LinkClosed, LinkTimeout, PortError

BAUD = 921_600


class SerialStream:
    """A serial device (USB adapter, on-board UART, or the PTY of a virtual board).

    Parameters
    ----------
    device : its path, as `/dev/ttyUSB0`.
    baud : the rate of the line; a board whose PLL does not lock has 460800.
    """

    virtual = False

    def __init__(self, device: str, baud: int = BAUD) -> None:
        self._name = device
        try:
            # The lock comes first: without it two hosts on one port each get part of every reply.
            self._port = serial.Serial(device, baud, timeout=0, write_timeout=2.0, exclusive=True)
        except (OSError, ValueError) as error:
            raise self._open_error(error) from error

    @property
    def name(self) -> str:
        """The device's path."""
        return self._name

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        try:
            self._port.write(data)
        except serial.SerialTimeoutException as error:
            raise LinkTimeout(
                f"{self._name}: the port has taken no bytes for 2 seconds",
                "check the adapter, and that no flow control holds it up",
            ) from error
        except OSError as error:
            raise self._closed(error) from error

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, waiting up to `timeout_s` for the first byte."""
        try:
            self._port.timeout = max(timeout_s, 0.0)
            first: bytes = self._port.read(1)
            if not first:
                return b""
            self._port.timeout = 0
            rest: bytes = self._port.read(self._port.in_waiting)
            return first + rest
        except (OSError, TypeError) as error:
            # pyserial raises TypeError when the device vanishes between its select and its read.
            raise self._closed(error) from error

    def sleep(self, seconds: float) -> None:
        """Wait; the operating system keeps what arrives."""
        time.sleep(max(seconds, 0.0))

    def now_s(self) -> float:
        """Return the host's monotonic clock."""
        return time.monotonic()

    def close(self) -> None:
        """Release the port."""
        with contextlib.suppress(OSError):  # the device may be gone already
            self._port.close()

    def _closed(self, error: Exception) -> LinkClosed:
        return LinkClosed(
            f"{self._name}: the link to the board is gone ({error})",
            "check the cable and the board's power, then try again: a download resumes where it was cut",
        )

    def _open_error(self, error: Exception) -> PortError:
        number = getattr(error, "errno", None)
        if number in (errno.EBUSY, errno.EAGAIN):
            return PortError(
                f"{self._name}: another program is using this port",
                f"close the other program (`fuser {self._name}` names it), or choose another port",
            )
        if number == errno.ENOENT:
            return PortError(
                f"{self._name}: there is no such port",
                "`truing ports` lists the ports found; `--port sim` needs none",
            )
        if number == errno.EACCES:
            return PortError(
                f"{self._name}: no permission to open this port",
                "join the group that owns it (often `sudo usermod -aG dialout $USER`) and log in again",
            )
        return PortError(f"{self._name}: cannot be opened as a serial port ({error})")
