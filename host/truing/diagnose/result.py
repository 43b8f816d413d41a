"""The result of a diagnosis; docs/DATA_FORMAT.md, section 4, defines its JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from truing.arrays import FloatArray
from truing.diagnose.data.traces import RunTraces
from truing.diagnose.learned.result import LearnedCorrection
from truing.plan import Plan
from truing.recording.frames import preformatted
from truing.recording.run import RecordingSet, Wheel

Verdict: TypeAlias = Literal[
    "consistent", "parameters_only", "missing_physics", "partly_explained", "ambiguous", "unexplained"
]
Scope: TypeAlias = Literal["left", "right", "both", "body"]
Domain: TypeAlias = Literal["wheel", "pose"]
Severity: TypeAlias = Literal["note", "warning"]

SCHEMA = 2
VERDICTS: tuple[Verdict, ...] = (
    "consistent",
    "parameters_only",
    "missing_physics",
    "partly_explained",
    "ambiguous",
    "unexplained",
)


# Verdicts that name effects.
NAMING: tuple[Verdict, ...] = ("missing_physics", "partly_explained", "ambiguous")


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """A value with its 95 % interval; the parameter's own limit stands where the recordings set none."""

    value: float
    ci95: tuple[float, float]
    unit: str

    def to_json(self) -> dict[str, Any]:
        """As docs/DATA_FORMAT.md has it; what is not finite becomes null."""
        low, high = self.ci95
        return {"value": number(self.value), "ci95": [number(low), number(high)], "unit": self.unit}


@dataclass(frozen=True, slots=True)
class NamedEffect:
    """An effect that the verdict names, alone or as one of several alternatives.

    Attributes
    ----------
    parameters : by the names of docs/DATA_FORMAT.md.
    confidence : 0 to 1, that this effect of the catalogue is present.
    heldout_rmse_before, heldout_rmse_after : free-run error of the refitted baseline and of the baseline
        with this effect, on runs left out of both fits; `unit`.
    indistinguishable_from : the other effects that explain the recordings as well.
    domain : which signals show it: the wheels' speeds, or the pose against an outside reference.
    explanation : which of the explanations it belongs to, when several are left: effects of one number
        act together, effects of different numbers are alternatives.
    note : anything a reader should know about it, in words.
    """

    name: str
    scope: Scope
    parameters: Mapping[str, EffectParameter]
    confidence: float
    heldout_rmse_before: float
    heldout_rmse_after: float
    indistinguishable_from: tuple[str, ...] = ()
    domain: Domain = "wheel"
    unit: str = "m/s"
    explanation: int = 0
    note: str = ""

    def to_json(self) -> dict[str, Any]:
        """As docs/DATA_FORMAT.md has it."""
        return {
            "name": self.name,
            "scope": self.scope,
            "parameters": {name: value.to_json() for name, value in self.parameters.items()},
            "confidence": number(self.confidence),
            "heldout_rmse_before": number(self.heldout_rmse_before),
            "heldout_rmse_after": number(self.heldout_rmse_after),
            "indistinguishable_from": list(self.indistinguishable_from),
            "domain": self.domain,
            "unit": self.unit,
            "explanation": self.explanation,
            "note": self.note,
        }


@dataclass(frozen=True, slots=True)
class MismatchSpan:
    """A stretch of one run where baseline (refitted) and recording differ by more than their noise.

    Attributes
    ----------
    signal : the column it is about (`vel_left_mps`, `truth_theta_rad`, ...).
    share : of the energy of the whole mismatch, 0 to 1.
    regime : what the robot does there, in words.
    times_noise : RMS of the mismatch in the span over the RMS of the noise there.
    """

    run: str
    signal: str
    t_start_s: float
    t_end_s: float
    share: float
    regime: str
    times_noise: float | None = None

    def to_json(self) -> dict[str, Any]:
        """As docs/DATA_FORMAT.md has it."""
        return {
            "run": self.run,
            "signal": self.signal,
            "t_start_s": number(self.t_start_s),
            "t_end_s": number(self.t_end_s),
            "share": number(self.share),
            "regime": self.regime,
            "times_noise": number(self.times_noise),
        }


