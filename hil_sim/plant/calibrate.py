"""Calibrates the plant's parameters: compares the paper's effort tests with the plant, and fits on request.

Without arguments it prints the table for the numbers that the library has.
"""
# ruff: noqa: T201

from __future__ import annotations

import argparse
import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from hil_sim.plant import STEP_S, Plant, RobotParameters

LOG_S = 0.05
LEVEL_S = 2.0
REST_S = 1.0
STEADY_SHARE = 0.4
"""The gain of a level is the mean speed over this last share of it, over the input."""


@dataclass(frozen=True)
class PaperLevel:
    """One row's third of Bakirci 2023, Table III or IV: effort in per cent, gain in mm/s per per cent."""

    effort: float
    gain: float
    tau_s: float


@dataclass(frozen=True)
class PaperTest:
    """One effort test of the paper; `wheels` are the factors with which left and right take the effort."""

    name: str
    wheels: tuple[float, float]
    levels: tuple[PaperLevel, ...]
    tau_down_s: float | None = None


def _pivot(name: str, level: PaperLevel, tau_down_s: float) -> PaperTest:
    return PaperTest(name, (1.0, 0.0), (level,), tau_down_s)


def _straight(name: str, *levels: PaperLevel) -> PaperTest:
    return PaperTest(name, (1.0, 1.0), levels)


_L = PaperLevel
PAPER = (
    _pivot("I", _L(15, 9.132, 0.603), 0.247),
    _pivot("II", _L(30, 13.353, 0.616), 0.231),
    _pivot("III", _L(45, 14.544, 0.415), 0.452),
    _pivot("IV", _L(60, 14.177, 0.305), 0.339),
    _straight("IX", _L(15, 12.131, 0.218), _L(30, 14.175, 0.237), _L(25, 14.075, 0.554)),
    _straight("X", _L(25, 14.225, 0.241), _L(40, 14.506, 0.584), _L(35, 14.281, 0.534)),
    _straight("XI", _L(35, 14.283, 0.525), _L(50, 14.402, 0.697), _L(45, 14.446, 0.571)),
    _straight("XII", _L(45, 14.454, 0.633), _L(60, 14.673, 0.635), _L(55, 14.558, 0.786)),
    _straight(
        "XVII",
        *(_L(25, 14.078, 0.624), _L(40, 14.757, 0.675), _L(30, 13.839, 0.453)),
        *(_L(35, 14.313, 0.417), _L(15, 13.338, 0.362), _L(60, 14.831, 1.057)),
    ),
)


@dataclass(frozen=True)
class ReplayedLevel:
    """One level as the plant drove it, read from the left encoder at 20 Hz as the paper's log was."""

    test: PaperTest
    paper: PaperLevel
    previous_effort: float
    gain: float
    exact_gain: float
    tau_s: float

    @property
    def error_percent(self) -> float:
        """Relative error of the gain against the paper."""
        return 100.0 * (self.gain / self.paper.gain - 1.0)


def crossing_s(speeds: NDArray[np.float64], before: float, steady: float) -> float:
    """First crossing of 63.2 % of a step, s after its command.

    Parameters
    ----------
    speeds
        Shape (samples,), mean speed over each log interval since the command, any unit.
    before, steady
        Speed before the step and its new steady speed, same unit.
    """
    share = np.concatenate(([0.0], (speeds - before) / (steady - before)))
    target = 1.0 - np.exp(-1.0)
    after = int(np.argmax(share >= target))
    if share[after] < target:
        return float("nan")
    fraction = (target - share[after - 1]) / (share[after] - share[after - 1])
    return float((after - 1 + fraction) * LOG_S)


