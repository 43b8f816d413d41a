"""Whatever stands for a model, as a baseline (what is compared) or as a robot's model (what is simulated)."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

from truing.diagnose.present.corrected_model import CorrectedModel, corrected_model
from truing.diagnose.result import Diagnosis
from truing.errors import TruingError
from truing.exporters import read_model
from truing.exporters.source import from_baseline
from truing.identify.identification import Identification
from truing.identify.model_ladder import SetModels
from truing.model.robot_model import RobotModel
from truing.recording.baseline import Baseline, parse_baseline, read_baseline

AnyModel: TypeAlias = str | Path | Baseline | RobotModel | Identification | SetModels | Diagnosis


def as_baseline(model: AnyModel) -> Baseline:
    """A baseline from a model, its file, or a result that holds one."""
    if isinstance(model, (str, Path)):
        return read_baseline(model)
    if isinstance(model, Baseline):
        return model
    if isinstance(model, Diagnosis):
        return corrected(model).baseline
    robot = model if isinstance(model, RobotModel) else _fitted(model)
    return parse_baseline(robot.to_toml(), Path("model"))


def as_robot_model(model: AnyModel) -> tuple[RobotModel, tuple[str, ...]]:
    """A robot's model, and a sentence for each thing that a wheel's physics cannot hold."""
    if isinstance(model, (str, Path)):
        return read_model(Path(model))
    if isinstance(model, Baseline):
        return from_baseline(model)
    if isinstance(model, Diagnosis):
        found = corrected(model)
        return found.model, found.notes
    return (model if isinstance(model, RobotModel) else _fitted(model)), ()


def corrected(diagnosis: Diagnosis) -> CorrectedModel:
    """What to simulate after a diagnosis.

    Raises
    ------
    TruingError
        The diagnosis does not hold its recordings: it did not come from `truing.diagnose`.
    """
    if diagnosis.recordings is None or diagnosis.recordings.baseline is None:
        raise TruingError(
            f"{diagnosis.name}: this diagnosis has lost the baseline that it corrects",
            "Take the result of truing.diagnose as it is",
        )
    return corrected_model(diagnosis, diagnosis.recordings.baseline)


def _fitted(model: Identification | SetModels) -> RobotModel:
    if isinstance(model, (Identification, SetModels)):
        return model.robot_model()
    raise TruingError(
        f"{type(model).__name__} is no model",
        "Give a baseline.toml or model file, or what truing.identify, fit or diagnose returned",
    )
