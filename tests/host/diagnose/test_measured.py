"""A direct measurement takes the baseline's place, rules its error out, and resolves what no drive can."""

from __future__ import annotations

import pytest

from support.practice_robots import make_trial
from truing.diagnose.diagnosis_input import Options, read_input
from truing.diagnose.engine import diagnose
from truing.diagnose.measured import Measured, how_to_resolve, parse_measured, ruled_out
from truing.errors import IdentifyError
from truing.recording.run import RecordingSet


def test_measured_numbers_are_parsed() -> None:
    assert parse_measured(["counts_per_rev=2400", "wheelbase_m=0.283"]) == (
        Measured("counts_per_rev", 2400.0),
        Measured("wheelbase_m", 0.283),
    )


@pytest.mark.parametrize(
    "text", ["mass=3", "wheelbase_m", "wheelbase_m=-1", "wheelbase_m=nan", "wheelbase_m=x"]
)
def test_what_cannot_be_measured_so_is_an_error_that_says_what_can(text: str) -> None:
    with pytest.raises(IdentifyError, match="--measured") as error:
        parse_measured([text])
    assert "VALUE" in str(error.value.next_step)


def test_each_measurement_rules_out_the_error_of_its_number() -> None:
    assert ruled_out(parse_measured(["counts_per_rev=2400"])) == {"encoder_scale"}
    assert how_to_resolve(("wheel_radius_error", "encoder_scale")) == (
        "--measured wheel_radius_m=VALUE or --measured counts_per_rev=VALUE"
    )
    assert how_to_resolve(("driver_lag",)) == ""


@pytest.fixture(scope="module")
def scaled(tmp_path_factory: pytest.TempPathFactory) -> RecordingSet:
    """A robot whose encoders have other counts than its baseline says, seen from outside."""
    folder = tmp_path_factory.mktemp("scaled")
    make_trial(43, "encoder_scale", folder=folder, plan_kind="thirds")
    return read_input(folder / "recordings", None)


@pytest.mark.slow
def test_a_measured_number_resolves_the_ambiguity(scaled: RecordingSet) -> None:
    assert scaled.baseline is not None
    assert scaled.baseline.robot is not None
    before = diagnose(scaled, Options(jobs=1))
    names = {effect.name for effect in before.effects}
    assert {"encoder_scale", "wheel_radius_error"} <= names
    assert before.next_experiment is not None
    assert "--measured" in before.next_experiment.why
    radius_m = scaled.baseline.robot.wheel_radius_m
    assert radius_m is not None
    known = (Measured("wheel_radius_m", radius_m),)
    after = diagnose(scaled, Options(jobs=1, measured=known))
    assert after.verdict == "missing_physics"
    assert [effect.name for effect in after.effects] == ["encoder_scale"]
