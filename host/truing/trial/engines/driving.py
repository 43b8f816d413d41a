"""How a trial's robot is driven: plans drawn for it, and the loop that turns them into efforts."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from truing.arrays import FloatArray
from truing.plan import Kind, Plan, Segment
from truing.trial.engines.engine import TICK_S, Rng
from truing.trial.engines.nominal import NominalRobot

Mode = Literal["effort", "velocity", "mixed"]

# The speed of the velocity loop comes from the counts of so many ticks.
_SPEED_TICKS = 4
# Bandwidth of the loop over that of the wheel, and the integral's share.
_LOOP = 3.0
_REST = Segment(Kind.EFFORT, 0.4, 0.0, 0.0)


class PlanDriver:
    """Efforts of a plan: as commanded, or by a PI loop with feedforward on the encoders' counts."""

    def __init__(self, plan: Plan, nominal: NominalRobot) -> None:
        self.plan = plan
        self._nominal = nominal
        ends = np.cumsum([round(segment.duration_s / TICK_S) for segment in plan.segments])
        self._segment = np.searchsorted(ends, np.arange(int(ends[-1])), side="right")
        self._counts: list[FloatArray] = []
        self._integral = np.zeros(2)

    @property
    def ticks(self) -> int:
        """How many intervals the run has."""
        return len(self._segment)

    def command(self, tick: int) -> tuple[str, float, float]:
        """Mode and command of the interval that begins at this tick."""
        segment = self.plan.segments[self._segment[tick]]
        if segment.kind is Kind.EFFORT:
            return "effort", segment.a, segment.b
        if segment.kind is Kind.VELOCITY:
            return "velocity", segment.a, segment.b
        turn = 0.5 * segment.b * self._nominal.wheelbase_m
        return "velocity", segment.a - turn, segment.a + turn

    def efforts(self, tick: int, angles_rad: FloatArray) -> tuple[float, float]:
        """Efforts of the interval that begins at this tick."""
        if tick == 0:
            self._counts.clear()
            self._integral[:] = 0.0
        per_rad = self._nominal.counts_per_rev / (2.0 * math.pi)
        self._counts.append(np.floor(angles_rad * per_rad))
        mode, left, right = self.command(tick)
        if mode == "effort":
            self._integral[:] = 0.0
            return left, right
        return self._closed_loop(np.array([left, right]))

    def _closed_loop(self, wanted: FloatArray) -> tuple[float, float]:
        nominal = self._nominal
        gain, constant = np.array(nominal.gain_mps), np.array(nominal.time_constant_s)
        back = min(_SPEED_TICKS, len(self._counts) - 1)
        speed = np.zeros(2)
        if back:
            moved = self._counts[-1] - self._counts[-1 - back]
            speed = moved * nominal.metres_per_count / (back * TICK_S)
        missing = wanted - speed
        proportional = (_LOOP - 1.0) / gain
        effort = wanted / gain + proportional * missing + self._integral
        held = np.clip(effort, -1.0, 1.0)
        # No integration while the effort is at its limit (anti-windup).
        grows = held == effort
        self._integral += np.where(grows, proportional * missing * TICK_S / constant, 0.0)
        return float(held[0]), float(held[1])


def draw_plans(rng: Rng, nominal: NominalRobot, mode: Mode) -> tuple[Plan, ...]:
    """Eight runs of about six seconds: what an engineer drives who wants to know a robot."""
    kinds = {"effort": "EEEEEEEE", "velocity": "VVVVVVVV", "mixed": "EVEVEVEV"}[mode]
    drawn = (
        ("steps", _steps),
        ("reversals", _reversals),
        ("ramps", _ramps),
        ("turns", _turns),
        ("one_wheel", _one_wheel),
        ("headings", _headings),
        ("creeping", _creeping),
        ("random", _random),
    )
    return tuple(
        _plan(f"{number:02d}_{name}", make(rng), nominal, closed=kind == "V")
        for number, ((name, make), kind) in enumerate(zip(drawn, kinds, strict=True), 1)
    )


Levels = list[tuple[float, float, float]]


def _plan(name: str, levels: Levels, nominal: NominalRobot, *, closed: bool) -> Plan:
    segments = [_REST]
    for seconds, left, right in levels:
        duration = round(seconds / 0.05) * 0.05
        if closed:
            left, right = (0.8 * u * g for u, g in zip((left, right), nominal.gain_mps, strict=True))
            segments.append(Segment(Kind.VELOCITY, duration, round(left, 4), round(right, 4)))
        else:
            segments.append(Segment(Kind.EFFORT, duration, round(left, 3), round(right, 3)))
    return Plan(name, name.split("_", 1)[1].replace("_", " "), tuple(segments))


def _steps(rng: Rng) -> Levels:
    levels = rng.permutation([0.25, 0.5, 0.85]) * rng.uniform(0.9, 1.1)
    return [piece for u in levels for piece in ((1.3, float(u), float(u)), (0.6, 0.0, 0.0))]


def _reversals(rng: Rng) -> Levels:
    high, low = float(rng.uniform(0.7, 0.9)), float(rng.uniform(0.25, 0.45))
    return [(1.0, u, u) for u in (high, -high, high, -low, low)] + [(0.6, 0.0, 0.0)]


def _ramps(rng: Rng) -> Levels:
    top = float(rng.uniform(0.5, 0.8))
    up = [top * k / 10.0 for k in range(1, 11)]
    return [(0.25, u, u) for u in (*up, *up[::-1])] + [(0.5, 0.0, 0.0)]


def _turns(rng: Rng) -> Levels:
    u, v = float(rng.uniform(0.3, 0.5)), float(rng.uniform(0.5, 0.7))
    return [(1.2, u, -u), (0.5, 0.0, 0.0), (1.2, -v, v), (0.5, 0.0, 0.0), (1.2, u, u), (0.6, 0.0, 0.0)]


def _one_wheel(rng: Rng) -> Levels:
    u = float(rng.uniform(0.4, 0.7))
    return [(1.2, u, 0.0), (0.6, 0.0, 0.0), (1.2, 0.0, u), (0.6, 0.0, 0.0), (1.0, -u, 0.0), (0.6, 0.0, 0.0)]


def _headings(rng: Rng) -> Levels:
    u, turn = float(rng.uniform(0.4, 0.6)), float(rng.uniform(0.25, 0.4))
    out: Levels = []
    for _ in range(3):
        out += [(0.8, u, u), (0.7, -u, -u), (0.4, turn, -turn)]
    return [*out, (0.4, 0.0, 0.0)]


def _creeping(rng: Rng) -> Levels:
    levels = rng.uniform(0.06, 0.22, 4) * np.array([1.0, -1.0, 1.0, -1.0])
    return [piece for u in levels for piece in ((1.1, float(u), float(u)), (0.35, 0.0, 0.0))]


def _random(rng: Rng) -> Levels:
    out: Levels = []
    while sum(piece[0] for piece in out) < 5.5:
        left, right = (float(u) for u in rng.uniform(-0.8, 0.8, 2))
        out.append((float(rng.uniform(0.25, 1.2)), left, left if rng.random() < 0.5 else right))
    return [*out, (0.5, 0.0, 0.0)]
