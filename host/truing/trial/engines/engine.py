"""What a physics engine must offer to a trial: robots, what it can hide in them, and their motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, Protocol, TypeVar

import numpy as np

from truing.arrays import FloatArray
from truing.trial.engines.nominal import NominalRobot

# Efforts are set and encoders read at this interval, the fastest rate of a recording.
TICK_S = 0.005
Domain = Literal["wheel", "pose"]
# `catalogue`: an effect that the diagnosis can name; `outside`: one that it cannot; `form`: a change that the
# baseline's own form can follow, so that nothing is missing.
Kind = Literal["catalogue", "outside", "form"]
Rng = np.random.Generator
RobotT = TypeVar("RobotT")


class Driver(Protocol):
    """What sets the efforts of one run."""

    @property
    def ticks(self) -> int:
        """How many intervals of `TICK_S` the run has."""

    def efforts(self, tick: int, angles_rad: FloatArray) -> tuple[float, float]:
        """Efforts of the interval that begins at this tick, from the encoders' shafts there, shape (2,)."""


@dataclass(frozen=True)
class Motion:
    """One run, without the noise of any sensor; n ticks, of which the first is the start at rest.

    Attributes
    ----------
    effort : shape (n, 2), in the interval that ends at the tick.
    angle_rad : shape (n, 2), what the encoders are fixed to.
    pose : shape (n, 3), true x, y (m), heading (rad).
    """

    effort: FloatArray
    angle_rad: FloatArray
    pose: FloatArray


@dataclass(frozen=True)
class EngineEffect(Generic[RobotT]):
    """One thing that an engine can hide in its robot by its own means.

    Attributes
    ----------
    catalogue : name in the diagnosis' catalogue; of an outsider its own name.
    apply : the robot with it; raw strength 1 is the largest that is plausible.
    expected : parameters of the catalogue's equation that the changed robot should show, by their names;
        none where they cannot be reckoned.
    within : factor by which an estimate may miss them: the equation is not the engine's.
    domain : whether it shows in the wheels' speeds or only in a pose measured from outside.
    incompatible : effects that use the same means.
    """

    name: str
    kind: Kind
    catalogue: str
    means: str
    apply: Callable[[RobotT, float, Rng], RobotT]
    expected: Callable[[RobotT], Mapping[str, float]] = lambda _robot: {}
    within: float = 1.3
    start: float = 0.3
    domain: Domain = "wheel"
    incompatible: tuple[str, ...] = ()


class Engine(Protocol[RobotT]):
    """A physics engine."""

    @property
    def name(self) -> str:
        """As the command line has it."""

    @property
    def version(self) -> str:
        """Of the installed package."""

    @property
    def effects(self) -> Mapping[str, EngineEffect[RobotT]]:
        """What it can hide, by name."""

    def healthy(self, nominal: NominalRobot) -> RobotT:
        """A robot with nothing hidden in it."""

    def simulate(
        self, robot: RobotT, drivers: Sequence[Driver], torques_nm: Sequence[FloatArray] | None = None
    ) -> list[Motion]:
        """Drive runs one after the other, each from rest at the origin.

        Parameters
        ----------
        torques_nm : per run, disturbing torques on the axles in each interval, shape (n - 1, 2).
        """
