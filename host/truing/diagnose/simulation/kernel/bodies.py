"""One wheel as up to three bodies in a row: motor side, gap, rim, tyre, robot.

The gap transmits torque while its sides touch and none while they do not; contact is made without bounce
(the bodies share their momentum). The tyre rolls while it can give the robot the acceleration that rolling
asks for, and slides with a constant force when it cannot. Within a substep every cluster of bodies that
move as one obeys `dv/dt = level - rate v`, solved in closed form up to the next contact, stop or grip.
"""

from __future__ import annotations

import math

from truing.diagnose.simulation.state import Bodies, Record
from truing.model.compiled import part
from truing.model.kernel import decay_integral

from .tolerances import PAST_EVENT_S, SAME_MPS, TINY_S

# Share of dry friction on the motor's side of the gap: bearings and gears on one side, the tyre on the other.
FRICTION_AT_MOTOR = 0.5
# Smallest share of the inertia that a body has.
MIN_SHARE = 0.02
# Most events in one substep, and halvings of the span in which an event is looked for.
MAX_EVENTS = 1000
BISECTIONS = 45
# What ends a span: nothing, a side of the gap stops, contact behind or ahead, the tyre grips, the gap opens.
NO_EVENT, MOTOR_STOPS, RIM_STOPS, TOUCHES_BEHIND, TOUCHES_AHEAD, GRIPS, OPENS = range(7)


@part
def start_bodies(wheel: Record, v: float, keep_place: bool) -> None:
    """All bodies at one speed; the place in the gap stays, or is unknown and taken as the middle."""
    wheel.motor_speed = v
    wheel.rim_speed = v
    wheel.robot_speed = v
    wheel.ground = 0.0
    wheel.rolls = True
    if not keep_place:
        wheel.place = 0.5
        wheel.touch = 0.0


@part
def advance_bodies(
    wheel: Record,
    h: float,
    motor: float,
    back_emf: float,
    push: float,
    gap: float,
    motor_share: float,
    grip: float,
    spin_share: float,
) -> float:
    """Advance one wheel's bodies by `h`; returns the travel of the encoder's shaft, m.

    Parameters
    ----------
    motor ... grip : as in `Bodies`.
    spin_share : share of the inertia that turns when the tyre slides.
    """
    has_gap, slides = gap > 0.0, grip < math.inf
    at_motor = max(motor_share, MIN_SHARE) if has_gap else 0.0
    at_rim = max(spin_share - at_motor, MIN_SHARE) if slides else 0.0
    dry_motor = FRICTION_AT_MOTOR * wheel.friction if has_gap else 0.0
    b = Bodies(
        motor, back_emf, push, wheel.friction, dry_motor, wheel.slope, gap, grip,
        at_motor, at_rim, 1.0 - at_motor - at_rim,
    )  # fmt: skip
    if not has_gap:
        wheel.touch = 1.0
    if not slides:
        wheel.rolls = True
    left, travelled = h, 0.0
    for _ in range(MAX_EVENTS):
        if left <= TINY_S:
            break
        if has_gap and wheel.touch != 0.0:
            _open_gap(wheel, b)
        sliding = _sliding(wheel, b)
        _set_clusters(wheel, b, sliding)
        span, event = _first_event(wheel, b, left, sliding)
        travelled += _move(wheel, b, span, event)
        _set_contact(wheel, b, event)
        left -= span
    return travelled


@part
def _open_gap(wheel: Record, b: Bodies) -> None:
    """Part the sides of the gap where the motor's side would have to pull the other along."""
    v, side = wheel.motor_speed, wheel.motor_side
    carried = b.motor_share + b.rim_share + (b.robot_share if wheel.rolls else 0.0)
    force = b.motor + b.push + _pull(wheel, b, math.copysign(1.0, wheel.rim_speed - wheel.robot_speed))
    _set_cluster(side, v, carried, force, b.dry, b.slope, b.back_emf)
    if side.held:
        if wheel.touch * b.motor < -b.dry_motor:
            wheel.touch = 0.0
        return
    s = math.copysign(1.0, v) if v != 0.0 else math.copysign(1.0, force)
    handed = b.motor - b.back_emf * v - s * b.dry_motor
    handed -= b.motor_share / b.slope * (side.level - side.rate * v)
    if wheel.touch * handed < -1e-12:
        wheel.touch = 0.0


