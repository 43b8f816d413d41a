"""MuJoCo as an engine of trials: its robots, what it can hide in them, and their motion."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from truing.arrays import FloatArray
from truing.trial.engines.engine import TICK_S, Driver, EngineEffect, Motion
from truing.trial.engines.mujoco_effects import EFFECTS
from truing.trial.engines.mujoco_robot import STEP_S, MujocoRobot
from truing.trial.engines.nominal import NominalRobot

if TYPE_CHECKING:
    from mujoco import MjData, MjModel

_SETTLING_S = 0.4
_STEPS = round(TICK_S / STEP_S)
_SIDES = ("left", "right")


class MujocoEngine:
    """MuJoCo (https://mujoco.org)."""

    name = "mujoco"

    @property
    def version(self) -> str:
        """Of the installed package."""
        import mujoco

        return str(mujoco.__version__)

    @property
    def effects(self) -> Mapping[str, EngineEffect[MujocoRobot]]:
        """What it can hide, by name."""
        return EFFECTS

    def healthy(self, nominal: NominalRobot) -> MujocoRobot:
        """A robot with nothing hidden in it."""
        return MujocoRobot(nominal)

    def simulate(
        self,
        robot: MujocoRobot,
        drivers: Sequence[Driver],
        torques_nm: Sequence[FloatArray] | None = None,
    ) -> list[Motion]:
        """Drive runs one after the other, each from rest at the origin."""
        return [
            _one_run(robot, driver, robot.mjcf(number), None if torques_nm is None else torques_nm[number])
            for number, driver in enumerate(drivers)
        ]


@functools.lru_cache(maxsize=2)
def _settled(mjcf: str) -> tuple[MjModel, MjData]:
    """The robot after it has come to rest on a level floor: wheels and casters share its weight."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round(_SETTLING_S / STEP_S))
    data.qvel[:] = 0.0
    return model, data


def _one_run(robot: MujocoRobot, driver: Driver, mjcf: str, torques: FloatArray | None) -> Motion:
    import mujoco

    model, settled = _settled(mjcf)
    data = mujoco.MjData(model)
    data.qpos[:] = settled.qpos
    model.opt.gravity[:] = robot.gravity
    angles = [int(model.joint(f"{side}_motor").qposadr[0]) for side in _SIDES]
    axles = [int(model.joint(f"{side}_motor").dofadr[0]) for side in _SIDES]
    start, origin = data.qpos[angles].copy(), data.qpos[:3].copy()
    n, full = driver.ticks + 1, robot.full_control
    effort, angle, place = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 7))
    place[0] = data.qpos[:7]
    for tick in range(driver.ticks):
        pair = driver.efforts(tick, angle[tick])
        data.ctrl[:] = (full * pair[0], full * pair[1])
        if torques is not None:
            data.qfrc_applied[axles] = torques[tick]
        mujoco.mj_step(model, data, _STEPS)
        effort[tick + 1] = pair
        angle[tick + 1] = data.qpos[angles] - start
        place[tick + 1] = data.qpos[:7]
    w, x, y, z = place[:, 3], place[:, 4], place[:, 5], place[:, 6]
    heading = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    pose = np.column_stack([place[:, 0] - origin[0], place[:, 1] - origin[1], heading - heading[0]])
    return Motion(effort, angle, pose)
