"""What the compiled simulation reads, works in and writes: arrays by name, and one record per wheel.

`WHEEL` and `BOTH` hold what changes on the way; a record goes to a compiled function as one pointer.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from truing.arrays import FloatArray, IntArray

# A record in compiled code, with the fields of one of the types below.
Record: TypeAlias = Any
# Records, shape (2,) for the wheels (left, right).
Records: TypeAlias = np.ndarray[Any, np.dtype[np.void]]

# The exponential that was computed last for one purpose.
EXPONENTIAL = np.dtype([
    ("rate", float),  # 1/s
    ("span", float),  # s
    ("integral", float),  # s, (1 - exp(-rate span)) / rate
    ("keep", float),  # exp(-rate span)
])  # fmt: skip

# Bodies that move as one: dv/dt = level - rate v.
CLUSTER = np.dtype([
    ("speed", float),  # m/s
    ("level", float),  # m/s^2
    ("rate", float),  # 1/s
    ("end", float),  # m/s, speed after the span
    ("held", bool),  # dry friction holds it at rest
], align=True)  # fmt: skip

WHEEL = np.dtype([
    # State.
    ("speed", float),  # m/s
    ("travel", float),  # m, of the encoder's shaft, since the segment began
    ("duty", float),  # effort that the driver gives after its lag
    ("heat", float),  # s, integral of the squared motor current over the row, of stall current
    # Input.
    ("piece", int),  # number of the piece of constant effort
    ("command", float),  # commanded effort, delayed
    ("target", float),  # effort that the driver gives out, before its lag
    # Row: its start, and the measured wheel angles of its run and of the substep's two ends, rad.
    ("travel_before", float),
    ("ground_before", float),
    ("origin", float),
    ("angle_start", float),
    ("angle_end", float),
    # Substep: dv/dt = level - rate v + transient exp(-t / lag).
    ("operating_speed", float),  # m/s, at which speed-dependent effects are evaluated
    ("level", float),  # m/s^2
    ("rate", float),  # 1/s
    ("transient", float),  # m/s^2
    ("held", bool),  # friction or the speed limit holds the speed
    ("direction", float),  # -1 or 1
    ("start_duty", float),  # effort at the substep's start
    ("mean_duty", float),  # mean effort over the substep
    ("effort", float),  # mean effort times supply
    ("push", float),  # effort that acts at all times
    ("friction", float),  # effort against the motion
    ("gain", float),  # m/s per effort
    ("free_rate", float),  # 1/s, rate while the motor's torque is not limited
    ("slope", float),  # m/s^2 per effort
    ("limited", float),  # -1 or 1 where the torque is limited, else 0
    ("net", float),  # effort or acceleration, while scrub or coupling is worked out
    ("end", float),  # m/s, speed at the substep's end
    ("distance", float),  # m, travel in the substep
    # Exponentials over the whole substep, over its half, and of the lag against the wheel.
    ("whole", EXPONENTIAL),
    ("half", EXPONENTIAL),
    ("against", EXPONENTIAL),
    # Bodies of a wheel that has a gap or slides (`kernel/bodies.py`).
    ("motor_speed", float),  # m/s
    ("rim_speed", float),  # m/s
    ("robot_speed", float),  # m/s
    ("place", float),  # of the motor's side in the gap, 0 (behind) to 1 (ahead)
    ("touch", float),  # side of the gap that touches: -1 behind, 1 ahead, 0 none
    ("rolls", bool),  # the tyre does not slide
    ("ground", float),  # m, travel over the ground since the segment began
    ("motor_side", CLUSTER),
    ("rim_side", CLUSTER),
    ("robot_side", CLUSTER),
], align=True)  # fmt: skip

BOTH = np.dtype([
    ("draw", float),  # s, integral over the row of the motors' battery currents, of one at stall
    ("scrub", float),  # share of the scrub that acts, -1..1
    ("locked", bool),  # scrub keeps both wheels at one speed
    ("lag", EXPONENTIAL),  # of the lag between driver and motor
], align=True)  # fmt: skip


class Inputs(NamedTuple):
    """What a simulation reads of a recording set (n rows) and its robot.

    Attributes
    ----------
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
    wheelbase : m, infinite where it is not known.
    instant : the recorder reads a speed at the row's time, not its mean over the row.
    """

    start: IntArray
    first_piece: IntArray
    piece_end: FloatArray
    piece_effort: FloatArray
    t: FloatArray
    dt: FloatArray
    elapsed: FloatArray
    interval: FloatArray
    initial: FloatArray
    angles: FloatArray
    angle_rates: FloatArray
    origins: FloatArray
    heading: FloatArray
    radius: float
    top: FloatArray
    wheelbase: float
    instant: bool


class Scratch(NamedTuple):
    """What a simulation writes and works in; numba has no allocation here.

    Attributes
    ----------
    speed : shape (n, 2), m/s, the speed that the recorder would report.
    lost : shape (n, 2), m, encoder travel minus ground travel in the row's interval.
    heat, draw : shapes (n, 2), (n,): see `stages.SLOW_CONTEXT`; valid where the currents are tracked.
    slows : shape (slots, n, 2), slow states of effects, read by `rollout`.
    wheels, both : shape (2,) of WHEEL, shape (1,) of BOTH.
    states, states_before : shape (slots, 2), effects' states now and at the row's start.
    """

    speed: FloatArray
    lost: FloatArray
    heat: FloatArray
    draw: FloatArray
    slows: FloatArray
    wheels: Records
    both: Records
    states: FloatArray
    states_before: FloatArray


def new_scratch(rows: int, slow_slots: int, state_slots: int) -> Scratch:
    """Scratch for a set of this many rows; the columns of a side that is not simulated stay zero."""
    return Scratch(
        speed=np.zeros((rows, 2)),
        lost=np.zeros((rows, 2)),
        heat=np.zeros((rows, 2)),
        draw=np.zeros(rows),
        slows=np.zeros((slow_slots, rows, 2)),
        wheels=np.zeros(2, WHEEL),
        both=np.zeros(1, BOTH),
        states=np.zeros((state_slots, 2)),
        states_before=np.zeros((state_slots, 2)),
    )


class Robot(NamedTuple):
    """The simulated robot: its numbers, the effects that are on, and what they give for a whole simulation.

    Attributes
    ----------
    p : the baseline's four numbers (gain and time constant of the left, of the right wheel), then every
        effect's parameters in plain units.
    active : bit e is set where effect e is on.
    slows, states : see `Scratch`.
    delay ... motor_share : the stages of these names (`stages.STAGES`).
    """

    p: FloatArray
    active: int
    slows: FloatArray
    states: FloatArray
    radius: float
    delay: tuple[float, float]
    lag: float
    torque_limit: float
    back_emf: float
    speed_limit: float
    scrub: float
    coupling: float
    grip: float
    spin_share: float
    motor_share: float


class Bodies(NamedTuple):
    """One wheel's bodies over a substep.

    Attributes
    ----------
    motor, back_emf : effort at the motor, and how much of it is lost per m/s.
    push : effort on the wheel at all times.
    dry, dry_motor : dry friction of everything together, and on the motor's side of the gap, effort.
    slope : acceleration of everything together per effort, m/s^2.
    gap : m at the rim.
    grip : largest acceleration that the tyre gives, m/s^2.
    motor_share, rim_share, robot_share : shares of the inertia.
    """

    motor: float
    back_emf: float
    push: float
    dry: float
    dry_motor: float
    slope: float
    gap: float
    grip: float
    motor_share: float
    rim_share: float
    robot_share: float
