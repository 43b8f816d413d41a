"""Decodes the records of one block of the log, in integers that also fit numba's 64 bits.

The format is protocol/SPEC.md's ("Records"). The functions are plain Python, quick enough for a run of
a few minutes; `compiled_decoder` gives the same ones compiled, for logs of half an hour.
"""

from __future__ import annotations

import types
from collections.abc import Callable, MutableSequence, Sequence
from typing import Any

Ints = MutableSequence[int]

FIELDS = 16
_EFFORT, _VELOCITY = 1, 2

# Models: per kind of number six for "not zero" by context, one for the sign, twelve for the length,
# twelve for the bit below the highest; then "state changed" and "not as replayed".
_SIGN, _MORE, _TOP = 6, 7, 19
_LENGTHS = 12
_TIME, _MODE, _TRAVEL, _EFFORT_SET, _EFFORT_HELD, _SPEED, _HEADING, _POSITION, _BATTERY = (
    *(0, 31, 155, 186, 217, 248, 279, 310, 341),
)
_STATE_KINDS = (31, 62, 93, 124, 124)
_CHANGED, _DIFFERS = 372, 373
MODELS = 374

# One series of numbers: last, the one before, a smooth mean, the last residual, four predictions' errors.
_SERIES = 8
_LAST, _BEFORE, _SMOOTH, _RESIDUAL, _ERRORS = range(5)
SERIES = 5 * _SERIES


def wrapped(value: int) -> int:
    """The signed 32-bit number that `value` is modulo 2^32."""
    return ((value + 0x80000000) & 0xFFFFFFFF) - 0x80000000


def clamped(value: int, limit: int) -> int:
    """`value`, brought between -limit and limit."""
    return min(max(value, -limit), limit)


def narrow(line: Ints, data: Sequence[int], bound: int, bit: int) -> None:
    """Follow the coder's interval (`line`: range, code, place, length)."""
    if bit:
        line[0] = bound
    else:
        line[1] -= bound
        line[0] -= bound
    while line[0] < 0x1000000:
        at = line[2]
        line[1] = line[1] << 8 | (data[at] if at < line[3] else 0)
        line[0] <<= 8
        line[2] = at + 1


def coded_bit(line: Ints, data: Sequence[int], p: Ints, seen: Ints, model: int) -> int:
    """Read one bit, and let its model update it."""
    one = p[model]
    bound = (line[0] >> 16) * one
    rate = 655360 // (10 * seen[model] + 16)
    if seen[model] < 30:
        seen[model] += 1
    if line[1] < bound:
        narrow(line, data, bound, 1)
        p[model] = min(one + ((65536 - one) * rate >> 16), 65536 - 64)
        return 1
    narrow(line, data, bound, 0)
    p[model] = max(one - (one * rate >> 16), 64)
    return 0


def plain_bits(line: Ints, data: Sequence[int], count: int) -> int:
    """Read `count` bits that no model knows, most significant first."""
    value = 0
    for _ in range(count):
        bound = line[0] >> 1
        bit = 1 if line[1] < bound else 0
        narrow(line, data, bound, bit)
        value = value << 1 | bit
    return value


def number(line: Ints, data: Sequence[int], p: Ints, seen: Ints, kind: int, context: int) -> int:
    """Read how far a value lies from what was expected."""
    if coded_bit(line, data, p, seen, kind + context) == 0:
        return 0
    negative = coded_bit(line, data, p, seen, kind + _SIGN)
    length = 0
    while length < _LENGTHS and coded_bit(line, data, p, seen, kind + _MORE + length) == 1:
        length += 1
    if length == _LENGTHS:
        length = plain_bits(line, data, 5)
        size = 1 << length | plain_bits(line, data, length)
    elif length > 0:
        size = 2 | coded_bit(line, data, p, seen, kind + _TOP + length)
        size = size << (length - 1) | plain_bits(line, data, length - 1)
    else:
        size = 1
    return -size if negative else size


def best_prediction(g: Ints, at: int) -> int:
    """The prediction, of four, with the smallest recent error."""
    best = 0
    for i in range(1, 4):
        if g[at + _ERRORS + i] < g[at + _ERRORS + best]:
            best = i
    step = g[at] - g[at + _BEFORE]
    if best == 0:
        return g[at]
    if best == 1:
        return g[at] + (step >> 1)
    return g[at] + step if best == 2 else (g[at + _SMOOTH] + 32) >> 6


