"""Logs faster than a wheel: a search needs fewer rows, and ends where all of them say."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from truing.identify import output_error
from truing.identify.grey_box import fit_wheel
from truing.identify.output_error import fit_physics
from truing.identify.signals import SEARCH_SPACING_S, WheelSignal, thinned, wheel_signal
from truing.identify.structures import structure
from truing.recording.run import Run

Array = NDArray[np.float64]


def logged(interval_s: float, seed: int, seconds: float = 5.0) -> Run:
    """A wheel of gain 1.5 m/s and time constant 0.2 s with dry friction, with a gap in the log."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, interval_s)
    effort = np.zeros(len(t))
    for begin in np.arange(0.2, seconds - 0.7, 0.8):
        effort[(t > begin) & (t <= begin + 0.5)] = rng.uniform(-0.8, 0.8)
    v, speed = 0.0, np.zeros(len(t))
    for row, u in enumerate(effort):
        free = v + interval_s * (1.5 * u - v) / 0.2
        v = float(np.sign(free) * max(abs(free) - interval_s * 1.5 * 0.05 / 0.2, 0.0))
        speed[row] = v
    speed += 0.004 * rng.standard_normal(len(t))
    keep = (t < 2.0) | (t > 2.3)
    columns = {"t_s": t[keep]}
    for side in ("left", "right"):
        columns |= {f"effort_{side}": effort[keep], f"vel_{side}_mps": speed[keep]}
    return Run(f"{seed:02d}", columns, order=tuple(columns))


@pytest.fixture(scope="module")
def fast() -> WheelSignal:
    return wheel_signal([logged(0.001, seed) for seed in range(3)], "left")


def impulses(signal: WheelSignal, values: Array) -> list[float]:
    """What values (n,) sum up to over each segment's time."""
    t = signal.excitation.t_s
    return [float(values[a + 1 : b] @ np.diff(t[a:b])) for a, b in pairwise(signal.excitation.starts)]


def test_rows_that_are_put_together_keep_what_efforts_and_speeds_sum_up_to(fast: WheelSignal) -> None:
    fewer = thinned(fast)
    assert fewer is not None
    assert len(fewer) < len(fast) / 7
    assert fewer.excitation.segments == fast.excitation.segments == 6
    for one, other in ((fast.speed_mps, fewer.speed_mps), (fast.excitation.effort, fewer.excitation.effort)):
        assert impulses(fewer, other) == pytest.approx(impulses(fast, one), abs=1e-9)
    for (a, b), (c, d) in zip(
        pairwise(fast.excitation.starts), pairwise(fewer.excitation.starts), strict=True
    ):
        assert fewer.excitation.t_s[[c, d - 1]] == pytest.approx(fast.excitation.t_s[[a, b - 1]])
        assert fewer.speed_mps[c] == fast.speed_mps[a], "the first row gives the initial speed"


def test_a_log_of_a_usual_rate_stays_as_it_is() -> None:
    assert thinned(wheel_signal([logged(0.005, 1)], "left")) is None
    assert thinned(wheel_signal([logged(0.002, 1)], "left")) is not None
    assert SEARCH_SPACING_S < 0.01


@pytest.mark.parametrize("name", ["friction", "stribeck"])
def test_all_rows_say_where_the_search_ends(
    name: str, fast: WheelSignal, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = [logged(0.001, seed) for seed in range(3)]
    found = fit_wheel(runs, "left", name, hold_out=False, intervals=False)
    rows: list[int] = []
    original = output_error.simulate_physics

    def counted(values: Array, excitation: object, initial: Array) -> object:
        rows.append(len(excitation.t_s))  # type: ignore[attr-defined]
        return original(values, excitation, initial)  # type: ignore[arg-type]

    monkeypatch.setattr(output_error, "thinned", lambda signal: None)
    monkeypatch.setattr(output_error, "simulate_physics", counted)
    whole = fit_wheel(runs, "left", name, hold_out=False, intervals=False)
    slow = sum(rows)
    assert found.search.minimum.cost < (1.0 + 1e-5) * whole.search.minimum.cost
    if name == "friction":
        # Breakaway friction is not in these runs: its numbers are free within the same error.
        assert found.physics.gain_mps == pytest.approx(whole.physics.gain_mps, rel=1e-3)
        assert found.physics.friction == pytest.approx(whole.physics.friction, abs=1e-3)
    monkeypatch.undo()
    rows.clear()
    monkeypatch.setattr(output_error, "simulate_physics", counted)
    fit_wheel(runs, "left", name, hold_out=False, intervals=False)
    assert sum(rows) < 0.6 * slow


def test_the_fit_itself_keeps_every_row(fast: WheelSignal) -> None:
    found = fit_physics(fast, structure("friction"))
    assert len(found.predicted_mps) == len(fast)
