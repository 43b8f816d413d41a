"""One substep of both wheels: what acts on them, the first event, and how far they come.

Between events each wheel obeys `dv/dt = level - rate v + swing exp(-t / lag)`, which is solved in closed
form; `swing` is what a lag between command and motor still has to lose. Effects that depend on the speed
are evaluated at the substep's middle (predictor, then step: second order). A substep ends early where a
wheel stops, breaks away, reaches its speed limit or leaves its current limit, or where the wheels meet at
one speed under scrub.

The assembler compiles this file with `stage` standing for the functions that it builds from the effects;
read on its own it is a robot without any effect (`stubs.py`).
"""

from __future__ import annotations

import math

from truing.diagnose.data import FloatArray
from truing.diagnose.simulation import stubs as stage
from truing.diagnose.simulation.bodies import MOTOR, advance_bodies
from truing.diagnose.simulation.jit import compiled

# Rows of the state, one column per wheel.
SPEED, TRAVEL, DUTY, HEAT, DRAW, STATE_ROWS = 0, 1, 2, 3, 4, 5
# Rows of the work array: what holds over one substep, one column per wheel.
AT, LEVEL, RATE, HELD, DIRECTION, TARGET, MEAN, EFFORT, PUSH, LOSS, SLOPE = range(11)
START, OWN, LIMITED, GAIN, CALM, SWING, END, GONE, NET = range(11, 20)
WORK_ROWS = 20
# Rows of the memory of exponentials: whole and half substep by wheel, lag, lag against wheel.
WHOLE, HALF, LAG, AGAINST, MEMORY_ROWS = 0, 2, 4, 5, 7
# Columns of a memory's row.
OF_RATE, OF_SPAN, INTEGRAL, KEEP, MEMORY_COLUMNS = 0, 1, 2, 3, 4

TINY_S = 1e-10
# Spans that differ by less are the same span.
SAME_S = 1e-12
# A speed within this of an event's speed is at the event, m/s.
SAME_MPS = 1e-9
# Some events are overstepped by this much, so that the next substep finds the wheel past them.
PAST_EVENT_S = 1e-7
# What ends a substep: nothing, wheel 0 or 1 at a speed, a wheel past its event, both at one speed.
NO_EVENT, PAST, MEETING = -1, 2, 3
BISECTIONS = 45
LAST_ATTEMPT = 3


@compiled
def decay_integral(rate: float, h: float) -> float:
    """(1 - exp(-rate h)) / rate, well-behaved for a rate near zero."""
    z = rate * h
    if abs(z) < 1e-9:
        return h * (1.0 - 0.5 * z)
    return -math.expm1(-z) / rate


