"""One practice trial: a robot with something hidden, its recordings, and the answer kept apart."""

from __future__ import annotations

import json
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from support.practice_robots.draws import draw_baseline, draw_experiment, draw_machine, draw_signals
from support.practice_robots.effects import CATALOGUE, Draw, Hidden, Shape
from support.practice_robots.kernel import SUPPLY, WARM, X
from support.practice_robots.outside import OUTSIDE
from support.practice_robots.physics import Physics
from support.practice_robots.plans import PLAN_KINDS, PlanKind
from support.practice_robots.recorder import Drive, by_run_difference
from support.practice_robots.reference import FREE, effective
from support.practice_robots.strength import Experiment, find_size
from support.practice_robots.writer import draw_log, write_set

Array: TypeAlias = NDArray[np.float64]
Strength: TypeAlias = Literal["full", "weak"]
STRENGTHS: dict[str, tuple[float, float]] = {"full": (1.0, 4.0), "weak": (0.3, 1.0)}
NULLS = ("null_exact", "null_numbers")
ATTEMPTS = 24

# Pairs that set the same numbers of the robot, or that no recording distinguishes.
NOT_TOGETHER = (
    {"coulomb_friction", "stribeck_friction"},
    {"encoder_scale", "wheel_radius_error"},
    {"wheel_radius_error", "heading_drift"},
    {"encoder_scale", "heading_drift"},
    {"encoder_scale", "encoder_dropout"},
    {"input_delay", "driver_lag"},
    {"driver_lag", "speed_filter"},
    {"input_delay", "speed_filter"},
)
# One number for both wheels in the catalogue, so that both wheels must be alike for it to be true.
ONE_NUMBER = {"coast_decay"}
NEEDS_TRUTH = {"encoder_scale", "wheel_radius_error", "wheelbase_error", "heading_drift"}
SHOWS_IN_TRUTH = {"wheel_slip", "floor_slope", "encoder_dropout", "encoder_eccentricity", "gear_backlash"}


class NotReachable(Exception):  # noqa: N818 - says what happened
    """No robot and plan was found on which the effect reaches its strength."""


@dataclass(frozen=True)
class HiddenEffect:
    """One thing hidden: `strength` is S; parameters as docs/DATA_FORMAT.md names them."""

    name: str
    parameters: dict[str, float]
    approximate: bool
    strength: float
    remainder: float  # S that the catalogue's equation with these parameters leaves; nan: not looked at
    domain: str
    in_catalogue: bool


@dataclass(frozen=True)
class Answer:
    """What is hidden in a set. `energy[run][signal]` holds the effects' squared size per row."""

    seed: int
    kind: str  # null_exact, null_numbers, single, pair, outside
    strength: str
    plan: str
    effects: tuple[HiddenEffect, ...]
    noise_mps: float
    pose_noise: tuple[float, float, float]  # m, m, rad over one second
    signals: str
    truth: bool
    gyro: bool
    rate_hz: float
    counts_per_rev: float
    gain_mps: tuple[float, float]
    time_constant_s: tuple[float, float]
    energy: dict[str, dict[str, list[float]]]
    folder: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(effect.name for effect in self.effects)

    def save(self, path: Path) -> None:
        path.write_text(json.dumps(asdict(self)), encoding="utf-8")

    @classmethod
    def load(cls, path: Path) -> Answer:
        raw: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        raw["effects"] = tuple(HiddenEffect(**effect) for effect in raw["effects"])
        for name in ("pose_noise", "gain_mps", "time_constant_s"):
            raw[name] = tuple(raw[name])
        return cls(**raw)


def _number(name: str) -> int:
    return zlib.crc32(name.encode())


def _hidden(name: str) -> Hidden:
    return CATALOGUE[name] if name in CATALOGUE else OUTSIDE[name]


