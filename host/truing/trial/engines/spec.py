"""What a seed draws for a trial in an engine: robot, effects, strengths, driving, recorder, disturbance."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from truing.errors import TruingError
from truing.plan import Plan
from truing.trial.engines.driving import Mode, draw_plans
from truing.trial.engines.engine import TICK_S, EngineEffect, Rng
from truing.trial.engines.nominal import NominalRobot, draw_nominal
from truing.trial.engines.recorder import Recorder

Family = Literal["one", "two", "null", "outside"]
MODES: tuple[Mode, ...] = ("effort", "velocity", "mixed")
RATES_HZ = (20, 50, 200)
# S, as in the campaign on the own plant.
FULL_STRENGTH = (1.0, 8.0)
WEAK_STRENGTH = (0.3, 1.0)
_BASELINE_OFF = 0.08
_FORM_RAW = (0.1, 0.5)
Effects = Mapping[str, EngineEffect[Any]]


@dataclass(frozen=True)
class Disturbance:
    """A torque on each axle: effort that it balances (RMS), and its memory."""

    effort: float
    correlation_s: float


@dataclass(frozen=True)
class EngineTrial:
    """Everything about one trial that is drawn from its seed.

    Attributes
    ----------
    wanted : S of each effect; of a change of the baseline's form its raw strength.
    """

    engine: str
    seed: int
    family: Family
    names: tuple[str, ...]
    wanted: tuple[float, ...]
    weak: bool
    mode: Mode
    nominal: NominalRobot
    plans: tuple[Plan, ...]
    recorder: Recorder
    disturbance: Disturbance
    baseline_gain_mps: tuple[float, float]
    baseline_time_constant_s: tuple[float, float]

    @property
    def limits(self) -> tuple[float, float]:
        """The class of strengths that S must lie in."""
        return (WEAK_STRENGTH[0], FULL_STRENGTH[0]) if self.weak else (FULL_STRENGTH[0], np.inf)

    def rng_of(self, number: int) -> Rng:
        """What an effect's own draws start from; the same whatever its strength."""
        return np.random.default_rng([self.seed, 0x656E67, number])

    def torques_nm(self, run: int, ticks: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
        """The disturbing torques of a run, shape (ticks, 2)."""
        from scipy.signal import lfilter

        rng = np.random.default_rng([self.seed, 0x746F72, run])
        kept = np.exp(-TICK_S / self.disturbance.correlation_s)
        noise = rng.normal(0.0, np.sqrt(1.0 - kept**2), (ticks, 2))
        first = rng.normal(0.0, 1.0, (1, 2))
        shaped, _ = lfilter([1.0], [1.0, -kept], noise, axis=0, zi=kept * first)
        return np.asarray(shaped * self.disturbance.effort * np.array(self.nominal.stalls_nm))


def draw_engine_trial(
    engine: str,
    effects: Effects,
    effect: str,
    seed: int,
    *,
    weak: bool | None = None,
    mode: Mode | None = None,
    rate_hz: int | None = None,
) -> EngineTrial:
    """Return the trial that a seed stands for.

    Parameters
    ----------
    effect : random, pair, outside, form, none, or names with commas between.
    weak, mode, rate_hz : drawn where None.
    """
    rng = np.random.default_rng([seed, 0x747275, 0x656E67])
    family, names = _chosen(effects, effect, rng)
    drawn_weak, drawn_mode = bool(rng.random() < 0.4), MODES[int(rng.integers(len(MODES)))]
    drawn_rate = RATES_HZ[int(rng.integers(len(RATES_HZ)))]
    is_weak = (drawn_weak if weak is None else weak) and family == "one"
    low, high = WEAK_STRENGTH if is_weak else FULL_STRENGTH
    if family == "null":
        low, high = _FORM_RAW
    wanted = tuple(float(np.exp(rng.uniform(np.log(low), np.log(high)))) for _ in names)
    nominal = draw_nominal(rng)
    mode = mode or drawn_mode
    needs_truth = any(effects[name].domain == "pose" or name == "low_grip" for name in names)
    has_pose = rng.random() < 0.4 or needs_truth
    noise_mm, noise_mrad = float(rng.uniform(0.5, 3.0)), float(rng.uniform(1.0, 4.0))
    off = 1.0 + rng.uniform(-_BASELINE_OFF, _BASELINE_OFF, 4)
    if family == "null" and rng.random() < 0.3:
        off[:] = 1.0
    gain, constant = np.array(nominal.gain_mps) * off[:2], np.array(nominal.time_constant_s) * off[2:]
    return EngineTrial(
        engine=engine,
        seed=seed,
        family=family,
        names=names,
        wanted=wanted,
        weak=is_weak,
        mode=mode,
        nominal=nominal,
        plans=draw_plans(rng, nominal, mode),
        recorder=Recorder(
            rate_hz or drawn_rate, noise_mm if has_pose else 0.0, noise_mrad if has_pose else 0.0
        ),
        disturbance=Disturbance(
            effort=float(np.exp(rng.uniform(np.log(0.002), np.log(0.012)))),
            correlation_s=float(np.exp(rng.uniform(np.log(0.05), np.log(0.5)))),
        ),
        baseline_gain_mps=(float(gain[0]), float(gain[1])),
        baseline_time_constant_s=(float(constant[0]), float(constant[1])),
    )


def _chosen(effects: Effects, effect: str, rng: Rng) -> tuple[Family, tuple[str, ...]]:
    pools = {"random": "catalogue", "pair": "catalogue", "outside": "outside", "form": "form"}
    if effect == "none":
        return "null", ()
    if effect in pools:
        pool = [each.name for each in effects.values() if each.kind == pools[effect]]
        first = str(rng.choice(pool))
        if effect != "pair":
            return _family(effects, (first,)), (first,)
        others = [name for name in pool if compatible(effects, first, name)]
        return "two", (first, str(rng.choice(others)))
    names = tuple(effect.split(","))
    unknown = [name for name in names if name not in effects]
    if unknown:
        raise TruingError(
            f"{unknown[0]}: no effect of that name in this engine",
            f"known: {', '.join(effects)}, random, pair, outside, form, none",
        )
    if len(names) > 2 or (len(names) == 2 and not compatible(effects, *names)):
        raise TruingError(f"{effect}: these cannot be in one robot", "give one effect or another pair")
    return _family(effects, names), names


def compatible(effects: Effects, one: str, other: str) -> bool:
    """Whether both can be in one robot and be told by name."""
    a, b = effects[one], effects[other]
    apart = one not in b.incompatible and other not in a.incompatible
    both = a.kind == b.kind == "catalogue"
    return one != other and a.catalogue != b.catalogue and apart and both


def _family(effects: Effects, names: tuple[str, ...]) -> Family:
    if len(names) == 2:
        return "two"
    kinds: dict[str, Family] = {"catalogue": "one", "outside": "outside", "form": "null"}
    return kinds[effects[names[0]].kind]


def trial_json(trial: EngineTrial) -> dict[str, Any]:
    """The draws as JSON, for the sealed answer."""
    out = dataclasses.asdict(dataclasses.replace(trial, plans=()))
    return {key: value for key, value in out.items() if key != "plans"}
