"""ARX by SIPPY, its orders and delay chosen by its own Bayesian information criterion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.studies.real.peers.discrete import free_run, one_record, quiet
from truing.studies.real.peers.peer import Peer, WheelModel
from truing.studies.real.peers.wheel_runs import WheelRun

# SIPPY takes a twentieth of a second for each combination.
MOST_OUTPUTS, MOST_INPUTS, MOST_DELAY_ROWS = 2, 2, 5


@dataclass(frozen=True, slots=True)
class ArxWheel:
    """v[k] = sum a_i v[k - i] + sum b_j u[k - j - 1], with u[k - 1] the effort between rows k - 1 and k.

    Attributes
    ----------
    outputs, inputs : a_1 and b_0 first; zeros stand for terms that are not there.
    orders : how many outputs, how many inputs, and the delay in rows.
    """

    interval_s: float
    outputs: FloatArray
    inputs: FloatArray
    orders: tuple[int, int, int]

    def simulate(self, run: WheelRun) -> FloatArray:
        """Free run; before the run its first speed and first effort are taken to have lasted."""

        def step(effort: FloatArray, speed: FloatArray) -> FloatArray:
            na, nb = len(self.outputs), len(self.inputs)
            v = np.concatenate((np.full(na, speed[0]), speed))
            u = np.concatenate((np.full(nb, run.effort[0]), effort))
            for k in range(1, len(speed)):
                past = v[na + k - na : na + k][::-1]
                driven = u[k : nb + k][::-1]
                v[na + k] = self.outputs @ past + self.inputs @ driven
            return np.asarray(v[na:])

        return free_run(run, self.interval_s, step)


def fit_arx(runs: Sequence[WheelRun], near: WheelModel | None = None) -> WheelModel:
    """One model of all runs laid end to end.

    Parameters
    ----------
    near : a model whose orders and delay are taken; None: they are chosen.
    """
    record = one_record(runs)
    orders = near.orders if isinstance(near, ArxWheel) else None
    with quiet("SIPPY's ARX"):
        from sippy_unipi import system_identification

        choice: dict[str, Any] = {
            "IC": "BIC",
            "na_ord": [1, MOST_OUTPUTS],
            "nb_ord": [1, MOST_INPUTS],
            "delays": [0, MOST_DELAY_ROWS],
        }
        if orders is not None:
            choice = {"ARX_orders": list(orders)}
        found = system_identification(
            record.speed_mps, record.effort, "ARX", tsample=record.interval_s, **choice
        )
        a, b = (np.ravel(_first(part)).astype(float) for part in (found.DENOMINATOR, found.NUMERATOR))
        if orders is None:
            orders = (int(found.na), int(found.nb), int(found.theta))
    return ArxWheel(record.interval_s, -a[1:], b, orders)


def _first(nested: Any) -> Any:
    """The polynomial of the only input and output, which SIPPY nests in lists of lists."""
    while isinstance(nested, list | tuple | np.ndarray) and np.ndim(nested[0]) > 0:
        nested = nested[0]
    return nested


ARX = Peer("arx", "ARX (SIPPY)", fit_arx, module="sippy_unipi", library="sippy-unipi")
