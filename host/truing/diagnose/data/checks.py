"""Data checks before a diagnosis: errors that prevent it, rows and effects left out, warnings, notes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import BoolArray
from truing.diagnose.data.input_checks import (
    MIN_EFFORT,
    STEPS_ADVICE,
    check_excitation,
    check_signs,
    check_time,
    check_units,
    listed,
)
from truing.diagnose.data.valid_rows import Pair, jumps, moves, valid_rows, wheel_speeds
from truing.diagnose.result import Check, Severity
from truing.errors import IdentifyError
from truing.identify.data_checks import Finding, check_set
from truing.identify.effort_checks import refuse_efforts
from truing.identify.effort_row import effort_row
from truing.recording.baseline import Baseline
from truing.recording.run import MINIMUM_ROWS, TRUTH_COLUMNS, WHEELS, RecordingSet, Run, Wheel

# 16, 24 and 32 bit counters wrap by these.
COUNTER_SPANS = (2.0**16, 2.0**24, 2.0**32)
FULL_SCALE = 0.995
# Share of the driven rows with opposite efforts above which the robot only turns on the spot.
OPPOSITE_SHARE = 0.98

POSE_EFFECTS = ("wheel_slip", "wheel_radius_error", "wheelbase_error")
FAST_EFFECTS = (
    *("input_delay", "driver_lag", "speed_filter", "coast_decay"),
    *("current_limit", "gear_backlash"),
)

# What `check_set` finds, by its topic: how much it matters, and what to do.
_KNOWN: dict[str, tuple[Severity, str]] = {
    "gap": ("note", ""),
    "effort": ("warning", "Efforts are fractions of the supply; divide volts by the supply voltage"),
    "repeated": ("warning", "Log at the rate at which the speed is updated, or log counts"),
    "jump": ("warning", "Log counts beside positions, or do not reset positions within a run"),
    "load": (
        "warning",
        "Add the load to the simulation as a constant effort, or balance it, and record steps both ways: a "
        "model found here has the efforts beyond it as its input",
    ),
    "scatter": (
        "warning",
        "Record steps of effort without a speed controller: these efforts say what friction takes, and "
        "nothing of the speed",
    ),
    "sides": ("warning", "Turn each wheel ten times by hand and compare its counts with the baseline's"),
}


@dataclass(frozen=True, slots=True)
class DataChecks:
    """What the data allow.

    Attributes
    ----------
    checks : all findings, warnings first.
    usable : per run, shape (n, 2); False where a row is not a valid measurement of a wheel.
    wheels : the wheels that move.
    geometry : whether counts become metres and wheel travel a pose.
    outside_pose : whether any run holds a pose from outside the robot.
    blocked : effects that are not identifiable.
    """

    checks: tuple[Check, ...]
    valid: tuple[BoolArray, ...]
    wheels: tuple[Wheel, ...]
    geometry: bool
    outside_pose: bool
    blocked: tuple[str, ...]


def check_data(recordings: RecordingSet) -> DataChecks:
    """Check recordings before anything is fitted.

    Raises
    ------
    RecordingError, IdentifyError : no verdict is possible; says why, where, and what to do.
    """
    baseline = recordings.baseline
    if baseline is None:
        raise IdentifyError(
            f"{recordings.path or recordings.name}: there is no baseline to compare with",
            "Give --model a baseline.toml: [wheel.left] and [wheel.right] with gain_mps and time_constant_s",
        )
    if not recordings.runs:
        raise IdentifyError(f"{recordings.path or recordings.name}: there is no run in it")
    for run in recordings:
        check_time(run)
    refuse_efforts(recordings)
    speeds = [wheel_speeds(run, baseline) for run in recordings]
    check_units(recordings, baseline, speeds)
    check_signs(recordings, speeds)
    wheels, found = _movable(recordings, speeds)
    check_excitation(recordings, baseline, speeds)

    valid = valid_rows(recordings.runs, baseline, speeds)
    for run, pair in zip(recordings, speeds, strict=True):
        found += _jumps(run, baseline, pair)
    if sum(int(mask.sum()) for mask in valid) < MINIMUM_ROWS:
        raise IdentifyError(
            f"fewer than {MINIMUM_ROWS} rows are left to compare once jumps are set aside",
            "Look at the counts: a loose plug or a counter that resets looks like this",
        )
    found += _from_findings(check_set(recordings))
    found += [check for inspect in _INSPECTIONS for check in inspect(recordings, baseline)]
    found.sort(key=lambda check: check.severity != "warning")
    blocked = sorted({name for check in found for name in check.blocks})
    return DataChecks(
        tuple(found),
        tuple(valid),
        wheels,
        baseline.metres_per_count is not None and baseline.wheelbase_m is not None,
        any(_has_outside_pose(run) for run in recordings),
        tuple(blocked),
    )


def _movable(recordings: RecordingSet, speeds: Sequence[Pair]) -> tuple[tuple[Wheel, ...], list[Check]]:
    """The wheels that moved, and checks about the others."""
    moving, found = [], []
    for column, wheel in enumerate(WHEELS):
        if moves(speeds, column):
            moving.append(wheel)
            continue
        largest = max(float(np.abs(run.effort(wheel)).max()) for run in recordings)
        if largest < MIN_EFFORT:
            text = f"the {wheel} wheel is never driven and never moves: it is not diagnosed"
            found.append(Check("dead", text, "warning", STEPS_ADVICE, None, wheel))
        else:
            text = (
                f"the {wheel} wheel never moves, though driven with up to {100.0 * largest:.0f} % effort: "
                "encoder dead, or wheel stuck; its physics is not identifiable"
            )
            step = "`truing check` turns each wheel and names the lead; then record again"
            found.append(Check("dead", text, "warning", step, None, wheel))
    if not moving:
        largest = max(float(np.abs(run.effort(wheel)).max()) for run in recordings for wheel in WHEELS)
        if largest < MIN_EFFORT:
            raise IdentifyError(
                "no excitation: no run drives a wheel, so there is nothing to compare", STEPS_ADVICE
            )
        raise IdentifyError(
            f"neither wheel ever moves, though driven with up to {100.0 * largest:.0f} % effort",
            "Look at the encoders: `truing check` turns each wheel and names the lead",
        )
    return tuple(moving), found


def _jumps(run: Run, baseline: Baseline, speeds: Pair) -> Iterator[Check]:
    """Checks about rows whose speed no wheel of this robot can have."""
    for column, wheel in enumerate(WHEELS):
        bad = jumps(run, baseline, speeds[column], column)
        if not bad.any():
            continue
        # A single sample off and back makes two bad intervals; the first row repeats the second's speed.
        row = int(np.flatnonzero(bad)[0]) + 1
        count = int(bad.sum())
        what = f"{count} rows jump" if count > 1 else f"row {row} jumps"
        place = f", the first at row {row}" if count > 1 else ""
        text = f"{what} by more than the wheel can turn{place}{_counter(run, wheel, bad)}; left out"
        yield Check("jump", text, "warning", "Look at that row of the file", run.name, wheel)


def _counter(run: Run, wheel: Wheel, bad: BoolArray) -> str:
    ticks = run.columns.get(f"ticks_{wheel}")
    if ticks is None:
        return ""
    row = max(int(np.flatnonzero(bad)[0]), 1)
    step = abs(float(ticks[row] - ticks[row - 1]))
    for span in COUNTER_SPANS:
        if abs(step - span) < 0.25 * span:
            return f" (a counter that wraps at {span:.0f})"
    return " (a counter that was reset)" if abs(ticks[row]) < 0.05 * abs(ticks[row - 1]) else ""


def _from_findings(findings: Sequence[Finding]) -> list[Check]:
    """Findings of the general checks with their severity for a diagnosis; one check per topic."""
    groups: dict[str, list[Finding]] = {}
    for finding in findings:
        if finding.topic not in ("dead", "sign", "jump"):
            groups.setdefault(finding.topic or finding.text, []).append(finding)
    checks = []
    for topic, group in groups.items():
        severity, step = _KNOWN.get(topic, ("note", ""))
        first = group[0]
        others = ", ".join(finding.place for finding in group[1:4])
        more = f" and {len(group) - 4} more" if len(group) > 4 else ""
        text = first.text + (f" (also {others}{more})" if others else "")
        kind = topic if topic in _KNOWN else "file"
        checks.append(Check(kind, text, severity, step, first.run, first.wheel))
    return checks


def _few_runs(recordings: RecordingSet, baseline: Baseline) -> Iterator[Check]:
    del baseline
    if len(recordings) == 1:
        text = (
            "one run only: it is cut into parts for cross-validation, but what differs from run to run "
            "(supply, temperature, payload) is not distinguishable from the robot itself"
        )
        step = "Record at least four runs, some of them alike: their differences are the noise"
        yield Check("few_runs", text, "warning", step)
    elif len(recordings) < 4:
        text = f"{len(recordings)} runs only: little data for cross-validation"
        yield Check("few_runs", text, "note", "Record at least four runs, some of them alike")


def _one_sided(recordings: RecordingSet, baseline: Baseline) -> Iterator[Check]:
    del baseline
    lowest = min(float(run.effort(wheel).min()) for run in recordings for wheel in WHEELS)
    highest = max(float(run.effort(wheel).max()) for run in recordings for wheel in WHEELS)
    if lowest > -MIN_EFFORT or highest < MIN_EFFORT:
        way = "forward" if lowest > -MIN_EFFORT else "backward"
        text = f"the wheels are only ever driven {way}: what depends on direction or reversal is not excited"
        step = "Add a run that reverses at several levels"
        blocks = ("direction_asymmetry",)
        yield Check("one_sided", text, "note", step, blocks=blocks)


def _effort_row(recordings: RecordingSet, baseline: Baseline) -> Iterator[Check]:
    del baseline
    found = effort_row(recordings)
    if found is not None and found.sentence():
        yield Check("effort_row", found.sentence(), "warning", found.advice(), None, found.wheel)


def _straight(recordings: RecordingSet, baseline: Baseline) -> Iterator[Check]:
    del baseline
    differ = max(float(np.abs(run.effort("left") - run.effort("right")).max()) for run in recordings)
    if differ < MIN_EFFORT:
        text = "both wheels always get the same effort: how they act on each other is not excited"
        step = "Add a run with one wheel against the other, and one with one wheel alone"
        yield Check("straight", text, "note", step, blocks=("turning_scrub", "inertia_coupling"))


def _on_the_spot(recordings: RecordingSet, baseline: Baseline) -> Iterator[Check]:
    del baseline
    if _is_opposite(recordings):
        text = (
            "the robot only turns on the spot: scrub in turns is one with friction of the wheels, and the "
            "inertia in turns with theirs"
        )
        step = "Add a straight run, and one with one wheel alone"
        yield Check("on_the_spot", text, "note", step, blocks=("turning_scrub", "inertia_coupling"))


def _is_opposite(recordings: RecordingSet) -> bool:
    """Whether the wheels' efforts are opposite in nearly every row in which both are driven."""
    pairs = [np.stack([run.effort("left"), run.effort("right")], axis=1) for run in recordings]
    efforts = np.concatenate(pairs)
    driven = efforts[(np.abs(efforts) > MIN_EFFORT).any(axis=1)]
    return len(driven) > 0 and float(np.mean(driven[:, 0] * driven[:, 1] < 0.0)) > OPPOSITE_SHARE


