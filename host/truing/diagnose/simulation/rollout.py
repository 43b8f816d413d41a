"""The kernel: both wheels through all segments, in exponential steps, with stops solved as events.

Between events each wheel obeys `dv/dt = level - rate v` with `level` and `rate` constant over a substep,
which is solved in closed form. Effects that depend on the state are evaluated at the substep's middle
(predictor, then step: second order). A substep ends early where a wheel stops, breaks away, reaches its
speed limit, or where the wheels meet at one speed under scrub; it always ends where the input changes.

The assembler compiles this file with `stage` standing for the functions that it builds from the effects;
read on its own it is a robot without any effect (`stubs.py`).
"""

from __future__ import annotations

import math

import numpy as np

from truing.diagnose.data import FloatArray, IntArray
from truing.diagnose.simulation import stubs as stage
from truing.diagnose.simulation.bodies import (
    BODY_ROWS,
    GROUND,
    MOTOR,
    SCRATCH,
    advance_bodies,
    start_bodies,
)
from truing.diagnose.simulation.jit import cached, compiled

# Rows of the state, one column per wheel.
SPEED, TRAVEL, DUTY, HEAT, DRAW, STATE_ROWS = 0, 1, 2, 3, 4, 5
# Rows of the work array: what holds over one substep, one column per wheel.
AT, LEVEL, RATE, HELD, DIRECTION, TARGET, MEAN, EFFORT, PUSH, LOSS, SLOPE = range(11)
START, OWN, LIMITED, BRAKE = range(11, 15)
WORK_ROWS = 15

TINY_S = 1e-10
# A breakaway is overstepped by this much, so that the next substep finds the wheel free.
PAST_BREAKAWAY_S = 1e-7
MAX_EVENTS = 200


@compiled
def decay_integral(rate: float, h: float) -> float:
    """(1 - exp(-rate h)) / rate, well-behaved for a rate near zero."""
    z = rate * h
    if abs(z) < 1e-9:
        return h * (1.0 - 0.5 * z)
    return -math.expm1(-z) / rate


@compiled
def time_to_reach(v: float, goal: float, level: float, rate: float) -> float:
    """When `dv/dt = level - rate v` takes v to the goal, s; negative when it never does."""
    if abs(rate) < 1e-9:
        return (goal - v) / level if level != 0.0 else -1.0
    ratio = (level - rate * v) / (level - rate * goal) if level != rate * goal else 0.0
    return math.log(ratio) / rate if ratio > 0.0 else -1.0


