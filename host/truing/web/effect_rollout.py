"""What a baseline with effects does under the efforts of a run: its wheels' speeds and its path."""

from __future__ import annotations

import math

import numpy as np

from truing.baseline import Baseline
from truing.errors import TruingError
from truing.recording import FloatArray, RecordingSet, Run
from truing.web.pose import Pose


def effect_rollout(run: Run, baseline: Baseline, start: Pose) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time (n,), speeds (n, 2) in m/s and path (n, 3) in m, m, rad, from efforts alone.

    Effects that last over a whole set (charge, heat) see this one run only.

    Raises
    ------
    TruingError : the run or an effect is nothing that can be simulated.
    """
    # Late: the catalogue is compiled on its first use.
    from truing.diagnose.data import set_data
    from truing.diagnose.simulation.simulator import SetSimulator

    data = set_data(RecordingSet(run.name, (run,), baseline))
    simulator = SetSimulator(data, baseline, commanded=True)
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
    return data.t_s, speeds, np.column_stack((x, y, heading))
