"""Compiles the simulation before anything waits for it.

The machine code is kept (`truing.model.code_cache`), so that this is done once for each state of the
effects' files.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from truing.diagnose.catalogue import CATALOGUE, Catalogue
from truing.diagnose.data.set_data import set_data
from truing.diagnose.simulation.assemble import Kernel, kernel_of
from truing.diagnose.simulation.simulator import SetSimulator
from truing.model.code_cache import code_folder
from truing.recording.baseline import Baseline, WheelModel
from truing.recording.run import RecordingSet, Run

# Each of the compiled functions leaves an index in the cache. A single axis has no pose.
OF_WHEELS = ("rollout.rollout", "rollout.slow")
OF_POSE = ("ground.ground_motion", "ground.windowed_motion")


def is_compiled(kernel: Kernel) -> bool:
    """Whether the cache holds this simulation's machine code."""
    files = {path.name for path in code_folder().glob(f"truing_kernel_{kernel.mark}_*/*.nbi")}
    functions = OF_WHEELS if int(kernel.stage.WHEELS) == 1 else OF_WHEELS + OF_POSE
    return all(any(file.startswith(f"{name}-") for file in files) for name in functions)


def compile_once(say: Callable[[str], None], catalogue: Catalogue = CATALOGUE, wheels: int = 2) -> None:
    """Compile the simulation unless that was done before; `say` gets a line before and one after.

    Parameters
    ----------
    wheels : 1 for the simulation of a single axis.
    """
    if is_compiled(kernel_of(catalogue, wheels)):
        return
    began = time.monotonic()
    say("compiling the simulation, once (10 to 30 s) ...")
    simulate_rest(catalogue, wheels)
    say(f"compiled the simulation in {time.monotonic() - began:.0f} s")


def simulate_rest(catalogue: Catalogue, wheels: int = 2) -> None:
    """Simulate a few rows at rest with all effects, which calls every compiled function."""
    t_s, rest = np.array([0.0, 0.05, 0.1, 0.15]), np.zeros(4)
    columns = ("effort_left", "effort_right", "pos_left_m", "pos_right_m")
    run = Run("rest", {"t_s": t_s} | dict.fromkeys(columns, rest))
    wheel = WheelModel(1.0, 1.0)
    baseline = Baseline(Path("baseline.toml"), wheel, wheel, None, None, {})
    recordings = RecordingSet("rest", (run,), baseline).of_axis("translation" if wheels == 1 else None)
    simulator = SetSimulator(set_data(recordings), catalogue=catalogue)
    theta, on = simulator.start(), simulator.enabled(catalogue)
    simulator.currents(theta, on)
    simulator.speeds(theta, on)
    if wheels == 2:
        simulator.pose_residuals(theta, on)
