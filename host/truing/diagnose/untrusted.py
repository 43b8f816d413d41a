"""A wheel whose readings follow nothing: its encoder is at fault, and no physics is to be looked for in them.

Wheels under the same effort turn alike, or differ in a way that effort, speed or angle explain: a ratio
that stays. Readings that swing by a large share of themselves several times a second while the other
wheel turns evenly, and whose mean share of the other's changes from run to run besides, are lost counts.
An eccentric encoder swings, but keeps its mean; a weak side keeps both. (One of the real drivetrains here
reads 34 to 61 % of its other side, swinging by 23 to 30 %; the swing of the other four is 3 % at most.)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from truing.baseline import Baseline
from truing.diagnose.result import Check, Diagnosis, EffectParameter, MismatchSpan
from truing.diagnose.usable import wheel_speeds
from truing.recording import MOTION_PAIRS, WHEELS, FloatArray, RecordingSet, Run, Wheel

# Rows in which the other wheel is faster than this share of its fastest, under efforts this alike.
MOVING_SHARE, ALIKE = 0.25, 0.02
LEAST_ROWS = 20
# Readings swing about their median over this time.
SMOOTH_S = 1.0
# A fault beyond this robust spread of the swing, and this many times as much as the other wheel's own.
LEAST_SWING, SWING_TIMES = 0.12, 3.0
# ... whose share of the other wheel changes by this factor between runs.
LEAST_CHANGE = 1.25

_POSE = ("truth_x_m", "truth_y_m", "truth_theta_rad", "gyro_z_radps")


@dataclass(frozen=True, slots=True)
class Untrusted:
    """A wheel whose encoder is at fault.

    Attributes
    ----------
    shares : by run, its speed over the other wheel's under the same effort (median).
    swing : spread about that, as a share of it.
    spans : where, and how much of all that it lacks.
    """

    wheel: Wheel
    shares: dict[str, float]
    swing: float
    spans: tuple[MismatchSpan, ...]

    @property
    def other(self) -> Wheel:
        """The wheel that can be judged."""
        return "left" if self.wheel == "right" else "right"

    def check(self) -> Check:
        """What a reader should know first."""
        low, high = min(self.shares.values()), max(self.shares.values())
        text = (
            f"reads {100.0 * low:.0f} to {100.0 * high:.0f} % of the {self.other} wheel from run to run "
            f"under the same effort, swinging by {100.0 * self.swing:.0f} % at steady speed: its encoder "
            "loses counts; what the wheel itself does cannot be said"
        )
        step = "Look at the encoder's disc, coupling and leads; turn the wheel ten times by hand and count"
        return Check("encoder", text, "doubt", step, None, self.wheel)


def untrusted_wheel(recordings: RecordingSet, baseline: Baseline) -> Untrusted | None:
    """The wheel whose readings follow nothing, if one is so."""
    for column, wheel in enumerate(WHEELS):
        looks = [look for look in (_look(run, baseline, column) for run in recordings) if look is not None]
        if len(looks) < 2:
            continue
        shares = {look.run: look.share for look in looks}
        swing = float(np.median([look.swing for look in looks]))
        own, other = (float(np.median([look.roughness[k] for look in looks])) for k in (0, 1))
        change = max(shares.values()) / max(min(shares.values()), 1e-9)
        if min(shares.values()) <= 0.0 or change < LEAST_CHANGE:
            continue
        if swing > LEAST_SWING and own > SWING_TIMES * other:
            total = sum(look.lacking for look in looks)
            spans = tuple(_span(wheel, look, total) for look in looks)
            return Untrusted(wheel, shares, swing, spans)
    return None


def one_wheel(recordings: RecordingSet, wheel: Wheel) -> RecordingSet:
    """The same runs with the other wheel dead (its motion zero), and without what takes two wheels."""
    dead = 1 - WHEELS.index(wheel)

    def stripped(run: Run) -> Run:
        columns = {name: values for name, values in run.columns.items() if name not in _POSE}
        for pair in MOTION_PAIRS.values():
            if pair[dead] in columns:
                columns[pair[dead]] = np.zeros(len(run))
        return replace(run, columns=columns)

    return replace(recordings, runs=tuple(stripped(run) for run in recordings))


def with_untrusted(of_other: Diagnosis, found: Untrusted) -> Diagnosis:
    """The verdict on a set with such a wheel, from that on its other wheel alone."""
    said = [
        f"The {found.other} wheel by itself: {of_other.verdict.replace('_', ' ')}",
        ", ".join(
            f"{effect.name} {_numbers_of(effect.parameters, found.wheel)}" for effect in of_other.effects
        ),
    ]
    note = ": ".join(part for part in said if part) + f" (--wheel {found.other} says more)"
    return replace(
        of_other,
        verdict="unexplained",
        effects=(),
        mismatch=found.spans,
        next_experiment=None,
        notes=(*of_other.notes, note),
        checks=(found.check(), *of_other.checks),
    )


@dataclass(frozen=True, slots=True)
class _Look:
    """One run: the wheel's share of the other, its swing, both wheels' own roughness, what it lacks."""

    run: str
    share: float
    swing: float
    roughness: tuple[float, float]
    lacking: float
    times_s: tuple[float, float]


def _look(run: Run, baseline: Baseline, column: int) -> _Look | None:
    pair = wheel_speeds(run, baseline)
    own, other = pair[column], pair[1 - column]
    fastest = float(np.percentile(np.abs(other), 98.0))
    rows = np.abs(other) > max(MOVING_SHARE * fastest, 1e-6)
    rows &= np.abs(run.effort("left") - run.effort("right")) < ALIKE
    if rows.sum() < LEAST_ROWS or fastest <= 0.0:
        return None
    ratio = own[rows] / other[rows]
    share = float(np.median(ratio))
    times = run.t_s[rows]
    return _Look(
        run.name,
        share,
        _swing(ratio, run.interval_s) / max(abs(share), 1e-9),
        (_swing(own[rows], run.interval_s) / max(abs(share), 1e-9), _swing(other[rows], run.interval_s)),
        float(np.sum((own[rows] - other[rows]) ** 2) * run.interval_s),
        (float(times[0]), float(times[-1])),
    )


def _swing(values: FloatArray, interval_s: float) -> float:
    """Robust spread of values about their running median."""
    rows = max(3, round(SMOOTH_S / max(interval_s, 1e-6)) | 1)
    return float(1.4826 * np.median(np.abs(values - median_filter(values, min(rows, len(values))))))


def _span(wheel: Wheel, look: _Look, total: float) -> MismatchSpan:
    regime = f"{100.0 * look.share:.0f} % of the other wheel, swinging by {100.0 * look.swing:.0f} %"
    share = look.lacking / max(total, 1e-12)
    return MismatchSpan(look.run, f"vel_{wheel}_mps", *look.times_s, share, f"{regime}: counts are lost")


def _numbers_of(parameters: Mapping[str, EffectParameter], wheel: Wheel) -> str:
    """The parameters of the other wheel and of the body, in words."""
    shown = [f"{value.value:.3g} {value.unit}" for name, value in parameters.items() if wheel not in name]
    return " ".join(shown)