@compiled
def evaluate(
    p: FloatArray,
    active: int,
    k: FloatArray,
    command: FloatArray,
    row: int,
    elapsed: float,
    slows: FloatArray,
    angle: FloatArray,
    heading: float,
    starting: bool,
) -> None:
    """Level and rate of both wheels at the speeds `k[AT]`; what is held is decided when `starting`."""
    voltage = 1.0
    if active & stage.USES_SUPPLY:
        square, speed = 0.0, 0.0
        for w in range(2):
            square += 0.5 * k[MEAN, w] * k[MEAN, w]
            speed += 0.5 * k[MEAN, w] * k[AT, w] / p[2 * w]
        voltage = stage.supply(p, active, 0, row, slows, square, speed)
    limit = stage.torque_limit(p, active) if active & stage.USES_TORQUE_LIMIT else math.inf
    shear = 0.0
    for w in range(2):
        v = k[AT, w]
        effort = k[MEAN, w] * voltage
        pushed = 0.0
        if active & stage.USES_PUSH:
            pushed = stage.push(
                p, active, w, angle[0, w], angle[1, w], angle[2, w], heading, p[2 * w + 1] / p[2 * w]
            )
        k[EFFORT, w] = effort
        k[PUSH, w] = pushed
        if starting:
            at_start = k[START, w] * voltage
            if v > 0.0 or v < 0.0:
                k[DIRECTION, w] = math.copysign(1.0, v)
            else:
                k[DIRECTION, w] = math.copysign(1.0, at_start + pushed)
        _inertial(p, active, k, command[w], row, elapsed, slows, limit, w)
    if active & stage.USES_SCRUB:
        shear = stage.scrub(p, active)
        if starting:
            _shear(p, active, k, command, row, elapsed, slows, limit, shear)
    for w in range(2):
        sign = 1.0 - 2.0 * w  # scrub slows the left wheel down and drags the right one along
        extra = k[PUSH, w] - sign * shear * k[OWN, 0]
        if starting:
            k[HELD, w] = 0.0
            if k[AT, w] == 0.0:
                at_start = k[START, w] * voltage
                at_start = min(max(at_start, -limit), limit)
                if abs(at_start + extra) <= k[LOSS, w]:
                    k[HELD, w] = 1.0
        if k[HELD, w] != 0.0:
            k[LEVEL, w] = 0.0
            k[RATE, w] = 0.0
            continue
        if k[LIMITED, w] != 0.0:
            k[RATE, w] = 0.0
            motor = k[LIMITED, w] * limit
        else:
            motor = k[EFFORT, w]
        k[LEVEL, w] = k[SLOPE, w] * (motor + extra - k[DIRECTION, w] * k[LOSS, w])
    if active & stage.USES_COUPLING:
        _couple(k, stage.coupling(p, active), starting)
    if active & stage.USES_SPEED_LIMIT and starting:
        ceiling = stage.speed_limit(p, active)
        for w in range(2):
            v = k[AT, w]
            if abs(v) >= ceiling and (k[LEVEL, w] - k[RATE, w] * v) * v > 0.0:
                k[HELD, w] = 1.0
                k[LEVEL, w] = 0.0
                k[RATE, w] = 0.0


@compiled
def _inertial(
    p: FloatArray,
    active: int,
    k: FloatArray,
    command: float,
    row: int,
    elapsed: float,
    slows: FloatArray,
    limit: float,
    w: int,
) -> None:
    """Rate, acceleration per effort and friction of one wheel in its direction."""
    s = k[DIRECTION, w]
    gain, tau = p[2 * w], p[2 * w + 1]
    if active & stage.USES_GAIN:
        gain *= stage.gain(p, active, w, row, slows, s, command, elapsed)
    if active & stage.USES_INERTIA:
        tau *= stage.inertia(p, active, w, row, slows, s, command, elapsed)
    k[SLOPE, w] = gain / tau
    k[BRAKE, w] = 1.0 / gain
    k[RATE, w] = 1.0 / tau
    k[LOSS, w] = stage.friction(p, active, w, abs(k[AT, w]), s) if active & stage.USES_FRICTION else 0.0
    k[LIMITED, w] = 0.0
    if active & stage.USES_TORQUE_LIMIT:
        motor = k[EFFORT, w] - k[AT, w] / gain
        if abs(motor) > limit:
            k[LIMITED, w] = math.copysign(1.0, motor)


