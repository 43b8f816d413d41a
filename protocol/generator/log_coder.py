"""The log's coding as SPEC.md describes it, in plain integers: makes the vectors, and the tests' logs.

Written for the eye and not for speed; it shares nothing with the board's coder and the host's decoder.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field

MODE_EFFORT, MODE_VELOCITY = 1, 2
HALF = 1 << 15
TOP_BYTE = 1 << 24
KINDS = (
    *("time", "mode", "segment", "faults", "command", "travel"),
    *("effort_set", "effort_held", "speed", "heading", "position", "battery"),
)


def wrapped(value: int) -> int:
    """The signed 32-bit number that `value` is modulo 2^32."""
    return (value + 2**31) % 2**32 - 2**31


def clamped(value: int, limit: int) -> int:
    return max(-limit, min(value, limit))


@dataclass
class Bit:
    """Probability of a one, in 1/65536, and the number of bits it was estimated from."""

    p: int = HALF
    seen: int = 0

    def update(self, bit: int) -> None:
        rate = 655360 // (10 * self.seen + 16)
        self.p += ((65536 - self.p) * rate >> 16) if bit else -(self.p * rate >> 16)
        self.p = max(64, min(self.p, 65536 - 64))
        self.seen = min(self.seen + 1, 30)


class RangeCoder:
    """Binary arithmetic coding with carries (Martin, *Range encoding*, 1979), most significant byte first."""

    def __init__(self) -> None:
        self.out = bytearray()
        self.low, self.range = 0, 2**32 - 1

    def _take(self, bit: int, bound: int) -> None:
        if bit:
            self.range = bound
        else:
            self.low += bound
            self.range -= bound
        while self.range < TOP_BYTE:
            self._shift()
            self.range <<= 8

    def _shift(self) -> None:
        self._carry()
        self.out.append(self.low >> 24)
        self.low = self.low << 8 & 0xFFFFFFFF

    def _carry(self) -> None:
        if self.low >> 32:
            at = len(self.out) - 1
            while self.out[at] == 0xFF:
                self.out[at] = 0
                at -= 1
            self.out[at] += 1
            self.low &= 0xFFFFFFFF

    def bit(self, bit: int, model: Bit) -> None:
        self._take(bit, (self.range >> 16) * model.p)
        model.update(bit)

    def plain(self, value: int, bits: int) -> None:
        for i in reversed(range(bits)):
            self._take(value >> i & 1, self.range >> 1)

    def close(self) -> bytes:
        """One byte identifies the interval; zeros follow."""
        self.low += TOP_BYTE - 1
        self._carry()
        self.out.append(self.low >> 24)
        return bytes(self.out).rstrip(b"\0")


class Number:
    """Models of one kind of number."""

    def __init__(self) -> None:
        self.zero = [Bit() for _ in range(6)]
        self.sign = Bit()
        self.more = [Bit() for _ in range(12)]
        self.top = [Bit() for _ in range(12)]

    def code(self, coder: RangeCoder, value: int, context: int = 0) -> None:
        coder.bit(value != 0, self.zero[context])
        if value == 0:
            return
        coder.bit(value < 0, self.sign)
        size = abs(value)
        length = size.bit_length() - 1
        for i in range(min(length, 12)):
            coder.bit(1, self.more[i])
        if length >= 12:
            coder.plain(length, 5)
            coder.plain(size - (1 << length), length)
            return
        coder.bit(0, self.more[length])
        if length:
            coder.bit(size >> (length - 1) & 1, self.top[length])
            coder.plain(size & (1 << (length - 1)) - 1, length - 1)


class Predictor:
    """Predicts the next value of a series, by the predictor of four with the smallest recent error."""

    LIMIT = 1 << 23

    def __init__(self) -> None:
        self.last = self.before = self.smooth = 0
        self.errors = [0] * 4
        self.residual = 0

    def predictions(self) -> list[int]:
        step = self.last - self.before
        return [self.last, self.last + (step >> 1), self.last + step, (self.smooth + 32) >> 6]

    def best(self) -> int:
        return self.predictions()[self.errors.index(min(self.errors))]

    def context(self, driven: bool) -> int:
        if self.last == 0 and self.before == 0:
            return 5 if driven else 4
        size = abs(self.residual)
        return 0 if size == 0 else 1 if size == 1 else 2 if size < 4 else 3

    def update(self, value: int, residual: int) -> None:
        value = clamped(value, self.LIMIT)
        for i, prediction in enumerate(self.predictions()):
            self.errors[i] += min(abs(value - prediction), 1 << 20) * 4 - (self.errors[i] >> 2)
        self.smooth += ((value << 6) - self.smooth) >> 2
        self.before, self.last, self.residual = self.last, value, residual


def float_parts(value: float) -> tuple[int, int]:
    """`mantissa * 2^exponent` with a mantissa of 24 bits; 0, 0 unless it is a positive normal number."""
    bits = struct.unpack("<I", struct.pack("<f", value))[0]
    exponent = bits >> 23
    if exponent == 0 or exponent >= 255:
        return 0, 0
    return bits & 0x7FFFFF | 0x800000, exponent - 150


def sine_cosine(phase: int) -> tuple[int, int]:
    """Of `phase` / 2^32 turns, times 2^24."""
    quadrant = (phase + 0x20000000 & 0xFFFFFFFF) >> 30
    x = wrapped(phase - (quadrant << 30)) * 1686629713 >> 30
    z = x * x >> 30
    s = x + (x * (z * (-178956971 + (z * (8947849 + (z * -213044 >> 30)) >> 30)) >> 30) >> 30)
    c = (1 << 30) + (z * (-536870912 + (z * (44739243 + (z * -1491308 >> 30)) >> 30)) >> 30)
    s, c = s >> 6, c >> 6
    return [(s, c), (c, -s), (-s, -c), (-c, s)][quadrant & 3]


def rounded(numerator: int, divisor: int) -> int:
    """The quotient, half away from zero."""
    size = (abs(numerator) + divisor // 2) // divisor
    return size if numerator >= 0 else -size


class Geometry:
    """Geometry of the counts, from the block's header."""

    def __init__(self, metres_per_count: float, turns_per_count: float) -> None:
        self.mantissa, self.exponent = float_parts(metres_per_count)
        mantissa, exponent = float_parts(turns_per_count)
        shift = exponent + 40
        self.turn = min(mantissa << shift if shift >= 0 else mantissa >> -shift, 2**47)
        self.max_counts = 2**62 // self.turn if self.turn else 0

    def speed(self, counts: int, interval_ms: int) -> int:
        """mm/s."""
        shift = -(self.exponent + 14)
        if not 0 < interval_ms < 65536 or not 0 <= shift < 40:
            return 0
        scale = self.mantissa * 1000000 >> 14
        return max(-32768, min(rounded(counts * scale, interval_ms << shift), 32767))

    def heading(self, difference: int) -> int:
        """2^-40 turns."""
        return difference * self.turn if abs(difference) <= self.max_counts else 0

    def travel(self, sum_of_counts: int) -> int:
        """Displacement of the body for the sum of the wheels' counts, 2^-32 m."""
        shift = self.exponent + 31
        product = sum_of_counts * self.mantissa
        if shift > 0:
            product = clamped(product, 2**38) << min(shift, 20)
        else:
            product >>= min(-shift, 62)
        return clamped(product, 2**38)