@dataclass(frozen=True, slots=True)
class FitErrors:
    """Free-run errors over all runs: the baseline as given, refitted, with what was named; and the noise.

    Attributes
    ----------
    noise_floor : from the recordings alone, and never above `model_rmse`.
    heldout_refit_rmse, heldout_model_rmse : of both models on runs left out.
    """

    baseline_rmse: float
    refit_rmse: float
    model_rmse: float
    noise_floor: float
    unit: str = "m/s"
    heldout_refit_rmse: float = math.nan
    heldout_model_rmse: float = math.nan

    def to_json(self) -> dict[str, Any]:
        """As docs/DATA_FORMAT.md has it."""
        return {
            "baseline_rmse": number(self.baseline_rmse),
            "refit_rmse": number(self.refit_rmse),
            "model_rmse": number(self.model_rmse),
            "noise_floor": number(self.noise_floor),
            "unit": self.unit,
            "heldout_refit_rmse": number(self.heldout_refit_rmse),
            "heldout_model_rmse": number(self.heldout_model_rmse),
        }


@dataclass(frozen=True, slots=True)
class NextExperiment:
    """The run that would distinguish the explanations.

    Attributes
    ----------
    separates : the explanations, each as the effects that it consists of.
    expected_difference_over_noise : whitened norm of what the run would show between the two closest
        explanations, the rival refitted; above about 3 they are distinguishable.
    why : in words.
    """

    plan: Plan
    separates: tuple[tuple[str, ...], ...]
    expected_difference_over_noise: float
    why: str

    def to_json(self) -> dict[str, Any]:
        """The plan as a plan file's content."""
        return {
            "plan": self.plan.to_dict(),
            "separates": [list(names) for names in self.separates],
            "expected_difference_over_noise": number(self.expected_difference_over_noise),
            "why": self.why,
        }


@dataclass(frozen=True, slots=True)
class Check:
    """One finding about the data.

    Attributes
    ----------
    severity : `warning` where it affects the verdict, `note` where it only explains.
    next_step : what to do about it; may be empty.
    blocks : effects that are not identifiable because of it.
    """

    topic: str
    text: str
    severity: Severity = "note"
    next_step: str = ""
    run: str | None = None
    wheel: Wheel | None = None
    blocks: tuple[str, ...] = ()

    def __str__(self) -> str:
        places = [self.run] if self.run is not None else []
        if self.wheel is not None:
            places.append(f"{self.wheel} wheel")
        where = f"{', '.join(places)}: " if places else ""
        return where + self.text

    def to_json(self) -> dict[str, Any]:
        """Every field by its name."""
        return {
            "topic": self.topic,
            "severity": self.severity,
            "text": self.text,
            "next_step": self.next_step,
            "run": self.run,
            "wheel": self.wheel,
            "blocks": list(self.blocks),
        }


@dataclass(frozen=True, slots=True)
class RankedEffect:
    """One effect, or set of effects, that was tested; all are listed (multiple testing).

    Attributes
    ----------
    names : the effects added to the baseline.
    score : predicted gain of the score test, nats.
    improvement : penalised log-likelihood gain over the refitted baseline, nats.
    heldout_rmse : free-run error on runs that were left out, m/s (or `unit`); NaN when not fitted.
    fitted : whether the score test led to a fit.
    note : why it was dropped, or kept.
    """

    names: tuple[str, ...]
    score: float
    improvement: float
    fitted: bool
    heldout_rmse: float = math.nan
    parameters: int = 0
    domain: Domain = "wheel"
    unit: str = "m/s"
    note: str = ""

    def to_json(self) -> dict[str, Any]:
        """Every field by its name; `name` joins the effects with a plus."""
        return {
            "name": " + ".join(self.names),
            "score": number(self.score),
            "improvement": number(self.improvement),
            "fitted": self.fitted,
            "heldout_rmse": number(self.heldout_rmse),
            "parameters": self.parameters,
            "domain": self.domain,
            "unit": self.unit,
            "note": self.note,
        }


