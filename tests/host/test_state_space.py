"""State-space models: the subspace fit finds poles, gain and order, in the form of the paper's (39)."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from support.synthetic_wheel import Truth, baseline, record, staircase
from truing.errors import IdentifyError
from truing.identify.simulate import simulate
from truing.identify.state_space import fit_state_space
from truing.model.linear import StateSpaceModel
from truing.recording.run import Run

Array = NDArray[np.float64]

# As printed in the paper; (40) repeats A and B of (39).
A = np.array([[0.7592, 0.1390], [-0.4384, -0.0198]])
B = np.array([0.00121, 0.01456])
PAPER_39 = StateSpaceModel(A, B, np.array([1457.0, -120.0]), np.array([0.0002655, 0.0000078]), 0.05)
PAPER_40 = StateSpaceModel(A, B, np.array([976.1, -125.7]), np.array([0.0002091, -0.0002883]), 0.05)


def from_known(model: StateSpaceModel, seed: int, noise: float = 0.0, rows: int = 400) -> Run:
    rng = np.random.default_rng(seed)
    effort = np.repeat(rng.uniform(-0.6, 0.6, rows // 8 + 1), 8)[:rows]
    speed = model.simulate(effort, np.zeros(model.order)) + noise * rng.normal(size=rows)
    columns = {"t_s": 0.05 * np.arange(rows)}
    for side in ("left", "right"):
        columns[f"effort_{side}"] = effort
        columns[f"vel_{side}_mps"] = speed
    return Run(f"{seed:02d}", columns)


def test_the_printed_39_has_the_gain_of_the_papers_tables_and_the_printed_40_has_not() -> None:
    # Effort in per cent and speed in mm/s: Table IV has 14.1 to 14.8 for effort, 1.0 to 1.1 for velocity.
    assert PAPER_39.gain_mps == pytest.approx(14.3, abs=0.1)
    assert PAPER_40.gain_mps == pytest.approx(9.15, abs=0.05)


def test_poles_and_gain_come_back_from_noise_free_data_exactly() -> None:
    fit = fit_state_space([from_known(PAPER_39, 1), from_known(PAPER_39, 2)], "left", order=2)
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(fit.model.a)), np.sort_complex(np.linalg.eigvals(A)), atol=1e-6
    )
    assert fit.model.gain_mps == pytest.approx(PAPER_39.gain_mps, rel=1e-6)
    assert fit.free_run.percent < 1e-4


def test_the_order_that_made_the_data_is_chosen_on_unseen_data() -> None:
    fit = fit_state_space([from_known(PAPER_39, seed, noise=0.05) for seed in range(4)], "left")
    assert fit.model.order == 2
    assert fit.considered[2] < 0.9 * fit.considered[1]
    assert fit.singular_values[1] > 5.0 * fit.singular_values[2]
    assert fit.model.stable


def test_measured_speeds_help_a_prediction_through_k_and_not_a_simulation() -> None:
    truth = Truth(friction=0.0, breakaway=0.0, disturbance=0.03, disturbance_memory_s=0.5)
    recorded = [record(truth, staircase(k), seed=k, name=str(k), fine_s=5e-4) for k in range(4)]
    fit = fit_state_space(recorded, "left", baseline())
    assert np.any(fit.model.k != 0.0)
    assert fit.held_out_one_step.rms_mps < 0.6 * fit.held_out_free_run.rms_mps
    silenced = fit.model.simulate(np.full(50, 0.3), np.zeros(fit.model.order))
    assert silenced[0] == 0.0  # y(t) = C x(t) + 0 u(t)


def test_a_state_space_model_simulates_a_run_it_never_saw() -> None:
    recorded = [from_known(PAPER_39, seed, noise=0.02) for seed in range(3)]
    fit = fit_state_space(recorded[:2], "left", order=2)
    unseen = simulate(fit.model, recorded[2], "left")
    assert unseen.error.rms_mps < 0.03


def test_too_little_data_or_a_silly_order_is_refused() -> None:
    short = from_known(PAPER_39, 1, rows=25)
    with pytest.raises(IdentifyError, match="rows or more"):
        fit_state_space([short], "left")
    with pytest.raises(IdentifyError, match="order of a state-space model"):
        fit_state_space([from_known(PAPER_39, 1)], "left", order=0)
