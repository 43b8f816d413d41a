"""A model's numbers fitted once more, through the user's own simulation instead of ours.

A model of single wheels knows nothing of bodies and contacts. On runs with turns it takes the scrub and the
coupling that the user's simulation has already for friction, lag and gain. Here the user's file is simulated
with the model in it, and gains, frictions, the time constants' common factor and the delays' common shift are
moved to the least squares of the speeds, with derivatives from one more simulation for each number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from truing.arrays import FloatArray
from truing.errors import TruingError
from truing.levenberg import minimise
from truing.model.robot_model import RobotModel
from truing.progress import Progress

from .into import MJCF, own_file
from .own_robot import KEEP_MASSES, KEEPS
from .recorded import Task, residuals
from .terms import DEFAULTS, ExportOptions, wheels

# Log gain and friction (effort) left and right, log factor of the time constants, shift of the delays (s).
STEPS = np.array([0.02, 0.02, 0.005, 0.005, 0.03, 0.004])
MAX_ITERATIONS = 8
# Of so many runs one, the last, judges and is not fitted to.
ONE_LEFT_OUT_OF = 3
# Steps that lower the squared error by less than this share, twice in a row, end the fit.
ENOUGH = 0.006


@dataclass(frozen=True, slots=True)
class Refined:
    """The model with other numbers, what was kept for it, its errors on the runs before and after, m/s."""

    model: RobotModel
    keep: str
    before_mps: float
    after_mps: float

    def lines(self) -> list[str]:
        """The wheels' numbers, in sentences."""
        return [
            f"{side}: {wheel.gain_mps:.4g} m/s at full effort, time constant {wheel.time_constant_s:.4g} s, "
            f"friction {wheel.friction:.4g} of full effort, delay {1e3 * wheel.delay_s:.3g} ms"
            for side, wheel in wheels(self.model)
        ]


def divided(all_tasks: Sequence[Task]) -> tuple[list[Task], list[Task]]:
    """Runs to fit, and runs that are left out of it; of fewer than three runs none is."""
    last = ONE_LEFT_OUT_OF - 1
    fitted = [task for number, task in enumerate(all_tasks) if number % ONE_LEFT_OUT_OF != last]
    return fitted, [task for number, task in enumerate(all_tasks) if number % ONE_LEFT_OUT_OF == last]


def refine(
    path: Path,
    model: RobotModel,
    all_tasks: Sequence[Task],
    options: ExportOptions = DEFAULTS,
    *,
    keep: str | None = None,
    joints: tuple[str, str] | None = None,
    progress: Progress | None = None,
) -> Refined:
    """Fit a model's numbers on runs through the user's own file, which stays as it is.

    Parameters
    ----------
    keep : see `own_robot`; None: what fits better at the start.
    """
    file = own_file(path, options.radius(model), joints)
    if file.kind != MJCF:
        raise TruingError(f"{path}: nothing that is installed here drives it", "Leave --refine away")

    def errors(numbers: FloatArray, kept: str) -> FloatArray:
        moved = _moved(model, numbers)
        made = file.with_model(moved, kept)
        return residuals(all_tasks, made.simulation(made.after), moved)

    unmoved = np.zeros(STEPS.size)
    starts = {}
    # Masses can always be kept; motors only where the chassis then has a mass.
    for kept in (keep,) if keep is not None else KEEPS:
        try:
            starts[kept] = errors(unmoved, kept)
        except TruingError:
            if kept in (keep, KEEP_MASSES):
                raise
    kept = min(starts, key=lambda one: float(starts[one] @ starts[one]))
    iteration = 0

    def slopes(numbers: FloatArray, here: FloatArray) -> FloatArray:
        nonlocal iteration
        iteration += 1
        moved = [(errors(numbers + step, kept) - here) / step.sum() for step in np.diag(STEPS)]
        if progress is not None:
            progress(iteration / MAX_ITERATIONS)
        return np.stack(moved, axis=1)

    wide = np.full(STEPS.size, np.inf)
    end = minimise(
        lambda numbers: errors(numbers, kept),
        slopes,
        unmoved,
        -wide,
        wide,
        iterations=MAX_ITERATIONS,
        tolerance=ENOUGH,
    )
    if progress is not None:
        progress(1.0)
    return Refined(_moved(model, end.theta), kept, _rms(starts[kept]), _rms(end.residual))


def _moved(model: RobotModel, numbers: FloatArray) -> RobotModel:
    """The model with its numbers moved; friction and delay stay above zero."""
    slower, later = float(np.exp(numbers[4])), float(numbers[5])
    left, right = (
        replace(
            wheel,
            gain_mps=wheel.gain_mps * float(np.exp(numbers[side])),
            friction=max(wheel.friction + float(numbers[2 + side]), 0.0),
            time_constant_s=wheel.time_constant_s * slower,
            delay_s=max(wheel.delay_s + later, 0.0),
        )
        for side, wheel in enumerate((model.left, model.right))
    )
    return replace(model, left=left, right=right)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