@compiled
def remember(m: FloatArray, i: int, rate: float, h: float) -> None:
    """Have (1 - exp(-rate h)) / rate and exp(-rate h) in row i of the memory."""
    if m[i, OF_RATE] != rate or abs(m[i, OF_SPAN] - h) > SAME_S:
        m[i, OF_RATE] = rate
        m[i, OF_SPAN] = h
        m[i, INTEGRAL] = decay_integral(rate, h)
        m[i, KEEP] = 1.0 - rate * m[i, INTEGRAL]


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
    limit: float,
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
    shear = stage.scrub(p, active) if active & stage.USES_SCRUB else 0.0
    for w in range(2):
        v = k[AT, w]
        k[EFFORT, w] = k[MEAN, w] * voltage
        if starting:
            if active & stage.USES_PUSH:
                k[PUSH, w] = stage.push(
                    p, active, w, angle[0, w], angle[1, w], angle[2, w], heading, p[2 * w + 1] / p[2 * w]
                )
            k[DIRECTION, w] = math.copysign(1.0, v if v != 0.0 else k[START, w] * voltage + k[PUSH, w])
    for again in range(2):
        for w in range(2):
            _inertial(p, active, k, command[w], row, elapsed, slows, limit, w, starting)
        if again == 1 or not starting or not active & stage.USES_SCRUB:
            break
        if not _shear(k, limit, shear):
            break
    for w in range(2):
        sign = 1.0 - 2.0 * w  # scrub slows the left wheel down and drags the right one along
        extra = k[PUSH, w] - sign * shear * k[OWN, 0]
        if starting:
            at_start = min(max(k[START, w] * voltage, -limit), limit)
            held = k[AT, w] == 0.0 and abs(at_start + extra) <= k[LOSS, w]
            k[HELD, w] = 1.0 if held else 0.0
        k[LEVEL, w] = 0.0
        k[RATE, w] = 0.0
        k[SWING, w] = 0.0
        if k[HELD, w] == 0.0:
            motor = k[LIMITED, w] * limit
            if k[LIMITED, w] == 0.0:
                motor = k[EFFORT, w]
                k[RATE, w] = k[CALM, w]
                k[SWING, w] = k[SLOPE, w] * voltage * (k[START, w] - k[TARGET, w])
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
                k[SWING, w] = 0.0


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
    starting: bool,
) -> None:
    """Rate, acceleration per effort and friction of one wheel in its direction."""
    v, s = k[AT, w], k[DIRECTION, w]
    if starting:
        gain, tau = p[2 * w], p[2 * w + 1]
        if active & stage.USES_GAIN:
            gain *= stage.gain(p, active, w, row, slows, s, command, elapsed)
        if active & stage.USES_INERTIA:
            tau *= stage.inertia(p, active, w, row, slows, s, command, elapsed)
        k[GAIN, w] = gain
        k[CALM, w] = 1.0 / tau
        k[SLOPE, w] = gain / tau
    if active & stage.USES_FRICTION:
        k[LOSS, w] = stage.friction(p, active, w, abs(v), s)
    if active & stage.USES_TORQUE_LIMIT:
        motor = k[EFFORT, w] - v / k[GAIN, w]
        k[LIMITED, w] = math.copysign(1.0, motor) if abs(motor) > limit else 0.0


@compiled
def _shear(k: FloatArray, limit: float, shear: float) -> bool:
    """How much of the scrub acts (`k[OWN, 0]`, -1..1); `k[OWN, 1]` is 1 where it locks the wheels together.

    With unequal speeds scrub slides and acts in full. With equal ones it takes whatever value keeps them
    equal, as dry friction does at rest; two wheels at rest stay so while some value lets both. Returns
    whether it changed a wheel's direction.
    """
    left, right = k[AT, 0], k[AT, 1]
    k[OWN, 1] = 0.0
    if left != right:
        k[OWN, 0] = math.copysign(1.0, left - right)
        return False
    if left != 0.0:
        k[OWN, 0] = 0.0
        k[OWN, 1] = 1.0
        return False
    for w in range(2):
        k[NET, w] = min(max(k[EFFORT, w], -limit), limit) + k[PUSH, w]
    low = max(max(k[NET, 0] - k[LOSS, 0], -k[NET, 1] - k[LOSS, 1]), -shear)
    high = min(min(k[NET, 0] + k[LOSS, 0], -k[NET, 1] + k[LOSS, 1]), shear)
    if low <= high:
        k[OWN, 0] = 0.5 * (low + high) / shear if shear > 0.0 else 0.0
        return False
    s = math.copysign(1.0, k[NET, 0] + k[NET, 1])
    net_left = k[NET, 0] - s * k[LOSS, 0]
    net_right = k[NET, 1] - s * k[LOSS, 1]
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
            k[DIRECTION, w] = math.copysign(1.0, k[NET, w] - sign * shear * k[OWN, 0])
    return True


