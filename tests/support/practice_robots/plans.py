"""What the practice robots drive: efforts at 1 kHz, run by run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
PlanKind: TypeAlias = Literal["rich", "thirds", "ordinary"]
PLAN_KINDS: tuple[PlanKind, ...] = get_args(PlanKind)

RUN_MS = 15_000
REST_MS = 600
Piece: TypeAlias = tuple[float, float, float, float, float]  # s, left from, to, right from, to


def _run(pieces: list[Piece], duration_ms: int = RUN_MS) -> Array:
    """Efforts (ms, 2) of linear pieces after a rest, padded with zeros or cut."""
    out = np.zeros((duration_ms, 2))
    at = REST_MS
    for seconds, left0, left1, right0, right1 in pieces:
        length = min(round(seconds * 1000), duration_ms - at)
        if length <= 0:
            break
        share = (np.arange(length) + 0.5) / max(round(seconds * 1000), 1)
        out[at : at + length, 0] = left0 + (left1 - left0) * share
        out[at : at + length, 1] = right0 + (right1 - right0) * share
        at += length
    out[-300:] = 0.0
    return np.clip(out, -1.0, 1.0)


def _hold(seconds: float, left: float, right: float | None = None) -> Piece:
    other = left if right is None else right
    return (seconds, left, left, other, other)


def _ramp(seconds: float, start: float, end: float, turn: float = 1.0) -> Piece:
    return (seconds, start, end, turn * start, turn * end)


def _grid(rng: Generator, low: float, high: float) -> float:
    return float(np.round(rng.uniform(low, high) * 20) / 20)


def _steps(rng: Generator) -> Array:
    levels = rng.permutation(np.array([0.2, 0.35, 0.5, 0.65, 0.8])) + rng.uniform(-0.05, 0.05)
    return _run([piece for u in levels for piece in (_hold(1.6, u), _hold(1.0, 0.0))])


def _reversals(rng: Generator) -> Array:
    pieces = []
    for _ in range(8):
        u = float(rng.uniform(0.12, 0.5))
        pieces += [_hold(_grid(rng, 0.7, 1.1), u), _hold(_grid(rng, 0.7, 1.1), -u)]
    return _run(pieces)


def _full_reversals(rng: Generator) -> Array:
    top = float(rng.uniform(0.85, 1.0))
    return _run(
        [
            *(_hold(2.0, top), _hold(2.0, -top), _hold(1.5, top), _hold(1.5, -top), _hold(1.0, 0)),
            *(_hold(1.5, 0.7), _hold(1.5, -0.7), _hold(1.0, 0.7), _hold(1.2, 0)),
        ]
    )


def _ramps(rng: Generator) -> Array:
    top = float(rng.uniform(0.15, 0.35))
    return _run([_ramp(3.0, 0, top), _ramp(5.5, top, -top), _ramp(3.0, -top, 0), _ramp(2.5, 0, top / 2)])


def _coast_downs(rng: Generator) -> Array:
    pieces = []
    for u in (0.3, -0.45, 0.6, 0.9):
        pieces += [_hold(1.6, u * float(rng.uniform(0.9, 1.1))), _hold(1.9, 0.0)]
    return _run(pieces)


def _staircase(rng: Generator) -> Array:
    sign = float(rng.choice([1.0, 1.0, -1.0]))
    pieces = [_hold(1.15, sign * u) for u in np.linspace(0.1, 1.0, 10)]
    return _run([*pieces, _hold(1.0, sign * 0.6), _hold(1.0, sign * 0.3)])


def _spin(rng: Generator) -> Array:
    pieces = []
    for u in (0.15, -0.25, 0.4, -0.4, 0.6):
        v = u * float(rng.uniform(0.85, 1.1))
        pieces += [_hold(1.6, v, -v), _hold(1.0, 0.0)]
    return _run(pieces)


def _chirp(rng: Generator) -> Array:
    t = np.arange(RUN_MS - REST_MS) / 1000.0
    f0, f1 = 0.15, float(rng.uniform(4.0, 6.0))
    length = t[-1]
    phase = 2 * np.pi * f0 * length / np.log(f1 / f0) * ((f1 / f0) ** (t / length) - 1)
    wave = float(rng.uniform(0.25, 0.45)) * np.sin(phase)
    wave = np.repeat(wave.reshape(-1, 50)[:, 25], 50)  # a sequence of 50 ms segments
    out = np.zeros((RUN_MS, 2))
    out[REST_MS:] = (wave + float(rng.choice([0.0, 0.25])))[:, None]
    out[-300:] = 0.0
    return out


def _creep(rng: Generator) -> Array:
    pieces = []
    for u in (0.03, 0.06, 0.09, 0.12, -0.06, -0.12):
        pieces += [_hold(1.9, u * float(rng.uniform(0.8, 1.2))), _hold(0.5, 0.0)]
    return _run(pieces)


def _one_wheel(rng: Generator) -> Array:
    u = float(rng.uniform(0.3, 0.6))
    return _run(
        [
            *(_hold(1.8, u, 0), _hold(0.8, 0), _hold(1.8, 0, u), _hold(0.8, 0), _hold(1.8, u), _hold(0.8, 0)),
            *(_hold(1.2, -u, 0), _hold(1.2, 0, -u), _hold(1.4, -u), _hold(0.8, 0)),
        ]
    )


def _arcs(rng: Generator) -> Array:
    pieces = []
    for _ in range(7):
        u, turn = float(rng.uniform(0.2, 0.6)), float(rng.uniform(-0.2, 0.2))
        pieces += [_hold(_grid(rng, 1.4, 2.2), u + turn, u - turn)]
    return _run([*pieces, _hold(1.0, 0.0)])


def _random_steps(rng: Generator) -> Array:
    pieces = []
    for _ in range(40):
        left, right = rng.uniform(-0.7, 0.7, 2)
        pieces.append(_hold(_grid(rng, 0.25, 1.0), float(left), float(right)))
    return _run(pieces)


RICH: tuple[Callable[[Generator], Array], ...] = (
    _steps,
    _reversals,
    _full_reversals,
    _ramps,
    _coast_downs,
    _staircase,
    _spin,
    _chirp,
    _creep,
    _one_wheel,
    _arcs,
    _random_steps,
)


def _drive_about(rng: Generator) -> Array:
    """Somebody with a joystick: smooth pushes, arcs, stops, now and then backwards or a turn on the spot."""
    pieces: list[Piece] = []
    left = right = 0.0
    for _ in range(12):
        what = rng.random()
        if what < 0.62:
            u, turn = float(rng.uniform(0.2, 0.6)), float(rng.normal(0, 0.08))
            aim = (u + turn, u - turn)
        elif what < 0.76:
            aim = (0.0, 0.0)
        elif what < 0.88:
            u = float(rng.uniform(0.15, 0.3)) * float(rng.choice([-1, 1]))
            aim = (u, -u)
        else:
            u = float(rng.uniform(0.2, 0.4))
            aim = (-u, -u)
        pieces.append((_grid(rng, 0.1, 0.5), left, aim[0], right, aim[1]))
        pieces.append(_hold(_grid(rng, 0.6, 2.0), *aim))
        left, right = aim
    return _run(pieces)


def draw_plan(kind: PlanKind, rng: Generator) -> list[Array]:
    """The runs of one set, each (ms, 2). Edges mostly fall on the log's grid of 50 ms."""
    late = int(rng.integers(1, 50)) if rng.random() < 0.25 else 0
    return [_late(run, late) for run in _plan(kind, rng)]


def _late(run: Array, ms: int) -> Array:
    """The same, so many milliseconds later: edges fall inside log rows."""
    return np.vstack([np.zeros((ms, 2)), run[: len(run) - ms]]) if ms else run


def _plan(kind: PlanKind, rng: Generator) -> list[Array]:
    if kind == "ordinary":
        return [_drive_about(rng) for _ in range(int(rng.integers(8, 14)))]
    state = rng.bit_generator.state
    runs = [make(rng) for make in RICH]
    rng.bit_generator.state = state
    runs.append(runs[0].copy() if rng.random() < 0.6 else RICH[0](rng))  # a run driven twice
    order = rng.permutation(len(runs)) if rng.random() < 0.5 else np.arange(len(runs))
    if kind == "thirds":
        order = np.sort(rng.permutation(len(runs))[: round(len(runs) * 2 / 3)])
    return [runs[i] for i in order]
