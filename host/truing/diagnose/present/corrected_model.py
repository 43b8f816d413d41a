"""The user's baseline with what the diagnosis found: as a baseline, and as a model for the exporters."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from truing.diagnose.effect_tables import effect_table
from truing.diagnose.present.text import alternatives, effect_title, joined
from truing.diagnose.result import Diagnosis, NamedEffect
from truing.exporters.source import from_baseline
from truing.model.robot_model import RobotModel
from truing.recording.baseline import Baseline, RobotGeometry, WheelModel


@dataclass(frozen=True, slots=True)
class CorrectedModel:
    """What to simulate from now on.

    Attributes
    ----------
    baseline : every effect by its documented names, numbers refitted with them.
    model : the part of it that a wheel's physics can express, for the exporters.
    notes : what `model` leaves out, and what was chosen where the verdict leaves a choice.
    """

    baseline: Baseline
    model: RobotModel
    notes: tuple[str, ...]

    def to_toml(self) -> str:
        """A model file that is a baseline with every effect in it, also those that no wheel's physics has."""
        tables = {name: dict(table) for name, table in self.baseline.effects.items()}
        text = self.model.to_toml(tables)
        if self.baseline.reference_mps is not None:
            left, right = self.baseline.reference_mps
            text += f"\n[reference]\nfull_effort_left_mps = {left!r}\nfull_effort_right_mps = {right!r}\n"
        return text


def corrected_model(diagnosis: Diagnosis, baseline: Baseline) -> CorrectedModel:
    """Put the refitted numbers and the named effects (of the likeliest explanation) into the baseline."""
    notes = []
    chosen = chosen_effects(diagnosis)
    learned = diagnosis.learned
    alone = learned is not None and learned.correction is not None and not learned.effects
    if alone and chosen:
        here = joined([effect_title(effect.name) for effect in chosen])
        notes.append(f"the learned correction stands in the place of {here}")
        chosen = ()
    elif diagnosis.verdict == "ambiguous":
        others = [" with ".join(map(effect_title, names)) for names in alternatives(diagnosis)[1:]]
        here = joined([effect_title(effect.name) for effect in chosen])
        notes.append(f"{here} is taken, the likeliest; {joined(others, 'or')} explains as much")
    if diagnosis.verdict == "unexplained":
        notes.append("only the parameters are refitted: the mismatch is not in the catalogue")
    effects: dict[str, dict[str, Any]] = {name: dict(table) for name, table in baseline.effects.items()}
    if diagnosis.verdict != "consistent":
        for name, parameters in diagnosis.baseline_effects.items():
            effects[name] = effect_table(name, parameters, diagnosis.exact.get(name, {}), baseline)
    for effect in chosen:
        exact = diagnosis.exact.get(effect.name, {})
        effects[effect.name] = effect_table(effect.name, effect.parameters, exact, baseline)
    left, right = (_wheel(diagnosis, baseline, side, alone=alone) for side in ("left", "right"))
    robot = baseline.robot
    if "wheelbase_error" in effects and robot is not None and robot.wheelbase_m is not None:
        factor = float(effects.pop("wheelbase_error")["factor"])
        robot = replace(robot, wheelbase_m=factor * robot.wheelbase_m)
    if "side_asymmetry" in effects:
        left, right = _sides(left, right, effects.pop("side_asymmetry"))
    corrected = replace(baseline, left=left, right=right, robot=robot, effects=effects)
    model, unused = from_baseline(corrected)
    if set(effects) - set(model.effects()):
        # Some effects are shares of the full-effort speed: they keep the one that they were found with.
        corrected = replace(corrected, reference_mps=baseline.full_effort_mps)
    named = tuple(effect_title(effect.name) for effect in chosen)
    source = {"diagnosis": f"{diagnosis.name}, {diagnosis.verdict.replace('_', ' ')}"}
    if named:
        source["added"] = joined(named)
    correction = None if learned is None else learned.correction
    model = replace(model, robot=corrected.robot or RobotGeometry(), source=source, correction=correction)
    return CorrectedModel(corrected, model, (*notes, *unused))


def chosen_effects(diagnosis: Diagnosis) -> tuple[NamedEffect, ...]:
    """The named effects that act together in the likeliest explanation."""
    if diagnosis.verdict == "partly_explained":
        return tuple(effect for effect in diagnosis.effects if effect.explanation == 0)
    if diagnosis.verdict != "ambiguous":
        return diagnosis.effects
    first = alternatives(diagnosis)[0]
    return tuple(effect for effect in diagnosis.effects if effect.name in first)


def _wheel(diagnosis: Diagnosis, baseline: Baseline, side: str, *, alone: bool) -> WheelModel:
    given = baseline.left if side == "left" else baseline.right
    if diagnosis.verdict == "consistent":
        return given
    values = {
        entry.name: entry.refitted if alone else entry.with_effects.value
        for entry in diagnosis.numbers
        if entry.wheel == side
    }
    return WheelModel(
        values.get("gain_mps", given.gain_mps), values.get("time_constant_s", given.time_constant_s)
    )


def _sides(left: WheelModel, right: WheelModel, ratios: dict[str, Any]) -> tuple[WheelModel, WheelModel]:
    """Two different wheels in place of two equal ones, whose numbers are the geometric means."""
    gain = math.sqrt(float(ratios["gain_ratio"]))
    constant = math.sqrt(float(ratios["time_constant_ratio"]))
    return (
        WheelModel(left.gain_mps * gain, left.time_constant_s * constant),
        WheelModel(right.gain_mps / gain, right.time_constant_s / constant),
    )