@compiled
def _couple(k: FloatArray, share: float, starting: bool) -> None:
    """Add the other wheel's share; a wheel that is held hands back what it was given."""
    for w in range(2):
        k[NET, w] = k[LEVEL, w] - k[RATE, w] * k[AT, w]
    if starting:
        for w in range(2):
            if k[HELD, w] != 0.0:
                # Effort that friction has to hold: its own, and what the other wheel passes on.
                passed = share * k[NET, 1 - w] / k[SLOPE, w]
                total = k[EFFORT, w] + k[PUSH, w] + passed
                if abs(total) > k[LOSS, w]:
                    k[HELD, w] = 0.0
                    k[DIRECTION, w] = math.copysign(1.0, total)
                    k[NET, w] = k[SLOPE, w] * (k[EFFORT, w] + k[PUSH, w] - k[DIRECTION, w] * k[LOSS, w])
                    k[LEVEL, w] = k[NET, w]
    for w in range(2):
        if k[HELD, w] != 0.0:
            continue
        if k[HELD, 1 - w] != 0.0:
            k[LEVEL, w] *= 1.0 - share * share
            k[RATE, w] *= 1.0 - share * share
        else:
            k[LEVEL, w] += share * k[NET, 1 - w]


@compiled
def _lock(x: FloatArray, k: FloatArray, m: FloatArray, h: float, shear: float) -> None:
    """Scrub that keeps two wheels of equal speed equal over a substep, as far as it reaches."""
    apart, pull = 0.0, 0.0
    for w in range(2):
        remember(m, WHOLE + w, k[RATE, w], h)
        end = x[SPEED, w] * m[WHOLE + w, KEEP] + k[LEVEL, w] * m[WHOLE + w, INTEGRAL]
        apart += (1.0 - 2.0 * w) * end
        pull += k[SLOPE, w] * m[WHOLE + w, INTEGRAL]
    wanted = apart / pull
    if abs(wanted) > shear:
        wanted = math.copysign(shear, wanted)
        k[OWN, 1] = 0.0
    k[LEVEL, 0] -= k[SLOPE, 0] * wanted
    k[LEVEL, 1] += k[SLOPE, 1] * wanted


@compiled
def _speed_after(x: FloatArray, k: FloatArray, w: int, h: float, lag: float, share: float) -> float:
    """Speed of one wheel after `h`; `share` is the part of `swing` that `level` holds already."""
    rate = k[RATE, w]
    integral = decay_integral(rate, h)
    keep = 1.0 - rate * integral
    speed = x[SPEED, w] * keep + k[LEVEL, w] * integral
    if lag > 0.0 and k[SWING, w] != 0.0:
        speed += k[SWING, w] * (keep * decay_integral(1.0 / lag - rate, h) - share * integral)
    return float(speed)


@compiled
def _crossing(x: FloatArray, k: FloatArray, w: int, h: float, goal: float, lag: float, share: float) -> float:
    """When a wheel reaches the goal, s, where it has crossed it by `h`; negative if it does not.

    With w = MEETING it is the difference of both wheels' speeds that reaches zero.
    """
    if w != MEETING and (lag <= 0.0 or k[SWING, w] == 0.0):
        v, level, rate = x[SPEED, w], k[LEVEL, w], k[RATE, w]
        if abs(rate) < 1e-9:
            return float((goal - v) / level) if level != 0.0 else -1.0
        ratio = (level - rate * v) / (level - rate * goal) if level != rate * goal else 0.0
        return float(math.log(ratio) / rate) if ratio > 0.0 else -1.0
    low, high = 0.0, h
    before = x[SPEED, 0] - x[SPEED, 1] if w == MEETING else x[SPEED, w] - goal
    half = h
    for turn in range(BISECTIONS):
        if w == MEETING:
            now = _speed_after(x, k, 0, half, lag, share) - _speed_after(x, k, 1, half, lag, share)
        else:
            now = _speed_after(x, k, w, half, lag, share) - goal
        if turn == 0 and before * now >= 0.0:
            return -1.0
        if before * now > 0.0:
            low = half
        else:
            high = half
        half = 0.5 * (low + high)
    return half