def make_trial(
    seed: int,
    effect: str,
    strength: str = "full",
    *,
    folder: Path,
    plan_kind: PlanKind | None = None,
    second_effect: str | None = None,
    noise: float | None = None,
    rate_hz: float = 20.0,
) -> Answer:
    """Write a recording set under `folder`/recordings and its answer as `folder`/answer.json.

    Parameters
    ----------
    effect
        A name of the catalogue or of `OUTSIDE`, `null_exact` or `null_numbers`.
    strength
        "full" (S from 1 to 4) or "weak" (0.3 to 1); of no meaning for nulls.
    plan_kind
        "rich", "thirds" (a third of the runs missing), "ordinary"; drawn where None. An effect that
        the plan cannot bring to its strength gets other robots, then other plans.
    noise
        RMS of the disturbance in speed over that of quantisation; drawn from 0.3 to 4 where None.
    """
    entropy = [seed, _number(effect), _number(strength), _number(second_effect or "-")]
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng(np.random.SeedSequence([*entropy, attempt]))
        kind = plan_kind or PLAN_KINDS[int(rng.choice(3, p=[0.55, 0.22, 0.23]))]
        if attempt >= ATTEMPTS // 2:
            kind = "rich"
        answer = _attempt(rng, seed, effect, strength, second_effect, kind, noise, rate_hz, folder)
        if answer is not None:
            answer.save(folder / "answer.json")
            return answer
    raise NotReachable(f"{effect} ({strength}, seed {seed}) does not reach its strength")


def _attempt(
    rng: Generator,
    seed: int,
    effect: str,
    strength: str,
    second_effect: str | None,
    plan_kind: PlanKind,
    noise: float | None,
    rate_hz: float,
    folder: Path,
) -> Answer | None:
    names = [] if effect in NULLS else [effect, *([second_effect] if second_effect else [])]
    sides_equal = "side_asymmetry" in names
    machine = draw_machine(
        rng,
        sides_equal=sides_equal or bool(ONE_NUMBER & set(names)),
        viscous=_viscous(names),
    )
    experiment = draw_experiment(rng, machine, plan_kind, rate_hz, noise, sides_equal=sides_equal)
    ends = np.append(np.flatnonzero(experiment.layout.start), len(experiment.layout.start))
    draw = Draw(rng, machine.physics, tuple(int(n) for n in np.diff(ends)))
    robot = experiment.healthy
    wheel_noise = experiment.wheel_noise(experiment.healthy)
    pose_noise = experiment.pose_noise()
    found: list[tuple[Hidden, float, Shape, float]] = []
    for name in names:
        hidden = _hidden(name)
        shape = hidden.shape(draw)
        sized = _sized(experiment, hidden, shape, strength, wheel_noise, pose_noise, rng)
        if sized is None:
            return None
        found.append((hidden, sized[0], shape, sized[1]))
        robot = hidden.apply(robot, sized[0], shape)
    signals = draw_signals(rng, filtered="speed_filter" in names)
    share = 0.3
    if NEEDS_TRUTH & set(names):
        share = 1.0
    elif SHOWS_IN_TRUTH & set(names):
        share = 0.6
    log = draw_log(rng, signals, truth_share=share, start_matters="floor_slope" in names)
    gain, tau = draw_baseline(rng, machine, exact=effect == "null_exact", sides_equal=sides_equal)
    driven = experiment.disturbed(robot, quantised=True)
    write_set(folder / "recordings", experiment, driven, log, gain, tau, rng)
    hidden_effects: list[HiddenEffect] = []
    for hidden, size, shape, got in sorted(found, key=lambda item: -item[3]):
        parameters, remainder = _parameters(experiment, hidden, size, shape)
        hidden_effects.append(
            HiddenEffect(
                name=hidden.name,
                parameters=parameters,
                approximate=not (hidden.exact or hidden.name in FREE),
                strength=got,
                remainder=remainder / wheel_noise,
                domain=hidden.domain,
                in_catalogue=hidden.name in CATALOGUE,
            )
        )
    kind = effect if effect in NULLS else "pair" if second_effect else "single"
    if effect in OUTSIDE:
        kind = "outside"
    return Answer(
        seed=seed,
        kind=kind,
        strength=strength,
        plan=plan_kind,
        effects=tuple(hidden_effects),
        noise_mps=wheel_noise,
        pose_noise=tuple(float(v) for v in pose_noise),  # type: ignore[arg-type]
        signals=signals,
        truth=log.truth,
        gyro=log.gyro,
        rate_hz=rate_hz,
        counts_per_rev=experiment.nominal_counts,
        gain_mps=tuple(float(v) for v in machine.gain),  # type: ignore[arg-type]
        time_constant_s=tuple(float(v) for v in machine.time_constant),  # type: ignore[arg-type]
        energy=_energy(experiment, robot) if names else {},
        folder=str(folder),
    )


