"""Scores a trial in an engine: names, and parameters beside those that the changed robot should show."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from truing.trial.campaign import verdict_score
from truing.trial.concealed import TrialResult
from truing.trial.engines.asked import EngineAsked
from truing.trial.score import Score

if TYPE_CHECKING:
    from truing.diagnose.result import Diagnosis


def score(asked: EngineAsked, result: TrialResult) -> Score:
    """Hold a verdict against the opened answer."""
    answer, plain = result.answer, verdict_score(asked, result, on_board=False)
    measured = {
        "engine": answer["engine"],
        "engine_names": [each["engine_name"] for each in answer["effects"] + answer["inside_form"]],
        "noise_mps": answer["noise_mps"],
        "healthy_mps": answer["healthy"]["rms_mps"],
        "healthy_share": answer["healthy"]["share"],
        "parameters": parameters(answer["effects"], result.first.diagnosis) if plain.named else {},
    }
    return replace(plain, measured=measured)


def parameters(hidden: list[dict[str, Any]], diagnosis: Diagnosis) -> dict[str, dict[str, Any]]:
    """Parameters found beside those expected, by `effect.parameter`, of the effects that are named."""
    out: dict[str, dict[str, Any]] = {}
    for each in hidden:
        found = [effect for effect in diagnosis.effects if effect.name == each["name"]]
        for key, expected in each["expected"].items():
            estimate = next((e.parameters[key] for e in found if key in e.parameters), None)
            if estimate is None or estimate.value is None:
                continue
            value, true, factor = float(estimate.value), float(expected), float(each["within"])
            out[f"{each['name']}.{key}"] = {
                "expected": true,
                "found": value,
                "within": value * true > 0.0 and 1.0 / factor <= value / true <= factor,
            }
    return out