@compiled
def _breakaway(k: FloatArray, lag: float, w: int, h: float) -> float:
    """When a lagged effort that grows overcomes what holds the wheel at rest, s; negative if it does not."""
    scale = k[EFFORT, w] / k[MEAN, w] if k[MEAN, w] != 0.0 else 1.0
    for side in range(2):
        sign = 1.0 - 2.0 * side
        goal = (sign * k[LOSS, w] - k[PUSH, w]) / scale
        far = sign * (k[TARGET, w] - goal)
        near = sign * (k[START, w] - goal)
        if far > 0.0 >= near:
            when = lag * math.log((far - near) / far)
            if when < h:
                return when
    return -1.0


@compiled
def step(
    p: FloatArray,
    active: int,
    x: FloatArray,
    k: FloatArray,
    m: FloatArray,
    b: FloatArray,
    c: FloatArray,
    command: FloatArray,
    h_wanted: float,
    row: int,
    elapsed: float,
    slows: FloatArray,
    angle: FloatArray,
    heading: float,
    radius: float,
    states: FloatArray,
    track: bool,
) -> float:
    """Advance both wheels by `h_wanted`, or to the first event before; returns how far it came."""
    h = h_wanted
    lag = stage.lag(p, active) if active & stage.USES_LAG else 0.0
    limit = stage.torque_limit(p, active) if active & stage.USES_TORQUE_LIMIT else math.inf
    ceiling = stage.speed_limit(p, active) if active & stage.USES_SPEED_LIMIT else math.inf
    split = active & (stage.USES_GAP | stage.USES_GRIP) != 0
    middle = active & stage.USES_SPEED != 0 and not split
    turns = active & stage.USES_DIRECTION != 0
    event, goal = NO_EVENT, 0.0
    for attempt in range(LAST_ATTEMPT + 1):
        share = 1.0
        if lag > 0.0:
            remember(m, LAG, 1.0 / lag, h)
            share = m[LAG, INTEGRAL] / h
        for w in range(2):
            k[AT, w] = x[SPEED, w]
            k[START, w] = x[DUTY, w] if lag > 0.0 else k[TARGET, w]
            k[MEAN, w] = k[TARGET, w] + (k[START, w] - k[TARGET, w]) * share
        k[OWN, 0] = 0.0
        k[OWN, 1] = 0.0
        for part in range(2):
            evaluate(p, active, k, command, row, elapsed, slows, angle, heading, limit, part == 0)
            if part == 1 or not middle:
                break
            for w in range(2):
                if k[HELD, w] == 0.0:
                    remember(m, HALF + w, k[RATE, w], 0.5 * h)
                    v = x[SPEED, w] * m[HALF + w, KEEP] + k[LEVEL, w] * m[HALF + w, INTEGRAL]
                    k[AT, w] = 0.0 if turns and v * k[DIRECTION, w] < 0.0 else v
        if split:
            break
        if k[OWN, 1] != 0.0:
            _lock(x, k, m, h, stage.scrub(p, active))
        # The first event inside the substep.
        first = h
        known, event = event, NO_EVENT
        for w in range(2):
            v = x[SPEED, w]
            k[END, w] = v
            if k[HELD, w] != 0.0:
                if lag > 0.0 and v == 0.0:
                    when = _breakaway(k, lag, w, h)
                    if 0.0 <= when < first:
                        first, event = when + PAST_EVENT_S, PAST
                continue
            rate = k[RATE, w]
            remember(m, WHOLE + w, rate, h)
            end = v * m[WHOLE + w, KEEP] + k[LEVEL, w] * m[WHOLE + w, INTEGRAL]
            if lag > 0.0 and k[SWING, w] != 0.0:
                remember(m, AGAINST + w, 1.0 / lag - rate, h)
                rest = m[WHOLE + w, KEEP] * m[AGAINST + w, INTEGRAL] - share * m[WHOLE + w, INTEGRAL]
                end += k[SWING, w] * rest
            k[END, w] = end
            if known == w and abs(end - goal) < SAME_MPS:
                event = w
                continue
            top = 0.0
            seek = turns and v != 0.0 and end * v < 0.0
            if not seek and abs(end) > ceiling and abs(v) < ceiling:
                seek = True
                top = math.copysign(ceiling, end)
            if seek:
                when = _crossing(x, k, w, h, top, lag, share)
                if 0.0 <= when < first:
                    first, event, goal = when, w, top
            if lag <= 0.0 and k[LIMITED, w] != 0.0:
                out = k[GAIN, w] * (k[EFFORT, w] - k[LIMITED, w] * limit)
                if (end - out) * (v - out) < 0.0 and 0.0 <= (out - v) / k[LEVEL, w] < first:
                    first, event = (out - v) / k[LEVEL, w] + PAST_EVENT_S, PAST
        if active & stage.USES_SCRUB and k[OWN, 1] == 0.0 and x[SPEED, 0] != x[SPEED, 1]:
            when = _crossing(x, k, MEETING, h, 0.0, lag, share)
            if 0.0 <= when < first:
                first, event = when, MEETING
        if event == NO_EVENT or first >= h * (1.0 - 1e-9) or attempt == LAST_ATTEMPT:
            break
        h = max(first, TINY_S)
    if split:
        _step_bodies(p, active, k, b, c, h, limit, radius)
    else:
        for w in range(2):
            v, rate = x[SPEED, w], k[RATE, w]
            if k[HELD, w] != 0.0:
                k[GONE, w] = v * h
                continue
            if abs(rate * h) < 1e-6:
                k[GONE, w] = v * h + (k[LEVEL, w] - rate * v) * 0.5 * h * h
            else:
                k[GONE, w] = (k[LEVEL, w] * h - (k[END, w] - v)) / rate
            if event == w:
                k[END, w] = goal
            elif turns and v * k[END, w] < 0.0:
                k[END, w] = 0.0
        if (event == MEETING or k[OWN, 1] != 0.0) and k[HELD, 0] == 0.0 and k[HELD, 1] == 0.0:
            k[END, 0] = 0.5 * (k[END, 0] + k[END, 1])
            k[END, 1] = k[END, 0]
    for w in range(2):
        if lag > 0.0:
            x[DUTY, w] = k[TARGET, w] + (x[DUTY, w] - k[TARGET, w]) * m[LAG, KEEP]
        if track:
            current = k[EFFORT, w] - k[GONE, w] / (h * p[2 * w])
            x[HEAT, w] += current * current * h
            x[DRAW, 0] += 0.5 * k[MEAN, w] * current * h
        if active & stage.USES_AFTER_STEP:
            stage.after_step(p, active, w, states, h, x[SPEED, w], k[END, w], k[GONE, w])
        x[TRAVEL, w] += k[GONE, w]
        x[SPEED, w] = k[END, w]
    return h