def _saturation(recordings: RecordingSet, baseline: Baseline) -> Iterator[Check]:
    del baseline
    for wheel in WHEELS:
        full = sum(int((np.abs(run.effort(wheel)) >= FULL_SCALE).sum()) for run in recordings)
        rows = sum(len(run) for run in recordings)
        if full > 0.05 * rows:
            text = f"effort is at full scale in {100.0 * full / rows:.0f} % of the rows"
            yield Check("full_scale", text, "note", "", None, wheel)


def _slow_log(recordings: RecordingSet, baseline: Baseline) -> Iterator[Check]:
    fastest = min(baseline.left.time_constant_s, baseline.right.time_constant_s)
    for run in recordings:
        if run.interval_s > 2.0 * fastest:
            text = (
                f"rows come {run.interval_s:.3g} s apart, and the baseline's wheels settle within that: "
                "delays, lags and time constants are not identifiable"
            )
            step = f"Log at {math.ceil(4.0 / fastest):d} Hz or more"
            yield Check("slow_log", text, "warning", step, run.name, blocks=FAST_EFFECTS)
            return


def _geometry(recordings: RecordingSet, baseline: Baseline) -> Iterator[Check]:
    robot = baseline.robot
    missing = [
        name
        for name in ("wheel_radius_m", "wheelbase_m", "counts_per_rev")
        if robot is None or getattr(robot, name) is None
    ]
    pose = any(_has_outside_pose(run) for run in recordings)
    if missing:
        lacks = "has no [robot]" if robot is None else f"[robot] lacks {listed(missing)}"
        blocks: tuple[str, ...] = ()
        if "wheelbase_m" in missing:
            blocks = (*POSE_EFFECTS, "heading_drift")
        elif not any(run.has_pair("pos") for run in recordings) and "counts_per_rev" in missing:
            blocks = POSE_EFFECTS
        text = f"the baseline {lacks}: " + (
            "only the wheels' speeds are diagnosed" if blocks else "what depends on it is not diagnosed"
        )
        step = "Add [robot] with wheel_radius_m, wheelbase_m and counts_per_rev to the baseline"
        yield Check("geometry", text, "note", step, blocks=blocks)
    if not pose:
        text = "no pose from outside the robot: odometry errors are not identifiable"
        step = "Mark start and end of a run on the floor and write truth_x_m, truth_y_m, truth_theta_rad"
        # A yaw rate measures how the robot turns, not how far it goes.
        turns = any("gyro_z_radps" in run.columns for run in recordings)
        yield Check("no_pose", text, "note", step, blocks=("wheel_slip",) if turns else POSE_EFFECTS)


def _has_outside_pose(run: Run) -> bool:
    return all(name in run.columns for name in TRUTH_COLUMNS)


_INSPECTIONS: tuple[Callable[[RecordingSet, Baseline], Iterator[Check]], ...] = (
    _few_runs,
    _one_sided,
    _straight,
    _on_the_spot,
    _saturation,
    _slow_log,
    _geometry,
    _effort_row,
)
