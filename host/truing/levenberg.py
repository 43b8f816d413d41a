"""Bounded Levenberg-Marquardt on the normal equations, for a few parameters and many residuals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Minimum:
    """Where a search ended.

    Attributes
    ----------
    theta : shape (p,).
    residual : shape (n,), weighted residuals there.
    cost : sum of the squared residuals.
    converged : whether no step of a useful size was left.
    """

    theta: FloatArray
    residual: FloatArray
    cost: float
    iterations: int
    converged: bool


@np.errstate(over="ignore", invalid="ignore")  # a step into overflow has no finite cost and is not taken
def minimise(
    residual: Callable[[FloatArray], FloatArray],
    jacobian: Callable[[FloatArray, FloatArray], FloatArray],
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    *,
    iterations: int = 60,
    tolerance: float = 1e-7,
    secant: bool = False,
) -> Minimum:
    """Minimise the sum of squared residuals inside a box.

    A parameter that stands at a bound and would leave the box is held there for the step; a step is
    cut component by component at the box. Damping follows the ratio of true to predicted decrease.

    Parameters
    ----------
    residual : theta (p,) -> (n,).
    jacobian : theta (p,), residual there (n,) -> (n, p).
    tolerance : stop when the relative decrease of the cost is below this, twice in a row.
    secant : in every other step the derivatives are those of the step before, corrected by Broyden's
        rank-one formula (Broyden 1965, Mathematics of Computation 19; each parameter in units of its own
        sensitivity). For a start near the minimum and a residual much cheaper than its derivatives.
    """
    theta = np.clip(start, lower, upper)
    r = residual(theta)
    cost = float(r @ r)
    damping, grow, quiet = 1e-3, 2.0, 0
    count = 0
    converged = False
    j: FloatArray | None = None
    while count < iterations:
        count += 1
        exact = j is None
        j = jacobian(theta, r) if j is None else j
        gradient = j.T @ r
        hessian = j.T @ j
        at_lower = (theta <= lower) & (gradient > 0.0)
        at_upper = (theta >= upper) & (gradient < 0.0)
        free = ~(at_lower | at_upper)
        if not free.any():
            converged = True
            break
        h = hessian[np.ix_(free, free)]
        scale = np.maximum(np.diag(h), 1e-12 * max(float(np.diag(h).max()), 1e-300))
        step = np.zeros_like(theta)
        accepted = False
        for _ in range(12):
            try:
                step[free] = -np.linalg.solve(h + damping * np.diag(scale), gradient[free])
            except np.linalg.LinAlgError:
                damping *= 10.0
                continue
            trial = np.clip(theta + step, lower, upper)
            moved = trial - theta
            predicted = -float(2.0 * gradient @ moved + moved @ hessian @ moved)
            r_trial = residual(trial)
            trial_cost = float(r_trial @ r_trial)
            if np.isfinite(trial_cost) and trial_cost < cost:
                accepted = True
                ratio = (cost - trial_cost) / max(predicted, 1e-300)
                damping *= max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3) if ratio < 1.0 else 1.0 / 3.0
                damping, grow = max(damping, 1e-12), 2.0
                break
            damping *= grow
            grow *= 2.0
        if not accepted and not exact:
            j, damping, grow = None, 1e-3, 2.0
            continue
        if not accepted:
            converged = True
            break
        j = _corrected(j, moved, r_trial - r) if secant and exact else None
        small = cost - trial_cost <= tolerance * cost
        theta, r, cost = trial, r_trial, trial_cost
        quiet = quiet + 1 if small else 0
        if quiet >= 2 or cost <= 1e-30:
            converged = True
            break
    return Minimum(theta, r, cost, count, converged)


def _corrected(j: FloatArray, moved: FloatArray, change: FloatArray) -> FloatArray:
    """Derivatives (n, p), corrected so that they give the residual's change (n,) along a step (p,)."""
    along = moved * (j * j).sum(axis=0)
    length = float(along @ moved)
    return j + np.outer(change - j @ moved, along / length) if length > 0.0 else j
