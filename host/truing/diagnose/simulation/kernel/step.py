"""One substep of both wheels: what acts on them, the first event, and how far they come.

Between events each wheel obeys the equation of `acceleration.py`, which is solved in closed form. Effects
that depend on the speed are evaluated at the substep's middle (predictor, then step: second order). A
substep ends early where a wheel stops, breaks away, reaches its speed limit or leaves its current limit,
or where the wheels meet at one speed under scrub.
"""

from __future__ import annotations

import math

from truing.diagnose.simulation.state import Record, Records, Robot
from truing.model.compiled import part
from truing.model.kernel import decay_integral

from . import stage
from .acceleration import evaluate
from .bodies import advance_bodies
from .exponential import remember
from .tolerances import PAST_EVENT_S, SAME_MPS, TINY_S

# What ends a substep: nothing, wheel 0 or 1 at a speed, a wheel past its event, both at one speed.
NO_EVENT, PAST, MEETING = -1, 2, 3
# Halvings of the span in which an event is looked for.
BISECTIONS = 44
# A substep that was cut this often is taken as it is.
LAST_ATTEMPT = 3


@part
def step(
    robot: Robot,
    wheels: Records,
    both: Record,
    h: float,
    row: int,
    elapsed: float,
    heading: float,
    track: bool,
) -> float:
    """Advance both wheels by `h`, or to the first event before; returns how far it came, s."""
    split = robot.active & (stage.USES_GAP | stage.USES_GRIP) != 0
    event, goal = NO_EVENT, 0.0
    for attempt in range(LAST_ATTEMPT + 1):
        share = _set_duties(robot, wheels, both, h)
        evaluate(robot, wheels, both, row, elapsed, heading, True)
        if split:
            break
        if robot.active & stage.USES_SPEED:
            _predict_middle(robot, wheels, h)
            evaluate(robot, wheels, both, row, elapsed, heading, False)
        if both.locked:
            _lock(wheels, both, h, robot.scrub)
        when, event, goal = _first_event(robot, wheels, both, h, share, event, goal)
        if event == NO_EVENT or when >= h * (1.0 - 1e-9) or attempt == LAST_ATTEMPT:
            break
        h = max(when, TINY_S)
    for w in range(stage.WHEELS):
        if split:
            _advance_bodies(robot, wheels[w], w, h)
        else:
            _advance(robot, wheels[w], h, event == w, goal)
    if not split and (event == MEETING or both.locked):
        _join(wheels[0], wheels[1])
    for w in range(stage.WHEELS):
        _finish(robot, wheels[w], both, w, h, track)
    return h


@part
def _set_duties(robot: Robot, wheels: Records, both: Record, h: float) -> float:
    """Start the substep; returns the share of a lag's transient that is left on average."""
    share = 1.0
    if robot.lag > 0.0:
        remember(both.lag, 1.0 / robot.lag, h)
        share = both.lag.integral / h
    for w in range(stage.WHEELS):
        wheel = wheels[w]
        wheel.operating_speed = wheel.speed
        wheel.start_duty = wheel.duty if robot.lag > 0.0 else wheel.target
        wheel.mean_duty = wheel.target + (wheel.start_duty - wheel.target) * share
    both.scrub = 0.0
    both.locked = False
    return share


@part
def _predict_middle(robot: Robot, wheels: Records, h: float) -> None:
    """Set the speeds of the substep's middle."""
    for w in range(stage.WHEELS):
        wheel = wheels[w]
        if not wheel.held:
            remember(wheel.half, wheel.rate, 0.5 * h)
            v = wheel.speed * wheel.half.keep + wheel.level * wheel.half.integral
            reversed_ = robot.active & stage.USES_DIRECTION and v * wheel.direction < 0.0
            wheel.operating_speed = 0.0 if reversed_ else v


@part
def _join(left: Record, right: Record) -> None:
    """Two wheels that have met at one speed, unless one is held, end the substep at one speed."""
    if not left.held and not right.held:
        left.end = 0.5 * (left.end + right.end)
        right.end = left.end


