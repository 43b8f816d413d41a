"""A C header with the board's parameters that a model sets: feedforward and geometry.

With v the speed that is wanted and a its acceleration, the model's equation solved for effort is
`u = f sign(v) + v / gain + time_constant / gain a`, so that ks = f, kv = 1 / gain, ka = time_constant / gain.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from truing.errors import TruingError
from truing.model.robot_model import RobotModel
from truing.recording.writer import replace_file

from .terms import DEFAULTS, ExportOptions, headline, left_out, wheels

KIND = "c-header"
TITLE = "parameters of the board: feedforward ks, kv, ka and the geometry"
SUFFIX = ".h"
HOLDS = frozenset({"friction"})


def parameters(model: RobotModel) -> dict[str, float]:
    """Values by the names of the protocol's schema, checked against its ranges."""
    from truing_protocol import PARAMETERS

    values: dict[str, float] = {}
    for name in ("wheel_radius_m", "wheelbase_m", "counts_per_rev"):
        value = getattr(model.robot, name)
        if value is not None:
            values[name] = value
    for side, wheel in wheels(model):
        values[f"ff_ks_{side}"] = wheel.friction
        values[f"ff_kv_{side}"] = 1.0 / wheel.gain_mps
        values[f"ff_ka_{side}"] = wheel.time_constant_s / wheel.gain_mps
    known = {item.name: item for item in PARAMETERS}
    for name, value in values.items():
        item = known[name]
        if not item.minimum <= value <= item.maximum:
            raise TruingError(
                f"{name} would be {value:.6g}; the board takes {item.minimum:g} to {item.maximum:g}",
                "Check the model's gains and geometry",
            )
    return values


def write(model: RobotModel, path: Path, options: ExportOptions = DEFAULTS) -> tuple[Path, ...]:  # noqa: ARG001
    """Macros for whoever wants one value, and a table for whoever sets them all."""
    from truing_protocol import PARAMETERS

    units = {item.name: item.unit for item in PARAMETERS}
    values = parameters(model)
    guard = f"TRUING_{''.join(c if c.isalnum() else '_' for c in path.stem.upper())}_H"
    lines = [f"/* Parameters of {headline(model)}".replace("*/", "* /")]
    lines += [f"   {sentence}" for sentence in left_out(model, HOLDS)]
    lines[-1] += " */"
    lines += [f"#ifndef {guard}", f"#define {guard}", "", "#include <stdint.h>", ""]
    for name, value in values.items():
        lines.append(f"#define TRUING_{name.upper()} {_literal(value)} /* {units[name]} */")
    lines += [
        "",
        "/* Index and value of each, for a build that has the protocol's proto.h on its include path. */",
        "#ifdef TRUING_WITH_PROTOCOL",
        '#include "proto.h"',
        "static const struct {",
        "    uint16_t index;",
        "    float value;",
        "} truing_parameters[] = {",
        *(f"    {{ PROTO_PARAMETER_{name.upper()}, TRUING_{name.upper()} }}," for name in values),
        "};",
        "#endif",
        "",
        "#endif",
    ]
    replace_file(path, ("\n".join(lines) + "\n").encode())
    return (path,)


def _literal(value: float) -> str:
    """The shortest C literal that reads back as the same single-precision number."""
    text = str(np.float32(value))
    return f"{text}f" if any(mark in text for mark in ".e") else f"{text}.0f"
