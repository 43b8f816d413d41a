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

from truing.diagnose.data.set_data import FloatArray
from truing.diagnose.simulation import stubs as stage
from truing.diagnose.simulation.bodies import advance_bodies
from truing.diagnose.simulation.jit import compiled
from truing.diagnose.simulation.rows import (
    AGAINST,
    ANGLE_END,
    ANGLE_START,
    AT,
    CALM,
    COMMAND,
    DIRECTION,
    DRAW,
    DUTY,
    EFFORT,
    END,
    GAIN,
    GONE,
    HALF,
    HEAT,
    HELD,
    INTEGRAL,
    KEEP,
    LAG,
    LEVEL,
    LIMITED,
    LOSS,
    MEAN,
    MOTOR,
    NET,
    OF_RATE,
    OF_SPAN,
    ORIGIN,
    OWN,
    PUSH,
    RATE,
    SLOPE,
    SPEED,
    START,
    SWING,
    TARGET,
    TRAVEL,
    WHOLE,
)

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
def remember(k: FloatArray, block: int, w: int, rate: float, h: float) -> None:
    """Have (1 - exp(-rate h)) / rate and exp(-rate h) in a block of the memory."""
    if k[block + OF_RATE, w] != rate or abs(k[block + OF_SPAN, w] - h) > SAME_S:
        k[block + OF_RATE, w] = rate
        k[block + OF_SPAN, w] = h
        k[block + INTEGRAL, w] = decay_integral(rate, h)
        k[block + KEEP, w] = 1.0 - rate * k[block + INTEGRAL, w]


@compiled
def evaluate(
    p: FloatArray,
    active: int,
    k: FloatArray,
    row: int,
    elapsed: float,
    slows: FloatArray,
    heading: float,
    limit: float,
    starting: bool,
) -> None:
    """Level and rate of both wheels at the speeds `k[AT]`; what is held is decided when `starting`."""
    emf = stage.back_emf(p, active) if active & stage.USES_BACK_EMF else 1.0
    voltage = 1.0
    if active & stage.USES_SUPPLY:
        square, speed = 0.0, 0.0
        for w in range(2):
            square += 0.5 * k[MEAN, w] * k[MEAN, w]
            speed += 0.5 * k[MEAN, w] * emf * k[AT, w] / p[2 * w]
        voltage = stage.supply(p, active, 0, row, slows, square, speed)
    shear = stage.scrub(p, active) if active & stage.USES_SCRUB else 0.0
    for w in range(2):
        v = k[AT, w]
        k[EFFORT, w] = k[MEAN, w] * voltage
        if starting:
            if active & stage.USES_PUSH:
                k[PUSH, w] = stage.push(
                    p,
                    active,
                    w,
                    k[ANGLE_START, w],
                    k[ANGLE_END, w],
                    k[ORIGIN, w],
                    heading,
                    p[2 * w + 1] / p[2 * w],
                )
            k[DIRECTION, w] = math.copysign(1.0, v if v != 0.0 else k[START, w] * voltage + k[PUSH, w])
    for again in range(2):
        for w in range(2):
            _inertial(p, active, k, row, elapsed, slows, limit, emf, w, starting)
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
            k[RATE, w] = k[CALM, w] * (1.0 - emf)
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
    row: int,
    elapsed: float,
    slows: FloatArray,
    limit: float,
    emf: float,
    w: int,
    starting: bool,
) -> None:
    """Rate, acceleration per effort and friction of one wheel in its direction."""
    v, s = k[AT, w], k[DIRECTION, w]
    if starting:
        gain, tau = p[2 * w], p[2 * w + 1]
        if active & stage.USES_GAIN:
            gain *= stage.gain(p, active, w, row, slows, s, k[COMMAND, w], elapsed)
        if active & stage.USES_INERTIA:
            tau *= stage.inertia(p, active, w, row, slows, s, k[COMMAND, w], elapsed)
        k[GAIN, w] = gain
        k[CALM, w] = 1.0 / tau
        k[SLOPE, w] = gain / tau
    if active & stage.USES_FRICTION:
        k[LOSS, w] = stage.friction(p, active, w, abs(v), s)
    if active & stage.USES_TORQUE_LIMIT:
        motor = k[EFFORT, w] - emf * v / k[GAIN, w]
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
def _lock(k: FloatArray, h: float, shear: float) -> None:
    """Scrub that keeps two wheels of equal speed equal over a substep, as far as it reaches."""
    apart, pull = 0.0, 0.0
    for w in range(2):
        remember(k, WHOLE, w, k[RATE, w], h)
        end = k[SPEED, w] * k[WHOLE + KEEP, w] + k[LEVEL, w] * k[WHOLE + INTEGRAL, w]
        apart += (1.0 - 2.0 * w) * end
        pull += k[SLOPE, w] * k[WHOLE + INTEGRAL, w]
    wanted = apart / pull
    if abs(wanted) > shear:
        wanted = math.copysign(shear, wanted)
        k[OWN, 1] = 0.0
    k[LEVEL, 0] -= k[SLOPE, 0] * wanted
    k[LEVEL, 1] += k[SLOPE, 1] * wanted