@compiled
def _shear(
    p: FloatArray,
    active: int,
    k: FloatArray,
    command: FloatArray,
    row: int,
    elapsed: float,
    slows: FloatArray,
    limit: float,
    shear: float,
) -> None:
    """How much of the scrub acts (`k[OWN, 0]`, -1..1); `k[OWN, 1]` is 1 where it locks the wheels together.

    With unequal speeds scrub slides and acts in full. With equal ones it takes whatever value keeps them
    equal, as dry friction does at rest; two wheels at rest stay so while some value lets both.
    """
    left, right = k[AT, 0], k[AT, 1]
    k[OWN, 1] = 0.0
    if left != right:
        k[OWN, 0] = math.copysign(1.0, left - right)
    elif left != 0.0:
        k[OWN, 0] = 0.0
        k[OWN, 1] = 1.0
    else:
        total = np.empty(2)
        for w in range(2):
            total[w] = min(max(k[EFFORT, w], -limit), limit) + k[PUSH, w]
        low = max(total[0] - k[LOSS, 0], -total[1] - k[LOSS, 1], -shear)
        high = min(total[0] + k[LOSS, 0], -total[1] + k[LOSS, 1], shear)
        if low <= high:
            k[OWN, 0] = 0.5 * (low + high) / shear if shear > 0.0 else 0.0
        else:
            s = math.copysign(1.0, total[0] + total[1])
            net_left = total[0] - s * k[LOSS, 0]
            net_right = total[1] - s * k[LOSS, 1]
            wanted = (k[SLOPE, 0] * net_left - k[SLOPE, 1] * net_right) / (k[SLOPE, 0] + k[SLOPE, 1])
            if abs(wanted) <= shear:
                k[OWN, 0] = 0.0
                k[OWN, 1] = 1.0
                k[DIRECTION, 0] = s
                k[DIRECTION, 1] = s
            else:
                k[OWN, 0] = math.copysign(1.0, wanted)
                for w in range(2):
                    sign = 1.0 - 2.0 * w
                    k[DIRECTION, w] = math.copysign(1.0, total[w] - sign * shear * k[OWN, 0])
            for w in range(2):
                _inertial(p, active, k, command[w], row, elapsed, slows, limit, w)


@compiled
def _couple(k: FloatArray, share: float, starting: bool) -> None:
    """Add the other wheel's share; a wheel that is held hands back what it was given."""
    own = np.empty(2)
    for w in range(2):
        own[w] = k[LEVEL, w] - k[RATE, w] * k[AT, w]
    if starting:
        for w in range(2):
            if k[AT, w] == 0.0 and k[HELD, w] == 0.0:
                continue
            if k[HELD, w] != 0.0:
                # Effort that friction has to hold: its own, and what the other wheel passes on.
                passed = share * own[1 - w] / k[SLOPE, w]
                total = k[EFFORT, w] + k[PUSH, w] + passed
                if abs(total) > k[LOSS, w]:
                    k[HELD, w] = 0.0
                    k[DIRECTION, w] = math.copysign(1.0, total)
                    own[w] = k[SLOPE, w] * (k[EFFORT, w] + k[PUSH, w] - k[DIRECTION, w] * k[LOSS, w])
                    k[LEVEL, w] = own[w]
    for w in range(2):
        if k[HELD, w] != 0.0:
            continue
        if k[HELD, 1 - w] != 0.0:
            k[LEVEL, w] *= 1.0 - share * share
            k[RATE, w] *= 1.0 - share * share
        else:
            k[LEVEL, w] += share * own[1 - w]


@compiled
def _lock(k: FloatArray, h: float, shear: float) -> None:
    """Scrub that keeps two wheels of equal speed equal over a substep, as far as it reaches."""
    ends = np.empty(2)
    pulls = np.empty(2)
    for w in range(2):
        decay = decay_integral(k[RATE, w], h)
        ends[w] = k[AT, w] * math.exp(-k[RATE, w] * h) + k[LEVEL, w] * decay
        pulls[w] = k[SLOPE, w] * decay
    wanted = (ends[0] - ends[1]) / (pulls[0] + pulls[1])
    if abs(wanted) > shear:
        wanted = math.copysign(shear, wanted)
        k[OWN, 1] = 0.0
    k[LEVEL, 0] -= k[SLOPE, 0] * wanted
    k[LEVEL, 1] += k[SLOPE, 1] * wanted


