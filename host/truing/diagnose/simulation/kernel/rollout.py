"""The wheels through all segments, substep by substep (`step.py`), row by row.

A substep always ends where the input changes and where a row does.
"""

from __future__ import annotations

import math

from truing.arrays import FloatArray, IntArray
from truing.diagnose.simulation.state import Inputs, Record, Records, Robot, Scratch
from truing.model.compiled import cached, part

from . import stage
from .bodies import start_bodies
from .exponential import forget
from .step import step
from .tolerances import TINY_S

# Most events in one substep.
MAX_EVENTS = 200


@cached
def rollout(
    p: FloatArray,
    active: int,
    track: bool,
    chosen: IntArray,
    step_s: float,
    coarser: FloatArray,
    inputs: Inputs,
    scratch: Scratch,
) -> None:
    """Simulate the chosen segments with nothing but their efforts.

    Parameters
    ----------
    p, active : see `Robot`.
    track : keep the currents (`heat`, `draw`).
    chosen : segments to simulate, in order.
    step_s : largest substep; infinite where every step is exact.
    coarser : shape (n,), how many times longer a substep of this row may be.
    """
    robot = _robot(p, active, inputs, scratch)
    wheels, both = scratch.wheels, scratch.both[0]
    in_gap = False
    for segment in chosen:
        first, end = inputs.start[segment], inputs.start[segment + 1]
        _start_segment(robot, inputs, scratch, segment, in_gap)
        in_gap = True
        now = inputs.t[first]
        for row in range(first + 1, end):
            _start_row(scratch)
            while now < inputs.t[row] - TINY_S:
                until = min(inputs.t[row], _read_input(robot, inputs, wheels, segment, now))
                span = until - now
                count = 1 if step_s == math.inf else max(1, math.ceil(span / (step_s * coarser[row]) - 1e-9))
                size = span / count
                for k in range(count):
                    _substep(robot, inputs, wheels, both, row, until - (count - 1 - k) * size, size, track)
                now = until
            _finish_row(robot, inputs, scratch, row)


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


@part
def _robot(p: FloatArray, active: int, inputs: Inputs, scratch: Scratch) -> Robot:
    """What the effects that are on give for the whole simulation."""
    return Robot(
        p,
        active,
        scratch.slows,
        scratch.states,
        inputs.radius,
        (stage.delay(p, active, 0), stage.delay(p, active, 1)),
        stage.lag(p, active),
        stage.torque_limit(p, active),
        stage.back_emf(p, active),
        stage.speed_limit(p, active),
        stage.scrub(p, active),
        stage.coupling(p, active),
        stage.grip(p, active),
        stage.spin_share(p, active),
        stage.motor_share(p, active),
    )


@part
def _start_segment(robot: Robot, inputs: Inputs, scratch: Scratch, segment: int, in_gap: bool) -> None:
    """Both wheels at their initial speeds; `in_gap`: where the motors stand in their gaps is known."""
    first = inputs.start[segment]
    scratch.draw[first] = 0.0
    for w in range(stage.WHEELS):
        wheel = scratch.wheels[w]
        speed = inputs.initial[segment, w]
        forget(wheel.whole)
        forget(wheel.half)
        forget(wheel.against)
        wheel.speed = speed
        wheel.travel = 0.0
        # Effects that are off leave these as they are.
        wheel.push = 0.0
        wheel.friction = 0.0
        wheel.limited = 0.0
        for i in range(stage.STATE_SLOTS):
            scratch.states[i, w] = speed
        scratch.speed[first, w] = speed
        scratch.lost[first, w] = 0.0
        scratch.heat[first, w] = 0.0
        wheel.piece = inputs.first_piece[w, segment]
        # What was commanded before the first row's interval is unknown: nothing, for a start at rest.
        _command(robot, wheel, w, inputs.piece_effort[w, wheel.piece] if speed != 0.0 else 0.0)
        wheel.duty = wheel.target
        wheel.origin = inputs.origins[segment, w]
        start_bodies(wheel, speed, in_gap)
    forget(scratch.both[0].lag)


@part
def _command(robot: Robot, wheel: Record, w: int, effort: float) -> None:
    """Set what the driver is told and what it gives out for it."""
    wheel.command = effort
    wheel.target = effort
    if robot.active & stage.USES_DRIVE:
        wheel.target = stage.drive(robot.p, robot.active, w, effort)