def coding_context(g: Ints, at: int, driven: bool) -> int:
    """Coding context of the next value, by the size of the last residual."""
    if g[at] == 0 and g[at + _BEFORE] == 0:
        return 5 if driven else 4
    size = abs(g[at + _RESIDUAL])
    return size if size < 2 else 2 if size < 4 else 3


def update(g: Ints, at: int, value: int, residual: int) -> None:
    """Update the series with its next value."""
    value = clamped(value, 1 << 23)
    last, step = g[at], g[at] - g[at + _BEFORE]
    for i in range(4):
        if i == 0:
            prediction = last
        elif i == 1:
            prediction = last + (step >> 1)
        else:
            prediction = last + step if i == 2 else (g[at + _SMOOTH] + 32) >> 6
        error = min(abs(value - prediction), 1 << 20)
        g[at + _ERRORS + i] += 4 * error - (g[at + _ERRORS + i] >> 2)
    g[at + _SMOOTH] += (value * 64 - g[at + _SMOOTH]) >> 2
    g[at + _BEFORE] = last
    g[at] = value
    g[at + _RESIDUAL] = residual


def predicted(
    line: Ints, data: Sequence[int], p: Ints, seen: Ints, g: Ints, at: int, kind: int, driven: bool
) -> int:
    """Read a value of a series."""
    residual = number(line, data, p, seen, kind, coding_context(g, at, driven))
    value = wrapped(best_prediction(g, at) + residual)
    update(g, at, value, residual)
    return value


