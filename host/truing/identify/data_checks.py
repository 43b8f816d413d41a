"""What looks wrong with a recording before any model is fitted: said in words, never repaired."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import BoolArray, FloatArray
from truing.errors import IdentifyError
from truing.recording.held_load import held_load
from truing.recording.inverse_dynamics import drowned_damping
from truing.recording.run import MOTION_PAIRS, WHEELS, Geometry, RecordingSet, Run, Wheel

# Beyond these it is not a robot: volts, microseconds or a damaged file.
LARGEST_EFFORT = 1000.0
LARGEST_SPEED_MPS = 1000.0
# Of a single axis, rad/s or m/s: ultracentrifuges turn slower.
LARGEST_AXIS_SPEED = 1e5
# Wheels under the same effort should turn alike; a slower one below this share is worth a word.
ALIKE_SHARE = 0.8
# Wheels that were driven apart are compared again after this long under the same effort, s.
SETTLED_S = 1.0
# Rows faster than this share of the fastest show what an encoder does.
MOVING_SHARE = 0.25
# A speed that repeats itself this often while moving is updated more slowly than it is logged.
REPEATED_SHARE = 0.5
# A position step this many times larger than the speed allows is a reset, not travel.
RESET_FACTOR = 10.0


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that a reader should know about a run (or a wheel of it)."""

    run: str
    text: str
    wheel: Wheel | None = None
    topic: str = ""

    @property
    def place(self) -> str:
        """The run, and the wheel if it is about one."""
        return self.run if self.wheel is None else f"{self.run} {self.wheel}"

    def __str__(self) -> str:
        where = self.run if self.wheel is None else f"{self.run}, {self.wheel} wheel"
        return f"{where}: {self.text}"


def refuse_absurd(recordings: RecordingSet) -> None:
    """Stop at numbers that no wheeled robot makes; arithmetic on them would only hide where they are."""
    for run in recordings:
        for wheel in recordings.wheels:
            effort, speed = run.effort(wheel), run.speed(wheel, recordings.robot)
            _refuse_beyond(run, wheel, f"effort_{wheel}", effort, LARGEST_EFFORT, "")
            column = f"speed from {MOTION_PAIRS[speed.source][WHEELS.index(wheel)]}"
            largest = LARGEST_SPEED_MPS if run.axis is None else LARGEST_AXIS_SPEED
            _refuse_beyond(run, wheel, column, speed.values, largest, " m/s" if run.axis is None else "")


def _refuse_beyond(run: Run, wheel: Wheel, column: str, values: FloatArray, limit: float, unit: str) -> None:
    sizes = np.abs(values)
    row = int(np.argmax(sizes))
    if not sizes[row] <= limit:
        place = f"{run.path or run.name}: {column}, row {row + 1}"
        raise IdentifyError(
            f"{place}: {values[row]:.3g}{unit} is not what a {wheel} wheel does",
            "Look at that row, at the unit of the column, and at the geometry in the baseline",
        )


def check_set(recordings: RecordingSet) -> tuple[Finding, ...]:
    """Everything that looks wrong with a set, run by run."""
    found: list[Finding] = []
    for run in recordings:
        found.extend(Finding(run.name, text) for text in run.warnings)
        found.extend(_check_time(run))
        for wheel in recordings.wheels:
            found.extend(_check_effort(run, wheel))
            found.extend(_check_motion(run, wheel, recordings.robot))
            found.extend(_check_position(run, wheel))
        if run.axis is None:
            found.extend(_check_sides(run, recordings.robot))
    scattered = [
        Finding("all runs", drowned.text(), wheel, "scatter")
        for wheel in recordings.wheels
        if (drowned := drowned_damping(recordings, wheel)) is not None
    ]
    load = held_load(recordings)
    if load is None:
        return (*scattered, *found)
    # Efforts of one sign both ways are the load's, and no lead is swapped.
    said = load.text() + ("" if recordings.held_load is None else "; it is taken out of every effort")
    first = Finding("all runs", said, recordings.wheels[0], "load")
    return (*scattered, first, *(finding for finding in found if finding.topic != "sign"))


def summarise(findings: Sequence[Finding]) -> list[str]:
    """One line per topic, its first finding in full, the others by name."""
    groups: dict[str, list[Finding]] = {}
    for finding in findings:
        groups.setdefault(finding.topic or finding.text, []).append(finding)
    lines = []
    for group in groups.values():
        others = ", ".join(finding.place for finding in group[1:4])
        more = f" and {len(group) - 4} more" if len(group) > 4 else ""
        lines.append(f"{group[0]}" + (f" (also {others}{more})" if others else ""))
    return lines


def _check_time(run: Run) -> list[Finding]:
    gaps = run.gaps()
    if gaps.size == 0:
        return []
    lengths = run.t_s[gaps] - run.t_s[gaps - 1]
    worst = int(np.argmax(lengths))
    count = "a gap" if gaps.size == 1 else f"{gaps.size} gaps, the longest"
    place = f"{run.t_s[gaps[worst] - 1]:.2f} s"
    text = f"{count} of {lengths[worst]:.2f} s at {place}; fits start afresh behind it"
    return [Finding(run.name, text, None, "gap")]


