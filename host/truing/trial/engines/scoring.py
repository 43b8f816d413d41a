"""Scores a trial in an engine: names, and parameters beside those that the changed robot should show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from truing.trial.campaign import confidences_of, names_of, sure_names_of
from truing.trial.concealed import TrialResult
from truing.trial.engines.asked import EngineAsked
from truing.trial.score import Score, judge

if TYPE_CHECKING:
    from truing.diagnose.result import Diagnosis


def score(asked: EngineAsked, result: TrialResult) -> Score:
    """Hold a verdict against the opened answer."""
    answer, diagnosis = result.answer, result.first.diagnosis
    hidden = tuple(str(each["name"]) for each in answer["effects"])
    family = str(answer["family"])
    said = names_of(diagnosis)
    worth = judge(diagnosis.verdict, said, family, hidden, sure_names_of(diagnosis))
    return Score(
        effect=asked.effect,
        seed=asked.seed,
        weak=asked.weak,
        family=family,
        hidden=hidden,
        strengths=tuple(float(each["strength"]) for each in answer["effects"]),
        driving=str(answer["driving"]),
        on_board=False,
        verdict=diagnosis.verdict,
        said=said,
        named=worth.named,
        named_alone=worth.named_alone,
        confidently_wrong=worth.confidently_wrong,
        right=worth.right,
        place_right=None,
        later=(),
        resolved=None,
        seconds=result.first.seconds,
        cpu_s=result.first.cpu_s,
        building_cpu_s=result.building_cpu_s,
        scoring_cpu_s=0.0,
        sha256=result.sha256,
        measured={
            "engine": answer["engine"],
            "engine_names": [each["engine_name"] for each in answer["effects"] + answer["inside_form"]],
            "noise_mps": answer["noise_mps"],
            "healthy_mps": answer["healthy"]["rms_mps"],
            "healthy_share": answer["healthy"]["share"],
            "parameters": parameters(answer["effects"], diagnosis) if worth.named else {},
        },
        confidences=confidences_of(diagnosis),
    )


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
