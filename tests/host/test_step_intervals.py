"""The intervals of step metrics hold the truth under noise with memory and in counts."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
import scipy

from truing.arrays import FloatArray
from truing.identify.quantity import Quantity
from truing.identify.step_metrics import StepMetrics, step_metrics
from truing.identify.step_noise import window_noise
from truing.recording.run import Run

INTERVAL_S = 0.05
LEVELS = (0.0, 0.35, 0.5, 0.45, 0.0)
GAIN_MPS, TAU_S = 1.45, 0.30
REPEATS = 150


def first_order(t: FloatArray, dead_s: float) -> FloatArray:
    """Travel of a wheel with a dead time, m, exact."""
    travel, speed = np.zeros_like(t), 0.0
    at, position = 0.0, 0.0
    for number, level in enumerate(LEVELS):
        start = (1.0 + 2.0 * (number - 1) + dead_s) if number else 0.0
        end = 1.0 + 2.0 * number + dead_s if number < len(LEVELS) - 1 else t[-1] + 1.0
        target = GAIN_MPS * level
        rows = (t >= start) & (t <= end)
        s = t[rows] - at
        travel[rows] = position + target * s + (speed - target) * TAU_S * (1 - np.exp(-s / TAU_S))
        s_end = end - at
        position += target * s_end + (speed - target) * TAU_S * (1 - np.exp(-s_end / TAU_S))
        speed = target + (speed - target) * np.exp(-s_end / TAU_S)
        at = end
    return travel


@dataclass(frozen=True)
class Noise:
    sigma_mps: float
    memory: float
    count_m: float = 0.0


def made_run(noise: Noise, seed: int, *, dead_s: float = 0.0, overshoot: float = 0.0) -> Run:
    """A run of test XI's levels; `overshoot` adds an excursion of that share of each step."""
    t = INTERVAL_S * np.arange(round((1.0 + 2.0 * (len(LEVELS) - 1)) / INTERVAL_S) + 1)
    rng = np.random.default_rng(seed)
    travel = first_order(t, dead_s)
    speed = np.diff(travel, prepend=0.0) / INTERVAL_S
    if overshoot:
        for number, (before, level) in enumerate(pairwise(LEVELS)):
            after = t - (1.0 + 2.0 * number)
            bump = np.where((after > 0.85) & (after < 1.0), 1.0, 0.0)
            speed += overshoot * GAIN_MPS * (level - before) * bump
    shocks = rng.normal(0.0, noise.sigma_mps * np.sqrt(1 - noise.memory**2), len(t) + 200)
    slow = scipy.signal.lfilter([1.0], [1.0, -noise.memory], shocks)[200:]
    speed = speed + np.where(speed > 1e-3, slow, 0.0)
    if noise.count_m:
        counts = np.floor(np.cumsum(speed * INTERVAL_S) / noise.count_m + rng.uniform())
        speed = np.diff(counts, prepend=counts[0]) * noise.count_m / INTERVAL_S
    effort = np.array([LEVELS[min(max(int(np.ceil((x - 1e-9 - 1.0) / 2.0)), 0), 4)] for x in t])
    columns = {"t_s": t, "effort_left": effort, "effort_right": effort}
    columns |= {"vel_left_mps": speed, "vel_right_mps": speed}
    columns |= {"cmd_left": effort.copy(), "cmd_right": effort.copy()}
    return Run("01_made", columns, tuple(["effort"] * len(t)), {}, tuple(columns))


def measured(noise: Noise, seed: int, **kinds: float) -> tuple[StepMetrics, ...]:
    steps, reason = step_metrics(made_run(noise, seed, **kinds), "left")
    assert reason is None
    assert len(steps) == 4
    return steps


def covers(quantity: Quantity, truth: float) -> bool | None:
    if quantity.value is None or quantity.ci95 is None:
        return None
    return quantity.ci95[0] <= truth <= quantity.ci95[1]


def spread_of_window(noise: Noise) -> float:
    """Root of the expected variance of 16 rows about their line, m/s."""
    rows = np.arange(16)
    correlation = noise.memory ** np.abs(rows[:, None] - rows)
    q, _ = np.linalg.qr(np.column_stack((np.ones(16), rows)))
    return noise.sigma_mps * float(np.sqrt(np.trace((np.eye(16) - q @ q.T) @ correlation) / 14))


SILENT = Noise(0.0, 0.0)
NOISES = {
    "white": Noise(0.006, 0.0),
    "with memory": Noise(0.006, 0.5),
    "slow": Noise(0.006, 0.8),
    "counts": Noise(0.003, 0.3, 0.399 / 2400),
    "coarse counts": Noise(0.0, 0.0, 0.399 / 300),
}


