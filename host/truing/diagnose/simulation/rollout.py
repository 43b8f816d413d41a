"""The kernel: both wheels through all segments, substep by substep (`step.py`), row by row.

A substep always ends where the input changes and where a row does. The assembler compiles this file with
`stage` standing for the functions that it builds from the effects; read on its own it is a robot without
any effect (`stubs.py`).
"""

from __future__ import annotations

import math

from truing.diagnose.data.set_data import FloatArray, IntArray
from truing.diagnose.simulation import stubs as stage
from truing.diagnose.simulation.bodies import start_bodies
from truing.diagnose.simulation.jit import cached, compiled
from truing.diagnose.simulation.rows import (
    ANGLE_START,
    COMMAND,
    DRAW,
    DUTY,
    EDGE,
    GROUND,
    GROUND_BEFORE,
    HEAT,
    MEMORY_END,
    ORIGIN,
    PIECE,
    ROWS,
    SPEED,
    TARGET,
    TRAVEL,
    TRAVEL_BEFORE,
    WHOLE,
)
from truing.diagnose.simulation.step import TINY_S, step

MAX_EVENTS = 200


@compiled
def hermite(a: float, b: float, rate_a: float, rate_b: float, span: float, z: float) -> float:
    """Cubic through two values with their rates, at the share z of the span."""
    y = 1.0 - z
    return (
        (1.0 + 2.0 * z) * y * y * a
        + z * y * y * span * rate_a
        + z * z * (3.0 - 2.0 * z) * b
        - z * z * y * span * rate_b
    )


