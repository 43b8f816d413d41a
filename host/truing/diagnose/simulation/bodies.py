"""One wheel as up to three bodies in a row: motor side, gap, wheel, tyre, robot.

The gap transmits torque while its sides touch and none while they do not; contact is made without bounce
(the bodies share their momentum). The tyre rolls while it can give the robot the acceleration that rolling
asks for, and slides with a constant force when it cannot. Within a substep every cluster of bodies that
move as one obeys `dv/dt = level - rate v`, solved in closed form up to the next contact, stop or grip.
"""

from __future__ import annotations

import math

from truing.diagnose.data import FloatArray
from truing.diagnose.simulation.jit import compiled

# Rows of the bodies' state, one column per wheel.
MOTOR, WHEEL, ROBOT, PLACE, TOUCH, ROLLS, GROUND, BODY_ROWS = 0, 1, 2, 3, 4, 5, 6, 7
# Columns of a cluster's row in the scratch array.
_V, _LEVEL, _RATE, _HELD, _END = 0, 1, 2, 3, 4
SCRATCH = (3, 5)

# Share of dry friction on the motor's side of the gap: bearings and gears on one side, the tyre on the other.
FRICTION_AT_MOTOR = 0.5
LEAST_SHARE = 0.02
MAX_EVENTS = 1000
TINY_S = 1e-10
PAST_EVENT_S = 1e-7
# A flight through the gap is looked at this often, as a share of the motor side's time constant.
FLIGHT_SHARE = 0.02


@compiled
def _integral(rate: float, h: float) -> float:
    z = rate * h
    return h * (1.0 - 0.5 * z) if abs(z) < 1e-9 else -math.expm1(-z) / rate


@compiled
def _end(c: FloatArray, i: int, h: float) -> float:
    return float(c[i, _V] * math.exp(-c[i, _RATE] * h) + c[i, _LEVEL] * _integral(c[i, _RATE], h))


@compiled
def _travel(c: FloatArray, i: int, h: float) -> float:
    rate = c[i, _RATE]
    if abs(rate * h) < 1e-6:
        return float(c[i, _V] * h + (c[i, _LEVEL] - rate * c[i, _V]) * 0.5 * h * h)
    steady = c[i, _LEVEL] / rate
    return float(steady * h + (c[i, _V] - steady) * _integral(rate, h))


@compiled
def _cluster(
    c: FloatArray, i: int, v: float, share: float, force: float, dry: float, slope: float, back_emf: float
) -> None:
    """Level and rate of one cluster; `force` and `dry` in effort, `back_emf` effort per m/s."""
    c[i, _V] = v
    if v == 0.0 and abs(force) <= dry:
        c[i, _LEVEL], c[i, _RATE], c[i, _HELD] = 0.0, 0.0, 1.0
        return
    s = math.copysign(1.0, v) if v != 0.0 else math.copysign(1.0, force)
    c[i, _LEVEL] = slope / share * (force - s * dry)
    c[i, _RATE] = slope / share * back_emf
    c[i, _HELD] = 0.0


@compiled
def _copy(c: FloatArray, source: int, goal: int) -> None:
    for i in range(SCRATCH[1]):
        c[goal, i] = c[source, i]


@compiled
def start_bodies(b: FloatArray, w: int, v: float, keep_place: bool) -> None:
    """All bodies at one speed; the place in the gap stays, or is unknown and taken as the middle."""
    b[MOTOR, w] = v
    b[WHEEL, w] = v
    b[ROBOT, w] = v
    b[GROUND, w] = 0.0
    b[ROLLS, w] = 1.0
    if not keep_place:
        b[PLACE, w] = 0.5
        b[TOUCH, w] = 0.0


