"""What one trial is: which effects, how strong, on which robot, driven how, seen by which sensors."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from truing.errors import TruingError
from truing.plan import Kind, Plan, Segment, load_plan
from truing.trial.effects import ALL, CATALOGUE, INTERMITTENT, OUTSIDE
from truing.trial.robot import Robot, draw_robot

Family: TypeAlias = Literal["one", "two", "several", "null", "outside", "intermittent"]
Driving: TypeAlias = Literal["whole", "partial", "ordinary"]

# In the order in which they are driven: charge, heat and wheel angles run on from one to the next.
PLAN_NAMES = tuple(
    f"diagnosis/{name}"
    for name in (
        "steps_from_rest",
        "reversals",
        "slow_ramps",
        "coast_downs",
        "staircase",
        "turns_on_the_spot",
        "one_wheel_at_a_time",
        "chirp",
        "creeping",
        "independent_steps",
        "heavy_load",
        "rest_and_repeat",
        "four_headings",
    )
)
BASELINE_OFF = 0.08
# Of the family `several`: effects at once, from the first number to one less than the second.
SEVERAL = (3, 5)
FULL_STRENGTH = (1.0, 8.0)
WEAK_STRENGTH = (0.3, 1.0)
_LOOSE_RESTING_MPS = 0.03


@dataclass(frozen=True)
class Concealed:
    """One concealed effect: its name, the strength S aimed at, and what its own draws start from."""

    name: str
    strength: float
    seed: int


@dataclass(frozen=True)
class Sensors:
    """Sensors beside the encoders.

    Attributes
    ----------
    truth_mm, truth_mrad : standard deviation of an external pose measurement; 0: there is none.
    gyro_radps : standard deviation of a gyro; 0: none.
    """

    truth_mm: float = 0.0
    truth_mrad: float = 0.0
    gyro_radps: float = 0.0


@dataclass(frozen=True)
class TorqueDisturbance:
    """The torque disturbance: effort that it balances (RMS), its memory, the speed below which it fades."""

    effort: float
    correlation_s: float
    resting_mps: float


@dataclass(frozen=True)
class Trial:
    """Everything about one trial that is drawn from its seed."""

    seed: int
    family: Family
    effects: tuple[Concealed, ...]
    robot: Robot
    baseline_gain_mps: tuple[float, float]
    baseline_time_constant_s: tuple[float, float]
    driving: Driving
    plans: tuple[Plan, ...]
    sensors: Sensors
    disturbance: TorqueDisturbance
    weak: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """The concealed effects' names."""
        return tuple(effect.name for effect in self.effects)


def draw_trial(
    seed: int,
    family: Family = "one",
    names: tuple[str, ...] | None = None,
    *,
    weak: bool | None = None,
    plans: tuple[Plan, ...] | None = None,
) -> Trial:
    """Return the trial that a seed stands for.

    Parameters
    ----------
    names : the effects to conceal; drawn evenly from those of the family when left out.
    weak : strength below 1; drawn when left out.
    plans : drive these instead.
    """
    rng = np.random.default_rng([seed, 0x747275])
    names = _names(rng, family) if names is None else names
    unknown = [name for name in names if name not in ALL]
    if unknown:
        raise TruingError(f"{unknown[0]}: no effect of that name", f"known: {', '.join(ALL)}, random, none")
    weak = bool(rng.random() < 0.4) if weak is None else weak
    weak = weak and family == "one"
    low, high = WEAK_STRENGTH if weak else FULL_STRENGTH
    concealed = tuple(
        Concealed(name, float(np.exp(rng.uniform(np.log(low), np.log(high)))), int(rng.integers(2**62)))
        for name in names
    )
    robot = draw_robot(rng)
    tied = any(ALL[name].tied for name in names)
    off = 1.0 + rng.uniform(-BASELINE_OFF, BASELINE_OFF, 4)
    if family == "null" and rng.random() < 0.3:
        off[:] = 1.0
    gain, constant = np.array(robot.gain_mps), np.array(robot.time_constant_s)
    if tied:
        gain[:], constant[:] = gain.mean(), constant.mean()
        off[1], off[3] = off[0], off[2]
    chosen = str(rng.choice(["whole", "partial", "ordinary"], p=[0.65, 0.2, 0.15]))
    driving = _DRIVING[chosen]
    needs_truth = any("truth" in ALL[name].needs for name in names)
    has_pose = needs_truth or rng.random() < 0.4
    sensors = Sensors(
        truth_mm=float(rng.uniform(0.5, 3.0)) if has_pose else 0.0,
        truth_mrad=float(rng.uniform(1.0, 4.0)) if has_pose else 0.0,
        gyro_radps=float(rng.uniform(0.005, 0.02)) if rng.random() < 0.3 else 0.0,
    )
    disturbance = TorqueDisturbance(
        effort=float(np.exp(rng.uniform(np.log(0.002), np.log(0.015)))),
        correlation_s=float(np.exp(rng.uniform(np.log(0.05), np.log(0.5)))),
        resting_mps=float(rng.choice([0.0, 0.03])),
    )
    return Trial(
        seed=seed,
        family=family,
        effects=concealed,
        robot=robot,
        baseline_gain_mps=(float(gain[0] * off[0]), float(gain[1] * off[1])),
        baseline_time_constant_s=(float(constant[0] * off[2]), float(constant[1] * off[3])),
        driving=driving,
        plans=plans or _plans(rng, driving, robot),
        sensors=sensors,
        disturbance=disturbance,
        weak=weak,
    )


