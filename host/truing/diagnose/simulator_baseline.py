"""A baseline equivalent to another simulator, identified from that simulator's output."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.effect_tables import effect_table
from truing.diagnose.present.corrected_model import chosen_effects
from truing.diagnose.result import Check, Diagnosis
from truing.recording.baseline import Baseline, WheelModel
from truing.recording.run import WHEELS, RecordingSet


def equivalent_baseline(baseline: Baseline, found: Diagnosis) -> tuple[Baseline, tuple[Check, ...]]:
    """The baseline that behaves as another simulator does, and what is known of their difference.

    Parameters
    ----------
    baseline : from which the identification started.
    found : the diagnosis of the simulator's output. Effects of the baseline take the numbers that they have
        there, and those of the likeliest explanation join it: a delay of the simulator's is not the robot's.
    """
    values = {(entry.wheel, entry.name): entry.with_effects.value for entry in found.numbers}
    wheels = {}
    for wheel in WHEELS:
        given = baseline.left if wheel == "left" else baseline.right
        wheels[wheel] = WheelModel(
            values.get((wheel, "gain_mps"), given.gain_mps),
            values.get((wheel, "time_constant_s"), given.time_constant_s),
        )
    effects = dict(baseline.effects)
    tables = dict(found.baseline_effects)
    tables |= {effect.name: effect.parameters for effect in chosen_effects(found)}
    if found.verdict != "consistent":
        for name, parameters in tables.items():
            effects[name] = effect_table(name, parameters, found.exact.get(name, {}), baseline)
    text = f"your simulator is reproduced to {found.fit.model_rmse:.3g} {found.fit.unit} by a baseline"
    extra = sorted(set(effects) - set(baseline.effects))
    if extra:
        text += f" that contains {', '.join(extra)}"
    checks = [Check("simulator", text)]
    if found.verdict in ("partly_explained", "ambiguous", "unexplained"):
        text = (
            "what your simulator contains beyond the baseline is not in the catalogue, or ambiguous; the "
            "verdict may attribute it to the robot"
        )
        step = "Give the parameters and effects of your simulator in the baseline"
        checks.append(Check("simulator", text, "warning", step))
    equivalent = replace(
        baseline,
        left=wheels["left"],
        right=wheels["right"],
        effects=effects,
        reference_mps=baseline.full_effort_mps,
    )
    return equivalent, tuple(checks)


def with_simulator_errors(
    diagnosis: Diagnosis, recordings: RecordingSet, simulated: RecordingSet, checks: tuple[Check, ...]
) -> Diagnosis:
    """The error as given is that of the simulator itself, not of its equivalent baseline."""
    squares, count = 0.0, 0
    speeds: dict[str, FloatArray] = {}
    for recorded, made in zip(recordings, simulated, strict=True):
        pairs = [
            (
                recorded.speed(wheel, recordings.baseline).values,
                made.speed(wheel, recordings.baseline).values,
            )
            for wheel in WHEELS
        ]
        speeds[recorded.name] = np.stack([pair[1] for pair in pairs], axis=1)
        squares += sum(float(((a - b)[1:] ** 2).sum()) for a, b in pairs)
        count += 2 * (len(recorded) - 1)
    traces = tuple(
        replace(trace, baseline=speeds[trace.run]) if len(trace.t_s) == len(speeds[trace.run]) else trace
        for trace in diagnosis.traces
    )
    fit = replace(diagnosis.fit, baseline_rmse=float(np.sqrt(squares / count)))
    return replace(diagnosis, fit=fit, checks=(*diagnosis.checks, *checks), traces=traces)
