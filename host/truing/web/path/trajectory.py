"""The trajectory generator: control inputs u(t) = [v, omega] from six keys, after section 3.2 of the MOM
paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from truing.web.limits import CYCLE_S, Limits
from truing.web.pose import Pose

KEYS = ("forward", "back", "left", "right", "faster", "slower")
FORWARD, BACK, LEFT, RIGHT = KEYS[:4]
# Resolution of a drawn path: a quarter of a cycle is at most 2 cm, 2 pixels at the default scale.
_POINTS_PER_CYCLE = 4


@dataclass(frozen=True, slots=True)
class Cycle:
    """One control input: body speed (m/s), yaw rate (rad/s), duration (s)."""

    v_mps: float
    omega_radps: float
    duration_s: float = CYCLE_S


@dataclass
class KeyTrajectory:
    """A trajectory under construction: the model robot follows the keys, one cycle at a time.

    Time advances only with a cycle, so that pauses between keys are not recorded. Faster and slower scale
    both speeds, as in the paper.

    Attributes
    ----------
    start : the model robot's pose before the first cycle.
    speed_fraction : fraction of the speed limits that the keys command.
    limited_by : names of the limits that were active in the last cycle.
    """

    limits: Limits = field(default_factory=Limits)
    start: Pose = field(default_factory=Pose)
    speed_fraction: float = 0.4
    cycles: list[Cycle] = field(default_factory=list)
    limited_by: tuple[str, ...] = ()
    pose: Pose = field(init=False)

    def __post_init__(self) -> None:
        self.pose = self.start

    def change_speed(self, faster: bool) -> None:
        """One step of 10 %, between 10 and 100 % of the limits."""
        self.speed_fraction = min(1.0, max(0.1, round(self.speed_fraction + (0.1 if faster else -0.1), 1)))

    def cycle(self, keys: Sequence[str]) -> Pose:
        """Advance by one cycle with these keys held; returns the new pose."""
        forward = (FORWARD in keys) - (BACK in keys)
        left = (LEFT in keys) - (RIGHT in keys)
        requested = (
            forward * self.speed_fraction * self.limits.speed_mps,
            left * self.speed_fraction * self.limits.yaw_rate_radps,
        )
        return self._append(requested)

    def stop(self) -> None:
        """Append cycles until the model robot is at rest, at maximum deceleration."""
        while self.cycles and (self.cycles[-1].v_mps or self.cycles[-1].omega_radps):
            self._append((0.0, 0.0))

    def reset(self, start: Pose | None = None) -> None:
        """Remove all cycles and return to `start`."""
        self.start = self.start if start is None else start
        self.cycles.clear()
        self.pose, self.limited_by = self.start, ()

    def _append(self, requested: tuple[float, float]) -> Pose:
        previous = (self.cycles[-1].v_mps, self.cycles[-1].omega_radps) if self.cycles else (0.0, 0.0)
        v, omega, self.limited_by = self.limits.clamped(requested, previous)
        self.cycles.append(Cycle(round(v, 6), round(omega, 6)))
        self.pose = self.pose.advanced(self.cycles[-1].v_mps, self.cycles[-1].omega_radps, CYCLE_S)
        return self.pose


def braked_to_rest(cycles: Sequence[Cycle], limits: Limits) -> list[Cycle]:
    """The cycles, extended so that they end at rest."""
    trajectory = KeyTrajectory(limits, cycles=list(cycles))
    trajectory.stop()
    return trajectory.cycles


def poses(start: Pose, cycles: Sequence[Cycle]) -> list[Pose]:
    """Pose before the first cycle and after each one."""
    found = [start]
    for cycle in cycles:
        found.append(found[-1].advanced(cycle.v_mps, cycle.omega_radps, cycle.duration_s))
    return found


def path_points(start: Pose, cycles: Sequence[Cycle]) -> list[list[float]]:
    """The path as x, y, theta every quarter of a cycle."""
    found = [start.as_list()]
    at = start
    for cycle in cycles:
        part = cycle.duration_s / _POINTS_PER_CYCLE
        found += [
            at.advanced(cycle.v_mps, cycle.omega_radps, k * part).as_list()
            for k in range(1, _POINTS_PER_CYCLE + 1)
        ]
        at = at.advanced(cycle.v_mps, cycle.omega_radps, cycle.duration_s)
    return found


def duration_s(cycles: Sequence[Cycle]) -> float:
    """Total duration."""
    return sum(cycle.duration_s for cycle in cycles)