@compiled
def _speed_after(k: FloatArray, w: int, h: float, lag: float, share: float) -> float:
    """Speed of one wheel after `h`; `share` is the part of `swing` that `level` holds already."""
    rate = k[RATE, w]
    integral = decay_integral(rate, h)
    keep = 1.0 - rate * integral
    speed = k[SPEED, w] * keep + k[LEVEL, w] * integral
    if lag > 0.0 and k[SWING, w] != 0.0:
        speed += k[SWING, w] * (keep * decay_integral(1.0 / lag - rate, h) - share * integral)
    return float(speed)


@compiled
def _crossing(k: FloatArray, w: int, h: float, goal: float, lag: float, share: float) -> float:
    """When a wheel reaches the goal, s, where it has crossed it by `h`; negative if it does not.

    With w = MEETING it is the difference of both wheels' speeds that reaches zero.
    """
    if w != MEETING and (lag <= 0.0 or k[SWING, w] == 0.0):
        v, level, rate = k[SPEED, w], k[LEVEL, w], k[RATE, w]
        if abs(rate) < 1e-9:
            return float((goal - v) / level) if level != 0.0 else -1.0
        ratio = (level - rate * v) / (level - rate * goal) if level != rate * goal else 0.0
        return float(math.log(ratio) / rate) if ratio > 0.0 else -1.0
    low, high = 0.0, h
    before = k[SPEED, 0] - k[SPEED, 1] if w == MEETING else k[SPEED, w] - goal
    half = h
    for turn in range(BISECTIONS):
        if w == MEETING:
            now = _speed_after(k, 0, half, lag, share) - _speed_after(k, 1, half, lag, share)
        else:
            now = _speed_after(k, w, half, lag, share) - goal
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
    k: FloatArray,
    h_wanted: float,
    row: int,
    elapsed: float,
    slows: FloatArray,
    heading: float,
    radius: float,
    states: FloatArray,
    track: bool,
) -> float:
    """Advance both wheels by `h_wanted`, or to the first event before; returns how far it came."""
    h = h_wanted
    lag = stage.lag(p, active) if active & stage.USES_LAG else 0.0
    limit = stage.torque_limit(p, active) if active & stage.USES_TORQUE_LIMIT else math.inf
    emf = stage.back_emf(p, active) if active & stage.USES_BACK_EMF else 1.0
    ceiling = stage.speed_limit(p, active) if active & stage.USES_SPEED_LIMIT else math.inf
    split = active & (stage.USES_GAP | stage.USES_GRIP) != 0
    middle = active & stage.USES_SPEED != 0 and not split
    turns = active & stage.USES_DIRECTION != 0
    event, goal = NO_EVENT, 0.0
    for attempt in range(LAST_ATTEMPT + 1):
        share = 1.0
        if lag > 0.0:
            remember(k, LAG, 0, 1.0 / lag, h)
            share = k[LAG + INTEGRAL, 0] / h
        for w in range(2):
            k[AT, w] = k[SPEED, w]
            k[START, w] = k[DUTY, w] if lag > 0.0 else k[TARGET, w]
            k[MEAN, w] = k[TARGET, w] + (k[START, w] - k[TARGET, w]) * share
        k[OWN, 0] = 0.0
        k[OWN, 1] = 0.0
        for part in range(2):
            evaluate(p, active, k, row, elapsed, slows, heading, limit, part == 0)
            if part == 1 or not middle:
                break
            for w in range(2):
                if k[HELD, w] == 0.0:
                    remember(k, HALF, w, k[RATE, w], 0.5 * h)
                    v = k[SPEED, w] * k[HALF + KEEP, w] + k[LEVEL, w] * k[HALF + INTEGRAL, w]
                    k[AT, w] = 0.0 if turns and v * k[DIRECTION, w] < 0.0 else v
        if split:
            break
        if k[OWN, 1] != 0.0:
            _lock(k, h, stage.scrub(p, active))
        # The first event inside the substep.
        first = h
        known, event = event, NO_EVENT
        for w in range(2):
            v = k[SPEED, w]
            k[END, w] = v
            if k[HELD, w] != 0.0:
                if lag > 0.0 and v == 0.0:
                    when = _breakaway(k, lag, w, h)
                    if 0.0 <= when < first:
                        first, event = when + PAST_EVENT_S, PAST
                continue
            rate = k[RATE, w]
            remember(k, WHOLE, w, rate, h)
            end = v * k[WHOLE + KEEP, w] + k[LEVEL, w] * k[WHOLE + INTEGRAL, w]
            if lag > 0.0 and k[SWING, w] != 0.0:
                remember(k, AGAINST, w, 1.0 / lag - rate, h)
                rest = k[WHOLE + KEEP, w] * k[AGAINST + INTEGRAL, w] - share * k[WHOLE + INTEGRAL, w]
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
                when = _crossing(k, w, h, top, lag, share)
                if 0.0 <= when < first:
                    first, event, goal = when, w, top
            if lag <= 0.0 and k[LIMITED, w] != 0.0:
                out = k[GAIN, w] * (k[EFFORT, w] - k[LIMITED, w] * limit) / emf
                when = _crossing(k, w, h, out, lag, share) if (end - out) * (v - out) < 0.0 else -1.0
                if 0.0 <= when < first:
                    first, event = when + PAST_EVENT_S, PAST
        if active & stage.USES_SCRUB and k[OWN, 1] == 0.0 and k[SPEED, 0] != k[SPEED, 1]:
            when = _crossing(k, MEETING, h, 0.0, lag, share)
            if 0.0 <= when < first:
                first, event = when, MEETING
        if event == NO_EVENT or first >= h * (1.0 - 1e-9) or attempt == LAST_ATTEMPT:
            break
        h = max(first, TINY_S)
    if split:
        _step_bodies(p, active, k, h, limit, emf, radius)
    else:
        for w in range(2):
            v, rate = k[SPEED, w], k[RATE, w]
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
            k[DUTY, w] = k[TARGET, w] + (k[DUTY, w] - k[TARGET, w]) * k[LAG + KEEP, 0]
        if track:
            current = k[EFFORT, w] - emf * k[GONE, w] / (h * p[2 * w])
            k[HEAT, w] += current * current * h
            k[DRAW, 0] += 0.5 * k[MEAN, w] * current * h
        if active & stage.USES_AFTER_STEP:
            stage.after_step(p, active, w, states, h, k[SPEED, w], k[END, w], k[GONE, w])
        k[TRAVEL, w] += k[GONE, w]
        k[SPEED, w] = k[END, w]
    return h


@compiled
def _step_bodies(
    p: FloatArray,
    active: int,
    k: FloatArray,
    h: float,
    limit: float,
    emf: float,
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
        resisting = (1.0 - emf if limited else 1.0) / k[GAIN, w]
        pushed = k[PUSH, w]
        if k[HELD, w] == 0.0:
            pushed = k[LEVEL, w] / k[SLOPE, w] + k[DIRECTION, w] * k[LOSS, w] - motor
        k[GONE, w] = advance_bodies(
            k,
            w,
            h,
            motor,
            resisting,
            pushed,
            k[LOSS, w],
            k[SLOPE, w],
            gap,
            motor_share,
            grip,
            spin,
        )
        k[END, w] = k[MOTOR, w]
