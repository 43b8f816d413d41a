"""A wheel integrated in tiny steps under ramps and steps, as the peers of `truing real` get it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truing.studies.real.peers.wheel_runs import WheelRun

TINY_S, ROW_S = 2e-4, 0.02


@dataclass(frozen=True)
class Truth:
    """Gain in m/s per unit effort, times in s, friction in effort; `noise` in m/s."""

    gain: float = 3.0
    tau: float = 0.25
    friction: float = 0.0
    delay: float = 0.0
    lag: float = 0.0
    reverse_gain: float = 1.0
    reverse_friction: float = 1.0
    noise: float = 0.0


def ramps_and_steps(truth: Truth, seed: int = 1) -> tuple[WheelRun, ...]:
    """What WPILib's SysId records: slow ramps and steps, forwards and backwards, each from rest."""
    draw = np.random.default_rng(seed)
    ramp = np.linspace(0.0, 0.8, round(8.0 / TINY_S))
    step = np.concatenate((np.zeros(round(0.4 / TINY_S)), np.full(round(2.0 / TINY_S), 0.6)))
    efforts = (ramp, -ramp, step, -step)
    return tuple(_record(truth, effort, run, draw) for run, effort in enumerate(efforts))


def levels(truth: Truth, seed: int = 1, runs: int = 4) -> tuple[WheelRun, ...]:
    """Random levels with reversals and rests, each run from rest."""
    draw = np.random.default_rng(seed)
    out = []
    for run in range(runs):
        heights = np.concatenate(([0.0], draw.uniform(-0.8, 0.8, 11)))
        heights[draw.integers(2, 12, 2)] = 0.0
        out.append(_record(truth, np.repeat(heights, round(0.7 / TINY_S)), run, draw))
    return tuple(out)


def _record(truth: Truth, command: np.ndarray, run: int, draw: np.random.Generator) -> WheelRun:
    """Explicit Euler steps; the log holds the mean effort of each row and the speed at its end."""
    # Rows hold their effort: what lies between them would be another subject.
    rows = round(ROW_S / TINY_S)
    count = len(command) // rows
    effort = np.repeat(command[: count * rows].reshape(count, rows).mean(axis=1), rows)
    late = round(truth.delay / TINY_S)
    delayed = np.concatenate((np.zeros(late), effort))[: len(effort)]
    speed, shown = 0.0, 0.0
    out = np.empty(len(effort))
    for k, u in enumerate(delayed):
        forward = speed > 0.0 or (speed == 0.0 and u > 0.0)
        gain = truth.gain * (1.0 if forward else truth.reverse_gain)
        friction = truth.friction * (1.0 if forward else truth.reverse_friction)
        free = speed + TINY_S / truth.tau * (gain * u - speed)
        hold = TINY_S / truth.tau * gain * friction
        after = np.sign(free) * max(abs(free) - hold, 0.0)
        speed = 0.0 if speed * after < 0.0 else float(after)
        shown = speed if truth.lag == 0.0 else shown + TINY_S / truth.lag * (speed - shown)
        out[k] = shown
    t_s = ROW_S * np.arange(count + 1)
    measured = np.concatenate(([0.0], out[rows - 1 :: rows])) + truth.noise * draw.normal(size=count + 1)
    judged = np.arange(count + 1) > 0
    return WheelRun(run, t_s, np.concatenate(([0.0], effort[::rows])), measured, judged, 0.0)
