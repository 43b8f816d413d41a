"""The model as TOML: everything, in a form that is a baseline too."""

from __future__ import annotations

from pathlib import Path

from truing.model.robot_model import RobotModel
from truing.recording.writer import replace_file

from .terms import DEFAULTS, EVERYTHING, ExportOptions

KIND = "toml"
TITLE = "the whole model; also a baseline.toml for truing diagnose"
SUFFIX = ".toml"
HOLDS = EVERYTHING


def write(model: RobotModel, path: Path, options: ExportOptions = DEFAULTS) -> tuple[Path, ...]:  # noqa: ARG001
    """Write the model's own form."""
    replace_file(path, model.to_toml().encode())
    return (path,)