def replay_test(test: PaperTest, robot: RobotParameters, library: Path | None = None) -> list[ReplayedLevel]:
    """Drive one test on a freshly placed robot."""
    plant = Plant(robot, library=library)
    turn_m = 2.0 * np.pi * robot.left.radius_m
    mm_per_count = 1000.0 * turn_m / robot.left.encoder.counts_per_rev
    samples = round(LEVEL_S / LOG_S)
    steady_samples = round(STEADY_SHARE * samples)
    steady_s = steady_samples * LOG_S
    steps = round(LOG_S / STEP_S)

    plant.drive(0.0, 0.0)
    plant.advance_s(REST_S)
    replayed = []
    before, previous = 0.0, 0.0
    for level in test.levels:
        plant.drive(*(level.effort / 100.0 * wheel for wheel in test.wheels))
        counts, angles = [plant.encoder(0)], [plant.state().wheel_angle_rad[0]]
        for _ in range(samples):
            plant.advance(steps)
            counts.append(plant.encoder(0))
            angles.append(plant.state().wheel_angle_rad[0])
        steady = (counts[-1] - counts[-1 - steady_samples]) * mm_per_count / steady_s
        exact = (angles[-1] - angles[-1 - steady_samples]) * robot.left.radius_m * 1000.0 / steady_s
        speeds = np.diff(np.asarray(counts, dtype=np.float64)) * mm_per_count / LOG_S
        tau_s = crossing_s(speeds, before, steady)
        replayed.append(
            ReplayedLevel(test, level, previous, steady / level.effort, exact / level.effort, tau_s)
        )
        before, previous = steady, level.effort
    return replayed


def replay(robot: RobotParameters, library: Path | None = None) -> list[ReplayedLevel]:
    """All effort levels of Tables III and IV."""
    return [level for test in PAPER for level in replay_test(test, robot, library)]


def time_constant_s(robot: RobotParameters) -> float:
    """Of a step straight ahead without dry friction and sag: inertia over viscous drag and back-EMF's."""
    wheel = robot.left
    ratio = wheel.motor.gear_ratio
    inertia = wheel.inertia_kgm2 + ratio**2 * wheel.motor.rotor_inertia_kgm2
    inertia += robot.chassis.mass_kg / 2.0 * wheel.radius_m**2
    electric = (wheel.motor.emf_v_per_radps * ratio) ** 2 / wheel.motor.resistance_ohm
    return inertia / (electric + wheel.friction.viscous_nms_per_rad)


def breakaway_effort(robot: RobotParameters) -> float:
    """The effort at which a wheel of the standing robot begins to turn, both wheels driven."""
    motor = robot.left.motor
    stall_nm = motor.emf_v_per_radps * motor.gear_ratio * robot.battery.full_v / motor.resistance_ohm
    return robot.left.friction.breakaway_nm / stall_nm


BREAKAWAY_EFFORT_LIMIT = 0.09
"""The paper's robot starts at 15 % every time; with a breakaway close to that, the gain of a level would
depend on the few milliseconds by which the start is late. The fit is bounded away from it."""


def assembled(base: RobotParameters, tau_s: float, fitted: NDArray[np.float64]) -> RobotParameters:
    """A robot from the five fitted numbers, its rotor inertia set by the time constant.

    Parameters
    ----------
    fitted
        Shape (5,): back-EMF V s/rad, Coulomb N m, breakaway as effort, Stribeck speed rad/s, scrub N m.
    """
    emf, coulomb, breakaway, stribeck, scrub = (float(value) for value in fitted)
    ratio = base.left.motor.gear_ratio
    radius = base.left.radius_m
    damping = (emf * ratio) ** 2 / base.left.motor.resistance_ohm + base.left.friction.viscous_nms_per_rad
    carried = base.left.inertia_kgm2 + base.chassis.mass_kg / 2.0 * radius**2
    stall_nm = emf * ratio * base.battery.full_v / base.left.motor.resistance_ohm
    values = {
        "motor__emf_v_per_radps": emf,
        "motor__rotor_inertia_kgm2": max((tau_s * damping - carried) / ratio**2, 0.0),
        "friction__coulomb_nm": coulomb,
        "friction__breakaway_nm": max(coulomb, breakaway * stall_nm),
        "friction__stribeck_radps": stribeck,
    }
    both = {f"{side}__{name}": value for name, value in values.items() for side in ("left", "right")}
    return base.changed(chassis__scrub_nm=scrub, **both)


