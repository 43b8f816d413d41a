"""One wheel as up to three bodies in a row: motor side, gap, wheel, tyre, robot.

The gap transmits torque while its sides touch and none while they do not; contact is made without bounce
(the bodies share their momentum). The tyre rolls while it can give the robot the acceleration that rolling
asks for, and slides with a constant force when it cannot. Within a substep every cluster of bodies that
move as one obeys `dv/dt = level - rate v`, solved in closed form up to the next contact, stop or grip.
"""

from __future__ import annotations

import math

from truing.diagnose.data.set_data import FloatArray
from truing.diagnose.simulation.jit import compiled
from truing.diagnose.simulation.rows import (
    C_END,
    C_HELD,
    C_LEVEL,
    C_RATE,
    C_SPEED,
    CLUSTER_ROWS,
    GROUND,
    MOTOR,
    MOTOR_SIDE,
    PLACE,
    ROBOT,
    ROBOT_SIDE,
    ROLLS,
    TOUCH,
    WHEEL,
    WHEEL_SIDE,
)

# Share of dry friction on the motor's side of the gap: bearings and gears on one side, the tyre on the other.
FRICTION_AT_MOTOR = 0.5
LEAST_SHARE = 0.02
MAX_EVENTS = 1000
TINY_S = 1e-10
PAST_EVENT_S = 1e-7
SAME_MPS = 1e-9
BISECTIONS = 45


@compiled
def _integral(rate: float, h: float) -> float:
    z = rate * h
    return h * (1.0 - 0.5 * z) if abs(z) < 1e-9 else -math.expm1(-z) / rate


@compiled
def _end(k: FloatArray, i: int, h: float) -> float:
    return float(
        k[i + C_SPEED, 0] * math.exp(-k[i + C_RATE, 0] * h)
        + k[i + C_LEVEL, 0] * _integral(k[i + C_RATE, 0], h)
    )


@compiled
def _travel(k: FloatArray, i: int, h: float) -> float:
    rate = k[i + C_RATE, 0]
    if abs(rate * h) < 1e-6:
        return float(k[i + C_SPEED, 0] * h + (k[i + C_LEVEL, 0] - rate * k[i + C_SPEED, 0]) * 0.5 * h * h)
    steady = k[i + C_LEVEL, 0] / rate
    return float(steady * h + (k[i + C_SPEED, 0] - steady) * _integral(rate, h))


@compiled
def _cluster(
    k: FloatArray, i: int, v: float, share: float, force: float, dry: float, slope: float, back_emf: float
) -> None:
    """Level and rate of one cluster; `force` and `dry` in effort, `back_emf` effort per m/s."""
    k[i + C_SPEED, 0] = v
    if v == 0.0 and abs(force) <= dry:
        k[i + C_LEVEL, 0], k[i + C_RATE, 0], k[i + C_HELD, 0] = 0.0, 0.0, 1.0
        return
    s = math.copysign(1.0, v) if v != 0.0 else math.copysign(1.0, force)
    k[i + C_LEVEL, 0] = slope / share * (force - s * dry)
    k[i + C_RATE, 0] = slope / share * back_emf
    k[i + C_HELD, 0] = 0.0


@compiled
def _drift(k: FloatArray, h: float) -> float:
    """Speed of the motor's side against the wheel's after `h`."""
    return _end(k, MOTOR_SIDE, h) - _end(k, WHEEL_SIDE, h)


@compiled
def _same_way(k: FloatArray, h: float) -> float:
    """How long up to `h` the motor's side drifts one way through the gap, s.

    The drift is an exponential and a line: its slope changes sign once at most, and between that and either
    end the drift does so once at most.
    """
    rate = k[MOTOR_SIDE + C_RATE, 0]
    bend = k[MOTOR_SIDE + C_LEVEL, 0] - rate * k[MOTOR_SIDE + C_SPEED, 0]
    if rate > 0.0 and bend * k[WHEEL_SIDE + C_LEVEL, 0] > 0.0:
        turn = math.log(bend / k[WHEEL_SIDE + C_LEVEL, 0]) / rate
        if PAST_EVENT_S < turn < h:
            h = turn
    before = _drift(k, 0.0)
    if abs(before) < SAME_MPS:
        before = bend - k[WHEEL_SIDE + C_LEVEL, 0]
    if before * _drift(k, h) >= 0.0:
        return h
    low, high = 0.0, h
    for _ in range(BISECTIONS):
        half = 0.5 * (low + high)
        if before * _drift(k, half) > 0.0:
            low = half
        else:
            high = half
    return high