@part
def _read_input(robot: Robot, inputs: Inputs, wheels: Records, segment: int, now: float) -> float:
    """Set both wheels' input as it is at `now`; returns when it changes next, s."""
    begin = inputs.t[inputs.start[segment]]
    until = math.inf
    for w in range(stage.WHEELS):
        wheel, delay = wheels[w], robot.delay[w]
        arrival = begin - inputs.interval[segment] + delay
        if now < arrival - TINY_S:
            until = min(until, arrival)
            continue
        last = inputs.first_piece[w, segment + 1] - 1
        while wheel.piece < last and inputs.piece_end[w, wheel.piece] + delay <= now + TINY_S:
            wheel.piece += 1
        if wheel.piece < last:
            until = min(until, inputs.piece_end[w, wheel.piece] + delay)
        _command(robot, wheel, w, inputs.piece_effort[w, wheel.piece])
        # At a start in motion the lag has long followed what was commanded.
        if robot.lag > 0.0 and arrival <= begin and now <= begin and inputs.initial[segment, w] != 0.0:
            wheel.duty = wheel.target
    return until


@part
def _start_row(scratch: Scratch) -> None:
    for w in range(stage.WHEELS):
        wheel = scratch.wheels[w]
        wheel.travel_before = wheel.travel
        wheel.ground_before = wheel.ground
        wheel.heat = 0.0
        for i in range(stage.STATE_SLOTS):
            scratch.states_before[i, w] = scratch.states[i, w]
    scratch.both[0].draw = 0.0


@part
def _substep(
    robot: Robot,
    inputs: Inputs,
    wheels: Records,
    both: Record,
    row: int,
    end: float,
    size: float,
    track: bool,
) -> None:
    """Advance both wheels by `size` to the time `end`, event by event."""
    before, dt = inputs.t[row - 1], inputs.dt[row]
    left = size
    for _ in range(MAX_EVENTS):
        at = end - left
        if robot.active & stage.USES_ANGLE:
            for w in range(stage.WHEELS):
                wheels[w].angle_start = _angle(inputs, row, w, (at - before) / dt)
                wheels[w].angle_end = _angle(inputs, row, w, (at + left - before) / dt)
        z = (at + 0.5 * left - before) / dt
        heading = inputs.heading[row - 1] + z * (inputs.heading[row] - inputs.heading[row - 1])
        elapsed = inputs.elapsed[row] - inputs.t[row] + at + 0.5 * left
        left -= step(robot, wheels, both, left, row, elapsed, heading, track)
        if left <= TINY_S:
            break


@part
def _angle(inputs: Inputs, row: int, w: int, z: float) -> float:
    """Measured wheel angle at the share z of a row: the cubic through its two ends with their rates."""
    y = 1.0 - z
    span = inputs.dt[row]
    return float(
        (1.0 + 2.0 * z) * y * y * inputs.angles[row - 1, w]
        + z * y * y * span * inputs.angle_rates[row - 1, w]
        + z * z * (3.0 - 2.0 * z) * inputs.angles[row, w]
        - z * z * y * span * inputs.angle_rates[row, w]
    )


@part
def _finish_row(robot: Robot, inputs: Inputs, scratch: Scratch, row: int) -> None:
    """Write what the recorder would report of the row, and what was lost on the way to the ground."""
    active, dt = robot.active, inputs.dt[row]
    for w in range(stage.WHEELS):
        wheel = scratch.wheels[w]
        increment = wheel.travel - wheel.travel_before
        scratch.lost[row, w] = 0.0
        if active & (stage.USES_GAP | stage.USES_GRIP):
            scratch.lost[row, w] = increment - (wheel.ground - wheel.ground_before)
        if inputs.instant:
            increment = wheel.speed * dt
        if active & stage.USES_MEASURE:
            increment = stage.measure(
                robot.p, active, w, increment, dt, inputs.angles[row, w], inputs.angles[row - 1, w],
                wheel.origin, inputs.radius, inputs.top[w], scratch.states, scratch.states_before,
            )  # fmt: skip
        scratch.speed[row, w] = increment / dt
        scratch.heat[row, w] = wheel.heat / dt
    scratch.draw[row] = scratch.both[0].draw / (stage.WHEELS * dt)
