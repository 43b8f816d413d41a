"""Every parameter of the model as a MATLAB structure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from truing.model.robot_model import RobotModel
from truing.model.wheel import PHYSICS_FIELDS

from .mat_file import write_mat
from .terms import CORRECTION, DEFAULTS, EVERYTHING, ExportOptions, headline, wheels

KIND = "mat"
TITLE = "every parameter as a MATLAB structure: model.left.gain_mps, ..."
SUFFIX = ".mat"
HOLDS = EVERYTHING - {CORRECTION}


def write(model: RobotModel, path: Path, options: ExportOptions = DEFAULTS) -> tuple[Path, ...]:  # noqa: ARG001
    """`model.left`, `model.right` with every field; `model.robot` with what is known."""
    tree: dict[str, Any] = {
        side: {name: getattr(wheel, name) for name in PHYSICS_FIELDS} for side, wheel in wheels(model)
    }
    geometry = {
        name: getattr(model.robot, name)
        for name in ("wheel_radius_m", "wheelbase_m", "counts_per_rev")
        if getattr(model.robot, name) is not None
    }
    tree["robot"] = {"name": model.robot.name, **geometry}
    if model.rate_hz is not None:
        tree["rate_hz"] = model.rate_hz
    write_mat(path, {"model": tree, "about": headline(model)})
    return (path,)
