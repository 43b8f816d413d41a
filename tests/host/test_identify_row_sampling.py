"""Identification of speeds that were read at the rows' times instead of averaged over them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from support import recorded_sets
from support.read_speeds import FRICTION, NOISE_MPS, recorded
from truing.identify.identification import identify_set
from truing.identify.model_ladder import fit_models
from truing.identify.row_sampling import SAID, with_row_sampling
from truing.identify.simulate import simulate


@pytest.mark.parametrize("instant", [True, False], ids=["read", "averaged"])
def test_a_fit_finds_the_robot_however_its_speeds_were_read(instant: bool) -> None:
    """Half a row of 50 ms was taken from the time constant, or given to it."""
    found = fit_models(recorded(instant=instant))
    assert (SAID in found.notes) == instant
    for models in found.wheels:
        physics = models.chosen.physics
        assert physics.gain_mps == pytest.approx(recorded_sets.GAIN_MPS, rel=0.005)
        assert physics.time_constant_s == pytest.approx(recorded_sets.TAU_S, rel=0.005)
        assert physics.friction == pytest.approx(FRICTION, rel=0.02)
        assert physics.delay_s < 0.002
        assert models.chosen.free_run.rms_mps == pytest.approx(NOISE_MPS, rel=0.1)


def test_both_readings_give_one_time_constant_and_one_says_so() -> None:
    read, averaged = (identify_set(recorded(instant=instant)) for instant in (True, False))
    for one, other in zip(read.fits[:2], averaged.fits[:2], strict=True):
        assert one.time_constant.value == pytest.approx(other.time_constant.value, rel=0.005)
    assert SAID in [finding.text for finding in read.findings]
    assert SAID not in [finding.text for finding in averaged.findings]


def test_steps_of_read_speeds_are_timed_at_their_rows() -> None:
    both = [identify_set(recorded(instant=instant)).runs[0].left.steps for instant in (True, False)]
    times = [[step.time_constant.value for step in steps] for steps in both]
    known = [pair for pair in zip(*times, strict=True) if None not in pair]
    assert len(known) >= 3
    assert np.median([one - other for one, other in known]) == pytest.approx(0.0, abs=0.005)


def test_positions_beside_the_speeds_leave_nothing_to_find_out() -> None:
    speeds = recorded(instant=True)
    with_positions = []
    for run in speeds:
        travels = {
            f"pos_{side}_m": 0.05 * np.cumsum(run.columns[f"vel_{side}_mps"]) for side in ("left", "right")
        }
        with_positions.append(replace(run, columns=run.columns | travels))
    assert not any(run.instant for run in with_row_sampling(replace(speeds, runs=tuple(with_positions))))
    assert all(run.instant for run in with_row_sampling(speeds))


def test_a_simulation_gives_read_speeds_at_their_times() -> None:
    read = with_row_sampling(recorded(instant=True))
    model = fit_models(read).robot_model()
    assert simulate(model, read.runs, "left").error.rms_mps == pytest.approx(NOISE_MPS, rel=0.1)
    averaged = [replace(run, instant=False) for run in read]
    assert simulate(model, averaged, "left").error.rms_mps > 2.0 * NOISE_MPS
