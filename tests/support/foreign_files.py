"""Recordings of a known drive in the forms of other programs, written by their formats' own rules."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

TESTS = ("slow-forward", "slow-backward", "fast-forward", "fast-backward")
GAIN, TAU = 3.0, 0.2  # m/s per 12 V, s


@dataclass
class Drive:
    """One test: time (s), volts, travel (m) and speed (m/s) of both wheels, all of shape (n,)."""

    name: str
    t: np.ndarray
    volts: np.ndarray
    travel: np.ndarray
    speed: np.ndarray


def drive(name: str, period_s: float = 0.02, duration_s: float = 4.0) -> Drive:
    """A wheel without friction under a ramp or a step, in closed form at every row."""
    t = np.arange(0.0, duration_s, period_s)
    sign = 1.0 if name.endswith("forward") else -1.0
    decay = np.exp(-t / TAU)
    if name.startswith("slow"):
        rate = sign * 0.9  # V/s
        volts = rate * t
        k = GAIN * rate / 12.0
        speed = k * (t - TAU + TAU * decay)
        travel = k * (0.5 * t**2 - TAU * t + TAU**2 * (1.0 - decay))
    else:
        volts = np.full_like(t, sign * 7.0)
        k = GAIN * sign * 7.0 / 12.0
        speed = k * (1.0 - decay)
        travel = k * (t - TAU * (1.0 - decay))
    return Drive(name, t, volts, travel, speed)


def drives(**options: float) -> list[Drive]:
    """The four tests of a characterisation."""
    return [drive(name, **options) for name in TESTS]


def sysid_rows(test: Drive, width: int, time_scale: float = 1.0) -> list[list[float]]:
    """The rows of one test in the layout with so many columns."""
    zero = np.zeros_like(test.t)
    t = test.t * time_scale
    layouts = {
        10: (
            t,
            zero + 12.5,
            test.volts / 12.0,
            *[test.volts] * 2,
            *[test.travel] * 2,
            *[test.speed] * 2,
            zero,
        ),
        9: (t, *[test.volts] * 2, *[test.travel] * 2, *[test.speed] * 2, zero, zero),
        6: (t, zero + 12.5, test.volts / 12.0, test.volts, test.travel, test.speed),
        4: (t, test.volts, test.travel, test.speed),
    }
    return np.array(layouts[width]).T.tolist()


def write_sysid(path: Path, width: int = 9, time_scale: float = 1.0, **more: Any) -> Path:
    """A SysId JSON file of the four tests."""
    data: dict[str, Any] = {test.name: sysid_rows(test, width, time_scale) for test in drives()}
    path.write_text(json.dumps(data | more), encoding="utf-8")
    return path


class WpilogWriter:
    """WPILib's data log, version 1.0, byte by byte."""

    def __init__(self, extra: bytes = b"") -> None:
        self.data = bytearray(b"WPILOG" + struct.pack("<HI", 0x0100, len(extra)) + extra)
        self.entries = 0

    def start(self, name: str, kind: str) -> int:
        """Open a channel; its number."""
        self.entries += 1
        name_bytes, kind_bytes = name.encode(), kind.encode()
        payload = struct.pack("<BII", 0, self.entries, len(name_bytes)) + name_bytes
        payload += struct.pack("<I", len(kind_bytes)) + kind_bytes + struct.pack("<I", 0)
        self._record(0, 0, payload)
        return self.entries

    def double(self, entry: int, time_us: int, value: float) -> None:
        """One number."""
        self._record(entry, time_us, struct.pack("<d", value))

    def string(self, entry: int, time_us: int, value: str) -> None:
        """One text."""
        self._record(entry, time_us, value.encode())

    def _record(self, entry: int, time_us: int, payload: bytes) -> None:
        # The shortest widths that hold entry, size and time, as the library writes them.
        widths = [max((value.bit_length() + 7) // 8, 1) for value in (entry, len(payload), time_us)]
        self.data.append((widths[0] - 1) | (widths[1] - 1) << 2 | (widths[2] - 1) << 4)
        for value, width in zip((entry, len(payload), time_us), widths, strict=True):
            self.data += value.to_bytes(width, "little")
        self.data += payload


def write_wpilog(path: Path) -> Path:
    """A robot's log of the four tests, with idle time between them."""
    log = WpilogWriter(b"made for a test")
    state = log.start("/sysid-test-state-drive", "string")
    channels = {
        (quantity, side): log.start(f"/drive/{side}/{quantity}", "double")
        for quantity in ("voltage", "position", "velocity")
        for side in ("left", "right")
    }
    log.start("/drive/other", "int64")
    begin = 5_000_000
    names = {"slow-forward": "quasistatic-forward", "slow-backward": "quasistatic-reverse"}
    names |= {"fast-forward": "dynamic-forward", "fast-backward": "dynamic-reverse"}
    for test in drives():
        log.string(state, begin, names[test.name])
        for row, t in enumerate(test.t):
            now = begin + round(1e6 * t)
            for (quantity, _), entry in channels.items():
                values = {"voltage": test.volts, "position": test.travel, "velocity": test.speed}[quantity]
                log.double(entry, now + entry, float(values[row]))
        begin += round(1e6 * (test.t[-1] + 1.0))
        log.string(state, begin - 900_000, "none")
    path.write_bytes(log.data)
    return path
