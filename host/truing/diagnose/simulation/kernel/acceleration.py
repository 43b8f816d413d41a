"""What acts on both wheels at one instant: level and rate of their equation of motion.

It is `dv/dt = level - rate v + transient exp(-t / lag)` for each wheel; `transient` is what a lag
between command and motor still has to lose.
"""

from __future__ import annotations

import math

from truing.diagnose.simulation.state import Record, Records, Robot
from truing.model.compiled import part

from . import stage


@part
def evaluate(
    robot: Robot, wheels: Records, both: Record, row: int, elapsed: float, heading: float, starting: bool
) -> None:
    """Set level and rate of both wheels at their `operating_speed`; what is held is decided if `starting`."""
    p, active, limit = robot.p, robot.active, robot.torque_limit
    voltage = _supply(robot, wheels, row)
    for w in range(stage.WHEELS):
        wheel = wheels[w]
        wheel.effort = wheel.mean_duty * voltage
        if starting:
            if active & stage.USES_PUSH:
                wheel.push = stage.push(
                    p, active, w, wheel.angle_start, wheel.angle_end, wheel.origin, heading,
                    p[2 * w + 1] / p[2 * w],
                )  # fmt: skip
            v = wheel.operating_speed
            wheel.direction = math.copysign(1.0, v if v != 0.0 else wheel.start_duty * voltage + wheel.push)
    for again in range(2):
        for w in range(stage.WHEELS):
            _set_numbers(robot, wheels[w], w, row, elapsed, starting)
        if again == 1 or not starting or not active & stage.USES_SCRUB:
            break
        if not _scrub(wheels, both, limit, robot.scrub):
            break
    for w in range(stage.WHEELS):
        wheel = wheels[w]
        sign = 1.0 - 2.0 * w  # scrub slows the left wheel down and drags the right one along
        extra = wheel.push - sign * robot.scrub * both.scrub
        if starting:
            at_start = min(max(wheel.start_duty * voltage, -limit), limit)
            wheel.held = wheel.operating_speed == 0.0 and abs(at_start + extra) <= wheel.friction
        _hold(wheel)
        if not wheel.held:
            motor = wheel.limited * limit
            wheel.rate = wheel.free_rate * (1.0 - robot.back_emf)
            if wheel.limited == 0.0:
                motor = wheel.effort
                wheel.rate = wheel.free_rate
                wheel.transient = wheel.slope * voltage * (wheel.start_duty - wheel.target)
            wheel.level = wheel.slope * (motor + extra - wheel.direction * wheel.friction)
    if active & stage.USES_COUPLING:
        _couple(wheels, robot.coupling, starting)
    if active & stage.USES_SPEED_LIMIT and starting:
        for w in range(stage.WHEELS):
            wheel = wheels[w]
            v = wheel.operating_speed
            if abs(v) >= robot.speed_limit and (wheel.level - wheel.rate * v) * v > 0.0:
                wheel.held = True
                _hold(wheel)


@part
def _supply(robot: Robot, wheels: Records, row: int) -> float:
    """Supply voltage over nominal."""
    if not robot.active & stage.USES_SUPPLY:
        return 1.0
    square, speed = 0.0, 0.0
    for w in range(stage.WHEELS):
        mean = wheels[w].mean_duty
        square += mean * mean
        speed += mean * robot.back_emf * wheels[w].operating_speed / robot.p[2 * w]
    square, speed = square / stage.WHEELS, speed / stage.WHEELS
    return float(stage.supply(robot.p, robot.active, 0, row, robot.slows, square, speed))


@part
def _hold(wheel: Record) -> None:
    """No change of speed."""
    wheel.level = 0.0
    wheel.rate = 0.0
    wheel.transient = 0.0


@part
def _set_numbers(robot: Robot, wheel: Record, w: int, row: int, elapsed: float, starting: bool) -> None:
    """Rate, acceleration per effort and friction of one wheel in its direction."""
    p, active, slows = robot.p, robot.active, robot.slows
    v, s = wheel.operating_speed, wheel.direction
    if starting:
        gain, tau = p[2 * w], p[2 * w + 1]
        if active & stage.USES_GAIN:
            gain *= stage.gain(p, active, w, row, slows, s, wheel.command, elapsed)
        if active & stage.USES_INERTIA:
            tau *= stage.inertia(p, active, w, row, slows, s, wheel.command, elapsed)
        wheel.gain = gain
        wheel.free_rate = 1.0 / tau
        wheel.slope = gain / tau
    if active & stage.USES_FRICTION:
        wheel.friction = stage.friction(p, active, w, abs(v), s)
        if active & stage.USES_FRICTION_RATIO:
            wheel.friction *= stage.friction_ratio(p, active, w, s)
    if active & stage.USES_TORQUE_LIMIT:
        motor = wheel.effort - robot.back_emf * v / wheel.gain
        wheel.limited = math.copysign(1.0, motor) if abs(motor) > robot.torque_limit else 0.0


@part
def _scrub(wheels: Records, both: Record, limit: float, scrub: float) -> bool:
    """How much of the scrub acts (`both.scrub`), and whether it locks the wheels together.

    With unequal speeds scrub slides and acts in full. With equal ones it takes whatever value keeps them
    equal, as dry friction does at rest; two wheels at rest stay so while some value lets both. Returns
    whether it changed a wheel's direction.
    """
    left, right = wheels[0], wheels[1]
    both.locked = False
    if left.operating_speed != right.operating_speed:
        both.scrub = math.copysign(1.0, left.operating_speed - right.operating_speed)
        return False
    if left.operating_speed != 0.0:
        both.scrub = 0.0
        both.locked = True
        return False
    for w in range(2):
        wheels[w].net = min(max(wheels[w].effort, -limit), limit) + wheels[w].push
    low = max(max(left.net - left.friction, -right.net - right.friction), -scrub)
    high = min(min(left.net + left.friction, -right.net + right.friction), scrub)
    if low <= high:
        both.scrub = 0.5 * (low + high) / scrub if scrub > 0.0 else 0.0
        return False
    s = math.copysign(1.0, left.net + right.net)
    net_left = left.net - s * left.friction
    net_right = right.net - s * right.friction
    wanted = (left.slope * net_left - right.slope * net_right) / (left.slope + right.slope)
    both.locked = abs(wanted) <= scrub
    both.scrub = 0.0 if both.locked else math.copysign(1.0, wanted)
    for w in range(2):
        sign = 1.0 - 2.0 * w
        net = wheels[w].net - sign * scrub * both.scrub
        wheels[w].direction = s if both.locked else math.copysign(1.0, net)
    return True


@part
def _couple(wheels: Records, share: float, starting: bool) -> None:
    """Add the other wheel's share; a wheel that is held hands back what it was given."""
    for w in range(2):
        wheel = wheels[w]
        wheel.net = wheel.level - wheel.rate * wheel.operating_speed
    for w in range(2):
        wheel = wheels[w]
        if starting and wheel.held:
            # Effort that friction has to hold: its own, and what the other wheel passes on.
            passed = share * wheels[1 - w].net / wheel.slope
            total = wheel.effort + wheel.push + passed
            if abs(total) > wheel.friction:
                wheel.held = False
                wheel.direction = math.copysign(1.0, total)
                wheel.net = wheel.slope * (wheel.effort + wheel.push - wheel.direction * wheel.friction)
                wheel.level = wheel.net
    for w in range(2):
        wheel, other = wheels[w], wheels[1 - w]
        if wheel.held:
            continue
        if other.held:
            wheel.level *= 1.0 - share * share
            wheel.rate *= 1.0 - share * share
        else:
            wheel.level += share * other.net