@part
def _lock(wheels: Records, both: Record, h: float, scrub: float) -> None:
    """Scrub that keeps two wheels of equal speed equal over a substep, as far as it reaches."""
    apart, pull = 0.0, 0.0
    for w in range(2):
        wheel = wheels[w]
        remember(wheel.whole, wheel.rate, h)
        end = wheel.speed * wheel.whole.keep + wheel.level * wheel.whole.integral
        apart += (1.0 - 2.0 * w) * end
        pull += wheel.slope * wheel.whole.integral
    wanted = apart / pull
    if abs(wanted) > scrub:
        wanted = math.copysign(scrub, wanted)
        both.locked = False
    wheels[0].level -= wheels[0].slope * wanted
    wheels[1].level += wheels[1].slope * wanted


@part
def _first_event(
    robot: Robot, wheels: Records, both: Record, h: float, share: float, known: int, goal: float
) -> tuple[float, int, float]:
    """When the first event inside the substep comes, s, which it is, and the speed that a wheel then has.

    `known` and `goal` are the event that the substep was cut to end at.
    """
    lag, active = robot.lag, robot.active
    first, event = h, NO_EVENT
    for w in range(stage.WHEELS):
        wheel = wheels[w]
        v = wheel.speed
        wheel.end = v
        if wheel.held:
            if lag > 0.0 and v == 0.0:
                when = _breakaway(wheel, lag, h)
                if 0.0 <= when < first:
                    first, event = when + PAST_EVENT_S, PAST
            continue
        end = _set_end(wheel, h, lag, share)
        if known == w and abs(end - goal) < SAME_MPS:
            event = w
            continue
        top = 0.0
        seek = active & stage.USES_DIRECTION != 0 and v != 0.0 and end * v < 0.0
        if not seek and abs(end) > robot.speed_limit and abs(v) < robot.speed_limit:
            seek = True
            top = math.copysign(robot.speed_limit, end)
        if seek:
            when = _crossing(wheels, w, h, top, lag, share)
            if 0.0 <= when < first:
                first, event, goal = when, w, top
        if lag <= 0.0 and wheel.limited != 0.0:
            out = wheel.gain * (wheel.effort - wheel.limited * robot.torque_limit) / robot.back_emf
            when = _crossing(wheels, w, h, out, lag, share) if (end - out) * (v - out) < 0.0 else -1.0
            if 0.0 <= when < first:
                first, event = when + PAST_EVENT_S, PAST
    if active & stage.USES_SCRUB and not both.locked and wheels[0].speed != wheels[1].speed:
        when = _crossing(wheels, MEETING, h, 0.0, lag, share)
        if 0.0 <= when < first:
            first, event = when, MEETING
    return first, event, goal


@part
def _set_end(wheel: Record, h: float, lag: float, share: float) -> float:
    """Set and return the speed at the substep's end; as `_speed_after`, with remembered exponentials."""
    remember(wheel.whole, wheel.rate, h)
    whole, against = wheel.whole, wheel.against
    end = wheel.speed * whole.keep + wheel.level * whole.integral
    if lag > 0.0 and wheel.transient != 0.0:
        remember(against, 1.0 / lag - wheel.rate, h)
        end += wheel.transient * (whole.keep * against.integral - share * whole.integral)
    wheel.end = end
    return float(end)


@part
def _speed_after(wheel: Record, h: float, lag: float, share: float) -> float:
    """Speed of one wheel after `h`; `share` is the part of `transient` that `level` holds already."""
    integral = decay_integral(wheel.rate, h)
    keep = 1.0 - wheel.rate * integral
    speed = wheel.speed * keep + wheel.level * integral
    if lag > 0.0 and wheel.transient != 0.0:
        speed += wheel.transient * (keep * decay_integral(1.0 / lag - wheel.rate, h) - share * integral)
    return float(speed)


@part
def _over(wheels: Records, w: int, h: float, goal: float, lag: float, share: float) -> float:
    """Speed of a wheel over the goal after `h`; with w = MEETING the left wheel's over the right one's."""
    if w == MEETING:
        return _speed_after(wheels[0], h, lag, share) - _speed_after(wheels[1], h, lag, share)
    return _speed_after(wheels[w], h, lag, share) - goal


