"""Identified numbers and fitted models in three lines: the robot, what a simulation lacks, the next step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from truing.recording.wheel_text import response_text, wheels_text

if TYPE_CHECKING:
    from truing.identify.identification import Identification
    from truing.identify.model_ladder import SetModels

# A gain that changes by this share between the largest steps and the smallest is pointed out.
CHANGED_GAIN = 0.1
# Levels this much smaller than a wheel's largest count as small.
SMALL_LEVEL = 0.5

# What each structure has beyond gain and time constant.
STRUCTURE_WORDS = {
    "friction": "dry friction",
    "delay": "dry friction and a delay",
    "breakaway": "breakaway friction",
    "stribeck": "breakaway friction that falls with speed",
    "asymmetric": "gain and friction that differ between the directions",
    "recorder_lag": "a lag in the recorded speed",
    "recorder_window": "a moving average in the recorded speed",
    "driver_lag": "a lag in the motor's driver",
    "drag": "drag that grows with speed squared",
    "offset": "a constant effort",
    "supply": "the supply's voltage",
}


def identified_lines(result: Identification, runs: str = "RUNS") -> tuple[str, ...]:
    """What `truing identify` says first.

    Parameters
    ----------
    runs : the path that the user gave, for the command to go on with.
    """
    lines = _identified(result, runs)
    return lines if result.axis is None else tuple(map(result.axis.text, lines))


def _identified(result: Identification, runs: str) -> tuple[str, ...]:
    fits = {wheel: fit for wheel, fit in result.whole_fits.items() if fit.gain.value is not None}
    gains = {str(wheel): fit.gain.value for wheel, fit in fits.items() if fit.gain.value is not None}
    times = {
        str(wheel): fit.time_constant.value
        for wheel, fit in fits.items()
        if fit.time_constant.value is not None
    }
    errors = {str(wheel): fit.rms_percent for wheel, fit in fits.items() if fit.rms_percent is not None}
    following = f"Next: `truing fit {runs}` adds friction and delay, and says what that brings."
    if not gains:
        reasons = {fit.gain.reason for fit in result.whole_fits.values() if fit.gain.reason}
        why = "; ".join(sorted(reasons)) or "no wheel is driven"
        return (f"The robot: these recordings do not show its gain ({why}).",)
    left = f"leaves {wheels_text(errors, '%', 2)} of the top speed"
    return (
        f"The robot: {response_text(gains, times)}.",
        f"A first-order simulation with these numbers {left}{_changed_gain(result)}.",
        following,
    )


def _changed_gain(result: Identification) -> str:
    """How much lower the gain of small steps is than that of the largest: what one gain cannot follow."""
    shares = []
    for wheel in ("left", "right"):
        steps = [
            (abs(step.input), step.gain.value)
            for run in result.runs
            for side in run.wheels
            if side.wheel == wheel
            for step in side.steps
            if step.kind == "effort" and step.input != 0.0 and step.gain.value is not None
        ]
        if not steps:
            continue
        top = max(level for level, _ in steps)
        large = [gain for level, gain in steps if level > 0.9 * top]
        small = [gain for level, gain in steps if level < SMALL_LEVEL * top]
        if small:
            shares.append(1.0 - float(np.median(small)) / float(np.median(large)))
    if not shares or max(map(abs, shares)) < CHANGED_GAIN:
        return ""
    change = max(shares, key=abs)
    word = "lower" if change > 0.0 else "higher"
    return f"; the gain of small steps is {100.0 * abs(change):.0f} % {word}, which it cannot follow"


def fitted_lines(models: SetModels, runs: str = "RUNS") -> tuple[str, ...]:
    """What `truing fit` says first.

    Parameters
    ----------
    runs : the path that the user gave, for the command to go on with.
    """
    lines = _fitted(models, runs)
    return lines if models.axis is None else tuple(map(models.axis.text, lines))


def _fitted(models: SetModels, runs: str) -> tuple[str, ...]:
    chosen = {wheel.wheel: wheel.chosen for wheel in models.wheels}
    robot = response_text(_known(models, "gain_mps"), _known(models, "time_constant_s"))
    rubs = _known(models, "friction")
    if rubs and any(fit.physics.friction > 0.0 for fit in chosen.values()):
        percent = {side: 100.0 * value for side, value in rubs.items()}
        robot += f", dry friction {wheels_text(percent, '%', 2)} of full effort"
    return (
        f"The robot: {robot}.",
        _lacking(models),
        f"Next: write it with `--out model.toml`; `truing diagnose {runs} --model model.toml` says what it "
        "still lacks.",
    )


def _lacking(models: SetModels) -> str:
    """What the chosen models have beyond a first-order one, and the error of both on runs left out."""
    structures = {wheel.wheel: wheel.chosen.structure.name for wheel in models.wheels}
    before, after, where = {}, {}, "on runs left out"
    for wheel in models.wheels:
        plain, chosen = wheel.steps[0].held_out, wheel.chosen.held_out
        if plain is None or chosen is None:
            plain, chosen, where = wheel.steps[0].free_run, wheel.chosen.free_run, "on the fitted runs"
        before[str(wheel.wheel)], after[str(wheel.wheel)] = plain.percent, chosen.percent
    names = set(structures.values())
    if names == {"linear"}:
        left = wheels_text(after, "%", 2)
        return (
            f"A first-order simulation lacks nothing that these runs show: {left} of the top speed {where}."
        )
    if len(names) == 1:
        missing = STRUCTURE_WORDS[next(iter(names))]
    else:
        named = {side: STRUCTURE_WORDS.get(name, "nothing") for side, name in structures.items()}
        missing = ", ".join(f"{words} ({side})" for side, words in named.items())
    start, end = wheels_text(before, "%", 2), wheels_text(after, "%", 2)
    it = "them" if " and " in missing or len(names) > 1 else "it"
    return (
        f"A first-order simulation lacks {missing}: with {it} the error {where} falls from {start} to "
        f"{end} of the top speed."
    )


def _known(models: SetModels, name: str) -> Mapping[str, float]:
    found = {wheel.wheel: wheel.chosen.parameters.get(name) for wheel in models.wheels}
    return {
        side: quantity.value
        for side, quantity in found.items()
        if quantity is not None and quantity.value is not None
    }
