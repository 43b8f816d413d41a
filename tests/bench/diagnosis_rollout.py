"""What one simulation of a whole set costs a diagnosis, effect by effect."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from bench.figure import Figure
from support.simulated_runs import RICH, by_run, recordings
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data.set_data import SetData
from truing.diagnose.simulation.simulator import SetSimulator

RUNS = 13
ROUNDS = 7


def measure(root: Path) -> list[Figure]:
    """CPU time of simulating 13 runs of 15 s at 20 Hz: without effects, and with the slowest one."""
    data = _driven()
    nothing = _milliseconds(data, ())
    name, slowest = max(
        ((name, _milliseconds(data, (name,))) for name in CATALOGUE), key=lambda item: item[1]
    )
    peer = "the same without effects"
    return [
        Figure("simulating 195 s, no effect", nothing, "ms", "less", bar=5),
        Figure(f"simulating 195 s, {name} (the slowest)", slowest, "ms", "less", 5, peer, nothing),
    ]


def _driven() -> SetData:
    """Runs whose measured speeds are those of the robot itself."""
    effort = np.concatenate(RICH)
    first = SetSimulator(recordings((effort,) * RUNS))
    speeds = first.speeds(first.start(), first.enabled([]))
    return recordings((effort,) * RUNS, by_run(first.data, speeds))


def _milliseconds(data: SetData, names: tuple[str, ...]) -> float:
    simulator = SetSimulator(data)
    theta = simulator.start()
    for name in names:
        for item in CATALOGUE[name].parameters:
            if item.starts:
                theta[simulator.layout.index(f"{name}.{item.name}")] = item.starts[0]
    on = simulator.enabled(names)
    spans = []
    for turn in range(ROUNDS):
        # The last speeds are kept: another gain makes another simulation.
        theta[0] *= 1.0 + 1e-6 * turn
        begin = time.process_time()
        simulator.speeds(theta, on)
        spans.append(time.process_time() - begin)
    return 1e3 * float(np.median(spans))