def _check_effort(run: Run, wheel: Wheel) -> list[Finding]:
    largest = float(np.abs(run.effort(wheel)).max())
    if largest <= 1.0 + 1e-6:
        return []
    row = int(np.abs(run.effort(wheel)).argmax()) + 1
    text = f"effort reaches {largest:.3g} (row {row}), beyond -1..1: are these volts or per cent?"
    return [Finding(run.name, text, wheel, "effort")]


def _check_motion(run: Run, wheel: Wheel, baseline: Geometry | None) -> list[Finding]:
    effort = run.effort(wheel)
    measured = run.speed(wheel, baseline)
    speed = measured.values
    if float(np.percentile(np.abs(effort), 98)) < 0.1:
        return []
    if not (speed != 0.0).any():
        largest = 100.0 * float(np.abs(effort).max())
        text = f"driven at up to {largest:.0f} % effort, yet no motion: encoder dead or wheel stuck"
        return [Finding(run.name, text, wheel, "dead")]
    found = []
    driven = np.abs(effort) > 0.5 * np.percentile(np.abs(effort), 98)
    if float(np.mean(speed[driven] * np.sign(effort[driven]))) < 0.0:
        text = "turns against its effort: motor or encoder leads swapped"
        found.append(Finding(run.name, text, wheel, "sign"))
    moving = np.abs(speed) > MOVING_SHARE * np.percentile(np.abs(speed), 98)
    pairs = moving[1:] & moving[:-1]
    # Counts repeat for a good reason: they are whole numbers.
    if measured.source != "ticks" and pairs.sum() >= 20 and _falls_and_rises(run, wheel):
        repeated = float(np.mean(np.diff(speed)[pairs] == 0.0))
        if repeated > REPEATED_SHARE:
            share = 100.0 * repeated
            text = f"{share:.0f} % of the speeds repeat the row before: updated more slowly than logged"
            found.append(Finding(run.name, text, wheel, "repeated"))
    return found


def _falls_and_rises(run: Run, wheel: Wheel) -> bool:
    """Whether the speed column is fine enough that repeats are not just its resolution."""
    values = run.columns.get(f"vel_{wheel}_mps")
    return values is not None and np.unique(values).size > 20


def _check_position(run: Run, wheel: Wheel) -> list[Finding]:
    if not (run.has_pair("pos") and run.has_pair("vel")):
        return []
    travel = np.abs(np.diff(run.columns[f"pos_{wheel}_m"]))
    fastest = float(np.percentile(np.abs(run.columns[f"vel_{wheel}_mps"]), 98))
    jumps = np.flatnonzero(travel > RESET_FACTOR * fastest * np.maximum(np.diff(run.t_s), run.interval_s))
    if fastest == 0.0 or jumps.size == 0:
        return []
    row = int(jumps[0]) + 2
    text = f"position jumps by {travel[jumps[0]]:.3g} m at row {row} (a counter reset?); the speeds do not"
    return [Finding(run.name, text, wheel, "jump")]


def _lasting(holds: BoolArray, rows: int) -> BoolArray:
    """Where `holds` (n,) has been true for so many rows before: wheels driven apart take time to meet."""
    index = np.arange(len(holds))
    last_false = np.maximum.accumulate(np.where(holds, -1, index))
    return np.asarray(index - last_false > rows)


def _check_sides(run: Run, baseline: Geometry | None) -> list[Finding]:
    """One wheel much slower than the other under the same effort."""
    left, right = (run.speed(wheel, baseline).values for wheel in WHEELS)
    efforts = [run.effort(wheel) for wheel in WHEELS]
    largest = float(np.percentile(np.abs(efforts), 98))
    same = np.abs(efforts[0] - efforts[1]) < 0.05 * largest
    fastest = np.maximum(np.abs(left), np.abs(right))
    same &= _lasting(same, max(1, round(SETTLED_S / run.interval_s)))
    rows = same & (fastest > MOVING_SHARE * np.percentile(fastest, 98))
    if rows.sum() < 20 or largest < 0.02:
        return []
    ratio, slow, fast = _slower(left[rows], right[rows])
    if float(np.median(ratio)) >= ALIKE_SHARE:
        return []
    low, middle, high = np.percentile(ratio, [10, 50, 90])
    text = (
        f"turns at {100 * middle:.0f} % of the {fast} wheel's speed under the same effort "
        f"({100 * low:.0f} to {100 * high:.0f} % in most rows): "
    )
    wander = high - low > 0.15
    text += (
        "its encoder miscounts, or the two motors, drivers or loads are not alike"
        if wander
        else "its counts per revolution, radius or gearing differ, or the two motors do"
    )
    return [Finding(run.name, text, slow, "sides")]


def _slower(left: FloatArray, right: FloatArray) -> tuple[FloatArray, Wheel, Wheel]:
    """Speed of the slower wheel over the faster one's, row by row, and which they are."""
    if np.abs(left).mean() < np.abs(right).mean():
        return np.abs(left) / np.maximum(np.abs(right), 1e-9), "left", "right"
    return np.abs(right) / np.maximum(np.abs(left), 1e-9), "right", "left"
