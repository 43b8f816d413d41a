"""What the recordings say of their recorder: renewal, lateness, smoothing and resolution of each signal."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.data.recorder import Renewal, renewals
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effects.speed_filter import direct_lag
from truing.diagnose.result import RecordedSignal
from truing.recording.run import RecordingSet

# Delays of a recorded speed are looked for up to this, in this many steps.
MAX_LATE_S, LATE_STEPS = 0.3, 61


def recorded_signals(recordings: RecordingSet, data: SetData) -> dict[str, RecordedSignal]:
    """The recorder of each wheel's speed, by signal."""
    filter_s = math.nan
    if data.recorded_vel_mps is not None and data.position_speed_mps is not None:
        lag = direct_lag(data)
        filter_s = math.nan if lag is None else lag.time_constant_s
    return {
        f"speed_{side}": _signal(each, data, wheel, filter_s)
        for wheel, (side, each) in enumerate(zip(("left", "right"), renewals(recordings), strict=True))
    }


def _signal(each: Renewal, data: SetData, wheel: int, filter_s: float) -> RecordedSignal:
    return RecordedSignal(
        each.every_s,
        _late_s(data, wheel),
        filter_s,
        data.resolution_mps if data.source != "vel" else each.resolution,
        instant=data.instant,
    )


def _late_s(data: SetData, wheel: int) -> float:
    """Delay of a recorded speed against its own positions or counts, s; NaN where either is missing.

    The integral of a delayed speed is the delayed travel. Travels are compared, since differences of
    positions that are themselves held say little.
    """
    reported = data.recorded_vel_mps
    if reported is None or data.position_speed_mps is None or not np.any(data.travel_m[:, wheel]):
        return math.nan
    shifts = np.linspace(0.0, MAX_LATE_S, LATE_STEPS)
    sizes = [_misfit(data, reported[:, wheel], data.travel_m[:, wheel], shift) for shift in shifts]
    return float(shifts[int(np.argmin(sizes))])


def _misfit(data: SetData, speed: FloatArray, travel: FloatArray, shift_s: float) -> float:
    """Squared difference of the integrated speed and the travel so much earlier, at its best scale."""
    total = 0.0
    for a, b in pairwise(data.starts):
        integral = np.cumsum(speed[a:b] * data.dt_s[a:b])
        earlier = np.interp(data.t_s[a:b] - shift_s, data.t_s[a:b], travel[a:b])
        integral, earlier = integral - integral.mean(), earlier - earlier.mean()
        power = float(earlier @ earlier)
        scale = float(integral @ earlier) / power if power > 0.0 else 0.0
        total += float(np.sum((integral - scale * earlier) ** 2))
    return total
