"""Feedforward from a drive: what a wheel needs per speed, acceleration and direction, and how it tracks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import get_args

import numpy as np

from truing.arrays import FloatArray
from truing.errors import IdentifyError
from truing.identify.grey_box import fit_wheel
from truing.identify.structures import DELAY
from truing.model.wheel import WheelPhysics
from truing.plan import Kind, Plan, Segment
from truing.recording.run import Run, Wheel
from truing_protocol import PARAMETERS

_LEARNING_RATE_HZ = 100
# A count more or less in a row is 3 mm/s at 2400 counts a turn, and would be 17 mm/s at 100 Hz.
_PROOF_RATE_HZ = 20
_BOTH_WAYS = DELAY.plus("both_ways", "reverse_gain", "reverse_time_constant", "reverse_friction")
_EFFORTS = (0.15, 0.30, 0.50)
_SPEEDS_MPS = (0.10, 0.30, 0.50, 0.20)
_LEVEL_S = 1.2
_REST_S = 1.0


def learning_plan() -> Plan:
    """Steps of effort forward and back to the start: steady states for kS and kV, their edges for kA."""
    segments = [Segment(Kind.EFFORT, _REST_S, 0.0, 0.0)]
    for sign in (1.0, -1.0):
        segments += [Segment(Kind.EFFORT, _LEVEL_S, sign * effort, sign * effort) for effort in _EFFORTS]
        segments.append(Segment(Kind.EFFORT, _REST_S, 0.0, 0.0))
    return Plan("tune", "Steps of effort, forward and back", tuple(segments), _LEARNING_RATE_HZ)


def proof_plan() -> Plan:
    """Steps of speed that the learning never saw, forward and back to the start."""
    segments = [Segment(Kind.VELOCITY, _REST_S, 0.0, 0.0)]
    for sign in (1.0, -1.0):
        segments += [Segment(Kind.VELOCITY, _LEVEL_S, sign * speed, sign * speed) for speed in _SPEEDS_MPS]
        segments.append(Segment(Kind.VELOCITY, _REST_S, 0.0, 0.0))
    return Plan("tune_proof", "Steps of speed, forward and back", tuple(segments), _PROOF_RATE_HZ)


def learn(run: Run) -> dict[str, float]:
    """Return the feedforward parameters that a drive of `learning_plan` shows, by their names on the board.

    One model of a wheel, with its own gain, time constant and friction in reverse, is fitted by its
    free-run simulation error. Backwards through it: kV = 1/gain, kA = time constant/gain, kS = friction.

    Raises
    ------
    IdentifyError : a wheel did not turn, or turned against its effort.
    """
    found: dict[str, float] = {}
    for wheel in get_args(Wheel):
        physics = fit_wheel([run], wheel, _BOTH_WAYS, hold_out=False, intervals=False).physics
        if physics.gain_mps <= 0.0:
            raise IdentifyError(
                f"the {wheel} wheel turned against its effort, or not at all",
                "`truing params set motor_left_reversed 1` (or encoder_..., or right) puts a direction right",
            )
        found |= feedforward_of(physics, wheel)
    return found


def feedforward_of(physics: WheelPhysics, wheel: Wheel) -> dict[str, float]:
    """Feedforward parameters of one wheel, within the limits that the board sets."""
    found: dict[str, float] = {}
    for suffix, gain, constant, friction in (
        ("", 1.0, 1.0, 1.0),
        ("_reverse", physics.reverse_gain, physics.reverse_time_constant, physics.reverse_friction),
    ):
        kv = 1.0 / (physics.gain_mps * gain)
        values = {"ks": physics.friction * friction, "kv": kv, "ka": kv * physics.time_constant_s * constant}
        found |= {f"ff_{name}_{wheel}{suffix}": value for name, value in values.items()}
    limits = {info.name: (info.minimum, info.maximum) for info in PARAMETERS}
    return {name: min(max(value, limits[name][0]), limits[name][1]) for name, value in found.items()}


@dataclass(frozen=True, slots=True)
class Tracking:
    """How far the wheels' speeds were from what velocity mode meant them to be, RMS, m/s."""

    left_mps: float
    right_mps: float

    @property
    def both_mps(self) -> float:
        """RMS over both wheels."""
        return float(np.hypot(self.left_mps, self.right_mps) / np.sqrt(2.0))


def tracking(run: Run, parameters: Mapping[str, float]) -> Tracking:
    """Return the tracking error of a run in velocity mode.

    Parameters
    ----------
    parameters : the board's, for the acceleration limit that shapes the speed meant and for the
        travel of a count.
    """
    per_count = 2.0 * np.pi * parameters["wheel_radius_m"] / parameters["counts_per_rev"]
    errors = []
    for side in ("left", "right"):
        meant = _meant(run.t_s, run.columns[f"cmd_{side}"], parameters["accel_limit_mps2"])
        measured = np.diff(run.columns[f"ticks_{side}"]) * per_count / np.diff(run.t_s)
        errors.append(float(np.sqrt(np.mean((measured - meant) ** 2))))
    return Tracking(*errors)


def _meant(t_s: FloatArray, command_mps: FloatArray, limit_mps2: float) -> FloatArray:
    """Mean of the slewed command between rows, shape (n - 1,); a row holds the command up to it."""
    meant, speed = [], 0.0
    for interval, command in zip(np.diff(t_s), command_mps[1:], strict=True):
        reach_s = min(abs(command - speed) / limit_mps2, interval)
        after = speed + np.sign(command - speed) * limit_mps2 * reach_s
        meant.append(((speed + after) / 2.0 * reach_s + after * (interval - reach_s)) / interval)
        speed = after
    return np.array(meant)
