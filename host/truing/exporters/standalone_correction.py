"""A learned correction as a force in MuJoCo: lookups of one variable each, for two wheel joints.

    import mujoco
    from NAME_correction import Correction
    model = mujoco.MjModel.from_xml_path("NAME.xml")
    data = mujoco.MjData(model)
    correction = Correction(model)
    while ...:
        data.ctrl[:] = efforts             # -1..1
        correction.apply(model, data)      # before every step
        mujoco.mj_step(model, data)

or, for every step whoever calls it: `mujoco.set_mjcb_control(correction.apply)`. MJCF itself has no lookups.
Forces go to `qfrc_applied` of the wheels' joints, dry friction to their `dof_frictionloss`. A `signal` is an
error of the recorder and no force: `shown(data)` gives the speeds with it. Needs nothing else of the package.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from typing import Any

# What is exported stands here instead.
TABLE: dict[str, Any] = {}
JOINTS = ("left_wheel", "right_wheel")
RADIUS_M = 1.0
TORQUE_NM = (1.0, 1.0)
FRICTION_NM = (0.0, 0.0)
WHEELBASE_M = 0.0

MAX_FALL = 0.9
RINGING_DAMPING = 0.1
# Below this speed a wheel is at rest for the direction of its friction, m/s.
REST_MPS = 1e-6


class Correction:
    """The learned correction and what it remembers."""

    def __init__(self, model: Any) -> None:
        self.dofs = [model.joint(name).dofadr[0] for name in JOINTS]
        self.memory: dict[tuple[int, int], tuple[float, float]] = {}
        self.time_s = 0.0
        self.travel_m = [0.0, 0.0]
        self.place = [0.0, 0.0, 0.0]

    def apply(self, model: Any, data: Any) -> None:
        """Set the forces of the next step from the efforts in `data.ctrl` and the joints' speeds."""
        h = model.opt.timestep
        efforts = [float(data.ctrl[w]) for w in range(2)]
        speeds = self._speeds(data)
        for w in range(2):
            force, friction = self._parts(w, h, efforts, speeds)
            force -= min(friction, 0.0) * _sign(speeds[w], force)
            data.qfrc_applied[self.dofs[w]] = TORQUE_NM[w] * force
            model.dof_frictionloss[self.dofs[w]] = FRICTION_NM[w] + TORQUE_NM[w] * max(friction, 0.0)
        self._move(h, speeds)

    def shown(self, data: Any) -> list[float]:
        """The speeds (m/s at the rim) as a recorder with the learned error of the signal shows them."""
        speeds = self._speeds(data)
        shares = [sum(self._signal(term, w, speeds) for term in TABLE["terms"]) for w in range(2)]
        return [speeds[w] * (1.0 + shares[w]) for w in range(2)]

    def _speeds(self, data: Any) -> list[float]:
        return [RADIUS_M * float(data.qvel[dof]) for dof in self.dofs]

    def _signal(self, term: dict[str, Any], w: int, speeds: Sequence[float]) -> float:
        if term["acts_as"] != "signal":
            return 0.0
        return _lookup(term, w, self._variable(term, 0, w, 0.0, (0.0, 0.0), speeds), speeds[w])

    def _parts(
        self, w: int, h: float, efforts: Sequence[float], speeds: Sequence[float]
    ) -> tuple[float, float]:
        """Effort forward, and dry friction in effort."""
        gain: list[float] = TABLE["gain_mps"]
        v = speeds[w]
        net = efforts[w] - v / gain[w]
        force = TABLE["effort_share"][w] * efforts[w] + TABLE["drag"][w] * v
        friction, inertia = 0.0, 0.0
        for k, term in enumerate(TABLE["terms"]):
            value = _lookup(term, w, self._variable(term, k, w, h, efforts, speeds), v)
            kind = term["acts_as"]
            force += value if kind == "force" else value * efforts[w] if kind == "gain" else 0.0
            friction += value if kind == "friction" else 0.0
            inertia += value if kind == "inertia" else 0.0
        # A share of the net effort is one of all forces on the wheel, damping and all.
        return force + max(inertia, -MAX_FALL) * net, friction

    def _variable(
        self,
        term: dict[str, Any],
        k: int,
        w: int,
        h: float,
        efforts: Sequence[float],
        speeds: Sequence[float],
    ) -> float:
        name, constant = str(term["variable"]), float(term["constant"])
        gain: list[float] = TABLE["gain_mps"]
        x, y, heading = self.place
        plain: dict[str, float] = {
            "speed": speeds[w],
            "speed_difference": speeds[w] - speeds[1 - w],
            "net_effort": efforts[w] - speeds[w] / gain[w],
            "other_net_effort": efforts[1 - w] - speeds[1 - w] / gain[1 - w],
            "effort": efforts[w],
            "other_effort": efforts[1 - w],
            "load": 0.5 * (abs(efforts[0]) + abs(efforts[1])),
            "run_time": self.time_s,
            "set_time": self.time_s,
            "travel": self.travel_m[w],
            "travel_repeating": self.travel_m[w],
            "angle_repeating": self.travel_m[w],
            "place_x": x,
            "place_y": y,
            "place_x_repeating": x,
            "place_y_repeating": y,
            "ahead": x * math.cos(heading) + y * math.sin(heading),
            "heading": heading,
        }
        if name in plain:
            period = 2.0 * math.pi if name == "heading" else constant if "repeating" in name else 0.0
            return plain[name] % period if period else plain[name]
        driven = 0.5 * (efforts[0] + efforts[1]) if name.startswith("mean_") else efforts[w]
        return self._remembered(name, constant, (k, w), h, driven)

    def _remembered(self, name: str, constant: float, key: tuple[int, int], h: float, driven: float) -> float:
        position, rate = self.memory.get(key, (0.0, 0.0))
        if name in ("recent_effort", "heat"):
            goal = driven * driven if name == "heat" else driven
            position = goal + (position - goal) * math.exp(-h / constant)
            self.memory[key] = (position, 0.0)
            return position if name == "heat" else position - driven
        omega = 2.0 * math.pi * constant
        rate += h * omega * (driven - position - 2.0 * RINGING_DAMPING * rate)
        position += h * omega * rate
        self.memory[key] = (position, rate)
        return rate if name.endswith("_rate") else position - driven

    def _move(self, h: float, speeds: Sequence[float]) -> None:
        steps = [h * v for v in speeds]
        self.travel_m = [self.travel_m[w] + steps[w] for w in range(2)]
        turn = (steps[1] - steps[0]) / WHEELBASE_M if WHEELBASE_M else 0.0
        middle = self.place[2] + 0.5 * turn
        ahead = 0.5 * (steps[0] + steps[1])
        self.place[0] += ahead * math.cos(middle)
        self.place[1] += ahead * math.sin(middle)
        self.place[2] += turn
        self.time_s += h


def _sign(v: float, force: float) -> float:
    """Direction of motion; of a wheel at rest that of the force on it."""
    return math.copysign(1.0, v) if abs(v) > REST_MPS else math.copysign(1.0, force) if force else 0.0


def _lookup(term: dict[str, Any], w: int, z: float, v: float) -> float:
    grid: list[float] = term["grid"]
    values: list[float] = term["left" if w == 0 else "right"]
    k = bisect.bisect_right(grid, z) if z > 0.0 or v >= 0.0 else bisect.bisect_left(grid, z)
    if k == 0 or k == len(grid):
        return values[min(k, len(grid) - 1)]
    share = (z - grid[k - 1]) / (grid[k] - grid[k - 1])
    return values[k - 1] + share * (values[k] - values[k - 1])
