"""Arrays that the report draws: recordings and their simulations; they stay out of the JSON."""

from __future__ import annotations

from dataclasses import dataclass

from truing.arrays import BoolArray, FloatArray


@dataclass(frozen=True, slots=True)
class PoseTraces:
    """Residuals of displacement over windows: truth less prediction from measured wheel travel.

    Attributes
    ----------
    t_start_s, t_end_s : shape (m,), s.
    baseline, refit, model : shape (m, 3): forward (m), to the left (m), heading (rad), in the body's
        frame at the window's start.
    noise_sd : shape (3,) or (m, 3), the same units.
    """

    t_start_s: FloatArray
    t_end_s: FloatArray
    baseline: FloatArray
    refit: FloatArray
    model: FloatArray
    noise_sd: FloatArray


@dataclass(frozen=True, slots=True)
class RunTraces:
    """One run as measured and as simulated, for pictures; columns are left, right.

    Attributes
    ----------
    t_s, interval_s : shape (n,), s; a speed is the mean over the interval that ends at `t_s`.
    effort : shape (n, 2).
    measured, baseline, refit, model : shape (n, 2), m/s; model is refit where nothing was
        named.
    noise_sd : shape (n, 2), m/s, quantisation and disturbance together.
    valid : shape (n, 2); False where a row is not valid (first row, behind a gap, saturated).
    weight : shape (n, 2), recorded rows that each row stands for in a free-run error; None: one each.
    wheel_angle : shape (n, 2), rad, from counts or travel; None without geometry.
    heading : shape (n,), rad; None where unknown.
    start_s : when the run began, from the start of the set, s.
    """

    run: str
    t_s: FloatArray
    interval_s: FloatArray
    effort: FloatArray
    measured: FloatArray
    baseline: FloatArray
    refit: FloatArray
    model: FloatArray
    noise_sd: FloatArray
    valid: BoolArray
    wheel_angle: FloatArray | None = None
    heading: FloatArray | None = None
    start_s: float = 0.0
    pose: PoseTraces | None = None
    weight: FloatArray | None = None
