"""Encoder fault detection: a wheel that loses counts irregularly, from which no physics can be estimated.

Under the same effort the ratio of the wheels' speeds is constant, or depends on effort, speed or angle. A
speed that fluctuates by a large share several times a second while the other wheel turns evenly, and whose
mean ratio to the other one also changes from run to run, indicates lost counts. An eccentric encoder
fluctuates but keeps its mean; an asymmetry of the sides changes neither. (One of the real drivetrains here
reads 34 to 61 % of its other side and fluctuates by 23 to 30 %; the other four by 3 % at most.)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.data.valid_rows import wheel_speeds
from truing.diagnose.one_wheel import without_wheel
from truing.diagnose.result import Check, Diagnosis, MismatchSpan
from truing.recording.baseline import Baseline
from truing.recording.run import MOTION_PAIRS, WHEELS, RecordingSet, Run, Wheel

# Rows in which the other wheel is faster than this share of its fastest, under efforts this alike.
MOVING_SHARE, ALIKE = 0.25, 0.02
MIN_ROWS = 20
# The fluctuation is taken about the running median over this time.
SMOOTH_S = 1.0
# Relative fluctuation that indicates a fault, and its ratio to the other wheel's.
MIN_FLUCTUATION, FLUCTUATION_RATIO = 0.12, 3.0
# Ratio of the largest to the smallest mean ratio over the runs.
MIN_SHARE_CHANGE = 1.25


@dataclass(frozen=True, slots=True)
class EncoderFault:
    """A wheel whose encoder is at fault.

    Attributes
    ----------
    shares : by run, its speed over the other wheel's under the same effort (median).
    fluctuation : robust standard deviation about that, relative.
    error_mps : RMS difference from the other wheel under the same effort.
    spans : where, with their shares of the error.
    """

    wheel: Wheel
    shares: dict[str, float]
    fluctuation: float
    error_mps: float
    spans: tuple[MismatchSpan, ...]

    @property
    def other(self) -> Wheel:
        """The wheel without a fault."""
        return "left" if self.wheel == "right" else "right"

    def check(self) -> Check:
        """The warning about it."""
        low, high = min(self.shares.values()), max(self.shares.values())
        text = (
            f"reads {100.0 * low:.0f} to {100.0 * high:.0f} % of the {self.other} wheel from run to run "
            f"under the same effort, and fluctuates by {100.0 * self.fluctuation:.0f} % at steady speed: its "
            "encoder loses counts, or the two motors are not alike (another motor, a driver that limits, a "
            "wheel that binds); from these recordings the two cannot be distinguished"
        )
        step = (
            "Turn the wheel ten times by hand and count: right counts clear the encoder, and the motor or "
            "its driver is the cause; else look at the encoder's disc, coupling and leads"
        )
        return Check("encoder", text, "warning", step, None, self.wheel)


def find_encoder_fault(recordings: RecordingSet, baseline: Baseline) -> EncoderFault | None:
    """The wheel with an encoder fault, if any."""
    for column, wheel in enumerate(WHEELS):
        ratios = [
            ratio for ratio in (_run_ratio(run, baseline, column) for run in recordings) if ratio is not None
        ]
        if len(ratios) < 2:
            continue
        shares = {ratio.run: ratio.share for ratio in ratios}
        fluctuation = float(np.median([ratio.fluctuation for ratio in ratios]))
        own, other = (float(np.median([ratio.roughness[k] for ratio in ratios])) for k in (0, 1))
        change = max(shares.values()) / max(min(shares.values()), 1e-9)
        if min(shares.values()) <= 0.0 or change < MIN_SHARE_CHANGE:
            continue
        if fluctuation > MIN_FLUCTUATION and own > FLUCTUATION_RATIO * other:
            total = sum(ratio.error_energy for ratio in ratios)
            spans = tuple(_span(wheel, ratio, total) for ratio in ratios)
            error_mps = float(np.sqrt(total / sum(ratio.moving_s for ratio in ratios)))
            return EncoderFault(wheel, shares, fluctuation, error_mps, spans)
    return None


def one_wheel(recordings: RecordingSet, wheel: Wheel) -> RecordingSet:
    """The same runs with the other wheel's motion set to zero, and without signals that need two wheels."""
    dead = 1 - WHEELS.index(wheel)

    def stripped(run: Run) -> Run:
        columns = dict(run.columns)
        for pair in MOTION_PAIRS.values():
            if pair[dead] in columns:
                columns[pair[dead]] = np.zeros(len(run))
        return replace(run, columns=columns)

    return replace(recordings, runs=tuple(stripped(run) for run in recordings.without_pose()))


