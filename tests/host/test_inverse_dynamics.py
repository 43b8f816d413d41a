"""Efforts that say nothing of the speed, as a speed controller makes them, are found and said."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import truing
from truing.diagnose.present.text import sections
from truing.recording.inverse_dynamics import drowned_damping, regression, wheel_motion
from truing.recording.run import RecordingSet

Array = NDArray[np.float64]
ROW_S, FRICTION, INERTIA, SPEEDS = 0.03, 0.05, 3e-4, (3.0, 15.0, -6.0, 24.0, -15.0)


def held_at_speeds(seed: int, damping: float, scatter: float) -> dict[str, Array]:
    """A motor that a controller holds at one speed after the other."""
    random = np.random.default_rng(seed)
    wanted = np.repeat([0.0, *(level for speed in SPEEDS for level in (speed, 0.0))], 80)
    speed = np.zeros(len(wanted))
    for row in range(1, len(speed)):
        speed[row] = speed[row - 1] + (wanted[row] - speed[row - 1]) * 0.4
    taken = FRICTION * np.sign(speed) * (np.abs(speed) > 0.1) + damping * speed
    effort = taken + INERTIA * np.gradient(speed) / ROW_S
    effort += scatter * random.standard_normal(len(speed)) * (np.abs(speed) > 0.1)
    time = ROW_S * np.arange(len(speed))
    return {"t_s": time, "effort": effort, "vel_radps": speed + 0.03 * random.standard_normal(len(speed))}


def motor(damping: float, scatter: float) -> RecordingSet:
    return truing.read([held_at_speeds(seed, damping, scatter) for seed in range(3)], name="motor")


def test_friction_and_damping_come_out_of_a_controllers_efforts() -> None:
    motion = wheel_motion(motor(2e-3, 0.01), "left")
    assert motion is not None
    _, friction, damping, inertia = regression(motion.terms[motion.moving], motion.effort[motion.moving])
    assert friction == pytest.approx(FRICTION, abs=0.003)
    assert damping == pytest.approx(2e-3, rel=0.1)
    assert inertia == pytest.approx(INERTIA, rel=0.3)


@pytest.mark.parametrize(("damping", "scatter", "tells"), [
    (5e-4, 0.04, False),
    (5e-4, 0.008, True),
    (1e-2, 0.04, True),
])  # fmt: skip
def test_efforts_tell_slow_from_fast_where_damping_is_above_their_scatter(
    damping: float, scatter: float, tells: bool
) -> None:
    found = drowned_damping(motor(damping, scatter), "left")
    assert (found is None) == tells
    if found is not None:
        assert found.scatter == pytest.approx(scatter, rel=0.1)
        assert found.damping == pytest.approx(24.0 * damping, abs=0.006)


def test_one_speed_alone_says_nothing_of_damping() -> None:
    made = held_at_speeds(1, 5e-4, 0.04)
    rows = slice(0, 160)
    assert (
        drowned_damping(truing.read([{key: of[rows] for key, of in made.items()}], name="x"), "left") is None
    )


def test_a_diagnosis_says_that_no_simulation_can_follow_and_what_to_record() -> None:
    found = truing.diagnose(motor(2e-4, 0.05), jobs=1)
    shown = {section.title: " ".join(section.lines) for section in sections(found)}
    assert found.verdict == "unexplained"
    assert "do not distinguish slow from fast motion" in shown["Verdict"]
    assert "Next: record steps of effort without a speed controller" in shown["Verdict"]
    assert "Inspect the places" not in shown["What to do next"]
