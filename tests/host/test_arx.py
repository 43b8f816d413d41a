"""ARX models: equation (37) finds what made the data; orders come from unseen data; errors are named."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from support.synthetic_wheel import Truth, baseline, record, staircase
from truing.errors import IdentifyError
from truing.identify.arx import fit_arx
from truing.identify.model_error import FreeRunError, OneStepError
from truing.identify.simulate import simulate
from truing.model.linear import ArxModel
from truing.recording.run import Run

Array = NDArray[np.float64]

KNOWN = ArxModel(np.array([1.2, -0.35]), np.array([0.02, 0.15, 0.05]), 0.05)


def from_known(seed: int, noise: float = 0.0, rows: int = 300) -> Run:
    rng = np.random.default_rng(seed)
    effort = np.repeat(rng.uniform(-0.6, 0.6, rows // 10 + 1), 10)[:rows]
    speed = np.zeros(rows)
    shocks = noise * rng.normal(size=rows)
    for k in range(2, rows):
        speed[k] = KNOWN.m @ speed[k - 1 : k - 3 if k > 2 else None : -1][:2]
        speed[k] += KNOWN.n @ effort[k - 2 : k + 1][::-1] + shocks[k]
    columns = {"t_s": 0.05 * np.arange(rows)}
    for side in ("left", "right"):
        columns[f"effort_{side}"] = effort
        columns[f"vel_{side}_mps"] = speed
    return Run(f"{seed:02d}", columns)


def plan(levels: tuple[float, ...]) -> list[tuple[float, float]]:
    """A test of the paper: 1 s of rest, 2 s a level, 2 s of rest."""
    return [(0.0, 0.0)] + [(1.0 + 2.0 * k, level) for k, level in enumerate((*levels, 0.0))]


def test_least_squares_finds_the_weights_that_made_the_data() -> None:
    fit = fit_arx([from_known(1), from_known(2)], "left", alpha=2, beta=3)
    np.testing.assert_allclose(fit.model.m, KNOWN.m, atol=1e-9)
    np.testing.assert_allclose(fit.model.n, KNOWN.n, atol=1e-9)
    assert fit.model.gain_mps == pytest.approx(0.22 / 0.15)
    assert fit.one_step.rms_mps < 1e-10
    assert fit.free_run.rms_mps < 1e-9


def test_it_is_equation_37_that_is_solved() -> None:
    run = from_known(3, noise=0.01)
    fit = fit_arx([run], "left", alpha=2, beta=2)
    v, u = run.columns["vel_left_mps"], run.columns["effort_left"]
    omega = np.column_stack((v[1:-1], v[:-2], u[2:], u[1:-1]))
    eta = np.linalg.solve(omega.T @ omega, omega.T @ v[2:])
    np.testing.assert_allclose(np.concatenate((fit.model.m, fit.model.n)), eta, rtol=1e-8)


def test_orders_chosen_by_held_out_error_are_the_ones_that_made_the_data() -> None:
    fit = fit_arx([from_known(seed, noise=0.004) for seed in range(5)], "left")
    assert (len(fit.model.m), len(fit.model.n)) == (2, 3)
    assert fit.considered[(2, 3)] < fit.considered[(1, 1)]


def test_one_step_error_flatters_and_the_two_errors_are_different_types() -> None:
    truth = Truth(friction=0.06, breakaway=0.06)
    recorded = [record(truth, staircase(k), seed=k, name=str(k), fine_s=5e-4) for k in range(3)]
    fit = fit_arx(recorded, "left", baseline())
    assert isinstance(fit.one_step, OneStepError)
    assert isinstance(fit.free_run, FreeRunError)
    assert not issubclass(OneStepError, FreeRunError)
    assert not issubclass(FreeRunError, OneStepError)
    assert fit.free_run.rms_mps > 1.5 * fit.one_step.rms_mps
    assert fit.to_json()["one_step"]["kind"] == "one_step"
    assert fit.to_json()["free_run_held_out"]["kind"] == "free_run_held_out"


def test_an_effort_model_of_test_xi_carries_over_to_test_xvii() -> None:
    truth = Truth(gain=1.46, tau=0.35, friction=0.01, breakaway=0.01)
    xi = record(truth, plan((0.35, 0.50, 0.45)), seed=11, name="XI", duration_s=9.0)
    xvii = record(truth, plan((0.25, 0.40, 0.30, 0.35, 0.15, 0.60)), seed=17, name="XVII", duration_s=15.0)
    fit = fit_arx([xi], "left", baseline())
    unseen = simulate(fit.model, xvii, "left", baseline())
    assert unseen.error.percent < 5.0


def test_a_run_that_diverges_is_a_large_error_and_not_a_crash() -> None:
    unstable = ArxModel(np.array([1.5]), np.array([1.0]), 0.05)
    assert not unstable.stable
    rows = 400
    rng = np.random.default_rng(0)
    columns = {"t_s": 0.05 * np.arange(rows)}
    for side in ("left", "right"):
        columns[f"vel_{side}_mps"] = rng.normal(size=rows)
        columns[f"effort_{side}"] = rng.normal(size=rows) * 0.1
    fit = fit_arx([Run("noise", columns)], "left")
    assert np.isfinite(fit.held_out_free_run.rms_mps)


def test_a_discrete_model_refuses_a_recording_at_another_rate() -> None:
    run = from_known(1)
    other = Run("other", dict(run.columns) | {"t_s": 0.02 * np.arange(len(run))})
    fit = fit_arx([run], "left", alpha=2, beta=3)
    with pytest.raises(IdentifyError, match=r"every 0\.05 s.*every 0\.02 s"):
        simulate(fit.model, other, "left")


def test_uneven_rows_are_put_on_a_grid_without_losing_travel() -> None:
    truth = Truth(friction=0.0, breakaway=0.0)
    even = record(truth, staircase(3), seed=3, fine_s=5e-4)
    keep = np.ones(len(even), dtype=bool)
    keep[50:250:7] = False
    t, ticks = even.t_s[keep], even.columns["ticks_left"][keep]
    impulse = np.cumsum(even.columns["effort_left"] * 0.05)[keep]
    effort = np.diff(impulse, prepend=0.0) / np.diff(t, prepend=-0.05)
    columns = {"t_s": t}
    for side in ("left", "right"):
        columns[f"ticks_{side}"] = ticks
        columns[f"effort_{side}"] = effort
    fit = fit_arx([Run("uneven", columns)], "left", baseline())
    assert fit.model.interval_s == pytest.approx(0.05)
    assert fit.model.gain_mps == pytest.approx(1.45, rel=0.02)
