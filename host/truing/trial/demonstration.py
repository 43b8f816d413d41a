"""One concealed effect from seal to corrected simulation, judged on runs that nothing was fitted to."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.diagnosis_input import Options, read_input
from truing.diagnose.engine import diagnose
from truing.diagnose.result import Diagnosis, MismatchSpan
from truing.progress import Progress
from truing.recording.run import WHEELS
from truing.trial.concealed import Asked, Tell, TrialResult, run_concealed

# The seed decides effect, strength, robot, baseline and noise; any other conceals another effect.
SEED = 76
# Few runs, so that the demonstration takes seconds: starts, reversals, and ramps through zero effort.
PLANS = ("diagnosis/steps_from_rest", "diagnosis/reversals", "diagnosis/slow_ramps")

# A wheel's numbers in a verdict, and as the simulator calls them.
_NUMBERS = {"gain_mps": "gain", "time_constant_s": "tau"}


@dataclass(frozen=True)
class Curves:
    """One wheel in one run, as measured and as simulated, m/s; arrays of shape (n,).

    Attributes
    ----------
    given : by the baseline as given.
    model : by the baseline with what the diagnosis found.
    """

    run: str
    wheel: str
    t_s: FloatArray
    measured: FloatArray
    given: FloatArray
    model: FloatArray

    @property
    def errors(self) -> tuple[float, float]:
        """RMS error as given and with what was found, m/s."""
        return tuple(  # type: ignore[return-value]
            float(np.sqrt(np.mean((self.measured - simulated)[1:] ** 2)))
            for simulated in (self.given, self.model)
        )


@dataclass(frozen=True)
class Demonstration:
    """What a concealed trial showed.

    Attributes
    ----------
    place : the strongest span of the mismatch that lies in a wheel's speed; None where there is none.
    recorded : the run of `place`, which the diagnosis saw.
    unseen : the first of the judging runs, which it did not see.
    unseen_runs : names of the judging runs.
    given_mps, refitted_mps, model_mps : RMS free-run error on the judging runs, both wheels: the baseline as
        given, with its own best numbers, and with what the diagnosis found.
    noise_mps : RMS of noise and disturbance in the recorded speeds.
    """

    result: TrialResult
    place: MismatchSpan | None
    recorded: Curves | None
    unseen: Curves
    unseen_runs: tuple[str, ...]
    given_mps: float
    refitted_mps: float
    model_mps: float
    noise_mps: float

    @property
    def diagnosis(self) -> Diagnosis:
        """The verdict, reached before the seal was opened."""
        return self.result.first.diagnosis

    @property
    def concealed(self) -> tuple[tuple[str, float], ...]:
        """Names of the concealed effects, each with its strength S."""
        return tuple((str(each["name"]), float(each["strength"])) for each in self.result.answer["effects"])

    def to_json(self) -> dict[str, Any]:
        """What was sealed, said and measured."""
        return {
            "sha256": self.result.sha256,
            "verdict": self.diagnosis.to_json(),
            "answer": self.result.answer,
            "unseen": {
                "runs": list(self.unseen_runs),
                "given_rmse": self.given_mps,
                "refitted_rmse": self.refitted_mps,
                "model_rmse": self.model_mps,
                "noise": self.noise_mps,
                "unit": "m/s",
            },
        }


def demonstrate(
    folder: Path, seed: int = SEED, *, tell: Tell = lambda _text: None, progress: Progress | None = None
) -> Demonstration:
    """Conceal an effect, diagnose the recordings, open the seal, and judge on further runs of that robot.

    Parameters
    ----------
    folder : gets `set` (what the diagnosis sees) and `judged` (runs driven after the verdict, and the truth).
    tell : told the sealed answer's hash before the robot moves.
    """
    shutil.rmtree(folder, ignore_errors=True)
    asked = Asked("random", seed, plans=PLANS, weak=False, core=True, judged=folder / "judged")
    result = run_concealed(asked, folder / "set", tell=tell, progress=progress, diagnose=_diagnose)
    return _judged(result, folder)


def _diagnose(folder: Path, baseline: Path) -> Diagnosis:
    return diagnose(read_input(folder, baseline), Options())


def _judged(result: TrialResult, folder: Path) -> Demonstration:
    """Simulate the judging runs with the three models, from their efforts alone."""
    # What knows the answer is loaded once the seal is open, and not before.
    from truing.trial.measure import SPEED_SIGNALS
    from truing.trial.true_model import TrueModel

    diagnosis = result.first.diagnosis
    true_model = TrueModel(folder / "set", folder / "judged", len(diagnosis.runs), result.answer)
    given = true_model.simulator.start()
    refitted = given.copy()
    for entry in diagnosis.numbers:
        refitted[true_model.simulator.layout.index(f"{_NUMBERS[entry.name]}_{entry.wheel}")] = entry.refitted
    found = diagnosis.explanations[0]
    place = next((span for span in diagnosis.mismatch if span.signal in SPEED_SIGNALS), None)
    wheel = 0 if place is None else SPEED_SIGNALS.index(place.signal)
    every = true_model.all.data
    rows = true_model.judging & (every.run_of_row == every.run_of_row[true_model.judging][0])
    unseen = Curves(
        every.names[int(every.run_of_row[rows][0])],
        WHEELS[wheel],
        every.t_s[rows],
        every.speed_mps[rows, wheel],
        true_model.speeds(given, ())[rows, wheel],
        true_model.speeds(found.theta, found.effects)[rows, wheel],
    )
    judging = np.unique(every.run_of_row[true_model.judging])
    return Demonstration(
        result,
        place,
        None if place is None else _recorded(diagnosis, place, wheel),
        unseen,
        tuple(every.names[int(run)] for run in judging),
        true_model.speed_error(given, ()),
        true_model.speed_error(refitted, ()),
        true_model.speed_error(found.theta, found.effects),
        true_model.noise_mps,
    )


def _recorded(diagnosis: Diagnosis, place: MismatchSpan, wheel: int) -> Curves:
    trace = next(one for one in diagnosis.traces if one.run == place.run)
    columns = (trace.measured, trace.baseline, trace.model)
    return Curves(trace.run, WHEELS[wheel], trace.t_s, *(values[:, wheel] for values in columns))
