"""What stands in for the assembled stages when `rollout.py` is read on its own: a robot without effects.

The assembler replaces the import of this module by functions of the same names, built from the hooks.
"""

from __future__ import annotations

import math

from truing.diagnose.data.set_data import FloatArray

USES_SUPPLY = USES_SCRUB = USES_PUSH = USES_COUPLING = USES_SPEED_LIMIT = USES_TORQUE_LIMIT = 0
USES_GAP = USES_GRIP = USES_SLOW = USES_AFTER_STEP = USES_ANGLE = USES_HEADING = USES_MEASURE = 0
USES_SPEED = USES_DIRECTION = USES_BACK_EMF = 0
USES_DELAY = USES_LAG = USES_DRIVE = USES_GAIN = USES_INERTIA = USES_FRICTION = 0
SLOW_SLOTS = STATE_SLOTS = 1

P = FloatArray
# ruff: noqa: ARG001


def delay(p: P, active: int) -> float:
    return 0.0


def lag(p: P, active: int) -> float:
    return 0.0


def drive(p: P, active: int, wheel: int, effort: float) -> float:
    return effort


def supply(
    p: P, active: int, wheel: int, row: int, slows: FloatArray, duty_square: float, duty_speed: float
) -> float:
    return 1.0


def back_emf(p: P, active: int) -> float:
    return 1.0


def friction(p: P, active: int, wheel: int, speed: float, direction: float) -> float:
    return 0.0


def scrub(p: P, active: int) -> float:
    return 0.0


def push(
    p: P,
    active: int,
    wheel: int,
    angle_start: float,
    angle_end: float,
    origin: float,
    heading: float,
    effort_per_mps2: float,
) -> float:
    return 0.0


def torque_limit(p: P, active: int) -> float:
    return math.inf


def gain(
    p: P,
    active: int,
    wheel: int,
    row: int,
    slows: FloatArray,
    direction: float,
    command: float,
    elapsed: float,
) -> float:
    return 1.0


def inertia(
    p: P,
    active: int,
    wheel: int,
    row: int,
    slows: FloatArray,
    direction: float,
    command: float,
    elapsed: float,
) -> float:
    return 1.0


def speed_limit(p: P, active: int) -> float:
    return math.inf


def coupling(p: P, active: int) -> float:
    return 0.0


def gap(p: P, active: int, wheel: int, radius: float) -> float:
    return 0.0


def motor_share(p: P, active: int) -> float:
    return 0.0


def grip(p: P, active: int) -> float:
    return math.inf


def spin_share(p: P, active: int) -> float:
    return 0.0


def measure(
    p: P,
    active: int,
    wheel: int,
    increment: float,
    dt: float,
    angle: float,
    angle_before: float,
    origin: float,
    radius: float,
    top: float,
    states: FloatArray,
    states_before: FloatArray,
) -> float:
    return increment


def ground(
    p: P,
    active: int,
    wheel: int,
    increment: float,
    dt: float,
    angle: float,
    angle_before: float,
    origin: float,
    radius: float,
    top: float,
) -> float:
    return increment


def distance(p: P, active: int, forward: float) -> float:
    return forward


def turning(p: P, active: int, turn: float, forward: float) -> float:
    return turn


def slow_states(
    p: P,
    active: int,
    dt: FloatArray,
    heat: FloatArray,
    draw: FloatArray,
    elapsed: FloatArray,
    slows: FloatArray,
) -> None:
    return None


def after_step(
    p: P,
    active: int,
    wheel: int,
    states: FloatArray,
    h: float,
    speed_start: float,
    speed_end: float,
    travel: float,
) -> None:
    return None
