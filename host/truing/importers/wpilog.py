"""WPILib data logs (.wpilog): the records of a robot program, cut into the tests of its SysId routine.

The format is WPILib's "WPILib Data Log File Format", version 1.0: a header, then records of an entry
number, a time in microseconds and a payload; entry 0 carries control records that give the other entries
their names and types.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from truing.arrays import FloatArray
from truing.errors import RecordingError

from .foreign import Finding, ForeignTest, ImportOptions

KIND = "WPILib data log"
MAGIC = b"WPILOG"
HEADER_BYTES = 12

CONTROL_START = 0
NUMBER_CODES = {"double": "<d", "float": "<f", "int64": "<q"}

QUANTITIES = {
    "volts": ("voltage", "volts", "applied"),
    "position": ("position", "distance"),
    "speed": ("velocity", "speed", "rate"),
}
STATE_WORDS = ("quasistatic", "dynamic")
SIDES = ("left", "right")


@dataclass(slots=True)
class Entry:
    """One named channel: times in microseconds and the values that came with them."""

    name: str
    kind: str
    times: list[int] = field(default_factory=list)
    values: list[float | str] = field(default_factory=list)


def matches(path: Path, head: bytes) -> bool:  # noqa: ARG001 (the importers' common form)
    """Whether the file begins as a data log does."""
    return head.startswith(MAGIC)


def read_entries(path: Path) -> tuple[list[Entry], int]:
    """Every channel of numbers or text, in the order in which they were opened, and the bytes left over.

    A log whose end was cut off (a robot loses power) is read up to its last whole record.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordingError(path, f"cannot be read: {error.strerror}") from None
    if len(data) < HEADER_BYTES or not data.startswith(MAGIC):
        raise RecordingError(path, "not a WPILib data log: it does not begin with a whole WPILOG header")
    if data[7] != 1:
        raise RecordingError(path, f"data log version {data[7]}.{data[6]}; version 1 is read")
    at = HEADER_BYTES + int.from_bytes(data[8:12], "little")
    entries: dict[int, Entry] = {}
    while at < len(data):
        widths = data[at]
        entry_width, size_width, time_width = (widths & 3) + 1, (widths >> 2 & 3) + 1, (widths >> 4 & 7) + 1
        body = at + 1 + entry_width + size_width + time_width
        number = int.from_bytes(data[at + 1 : at + 1 + entry_width], "little")
        size = int.from_bytes(data[at + 1 + entry_width : at + 1 + entry_width + size_width], "little")
        time = int.from_bytes(data[body - time_width : body], "little")
        if body + size > len(data):
            break
        payload = data[body : body + size]
        if number == 0:
            _control(path, entries, payload, at)
        elif number in entries:
            _append(entries[number], time, payload)
        at = body + size
    return list(entries.values()), max(len(data) - at, 0)


def _control(path: Path, entries: dict[int, Entry], payload: bytes, at: int) -> None:
    """A start record: type u8, entry u32, then name, type and metadata, each with its length u32 ahead."""
    if not payload or payload[0] != CONTROL_START:
        return
    try:
        number, length = struct.unpack_from("<II", payload, 1)
        name = payload[9 : 9 + length].decode("utf-8", errors="replace")
        (kind_length,) = struct.unpack_from("<I", payload, 9 + length)
    except struct.error:
        raise RecordingError(path, f"damaged: the start record at byte {at} is too short") from None
    kind = payload[13 + length : 13 + length + kind_length].decode("utf-8", errors="replace")
    entries[number] = Entry(name, kind)


def _append(entry: Entry, time: int, payload: bytes) -> None:
    code = NUMBER_CODES.get(entry.kind)
    if code is not None and len(payload) == struct.calcsize(code):
        entry.times.append(time)
        entry.values.append(float(struct.unpack(code, payload)[0]))
    elif entry.kind == "string":
        entry.times.append(time)
        entry.values.append(payload.decode("utf-8", errors="replace"))


def read(path: Path, options: ImportOptions) -> tuple[list[ForeignTest], list[Finding]]:
    """One test per stretch of the SysId routine's state."""
    every, left_over = read_entries(path)
    entries = [entry for entry in every if entry.times]
    state = _state(path, entries)
    channels, findings = _channels(path, entries)
    if left_over:
        text = f"the log ends inside a record ({left_over} bytes left over); read up to the last whole one"
        findings.append(Finding("cut_off", text))
    per_unit = 1.0 if options.metres_per_unit is None else options.metres_per_unit
    if options.metres_per_unit is None:
        text = (
            "positions are taken as metres: a log does not say; truing import --metres-per-unit scales them"
        )
        findings.append(Finding("position_unit", text))
    tests = []
    base = channels["position", 0] if ("position", 0) in channels else channels["speed", 0]
    rows = np.array(base.times, dtype=np.float64)
    # Some programs write the state ahead of a loop's values, some behind them.
    half = _half_a_loop(rows)
    for name, begin, end in _stretches(state):
        times = rows[(rows + half >= begin) & (rows + half < end)]
        if times.size < 2:
            continue
        tests.append(_test(name.replace("-", "_"), times, channels, per_unit))
    if not tests:
        raise RecordingError(
            path, f"no SysId test in {state.name!r}: the routine was never run while this log was written"
        )
    return tests, findings


