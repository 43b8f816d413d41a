"""`--accept`: the user's own choice of effects is fitted, reported and exported, and said to be theirs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from support.simulated_runs import RICH, noisy_robot
from truing.cli import group
from truing.diagnose.accepted import with_accepted
from truing.diagnose.engine import investigate
from truing.diagnose.verdict import Reasoning
from truing.errors import IdentifyError
from truing.recording.baseline import read_baseline

EXAMPLE = Path(__file__).resolve().parents[3] / "docs" / "example"
FRICTION = {"coulomb_friction": {"left": 0.05, "right": 0.05}}


@pytest.fixture(scope="module")
def reasoning() -> Reasoning:
    return investigate(noisy_robot(RICH, FRICTION, 0.004, 5), lambda _: None, 1)


def test_a_part_of_a_name_stands_for_the_effect_that_fits_best(reasoning: Reasoning) -> None:
    found = with_accepted(reasoning, ["friction"])
    assert found.best.effects == ("coulomb_friction",)
    assert found.verdict == "missing_physics"
    assert not found.rivals


def test_effects_that_were_not_fitted_together_are(reasoning: Reasoning) -> None:
    found = with_accepted(reasoning, ["coulomb_friction", "winding", "drag"])
    assert set(found.best.effects) == {"coulomb_friction", "winding_heating", "quadratic_drag"}
    assert found.best.cost <= found.base.cost


def test_a_name_that_fits_none_or_several_is_refused(reasoning: Reasoning) -> None:
    with pytest.raises(IdentifyError, match="is no effect that these recordings can show"):
        with_accepted(reasoning, ["gremlins"])
    with pytest.raises(IdentifyError, match="driver may be"):
        with_accepted(reasoning, ["driver", "gear", "encoder"])


@pytest.mark.slow
def test_the_accepted_effects_are_exported_and_said_to_be_the_users(tmp_path: Path) -> None:
    model, verdict = tmp_path / "model.toml", tmp_path / "verdict.json"
    written = ["--export", f"toml:{model}", "--json", str(verdict)]
    done = CliRunner().invoke(
        group, ["diagnose", str(EXAMPLE), "--accept", "coulomb_friction+speed_limit", *written]
    )
    assert done.exit_code == 0, done.output
    assert "--accept" in done.output
    assert set(read_baseline(model).effects) == {"coulomb_friction", "speed_limit"}
    assert {effect["name"] for effect in json.loads(verdict.read_text())["effects"]} == {
        "coulomb_friction",
        "speed_limit",
    }