@pytest.mark.parametrize("kind", NOISES)
def test_intervals_hold_the_truth_nineteen_times_in_twenty(kind: str) -> None:
    """The gain's truth is what the window reads without noise; the times are the robot's own."""
    dead = 0.06
    clean = measured(SILENT, 0, dead_s=dead)
    held: dict[str, list[bool]] = {"gain": [], "time constant": [], "dead time": [], "ripple": []}
    widths: dict[str, list[float]] = {name: [] for name in held}
    for seed in range(REPEATS):
        for step, truth in zip(measured(NOISES[kind], seed, dead_s=dead), clean, strict=True):
            found = {"time constant": (step.time_constant, TAU_S + dead), "dead time": (step.dead_time, dead)}
            if step.input != 0.0:
                assert truth.gain.value is not None
                found["gain"] = (step.gain, truth.gain.value)
                if NOISES[kind].sigma_mps and not NOISES[kind].count_m:
                    found["ripple"] = (step.ripple, 1000.0 * spread_of_window(NOISES[kind]))
            for name, (quantity, value) in found.items():
                inside = covers(quantity, value)
                if inside is not None:
                    held[name].append(inside)
                    assert quantity.ci95 is not None
                    widths[name].append(quantity.ci95[1] - quantity.ci95[0])
    for name, hits in held.items():
        if hits:
            width = np.median(widths[name])
            print(f"{kind:14s} {name:14s} {np.mean(hits):.3f} of {len(hits)}, width {width:.4f}")
    for name, hits in held.items():
        if hits:
            assert np.mean(hits) >= 0.93, name


def test_an_overshoot_is_found_with_its_size_and_its_absence_too() -> None:
    noise = Noise(0.004, 0.4)
    inside, absent = [], []
    for seed in range(REPEATS):
        for step in measured(noise, seed, overshoot=0.30):
            first = step.overshoot if step.direction == "up" else step.undershoot
            # The bump stands on a response that still has a little of its way to go.
            rest = np.exp(-(0.85 + INTERVAL_S) / TAU_S)
            hit = covers(first, 100.0 * (0.30 - rest * 0.8))
            if hit is not None:
                inside.append(hit)
        for step in measured(noise, seed):
            first = step.overshoot if step.direction == "up" else step.undershoot
            if first.value is not None:
                absent.append(first.value == 0.0)
    print(f"overshoot held {np.mean(inside):.3f}, absence seen {np.mean(absent):.3f}")
    assert np.mean(inside) >= 0.93
    assert np.mean(absent) >= 0.93


def test_noise_that_remembers_widens_the_interval_of_a_mean() -> None:
    rng = np.random.default_rng(3)
    deviations = []
    for memory in (0.0, 0.8):
        windows = [
            scipy.signal.lfilter([1.0], [1.0, -memory], rng.normal(0.0, np.sqrt(1 - memory**2), 216))[200:]
            for _ in range(400)
        ]
        noises = [noise for noise in window_noise(windows) if noise is not None]
        deviations.append(float(np.sqrt(np.mean([noise.mean_deviation**2 for noise in noises]))))
        truth = float(np.sqrt(sum(memory ** abs(i - j) for i in range(16) for j in range(16)))) / 16
        print(f"memory {memory}: deviation of a mean {deviations[-1]:.3f}, truth {truth:.3f}")
        assert truth * 0.85 < deviations[-1] < truth * 1.5
    assert deviations[1] > 1.8 * deviations[0]


def test_a_window_of_a_thousand_rows_is_as_quick_and_its_intervals_cover_as_often() -> None:
    rng = np.random.default_rng(4)
    shocks = [rng.normal(0.0, np.sqrt(0.19), 1200) for _ in range(20)]
    windows = [scipy.signal.lfilter([1.0], [1.0, -0.9], row)[200:] for row in shocks]
    means = np.array([window.mean() for window in windows])
    halves = np.array([noise.quantile * noise.mean_deviation for noise in window_noise(windows) if noise])
    assert len(halves) == 20
    assert np.mean(np.abs(means) <= halves) >= 0.85


def test_what_the_log_cannot_show_has_a_reason_and_no_number() -> None:
    clean = measured(SILENT, 0)
    assert clean[-1].gain.value is None
    assert clean[-1].gain.reason == "no gain at zero input"
    for step in clean:
        for quantity in (step.time_constant, step.dead_time, step.overshoot, step.undershoot, step.ripple):
            assert quantity.value is not None or quantity.reason
