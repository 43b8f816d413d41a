"""The linear part as state space for MATLAB and Simulink: a .mat file and a script that loads it.

States and outputs are the wheels' speeds (m/s), inputs the efforts: A = diag(-1 / tau), B = diag(gain / tau),
C = I, D = 0. The discrete form holds the effort over `Ts`: Ad = exp(A Ts), Bd = gain (1 - Ad); exact, not
Euler's. Delay is a variable of its own (an input delay, a Transport Delay block); friction is no linear term:
the .mat carries it beside the matrices for a block that subtracts it from the effort.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from truing.model.robot_model import RobotModel
from truing.recording.writer import replace_file

from .mat_file import write_mat
from .terms import DEFAULTS, ExportOptions, headline, left_out, wheels

KIND = "simulink"
TITLE = "state space A, B, C, D, Ts and delay (.mat) with a script (.m)"
SUFFIX = ".mat"
HOLDS = frozenset({"delay"})

SCRIPT = """% {headline}
{notes}%
% Linear model of both wheels: speed (m/s) from effort (-1..1). Run this file; in Simulink use a
% State-Space block with A, B, C, D (or a Discrete State-Space block with Ad, Bd, Cd, Dd at Ts) behind a
% Transport Delay of delay(1) and delay(2). friction holds the dry friction of each wheel as effort: a
% block that subtracts friction .* sign(v) from the effort, and holds the wheel at rest while
% abs(effort) <= friction, completes the model.
here = fileparts(mfilename('fullpath'));
load(fullfile(here, '{file}'));
if exist('ss', 'file')
    continuous = ss(A, B, C, D, 'InputDelay', delay, 'InputName', {{'effort_left', 'effort_right'}}, ...
        'OutputName', {{'speed_left', 'speed_right'}});
    discrete = ss(Ad, Bd, Cd, Dd, Ts, 'InputDelay', delay_samples);
end
"""


def matrices(model: RobotModel, period_s: float) -> dict[str, np.ndarray]:
    """Continuous and discrete matrices, shapes (2, 2), and delays, shape (2, 1)."""
    tau = np.array([wheel.time_constant_s for _, wheel in wheels(model)])
    gain = np.array([wheel.gain_mps for _, wheel in wheels(model)])
    delay = np.array([[wheel.delay_s] for _, wheel in wheels(model)])
    decay = np.exp(-period_s / tau)
    return {
        "A": np.diag(-1.0 / tau),
        "B": np.diag(gain / tau),
        "C": np.eye(2),
        "D": np.zeros((2, 2)),
        "Ad": np.diag(decay),
        "Bd": np.diag(gain * (1.0 - decay)),
        "Cd": np.eye(2),
        "Dd": np.zeros((2, 2)),
        "Ts": np.array([[period_s]]),
        "delay": delay,
        "delay_samples": np.rint(delay / period_s),
        "friction": np.array([[wheel.friction] for _, wheel in wheels(model)]),
    }


def remarks(model: RobotModel, options: ExportOptions) -> tuple[str, ...]:
    """What rounding the delay to whole samples costs the discrete form."""
    period = options.period(model)
    said = []
    for side, wheel in wheels(model):
        lost = wheel.delay_s - round(wheel.delay_s / period) * period
        if abs(lost) > 1e-9:
            said.append(
                f"the discrete form delays by whole samples: {side} {wheel.delay_s:.4g} s becomes "
                f"{wheel.delay_s - lost:.4g} s at Ts = {period:.4g} s; the continuous form has it all"
            )
    return tuple(said)


def write(model: RobotModel, path: Path, options: ExportOptions = DEFAULTS) -> tuple[Path, ...]:
    """The .mat and, beside it, the script of the same name."""
    sentences = (*left_out(model, HOLDS), *remarks(model, options))
    notes = "".join(f"% {sentence}\n" for sentence in sentences)
    values = matrices(model, options.period(model))
    write_mat(path, {**values, "notes": "\n".join(sentences), "about": headline(model)})
    # A MATLAB script's name is an identifier.
    stem = "".join(c if c.isalnum() and c.isascii() else "_" for c in path.stem)
    script = path.with_name(f"{stem if stem[:1].isalpha() else f'm{stem}'}_load.m")
    replace_file(script, SCRIPT.format(headline=headline(model), notes=notes, file=path.name).encode())
    return path, script