def _state(path: Path, entries: list[Entry]) -> Entry:
    for entry in entries:
        if entry.kind == "string" and any(str(value).startswith(STATE_WORDS) for value in entry.values):
            return entry
    names = ", ".join(entry.name for entry in entries[:12])
    raise RecordingError(path, f"no channel tells which SysId test runs; channels: {names}")


def _channels(path: Path, entries: list[Entry]) -> tuple[dict[tuple[str, int], Entry], list[Finding]]:
    """Channels by quantity and side, from their names; a voltage without a side drives both."""
    candidates: dict[tuple[str, int], list[Entry]] = {}
    findings = []
    for entry in entries:
        if entry.kind not in NUMBER_CODES:
            continue
        name = entry.name.lower()
        sides = [side for side, word in enumerate(SIDES) if word in name]
        for quantity, words in QUANTITIES.items():
            if any(word in name for word in words):
                for side in sides or [0, 1]:
                    candidates.setdefault((quantity, side), []).append(entry)
                break
    found = {key: entries[0] for key, entries in candidates.items()}
    for (quantity, side), several in candidates.items():
        if len(several) > 1:
            others = ", ".join(repr(entry.name) for entry in several[1:])
            text = f"{SIDES[side]} {quantity} is taken from {several[0].name!r}; it could also be {others}"
            findings.append(Finding("several_channels", text))
    missing = [f"{name} volts" for side, name in enumerate(SIDES) if ("volts", side) not in found]
    if not any(all((quantity, side) in found for side in (0, 1)) for quantity in ("position", "speed")):
        missing.append("position or velocity of both sides")
    if missing:
        names = ", ".join(entry.name for entry in entries if entry.kind in NUMBER_CODES)
        raise RecordingError(path, f"no channel for {', '.join(missing)}; channels with numbers: {names}")
    if found["volts", 0] is found["volts", 1]:
        findings.append(Finding("one_voltage", f"both sides share the voltage {found['volts', 0].name!r}"))
    moving = "position" if ("position", 0) in found else "speed"
    if found[moving, 0] is found.get((moving, 1)):
        text = "one mechanism, not a drive: the same numbers stand on both sides"
        findings.append(Finding("single_mechanism", text))
    return found, findings


def _stretches(state: Entry) -> list[tuple[str, int, int]]:
    """(name, first time, end time) of each stretch in which a test ran, microseconds."""
    stretches: list[tuple[str, int, int]] = []
    ends = [*state.times[1:], 2**63]
    for value, begin, end in zip(state.values, state.times, ends, strict=True):
        name = str(value)
        if not name.startswith(STATE_WORDS):
            continue
        if stretches and stretches[-1][0] == name and stretches[-1][2] == begin:
            stretches[-1] = (name, stretches[-1][1], end)
        else:
            stretches.append((name, begin, end))
    return stretches


def _test(
    name: str, times: FloatArray, channels: dict[tuple[str, int], Entry], per_unit: float
) -> ForeignTest:
    def both(quantity: str) -> FloatArray | None:
        if (quantity, 0) not in channels or (quantity, 1) not in channels:
            return None
        return np.array([_held(channels[quantity, side], times) for side in (0, 1)])

    position, speed = both("position"), both("speed")
    return ForeignTest(
        name,
        times * 1e-6,
        volts=both("volts"),
        position=None if position is None else position * per_unit,
        speed=None if speed is None else speed * per_unit,
        time_known=True,
    )


def _held(entry: Entry, times: FloatArray) -> FloatArray:
    """The channel's value at each time: the last one written by then, shape of `times`."""
    written = np.array(entry.times, dtype=np.float64)
    values = np.array([float(value) for value in entry.values])
    # The channels of one loop are written one after another: up to half a loop later is still this row.
    index = np.searchsorted(written, times + _half_a_loop(written), side="right") - 1
    return values[np.clip(index, 0, values.size - 1)]


def _half_a_loop(times: FloatArray) -> float:
    return 0.5 * float(np.median(np.diff(times))) if times.size > 1 else 0.0
