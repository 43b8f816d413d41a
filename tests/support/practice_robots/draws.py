"""A practice robot drawn from seeds: machine, disturbance, baseline and what its log shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import scipy
from numpy.random import Generator
from numpy.typing import NDArray

from support.practice_robots.physics import Physics, healthy
from support.practice_robots.plans import PlanKind, draw_plan
from support.practice_robots.recorder import Layout, disturbance
from support.practice_robots.strength import Experiment

Array: TypeAlias = NDArray[np.float64]
Signals: TypeAlias = Literal["own", "ticks", "pos", "vel", "filtered", "filtered_beside_ticks"]

COUNTS = (64, 128, 256, 360, 512, 1000, 1440, 2048, 2400, 2400, 4096, 5000)


def _log_uniform(rng: Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


@dataclass(frozen=True)
class Machine:
    """A healthy robot and its first-order numbers."""

    physics: Physics
    gain: Array
    time_constant: Array


def draw_machine(
    rng: Generator, *, sides_equal: bool, viscous: tuple[float, float] = (0.05, 0.35)
) -> Machine:
    """A robot somewhere between a palm and a wheelchair; `viscous` bounds viscous torque over back-EMF."""
    radius = _log_uniform(rng, 0.03, 0.1)
    spread = 0.0 if sides_equal else 1.0
    gain = _log_uniform(rng, 0.6, 2.0) * (1 + spread * rng.uniform(-0.06, 0.06, 2))
    tau = _log_uniform(rng, 0.1, 0.55) * (1 + spread * rng.uniform(-0.1, 0.1, 2))
    viscous_share = rng.uniform(*viscous) * (1 + spread * rng.uniform(-0.1, 0.1, 2))
    rotor_share = np.full(2, rng.uniform(0.1, 0.4))
    physics = healthy(
        radius=radius,
        wheelbase=radius * rng.uniform(3.0, 5.5),
        gain=gain,
        time_constant=tau,
        viscous_share=viscous_share,
        rotor_share=rotor_share,
        mass=_log_uniform(rng, 0.8, 10.0),
        counts_per_rev=float(rng.choice(COUNTS)),
        electric_s=float(rng.uniform(0.7e-4, 1.5e-4)),
    )
    return Machine(physics, gain, tau)


def draw_experiment(
    rng: Generator,
    machine: Machine,
    plan_kind: PlanKind,
    rate_hz: float,
    noise: float | None,
    *,
    sides_equal: bool,
) -> Experiment:
    """The robot on a plan. `noise` is disturbance over quantisation (RMS of speed); drawn where None."""
    layout = Layout.of(draw_plan(plan_kind, rng), rate_hz)
    physics = machine.physics
    counts = float(physics.counts_per_rev[0])
    quantisation = 2 * np.pi * physics.radius / counts / layout.dt_s / np.sqrt(6)
    ratio = _log_uniform(rng, 0.3, 4.0) if noise is None else noise
    speed_noise = float(np.clip(ratio * quantisation, 5e-4, 0.02 * machine.gain.mean()))
    if noise == 0.0:
        speed_noise = 0.0
    memory = np.array([_log_uniform(rng, 0.05, 0.5)] * 2) * rng.uniform(0.8, 1.25, 2)
    passed = np.sqrt(memory / (memory + machine.time_constant))
    size = speed_noise / (machine.gain * passed) * rng.uniform(0.7, 1.4, 2)
    shape = None
    if rng.random() < 0.5:  # from the ground: only while it rolls
        keep = np.exp(-1e-3 / machine.time_constant.mean())
        speed = scipy.signal.lfilter([1 - keep], [1, -keep], layout.effort, axis=0) * machine.gain
        shape = np.abs(speed) / (np.abs(speed) + 0.03)
    torque = disturbance(rng, len(layout.effort), 1.0, memory, shape) * size
    return Experiment(
        healthy=physics,
        layout=layout,
        torque=torque,
        nominal_counts=counts,
        time_constant=machine.time_constant,
        pose_noise_m=_log_uniform(rng, 0.001, 0.004),
        heading_noise_rad=_log_uniform(rng, 0.002, 0.01),
        seed=int(rng.integers(1, 2**31 - 1)),
        sides_equal=sides_equal,
    )


def draw_signals(rng: Generator, *, filtered: bool) -> Signals:
    """Which columns the recorder writes."""
    if filtered:
        return "filtered_beside_ticks" if rng.random() < 0.5 else "filtered"
    kinds: tuple[Signals, ...] = ("own", "ticks", "pos", "vel")
    return kinds[int(rng.choice(4, p=[0.45, 0.2, 0.2, 0.15]))]


def draw_baseline(rng: Generator, machine: Machine, *, exact: bool, sides_equal: bool) -> tuple[Array, Array]:
    """Gains (2,) and time constants (2,) as a user has them: wrong by up to 8 %."""
    off = rng.uniform(-0.08, 0.08, (2, 2))
    if exact:
        off[:] = 0.0
    if sides_equal:
        off[:, 1] = off[:, 0]
    return machine.gain * (1 + off[0]), machine.time_constant * (1 + off[1])