def with_encoder_fault(of_other: Diagnosis, found: EncoderFault) -> Diagnosis:
    """The result for a set with an encoder fault, from that of its other wheel alone.

    What that wheel's diagnosis names is named of that wheel; what the faulty one does is left over.
    """
    verdict = of_other.verdict.replace("_", " ")
    note = f"The {found.other} wheel by itself: {verdict} (details: --wheel {found.other})"
    return replace(
        of_other,
        verdict="partly_explained" if of_other.effects else "unexplained",
        effects=tuple(
            replace(one, scope=found.other, parameters=without_wheel(one.parameters, found.wheel))
            for one in of_other.effects
        ),
        mismatch=found.spans,
        left_over_share=_left_over(of_other, found),
        next_experiment=None,
        notes=(*of_other.notes, note),
        checks=(found.check(), *of_other.checks),
    )


def _left_over(of_other: Diagnosis, found: EncoderFault) -> float:
    """Share of the mismatch of both wheels that nothing explains: all of the faulty wheel's."""
    sound = max(of_other.fit.refit_rmse**2 - of_other.fit.noise_floor**2, 0.0)
    faulty = found.error_mps**2
    return (of_other.left_over_share * sound + faulty) / (sound + faulty)


@dataclass(frozen=True, slots=True)
class _RunRatio:
    """One run: ratio to the other wheel, its fluctuation, that of both wheels alone, energy of the error.

    `moving_s` is the time that the energy was summed over.
    """

    run: str
    share: float
    fluctuation: float
    roughness: tuple[float, float]
    error_energy: float
    moving_s: float
    times_s: tuple[float, float]


def _run_ratio(run: Run, baseline: Baseline, column: int) -> _RunRatio | None:
    pair = wheel_speeds(run, baseline)
    own, other = pair[column], pair[1 - column]
    fastest = float(np.percentile(np.abs(other), 98.0))
    rows = np.abs(other) > max(MOVING_SHARE * fastest, 1e-6)
    rows &= np.abs(run.effort("left") - run.effort("right")) < ALIKE
    if rows.sum() < MIN_ROWS or fastest <= 0.0:
        return None
    speed_ratio = own[rows] / other[rows]
    share = float(np.median(speed_ratio))
    times = run.t_s[rows]
    return _RunRatio(
        run.name,
        share,
        _fluctuation(speed_ratio, run.interval_s) / max(abs(share), 1e-9),
        (
            _fluctuation(own[rows], run.interval_s) / max(abs(share), 1e-9),
            _fluctuation(other[rows], run.interval_s),
        ),
        float(np.sum((own[rows] - other[rows]) ** 2) * run.interval_s),
        float(rows.sum() * run.interval_s),
        (float(times[0]), float(times[-1])),
    )


def _fluctuation(values: FloatArray, interval_s: float) -> float:
    """Robust standard deviation of values about their running median."""
    from scipy.ndimage import median_filter

    rows = max(3, round(SMOOTH_S / max(interval_s, 1e-6)) | 1)
    return float(1.4826 * np.median(np.abs(values - median_filter(values, min(rows, len(values))))))


def _span(wheel: Wheel, ratio: _RunRatio, total: float) -> MismatchSpan:
    regime = (
        f"{100.0 * ratio.share:.0f} % of the other wheel, fluctuating by {100.0 * ratio.fluctuation:.0f} %"
    )
    share = ratio.error_energy / max(total, 1e-12)
    regime += ": lost counts, or another motor"
    return MismatchSpan(ratio.run, f"vel_{wheel}_mps", *ratio.times_s, share, regime)
