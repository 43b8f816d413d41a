"""What a baseline with effects does under the efforts of a run: its wheels' speeds and its path."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from truing.baseline import Baseline
from truing.errors import TruingError
from truing.recording import FloatArray, RecordingSet, Run
from truing.web.pose import Pose

# These remember what came before the run: charge, heat, a load that changed, the wheels' angle.
_REMEMBERING = {
    "supply_sag",
    "winding_heating",
    "payload_change",
    "torque_ripple",
    "encoder_eccentricity",
    "gear_backlash",
}


def remembers(baseline: Baseline) -> bool:
    """Whether an effect of the baseline depends on the runs before."""
    return not _REMEMBERING.isdisjoint(baseline.effects)


def effect_rollout(
    run: Run, baseline: Baseline, start: Pose, whole: Sequence[Run] = ()
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time (n,), speeds (n, 2) in m/s and path (n, 3) in m, m, rad, from efforts alone.

    Parameters
    ----------
    whole : the set that the run belongs to, in order, itself among them: what effects remember comes from
        there. Without it the run is all there is.

    Raises
    ------
    TruingError : the run or an effect is nothing that can be simulated.
    """
    # Late: the catalogue is compiled on its first use.
    from truing.diagnose.data import set_data
    from truing.diagnose.simulation.simulator import SetSimulator

    runs = tuple(whole) if any(one.name == run.name for one in whole) else (run,)
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
    forward, turn, aside = simulator.ground(theta, on).T
    heading = start.theta_rad + np.cumsum(turn)
    middle = heading - 0.5 * turn
    # The chord of an arc is sin(T/2)/(T/2) times as long as the arc.
    chord = forward * np.sinc(turn / (2.0 * math.pi))
    x = start.x_m + np.cumsum(chord * np.cos(middle) - aside * np.sin(middle))
    y = start.y_m + np.cumsum(chord * np.sin(middle) + aside * np.cos(middle))
    return data.t_s[simulator.rows], speeds, np.column_stack((x, y, heading))
