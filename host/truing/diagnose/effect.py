"""An effect of the catalogue: its description, its parameters, and how it joins the simulation.

One file in `effects/` holds one effect: a docstring with equation and source, one `EFFECT = Effect(...)`,
and hooks. A hook is a plain function named after a stage of the simulation (`simulation/stages.py` lists
the stages and says what each may ask for). Its arguments are found by name:

- the name of one of the effect's parameters gives that parameter's value;
- `own` gives `left` or `right`, whichever wheel is being simulated; `own_X` gives `X_left` or `X_right`;
- every other name is something the stage offers (`speed`, `command`, `wheel`, ...).

Hooks are compiled by numba: arithmetic and `math` only. An effect that is off costs one test of a bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from truing.diagnose.data.set_data import SetData

SIDES = ("left", "right")
Domain = Literal["wheel", "pose", "both"]
Need = Literal["pose", "heading", "geometry", "angle", "vel", "equal_wheels"]
Scale = Literal["one", "speed", "per_speed_squared", "duration", "time_constant", "acceleration"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of an effect.

    Attributes
    ----------
    name : as in docs/DATA_FORMAT.md where it is the same number; amplitudes are fitted as sine and cosine.
    unit : of the value; "1" for ratios and fractions.
    lower, upper : bounds.
    off : where the effect vanishes.
    starts : values of moderate strength to start a search from, the weak one first.
    wheel : the wheel whose speed alone it moves, or None.
    scale : what a search's number (and lower, upper, off, starts) is a multiple of: one, the robot's
        full-effort speed (m/s), one over its square, the length of the set (s), the time constant (s) or the
        acceleration at full effort from rest (in accelerations of gravity).
        Robots differ by a factor of fifty; hooks, `report` and `from_baseline` see the plain unit.
    log : positive, and better searched in its logarithm.
    nuisance : fitted or scanned, but not reported.
    scan : the error is not smooth in it: take `starts` as a grid.
    fixed : it stays at the best value of that grid.
    needs_pose : without a pose or yaw rate from outside it is one with the gains, and stays off.
    beside : it stays off without one of these other effects in the model.
    pull : a plain fit pulls it towards its start, as strongly as an error of this share of the full-effort
        speed in every row for a change by 1. Recordings that cannot determine it leave it there, and one that
        they determine is hardly changed (ridge regression: Hoerl & Kennard 1970).
    plain : plain fits of the free-run error alone fit it: it refines a model that leaves more than noise, and
        is no part of what the effect is recognised by.
    """

    name: str
    unit: str
    lower: float
    upper: float
    off: float
    starts: tuple[float, ...]
    wheel: Literal["left", "right"] | None = None
    scale: Scale = "one"
    log: bool = False
    nuisance: bool = False
    scan: bool = False
    fixed: bool = False
    needs_pose: bool = False
    beside: tuple[str, ...] = ()
    pull: float = 0.0
    plain: bool = False


def identity(values: Mapping[str, float]) -> dict[str, float]:
    """The numbers as they stand."""
    return dict(values)


def always(data: SetData) -> float:
    """Excited in any recording."""
    return 1.0 if len(data) else 0.0


def no_evidence(data: SetData) -> float:
    """No direct evidence from recorded signals."""
    return 0.0 * len(data)


@dataclass(frozen=True, slots=True)
class Effect:
    """One entry of the catalogue.

    Attributes
    ----------
    name : as in docs/DATA_FORMAT.md, section 5.
    title : plain words for a user.
    equation : one line, in effort units unless it says otherwise.
    source : where the equation comes from.
    signature : what it looks like in recordings.
    separated_by : the effects it is confused with, each with the run that distinguishes them.
    excited_by : the driving and the signals that show it, as `exercised` asks for them.
    parameters : in the order of docs/DATA_FORMAT.md.
    domain : seen in the wheels' speeds, in the pose, or in both.
    needs : what the recordings or the baseline must hold before it is identifiable:
        "pose" (truth or gyro), "heading", "geometry" (wheelbase), "angle" (wheel radius), "vel" (the
        selected speed is the recorder's own), "equal_wheels" (the baseline has both wheels equal).
    report : internal numbers to the reported ones. It gets the effect's parameters by name and also
        gain_left, tau_left, gain_right, tau_right.
    from_baseline : the numbers of an `[effect.NAME]` table to internal ones.
    exercised : 0 where these recordings could not show it, above 0 weakly, 1 or more fully.
    step_share : the largest substep that solves it accurately, as a share of the baseline's smaller time
        constant; infinite where any step is exact.
    settles : at steady speeds longer substeps do.
    exact : any step is exact while no other effect asks for a `step_share`.
    units : units of reported parameters that are no parameter of the same name here.
    non_negative : reported parameters among those that cannot be below zero.
    couples : it lets one wheel move the other, so that the wheels cannot be perturbed in one rollout.
    extends : the simpler effect that this one contains; it is named only where its additional parameters
        are significant.
    evidence : log-likelihood ratio from two recorded signals without a robot model, nats; 0 without any.
    """

    name: str
    title: str
    equation: str
    source: str
    signature: str
    separated_by: Mapping[str, str]
    excited_by: str
    parameters: tuple[Parameter, ...]
    domain: Domain = "wheel"
    needs: tuple[Need, ...] = ()
    report: Callable[[Mapping[str, float]], dict[str, float]] = identity
    from_baseline: Callable[[Mapping[str, float]], dict[str, float]] = identity
    exercised: Callable[[SetData], float] = always
    step_share: float = float("inf")
    settles: bool = True
    exact: bool = False
    couples: bool = False
    units: Mapping[str, str] = field(default_factory=dict)
    non_negative: tuple[str, ...] = ()
    extends: str = ""
    evidence: Callable[[SetData], float] = no_evidence

    def parameter(self, name: str) -> Parameter:
        """A parameter by its name."""
        return next(item for item in self.parameters if item.name == name)

    def internal(self, given: Mapping[str, float]) -> dict[str, float]:
        """Internal numbers of an `[effect.NAME]` table; one that it gives by its internal name stands."""
        own = {item.name for item in self.parameters}
        return self.from_baseline(given) | {key: value for key, value in given.items() if key in own}

    def reported(self, values: Mapping[str, float]) -> dict[str, float]:
        """The reported parameters for internal `values` (with the baseline's four numbers among them)."""
        if self.report is not identity:
            return self.report(values)
        return {item.name: values[item.name] for item in self.parameters if not item.nuisance}


def per_wheel(
    stem: str,
    unit: str,
    lower: float,
    upper: float,
    off: float,
    starts: tuple[float, ...],
    scale: Scale = "one",
    *,
    beside: tuple[str, ...] = (),
    pull: float = 0.0,
) -> tuple[Parameter, Parameter]:
    """The same parameter for the left and the right wheel; an empty stem names them left and right."""
    prefix = f"{stem}_" if stem else ""
    sides: tuple[Literal["left", "right"], ...] = ("left", "right")
    left, right = (
        Parameter(f"{prefix}{side}", unit, lower, upper, off, starts, side, scale, beside=beside, pull=pull)
        for side in sides
    )
    return left, right
