"""Unit and sign traps of foreign recordings: found from the data, said, put right only where certain."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from truing.arrays import FloatArray
from truing.errors import RecordingError

from .foreign import Finding, ForeignTest

SIDES = ("left", "right")

# Between rows of a recorder, s: 2 kHz to 1 Hz, with some play at the slow end.
MIN_STEP_S, MAX_STEP_S = 5e-4, 2.0
UNITS = {1.0: "seconds", 1e-3: "milliseconds", 1e-6: "microseconds"}

MIN_SAMPLES = 10  # of a kind before anything is said about it
REPEATED_SHARE = 0.2  # of the moving samples
LAG_SAMPLES = 1.5  # reported speed behind differenced position
LAG_S = 0.015
LONGEST_LAG_S = 0.3
SMOOTHING_S = 0.06
CLEAR_SHARE = 0.7  # a lag is believed when it leaves less than this of the difference
SCALE_TOLERANCE = 0.1
SIDE_TOLERANCE = 0.15
# Shares of the largest motion and drive: at rest, and a drive there that friction alone does not hold.
AT_REST, HOLDING = 0.02, 0.25
STALE_ROWS = 3  # at a test's start, left over from the test before


def inspect(path: Path, tests: Sequence[ForeignTest]) -> list[Finding]:
    """Everything suspicious about the tests; time and denormal numbers are corrected in place."""
    findings = [_settle_time(path, tests)]
    for test in tests:
        findings += _denormals(test)
    findings += [_stale_start(test) for test in tests]
    findings += [_repeated(test) for test in tests]
    for side in (0,) if all(test.axis is not None for test in tests) else (0, 1):
        findings += _speed_against_position(tests, side)
    findings.append(_unequal_sides(tests))
    return [_of_axis(finding, tests) for finding in findings if finding is not None]


def turn_signs(tests: Sequence[ForeignTest]) -> list[Finding]:
    """Drives without a sign, or with that of a motor mounted the other way round, corrected in place.

    `tests`: all of one robot, of whatever files. A load that is lifted in one file and lowered in the next
    drives the motor both ways: no file alone says how the motor is wired.
    """
    if not tests:
        return []
    sides = (0,) if all(test.axis is not None for test in tests) else (0, 1)
    found = [finding for side in sides for finding in _signs(tests, side)]
    return [_of_axis(finding, tests) for finding in found]


def _of_axis(finding: Finding, tests: Sequence[ForeignTest]) -> Finding:
    """What is said of both sides, once and without a side, where both hold the numbers of one axis."""
    if not all(test.axis is not None for test in tests):
        return finding
    return replace(finding, text=re.sub(r"\b(left|right) (?=drive|position|speed)", "", finding.text))


def _settle_time(path: Path, tests: Sequence[ForeignTest]) -> Finding | None:
    """Seconds from whatever the file has; time must not run backwards.

    Recorders sample at 1 Hz to 2 kHz, so that a median step beyond 2 can be no seconds, and one beyond
    2000 no milliseconds. Where two units are possible the wheels decide, whose travel is the integral of
    their speed; where they cannot, the coarser unit stands, and that is said.
    """
    for test in tests:
        backwards = np.flatnonzero(np.diff(test.time) < 0.0)
        if backwards.size:
            row = int(backwards[0]) + 2
            raise RecordingError(path, f"time runs backwards in test {test.name!r}, its row {row}")
    step = float(np.median(np.concatenate([np.diff(test.time) for test in tests])))
    if tests[0].time_known:
        if MAX_STEP_S >= step >= MIN_STEP_S:
            return None
        text = f"rows come {step:.3g} s apart: is the unit of time right?"
        return Finding("time_unit", text)
    scale = 1e-6 if step > MAX_STEP_S * 1e3 else 1e-3 if step > MAX_STEP_S else 1.0
    alternatives = ""
    # The next finer unit is possible too when it gives a step that a recorder may have.
    if step * scale * 1e-3 >= MIN_STEP_S:
        if _travel_over_speed(tests) < 3e-3 * scale:
            scale *= 1e-3
        else:
            alternatives = f"; {UNITS[scale * 1e-3]} are possible too, and a mapping could say so"
    if scale == 1.0 and not alternatives:
        return None
    for test in tests:
        test.time = test.time * scale
    action = "converted to seconds" if scale != 1.0 else "left as they are"
    text = f"time stamps are taken as {UNITS[scale]} (median step {step:g}), {action}{alternatives}"
    return Finding("time_unit", text, corrected=scale != 1.0)


def _travel_over_speed(tests: Sequence[ForeignTest]) -> float:
    """Distance walked over the integral of the speed, in the file's own time; infinite where unknown."""
    ratios = []
    for test in tests:
        if test.position is None or test.speed is None:
            continue
        integral = np.trapezoid(np.abs(test.speed), test.time, axis=1)
        walked = np.abs(np.diff(test.position, axis=1)).sum(axis=1)
        ratios += [float(w / i) for w, i in zip(walked, integral, strict=True) if i > 0.0]
    return float(np.median(ratios)) if ratios else np.inf


