"""Discrete linear models of one wheel: ARX (paper, equations (27) to (30)) and state space ((39))."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.model.compiled import compiled


@dataclass(frozen=True, slots=True)
class ArxModel:
    """v(t+1) = sum_i m_i v(t-i+1) + sum_j n_j u(t-j+1), the paper's equation (27) without its noise.

    u(t) is the input that acts from sample t to t+1. A log's effort is the mean over the interval
    that ends at its row, so that u(t) is the effort of row t+1.

    Attributes
    ----------
    m : shape (alpha,), weights of past speeds.
    n : shape (beta,), m/s per unit effort.
    interval_s : time between samples.
    """

    m: FloatArray
    n: FloatArray
    interval_s: float

    @property
    def history(self) -> int:
        """Rows that a prediction needs before its own."""
        return max(len(self.m), len(self.n) - 1)

    @property
    def gain_mps(self) -> float:
        """Steady speed per unit effort, m/s."""
        return float(np.sum(self.n) / (1.0 - np.sum(self.m)))

    @property
    def poles(self) -> FloatArray:
        """Largest magnitude first, shape (alpha,), magnitudes only."""
        return np.sort(np.abs(np.roots(np.concatenate(([1.0], -self.m)))))[::-1]

    @property
    def stable(self) -> bool:
        """Whether every pole lies inside the unit circle."""
        return bool(np.all(self.poles < 1.0))

    def predict(self, effort: FloatArray, speed: FloatArray) -> FloatArray:
        """One-step prediction of rows `history`.. from the measured rows before each.

        The result has shape (n - history,).
        """
        first = self.history
        out = np.zeros(len(speed) - first)
        for i, weight in enumerate(self.m, start=1):
            out += weight * speed[first - i : len(speed) - i]
        for j, weight in enumerate(self.n):
            out += weight * effort[first - j : len(effort) - j]
        return out

    def simulate(self, effort: FloatArray, head: FloatArray) -> FloatArray:
        """Free-run simulation of rows `history`.., shape (n - history,).

        Parameters
        ----------
        effort : shape (n,), all rows of the segment.
        head : shape (history,), measured speeds of the first rows: where the simulation starts.
        """
        from scipy.signal import lfilter, lfiltic

        first = self.history
        denominator = np.concatenate(([1.0], -self.m))
        speeds, efforts = head[::-1][: len(self.m)], effort[:first][::-1][: len(self.n) - 1]
        state = lfiltic(self.n, denominator, speeds, efforts)
        out, _ = lfilter(self.n, denominator, effort[first:], zi=state)
        return np.asarray(out)


@dataclass(frozen=True, slots=True)
class StateSpaceModel:
    """x(t+1) = A x(t) + B u(t) + K e(t), y(t) = C x(t) + 0 u(t) + e(t): the form of (39) and (40).

    u(t) acts from sample t to t+1, as in `ArxModel`.

    Attributes
    ----------
    a : shape (order, order). b, c, k : shape (order,), B in m/s per unit effort through C.
    interval_s : time between samples.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    k: FloatArray
    interval_s: float

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.b)

    @property
    def gain_mps(self) -> float:
        """Steady speed per unit effort, m/s."""
        return float(self.c @ np.linalg.solve(np.eye(self.order) - self.a, self.b))

    @property
    def stable(self) -> bool:
        """Whether every pole lies inside the unit circle."""
        return bool(np.all(np.abs(np.linalg.eigvals(self.a)) < 1.0))

    def simulate(self, effort: FloatArray, start: FloatArray) -> FloatArray:
        """Free-run simulation of every row, shape (n,), from state `start` (order,) at row 0."""
        out = np.empty(len(effort))
        _advance_states(self.a, self.b, self.c, np.zeros(self.order), effort, effort, start, out)
        return out

    def predict(self, effort: FloatArray, speed: FloatArray, start: FloatArray) -> FloatArray:
        """One-step prediction of every row from the measured rows before it, shape (n,)."""
        out = np.empty(len(effort))
        _advance_states(self.a, self.b, self.c, self.k, effort, speed, start, out)
        return out

    def start(self, effort: FloatArray, speed: FloatArray, rows: int) -> FloatArray:
        """The state at row 0, shape (order,), that fits the first `rows` measured speeds best.

        A wheel that does not move in those rows starts from zero: where friction holds it, a linear
        model would explain the rest by states that cancel the input, and drift away after it.
        """
        rows = max(min(rows, len(speed)), 1)
        if not np.any(speed[:rows]):
            return np.zeros(self.order)
        forced = self.simulate(effort[:rows], np.zeros(self.order))
        observability = np.empty((rows, self.order))
        row = self.c.copy()
        for r in range(rows):
            observability[r] = row
            row = row @ self.a
        start, *_ = np.linalg.lstsq(observability, speed[:rows] - forced, rcond=1e-3)
        return np.asarray(start)


@compiled
def _advance_states(
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
    k: FloatArray,
    effort: FloatArray,
    speed: FloatArray,
    start: FloatArray,
    out: FloatArray,
) -> None:
    """Predictions of an innovations model; with k = 0, a free-run simulation."""
    order = b.shape[0]
    x = start.copy()
    following = np.empty(order)
    n = effort.shape[0]
    for row in range(n):
        y = 0.0
        for i in range(order):
            y += c[i] * x[i]
        out[row] = y
        if row + 1 < n:
            e = speed[row] - y
            for i in range(order):
                value = b[i] * effort[row + 1] + k[i] * e
                for j in range(order):
                    value += a[i, j] * x[j]
                following[i] = value
            for i in range(order):
                x[i] = following[i]