def _viscous(names: list[str]) -> tuple[float, float]:
    """Viscous torque over back-EMF braking. Heat lowers a gain only against a load, and a limit on the
    current spares viscous friction, which the catalogue's "torque saturates" does not know.
    """
    if "winding_heating" in names:
        return 0.2, 0.8
    return (0.03, 0.1) if "current_limit" in names else (0.05, 0.35)


def _sized(
    experiment: Experiment,
    hidden: Hidden,
    shape: Shape,
    strength: str,
    wheel_noise: float,
    pose_noise: Array,
    rng: Generator,
) -> tuple[float, float] | None:
    low, high = STRENGTHS[strength]
    target = float(np.exp(rng.uniform(np.log(low * 1.03), np.log(high * 0.97))))

    def strength_of(size: float) -> float:
        physics = hidden.apply(experiment.healthy, size, shape)
        if hidden.domain == "pose":
            return float((experiment.pose_effect(physics) / pose_noise).max())
        floor = experiment.wheel_noise(physics) if hidden.name == "speed_filter" else wheel_noise
        return experiment.wheel_effect(physics) / floor

    return find_size(strength_of, target, low, high)


def _parameters(
    experiment: Experiment, hidden: Hidden, size: float, shape: Shape
) -> tuple[dict[str, float], float]:
    """The catalogue's parameters, and the RMS (m/s) that its equation leaves where that was looked at."""
    robot = hidden.apply(experiment.healthy, size, shape)
    values = hidden.parameters(robot, size, shape)
    remainder = float("nan")
    if hidden.name == "supply_sag":
        values["drop_over_set"] = float(1 - experiment.clean(robot).rows[-1, SUPPLY] / robot.voltage)
    if hidden.name == "winding_heating":
        share = robot.viscous * robot.resistance / robot.torque_constant**2
        warmest = experiment.clean(robot).rows[:, WARM : WARM + 2].max(axis=0)
        values["gain_drop"] = float((1 - (1 + share) / (1 + share * (1 + warmest))).mean())
    if hidden.name in FREE:
        fitted, remainder = effective(experiment, hidden.name, robot, values)
        values |= fitted
    return {name: float(value) for name, value in values.items()}, remainder


def _energy(experiment: Experiment, robot: Physics) -> dict[str, dict[str, list[float]]]:
    """Squared difference, per row, to the robot without: speeds (m/s)^2, pose m^2 within the row."""
    with_it, without = (
        experiment.disturbed(robot, quantised=False),
        experiment.disturbed(experiment.healthy, quantised=False),
    )
    speed = (with_it.speed - without.speed) ** 2
    pose = ((_slipped(experiment, with_it) - _slipped(experiment, without)) ** 2).sum(axis=1)
    out: dict[str, dict[str, list[float]]] = {}
    for run in range(experiment.layout.runs):
        rows = experiment.layout.row_run == run
        out[f"{run + 1:02d}_run"] = {
            "left": _short(speed[rows, 0]),
            "right": _short(speed[rows, 1]),
            "pose": _short(pose[rows]),
        }
    return out


def _slipped(experiment: Experiment, driven: Drive) -> Array:
    """Per row, how far the robot moved less what its encoders say: forward (m), turn (m at the wheel)."""
    starts = np.flatnonzero(np.r_[True, np.diff(experiment.layout.row_run) > 0])
    moved = by_run_difference(driven.rows[:, X : X + 3], experiment.layout, np.zeros((len(starts), 3)))
    ahead = np.hypot(moved[:, 0], moved[:, 1])
    seen = driven.travel_m.mean(axis=1)
    turn = driven.travel_m[:, 1] - driven.travel_m[:, 0]
    half = experiment.healthy.wheelbase / 2
    return np.stack([ahead * np.sign(seen) - seen, moved[:, 2] * half - turn / 2], axis=1)


def _short(values: Array) -> list[float]:
    return [float(f"{value:.3g}") for value in values]


STRENGTH_NAMES = tuple(STRENGTHS)
assert set(get_args(Strength)) == set(STRENGTH_NAMES)
