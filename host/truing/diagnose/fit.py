"""Fits of nested model structures by free-run simulation error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.problem import Column, Problem, Residual
from truing.levenberg import minimise


@dataclass(frozen=True, slots=True)
class Fit:
    """A fitted model structure.

    Attributes
    ----------
    effects : added to the baseline, in the order in which they were added.
    theta : shape (p,), the simulator's whole vector.
    columns : the free parameters.
    residual : at `theta`.
    """

    effects: tuple[str, ...]
    theta: FloatArray
    columns: tuple[Column, ...]
    residual: Residual

    @property
    def cost(self) -> float:
        """Huber loss of the whitened residual, summed."""
        flat = self.residual.flat()
        return float(flat @ flat)

    @property
    def size(self) -> int:
        """Number of free parameters."""
        return len(self.columns)

    def value(self, column: str) -> float:
        """The fitted value of a column."""
        for one in self.columns:
            if one.name == column:
                return float(self.theta[one.entries[0]])
        raise KeyError(column)


def fit(
    problem: Problem,
    effects: tuple[str, ...],
    start: FloatArray,
    *,
    columns: tuple[Column, ...] | None = None,
    iterations: int = 15,
    tolerance: float = 1e-4,
    secant: bool = False,
) -> Fit:
    """Minimise the whitened residual over the structure's free parameters, from `start` (p,).

    `secant`: from a start near the minimum, by few simulations (`minimise`).
    """
    columns = problem.columns_of(effects) if columns is None else columns

    def theta_at(x: FloatArray) -> FloatArray:
        theta = start.copy()
        for value, column in zip(x, columns, strict=True):
            theta[list(column.entries)] = value
        return theta

    pulls = problem.pulls(columns)
    pulled = np.flatnonzero(pulls)
    centre = np.array([column.start for column in columns])

    def residual(x: FloatArray) -> FloatArray:
        flat = problem.residual(theta_at(x), effects).flat()
        return np.concatenate((flat, (pulls * (x - centre))[pulled]))

    def jacobian(x: FloatArray, flat: FloatArray) -> FloatArray:
        raw = problem.jacobian(theta_at(x), effects, columns)
        slopes = problem.loss_slopes(flat[: len(raw)])
        return np.concatenate((raw * slopes[:, None], np.diag(pulls)[pulled]))

    end = minimise(
        residual,
        jacobian,
        np.array([start[column.entries[0]] for column in columns]),
        np.array([column.lower for column in columns]),
        np.array([column.upper for column in columns]),
        iterations=iterations,
        tolerance=tolerance,
        secant=secant,
    )
    theta = theta_at(end.theta)
    return Fit(effects, theta, columns, problem.residual(theta, effects))


def reevaluate(problem: Problem, done: Fit) -> Fit:
    """The same parameter values on another problem (other rows, other noise)."""
    return Fit(done.effects, done.theta, done.columns, problem.residual(done.theta, done.effects))