@part
def _sliding(wheel: Record, b: Bodies) -> float:
    """Direction in which the tyre slides, 0 while it rolls; it lets go where rolling asks too much."""
    if not wheel.rolls:
        return math.copysign(1.0, wheel.rim_speed - wheel.robot_speed)
    if b.grip == math.inf:
        return 0.0
    v, side = wheel.rim_speed, wheel.motor_side
    if wheel.touch != 0.0:
        _set_cluster(side, v, 1.0, b.motor + b.push, b.dry, b.slope, b.back_emf)
    else:
        _set_cluster(side, v, b.rim_share + b.robot_share, b.push, b.dry - b.dry_motor, b.slope, 0.0)
    asked = side.level - side.rate * v
    if abs(asked) > b.grip * (1.0 + 1e-9):
        wheel.rolls = False
        return math.copysign(1.0, asked)
    return 0.0


@part
def _set_clusters(wheel: Record, b: Bodies, sliding: float) -> None:
    """Speed, level and rate of what moves as one."""
    motor, rim, robot = wheel.motor_side, wheel.rim_side, wheel.robot_side
    share, pull = _rim_share(wheel, b), _pull(wheel, b, sliding)
    if wheel.touch != 0.0:
        force = b.motor + b.push + pull
        _set_cluster(motor, wheel.motor_speed, b.motor_share + share, force, b.dry, b.slope, b.back_emf)
        _copy(motor, rim)
    else:
        _set_cluster(motor, wheel.motor_speed, b.motor_share, b.motor, b.dry_motor, b.slope, b.back_emf)
        _set_cluster(rim, wheel.rim_speed, share, b.push + pull, b.dry - b.dry_motor, b.slope, 0.0)
    if wheel.rolls:
        _copy(rim, robot)
    else:
        robot.speed, robot.level, robot.rate, robot.held = wheel.robot_speed, sliding * b.grip, 0.0, False


@part
def _pull(wheel: Record, b: Bodies, sliding: float) -> float:
    """Effort with which a sliding tyre acts on the rim."""
    return 0.0 if wheel.rolls else -sliding * b.robot_share * b.grip / b.slope


@part
def _rim_share(wheel: Record, b: Bodies) -> float:
    """Share of the inertia that moves with the rim, without the motor's."""
    return b.rim_share + (b.robot_share if wheel.rolls else 0.0)


@part
def _set_cluster(
    side: Record, v: float, share: float, force: float, dry: float, slope: float, back_emf: float
) -> None:
    """Level and rate of one cluster; `force` and `dry` in effort, `back_emf` effort per m/s."""
    side.speed = v
    side.held = v == 0.0 and abs(force) <= dry
    side.level, side.rate = 0.0, 0.0
    if not side.held:
        s = math.copysign(1.0, v) if v != 0.0 else math.copysign(1.0, force)
        side.level = slope / share * (force - s * dry)
        side.rate = slope / share * back_emf


@part
def _copy(source: Record, goal: Record) -> None:
    goal.speed, goal.level, goal.rate, goal.held = source.speed, source.level, source.rate, source.held


@part
def _first_event(wheel: Record, b: Bodies, h: float, sliding: float) -> tuple[float, int]:
    """When the first event comes, s, at most `h`, and which it is."""
    event = NO_EVENT
    if wheel.touch == 0.0:
        h = _same_way(wheel, h)
    elif b.gap > 0.0 and not wheel.motor_side.held:
        when = _opening(wheel, b, h)
        if 0.0 <= when < h:
            h, event = when + PAST_EVENT_S, OPENS
    when = _stop(wheel.motor_side, h)
    if 0.0 <= when < h:
        h, event = when, MOTOR_STOPS
    when = _stop(wheel.rim_side, h)
    if 0.0 <= when < h:
        h, event = when, RIM_STOPS
    if wheel.touch == 0.0:
        place = _place(wheel, b, h)
        if place < 0.0 or place > 1.0:
            event = TOUCHES_BEHIND if place < 0.0 else TOUCHES_AHEAD
            h = _contact(wheel, b, h, 0.0 if place < 0.0 else 1.0)
    if not wheel.rolls and sliding * _difference(wheel.rim_side, wheel.robot_side, h) < 0.0:
        h, event = _meeting(wheel.rim_side, wheel.robot_side, h, sliding), GRIPS
    return h, event


@part
def _same_way(wheel: Record, h: float) -> float:
    """How long up to `h` the motor's side drifts one way through the gap, s.

    The drift is an exponential and a line: its slope changes sign once at most, and between that and either
    end the drift does so once at most.
    """
    motor, rim = wheel.motor_side, wheel.rim_side
    bend = motor.level - motor.rate * motor.speed
    if motor.rate > 0.0 and bend * rim.level > 0.0:
        turn = math.log(bend / rim.level) / motor.rate
        if PAST_EVENT_S < turn < h:
            h = turn
    before = _difference(motor, rim, 0.0)
    if abs(before) < SAME_MPS:
        before = bend - rim.level
    if before * _difference(motor, rim, h) >= 0.0:
        return h
    return _meeting(motor, rim, h, before)


