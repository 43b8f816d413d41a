"""Compiles the simulation before anything waits for it; run as a module, it says so and how long it took.

The machine code is kept in NUMBA_CACHE_DIR, so that this is done once for each state of the effects' files.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from truing.diagnose.catalogue import CATALOGUE, Catalogue
from truing.diagnose.data.set_data import FloatArray, IntArray
from truing.diagnose.simulation.assemble import BASELINE_PARAMETERS, Kernel, kernel_of
from truing.diagnose.simulation.rows import ROWS

# Of the four compiled functions, each leaves an index in the cache.
FUNCTIONS = ("rollout", "slow", "ground_motion", "windowed_motion")


def is_compiled(kernel: Kernel) -> bool:
    """Whether the cache holds this simulation's machine code."""
    place = os.environ.get("NUMBA_CACHE_DIR")
    if not place:
        return False
    files = {path.name for path in Path(place).glob(f"*/*_{kernel.mark}.*.nbi")}
    return all(any(f".{name}-" in file for file in files) for name in FUNCTIONS)


def compile_once(say: Callable[[str], None], catalogue: Catalogue = CATALOGUE) -> None:
    """Compile the simulation unless that was done before; `say` gets a line before and one after."""
    kernel = kernel_of(catalogue)
    if is_compiled(kernel):
        return
    began = time.monotonic()
    say("compiling the simulation, once (10 to 30 s) ...")
    run_on_nothing(kernel, BASELINE_PARAMETERS + sum(len(e.parameters) for e in catalogue.values()))
    say(f"compiled the simulation in {time.monotonic() - began:.0f} s")


def run_on_nothing(kernel: Kernel, parameters: int) -> None:
    """Call every function with arrays of the right kind and without rows."""
    no_rows: FloatArray = np.zeros(0)
    no_pairs: FloatArray = np.zeros((0, 2))
    no_segments: IntArray = np.zeros(0, dtype=np.int64)
    p = np.ones(parameters)
    slows = np.zeros((int(kernel.stage.SLOW_SLOTS), 0, 2))
    states = np.zeros((int(kernel.stage.STATE_SLOTS), 2))
    pieces = np.zeros((2, 1))
    top = np.ones(2)
    kernel.rollout(
        p, 0, False, no_segments, 1.0, no_rows, no_segments, np.zeros((2, 1), dtype=np.int64), pieces, pieces,
        no_rows, no_rows, no_rows, no_rows, no_pairs, no_pairs, no_pairs, no_pairs, no_rows, 1.0, top, slows,
        np.zeros((ROWS, 2)), states, states.copy(), no_pairs, no_pairs, no_pairs, no_rows,
    )  # fmt: skip
    kernel.slow(p, 0, no_rows, no_pairs, no_rows, no_rows, slows)
    triples = np.zeros((0, 3))
    kernel.ground_motion(
        p, 0, no_pairs, no_pairs, no_rows, no_rows, no_pairs, no_pairs, 1.0, top, 1.0, triples
    )  # fmt: skip
    kernel.windowed_motion(triples, no_segments, no_segments, triples)


if __name__ == "__main__":
    compile_once(print)