@cached
def rollout(
    p: FloatArray,
    active: int,
    track: bool,
    chosen: IntArray,
    step_s: float,
    coarser: FloatArray,
    start: IntArray,
    first_piece: IntArray,
    piece_end: FloatArray,
    piece_effort: FloatArray,
    t: FloatArray,
    dt: FloatArray,
    elapsed: FloatArray,
    interval: FloatArray,
    initial: FloatArray,
    angles: FloatArray,
    angle_rates: FloatArray,
    origins: FloatArray,
    heading: FloatArray,
    radius: float,
    top: FloatArray,
    slows: FloatArray,
    k: FloatArray,
    states: FloatArray,
    before: FloatArray,
    out: FloatArray,
    lost: FloatArray,
    heat: FloatArray,
    draw: FloatArray,
) -> None:
    """Simulate the chosen segments with nothing but their efforts.

    Parameters
    ----------
    p : the baseline's four numbers (gain and time constant of the left, of the right wheel), then every
        effect's parameters in plain units.
    active : bit e is set where effect e is on.
    track : keep the currents (`heat`, `draw`).
    chosen : segments to simulate, in order.
    step_s : largest substep; infinite where every step is exact.
    coarser : shape (n,), how many times longer a substep of this row may be.
    start : shape (segments + 1,), first row of every segment, and n.
    first_piece : shape (2, segments + 1), first piece of every segment by wheel.
    piece_end, piece_effort : shape (2, m), s and effort, padded.
    t, dt, elapsed : shape (n,), s.
    interval : shape (segments,), s.
    initial : shape (segments, 2), m/s.
    angles, angle_rates : shape (n, 2), rad and rad/s, measured, running on from run to run.
    origins : shape (segments, 2), rad, angle at which each segment's run began.
    heading : shape (n,), rad.
    radius : m, or 1 where it is not known.
    top : shape (2,), m/s, the baseline's full-effort speeds.
    slows : shape (slots, n, 2), slow states of effects, already known.
    k : shape (ROWS, 2), what the simulation works in (`rows.py`).
    states, before : shape (STATE_SLOTS, 2), scratch: effects' states now and at the row's start.
    out : shape (n, 2), m/s, the speed that the recorder would report (written).
    lost : shape (n, 2), m, encoder travel minus ground travel in the row's interval (written).
    heat, draw : shapes (n, 2), (n,): see `stages.SLOW_CONTEXT` (written if `track`).
    """
    for i in range(ROWS):
        k[i, 0], k[i, 1] = 0.0, 0.0
    late = stage.delay(p, active)
    lag = stage.lag(p, active) if active & stage.USES_LAG else 0.0
    split = active & (stage.USES_GAP | stage.USES_GRIP) != 0
    known_gap = False
    for segment in chosen:
        first, end = start[segment], start[segment + 1]
        for i in range(WHOLE, MEMORY_END):
            k[i, 0], k[i, 1] = -1.0, -1.0
        for w in range(2):
            k[SPEED, w] = initial[segment, w]
            k[TRAVEL, w] = 0.0
            for i in range(stage.STATE_SLOTS):
                states[i, w] = initial[segment, w]
            out[first, w] = initial[segment, w]
            lost[first, w] = 0.0
            heat[first, w] = 0.0
            k[PIECE, w] = first_piece[w, segment]
            # What was commanded before the first row's interval is unknown: nothing, for a start at rest.
            k[COMMAND, w] = piece_effort[w, int(k[PIECE, w])] if initial[segment, w] != 0.0 else 0.0
            k[TARGET, w] = (
                stage.drive(p, active, w, k[COMMAND, w]) if active & stage.USES_DRIVE else k[COMMAND, w]
            )
            k[DUTY, w] = k[TARGET, w]
            k[ORIGIN, w] = origins[segment, w]
            start_bodies(k, w, initial[segment, w], known_gap)
        known_gap = True
        draw[first] = 0.0
        now = t[first]
        arrival = t[first] - interval[segment] + late
        arrived = False
        fresh = True
        k[EDGE, 0], k[EDGE, 1] = -math.inf, -math.inf
        for row in range(first + 1, end):
            k[TRAVEL_BEFORE, 0], k[TRAVEL_BEFORE, 1] = k[TRAVEL, 0], k[TRAVEL, 1]
            k[GROUND_BEFORE, 0], k[GROUND_BEFORE, 1] = k[GROUND, 0], k[GROUND, 1]
            for i in range(stage.STATE_SLOTS):
                before[i, 0], before[i, 1] = states[i, 0], states[i, 1]
            k[HEAT, 0] = 0.0
            k[HEAT, 1] = 0.0
            k[DRAW, 0] = 0.0
            while now < t[row] - TINY_S:
                until = t[row]
                if not arrived and now >= arrival - TINY_S:
                    arrived = True
                    fresh = True
                if not arrived:
                    until = min(until, arrival)
                else:
                    for w in range(2):
                        last = first_piece[w, segment + 1] - 1
                        while k[PIECE, w] < last and piece_end[w, int(k[PIECE, w])] + late <= now + TINY_S:
                            k[PIECE, w] += 1.0
                            fresh = True
                        if fresh:
                            k[EDGE, w] = (
                                piece_end[w, int(k[PIECE, w])] + late if k[PIECE, w] < last else math.inf
                            )
                        until = min(until, k[EDGE, w])
                    if fresh:
                        for w in range(2):
                            k[COMMAND, w] = piece_effort[w, int(k[PIECE, w])]
                            k[TARGET, w] = (
                                stage.drive(p, active, w, k[COMMAND, w])
                                if active & stage.USES_DRIVE
                                else k[COMMAND, w]
                            )
                        if lag > 0.0 and arrival <= t[first] and now <= t[first]:
                            # At a start in motion the lag has long followed what was commanded.
                            for w in range(2):
                                if initial[segment, w] != 0.0:
                                    k[DUTY, w] = k[TARGET, w]
                        fresh = False
                span = until - now
                count = 1 if step_s == math.inf else max(1, math.ceil(span / (step_s * coarser[row]) - 1e-9))
                size = span / count
                for part in range(count):
                    left = size
                    for _ in range(MAX_EVENTS):
                        at = until - (count - 1 - part) * size - left
                        if active & stage.USES_ANGLE:
                            for w in range(2):
                                for side in range(2):
                                    z = (at + side * left - t[row - 1]) / dt[row]
                                    k[ANGLE_START + side, w] = hermite(
                                        angles[row - 1, w],
                                        angles[row, w],
                                        angle_rates[row - 1, w],
                                        angle_rates[row, w],
                                        dt[row],
                                        z,
                                    )
                        z = (at + 0.5 * left - t[row - 1]) / dt[row]
                        facing = heading[row - 1] + z * (heading[row] - heading[row - 1])
                        since = elapsed[row] - t[row] + at + 0.5 * left
                        done = step(p, active, k, left, row, since, slows, facing, radius, states, track)
                        left -= done
                        if left <= TINY_S:
                            break
                now = until
            for w in range(2):
                increment = k[TRAVEL, w] - k[TRAVEL_BEFORE, w]
                lost[row, w] = increment - (k[GROUND, w] - k[GROUND_BEFORE, w]) if split else 0.0
                if active & stage.USES_MEASURE:
                    increment = stage.measure(
                        p, active, w, increment, dt[row], angles[row, w], angles[row - 1, w],
                        k[ORIGIN, w], radius, top[w], states, before,
                    )  # fmt: skip
                out[row, w] = increment / dt[row]
                heat[row, w] = k[HEAT, w] / dt[row]
            draw[row] = k[DRAW, 0] / dt[row]


@cached
def slow(
    p: FloatArray,
    active: int,
    dt: FloatArray,
    heat: FloatArray,
    draw: FloatArray,
    elapsed: FloatArray,
    slows: FloatArray,
) -> None:
    """Fill the slow states of effects from the currents of a simulation without them."""
    stage.slow_states(p, active, dt, heat, draw, elapsed, slows)