@part
def _crossing(wheels: Records, w: int, h: float, goal: float, lag: float, share: float) -> float:
    """When a wheel reaches the goal, s, where it has crossed it by `h`; negative if it does not.

    With w = MEETING it is the difference of both wheels' speeds that reaches zero.
    """
    if w != MEETING and (lag <= 0.0 or wheels[w].transient == 0.0):
        v, level, rate = wheels[w].speed, wheels[w].level, wheels[w].rate
        if abs(rate) < 1e-9:
            return float((goal - v) / level) if level != 0.0 else -1.0
        ratio = (level - rate * v) / (level - rate * goal) if level != rate * goal else 0.0
        return float(math.log(ratio) / rate) if ratio > 0.0 else -1.0
    before = _over(wheels, w, 0.0, goal, lag, share)
    if before * _over(wheels, w, h, goal, lag, share) >= 0.0:
        return -1.0
    low, high = 0.0, h
    for _ in range(BISECTIONS):
        half = 0.5 * (low + high)
        if before * _over(wheels, w, half, goal, lag, share) > 0.0:
            low = half
        else:
            high = half
    return 0.5 * (low + high)


@part
def _breakaway(wheel: Record, lag: float, h: float) -> float:
    """When a lagged effort that grows overcomes what holds the wheel at rest, s; negative if it does not."""
    scale = wheel.effort / wheel.mean_duty if wheel.mean_duty != 0.0 else 1.0
    for side in range(2):
        sign = 1.0 - 2.0 * side
        goal = (sign * wheel.friction - wheel.push) / scale
        far = sign * (wheel.target - goal)
        near = sign * (wheel.start_duty - goal)
        if far > 0.0 >= near:
            when = lag * math.log((far - near) / far)
            if when < h:
                return float(when)
    return -1.0


@part
def _advance(robot: Robot, wheel: Record, h: float, at_goal: bool, goal: float) -> None:
    """Travel of one wheel, and its speed at the end where an event sets it."""
    v, rate = wheel.speed, wheel.rate
    if wheel.held:
        wheel.distance = v * h
        return
    if abs(rate * h) < 1e-6:
        wheel.distance = v * h + (wheel.level - rate * v) * 0.5 * h * h
    else:
        wheel.distance = (wheel.level * h - (wheel.end - v)) / rate
    if at_goal:
        wheel.end = goal
    elif robot.active & stage.USES_DIRECTION and v * wheel.end < 0.0:
        wheel.end = 0.0


@part
def _advance_bodies(robot: Robot, wheel: Record, w: int, h: float) -> None:
    """The same where a gap or a sliding tyre splits the wheel into bodies."""
    gap = stage.gap(robot.p, robot.active, w, robot.radius)
    motor, resisting, push = wheel.effort, 1.0 / wheel.gain, wheel.push
    if wheel.limited != 0.0:
        motor, resisting = wheel.limited * robot.torque_limit, (1.0 - robot.back_emf) / wheel.gain
    if not wheel.held:
        push = wheel.level / wheel.slope + wheel.direction * wheel.friction - motor
    wheel.distance = advance_bodies(
        wheel, h, motor, resisting, push, gap, robot.motor_share, robot.grip, robot.spin_share
    )
    wheel.end = wheel.motor_speed


@part
def _finish(robot: Robot, wheel: Record, both: Record, w: int, h: float, track: bool) -> None:
    """Take over what the substep came to."""
    active = robot.active
    if robot.lag > 0.0:
        wheel.duty = wheel.target + (wheel.duty - wheel.target) * both.lag.keep
    if track:
        current = wheel.effort - robot.back_emf * wheel.distance / (h * robot.p[2 * w])
        wheel.heat += current * current * h
        both.draw += wheel.mean_duty * current * h
    if active & stage.USES_AFTER_STEP:
        stage.after_step(robot.p, active, w, robot.states, h, wheel.speed, wheel.end, wheel.distance)
    wheel.travel += wheel.distance
    wheel.speed = wheel.end