def _denormals(test: ForeignTest) -> list[Finding]:
    """Numbers far below anything physical: uninitialised memory, or a division that never happened."""
    found = []
    for label, values in (("speed", test.speed), ("position", test.position)):
        if values is None:
            continue
        tiny = (values != 0.0) & (np.abs(values) < 1e-100)
        if tiny.any():
            values[tiny] = 0.0
            count = int(tiny.sum())
            text = f"{count} values of {label} lie below 1e-100, which is no measurement; taken as zero"
            found.append(Finding("denormal", text, test.name, corrected=True))
    return found


def _signs(tests: Sequence[ForeignTest], side: int) -> list[Finding]:
    """Volts without sign, or with the sign of a motor that is mounted the other way round."""
    gathered = _gather(tests, side)
    if gathered is None:
        return []
    drive, motion = gathered
    moving = (np.abs(motion) > 0.3 * np.max(np.abs(motion), initial=0.0)) & (np.abs(drive) > 0.0)
    if moving.sum() < MIN_SAMPLES:
        return []
    found = []
    both_ways = min((moving & (motion < 0.0)).sum(), (moving & (motion > 0.0)).sum()) >= MIN_SAMPLES
    if both_ways and (drive >= 0.0).all() and not _holds_a_load(drive, motion):
        commanded = all(test.command is not None for test in tests)
        for test in tests:
            given = test.command if commanded else _motion(test, side)
            assert given is not None
            _multiply(test, side, np.where(given < 0.0, -1.0, 1.0))
        source = "the command" if commanded else "the way the wheel turns"
        text = f"{SIDES[side]} drive has no sign although the wheel turns both ways; taken from {source}"
        found.append(Finding("unsigned_drive", text, corrected=True))
        gathered = _gather(tests, side)
        assert gathered is not None
        drive = gathered[0]
    agreement = float(np.mean(np.sign(drive[moving]) == np.sign(motion[moving])))
    share = f"{agreement:.0%} of the moving samples agree"
    if agreement < 0.2:
        for test in tests:
            _multiply(test, side, -np.ones_like(test.time))
        text = f"{SIDES[side]} drive and motion have opposite signs ({share}); the drive is turned round"
        found.append(Finding("opposite_sign", text, corrected=True))
    elif agreement < 0.8:
        text = f"{SIDES[side]} drive and motion agree in sign only at times ({share}); left as they are"
        found.append(Finding("mixed_sign", text))
    return found


def _holds_a_load(drive: FloatArray, motion: FloatArray) -> bool:
    """Whether the drive stays on at rest: what holds a load up keeps its sign whichever way it goes."""
    resting = np.abs(motion) < AT_REST * np.max(np.abs(motion), initial=0.0)
    return bool(
        resting.sum() >= MIN_SAMPLES and np.median(drive[resting]) > HOLDING * np.max(drive, initial=0.0)
    )


