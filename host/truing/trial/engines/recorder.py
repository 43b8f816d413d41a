"""What a recorder keeps of a robot's motion: counts, mean efforts, commands and outside poses at its rate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.recording.run import TRUTH_COLUMNS, Run
from truing.trial.engines.driving import PlanDriver
from truing.trial.engines.engine import TICK_S, Motion, Rng
from truing.trial.engines.nominal import NominalRobot


@dataclass(frozen=True)
class Recorder:
    """A recorder's rate, and the standard deviation of its outside pose (0: there is none)."""

    rate_hz: int
    truth_mm: float = 0.0
    truth_mrad: float = 0.0

    @property
    def ticks_per_row(self) -> int:
        """Intervals of the engine in a row's."""
        return round(1.0 / (self.rate_hz * TICK_S))

    def run(self, motion: Motion, driver: PlanDriver, nominal: NominalRobot, rng: Rng) -> Run:
        """The run as it is written."""
        every = self.ticks_per_row
        at = np.arange(0, len(motion.effort), every)
        columns: dict[str, FloatArray] = {
            "t_s": np.round(at * TICK_S, 4),
            "effort_left": np.round(_row_means(motion.effort[:, 0], every), 4),
            "effort_right": np.round(_row_means(motion.effort[:, 1], every), 4),
        }
        modes, commands = _commands(driver, at.tolist())
        columns |= {"cmd_left": commands[:, 0], "cmd_right": commands[:, 1]}
        counts = counted(motion.angle_rad[at], nominal)
        columns |= {"ticks_left": counts[:, 0], "ticks_right": counts[:, 1]}
        order = ["t_s", "mode", "cmd_left", "cmd_right", "effort_left", "effort_right"]
        order += ["ticks_left", "ticks_right"]
        if self.truth_mm > 0.0:
            spread = np.array([self.truth_mm, self.truth_mm, self.truth_mrad]) * 1e-3
            seen = motion.pose[at] + rng.normal(0.0, spread, (len(at), 3))
            for k, name in enumerate(TRUTH_COLUMNS):
                columns[name] = np.round(seen[:, k], 5)
                order.append(name)
        return Run(driver.plan.name, columns, tuple(modes), order=tuple(order))


def counted(angle_rad: FloatArray, nominal: NominalRobot) -> FloatArray:
    """Encoder counts since the start, shape as given."""
    counts: FloatArray = np.floor(angle_rad * nominal.counts_per_rev / (2.0 * math.pi))
    return counts


def _row_means(values: FloatArray, every: int) -> FloatArray:
    """Means over the intervals that end at the rows; the first row stands for itself."""
    whole = (len(values) - 1) // every
    means = values[1 : 1 + whole * every].reshape(whole, every).mean(axis=1)
    out: FloatArray = np.concatenate([values[:1], means])
    return out


def _commands(driver: PlanDriver, at: Sequence[int]) -> tuple[list[str], FloatArray]:
    """Mode and commands that act just before each row."""
    said = [driver.command(max(tick - 1, 0)) for tick in at]
    return [mode for mode, _, _ in said], np.array([[left, right] for _, left, right in said])