def fit(base: RobotParameters, tau_s: float, library: Path | None = None) -> RobotParameters:
    """Least squares over all gains' relative errors, from three starts."""
    scale = np.array([0.0175, 0.02, 0.06, 2.0, 0.1])
    low = np.array([0.010, 0.010, 0.005, 0.5, 0.001]) / scale
    high = np.array([0.030, 0.100, BREAKAWAY_EFFORT_LIMIT, 10.0, 1.0]) / scale

    def errors(unknown: NDArray[np.float64]) -> NDArray[np.float64]:
        robot = assembled(base, tau_s, unknown * scale)
        return np.array([one.exact_gain / one.paper.gain - 1.0 for one in replay(robot, library)])

    starts = [np.array([1.0, 1.0, 0.8, stribeck, 0.8]) for stribeck in (0.5, 1.0, 2.0)]
    fits = [least_squares(errors, start, bounds=(low, high), diff_step=[1e-3]) for start in starts]
    best = min(fits, key=lambda one: float(one.cost))
    return assembled(base, tau_s, best.x * scale)


def summary(levels: list[ReplayedLevel]) -> str:
    """Mean and worst absolute error of the gains."""
    errors = np.abs([level.error_percent for level in levels])
    return f"{len(errors)} gains: mean absolute error {errors.mean():.2f} %, worst {errors.max():.2f} %"


def print_table(robot: RobotParameters, library: Path | None = None) -> None:
    """Print every level beside the paper's."""
    levels = replay(robot, library)
    print("                          gain, mm/s per %              time constant, s")
    print("test  wheels  effort       paper  plant   error          paper  plant")
    for level in levels:
        wheels = "both" if level.test.wheels[1] else "left"
        step = f"{level.previous_effort:3.0f} -> {level.paper.effort:2.0f} %"
        print(
            f"{level.test.name:5s} {wheels:6s} {step}  {level.paper.gain:7.3f} {level.gain:7.3f} "
            f"{level.error_percent:+6.2f} %       {level.paper.tau_s:7.3f} {level.tau_s:6.3f}"
        )
    paper = np.median([level.paper.tau_s for level in levels])
    plant = np.median([level.tau_s for level in levels])
    print(summary(levels))
    print(f"time constant: median {paper:.3f} s in the paper, {plant:.3f} s here", end="")
    print(f" ({time_constant_s(robot):.3f} s without friction, sag and log)")
    print(f"a standing wheel starts at {100 * breakaway_effort(robot):.1f} % effort")


def print_numbers(robot: RobotParameters) -> None:
    """Print one wheel's and the chassis' numbers as plant_params.c has them."""
    parts = (("motor", robot.left.motor), ("friction", robot.left.friction), ("chassis", robot.chassis))
    for name, part in parts:
        print(name, *(f"  .{key} = {value:.4g}" for key, value in dataclasses.asdict(part).items()), sep="\n")


CHOSEN_TAU_S = 0.38


def main() -> None:
    """Print what the arguments ask for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fit", action="store_true", help="find the fitted numbers again")
    parser.add_argument("--tau", type=float, default=CHOSEN_TAU_S, help="time constant for --fit, s")
    parser.add_argument("--trade", action="store_true", help="fit for a range of time constants")
    parser.add_argument("--library", type=Path, help="another build of the plant")
    arguments = parser.parse_args()

    robot = RobotParameters.msrp(arguments.library)
    if arguments.trade:
        for tau_s in (0.25, 0.30, 0.35, 0.40, 0.45, 0.50, 0.55, 0.60):
            fitted = fit(robot, tau_s, arguments.library)
            print(f"tau {tau_s:.2f} s, {summary(replay(fitted, arguments.library))}", flush=True)
        return
    if arguments.fit:
        robot = fit(robot, arguments.tau, arguments.library)
        print_numbers(robot)
    print_table(robot, arguments.library)


if __name__ == "__main__":
    main()