@compiled
def _copy(k: FloatArray, source: int, goal: int) -> None:
    for i in range(CLUSTER_ROWS):
        k[goal + i, 0] = k[source + i, 0]


@compiled
def start_bodies(k: FloatArray, w: int, v: float, keep_place: bool) -> None:
    """All bodies at one speed; the place in the gap stays, or is unknown and taken as the middle."""
    k[MOTOR, w] = v
    k[WHEEL, w] = v
    k[ROBOT, w] = v
    k[GROUND, w] = 0.0
    k[ROLLS, w] = 1.0
    if not keep_place:
        k[PLACE, w] = 0.5
        k[TOUCH, w] = 0.0


@compiled
def advance_bodies(
    k: FloatArray,
    w: int,
    h: float,
    motor: float,
    back_emf: float,
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
    k : shape (ROWS, 2), what a simulation works in.
    motor, back_emf : effort at the motor, and how much of it is lost per m/s.
    push, dry : effort on the wheel at all times, and dry friction.
    slope : acceleration of everything together per effort, m/s^2.
    gap : m at the rim; `k[PLACE]` is the motor's place in it, 0 (behind) to 1 (ahead).
    grip : largest acceleration that the tyre gives, m/s^2.
    """
    has_gap = gap > 0.0
    m = max(motor_share, LEAST_SHARE) if has_gap else 0.0
    slides = grip < math.inf
    r = max(spin_share - m, LEAST_SHARE) if slides else 0.0
    rest = 1.0 - m - r if slides else 1.0 - m
    if not has_gap:
        k[TOUCH, w] = 1.0
    if not slides:
        k[ROLLS, w] = 1.0
    dry_motor = FRICTION_AT_MOTOR * dry if has_gap else 0.0
    dry_wheel = dry - dry_motor
    left = h
    travelled = 0.0
    for _ in range(MAX_EVENTS):
        if left <= TINY_S:
            break
        # What moves as one: decide contact and grip from the accelerations of the whole.
        rolls = k[ROLLS, w] != 0.0
        touch = k[TOUCH, w]
        if has_gap and touch != 0.0:
            v = k[MOTOR, w]
            carried = m + r + (rest if rolls else 0.0)
            pull = 0.0 if rolls else -math.copysign(rest * grip / slope, k[WHEEL, w] - k[ROBOT, w])
            _cluster(k, MOTOR_SIDE, v, carried, motor + push + pull, dry, slope, back_emf)
            if k[MOTOR_SIDE + C_HELD, 0] != 0.0:
                if touch * motor < -dry_motor:
                    touch = 0.0
            else:
                s = math.copysign(1.0, v) if v != 0.0 else math.copysign(1.0, motor + push + pull)
                handed = motor - back_emf * v - s * dry_motor
                handed -= m / slope * (k[MOTOR_SIDE + C_LEVEL, 0] - k[MOTOR_SIDE + C_RATE, 0] * v)
                if touch * handed < -1e-12:
                    touch = 0.0
            k[TOUCH, w] = touch
        if slides and rolls:
            v = k[WHEEL, w]
            if touch != 0.0:
                _cluster(k, MOTOR_SIDE, v, 1.0, motor + push, dry, slope, back_emf)
            else:
                _cluster(k, MOTOR_SIDE, v, r + rest, push, dry_wheel, slope, 0.0)
            asked = k[MOTOR_SIDE + C_LEVEL, 0] - k[MOTOR_SIDE + C_RATE, 0] * v
            if abs(asked) > grip * (1.0 + 1e-9):
                rolls = False
                k[ROLLS, w] = 0.0
                sliding = math.copysign(1.0, asked)
            else:
                sliding = 0.0
        else:
            sliding = math.copysign(1.0, k[WHEEL, w] - k[ROBOT, w])
        pull = 0.0 if rolls else -sliding * rest * grip / slope
        wheel_share = r + (rest if rolls else 0.0)
        if touch != 0.0:
            _cluster(k, MOTOR_SIDE, k[MOTOR, w], m + wheel_share, motor + push + pull, dry, slope, back_emf)
            _copy(k, MOTOR_SIDE, WHEEL_SIDE)
        else:
            _cluster(k, MOTOR_SIDE, k[MOTOR, w], m, motor, dry_motor, slope, back_emf)
            _cluster(k, WHEEL_SIDE, k[WHEEL, w], wheel_share, push + pull, dry_wheel, slope, 0.0)
        if rolls:
            _copy(k, WHEEL_SIDE, ROBOT_SIDE)
        else:
            k[ROBOT_SIDE + C_SPEED, 0] = k[ROBOT, w]
            k[ROBOT_SIDE + C_LEVEL, 0] = sliding * grip
            k[ROBOT_SIDE + C_RATE, 0] = 0.0
            k[ROBOT_SIDE + C_HELD, 0] = 0.0
        # The first event.
        now = left
        event = 0
        if touch == 0.0:
            now = _same_way(k, now)
        elif has_gap and k[MOTOR_SIDE + C_HELD, 0] == 0.0:
            # The gap opens where the motor's side hands nothing on.
            v, level, rate = k[MOTOR_SIDE + C_SPEED, 0], k[MOTOR_SIDE + C_LEVEL, 0], k[MOTOR_SIDE + C_RATE, 0]
            s = math.copysign(1.0, v if v != 0.0 else level)
            offset = motor - s * dry_motor - m / slope * level
            per_speed = back_emf - m / slope * rate
            v_end = _end(k, MOTOR_SIDE, now)
            if touch * (offset - per_speed * v_end) < 0.0 < touch * (offset - per_speed * v):
                goal = offset / per_speed
                when = (goal - v) / level
                if abs(rate) > 1e-9:
                    when = math.log((level - rate * v) / (level - rate * goal)) / rate
                if 0.0 <= when < now:
                    now, event = when + PAST_EVENT_S, 6
        for i in range(2):
            side = MOTOR_SIDE + CLUSTER_ROWS * i
            v = k[side + C_SPEED, 0]
            if v != 0.0 and _end(k, side, now) * v < 0.0:
                level, rate = k[side + C_LEVEL, 0], k[side + C_RATE, 0]
                when = -v / level if abs(rate) < 1e-9 else math.log1p(-rate * v / level) / rate
                if 0.0 <= when < now:
                    now, event = when, 1 + i
        if touch == 0.0:
            place = k[PLACE, w] + (_travel(k, MOTOR_SIDE, now) - _travel(k, WHEEL_SIDE, now)) / gap
            if place < 0.0 or place > 1.0:
                wall = 0.0 if place < 0.0 else 1.0
                outward = 2.0 * wall - 1.0
                low, high = 0.0, now
                for _ in range(BISECTIONS):
                    half = 0.5 * (low + high)
                    if (
                        outward
                        * (
                            k[PLACE, w]
                            + (_travel(k, MOTOR_SIDE, half) - _travel(k, WHEEL_SIDE, half)) / gap
                            - wall
                        )
                        > 0.0
                    ):
                        high = half
                    else:
                        low = half
                now, event = high, 3 if wall == 0.0 else 4
        if not rolls and sliding * (_end(k, WHEEL_SIDE, now) - _end(k, ROBOT_SIDE, now)) < 0.0:
            low, high = 0.0, now
            for _ in range(BISECTIONS):
                half = 0.5 * (low + high)
                if sliding * (_end(k, WHEEL_SIDE, half) - _end(k, ROBOT_SIDE, half)) > 0.0:
                    low = half
                else:
                    high = half
            now, event = high, 5
        shift = _travel(k, MOTOR_SIDE, now)
        travelled += shift
        if touch == 0.0:
            k[PLACE, w] += (shift - _travel(k, WHEEL_SIDE, now)) / gap
        k[GROUND, w] += _travel(k, ROBOT_SIDE, now)
        for i in range(3):
            side = MOTOR_SIDE + CLUSTER_ROWS * i
            k[side + C_END, 0] = k[side + C_SPEED, 0] if k[side + C_HELD, 0] != 0.0 else _end(k, side, now)
        if event == 1 or (event == 2 and touch != 0.0):
            k[MOTOR_SIDE + C_END, 0] = 0.0
        if event == 2 or (event == 1 and touch != 0.0):
            k[WHEEL_SIDE + C_END, 0] = 0.0
        if rolls:
            k[ROBOT_SIDE + C_END, 0] = k[WHEEL_SIDE + C_END, 0]
        k[MOTOR, w] = k[MOTOR_SIDE + C_END, 0]
        k[WHEEL, w] = k[WHEEL_SIDE + C_END, 0]
        k[ROBOT, w] = k[ROBOT_SIDE + C_END, 0]
        if event == 3 or event == 4:
            k[TOUCH, w] = -1.0 if event == 3 else 1.0
            k[PLACE, w] = 0.0 if event == 3 else 1.0
            common = (m * k[MOTOR_SIDE + C_END, 0] + wheel_share * k[WHEEL_SIDE + C_END, 0]) / (
                m + wheel_share
            )
            k[MOTOR, w] = common
            k[WHEEL, w] = common
            if rolls:
                k[ROBOT, w] = common
        elif event == 5:
            k[ROLLS, w] = 1.0
            k[ROBOT, w] = k[WHEEL, w]
        left -= now
    return travelled
