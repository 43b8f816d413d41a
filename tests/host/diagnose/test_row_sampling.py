"""Speeds that were read at the rows' times instead of averaged over them, as simulators write them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from support import recorded_sets
from support.read_speeds import FRICTION, NOISE_MPS, recorded
from truing.diagnose.diagnosis_input import Options
from truing.diagnose.engine import diagnose
from truing.diagnose.present.text import recorder_lines
from truing.diagnose.result import Diagnosis

STARTS_IN_MOTION = 45  # rows that are cut off, s times the rate


def diagnosed(*, instant: bool, cut: int = 0) -> Diagnosis:
    """The diagnosis of four runs that hold speeds and nothing else of the motion."""
    recordings = replace(recorded(instant=instant, cut=cut), baseline=recorded_sets.baseline())
    return diagnose(recordings, Options(jobs=1))


@pytest.mark.parametrize(
    ("instant", "cut"), [(True, 0), (True, STARTS_IN_MOTION), (False, 0)], ids=["rest", "motion", "means"]
)
def test_friction_is_found_however_the_speeds_were_read(instant: bool, cut: int) -> None:
    """Half a row of difference was explained by play, ripple and an eccentric encoder."""
    found = diagnosed(instant=instant, cut=cut)
    assert [effect.name for effect in found.effects] == ["coulomb_friction"], found.verdict
    assert found.verdict == "missing_physics"
    for parameter in found.effects[0].parameters.values():
        assert parameter.value == pytest.approx(FRICTION, rel=0.05)
    assert found.fit.model_rmse == pytest.approx(NOISE_MPS, rel=0.1)
    said = "\n".join(recorder_lines(found))
    assert ("not averaged" in said) == instant
