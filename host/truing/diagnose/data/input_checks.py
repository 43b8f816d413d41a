"""Input checks that prevent a diagnosis: wrong units, wrong signs, no excitation."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from truing.arrays import BoolArray, FloatArray
from truing.errors import IdentifyError, RecordingError
from truing.recording.baseline import Baseline
from truing.recording.run import WHEELS, RecordingSet, Run

# docs/DATA_FORMAT.md, section 2: 1 Hz to 2 kHz; beyond, the unit of time is wrong.
INTERVALS_S = (2.5e-4, 2.0)
# Efforts below this are no excitation.
MIN_EFFORT = 0.02
# Speed over what the baseline expects, in driven rows: beyond this factor the unit is wrong, not the model.
UNIT_FACTOR = 20.0
UNITS = {
    1000.0: "mm/s instead of m/s (or times in ms)",
    100.0: "cm/s instead of m/s",
    39.37: "inches instead of metres",
    60.0: "metres per minute",
    1e-3: "times in ms, or km instead of m",
    1e-6: "times in us",
}
# Speed times the effort's sign, over |speed|, in driven rows: below this the signs disagree.
SIGN_DISAGREEMENT = -0.3
STEPS_ADVICE = "Drive steps of several levels both ways with rests between them: `truing run paper/XVII`"


def _place(run: Run) -> str:
    return str(run.path or run.name)


def check_time(run: Run) -> None:
    """Raise where the row interval shows that times are not in seconds."""
    interval = run.interval_s
    if INTERVALS_S[0] <= interval <= INTERVALS_S[1]:
        return
    guess = ""
    for unit, scale in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        if INTERVALS_S[0] <= interval * scale <= 0.5:
            guess = f": is t_s in {unit}?"
            break
    raise RecordingError(
        _place(run),
        f"rows come {interval:.4g} s apart, outside 1 Hz to 2 kHz{guess}",
        column="t_s",
        next_step="Write t_s in seconds, or let `truing import` convert the file",
    )


def _driven(effort: FloatArray) -> BoolArray:
    """Rows with a good part of the largest effort, shape (n,)."""
    sizes = np.abs(effort)
    driven: BoolArray = sizes > max(0.5 * float(np.percentile(sizes, 98.0)), MIN_EFFORT)
    return driven


def check_units(
    recordings: RecordingSet, baseline: Baseline, speeds: Sequence[tuple[FloatArray, ...]]
) -> None:
    """Raise where both wheels differ from the baseline by a factor that only a wrong unit explains."""
    ratios = []
    for column, wheel in enumerate(WHEELS):
        model = baseline.left if wheel == "left" else baseline.right
        values = []
        for run, pair in zip(recordings, speeds, strict=True):
            rows = _driven(run.effort(wheel)) & (pair[column] != 0.0)
            values.append(np.abs(pair[column][rows] / (model.gain_mps * run.effort(wheel)[rows])))
        joined = np.concatenate(values)
        if joined.size < 10:
            return
        ratios.append(float(np.percentile(joined, 75.0)))
    if not (min(ratios) > UNIT_FACTOR or max(ratios) < 1.0 / UNIT_FACTOR):
        return
    ratio = math.sqrt(ratios[0] * ratios[1])
    close = min(UNITS, key=lambda factor: abs(math.log(factor / ratio)))
    guess = f": {UNITS[close]}?" if abs(math.log(close / ratio)) < math.log(1.6) else ""
    raise IdentifyError(
        f"both wheels turn at {ratio:.3g} times the speed that the baseline gives for their efforts{guess}",
        "Look at the units of speed, position and time, and at counts_per_rev, wheel_radius_m and gain_mps",
    )


def check_signs(recordings: RecordingSet, speeds: Sequence[tuple[FloatArray, ...]]) -> None:
    """Raise for a wheel that turns against its effort."""
    for column, wheel in enumerate(WHEELS):
        opposite = []
        for run, pair in zip(recordings, speeds, strict=True):
            rows = _driven(run.effort(wheel))
            size = float(np.abs(pair[column][rows]).sum())
            along = float((pair[column][rows] * np.sign(run.effort(wheel)[rows])).sum())
            if rows.sum() >= 5 and size > 0.0 and along < SIGN_DISAGREEMENT * size:
                opposite.append(run.name)
        if not opposite:
            continue
        share = "in every run" if len(opposite) == len(recordings) else f"in {listed(opposite)}"
        raise IdentifyError(
            f"the {wheel} wheel turns against its effort {share}: "
            "motor or encoder leads swapped, or a sign lost in the recording",
            f"Put right effort_{wheel} or the {wheel} wheel's counts (`truing check` finds swapped leads)",
        )


def check_excitation(
    recordings: RecordingSet, baseline: Baseline, speeds: Sequence[tuple[FloatArray, ...]]
) -> None:
    """Raise for constant efforts on settled wheels: only the gain would be identifiable."""
    spread = max(float(np.ptp(run.effort(wheel))) for run in recordings for wheel in WHEELS)
    levels = {round(float(run.effort(wheel)[0]), 3) for run in recordings for wheel in WHEELS}
    if spread > 1e-3 or (len(levels) > 1 and _any_rise(recordings, speeds)):
        return
    if max(abs(level) for level in levels) < MIN_EFFORT:
        raise IdentifyError(
            "no excitation: the efforts are zero in every row, so there is nothing to compare", STEPS_ADVICE
        )
    if _any_rise(recordings, speeds):
        return
    gain = baseline.left.gain_mps
    raise IdentifyError(
        "constant efforts: they never change and the wheels have settled before the first row, so that "
        f"only one steady speed is recorded (the baseline's gain is {gain:.3g} m/s; friction, delay and time "
        "constant leave no trace)",
        STEPS_ADVICE,
    )


def _any_rise(recordings: RecordingSet, speeds: Sequence[tuple[FloatArray, ...]]) -> bool:
    """Whether a wheel starts well below the speed at which it ends."""
    for run, pair in zip(recordings, speeds, strict=True):
        count = max(len(run) // 10, 2)
        for values in pair:
            begin, end = abs(float(np.median(values[:2]))), abs(float(np.median(values[-count:])))
            if end > 0.0 and begin < 0.7 * end:
                return True
    return False


def listed(names: Sequence[str]) -> str:
    """Names joined for a sentence, at most four."""
    shown = list(names[:4]) + ([f"{len(names) - 4} more"] if len(names) > 4 else [])
    return shown[0] if len(shown) == 1 else ", ".join(shown[:-1]) + " and " + shown[-1]
