"""Speeds that were read at the rows' times instead of averaged over them, as simulators write them."""

from __future__ import annotations

import numpy as np
import pytest

from support import recorded_sets
from truing.diagnose.diagnosis_input import Options
from truing.diagnose.engine import diagnose
from truing.diagnose.present.text import recorder_lines
from truing.diagnose.result import Diagnosis
from truing.recording.run import RecordingSet, Run

FRICTION, NOISE_MPS = 0.05, 0.003
SUBSTEPS = 20
STARTS_IN_MOTION = 45  # rows that are cut off, s times the rate


def wheel_speeds(effort: np.ndarray, *, instant: bool) -> np.ndarray:
    """Speeds (n, 2) of a first-order robot with dry friction, a row's effort being that up to its time."""
    step_s = 1.0 / recorded_sets.RATE_HZ / SUBSTEPS
    share = 1.0 - np.exp(-step_s / recorded_sets.TAU_S)
    speed, rows = np.zeros(2), [np.zeros(2)]
    for row in effort[1:]:
        within = []
        for _ in range(SUBSTEPS):
            before, direction = speed, np.where(speed != 0.0, np.sign(speed), np.sign(row))
            stuck = (before == 0.0) & (np.abs(row) <= FRICTION)
            goal = np.where(stuck, 0.0, recorded_sets.GAIN_MPS * (row - FRICTION * direction))
            after = before + (goal - before) * share
            speed = np.where((before * after < 0.0) & (np.abs(row) <= FRICTION), 0.0, after)
            within.append(0.5 * (before + speed))
        rows.append(speed if instant else np.mean(within, axis=0))
    return np.array(rows)


def diagnosed(*, instant: bool, cut: int = 0) -> Diagnosis:
    """The diagnosis of four runs that hold speeds and nothing else of the motion."""
    rng = np.random.default_rng(7)
    runs = []
    for number in range(1, 5):
        values = recorded_sets.columns(number)
        effort = np.stack([values["effort_left"], values["effort_right"]], axis=1)
        speed = wheel_speeds(effort, instant=instant)
        speed += NOISE_MPS * rng.standard_normal(speed.shape)
        columns = {"t_s": values["t_s"], "effort_left": effort[:, 0], "effort_right": effort[:, 1]}
        columns |= {"vel_left_mps": speed[:, 0], "vel_right_mps": speed[:, 1]}
        kept = {name: column[cut:].copy() for name, column in columns.items()}
        runs.append(Run(f"{number:02d}_levels", kept, order=tuple(kept)))
    return diagnose(RecordingSet("plain", tuple(runs), recorded_sets.baseline()), Options(jobs=1))


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
