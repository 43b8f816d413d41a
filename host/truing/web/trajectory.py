"""The trajectory generator: control inputs u(t) = [v, omega] from six keys, as the MOM paper's section 3.2
has it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from truing.web.limits import CYCLE_S, Limits
from truing.web.pose import Pose

FORWARD, BACK, LEFT, RIGHT, FASTER, SLOWER = KEYS = ("forward", "back", "left", "right", "faster", "slower")
# What a path on the screen is drawn from; a tenth of a cycle is half a pixel at a metre in a hundred.
_DRAWN_PER_CYCLE = 4


@dataclass(frozen=True, slots=True)
class Cycle:
    """One control input: body speed (m/s), yaw rate (rad/s), for so long (s)."""

    v_mps: float
    omega_radps: float
    duration_s: float = CYCLE_S


@dataclass
class KeyTrajectory:
    """A trajectory in the making: the model robot drives as the keys say, one cycle at a time.

    Time passes only with a cycle, so that thinking between two keys costs nothing. Faster and slower
    scale both speeds, as the two keys of the paper do.

    Attributes
    ----------
    start : the model robot's pose before the first cycle.
    share : of the limits' speeds that the keys ask for.
    held : what kept the last cycle from doing as asked.
    """

    limits: Limits = field(default_factory=Limits)
    start: Pose = field(default_factory=Pose)
    share: float = 0.4
    cycles: list[Cycle] = field(default_factory=list)
    held: tuple[str, ...] = ()
    pose: Pose = field(init=False)

    def __post_init__(self) -> None:
        self.pose = self.start

    def change_speed(self, faster: bool) -> None:
        """One step of a tenth, from a tenth to all of the limits."""
        self.share = min(1.0, max(0.1, round(self.share + (0.1 if faster else -0.1), 1)))

    def cycle(self, keys: Sequence[str]) -> Pose:
        """Let one cycle pass with these keys held; returns the new pose."""
        ahead = (FORWARD in keys) - (BACK in keys)
        aside = (LEFT in keys) - (RIGHT in keys)
        wanted = (ahead * self.share * self.limits.speed_mps, aside * self.share * self.limits.turn_radps)
        return self._append(wanted)

    def stop(self) -> None:
        """Cycles until the model robot stands, as fast as it may brake."""
        while self.cycles and (self.cycles[-1].v_mps or self.cycles[-1].omega_radps):
            self._append((0.0, 0.0))

    def undo(self, cycles: int = 10) -> None:
        """Take back the last cycles."""
        del self.cycles[max(0, len(self.cycles) - cycles) :]
        self.pose = poses(self.start, self.cycles)[-1]
        self.held = ()

    def reset(self, start: Pose | None = None) -> None:
        """Forget the cycles; stand at `start`."""
        self.start = self.start if start is None else start
        self.cycles.clear()
        self.pose, self.held = self.start, ()

    def _append(self, wanted: tuple[float, float]) -> Pose:
        before = (self.cycles[-1].v_mps, self.cycles[-1].omega_radps) if self.cycles else (0.0, 0.0)
        v, omega, self.held = self.limits.allowed(wanted, before)
        self.cycles.append(Cycle(round(v, 6), round(omega, 6)))
        self.pose = self.pose.advanced(self.cycles[-1].v_mps, self.cycles[-1].omega_radps, CYCLE_S)
        return self.pose


def braked(cycles: Sequence[Cycle], limits: Limits) -> list[Cycle]:
    """The cycles with what it takes to stand still at their end."""
    made = KeyTrajectory(limits, cycles=list(cycles))
    made.stop()
    return made.cycles


def poses(start: Pose, cycles: Sequence[Cycle]) -> list[Pose]:
    """Pose before the first cycle and after each."""
    found = [start]
    for cycle in cycles:
        found.append(found[-1].advanced(cycle.v_mps, cycle.omega_radps, cycle.duration_s))
    return found


def drawn(start: Pose, cycles: Sequence[Cycle]) -> list[list[float]]:
    """The path as x, y, theta every quarter of a cycle."""
    found = [start.as_list()]
    at = start
    for cycle in cycles:
        part = cycle.duration_s / _DRAWN_PER_CYCLE
        found += [
            at.advanced(cycle.v_mps, cycle.omega_radps, k * part).as_list()
            for k in range(1, _DRAWN_PER_CYCLE + 1)
        ]
        at = at.advanced(cycle.v_mps, cycle.omega_radps, cycle.duration_s)
    return found


def duration_s(cycles: Sequence[Cycle]) -> float:
    """How long it takes."""
    return sum(cycle.duration_s for cycle in cycles)
