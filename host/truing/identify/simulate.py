"""Any fitted model against a run: one call, one free-run error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from truing.arrays import FloatArray
from truing.errors import IdentifyError
from truing.identify.even import even_signal
from truing.identify.grey_box import simulate_signal
from truing.identify.held_out import rms_by_run
from truing.identify.model_error import FreeRunError, free_run_error
from truing.identify.signals import WheelSignal, wheel_signal
from truing.identify.state_space import START_ROWS
from truing.model.linear import ArxModel, StateSpaceModel
from truing.model.robot_model import RobotModel
from truing.model.wheel import WheelPhysics
from truing.recording.run import Geometry, Run, Wheel

AnyModel: TypeAlias = WheelPhysics | RobotModel | ArxModel | StateSpaceModel


@dataclass(frozen=True, slots=True)
class Simulation:
    """A free-run simulation beside the measurement.

    Attributes
    ----------
    t_s, speed_mps, measured_mps : shape (n,); rows that only give the model its start are left out.
    error : free-run error over these rows.
    """

    t_s: FloatArray
    speed_mps: FloatArray
    measured_mps: FloatArray
    error: FreeRunError


def simulate(
    model: AnyModel, runs: Run | Sequence[Run], wheel: Wheel, baseline: Geometry | None = None
) -> Simulation:
    """Simulate runs that the model may never have seen, from their efforts and first rows alone."""
    signal = wheel_signal([runs] if isinstance(runs, Run) else runs, wheel, baseline)
    if isinstance(model, RobotModel):
        model = model.wheel(wheel)
    if isinstance(model, WheelPhysics):
        predicted = simulate_signal(model, signal)
        keep = signal.counted
        by_run = signal.rms_by_run(predicted - signal.speed_mps)
        return Simulation(
            signal.excitation.t_s[keep],
            predicted[keep],
            signal.speed_mps[keep],
            free_run_error(signal.names, by_run, signal.scale_mps),
        )
    return _simulate_discrete(model, signal)


def _simulate_discrete(model: ArxModel | StateSpaceModel, signal: WheelSignal) -> Simulation:
    head = model.history if isinstance(model, ArxModel) else START_ROWS
    even = even_signal(signal, head + 2)
    if abs(even.interval_s - model.interval_s) > 0.01 * model.interval_s:
        raise IdentifyError(
            f"the model has a sample every {model.interval_s:.4g} s, "
            f"the recording every {even.interval_s:.4g} s",
            "A discrete model simulates at its own rate only; fit a grey-box model instead",
        )
    times, speeds, measured = [], [], []
    for stretch in even.stretches:
        if isinstance(model, ArxModel):
            run = model.simulate(stretch.effort, stretch.speed[:head])
        else:
            start = model.start(stretch.effort, stretch.speed, START_ROWS)
            run = model.simulate(stretch.effort, start)[head:]
        speeds.append(run)
        measured.append(stretch.speed[head:])
        times.append(even.interval_s * np.arange(head, len(stretch.speed)))
    indices = sorted({stretch.run for stretch in even.stretches})
    residuals = [a - b for a, b in zip(speeds, measured, strict=True)]
    by_run = rms_by_run(even.stretches, residuals, indices)
    return Simulation(
        np.concatenate(times),
        np.concatenate(speeds),
        np.concatenate(measured),
        free_run_error(tuple(signal.names[k] for k in indices), by_run, signal.scale_mps),
    )
