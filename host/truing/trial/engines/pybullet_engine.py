"""Bullet, through PyBullet, as an engine of trials: its robots, what it can hide, and their motion."""

from __future__ import annotations

import importlib.metadata
import tempfile
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.trial.engines.engine import TICK_S, Driver, EngineEffect, Motion
from truing.trial.engines.nominal import NominalRobot
from truing.trial.engines.pybullet_effects import EFFECTS
from truing.trial.engines.pybullet_robot import BulletRobot
from truing.trial.engines.robot import GRAVITY

STEP_S = 0.001
_SETTLING_S = 0.3
_STEPS = round(TICK_S / STEP_S)
_WHEELS = (0, 1)


class BulletEngine:
    """Bullet (https://pybullet.org)."""

    name = "pybullet"

    @property
    def version(self) -> str:
        """Of the installed package."""
        return importlib.metadata.version("pybullet")

    @property
    def effects(self) -> Mapping[str, EngineEffect[BulletRobot]]:
        """What it can hide, by name."""
        return EFFECTS

    def healthy(self, nominal: NominalRobot) -> BulletRobot:
        """A robot with nothing hidden in it."""
        return BulletRobot(nominal)

    def simulate(
        self,
        robot: BulletRobot,
        drivers: Sequence[Driver],
        torques_nm: Sequence[FloatArray] | None = None,
    ) -> list[Motion]:
        """Drive runs one after the other, each from rest at the origin."""
        import pybullet

        world = pybullet.connect(pybullet.DIRECT)
        try:
            return [
                _Run(world, robot, number).drive(driver, None if torques_nm is None else torques_nm[number])
                for number, driver in enumerate(drivers)
            ]
        finally:
            pybullet.disconnect(world)


class _Run:
    """One run: a floor and the robot on it, at rest."""

    def __init__(self, world: int, robot: BulletRobot, number: int) -> None:
        import pybullet

        self._bullet: Any = pybullet
        self._world = {"physicsClientId": world}
        self._robot = robot
        bullet, nominal = self._bullet, robot.nominal
        bullet.resetSimulation(**self._world)
        bullet.setTimeStep(STEP_S, **self._world)
        bullet.setGravity(0.0, 0.0, -GRAVITY, **self._world)
        self._floor()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_text(robot.urdf(number), encoding="utf-8")
            self._body = bullet.loadURDF(
                str(path), [0, 0, nominal.radius_m], flags=bullet.URDF_USE_INERTIA_FROM_FILE, **self._world
            )
        self._dynamics(-1, lateralFriction=0.0)
        for joint in range(bullet.getNumJoints(self._body, **self._world)):
            self._dynamics(joint, jointDamping=0.0)
            self._brake(joint, 0.0)
        for wheel in _WHEELS:
            self._dynamics(
                wheel,
                lateralFriction=robot.grip,
                spinningFriction=robot.torsion_m,
                rollingFriction=robot.rolling_m,
                jointDamping=robot.joint_damping_nms(wheel),
            )
            self._brake(wheel, robot.friction_nm[wheel])
        for _ in range(round(_SETTLING_S / STEP_S)):
            bullet.stepSimulation(**self._world)
        bullet.setGravity(*robot.gravity, **self._world)

    def _floor(self) -> None:
        bullet = self._bullet
        plane = bullet.createCollisionShape(bullet.GEOM_PLANE, **self._world)
        bodies = [bullet.createMultiBody(0, plane, **self._world)]
        if self._robot.bump_m > 0.0:
            size = [0.04, 20.0, self._robot.bump_m]
            box = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=size, **self._world)
            bodies.append(
                bullet.createMultiBody(0, box, basePosition=[self._robot.bump_at_m, 0, 0], **self._world)
            )
        for body in bodies:
            # Lateral friction of both sides is multiplied, and rolling friction by the other's lateral.
            bullet.changeDynamics(
                body, -1, lateralFriction=1.0, spinningFriction=0.0, rollingFriction=0.0, **self._world
            )

    def _dynamics(self, link: int, **values: float) -> None:
        free = {"linearDamping": 0.0, "angularDamping": 0.0}
        self._bullet.changeDynamics(self._body, link, **free, **values, **self._world)

    def _brake(self, joint: int, torque_nm: float) -> None:
        """Bullet's motor constraint at speed zero, limited to a torque: Coulomb friction."""
        bullet = self._bullet
        bullet.setJointMotorControl2(
            self._body, joint, bullet.VELOCITY_CONTROL, targetVelocity=0.0, force=torque_nm, **self._world
        )

    def _angles(self) -> FloatArray:
        states = self._bullet.getJointStates(self._body, _WHEELS, **self._world)
        return np.array([state[0] for state in states])

    def _pose(self) -> tuple[float, float, float]:
        place, turn = self._bullet.getBasePositionAndOrientation(self._body, **self._world)
        return place[0], place[1], self._bullet.getEulerFromQuaternion(turn)[2]

    def drive(self, driver: Driver, torques: FloatArray | None) -> Motion:
        """Drive it."""
        bullet, stall = self._bullet, self._robot.nominal.stalls_nm
        n = driver.ticks + 1
        effort, angle, pose = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 3))
        start, pose[0] = self._angles(), self._pose()
        waiting = deque([(0.0, 0.0)] * round(self._robot.delay_s / STEP_S))
        for tick in range(driver.ticks):
            pair = driver.efforts(tick, angle[tick])
            push = (0.0, 0.0) if torques is None else torques[tick]
            for _ in range(_STEPS):
                waiting.append(pair)
                acting = waiting.popleft()
                forces = [stall[i] * acting[i] + float(push[i]) for i in _WHEELS]
                bullet.setJointMotorControlArray(
                    self._body, _WHEELS, bullet.TORQUE_CONTROL, forces=forces, **self._world
                )
                bullet.stepSimulation(**self._world)
            effort[tick + 1] = pair
            angle[tick + 1] = self._angles() - start
            pose[tick + 1] = self._pose()
        pose[:, 2] = np.unwrap(pose[:, 2])
        return Motion(effort, angle, pose - pose[0])