@dataclass(frozen=True, slots=True)
class SignalNoise:
    """The noise of one signal, estimated from the recordings.

    Attributes
    ----------
    signal : `vel_left_mps` and so on, or `truth_x_m`, ...
    quantisation, disturbance, rms : RMS each, in `unit`; rms is both together.
    correlation_s : correlation time, s.
    known_from : in words: repeated runs, the residual of the richest model, ...
    """

    signal: str
    quantisation: float
    disturbance: float
    rms: float
    correlation_s: float
    known_from: str
    unit: str = "m/s"

    def to_json(self) -> dict[str, Any]:
        """Every field by its name."""
        return {
            "signal": self.signal,
            "quantisation": number(self.quantisation),
            "disturbance": number(self.disturbance),
            "rms": number(self.rms),
            "correlation_s": number(self.correlation_s),
            "known_from": self.known_from,
            "unit": self.unit,
        }


@dataclass(frozen=True, slots=True)
class Split:
    """One division of the runs, made before anything was fitted, and the errors on the runs left out."""

    fitted: tuple[str, ...]
    judged: tuple[str, ...]
    rmse_before: float
    rmse_after: float
    noise_floor: float = math.nan

    def to_json(self) -> dict[str, Any]:
        """Every field by its name."""
        return {
            "fitted": list(self.fitted),
            "judged": list(self.judged),
            "rmse_before": number(self.rmse_before),
            "rmse_after": number(self.rmse_after),
            "noise_floor": number(self.noise_floor),
        }


@dataclass(frozen=True, slots=True)
class WheelNumbers:
    """A wheel's `gain_mps` or `time_constant_s`: as given, refitted, and with the effects."""

    wheel: Wheel
    name: str
    unit: str
    given: float
    refitted: float
    with_effects: EffectParameter

    def to_json(self) -> dict[str, Any]:
        """Every field by its name."""
        return {
            "wheel": self.wheel,
            "name": self.name,
            "unit": self.unit,
            "given": number(self.given),
            "refitted": number(self.refitted),
            "with_effects": self.with_effects.to_json(),
        }


@dataclass(frozen=True, slots=True)
class Explanation:
    """One way to explain the recordings, as the simulator takes it.

    Attributes
    ----------
    effects : the effects that are on besides those of the baseline.
    theta : shape (p,), the whole parameter vector of `SetSimulator`.
    confidence : 0 to 1.
    """

    effects: tuple[str, ...]
    theta: FloatArray
    confidence: float = math.nan


@dataclass(frozen=True, slots=True)
class Compensation:
    """Board parameters that compensate the diagnosed effects, and notes on those without one."""

    parameters: Mapping[str, float]
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """`parameters` by the board's names."""
        return {"parameters": {k: number(v) for k, v in self.parameters.items()}, "notes": list(self.notes)}


