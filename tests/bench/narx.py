"""A NARX network on the same rows: the black box that learned corrections are compared with.

One hidden layer of tanh units per wheel gives the change of the speed from the last two speeds of both wheels
and the last efforts (Narendra and Parthasarathy 1990, IEEE Trans. Neural Networks 1). It
is fitted one step ahead, by Levenberg and Marquardt's method, and runs free on other runs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truing.diagnose.data.set_data import SetData
from truing.levenberg import minimise

Array = NDArray[np.float64]

HIDDEN = 8
STEPS = 40
# Penalty on weights, as a share of the mean squared change of the speed.
RIDGE = 1e-3
PAST = 2


class Narx:
    """One network for each wheel."""

    def __init__(self, data: SetData, counted: Array) -> None:
        self.scale = np.abs(data.speed_mps).max(axis=0)
        self.weights = [self._fitted(data, counted, w) for w in range(2)]

    def _inputs(self, speeds: Array, effort: Array, k: Array, w: int) -> Array:
        columns = [np.ones(len(k))]
        for back in range(1, PAST + 1):
            columns += [speeds[k - back, w] / self.scale[w], speeds[k - back, 1 - w] / self.scale[1 - w]]
        for back in range(PAST):
            columns += [effort[k - back, w], effort[k - back, 1 - w]]
        return np.stack(columns, axis=1)

    def _fitted(self, data: SetData, counted: Array, w: int) -> tuple[Array, Array, float]:
        first = np.repeat(data.starts[:-1], np.diff(data.starts))
        good = counted.all(axis=1)
        rows = np.arange(len(data))
        rows = rows[rows - first >= PAST]
        rows = rows[good[rows] & good[rows - 1] & good[rows - 2]]
        x = self._inputs(data.speed_mps, data.effort, rows, w)
        y = (data.speed_mps[rows, w] - data.speed_mps[rows - 1, w]) / self.scale[w]
        spread = float(np.sqrt(np.mean(y**2))) or 1.0
        y = y / spread
        width = x.shape[1]
        rng = np.random.default_rng(w)
        start = np.concatenate((rng.normal(0.0, 0.5, HIDDEN * width), rng.normal(0.0, 0.5, HIDDEN + 1)))
        ridge = np.sqrt(RIDGE * len(y) / len(start))

        def split(theta: Array) -> tuple[Array, Array]:
            return theta[: HIDDEN * width].reshape(HIDDEN, width), theta[HIDDEN * width :]

        def residual(theta: Array) -> Array:
            inner, outer = split(theta)
            h = np.tanh(x @ inner.T)
            return np.concatenate((h @ outer[:-1] + outer[-1] - y, ridge * theta))

        def jacobian(theta: Array, _: Array) -> Array:
            inner, outer = split(theta)
            h = np.tanh(x @ inner.T)
            slope = (1.0 - h**2) * outer[:-1]
            parts = (slope[:, :, None] * x[:, None, :]).reshape(len(x), -1)
            whole = np.hstack((parts, h, np.ones((len(x), 1))))
            return np.vstack((whole, ridge * np.eye(len(theta))))

        bound = np.full(len(start), 50.0)
        inner, outer = split(minimise(residual, jacobian, start, -bound, bound, iterations=STEPS).theta)
        return inner, outer, spread

    def free_run(self, data: SetData) -> Array:
        """Speeds of all rows from the efforts alone, shape (n, 2); held within twice what was seen."""
        out = data.speed_mps.copy()
        for a, b in zip(data.starts[:-1], data.starts[1:], strict=True):
            out[a : a + PAST] = data.initial_mps[np.searchsorted(data.starts, a)]
            for k in range(a + PAST, b):
                for w in range(2):
                    inner, outer, spread = self.weights[w]
                    x = self._inputs(out, data.effort, np.array([k]), w)[0]
                    change = float(np.tanh(inner @ x) @ outer[:-1] + outer[-1]) * spread * self.scale[w]
                    out[k, w] = np.clip(out[k - 1, w] + change, -2.0 * self.scale[w], 2.0 * self.scale[w])
        return out