_DRIVING: dict[str, Driving] = {"whole": "whole", "partial": "partial", "ordinary": "ordinary"}


def _names(rng: np.random.Generator, family: Family) -> tuple[str, ...]:
    if family == "null":
        return ()
    pool = sorted({"outside": OUTSIDE, "intermittent": INTERMITTENT}.get(family, CATALOGUE))
    if family == "several":
        number = int(rng.integers(*SEVERAL))
    else:
        number = 2 if family == "two" else 1
    return tuple(str(name) for name in rng.choice(pool, number, replace=False))


def _plans(rng: np.random.Generator, driving: Driving, robot: Robot) -> tuple[Plan, ...]:
    if driving == "ordinary":
        return tuple(_ordinary(rng, robot, number) for number in range(1, 14))
    plans = [load_plan(name) for name in PLAN_NAMES]
    if driving == "partial":
        kept = np.sort(rng.choice(len(plans), len(plans) - len(plans) // 3, replace=False))
        plans = [plans[k] for k in kept]
    return tuple(plans)


def _ordinary(rng: np.random.Generator, robot: Robot, number: int) -> Plan:
    """Driving as people do: forward and in bends, in velocity mode, never to the limits."""
    top = 0.6 * min(robot.gain_mps)
    segments = [Segment(Kind.TWIST, 0.5, 0.0, 0.0)]
    left_s = 13.5
    while left_s > 0.0:
        duration = round(float(rng.uniform(0.6, 2.5)), 2)
        speed = float(rng.uniform(-0.3, 1.0)) * top
        turn = float(rng.choice([0.0, 1.0, -1.0])) * float(rng.uniform(0.2, 0.8)) * top / robot.wheelbase_m
        room = max(0.0, 1.2 * top - abs(speed)) * 2.0 / robot.wheelbase_m
        turn = float(np.clip(turn, -room, room))
        segments.append(Segment(Kind.TWIST, duration, round(speed, 3), round(turn, 3)))
        left_s -= duration
    segments.append(Segment(Kind.TWIST, 1.0, 0.0, 0.0))
    return Plan(f"ordinary_{number:02d}", "Ordinary driving", tuple(segments), 20)


def judging_plans(seed: int, robot: Robot) -> tuple[Plan, ...]:
    """Runs that judge what was fitted to others: efforts in steps of any size, and a drive as people do."""
    rng = np.random.default_rng([seed, 0x6A7564])
    plans = []
    for number in range(1, 4):
        segments = [Segment(Kind.EFFORT, 0.5, 0.0, 0.0)]
        left_s = 10.5
        while left_s > 0.0:
            duration = round(float(rng.uniform(0.25, 1.8)), 2)
            left, right = (round(float(u), 3) for u in rng.uniform(-0.8, 0.8, 2))
            # Half the time straight on, as robots mostly go; now and then nothing at all.
            right = left if rng.random() < 0.5 else right
            if rng.random() < 0.15:
                left = right = 0.0
            segments.append(Segment(Kind.EFFORT, duration, left, right))
            left_s -= duration
        segments.append(Segment(Kind.EFFORT, 1.0, 0.0, 0.0))
        plans.append(Plan(f"judging_{number:02d}", "Any efforts", tuple(segments), 20))
    return (*plans, dataclasses.replace(_ordinary(rng, robot, 4), name="judging_04"))


def with_strengths(trial: Trial, values: tuple[float, ...]) -> Robot:
    """Return the trial's robot with its effects at these raw strengths (1: the largest of its kind)."""
    robot = dataclasses.replace(
        trial.robot, changes=dict(trial.robot.changes), hidden=dict(trial.robot.hidden)
    )
    for concealed, value in zip(trial.effects, values, strict=True):
        ALL[concealed.name].apply(robot, value, np.random.default_rng(concealed.seed))
    disturbance = trial.disturbance
    if disturbance.effort > 0.0:
        torque = robot.effort_nm(disturbance.effort)
        # A motor that is loose from its held wheel would never stand still, and its board never start.
        loose = "gear__stiffness_nm_per_rad" in robot.hidden
        resting_mps = max(disturbance.resting_mps, _LOOSE_RESTING_MPS if loose else 0.0)
        robot.add_hidden(
            disturbance__torque_nm=(torque, torque),
            disturbance__correlation_s=disturbance.correlation_s,
            disturbance__resting_mps=resting_mps,
        )
    return robot
