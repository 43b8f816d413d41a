"""Initial speeds of runs that were cut off in motion, from the rows that follow.

A speed that is extrapolated from two rows has more noise than a row, and a free run carries its error on for
a time constant. As one more number of the model it is estimated from all those rows: its error decays in them
as exp(-t / T). How far it may move is known: the extrapolation is a Gaussian prior, so that where the model
leaves more than noise the initial speeds stay as they were measured.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from truing.arrays import FloatArray
from truing.diagnose.data.set_data import SetData
from truing.diagnose.noise_floor import noise_floor

# Noise of an extrapolation to the start from two rows, over that of a row: hypot(1.5, 0.5).
EXTRAPOLATED = 1.58
# Time constants after which a start is forgotten.
FORGOTTEN_TAUS = 4.0
# Smaller changes are none, as a share of a row's noise.
NEGLIGIBLE = 0.25


def with_likely_starts(data: SetData, speeds: FloatArray, taus: FloatArray) -> SetData:
    """The data with the most likely initial speeds, beside a model; the same object where none changes.

    Parameters
    ----------
    speeds : shape (n, 2), m/s, that the model simulates from the initial speeds as they are.
    taus : shape (2,), s, its time constants.
    """
    fast = noise_floor(data).fast
    prior = 1.0 / np.maximum(EXTRAPOLATED * fast, 1e-12) ** 2
    error = np.where(data.counted, data.speed_mps - speeds, 0.0)
    power = np.maximum((error**2).sum(axis=0) / np.maximum(data.counted.sum(axis=0), 1), 1e-24)
    initial = data.initial_mps.copy()
    for k, (a, b) in enumerate(pairwise(data.starts)):
        since_s = data.t_s[a:b, None] - data.t_s[a]
        decay = np.where(since_s < FORGOTTEN_TAUS * taus, np.exp(-since_s / taus), 0.0) * data.counted[a:b]
        change = (decay * error[a:b]).sum(axis=0) / power / (prior + (decay**2).sum(axis=0) / power)
        initial[k] += np.where(data.initial_mps[k] != 0.0, change, 0.0)
    changed = np.abs(initial - data.initial_mps) > NEGLIGIBLE * fast
    return replace(data, initial_mps=initial) if changed.any() else data
