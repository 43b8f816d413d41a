"""Recordings driven again by a robot in MuJoCo."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from truing.arrays import FloatArray

from .own_mjcf import Drive
from .recorded import Simulate, Task, spans

if TYPE_CHECKING:
    from mujoco import MjModel


def driven(model: MjModel, pair: tuple[Drive, Drive], radius_m: float) -> Simulate:
    """A simulation of the model, from its initial pose at rest, by its motors."""

    def simulate(task: Task) -> FloatArray:
        import mujoco

        data = mujoco.MjData(model)
        angles = [int(model.jnt_qposadr[drive.joint]) for drive in pair]
        start = data.qpos[angles].copy()
        forward = radius_m * np.array([drive.forward for drive in pair])
        travel = np.zeros((2, task.t_s.size))
        step_s, done = float(model.opt.timestep), 0
        for begin, end in spans(task):
            for drive, effort in zip(pair, task.effort(begin), strict=True):
                data.ctrl[drive.actuator] = effort * drive.control
            steps = round(end / step_s)
            if steps > done:
                mujoco.mj_step(model, data, steps - done)
                done = steps
            row = int(np.searchsorted(task.t_s, end))
            if task.t_s[row] == end:
                travel[:, row] = forward * (data.qpos[angles] - start)
        return travel

    return simulate
