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

# Each of the compiled functions leaves an index in the cache.
FUNCTIONS = ("rollout.rollout", "rollout.slow", "ground.ground_motion", "ground.windowed_motion")


def is_compiled(kernel: Kernel) -> bool:
    """Whether the cache holds this simulation's machine code."""
    files = {path.name for path in code_folder().glob(f"truing_kernel_{kernel.mark}_*/*.nbi")}
    return all(any(file.startswith(f"{name}-") for file in files) for name in FUNCTIONS)


def compile_once(say: Callable[[str], None], catalogue: Catalogue = CATALOGUE) -> None:
    """Compile the simulation unless that was done before; `say` gets a line before and one after."""
    if is_compiled(kernel_of(catalogue)):
        return
    began = time.monotonic()
    say("compiling the simulation, once (10 to 30 s) ...")
    simulate_rest(catalogue)
    say(f"compiled the simulation in {time.monotonic() - began:.0f} s")


def simulate_rest(catalogue: Catalogue) -> None:
    """Simulate a few rows at rest with all effects, which calls every compiled function."""
    t_s, rest = np.array([0.0, 0.05, 0.1, 0.15]), np.zeros(4)
    columns = ("effort_left", "effort_right", "pos_left_m", "pos_right_m")
    run = Run("rest", {"t_s": t_s} | dict.fromkeys(columns, rest))
    wheel = WheelModel(1.0, 1.0)
    baseline = Baseline(Path("baseline.toml"), wheel, wheel, None, None, {})
    simulator = SetSimulator(set_data(RecordingSet("rest", (run,), baseline)), catalogue=catalogue)
    theta, on = simulator.start(), simulator.enabled(catalogue)
    simulator.currents(theta, on)
    simulator.speeds(theta, on)
    simulator.pose_residuals(theta, on)