@dataclass(frozen=True, slots=True)
class RecordedSignal:
    """How the recorder made one signal; nothing of it is the robot's.

    Attributes
    ----------
    updated_every_s : usual time between two measurements, s.
    late_s : delay of a recorded speed against its own positions or counts, s; NaN where neither is recorded.
    filter_s : time constant of a first-order filter that explains it instead, s; NaN likewise.
    resolution : smallest step of the signal, in `unit`; 0 where none is found.
    instant : read at the rows' times, not averaged over them; for the text, since the JSON's keys are fixed.
    """

    updated_every_s: float
    late_s: float
    filter_s: float
    resolution: float
    unit: str = "m/s"
    instant: bool = False

    def to_json(self) -> dict[str, Any]:
        """As docs/DATA_FORMAT.md has it."""
        return {
            "updated_every_s": number(self.updated_every_s),
            "late_s": number(self.late_s),
            "filter_s": number(self.filter_s),
            "resolution": number(self.resolution),
            "unit": self.unit,
        }


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The whole result.

    Attributes
    ----------
    name : of the recording set.
    runs : names of the runs, in their order.
    effects : strongest first; empty unless the verdict is `missing_physics`, `partly_explained` or
        `ambiguous`.
    left_over_share : of the mismatch above the noise that no named effect explains, 0 to 1.
    learned : a correction for what no effect explains, where it was asked for; None otherwise.
    recorder : how each signal was recorded, by signal.
    baseline_effects : effects that the baseline already holds, with their refitted parameters.
    exact : the same effects and those of the likeliest explanation, by the fit's own numbers, nuisance ones
        too; kept out of the JSON.
    pose_fit : the same four errors against the outside pose, or None without one.
    not_exercised : effects that these recordings could not have shown.
    weakly_exercised : effects that they could have shown only if strong.
    explanations : those possible, best first (one under `missing_physics`); kept out of the JSON.
    traces : per run; kept out of the JSON.
    has_given : the baseline was given, so that there are errors and numbers as given; kept out of the JSON.
    recordings : what was diagnosed, with its baseline, where the result is to be exported from Python; kept
        out of the JSON.
    """

    name: str
    verdict: Verdict
    runs: tuple[str, ...]
    fit: FitErrors
    effects: tuple[NamedEffect, ...] = ()
    mismatch: tuple[MismatchSpan, ...] = ()
    not_exercised: tuple[str, ...] = ()
    weakly_exercised: tuple[str, ...] = ()
    next_experiment: NextExperiment | None = None
    pose_fit: FitErrors | None = None
    confidence: float = math.nan
    left_over_share: float = 0.0
    learned: LearnedCorrection | None = None
    recorder: Mapping[str, RecordedSignal] = field(default_factory=dict)
    baseline_effects: Mapping[str, Mapping[str, EffectParameter]] = field(default_factory=dict)
    exact: Mapping[str, Mapping[str, float]] = field(default_factory=dict, repr=False)
    notes: tuple[str, ...] = ()
    checks: tuple[Check, ...] = ()
    ranking: tuple[RankedEffect, ...] = ()
    noise: tuple[SignalNoise, ...] = ()
    splits: tuple[Split, ...] = ()
    numbers: tuple[WheelNumbers, ...] = ()
    compensation: Compensation | None = None
    seconds: float = math.nan
    explanations: tuple[Explanation, ...] = field(default=(), repr=False)
    traces: tuple[RunTraces, ...] = field(default=(), repr=False)
    has_given: bool = True
    recordings: RecordingSet | None = field(default=None, repr=False, compare=False)

    def __str__(self) -> str:
        from truing.diagnose.present.text import first_sections, wrapped

        return "\n".join(wrapped(first_sections(self))).rstrip()

    def _repr_html_(self) -> str:
        return preformatted(str(self))

    def to_json(self) -> dict[str, Any]:
        """As docs/verdict.schema.json has it: plain lists, numbers and text only."""
        return {
            "schema": SCHEMA,
            "name": self.name,
            "verdict": self.verdict,
            "confidence": number(self.confidence),
            "runs": list(self.runs),
            "effects": [effect.to_json() for effect in self.effects],
            "mismatch": [span.to_json() for span in self.mismatch],
            "fit": self.fit.to_json(),
            "pose_fit": None if self.pose_fit is None else self.pose_fit.to_json(),
            "left_over": {
                "share": number(self.left_over_share),
                "learned": None if self.learned is None else self.learned.to_json(),
            },
            "baseline_effects": {
                name: {key: value.to_json() for key, value in parameters.items()}
                for name, parameters in self.baseline_effects.items()
            },
            "recorder": {name: signal.to_json() for name, signal in self.recorder.items()},
            "not_exercised": list(self.not_exercised),
            "weakly_exercised": list(self.weakly_exercised),
            "next_experiment": None if self.next_experiment is None else self.next_experiment.to_json(),
            "notes": list(self.notes),
            "checks": [check.to_json() for check in self.checks],
            "numbers": [entry.to_json() for entry in self.numbers],
            "noise": [noise.to_json() for noise in self.noise],
            "splits": [split.to_json() for split in self.splits],
            "ranking": [ranked.to_json() for ranked in self.ranking],
            "compensation": None if self.compensation is None else self.compensation.to_json(),
            "seconds": number(self.seconds),
        }


def number(value: float | None) -> float | None:
    """A plain float for JSON; None for what is not finite, which JSON cannot hold."""
    if value is None or not math.isfinite(value):
        return None
    return float(value)