@compiled
def step(
    p: FloatArray,
    active: int,
    x: FloatArray,
    k: FloatArray,
    command: FloatArray,
    h_wanted: float,
    middle: bool,
    row: int,
    elapsed: float,
    slows: FloatArray,
    angle: FloatArray,
    heading: float,
    states: FloatArray,
    ends: FloatArray,
    track: bool,
) -> float:
    """Advance both wheels by `h_wanted`, or to the first event before; returns how far it came."""
    h = h_wanted
    lag = stage.lag(p, active) if active & stage.USES_LAG else 0.0
    ceiling = stage.speed_limit(p, active) if active & stage.USES_SPEED_LIMIT else math.inf
    event_of, goal = -1, 0.0
    for attempt in range(4):
        share = decay_integral(1.0 / lag, h) / h if lag > 0.0 else 0.0
        for w in range(2):
            k[AT, w] = x[SPEED, w]
            k[START, w] = x[DUTY, w] if lag > 0.0 else k[TARGET, w]
            k[MEAN, w] = k[TARGET, w] + (k[START, w] - k[TARGET, w]) * share
        k[OWN, 0] = 0.0
        k[OWN, 1] = 0.0
        evaluate(p, active, k, command, row, elapsed, slows, angle, heading, True)
        if middle:
            for w in range(2):
                v = x[SPEED, w]
                if k[HELD, w] == 0.0:
                    half = 0.5 * h
                    v_mid = v * math.exp(-k[RATE, w] * half) + k[LEVEL, w] * decay_integral(k[RATE, w], half)
                    if v_mid * k[DIRECTION, w] < 0.0:
                        v_mid = 0.0
                    k[AT, w] = v_mid
            locked = k[OWN, 1]
            evaluate(p, active, k, command, row, elapsed, slows, angle, heading, False)
            k[OWN, 1] = locked
            for w in range(2):
                k[AT, w] = x[SPEED, w]
        if k[OWN, 1] != 0.0:
            _lock(k, h, stage.scrub(p, active))
        if attempt == 3:
            break
        # The first event inside the substep.
        first = h
        event_of = -1
        for w in range(2):
            v = x[SPEED, w]
            level, rate = k[LEVEL, w], k[RATE, w]
            if k[HELD, w] != 0.0:
                if lag > 0.0 and v == 0.0:
                    late = _breakaway(k, lag, w, h)
                    if 0.0 <= late < first:
                        first = late + PAST_BREAKAWAY_S
                        event_of = 2
                continue
            v_end = v * math.exp(-rate * h) + level * decay_integral(rate, h)
            if v != 0.0 and v_end * v < 0.0:
                when = time_to_reach(v, 0.0, level, rate)
                if 0.0 <= when < first:
                    first, event_of, goal = when, w, 0.0
            elif abs(v_end) > ceiling and abs(v) < ceiling:
                top = math.copysign(ceiling, v_end)
                when = time_to_reach(v, top, level, rate)
                if 0.0 <= when < first:
                    first, event_of, goal = when, w, top
        if active & stage.USES_SCRUB and k[OWN, 1] == 0.0 and x[SPEED, 0] != x[SPEED, 1]:
            when = _meeting(x, k, h)
            if 0.0 <= when < first:
                first, event_of = when, 3
        if event_of < 0 or first >= h * (1.0 - 1e-9):
            break
        h = max(first, TINY_S)
    for w in range(2):
        v = x[SPEED, w]
        level, rate = k[LEVEL, w], k[RATE, w]
        if k[HELD, w] != 0.0:
            v_end, travel = v, v * h
        else:
            decay = decay_integral(rate, h)
            v_end = v * math.exp(-rate * h) + level * decay
            if abs(rate * h) < 1e-6:
                travel = v * h + (level - rate * v) * 0.5 * h * h
            else:
                travel = level / rate * h + (v - level / rate) * decay
            if event_of == w:
                v_end = goal
            elif v != 0.0 and v_end * v < 0.0:
                v_end = 0.0
        ends[w] = v_end
        x[TRAVEL, w] += travel
        if lag > 0.0:
            x[DUTY, w] = k[TARGET, w] + (x[DUTY, w] - k[TARGET, w]) * math.exp(-h / lag)
        if track:
            current = k[EFFORT, w] - travel / (h * p[2 * w])
            x[HEAT, w] += current * current * h
            x[DRAW, 0] += 0.5 * k[MEAN, w] * current * h
    if (event_of == 3 or k[OWN, 1] != 0.0) and k[HELD, 0] == 0.0 and k[HELD, 1] == 0.0:
        common = 0.5 * (ends[0] + ends[1])
        ends[0] = common
        ends[1] = common
    for w in range(2):
        if active & stage.USES_AFTER_STEP:
            stage.after_step(p, active, w, states, h, x[SPEED, w], ends[w])
        x[SPEED, w] = ends[w]
    return h


