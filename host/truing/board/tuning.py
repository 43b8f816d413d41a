"""Tuning of the feedforward: drive, learn, drive again; without a gain the old parameters return."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

if TYPE_CHECKING:
    from truing.plan import Plan

R = TypeVar("R")


class Tracked(Protocol):
    """A tracking error."""

    @property
    def both_mps(self) -> float:
        """RMS over both wheels."""


T = TypeVar("T", bound=Tracked)
T_co = TypeVar("T_co", bound=Tracked, covariant=True)


class TunedRobot(Protocol[R, T_co]):
    """What a tuning needs of whoever drives: the command line, or the view."""

    def drive(self, plan: Plan, label: str) -> R:
        """Drive a plan to its end and return its run."""

    def learn(self, run: R) -> dict[str, float]:
        """Return the feedforward parameters that the run of the learning plan shows."""

    def tracking(self, run: R, parameters: Mapping[str, float]) -> T_co:
        """Return the tracking error of a run of the proof plan."""

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Put values into force."""

    def restore_parameters(self, values: Mapping[str, float]) -> None:
        """Put the old values into force again, after whatever has happened."""


@dataclass(frozen=True)
class TuningResult(Generic[T]):
    """What was learned, and what it brings.

    Attributes
    ----------
    parameters : values before and learned, by name.
    is_better : the wheels follow more closely, and the board holds what was learned.
    """

    parameters: Mapping[str, tuple[float, float]]
    before: T
    after: T

    @property
    def is_better(self) -> bool:
        """Whether the tracking error fell."""
        return self.after.both_mps < self.before.both_mps


def tune(
    robot: TunedRobot[R, T], values: Mapping[str, float], proof: Plan, learning: Plan
) -> TuningResult[T]:
    """Drive, learn and drive again; the old parameters return where that is no better, stopped, or fails.

    Parameters
    ----------
    values : the board's parameters before.
    proof : steps of speed that show how the wheels follow.
    learning : steps of effort to learn from.
    """
    before = robot.tracking(robot.drive(proof, "tune_before"), values)
    learned = robot.learn(robot.drive(learning, "tune_learning"))
    old = {name: values[name] for name in learned}
    pairs = {name: (old[name], value) for name, value in learned.items()}
    keeps = False
    try:
        robot.set_parameters(learned)
        after = robot.tracking(robot.drive(proof, "tune_after"), values)
        result = TuningResult(pairs, before, after)
        keeps = result.is_better
    finally:
        if not keeps:
            robot.restore_parameters(old)
    return result
