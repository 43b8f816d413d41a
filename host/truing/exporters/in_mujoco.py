"""Recordings driven again by a robot in MuJoCo."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from truing.arrays import FloatArray

from .own_mjcf import Drive
from .recorded import Simulate, Task, spans

if TYPE_CHECKING:
    from mujoco import MjData, MjModel


def driven(model: MjModel, pair: tuple[Drive, Drive], radius_m: float) -> Simulate:
    """A simulation of the model, from its initial pose at rest, by its motors."""
    angles = [int(model.jnt_qposadr[drive.joint]) for drive in pair]
    forward = radius_m * np.array([drive.forward for drive in pair])

    def act(data: MjData, efforts: tuple[float, float]) -> None:
        for drive, effort in zip(pair, efforts, strict=True):
            data.ctrl[drive.actuator] = effort * drive.control

    return stepped(model, act, lambda data: forward * (data.qpos[angles] - model.qpos0[angles]))


def stepped(
    model: MjModel,
    act: Callable[[MjData, tuple[float, float]], None],
    travel_of: Callable[[MjData], FloatArray],
) -> Simulate:
    """A simulation in MuJoCo's own steps.

    Parameters
    ----------
    act : puts the efforts, left and right, that act from now on into the data.
    travel_of : rim travel of both wheels, shape (2,), m.
    """

    def simulate(task: Task) -> FloatArray:
        import mujoco

        data = mujoco.MjData(model)
        travel = np.zeros((2, task.t_s.size))
        step_s, done = float(model.opt.timestep), 0
        for begin, end in spans(task):
            act(data, task.effort(begin))
            steps = round(end / step_s)
            if steps > done:
                mujoco.mj_step(model, data, steps - done)
                done = steps
            row = int(np.searchsorted(task.t_s, end))
            if task.t_s[row] == end:
                travel[:, row] = travel_of(data)
        return travel

    return simulate
