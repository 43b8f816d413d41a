"""PySINDy: a sparse differential equation of speed, from speed, effort, their products and dry friction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.errors import PeerFailedError
from truing.model.compiled import compiled
from truing.studies.real.peers.discrete import DIVERGED, quiet
from truing.studies.real.peers.peer import Peer, WheelModel
from truing.studies.real.peers.wheel_runs import WheelRun, even_interval, even_run

# Scaled by top speed and top effort, a term of less than this much of the largest is dropped.
THRESHOLD = 0.05
# Rows over which speed is smoothed before it is differentiated, and the polynomial's degree.
SMOOTHING_ROWS, SMOOTHING_DEGREE = 11, 3
# The sign of speed as a smooth function, sharp against top speed.
SHARPNESS = 50.0
SUBSTEPS = 4


@dataclass(frozen=True, slots=True)
class SparseWheel:
    """dv/dt = coefficients . (1, v, u, v|v|, u|v|, tanh(SHARPNESS v)) in multiples of `top_mps`.

    Attributes
    ----------
    coefficients : shape (6,), 1/s.
    """

    coefficients: FloatArray
    top_mps: float

    def simulate(self, run: WheelRun) -> FloatArray:
        """Free run by the midpoint rule, the effort held between rows."""
        out = np.empty(len(run))
        limit = DIVERGED * float(np.max(np.abs(run.speed_mps), initial=1e-3)) / self.top_mps
        _integrate(run.t_s, run.effort, run.initial_mps / self.top_mps, self.coefficients, limit, out)
        return np.asarray(self.top_mps * out)


@compiled
def _slope(c: FloatArray, v: float, u: float) -> float:
    size = abs(v)
    slope: float = c[0] + c[1] * v + c[2] * u + (c[3] * v + c[4] * u) * size + c[5] * math.tanh(SHARPNESS * v)
    return slope


@compiled
def _integrate(
    t_s: FloatArray, effort: FloatArray, start: float, c: FloatArray, limit: float, out: FloatArray
) -> None:
    v = start
    out[0] = v
    # Friction turns within 1 / (SHARPNESS c[5]): substeps stay below half of that.
    stiff = 1.0 / (2.0 * SHARPNESS * abs(c[5]) + abs(c[1]) + 1e-9)
    for k in range(1, len(t_s)):
        steps = max(SUBSTEPS, int((t_s[k] - t_s[k - 1]) / stiff) + 1)
        h = (t_s[k] - t_s[k - 1]) / steps
        for _ in range(steps):
            middle = v + 0.5 * h * _slope(c, v, effort[k])
            v = v + h * _slope(c, middle, effort[k])
            v = min(max(v, -limit), limit)
        out[k] = v


# Each takes speed and effort: a function of one argument would be applied to both of them.
TERMS = (
    lambda v, u: np.ones_like(v + u),
    lambda v, u: v + 0.0 * u,
    lambda v, u: u + 0.0 * v,
    lambda v, u: v * np.abs(v) + 0.0 * u,
    lambda v, u: u * np.abs(v),
    lambda v, u: np.tanh(SHARPNESS * v) + 0.0 * u,
)


def fit_sindy(runs: Sequence[WheelRun], near: WheelModel | None = None) -> WheelModel:
    """Sequentially thresholded least squares over all runs; `near` is not used."""
    del near
    interval = even_interval(runs)
    evens = [even for even in (even_run(run, interval) for run in runs) if len(even.t_s) > SMOOTHING_ROWS]
    with quiet("PySINDy"):
        import pysindy

        top = float(np.percentile(np.abs(np.concatenate([even.speed_mps for even in evens])), 98.0))
        model = pysindy.SINDy(
            optimizer=pysindy.STLSQ(threshold=THRESHOLD),
            feature_library=pysindy.CustomLibrary(list(TERMS)),
            differentiation_method=pysindy.SmoothedFiniteDifference(
                smoother_kws={"window_length": SMOOTHING_ROWS, "polyorder": SMOOTHING_DEGREE}
            ),
        )
        model.fit(
            [even.speed_mps[:, None] / top for even in evens],
            t=interval,
            u=[even.effort[:, None] for even in evens],
        )
        coefficients = np.ravel(model.coefficients()).astype(float)
        if len(coefficients) != len(TERMS) or not np.all(np.isfinite(coefficients)):
            raise PeerFailedError("PySINDy found no equation")
    return SparseWheel(coefficients, top)


SINDY = Peer("sindy", "SINDy (PySINDy)", fit_sindy, module="pysindy", library="pysindy")