@compiled
def step_bodies(
    p: FloatArray,
    active: int,
    x: FloatArray,
    k: FloatArray,
    b: FloatArray,
    c: FloatArray,
    command: FloatArray,
    h: float,
    row: int,
    elapsed: float,
    slows: FloatArray,
    angle: FloatArray,
    heading: float,
    radius: float,
    states: FloatArray,
    track: bool,
) -> None:
    """Advance both wheels by `h` where a gap or a sliding tyre splits them into bodies."""
    lag = stage.lag(p, active) if active & stage.USES_LAG else 0.0
    share = decay_integral(1.0 / lag, h) / h if lag > 0.0 else 0.0
    for w in range(2):
        k[AT, w] = x[SPEED, w]
        k[START, w] = x[DUTY, w] if lag > 0.0 else k[TARGET, w]
        k[MEAN, w] = k[TARGET, w] + (k[START, w] - k[TARGET, w]) * share
        if lag > 0.0:
            x[DUTY, w] = k[TARGET, w] + (x[DUTY, w] - k[TARGET, w]) * math.exp(-h / lag)
    k[OWN, 0] = 0.0
    k[OWN, 1] = 0.0
    evaluate(p, active, k, command, row, elapsed, slows, angle, heading, True)
    grip = stage.grip(p, active) if active & stage.USES_GRIP else math.inf
    spin = stage.spin_share(p, active) if active & stage.USES_GRIP else 0.0
    motor_share = stage.motor_share(p, active) if active & stage.USES_GAP else 0.0
    for w in range(2):
        gap = stage.gap(p, active, w, radius) if active & stage.USES_GAP else 0.0
        limited = k[LIMITED, w] != 0.0
        limit = stage.torque_limit(p, active) if limited else 0.0
        motor = k[LIMITED, w] * limit if limited else k[EFFORT, w]
        back_emf = 0.0 if limited else k[BRAKE, w]
        pushed = k[PUSH, w]
        if k[HELD, w] == 0.0:
            pushed = k[LEVEL, w] / k[SLOPE, w] + k[DIRECTION, w] * k[LOSS, w] - motor
        travel = advance_bodies(
            b, c, w, h, motor, back_emf, pushed, k[LOSS, w], k[SLOPE, w], gap, motor_share, grip, spin
        )
        x[TRAVEL, w] += travel
        if track:
            current = k[EFFORT, w] - travel / (h * p[2 * w])
            x[HEAT, w] += current * current * h
            x[DRAW, 0] += 0.5 * k[MEAN, w] * current * h
        if active & stage.USES_AFTER_STEP:
            stage.after_step(p, active, w, states, h, x[SPEED, w], b[MOTOR, w])
        x[SPEED, w] = b[MOTOR, w]


@compiled
def _breakaway(k: FloatArray, lag: float, w: int, h: float) -> float:
    """When a lagged effort that grows overcomes what holds the wheel at rest, s; negative if it does not."""
    scale = k[EFFORT, w] / k[MEAN, w] if k[MEAN, w] != 0.0 else 1.0
    for side in range(2):
        goal = ((1.0 - 2.0 * side) * k[LOSS, w] - k[PUSH, w]) / scale
        far = k[TARGET, w] - goal
        near = k[START, w] - goal
        if far * near < 0.0:
            when = lag * math.log((k[START, w] - k[TARGET, w]) / (goal - k[TARGET, w]))
            if when < h:
                return when
    return -1.0


@compiled
def _meeting(x: FloatArray, k: FloatArray, h: float) -> float:
    """When the two wheels come to one speed, s; negative if they do not within `h`."""
    low, high = 0.0, h
    before = x[SPEED, 0] - x[SPEED, 1]
    if before * _gap_at(x, k, h) >= 0.0:
        return -1.0
    for _ in range(40):
        half = 0.5 * (low + high)
        if before * _gap_at(x, k, half) > 0.0:
            low = half
        else:
            high = half
    return 0.5 * (low + high)


