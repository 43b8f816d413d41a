"""One step in one run: no other part of the run can say what the step shows."""

from __future__ import annotations

import numpy as np
import pytest

from truing.diagnose.data.set_data import set_data
from truing.diagnose.diagnosis_input import Options
from truing.diagnose.engine import diagnose, initial_fit
from truing.diagnose.present.text import sections
from truing.diagnose.result import Diagnosis
from truing.diagnose.search import Search
from truing.diagnose.simulation.simulator import SetSimulator
from truing.diagnose.unseen_runs import UnseenRuns
from truing.identify.first_baseline import with_first_baseline
from truing.recording.run import RecordingSet, Run

DELAY_S, TAU_S, GAIN_MPS, STEP, INTERVAL_S = 0.03, 0.13, 1.0, 0.4, 0.005
# Slow changes of the supply, of which the delay explains nothing.
SAG, SAG_S = 0.02, 1.5


def one_step() -> RecordingSet:
    """A motor on a bench, 3.85 s at 200 Hz."""
    t = np.arange(770) * INTERVAL_S
    effort = np.where(t > 0.2, STEP, 0.0)
    since = np.maximum(t - 0.5 * INTERVAL_S - 0.2 - DELAY_S, 0.0)
    speed = GAIN_MPS * STEP * (1.0 - np.exp(-since / TAU_S)) * (1.0 + SAG * np.exp(-since / SAG_S))
    speed = np.round(speed + 0.004 * np.random.default_rng(1).standard_normal(len(t)), 3)
    columns = {"t_s": t, "effort_left": effort, "effort_right": effort}
    columns |= {"vel_left_mps": speed, "vel_right_mps": speed}
    return RecordingSet("step", (Run("01_step", columns, order=tuple(columns)),))


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return diagnose(with_first_baseline(one_step().of_axis("translation")), Options(jobs=1))


def test_the_part_of_a_run_that_alone_shows_an_effect_is_no_test_of_it() -> None:
    """Left out of the fit, it takes the delay with it: nothing is learned of it from the other parts."""
    data = set_data(with_first_baseline(one_step()))
    stage = initial_fit(data, SetSimulator(data, data.baseline))
    late = Search(stage.problem, {}, jobs=1).with_effect(stage.base, "input_delay")
    unseen = UnseenRuns(stage.problem, stage.base)
    assert unseen.errors(late).wheels > 0.99 * unseen.errors(stage.base).wheels
    assert unseen.benefit(late, stage.base) > 0.05


def test_the_delay_of_a_single_step_is_among_the_explanations(found: Diagnosis) -> None:
    assert found.verdict in ("missing_physics", "ambiguous")
    delay = next(effect for effect in found.effects if effect.name == "input_delay")
    low, high = delay.parameters["delay"].ci95
    assert low <= DELAY_S <= high
    assert found.fit.model_rmse < 0.95 * found.fit.refit_rmse


def test_without_a_baseline_nothing_is_said_of_numbers_as_given(found: Diagnosis) -> None:
    said = "\n".join(line for section in sections(found) for line in section.lines)
    assert "as given" not in said
    assert "m/s instead of" not in said
    assert "on the spot" not in said
    assert "gain and time constant alone" in said
    assert found.verdict != "parameters_only"