@compiled
def _step_bodies(
    p: FloatArray,
    active: int,
    k: FloatArray,
    b: FloatArray,
    c: FloatArray,
    h: float,
    limit: float,
    radius: float,
) -> None:
    """Advance both wheels by `h` where a gap or a sliding tyre splits them into bodies."""
    grip = stage.grip(p, active) if active & stage.USES_GRIP else math.inf
    spin = stage.spin_share(p, active) if active & stage.USES_GRIP else 0.0
    motor_share = stage.motor_share(p, active) if active & stage.USES_GAP else 0.0
    for w in range(2):
        gap = stage.gap(p, active, w, radius) if active & stage.USES_GAP else 0.0
        limited = k[LIMITED, w] != 0.0
        motor = k[LIMITED, w] * limit if limited else k[EFFORT, w]
        back_emf = 0.0 if limited else 1.0 / k[GAIN, w]
        pushed = k[PUSH, w]
        if k[HELD, w] == 0.0:
            pushed = k[LEVEL, w] / k[SLOPE, w] + k[DIRECTION, w] * k[LOSS, w] - motor
        k[GONE, w] = advance_bodies(
            b,
            c,
            w,
            h,
            motor,
            back_emf,
            1.0 / k[GAIN, w],
            pushed,
            k[LOSS, w],
            k[SLOPE, w],
            gap,
            motor_share,
            grip,
            spin,
        )
        k[END, w] = b[MOTOR, w]