def quotient(numerator: int, divisor: int) -> int:
    """Half away from zero."""
    size = (abs(numerator) + divisor // 2) // divisor
    return size if numerator >= 0 else -size


def speed_mmps(geometry: Ints, counts: int, interval_ms: int) -> int:
    """Mean speed of a wheel, as the board works it out (`geometry`: mantissa, exponent, turn, maximum)."""
    shift = -(geometry[1] + 14)
    if interval_ms <= 0 or interval_ms > 65535 or shift < 0 or shift >= 40:
        return 0
    scale = geometry[0] * 1000000 >> 14
    return min(max(quotient(counts * scale, interval_ms << shift), -32768), 32767)


def heading_q40(geometry: Ints, difference: int) -> int:
    """2^-40 turns for so many counts more on the right."""
    return difference * geometry[2] if abs(difference) <= geometry[3] else 0


def heading_e4(turns_q40: int) -> int:
    """1e-4 rad, saturating."""
    angle = quotient(clamped(turns_q40 >> 20, 1 << 36) * 62831853, 1000 << 20)
    return min(max(angle, -0x80000000), 0x7FFFFFFF)


def way_q32(geometry: Ints, counts: int) -> int:
    """2^-32 m that the body moves for the sum of both wheels' counts."""
    shift = geometry[1] + 31
    product = counts * geometry[0]
    if shift > 0:
        product = clamped(product, 1 << 38) << min(shift, 20)
    else:
        product >>= min(-shift, 62)
    return clamped(product, 1 << 38)


def sine(phase: int) -> int:
    """Of phase / 2^32 turns, times 2^24."""
    quadrant = ((phase + 0x20000000) & 0xFFFFFFFF) >> 30
    x = wrapped(phase - (quadrant << 30)) * 1686629713 >> 30
    z = x * x >> 30
    if quadrant & 1:
        inner = 44739243 + (z * -1491308 >> 30)
        value = ((1 << 30) + (z * (-536870912 + (z * inner >> 30)) >> 30)) >> 6
    else:
        inner = 8947849 + (z * -213044 >> 30)
        value = (x + (x * (z * (-178956971 + (z * inner >> 30)) >> 30) >> 30)) >> 6
    return -value if quadrant & 2 else value


def position(
    line: Ints, data: Sequence[int], p: Ints, seen: Ints, axes: Ints, axis: int, way: int, still: bool
) -> int:
    """Read where the robot is along one axis, mm."""
    at = clamped(axes[axis] + way, 1 << 53)
    thousand = (at >> 10) * 1000
    expected = (thousand + (1 << 21)) >> 22
    context = 0 if still else 1 + min(abs(thousand - (expected << 22)) >> 19, 3)
    residual = number(line, data, p, seen, _POSITION, context)
    value = wrapped(expected + residual)
    if residual > 0:
        at = clamped(((2 * value - 1) * 1099511628 >> 9) + 2048, 1 << 53)
    elif residual < 0:
        at = clamped(((2 * value + 1) * 1099511628 >> 9) - 2048, 1 << 53)
    axes[axis] = at
    return value


def decode(
    data: Sequence[int],
    work: Ints,
    p: Ints,
    seen: Ints,
    g: Ints,
    geometry: Ints,
    rate_hz: int,
    first_record: int,
    records: int,
    out: Ints,
) -> None:
    """Decode `records` records; each becomes 16 numbers of `out`, in the schema's order.

    `p` must hold halves (32768), `seen`, `g` and `work` (7 numbers) zeros; `data` are the bytes after
    the block's header.
    """
    line = work[:4]
    axes = work[4:7]
    line[0], line[2], line[3] = 0xFFFFFFFF, 4, len(data)
    for i in range(4):
        line[1] = line[1] << 8 | (data[i] if i < len(data) else 0)
    for record in range(records):
        row = record * FIELDS
        before = row - FIELDS
        expected = (1000 * (first_record + record)) // max(rate_hz, 1)
        out[row] = (expected + number(line, data, p, seen, _TIME, 0)) & 0xFFFFFFFF
        changed = coded_bit(line, data, p, seen, _CHANGED)
        for i in range(5):
            value = out[before + 1 + i] if record else 0
            if changed:
                value = value + number(line, data, p, seen, _STATE_KINDS[i], 0)
                value = value & 0xFFFFFFFF if i == 2 else wrapped(value)
            out[row + 1 + i] = value
        for wheel in range(2):
            driven = out[row + 4 + wheel] != 0
            moved = predicted(line, data, p, seen, g, wheel * _SERIES, _TRAVEL, driven)
            value = out[before + 8 + wheel] if record else 0
            out[row + 8 + wheel] = wrapped(value + moved)
        for wheel in range(2):
            command = out[row + 4 + wheel]
            at = (2 + wheel) * _SERIES
            if out[row + 1] == _VELOCITY:
                effort = predicted(line, data, p, seen, g, at, _EFFORT_HELD, command != 0)
            else:
                residual = number(line, data, p, seen, _EFFORT_SET, 0)
                effort = wrapped((command if out[row + 1] == _EFFORT else 0) + residual)
                update(g, at, effort, residual)
            out[row + 6 + wheel] = effort
        left = wrapped(out[row + 8] - (out[before + 8] if record else 0))
        right = wrapped(out[row + 9] - (out[before + 9] if record else 0))
        interval = (out[row] - (out[before] if record else 0)) & 0xFFFFFFFF
        heading = heading_q40(geometry, wrapped(out[row + 9] - out[row + 8]))
        out[row + 10] = speed_mmps(geometry, left, interval)
        out[row + 11] = speed_mmps(geometry, right, interval)
        out[row + 14] = wrapped(heading_e4(heading) + axes[2])
        if coded_bit(line, data, p, seen, _DIFFERS):
            for i in range(2):
                residual = number(line, data, p, seen, _SPEED, 0)
                out[row + 10 + i] = wrapped(out[row + 10 + i] + residual)
            residual = number(line, data, p, seen, _HEADING, 0)
            out[row + 14] = wrapped(out[row + 14] + residual)
            axes[2] = wrapped(axes[2] + residual)
        half = heading_q40(geometry, wrapped(right - left)) >> 1
        phase = ((heading + axes[2] * 17499069 - half) >> 8) & 0xFFFFFFFF
        way = way_q32(geometry, left + right)
        for axis in range(2):
            share = sine((phase + 0x40000000) & 0xFFFFFFFF) if axis == 0 else sine(phase)
            out[row + 12 + axis] = position(
                line, data, p, seen, axes, axis, way * share >> 24, left + right == 0
            )
        out[row + 15] = predicted(line, data, p, seen, g, 4 * _SERIES, _BATTERY, False)


_FUNCTIONS = (
    *(wrapped, clamped, narrow, coded_bit, plain_bits, number),
    *(best_prediction, coding_context, update, predicted),
    *(quotient, speed_mmps, heading_q40, heading_e4, way_q32, sine, position, decode),
)


def compiled_decoder() -> Callable[..., None]:
    """`decode`, compiled; takes numpy arrays. Importing numba costs more than decoding a short log."""
    from truing.model.compiled import compiled

    names: dict[str, Any] = dict(globals())
    for function in _FUNCTIONS:
        copy = types.FunctionType(function.__code__, names, function.__name__)
        names[function.__name__] = compiled(copy)
    decoder: Callable[..., None] = names["decode"]
    return decoder
