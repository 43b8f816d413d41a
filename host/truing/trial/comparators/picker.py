"""A picker by training error alone: of all single effects that were fitted, the one with the smallest.

It uses the very fits of the diagnosis and nothing else of it: no penalty per parameter, no ambiguity, no
way to say that nothing is missing.
"""

from __future__ import annotations

import math

import numpy as np

from truing.diagnose.result import Diagnosis
from truing.trial.comparators.opinion import Opinion


def picker(diagnosis: Diagnosis, rows: int) -> Opinion:
    """Return the effect with the smallest training error.

    Parameters
    ----------
    rows : samples that the fits saw, whose logarithm is the diagnosis' penalty for each parameter.
    """
    penalty = 0.5 * math.log(max(rows, 2))
    best, name = -math.inf, ""
    for entry in diagnosis.ranking:
        if len(entry.names) != 1 or not entry.fitted:
            continue
        gain = entry.improvement + penalty * entry.parameters
        if np.isfinite(gain) and gain > best:
            best, name = gain, entry.names[0]
    return Opinion((name,) if name else (), {})