def _motion(test: ForeignTest, side: int) -> FloatArray | None:
    motion = test.motion()
    return None if motion is None else motion[side]


def _gather(tests: Sequence[ForeignTest], side: int) -> tuple[FloatArray, FloatArray] | None:
    """Drive (volts or effort) and motion of one side over all tests; None where nothing tells the motion."""
    drives, motions = [], []
    for test in tests:
        drive = test.volts if test.volts is not None else test.effort
        motion = _motion(test, side)
        if drive is None or motion is None:
            return None
        drives.append(drive[side])
        motions.append(motion)
    return np.concatenate(drives), np.concatenate(motions)


def _multiply(test: ForeignTest, side: int, factor: FloatArray) -> None:
    # Both rows of an axis hold the same numbers.
    rows = slice(None) if test.axis is not None else side
    for values in (test.volts, test.effort):
        if values is not None:
            values[rows] *= factor


def _stale_start(test: ForeignTest) -> Finding | None:
    """The first rows of a test may still hold the test before: a position that jumps at its start."""
    if test.position is None or test.position.shape[1] < 20:
        return None
    steps = np.abs(np.diff(test.position, axis=1))
    usual = np.percentile(steps, 99.0, axis=1)
    jumps = [row for row in range(STALE_ROWS) if (steps[:, row] > 5.0 * usual + 1e-9).any()]
    if not jumps:
        return None
    row = jumps[-1] + 1
    text = f"position jumps behind its row {row}: its first rows hold an earlier moment; left as they are"
    return Finding("stale_start", text, test.name)


def _repeated(test: ForeignTest) -> Finding | None:
    """Rows written faster than the encoder is read repeat the last sample."""
    motion = test.motion()
    if motion is None or test.position is None:
        return None
    still = (np.diff(test.position, axis=1) == 0.0).all(axis=0)
    fastest = np.abs(motion).max(axis=0)
    moving = fastest[1:] > 0.2 * fastest.max(initial=0.0)
    if moving.sum() < 2 * MIN_SAMPLES:
        return None
    share = float(np.mean(still[moving]))
    if share < REPEATED_SHARE:
        return None
    text = f"{share:.0%} of the rows repeat the one before while the wheels move: logged faster than read"
    return Finding("repeated_samples", text, test.name)


def _speed_against_position(tests: Sequence[ForeignTest], side: int) -> list[Finding]:
    """A reported speed that lags the differenced position was filtered; one that is off has other units.

    The lag is found first: a speed that comes late by it misses what was walked in a test's last moments.
    """
    lags = [lag for test in tests if (lag := _speed_lag(test, side)) is not None]
    if not lags:
        return []
    step = float(np.median(np.concatenate([np.diff(test.time) for test in tests])))
    lag = float(np.median(lags))
    found = []
    if lag >= max(LAG_S, LAG_SAMPLES * step):
        text = f"the reported {SIDES[side]} speed lags the differenced position by about {1e3 * lag:.0f} ms"
        found.append(Finding("filtered_speed", f"{text}: a filter in the recorder"))
    else:
        lag = 0.0
    off = [(test, ratio) for test in tests if (ratio := _travel_ratio(test, side, lag)) is not None]
    wrong = [(test, ratio) for test, ratio in off if abs(ratio - 1.0) > SCALE_TOLERANCE]
    if wrong:
        listed = ", ".join(f"{ratio:.3g} ({test.name})" for test, ratio in wrong)
        text = f"{SIDES[side]} position moves {listed} times as far as the reported speed says"
        spread = float(np.ptp([ratio for _, ratio in off]))
        one = len(wrong) == len(off) and spread < SCALE_TOLERANCE * abs(wrong[0][1])
        text += ": the units differ" if one else ": samples are lost or jump"
        found.append(Finding("speed_unit", text))
    return found