@compiled
def advance_bodies(
    b: FloatArray,
    c: FloatArray,
    w: int,
    h: float,
    motor: float,
    back_emf: float,
    brake: float,
    push: float,
    dry: float,
    slope: float,
    gap: float,
    motor_share: float,
    grip: float,
    spin_share: float,
) -> float:
    """Advance one wheel's bodies by `h`; returns the travel of the encoder's shaft, m.

    Parameters
    ----------
    b, c : state (BODY_ROWS, 2), and scratch of shape SCRATCH.
    motor, back_emf : effort at the motor, and how much of it is lost per m/s.
    brake : the same outside a current limit, for the time scale of a flight through the gap.
    push, dry : effort on the wheel at all times, and dry friction.
    slope : acceleration of everything together per effort, m/s^2.
    gap : m at the rim; `b[PLACE]` is the motor's place in it, 0 (behind) to 1 (ahead).
    grip : largest acceleration that the tyre gives, m/s^2.
    """
    has_gap = gap > 0.0
    m = max(motor_share, LEAST_SHARE) if has_gap else 0.0
    slides = grip < math.inf
    r = max(spin_share - m, LEAST_SHARE) if slides else 0.0
    rest = 1.0 - m - r if slides else 1.0 - m
    if not has_gap:
        b[TOUCH, w] = 1.0
    if not slides:
        b[ROLLS, w] = 1.0
    dry_motor = FRICTION_AT_MOTOR * dry if has_gap else 0.0
    dry_wheel = dry - dry_motor
    left = h
    travelled = 0.0
    for _ in range(MAX_EVENTS):
        if left <= TINY_S:
            break
        # What moves as one: decide contact and grip from the accelerations of the whole.
        rolls = b[ROLLS, w] != 0.0
        touch = b[TOUCH, w]
        if has_gap and touch != 0.0:
            v = b[MOTOR, w]
            carried = m + r + (rest if rolls else 0.0)
            pull = 0.0 if rolls else -math.copysign(rest * grip / slope, b[WHEEL, w] - b[ROBOT, w])
            _cluster(c, 0, v, carried, motor + push + pull, dry, slope, back_emf)
            if c[0, _HELD] != 0.0:
                if touch * motor < -dry_motor:
                    touch = 0.0
            else:
                s = math.copysign(1.0, v) if v != 0.0 else math.copysign(1.0, motor + push + pull)
                handed = motor - back_emf * v - s * dry_motor
                handed -= m / slope * (c[0, _LEVEL] - c[0, _RATE] * v)
                if touch * handed < -1e-12:
                    touch = 0.0
            b[TOUCH, w] = touch
        if slides and rolls:
            v = b[WHEEL, w]
            if touch != 0.0:
                _cluster(c, 0, v, 1.0, motor + push, dry, slope, back_emf)
            else:
                _cluster(c, 0, v, r + rest, push, dry_wheel, slope, 0.0)
            asked = c[0, _LEVEL] - c[0, _RATE] * v
            if abs(asked) > grip * (1.0 + 1e-9):
                rolls = False
                b[ROLLS, w] = 0.0
                sliding = math.copysign(1.0, asked)
            else:
                sliding = 0.0
        else:
            sliding = math.copysign(1.0, b[WHEEL, w] - b[ROBOT, w])
        pull = 0.0 if rolls else -sliding * rest * grip / slope
        wheel_share = r + (rest if rolls else 0.0)
        if touch != 0.0:
            _cluster(c, 0, b[MOTOR, w], m + wheel_share, motor + push + pull, dry, slope, back_emf)
            _copy(c, 0, 1)
        else:
            _cluster(c, 0, b[MOTOR, w], m, motor, dry_motor, slope, back_emf)
            _cluster(c, 1, b[WHEEL, w], wheel_share, push + pull, dry_wheel, slope, 0.0)
        if rolls:
            _copy(c, 1, 2)
        else:
            c[2, _V] = b[ROBOT, w]
            c[2, _LEVEL] = sliding * grip
            c[2, _RATE] = 0.0
            c[2, _HELD] = 0.0
        # The first event.
        now = left
        event = 0
        if touch == 0.0:
            now = min(now, FLIGHT_SHARE * m / (slope * brake))
        elif has_gap and c[0, _HELD] == 0.0:
            # The gap opens where the motor's side hands nothing on.
            v, level, rate = c[0, _V], c[0, _LEVEL], c[0, _RATE]
            s = math.copysign(1.0, v if v != 0.0 else level)
            offset = motor - s * dry_motor - m / slope * level
            per_speed = back_emf - m / slope * rate
            v_end = _end(c, 0, now)
            if touch * (offset - per_speed * v_end) < 0.0 < touch * (offset - per_speed * v):
                goal = offset / per_speed
                when = (goal - v) / level
                if abs(rate) > 1e-9:
                    when = math.log((level - rate * v) / (level - rate * goal)) / rate
                if 0.0 <= when < now:
                    now, event = when + PAST_EVENT_S, 6
        for i in range(2):
            v = c[i, _V]
            if v != 0.0 and _end(c, i, now) * v < 0.0:
                level, rate = c[i, _LEVEL], c[i, _RATE]
                when = -v / level if abs(rate) < 1e-9 else math.log1p(-rate * v / level) / rate
                if 0.0 <= when < now:
                    now, event = when, 1 + i
        if touch == 0.0:
            place = b[PLACE, w] + (_travel(c, 0, now) - _travel(c, 1, now)) / gap
            if place < 0.0 or place > 1.0:
                wall = 0.0 if place < 0.0 else 1.0
                side = 2.0 * wall - 1.0
                low, high = 0.0, now
                for _ in range(45):
                    half = 0.5 * (low + high)
                    if side * (b[PLACE, w] + (_travel(c, 0, half) - _travel(c, 1, half)) / gap - wall) > 0.0:
                        high = half
                    else:
                        low = half
                now, event = high, 3 if wall == 0.0 else 4
        if not rolls and sliding * (_end(c, 1, now) - _end(c, 2, now)) < 0.0:
            low, high = 0.0, now
            for _ in range(45):
                half = 0.5 * (low + high)
                if sliding * (_end(c, 1, half) - _end(c, 2, half)) > 0.0:
                    low = half
                else:
                    high = half
            now, event = high, 5
        shift = _travel(c, 0, now)
        travelled += shift
        if touch == 0.0:
            b[PLACE, w] += (shift - _travel(c, 1, now)) / gap
        b[GROUND, w] += _travel(c, 2, now)
        for i in range(3):
            c[i, _END] = c[i, _V] if c[i, _HELD] != 0.0 else _end(c, i, now)
        if event == 1 or (event == 2 and touch != 0.0):
            c[0, _END] = 0.0
        if event == 2 or (event == 1 and touch != 0.0):
            c[1, _END] = 0.0
        if rolls:
            c[2, _END] = c[1, _END]
        b[MOTOR, w] = c[0, _END]
        b[WHEEL, w] = c[1, _END]
        b[ROBOT, w] = c[2, _END]
        if event == 3 or event == 4:
            b[TOUCH, w] = -1.0 if event == 3 else 1.0
            b[PLACE, w] = 0.0 if event == 3 else 1.0
            common = (m * c[0, _END] + wheel_share * c[1, _END]) / (m + wheel_share)
            b[MOTOR, w] = common
            b[WHEEL, w] = common
            if rolls:
                b[ROBOT, w] = common
        elif event == 5:
            b[ROLLS, w] = 1.0
            b[ROBOT, w] = b[WHEEL, w]
        left -= now
    return travelled
