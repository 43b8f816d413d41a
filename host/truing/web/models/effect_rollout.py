"""Simulation of a baseline with effects under the efforts of a run: wheel speeds and path."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from truing.arrays import FloatArray
from truing.errors import TruingError
from truing.recording.baseline import Baseline
from truing.recording.run import RecordingSet, Run
from truing.web.pose import Pose

# Effects whose state persists between runs: charge, heat, a changed load, the wheels' angle.
_EFFECTS_WITH_MEMORY = {
    "supply_sag",
    "winding_heating",
    "payload_change",
    "torque_ripple",
    "encoder_eccentricity",
    "gear_backlash",
}


def has_memory(baseline: Baseline) -> bool:
    """Whether an effect of the baseline depends on earlier runs."""
    return not _EFFECTS_WITH_MEMORY.isdisjoint(baseline.effects)


def effect_rollout(
    run: Run, baseline: Baseline, start: Pose, set_runs: Sequence[Run] = ()
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Time (n,), speeds (n, 2) in m/s and path (n, 3) in m, m, rad, from efforts alone.

    Without a wheelbase there is no path.

    Parameters
    ----------
    set_runs : all runs of the recording set in order, including this one: they determine the initial state
        of effects with memory. Without it the run is simulated alone.

    Raises
    ------
    TruingError : the run or an effect cannot be simulated.
    """
    # Imported late: the catalogue is compiled on its first use.
    from truing.diagnose.data.set_data import set_data
    from truing.diagnose.simulation.simulator import SetSimulator

    runs = tuple(set_runs) if any(one.name == run.name for one in set_runs) else (run,)
    index = next(k for k, one in enumerate(runs) if one.name == run.name)
    data = set_data(RecordingSet(run.name, runs, baseline))
    simulator = SetSimulator(data, baseline, commanded=True)
    if len(runs) > 1:
        simulator = simulator.select([index])
    try:
        theta = simulator.start()
    except KeyError as error:
        raise TruingError(f"an effect of the model has no parameter {error}") from error
    on = simulator.enabled(())
    speeds = simulator.speeds(theta, on)
    if not baseline.wheelbase_m:
        return data.t_s[simulator.rows], speeds, None
    forward, turn, lateral = simulator.ground(theta, on).T
    heading = start.theta_rad + np.cumsum(turn)
    middle = heading - 0.5 * turn
    # The chord of an arc is sin(T/2)/(T/2) times as long as the arc.
    chord = forward * np.sinc(turn / (2.0 * math.pi))
    x = start.x_m + np.cumsum(chord * np.cos(middle) - lateral * np.sin(middle))
    y = start.y_m + np.cumsum(chord * np.sin(middle) + lateral * np.cos(middle))
    return data.t_s[simulator.rows], speeds, np.column_stack((x, y, heading))