def _travel_ratio(test: ForeignTest, side: int, lag: float) -> float | None:
    """Distance by position over distance by reported speed, the speed taken `lag` seconds later."""
    if test.position is None or test.speed is None:
        return None
    time, position, speed = test.time, test.position[side], test.speed[side]
    begin, end = time[STALE_ROWS], time[-1] - lag
    if end - begin < 5.0 * lag:
        return None
    inside = (time >= begin + lag) & (time <= end + lag)
    walked = float(np.interp(end, time, position) - np.interp(begin, time, position))
    integrated = float(np.trapezoid(speed[inside], time[inside]))
    if abs(walked) < 20.0 * _resolution(position) or abs(integrated) < 1e-9:
        return None
    return walked / integrated


def _resolution(position: FloatArray) -> float:
    steps = np.abs(np.diff(position))
    steps = steps[steps > 0.0]
    return float(steps.min()) if steps.size else 0.0


def _speed_lag(test: ForeignTest, side: int) -> float | None:
    """Delay at which reported speed fits differenced position best, s; None where nothing tells."""
    if test.position is None or test.speed is None or test.time.size < 40:
        return None
    step = float(np.median(np.diff(test.time)))
    if step <= 0.0:
        return None
    even = np.arange(test.time[STALE_ROWS], test.time[-1], step)
    # Repeated positions make a differenced speed jump; the same mean on both moves neither in time.
    width = max(round(SMOOTHING_S / step), 1) | 1
    reach = min(int(LONGEST_LAG_S / step), even.size // 3)
    if even.size < 2 * width + reach:
        return None
    mean = np.full(width, 1.0 / width)
    speed = np.convolve(np.interp(even, test.time, test.speed[side]), mean, "valid")
    position = np.interp(even, test.time, test.position[side])
    differenced = np.convolve(np.gradient(position, step), mean, "valid")
    if np.std(speed) < 1e-9 or np.std(differenced) < 1e-9 or reach < 2:
        return None
    # The same rows at every lag, and the best factor for each: units must not decide.
    rows = speed.size - reach
    target = differenced[:rows]
    errors = []
    for k in range(reach):
        shifted = speed[k : k + rows]
        power = float(shifted @ shifted)
        factor = float(shifted @ target) / power if power > 0.0 else 0.0
        errors.append(float(np.mean((factor * shifted - target) ** 2)))
    best = int(np.argmin(errors))
    if best > 0 and errors[best] > CLEAR_SHARE * errors[0]:
        return None
    return best * step


def _unequal_sides(tests: Sequence[ForeignTest]) -> Finding | None:
    """Both sides of a straight test should go equally far; tests that spin are no straight tests."""
    ratios = []
    for test in tests:
        position = test.position
        if position is None and {"ticks_left", "ticks_right"} <= test.extra.keys():
            position = np.array([test.extra["ticks_left"], test.extra["ticks_right"]])
        if position is None:
            continue
        walked = position[:, -1] - position[:, min(STALE_ROWS, position.shape[1] - 1)]
        if walked[0] * walked[1] > 0.0:
            ratios.append(float(walked[1] / walked[0]))
    if not ratios or all(abs(ratio - 1.0) < SIDE_TOLERANCE for ratio in ratios):
        return None
    listed = ", ".join(f"{ratio:.2f}" for ratio in ratios)
    if len(ratios) > 1 and np.ptp(ratios) < SIDE_TOLERANCE * abs(float(np.mean(ratios))):
        cause = "the same each time, so that gearing, radius, counts per revolution or the two motors differ"
    elif len(ratios) > 1:
        cause = "from test to test: one encoder miscounts, the two motors differ, or the robot turned"
    else:
        cause = "in the only straight test: one encoder is off, the two motors differ, or the robot turned"
    return Finding("unequal_sides", f"right travel over left travel is {listed} {cause}")