@compiled
def _gap_at(x: FloatArray, k: FloatArray, h: float) -> float:
    """Left speed minus right speed after `h`."""
    speeds = np.empty(2)
    for w in range(2):
        v = x[SPEED, w]
        speeds[w] = v * math.exp(-k[RATE, w] * h) + k[LEVEL, w] * decay_integral(k[RATE, w], h)
    return float(speeds[0] - speeds[1])


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
    out : shape (n, 2), m/s, the speed that the recorder would report (written).
    lost : shape (n, 2), m, encoder travel minus ground travel in the row's interval (written).
    heat, draw : shapes (n, 2), (n,): see `stages.SLOW_CONTEXT` (written if `track`).
    """
    x = np.zeros((STATE_ROWS, 2))
    k = np.zeros((WORK_ROWS, 2))
    states = np.zeros((stage.STATE_SLOTS, 2))
    before = np.zeros((stage.STATE_SLOTS, 2))
    angle = np.zeros((3, 2))  # measured, at the substep's two ends and at the start of the run
    command = np.zeros(2)
    ends = np.zeros(2)
    travel = np.zeros(2)
    piece = np.zeros(2, dtype=np.int64)
    late = stage.delay(p, active)
    lag = stage.lag(p, active) if active & stage.USES_LAG else 0.0
    middle = step_s < math.inf
    split = active & (stage.USES_GAP | stage.USES_GRIP) != 0
    b = np.zeros((BODY_ROWS, 2))
    c = np.zeros(SCRATCH)
    grounded = np.zeros(2)
    known_gap = False
    for segment in chosen:
        first, end = start[segment], start[segment + 1]
        states[:] = 0.0
        for w in range(2):
            x[SPEED, w] = initial[segment, w]
            x[TRAVEL, w] = 0.0
            states[:, w] = initial[segment, w]
            out[first, w] = initial[segment, w]
            lost[first, w] = 0.0
            heat[first, w] = 0.0
            piece[w] = first_piece[w, segment]
            # What was commanded before the first row's interval is unknown: nothing, for a start at rest.
            command[w] = piece_effort[w, piece[w]] if initial[segment, w] != 0.0 else 0.0
            k[TARGET, w] = (
                stage.drive(p, active, w, command[w]) if active & stage.USES_DRIVE else command[w]
            )
            x[DUTY, w] = k[TARGET, w]
            angle[2, w] = origins[segment, w]
            start_bodies(b, w, initial[segment, w], known_gap)
        known_gap = True
        draw[first] = 0.0
        now = t[first]
        arrival = t[first] - interval[segment] + late
        arrived = False
        fresh = True
        edge = np.full(2, -math.inf)
        for row in range(first + 1, end):
            travel[0], travel[1] = x[TRAVEL, 0], x[TRAVEL, 1]
            grounded[0], grounded[1] = b[GROUND, 0], b[GROUND, 1]
            before[:] = states
            x[HEAT, 0] = 0.0
            x[HEAT, 1] = 0.0
            x[DRAW, 0] = 0.0
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
                        while piece[w] < last and piece_end[w, piece[w]] + late <= now + TINY_S:
                            piece[w] += 1
                            fresh = True
                        if fresh:
                            edge[w] = piece_end[w, piece[w]] + late if piece[w] < last else math.inf
                        until = min(until, edge[w])
                    if fresh:
                        for w in range(2):
                            command[w] = piece_effort[w, piece[w]]
                            k[TARGET, w] = (
                                stage.drive(p, active, w, command[w])
                                if active & stage.USES_DRIVE
                                else command[w]
                            )
                        if lag > 0.0 and arrival <= t[first] and now <= t[first]:
                            # At a start in motion the lag has long followed what was commanded.
                            for w in range(2):
                                if initial[segment, w] != 0.0:
                                    x[DUTY, w] = k[TARGET, w]
                        fresh = False
                span = until - now
                count = 1 if not middle else max(1, math.ceil(span / step_s - 1e-9))
                size = span / count
                for part in range(count):
                    left = size
                    for _ in range(MAX_EVENTS):
                        at = until - (count - 1 - part) * size - left
                        if active & stage.USES_ANGLE:
                            for w in range(2):
                                for side in range(2):
                                    z = (at + side * left - t[row - 1]) / dt[row]
                                    angle[side, w] = hermite(
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
                        if split:
                            step_bodies(
                                p, active, x, k, b, c, command, left, row, since,
                                slows, angle, facing, radius, states, track,
                            )  # fmt: skip
                            break
                        done = step(
                            p, active, x, k, command, left, middle, row, since,
                            slows, angle, facing, states, ends, track,
                        )  # fmt: skip
                        left -= done
                        if left <= TINY_S:
                            break
                now = until
            for w in range(2):
                increment = x[TRAVEL, w] - travel[w]
                lost[row, w] = increment - (b[GROUND, w] - grounded[w]) if split else 0.0
                if active & stage.USES_MEASURE:
                    increment = stage.measure(
                        p, active, w, increment, dt[row], angles[row, w], angles[row - 1, w],
                        angle[2, w], radius, top[w], states, before,
                    )  # fmt: skip
                out[row, w] = increment / dt[row]
                heat[row, w] = x[HEAT, w] / dt[row]
            draw[row] = x[DRAW, 0] / dt[row]


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


@cached
def ground_motion(
    p: FloatArray,
    active: int,
    travel: FloatArray,
    lost: FloatArray,
    dt: FloatArray,
    first: FloatArray,
    angles: FloatArray,
    origins: FloatArray,
    radius: float,
    top: FloatArray,
    wheelbase: float,
    out: FloatArray,
) -> None:
    """Body increments of every row from measured wheel travel.

    Parameters
    ----------
    travel : shape (n, 2), m, measured travel in the row's interval.
    lost : shape (n, 2), m, what slid or hid in the gap, from the simulation.
    origins : shape (n, 2), rad, angle at which the row's run began.
    first : shape (n,), 1 at a segment's first row: no motion is known there.
    out : shape (n, 3): forward m, turn rad, lateral 0 (written).
    """
    wheel = np.zeros(2)
    for row in range(travel.shape[0]):
        out[row, 2] = 0.0
        if first[row] != 0.0:
            out[row, 0] = 0.0
            out[row, 1] = 0.0
            continue
        for w in range(2):
            wheel[w] = stage.ground(
                p, active, w, travel[row, w], dt[row], angles[row, w], angles[row - 1, w], origins[row, w],
                radius, top[w],
            )  # fmt: skip
            wheel[w] -= lost[row, w]
        forward = 0.5 * (wheel[0] + wheel[1])
        turn = (wheel[1] - wheel[0]) / wheelbase
        out[row, 1] = stage.turning(p, active, turn, forward)
        out[row, 0] = stage.distance(p, active, forward)


@cached
def windowed_motion(motion: FloatArray, first: IntArray, last: IntArray, out: FloatArray) -> None:
    """Displacement over windows in the body frame at each window's start.

    Parameters
    ----------
    motion : shape (n, 3): forward m, turn rad, lateral m in the interval that ends at the row.
    first, last : shape (m,): a window spans the intervals of rows first + 1 to last.
    out : shape (m, 3): forward m, lateral m, turn rad (written).
    """
    for window in range(first.shape[0]):
        ahead, aside, turn = 0.0, 0.0, 0.0
        for row in range(first[window] + 1, last[window] + 1):
            facing = turn + 0.5 * motion[row, 1]
            cosine, sine = math.cos(facing), math.sin(facing)
            ahead += motion[row, 0] * cosine - motion[row, 2] * sine
            aside += motion[row, 0] * sine + motion[row, 2] * cosine
            turn += motion[row, 1]
        out[window, 0] = ahead
        out[window, 1] = aside
        out[window, 2] = turn
