"""The places in the simulation where an effect may act, and what a hook there may ask for.

The baseline of each wheel, in effort units, is `tau dv/dt = gain u - v`. With every stage in place:

    u  = drive(command(t - delay)), lagged by `lag`, times `supply`
    m  = clip(u - e v / g, torque_limit)                   what the motor gives; g = gain * gain()
    dv/dt = (g / T) (m - (1 - e) v / g + push - s (friction + scrub))   T = tau * inertia(), s the direction

The baseline cannot tell a motor's back-EMF from losses that grow with speed; where current matters,
`back_emf` is the share e of it.

`coupling` adds the other wheel's acceleration; `speed_limit` holds the speed; `gap` and `grip` split the
wheel into bodies that touch or slide. The encoder's travel over a row passes through `measure` and is
what the recorder reports; measured travel passes through `ground`, `distance` and `turning` on its way
to a pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Combine = Literal["sum", "product", "smallest", "largest", "chain"]


@dataclass(frozen=True, slots=True)
class Stage:
    """One place for hooks.

    Attributes
    ----------
    combine : how the values of several effects become one; a chain hands on its first context name.
    context : what a hook may ask for beside its parameters.
    """

    combine: Combine
    context: tuple[str, ...]
    meaning: str


STAGES: dict[str, Stage] = {
    "delay": Stage("sum", ("wheel",), "s by which the wheel's command arrives late"),
    "lag": Stage("largest", (), "s, first-order lag between the driver's command and the motor"),
    "drive": Stage("chain", ("effort",), "commanded effort in, effort that the driver gives out"),
    "supply": Stage(
        "product",
        ("duty_square", "duty_speed", "slow"),
        "supply voltage over nominal; duty_square and duty_speed are the means over the wheels of "
        "u^2 and u e v / g (the load current of a pulse-width bridge is u (u V - e v / g))",
    ),
    "back_emf": Stage("product", (), "back-EMF at the full-effort speed, over the supply"),
    "friction": Stage("sum", ("speed", "direction"), "effort against the motion at this |speed| (m/s)"),
    "friction_ratio": Stage("product", ("direction",), "factor on that effort"),
    "scrub": Stage("sum", (), "effort against the wheels turning differently"),
    "push": Stage(
        "sum",
        ("wheel", "angle_start", "angle_end", "origin", "heading", "effort_per_mps2"),
        "effort that acts at all times; angles are measured ones (rad) at the substep's two ends, running "
        "on from run to run; origin is the angle at which the run began",
    ),
    "torque_limit": Stage("smallest", (), "largest motor torque, as a share of stall torque"),
    "gain": Stage(
        "product",
        ("wheel", "direction", "command", "elapsed", "slow"),
        "factor on the steady speed per effort; direction is -1 or 1, command the delayed effort, "
        "elapsed the time since the start of the set (s)",
    ),
    "inertia": Stage(
        "product", ("wheel", "direction", "command", "elapsed", "slow"), "factor on the time constant"
    ),
    "speed_limit": Stage("smallest", (), "m/s that the wheel does not exceed"),
    "coupling": Stage("sum", (), "share of the other wheel's own acceleration that this one feels"),
    "gap": Stage("sum", ("radius",), "m at the rim, free play between encoder shaft and wheel"),
    "motor_share": Stage("sum", (), "share of the inertia on the motor's side of the gap"),
    "grip": Stage("smallest", (), "largest acceleration that the tyre can give the robot, m/s^2"),
    "spin_share": Stage("sum", (), "share of the inertia that turns when the tyre slides"),
    "measure": Stage(
        "chain",
        (
            "wheel",
            "increment",
            "dt",
            "angle",
            "angle_before",
            "origin",
            "radius",
            "top",
            "state",
            "state_before",
        ),
        "the encoder shaft's travel over a row (m) in, what the recorder reports out; top is the "
        "baseline's full-effort speed (m/s)",
    ),
    "ground": Stage(
        "chain",
        ("increment", "dt", "angle", "angle_before", "origin", "radius", "top"),
        "measured wheel travel over a row (m) in, travel over the ground out",
    ),
    "distance": Stage("chain", ("forward",), "mean of the wheels' ground travel (m) in, forward motion out"),
    "turning": Stage(
        "chain", ("turn", "forward"), "heading change over a row (rad) in, with what is missing from it out"
    ),
}

# Hooks of another form, called with arrays or with a state of their own:
# slow(dt, heat, draw, elapsed, out): once per simulation, after a first pass without the slow effects.
#   dt (n,) s; heat (n, 2) mean squared motor current over the row, of stall current; draw (n,) mean battery
#   current, of all motors at stall; out (n, 2), written; a hook's `slow` is its own entry at the current
#   row and wheel.
# after_step(state, wheel, h, speed_start, speed_end, travel): returns the effect's state of one wheel after a
#   substep; it starts a segment as the wheel's speed.
SLOW_CONTEXT = ("dt", "heat", "draw", "elapsed", "out")
STATE_CONTEXT = ("state", "wheel", "h", "speed_start", "speed_end", "travel")
