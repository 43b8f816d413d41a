"""WPILib gains kS, kV, kA (volts, metres, seconds) as JSON.

V = kS sign(v) + kV v + kA a, which is the model's equation solved for the voltage V = effort x nominal
voltage: kS = nominal x friction, kV = nominal / gain, kA = nominal x time constant / gain.
"""

from __future__ import annotations

import json
from pathlib import Path

from truing.model.robot_model import RobotModel
from truing.recording.writer import replace_file

from .terms import DEFAULTS, ExportOptions, headline, left_out, wheels

KIND = "wpilib"
TITLE = "feedforward gains kS, kV, kA"
SUFFIX = ".json"
HOLDS = frozenset({"friction"})


def write(model: RobotModel, path: Path, options: ExportOptions = DEFAULTS) -> tuple[Path, ...]:
    """Gains of each side, and their mean for a drive that has one set."""
    volts = options.nominal_voltage_v
    sides = {
        side: {
            "kS": volts * wheel.friction,
            "kV": volts / wheel.gain_mps,
            "kA": volts * wheel.time_constant_s / wheel.gain_mps,
        }
        for side, wheel in wheels(model)
    }
    tree = {
        "about": headline(model),
        "units": {"kS": "V", "kV": "V*s/m", "kA": "V*s^2/m"},
        "nominal_voltage": volts,
        **sides,
        "mean": {name: 0.5 * (sides["left"][name] + sides["right"][name]) for name in ("kS", "kV", "kA")},
        "left_out": list(left_out(model, HOLDS)),
    }
    if model.robot.wheelbase_m is not None:
        tree["trackwidth_m"] = model.robot.wheelbase_m
    replace_file(path, (json.dumps(tree, indent=2, ensure_ascii=False) + "\n").encode())
    return (path,)
