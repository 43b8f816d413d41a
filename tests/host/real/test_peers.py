"""Each method that `truing real` compares with finds the numbers of a wheel that is known."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from support.driven_wheel import Truth, levels, ramps_and_steps
from truing.errors import LibraryMissingError, PeerFailedError
from truing.studies.real.left_out import score
from truing.studies.real.peers.catalogue import LADDER, PEERS
from truing.studies.real.peers.first_order_wheel import NUMBERS, FirstOrderWheel
from truing.studies.real.peers.peer import Peer, WheelModel
from truing.studies.real.peers.wheel_runs import WheelRun, even_run
from truing.studies.real.row_set import RowSet

BY_NAME = {peer.name: peer for peer in PEERS}
Runs = tuple[WheelRun, ...]


def installed(name: str) -> Peer:
    peer = BY_NAME[name]
    if not peer.is_installed:
        pytest.skip(f"{peer.library} is not installed (./run setup peers)")
    return peer


def rms(model: WheelModel, runs: Runs) -> float:
    """Free-run error, per cent of top speed."""
    errors = np.concatenate([model.simulate(run) - run.speed_mps for run in runs])
    top = max(float(np.abs(run.speed_mps).max()) for run in runs)
    return float(100.0 * np.sqrt(np.mean(errors**2)) / top)


def climbed(runs: Runs) -> dict[str, FirstOrderWheel]:
    """The whole ladder, each rung from the one before."""
    models: dict[str, FirstOrderWheel] = {}
    for name in LADDER:
        found = BY_NAME[name].fit(runs, models.get(BY_NAME[name].starts_from))
        assert isinstance(found, FirstOrderWheel)
        models[name] = found
    return models


def numbers(model: FirstOrderWheel) -> dict[str, float]:
    return dict(zip(NUMBERS, model.numbers.tolist(), strict=True))


@pytest.mark.parametrize(
    "truth",
    [
        Truth(),
        Truth(friction=0.08, reverse_gain=0.9, reverse_friction=1.3),
        Truth(friction=0.05, delay=0.047, lag=0.09),
        Truth(friction=0.05, lag=0.25),
    ],
)
def test_the_closed_form_is_the_wheel_integrated_in_tiny_steps(truth: Truth) -> None:
    known = [truth.gain, truth.gain * truth.reverse_gain, truth.tau, truth.friction]
    known += [truth.friction * truth.reverse_friction, truth.delay, truth.lag]
    assert rms(FirstOrderWheel(np.array(known)), levels(truth)) < 0.1


def test_the_ladder_finds_friction_delay_filter_and_directions_again() -> None:
    truth = Truth(friction=0.06, delay=0.05, lag=0.12, reverse_gain=0.93, reverse_friction=1.4, noise=0.01)
    models = climbed(levels(truth))
    found = numbers(models["directions"])
    assert found["gain_forward"] == pytest.approx(truth.gain, rel=0.01)
    assert found["gain_reverse"] == pytest.approx(0.93 * truth.gain, rel=0.01)
    assert found["tau"] == pytest.approx(truth.tau, rel=0.1)
    assert found["friction_forward"] == pytest.approx(0.06, abs=0.004)
    assert found["friction_reverse"] == pytest.approx(0.084, abs=0.004)
    assert found["delay"] == pytest.approx(0.05, abs=0.01)
    assert found["lag"] == pytest.approx(0.12, abs=0.02)


def test_no_rung_fits_worse_than_the_one_below() -> None:
    runs = ramps_and_steps(Truth(friction=0.04, delay=0.03, noise=0.02))
    errors = [rms(model, runs) for model in climbed(runs).values()]
    assert all(after <= 1.0001 * before for before, after in pairwise(errors))
    assert errors[2] < 0.5 * errors[0]


def test_a_rung_refitted_near_its_own_fit_stays_there() -> None:
    runs = levels(Truth(friction=0.06, noise=0.01))
    models = climbed(runs)
    again = BY_NAME["friction"].fit(runs, models["friction"])
    assert isinstance(again, FirstOrderWheel)
    assert again.numbers == pytest.approx(models["friction"].numbers, rel=1e-3, abs=1e-4)


def test_a_wheel_that_is_never_driven_stands_still() -> None:
    runs = levels(Truth())
    dead = tuple(replace(run, effort=0.0 * run.effort) for run in runs)
    model = BY_NAME["linear"].fit(dead, None)
    assert all(np.all(model.simulate(run) == 0.0) for run in runs)
    again = BY_NAME["linear"].fit(runs, model)
    assert rms(again, runs) < 0.5


def test_sysids_regression_finds_ks_kv_and_ka_of_a_wheel_without_delay() -> None:
    truth = Truth(gain=4.0, tau=0.4, friction=0.05, noise=0.002)
    model = BY_NAME["sysid"].fit(ramps_and_steps(truth), None)
    assert isinstance(model, FirstOrderWheel)
    found = numbers(model)
    assert found["gain_forward"] == pytest.approx(4.0, rel=0.02)
    assert found["friction_forward"] == pytest.approx(0.05, abs=0.005)
    assert found["tau"] == pytest.approx(0.4, rel=0.08)


def test_sysids_regression_refuses_a_wheel_that_never_moves() -> None:
    runs = tuple(replace(run, speed_mps=0.0 * run.speed_mps) for run in ramps_and_steps(Truth()))
    with pytest.raises(PeerFailedError):
        BY_NAME["sysid"].fit(runs, None)


@pytest.mark.parametrize("name", ["arx", "n4sid"])
def test_a_discrete_model_simulates_a_linear_wheel_that_is_late(name: str) -> None:
    peer = installed(name)
    truth = Truth(delay=0.04, noise=0.003)
    model = peer.fit(levels(truth), None)
    assert rms(model, levels(replace(truth, noise=0.0), seed=7)) < 1.5


@pytest.mark.parametrize("name", ["arx", "n4sid"])
def test_a_discrete_model_keeps_its_order_when_it_is_refitted(name: str) -> None:
    peer = installed(name)
    runs = levels(Truth(delay=0.04, noise=0.003))
    first = peer.fit(runs, None)
    second = peer.fit(runs[1:], first)
    for part in ("inputs", "b"):
        if hasattr(first, part):
            assert np.count_nonzero(getattr(first, part)) == np.count_nonzero(getattr(second, part))
    assert rms(second, runs) == pytest.approx(rms(first, runs), abs=1.0)


def test_sindy_finds_gain_and_friction_again() -> None:
    peer = installed("sindy")
    truth = Truth(friction=0.08, noise=0.003)
    model = peer.fit(levels(truth), None)
    _, speed, effort, *_, friction = (float(value) for value in model.coefficients)  # type: ignore[attr-defined]
    top = model.top_mps  # type: ignore[attr-defined]
    assert -top * effort / speed == pytest.approx(truth.gain, rel=0.1)
    assert -friction / effort == pytest.approx(truth.friction, abs=0.02)
    assert rms(model, levels(replace(truth, noise=0.0), seed=7)) < 4.0


def test_a_missing_library_is_named_with_the_way_to_install_it() -> None:
    peer = Peer("other", "Other method", BY_NAME["sysid"].fit, module="no_such_module", library="no-such")
    with pytest.raises(LibraryMissingError) as caught:
        peer.require()
    assert "no-such" in caught.value.message
    assert "./run setup peers" in caught.value.next_step


def test_a_left_out_run_is_never_fitted() -> None:
    seen: list[set[int]] = []

    def fit(runs: object, near: WheelModel | None) -> WheelModel:
        del near
        assert isinstance(runs, list | tuple)
        seen.append({run.run for run in runs})
        return FirstOrderWheel(np.array([1.0, 1.0, 0.1, 0.0, 0.0, 0.0, 0.0]))

    runs = ramps_and_steps(Truth())
    score(Peer("spy", "spy", fit), RowSet((runs, runs), (0, 1, 2, 0), 1.0), {})
    assert seen == [{0, 1, 2, 3}] * 2 + [{1, 2}, {0, 2, 3}, {0, 1, 3}] * 2


def test_a_method_that_fails_says_why_and_has_no_error() -> None:
    def fail(runs: object, near: object) -> WheelModel:
        raise PeerFailedError("no rows")

    runs = ramps_and_steps(Truth())
    found, models = score(Peer("none", "none", fail), RowSet((runs, runs), (0, 1, 0, 1), 1.0), {})
    assert math.isnan(found.fitted)
    assert math.isnan(found.left_out)
    assert found.why == "no rows"
    assert models == ()


def test_an_error_counts_for_as_long_as_its_measurement_stands() -> None:
    t_s = 0.02 * np.arange(6)
    judged = np.array([False, True, False, False, True, True])
    run = WheelRun(0, t_s, 0.0 * t_s, 0.0 * t_s, judged, 0.0)
    errors = run.judge(np.arange(6.0))
    assert errors[:, 0].tolist() == [1.0, 4.0, 5.0]
    assert errors[:, 1] == pytest.approx([0.06, 0.02, 0.02])
    expected = 100.0 * math.sqrt((3.0 * 1.0 + 16.0 + 25.0) / 5.0)
    assert RowSet(((run,), (run,)), (0,), 1.0).percent([errors]) == pytest.approx(expected)


def test_even_times_conserve_the_effort() -> None:
    run = ramps_and_steps(Truth())[0]
    uneven = np.sort(np.random.default_rng(3).choice(np.arange(1, len(run)), len(run) // 2, replace=False))
    keep = np.concatenate(([0], uneven))
    impulse = np.concatenate(([0.0], np.cumsum(run.effort[1:] * np.diff(run.t_s))))[keep]
    effort = np.concatenate(([0.0], np.diff(impulse) / np.diff(run.t_s[keep])))
    thin = WheelRun(0, run.t_s[keep], effort, run.speed_mps[keep], run.judged[keep], 0.0)
    even = even_run(thin, 0.05)
    assert np.diff(even.t_s) == pytest.approx(0.05)
    end = np.interp(even.t_s[-1], thin.t_s, impulse)
    assert float(np.sum(even.effort[1:]) * 0.05) == pytest.approx(end, rel=1e-6)
