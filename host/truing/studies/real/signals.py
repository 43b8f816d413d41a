"""What a set is judged by: the speeds of its wheels, or its pose where only commands are known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from truing.arrays import BoolArray, FloatArray
from truing.diagnose.data.set_data import SetData
from truing.diagnose.simulation.simulator import SetSimulator

# Half of a usual wheelbase, m: turns a heading error into metres where no wheelbase is known.
LEVER_M = 0.15


class Signals:
    """Errors of a simulation: rows by wheel in m/s, or windows by pose component in m.

    Attributes
    ----------
    unit : of the errors.
    run_of_row, t_s : shape (k,), the run and the device time of each row or window.
    counted : shape (k, c), what is judged.
    """

    def __init__(self, data: SetData, simulator: SetSimulator) -> None:
        self.data, self.simulator = data, simulator
        self.unit = "m" if data.commanded else "m/s"
        if data.commanded:
            windows = simulator.windows(data.pose_horizon_s)
            self.run_of_row, self.t_s = windows.run, data.t_s[windows.last]
            self.counted: BoolArray = np.isfinite(windows.measured)
            # The heading as metres at the wheel: half a wheelbase from the midpoint.
            lever = 0.5 * data.baseline.wheelbase_m if data.baseline.wheelbase_m else LEVER_M
            self._scale = np.array([1.0, 1.0, lever])
        else:
            self.run_of_row, self.t_s, self.counted = data.run_of_row, data.t_s, data.counted

    def errors(self, theta: FloatArray, on: BoolArray) -> FloatArray:
        """Measured minus simulated, shape (k, c); zero where nothing is judged."""
        if self.data.commanded:
            raw = self.simulator.pose_residuals(theta, on, self.data.pose_horizon_s) * self._scale
        else:
            raw = self.data.speed_mps - self.simulator.speeds(theta, on)
        return np.where(self.counted, raw, 0.0)

    def derivatives(self, theta: FloatArray, on: BoolArray, free: Sequence[tuple[int, ...]]) -> FloatArray:
        """Of the errors, shape (k, c, len(free)), by differences."""
        if not self.data.commanded and all(len(entries) == 1 for entries in free):
            columns = -self.simulator.jacobian(theta, on, [entries[0] for entries in free])
            return np.where(self.counted[:, :, None], columns, 0.0)
        base = self.errors(theta, on)
        out = np.zeros((*base.shape, len(free)))
        for column, entries in enumerate(free):
            moved = theta.copy()
            step = self.simulator.derivative_step(theta, entries[0])
            moved[list(entries)] += step
            out[:, :, column] = (self.errors(moved, on) - base) / step
        return out
