"""A diagnosis in three lines: what the robot does, what the simulation lacks, what to do next."""

from __future__ import annotations

import math

import numpy as np

from truing.diagnose.present.text import amount, headline, next_lines, two_amounts
from truing.diagnose.result import Diagnosis, WheelNumbers
from truing.recording.wheel_text import response_text

# A model that leaves this share of the motion's own RMS follows none of it.
AS_STILL = 0.9

NOTHING_TO_DO = "nothing. Diagnose again when the robot, its load or its floor changes."


def first_screen(diagnosis: Diagnosis, *, board: bool) -> tuple[str, str, str]:
    """The robot, what its simulation lacks and what that brings, the first thing to do.

    Parameters
    ----------
    board : the user has a board of ours, so that advice about it is of use.
    """
    following = next_lines(diagnosis, board=board) or [NOTHING_TO_DO]
    load = [f"; it {check.text.partition('; ')[0]}" for check in diagnosis.checks if check.topic == "load"]
    return (
        f"The robot: {_robot(diagnosis)}{''.join(load)}.",
        f"{headline(diagnosis)} {error_sentence(diagnosis)}",
        f"Next: {following[0][:1].lower()}{following[0][1:]}",
    )


def error_sentence(diagnosis: Diagnosis) -> str:
    """What better numbers and effects take from the error of the simulation, beside the noise."""
    fit = diagnosis.fit
    if diagnosis.pose_fit is not None and diagnosis.effects and diagnosis.effects[0].domain == "pose":
        fit = diagnosis.pose_fit
    noise = amount(fit.noise_floor, fit.unit)
    if diagnosis.verdict == "consistent":
        error = fit.baseline_rmse if diagnosis.has_given else fit.refit_rmse
        return f"Its error is {amount(error, fit.unit)}, the noise {noise}."
    if not diagnosis.effects and not diagnosis.has_given:
        return f"Gain and time constant alone leave {amount(fit.refit_rmse, fit.unit)}; the noise is {noise}."
    if not diagnosis.effects:
        change = _change(fit.baseline_rmse, fit.refit_rmse, fit.unit)
        return f"Refitted numbers {change}; the noise is {noise}."
    before, after, where = fit.refit_rmse, fit.model_rmse, ""
    if math.isfinite(fit.heldout_refit_rmse) and math.isfinite(fit.heldout_model_rmse):
        before, after = fit.heldout_refit_rmse, fit.heldout_model_rmse
        where = " on runs left out of the fit"
    with_it = "With it the error" if len(diagnosis.effects) == 1 else "With them the error"
    if not (math.isfinite(before) and math.isfinite(after)):
        return f"The noise is {noise}."
    start, end = two_amounts(before, after, fit.unit)
    verb = "falls" if after < before else "goes"
    return f"{with_it}{where} {verb} from {start} to {end}; the noise is {noise}."


def _change(before: float, after: float, unit: str) -> str:
    start, end = two_amounts(before, after, unit)
    verb = "lower" if after < before else "change"
    return f"{verb} the error from {start} to {end}"


def _robot(diagnosis: Diagnosis) -> str:
    """Gain and time constant of each wheel, as far as they are known; without them, what was recorded."""
    if follows_nothing(diagnosis):
        return "its gain is not known, no simulation follows these runs better than one that stands still"
    if diagnosis.numbers:
        gains = _by_wheel(diagnosis.numbers, "gain_mps")
        return response_text(gains, _by_wheel(diagnosis.numbers, "time_constant_s"))
    runs = f"{len(diagnosis.runs)} runs" if len(diagnosis.runs) != 1 else "one run"
    seconds = sum(float(trace.t_s[-1] - trace.t_s[0]) for trace in diagnosis.traces)
    return f"{runs}, {seconds:.0f} s" if seconds > 0.0 else runs


def follows_nothing(diagnosis: Diagnosis) -> bool:
    """Whether the best model is hardly nearer to the measured speeds than no motion at all."""
    rows = [np.square(trace.measured[trace.valid]) for trace in diagnosis.traces]
    if diagnosis.fit.unit != "m/s" or not sum(map(len, rows)):
        return False
    motion = math.sqrt(float(np.mean(np.concatenate(rows))))
    unseen = diagnosis.fit.heldout_model_rmse
    return max(diagnosis.fit.model_rmse, unseen if math.isfinite(unseen) else 0.0) > AS_STILL * motion


def _by_wheel(numbers: tuple[WheelNumbers, ...], name: str) -> dict[str, float]:
    """The known values: a gain or time constant whose interval holds zero is none."""
    return {
        entry.wheel: entry.with_effects.value
        for entry in numbers
        if entry.name == name and not entry.with_effects.ci95[0] <= 0.0 <= entry.with_effects.ci95[1]
    }
