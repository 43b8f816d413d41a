"""N4SID by SIPPY, its order chosen by its own Bayesian information criterion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.studies.real.peers.discrete import free_run, one_record, quiet
from truing.studies.real.peers.peer import Peer, WheelModel
from truing.studies.real.peers.wheel_runs import WheelRun

BLOCK_ROWS = 20
MOST_STATES = 4


@dataclass(frozen=True, slots=True)
class StateSpaceWheel:
    """x[k + 1] = A x[k] + B u[k], v[k] = C x[k], with u[k] the effort between rows k and k + 1."""

    interval_s: float
    a: FloatArray
    b: FloatArray
    c: FloatArray

    def simulate(self, run: WheelRun) -> FloatArray:
        """Free run from the smallest state that has the first speed."""

        def step(effort: FloatArray, speed: FloatArray) -> FloatArray:
            state = np.linalg.pinv(self.c[None, :])[:, 0] * speed[0]
            for k in range(1, len(speed)):
                state = self.a @ state + self.b * effort[k - 1]
                speed[k] = self.c @ state
            return speed

        return free_run(run, self.interval_s, step)


def fit_n4sid(runs: Sequence[WheelRun], near: WheelModel | None = None) -> WheelModel:
    """One model of all runs laid end to end.

    Parameters
    ----------
    near : a model whose order is taken; None: it is chosen.
    """
    record = one_record(runs)
    choice: dict[str, Any] = {"IC": "BIC", "SS_orders": [1, MOST_STATES]}
    if isinstance(near, StateSpaceWheel):
        choice = {"SS_fixed_order": len(near.b)}
    with quiet("SIPPY's N4SID"):
        from sippy_unipi import system_identification

        found = system_identification(
            record.speed_mps, record.effort, "N4SID", tsample=record.interval_s,
            SS_f=BLOCK_ROWS, SS_A_stability=True, **choice,
        )  # fmt: skip
        a, b, c = (np.asarray(part, dtype=float) for part in (found.A, found.B, found.C))
    return StateSpaceWheel(record.interval_s, a, b[:, 0], c[0])


N4SID = Peer("n4sid", "N4SID (SIPPY)", fit_n4sid, module="sippy_unipi", library="sippy-unipi")
