"""The mass changes during or between runs: something is put on the robot, or taken off.

    T after = r T before, from the moment `at` of the set on

The time constant of a wheel drive is inertia over damping (Franklin, Powell and Emami-Naeini, Feedback
Control of Dynamic Systems, section 2.1): a load lengthens it and leaves steady speeds alone. `at` counts
from the set's first row, runs one right after the other.

In data: from one moment on every start and stop is slower (or quicker) by the same share; steady speeds
are as before.

Confused with: winding heating, which comes slowly and takes steady speed as well; a wrong time
constant, which is there from the start. The first run repeated as the last one separates it from both.
"""

from __future__ import annotations

from truing.diagnose.data import exercise
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Parameter


def inertia(time_constant_ratio: float, at: float, elapsed: float) -> float:
    """Factor on the time constant at this moment of the set."""
    return time_constant_ratio if elapsed >= at else 1.0


def _exercised(data: SetData) -> float:
    """Another time constant shows in transients alone: alike ones are needed before a change and after it.

    Starts alone before and stops alone after differ by friction and braking as well.
    """
    rows = exercise.effort_step_rows(data)
    early = data.elapsed_s[rows] < 0.5 * data.duration_s
    # A controller brakes with effort: what is a start and what a stop, the speed says.
    starts = exercise.speeds_up_after(data, rows)
    fewest = min(int((half & kind).sum()) for half in (early, ~early) for kind in (starts, ~starts))
    fewer = min(int(early.sum()), int((~early).sum()))
    return min(
        exercise.enough(len(rows), 8.0),
        exercise.enough(fewer, 2.0),
        exercise.enough(fewest, 1.0),
        exercise.enough(data.duration_s, 20.0),
    )


EFFECT = Effect(
    name="payload_change",
    title="the load changes during the set",
    equation="T after = r T before",
    source="Franklin, Powell and Emami-Naeini, Feedback Control of Dynamic Systems, section 2.1",
    signature="from one moment on every start and stop is slower by the same share; steady speeds stay",
    separated_by={
        "winding_heating": "load, rest, repeat: a load stays, heat goes",
        "supply_sag": "the first run repeated as the last: a load leaves steady speeds alone",
    },
    excited_by=(
        "Record 20 s or more with the same starts and stops in both halves of the set, and repeat the "
        "first run as the last one."
    ),
    parameters=(
        Parameter("time_constant_ratio", "1", 0.2, 5.0, 1.0, (1.2, 0.85), log=True),
        Parameter(
            "at",
            "s",
            0.0,
            1.0,
            0.5,
            tuple(k / 25.0 for k in range(1, 25)),
            scale="duration",
            scan=True,
            fixed=True,
        ),
    ),
    exercised=_exercised,
)
