"""Values of kept terms by the free-run error, from the linear stage on, and their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.learned.regression import LINEAR, Left, Sums, block, columns_of
from truing.diagnose.learned.selection import columns, penalty_matrix, solve
from truing.diagnose.learned.variables import Candidate, row_variable
from truing.model.correction import (
    PERIODIC,
    STATE_VARIABLES,
    Correction,
    Rows,
    Term,
    corrected_speeds,
    limited,
)

# A step for differences, in units of effort or a share.
STEP = 1e-3
# 97.5 % quantile of the normal distribution.
Z95 = 1.96


@dataclass(frozen=True)
class Structure:
    """Kept candidates with their penalties, for coefficient vectors of shape (2, width)."""

    candidates: tuple[Candidate, ...]
    penalties: FloatArray  # (2, width, width)
    gain: FloatArray
    tau: FloatArray

    @property
    def width(self) -> int:
        """Coefficients of each wheel."""
        return LINEAR + sum(columns_of(one) for one in self.candidates)

    def correction(self, theta: FloatArray, bands: FloatArray | None = None) -> Correction:
        """The correction with these coefficients (2, width) and half widths, within its limits."""
        terms, at = [], LINEAR
        for one in self.candidates:
            part = slice(at, at + columns_of(one))
            at = part.stop
            empty = Term(one.place, one.variable, one.constant, one.grid, (), ())
            values, widths = (
                None if each is None else _closed(one, each[:, part]) for each in (theta, bands)
            )
            assert values is not None
            terms.append(empty.with_values(values, widths))
        pair = [tuple(float(x) for x in each) for each in (self.gain, self.tau, theta[:, 0], theta[:, 1])]
        gain, tau, share, drag = pair
        return limited(
            Correction(
                (gain[0], gain[1]), (tau[0], tau[1]), tuple(terms), (share[0], share[1]), (drag[0], drag[1])
            )
        )


def _closed(one: Candidate, values: FloatArray) -> FloatArray:
    return np.hstack((values, values[:, :1])) if one.variable in PERIODIC else values


def rows_of(left: Left, terms: Sequence[Candidate | Term]) -> Rows:
    """The rows of a set with the variables that these terms read."""
    data = left.data
    keys = {(str(one.variable), one.constant) for one in terms if one.variable not in STATE_VARIABLES}
    variables = {key: row_variable(data, *key) for key in sorted(keys)}
    return Rows(data.starts, data.dt_s, data.effort, data.instant, variables)


def structure_of(
    left: Left, sums: Sums, terms: Sequence[int], weight: float, groups: Sequence[int]
) -> Structure:
    """The structure of these candidates, penalised as in the regression on these groups."""
    penalties = []
    for w in range(2):
        gram = block(sums.gram, groups, w, columns(sums, terms)).sum(axis=0)
        penalties.append(penalty_matrix(sums, terms, weight, gram))
    return Structure(tuple(sums.candidates[k] for k in terms), np.array(penalties), left.gain, left.tau)


def linear_start(sums: Sums, terms: Sequence[int], weight: float, groups: Sequence[int]) -> FloatArray:
    """Coefficients of the linear stage, shape (2, width)."""
    return np.array([solve(sums, terms, weight, groups, w) for w in range(2)])


@dataclass(frozen=True)
class Refined:
    """Coefficients (2, width), and the half widths of their 95 % intervals."""

    theta: FloatArray
    bands: FloatArray


def refine(
    left: Left,
    structure: Structure,
    start: FloatArray,
    weight: FloatArray,
    steps: int,
    *,
    bands: bool = False,
) -> Refined:
    """Minimise the penalised squared free-run error over the rows with these weights (n, 2).

    Both wheels' coefficients are moved in one simulation; what one wheel does to the other through a term of
    both speeds is left out of the derivatives, not of the error that a step must lower.
    """
    rows = rows_of(left, structure.candidates)
    counted = weight > 0.0
    target = np.where(counted, left.data.speed_mps, 0.0)

    def error(theta: FloatArray) -> FloatArray:
        return np.where(
            counted, target - corrected_speeds(structure.correction(theta), rows, left.speeds), 0.0
        )

    def cost(theta: FloatArray, r: FloatArray) -> float:
        return float(np.sum(weight * r**2)) + float(
            np.einsum("wk,wkl,wl->", theta, structure.penalties, theta)
        )

    theta = start
    r = error(theta)
    best, damping = cost(theta, r), 1e-2
    nothing = np.zeros_like(theta)
    empty = error(nothing)
    without = cost(nothing, empty)
    if without < best:
        theta, r, best = nothing, empty, without
    for _ in range(steps):
        jacobian = _derivatives(error, theta, r)
        accepted = False
        for _ in range(6):
            moved = theta.copy()
            for w in range(2):
                j = jacobian[w]
                h = (j * weight[:, w, None]).T @ j + structure.penalties[w]
                g = (j * weight[:, w, None]).T @ r[:, w] - structure.penalties[w] @ theta[w]
                moved[w] += np.linalg.solve(h + damping * np.diag(np.diag(h)) + 1e-12 * np.eye(len(h)), g)
            trial = error(moved)
            now = cost(moved, trial)
            if np.isfinite(now) and now < best:
                accepted = True
                break
            damping *= 5.0
        if not accepted:
            break
        small = best - now < 1e-3 * best
        theta, r, best, damping = moved, trial, now, damping / 3.0
        if small:
            break
    widths = _half_widths(left, structure, _derivatives(error, theta, r), r, weight) if bands else nothing
    return Refined(theta, widths)


def _derivatives(error, theta: FloatArray, r: FloatArray) -> FloatArray:  # type: ignore[no-untyped-def]
    """Derivatives of the simulated speeds, shape (2, n, width)."""
    out = np.zeros((2, len(r), theta.shape[1]))
    for k in range(theta.shape[1]):
        moved = theta.copy()
        moved[:, k] += STEP
        change = (r - error(moved)) / STEP
        out[0, :, k], out[1, :, k] = change[:, 0], change[:, 1]
    return out


def _half_widths(
    left: Left, structure: Structure, jacobian: FloatArray, r: FloatArray, weight: FloatArray
) -> FloatArray:
    """Half widths of 95 % intervals (2, width): sandwich over groups, at least that of white noise."""
    out = np.zeros((2, structure.width))
    for w in range(2):
        j = jacobian[w] * weight[:, w, None]
        inverse = np.linalg.inv(j.T @ jacobian[w] + structure.penalties[w] + 1e-12 * np.eye(structure.width))
        scores = np.stack(
            [(j * r[:, w, None])[left.group == group].sum(axis=0) for group in range(left.groups)]
        )
        sandwich = np.diag(inverse @ (scores.T @ scores) @ inverse)
        sigma2 = float(weight[:, w] @ r[:, w] ** 2) / max(float(weight[:, w].sum()) - structure.width, 1.0)
        out[w] = Z95 * np.sqrt(np.maximum(sandwich, sigma2 * np.diag(inverse)))
    return out