@part
def _opening(wheel: Record, b: Bodies, h: float) -> float:
    """When the motor's side begins to hand nothing on, s; negative if it does not by `h`."""
    side, touch = wheel.motor_side, wheel.touch
    v, level, rate = side.speed, side.level, side.rate
    s = math.copysign(1.0, v if v != 0.0 else level)
    offset = b.motor - s * b.dry_motor - b.motor_share / b.slope * level
    per_speed = b.back_emf - b.motor_share / b.slope * rate
    if not touch * (offset - per_speed * _end(side, h)) < 0.0 < touch * (offset - per_speed * v):
        return -1.0
    goal = offset / per_speed
    if abs(rate) > 1e-9:
        return float(math.log((level - rate * v) / (level - rate * goal)) / rate)
    return float((goal - v) / level)


@part
def _stop(side: Record, h: float) -> float:
    """When a cluster stops, s; negative if it does not by `h`."""
    v, level, rate = side.speed, side.level, side.rate
    if v != 0.0 and _end(side, h) * v < 0.0:
        return float(-v / level if abs(rate) < 1e-9 else math.log1p(-rate * v / level) / rate)
    return -1.0


@part
def _contact(wheel: Record, b: Bodies, h: float, wall: float) -> float:
    """When the motor's side reaches this end of the gap, which it has passed at `h`, s."""
    outward = 2.0 * wall - 1.0
    low, high = 0.0, h
    for _ in range(BISECTIONS):
        half = 0.5 * (low + high)
        if outward * (_place(wheel, b, half) - wall) > 0.0:
            high = half
        else:
            low = half
    return high


@part
def _meeting(a: Record, b: Record, h: float, before: float) -> float:
    """When two clusters have one speed, s; the sign of their difference at first is that of `before`."""
    low, high = 0.0, h
    for _ in range(BISECTIONS):
        half = 0.5 * (low + high)
        if before * _difference(a, b, half) > 0.0:
            low = half
        else:
            high = half
    return high


@part
def _move(wheel: Record, b: Bodies, h: float, event: int) -> float:
    """Advance all clusters by `h`; returns the travel of the motor's side, m."""
    motor, rim, robot = wheel.motor_side, wheel.rim_side, wheel.robot_side
    if wheel.touch == 0.0:
        wheel.place = _place(wheel, b, h)
    wheel.ground += _travel(robot, h)
    motor.end = motor.speed if motor.held else _end(motor, h)
    rim.end = rim.speed if rim.held else _end(rim, h)
    robot.end = robot.speed if robot.held else _end(robot, h)
    if event == MOTOR_STOPS or (event == RIM_STOPS and wheel.touch != 0.0):
        motor.end = 0.0
    if event == RIM_STOPS or (event == MOTOR_STOPS and wheel.touch != 0.0):
        rim.end = 0.0
    if wheel.rolls:
        robot.end = rim.end
    wheel.motor_speed, wheel.rim_speed, wheel.robot_speed = motor.end, rim.end, robot.end
    return _travel(motor, h)


@part
def _set_contact(wheel: Record, b: Bodies, event: int) -> None:
    """Speeds and contacts after an event of the gap or the tyre."""
    if event in (TOUCHES_BEHIND, TOUCHES_AHEAD):
        wheel.touch = -1.0 if event == TOUCHES_BEHIND else 1.0
        wheel.place = 0.0 if event == TOUCHES_BEHIND else 1.0
        share = _rim_share(wheel, b)
        common = (b.motor_share * wheel.motor_speed + share * wheel.rim_speed) / (b.motor_share + share)
        wheel.motor_speed = common
        wheel.rim_speed = common
        if wheel.rolls:
            wheel.robot_speed = common
    elif event == GRIPS:
        wheel.rolls = True
        wheel.robot_speed = wheel.rim_speed


@part
def _place(wheel: Record, b: Bodies, h: float) -> float:
    """Place of the motor's side in the gap after `h`."""
    return float(wheel.place + (_travel(wheel.motor_side, h) - _travel(wheel.rim_side, h)) / b.gap)


@part
def _difference(a: Record, b: Record, h: float) -> float:
    """Speed of one cluster against another's after `h`."""
    return _end(a, h) - _end(b, h)


@part
def _end(side: Record, h: float) -> float:
    """Speed after `h`."""
    return float(side.speed * math.exp(-side.rate * h) + side.level * decay_integral(side.rate, h))


@part
def _travel(side: Record, h: float) -> float:
    """Travel in `h`."""
    v, level, rate = side.speed, side.level, side.rate
    if abs(rate * h) < 1e-6:
        return float(v * h + (level - rate * v) * 0.5 * h * h)
    steady = level / rate
    return float(steady * h + (v - steady) * decay_integral(rate, h))
