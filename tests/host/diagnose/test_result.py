"""The verdict file is docs/DATA_FORMAT.md, section 4, whatever the diagnosis holds."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from support import diagnoses
from truing.diagnose.result import EffectParameter, FitErrors
from truing.plan import parse_plan

DIAGNOSES = [
    diagnoses.missing_physics,
    diagnoses.ambiguous,
    diagnoses.parameters_only,
    diagnoses.consistent,
    diagnoses.unexplained,
]


@pytest.mark.parametrize("make", DIAGNOSES)
def test_every_verdict_becomes_strict_json_with_the_documented_keys(make) -> None:
    tree = json.loads(json.dumps(make().to_json(), allow_nan=False))
    assert tree["schema"] == 2
    assert {"verdict", "effects", "mismatch", "fit", "not_exercised", "next_experiment"} <= set(tree)
    assert {"baseline_rmse", "refit_rmse", "model_rmse", "noise_floor", "unit"} <= set(tree["fit"])
    assert {"left_over", "recorder"} <= set(tree)
    for effect in tree["effects"]:
        assert {
            "name",
            "scope",
            "parameters",
            "confidence",
            "heldout_rmse_before",
            "heldout_rmse_after",
            "indistinguishable_from",
        } <= set(effect)
        for parameter in effect["parameters"].values():
            assert set(parameter) == {"value", "ci95", "unit"}
            assert len(parameter["ci95"]) == 2
    for span in tree["mismatch"]:
        assert {"run", "signal", "t_start_s", "t_end_s", "share", "regime"} <= set(span)


def test_what_is_not_finite_becomes_null() -> None:
    diagnosis = diagnoses.consistent()
    unknown = replace(diagnosis, fit=FitErrors(math.nan, math.inf, 0.01, 0.01), confidence=math.nan)
    tree = json.loads(json.dumps(unknown.to_json(), allow_nan=False))
    assert tree["fit"]["baseline_rmse"] is None
    assert tree["fit"]["refit_rmse"] is None
    assert tree["confidence"] is None


def test_numbers_of_numpy_become_plain_ones() -> None:
    import numpy as np

    parameter = EffectParameter(np.float64(0.05), (np.float64(0.04), np.float64(0.06)), "effort")
    assert json.dumps(parameter.to_json()) == '{"value": 0.05, "ci95": [0.04, 0.06], "unit": "effort"}'


def test_arrays_stay_out_of_the_file() -> None:
    diagnosis = diagnoses.missing_physics()
    assert diagnosis.traces
    assert "traces" not in diagnosis.to_json()
    assert "explanations" not in diagnosis.to_json()


def test_the_next_experiment_is_a_plan_that_the_plan_reader_takes() -> None:
    experiment = diagnoses.ambiguous().to_json()["next_experiment"]
    content = {key: value for key, value in experiment["plan"].items() if key != "name"}
    assert parse_plan(content, "next", "next") == replace(diagnoses.plan(), name="next")
    assert experiment["separates"] == [["coulomb_friction"], ["driver_deadband"]]
    assert experiment["expected_difference_over_noise"] == 7.5