def heading_e4(turns_q40: int) -> int:
    """1e-4 rad, saturating."""
    angle = rounded(clamped(turns_q40 >> 20, 2**36) * 62831853, 1000 << 20)
    return max(-(2**31), min(angle, 2**31 - 1))


@dataclass
class Axis:
    """Position on one axis, 2^-32 m, known to rounded millimetres."""

    at: int = 0

    def step(self, by: int) -> None:
        self.at = clamped(self.at + by, 2**53)

    def prediction(self) -> int:
        return (self.at >> 10) * 1000 + (1 << 21) >> 22

    def context(self, still: bool) -> int:
        if still:
            return 0
        return 1 + min(abs((self.at >> 10) * 1000 - (self.prediction() << 22)) >> 19, 3)

    def update(self, millimetres: int, residual: int) -> None:
        """Moves to the nearest position that rounds to the record's value."""
        if residual:
            edge = (2 * millimetres - 1 if residual > 0 else 2 * millimetres + 1) * 1099511628 >> 9
            self.at = clamped(edge + (2048 if residual > 0 else -2048), 2**53)


@dataclass
class BlockCoder:
    """One block's records."""

    geometry: Geometry
    rate_hz: int
    first_record: int = 0
    coder: RangeCoder = field(default_factory=RangeCoder)
    records: int = 0

    def __post_init__(self) -> None:
        self.numbers = {kind: Number() for kind in KINDS}
        self.same, self.replayed = Bit(), Bit()
        self.last = [0] * 16
        self.travel = [Predictor(), Predictor()]
        self.effort = [Predictor(), Predictor()]
        self.battery = Predictor()
        self.x, self.y = Axis(), Axis()
        self.turned = 0

    def _number(self, kind: str, value: int, prediction: int, context: int = 0) -> int:
        residual = wrapped(value - prediction)
        self.numbers[kind].code(self.coder, residual, context)
        return residual

    def add(self, record: list[int]) -> None:
        t_ms, mode, _, _, *rest = record
        command, efforts, counts, speeds = rest[0:2], rest[2:4], rest[4:6], rest[6:8]
        x_mm, y_mm, theta_e4, battery = rest[8:]
        geometry, last = self.geometry, self.last
        self._number("time", t_ms, 1000 * (self.first_record + self.records) // max(self.rate_hz, 1))
        self._state(record)
        moved = [0, 0]
        for wheel in (0, 1):
            moved[wheel] = wrapped(counts[wheel] - last[8 + wheel])
            predictor = self.travel[wheel]
            residual = self._number(
                "travel", moved[wheel], predictor.best(), predictor.context(command[wheel] != 0)
            )
            predictor.update(moved[wheel], residual)
        for wheel in (0, 1):
            predictor = self.effort[wheel]
            if mode == MODE_VELOCITY:
                context = predictor.context(command[wheel] != 0)
                residual = self._number("effort_held", efforts[wheel], predictor.best(), context)
            else:
                known = command[wheel] if mode == MODE_EFFORT else 0
                residual = self._number("effort_set", efforts[wheel], known)
            predictor.update(efforts[wheel], residual)
        interval = (t_ms - last[0]) % 2**32
        heading = geometry.heading(wrapped(counts[1] - counts[0]))
        replay = [geometry.speed(moved[0], interval), geometry.speed(moved[1], interval)]
        replay.append(wrapped(heading_e4(heading) + self.turned))
        seen = [*speeds, theta_e4]
        self.coder.bit(seen != replay, self.replayed)
        if seen != replay:
            for kind, value, predicted in zip(("speed", "speed", "heading"), seen, replay, strict=True):
                self._number(kind, value, predicted)
            self.turned = wrapped(self.turned + theta_e4 - replay[2])
        self._position(x_mm, y_mm, moved, heading)
        residual = self._number("battery", battery, self.battery.best(), self.battery.context(False))
        self.battery.update(battery, residual)
        self.last = list(record)
        self.records += 1

    def _state(self, record: list[int]) -> None:
        """Mode, segment, faults and command change seldom, and often together."""
        changed = record[1:6] != self.last[1:6]
        self.coder.bit(changed, self.same)
        if changed:
            for i, kind in enumerate(("mode", "segment", "faults", "command", "command"), start=1):
                self._number(kind, record[i], self.last[i])

    def _position(self, x_mm: int, y_mm: int, moved: list[int], heading: int) -> None:
        half = self.geometry.heading(wrapped(moved[1] - moved[0])) >> 1
        # 2^40 turns are 62831.853 e4: what the log adds to the heading of its counts turns the path too.
        turned = self.turned * 17499069
        phase = (heading + turned - half) >> 8 & 0xFFFFFFFF
        sine, cosine = sine_cosine(phase)
        step = self.geometry.travel(moved[0] + moved[1])
        for axis, share, seen in ((self.x, cosine, x_mm), (self.y, sine, y_mm)):
            axis.step(step * share >> 24)
            residual = self._number(
                "position", seen, axis.prediction(), axis.context(moved[0] + moved[1] == 0)
            )
            axis.update(seen, residual)


@dataclass(frozen=True)
class LogFormat:
    """What a log's blocks share."""

    metres_per_count: float
    turns_per_count: float
    rate_hz: int
    log_id: int = 1
    start_ms: int = 0
    sequence_crc: int = 0

    def coder(self, first_record: int) -> BlockCoder:
        geometry = Geometry(self.metres_per_count, self.turns_per_count)
        return BlockCoder(geometry, self.rate_hz, first_record)


CELL = 64
HEADER = struct.Struct("<IHHHBBIIIIffH")
VERSION = 2


def seal(log: LogFormat, block: BlockCoder, cell: int, end: int) -> bytes:
    """The block's bytes: header with its CRC, records, zeros up to a whole cell."""
    body = block.coder.close()
    head = HEADER.pack(
        cell,
        log.log_id,
        HEADER.size + 4 + len(body),
        block.records,
        VERSION,
        end,
        block.first_record,
        log.start_ms,
        (log.start_ms + block.last[0]) % 2**32,
        log.sequence_crc,
        log.metres_per_count,
        log.turns_per_count,
        log.rate_hz,
    )
    whole = head + struct.pack("<I", zlib.crc32(head + body)) + body
    return whole + bytes(-len(whole) % CELL)


def code_log(records: list[list[int]], log: LogFormat, first_cell: int = 0, full: int = 560) -> bytes:
    """A log's sealed blocks; a block is closed before the record that follows `full` bytes of records."""
    out = b""
    at = 0
    while at < len(records):
        block = log.coder(at)
        while at < len(records) and len(block.coder.out) < full:
            block.add(records[at])
            at += 1
        out += seal(log, block, first_cell + len(out) // CELL, end=at == len(records))
    return out
