"""Regression of acceleration on speed, effort and the sign of speed, as robot teams do (WPILib's SysId).

The model is a = (gain (u - s sign v) - v) / tau, linear in what multiplies u, v and sign v; samples near
standstill are left out. Friction is named where it is significantly above zero and more than a trace.
"""

from __future__ import annotations

import numpy as np

from truing.diagnose.data.set_data import SetData
from truing.trial.comparators.opinion import Opinion, slopes

SIDES = ("left", "right")
# Below this share of full speed a sample is thrown away.
_STANDING = 0.02
# Standard errors, and effort, beyond which friction is believed.
_SURE, _MIN_EFFORT = 3.0, 0.01


def sysid(data: SetData) -> Opinion:
    """Return the opinion of a least-squares fit per wheel."""
    numbers: dict[str, float] = {}
    named = False
    for wheel, side in enumerate(SIDES):
        seen = slopes(data, wheel)
        moving = np.abs(seen.speed) > _STANDING * data.top_mps
        terms = np.column_stack([seen.effort, seen.speed, np.sign(seen.speed)])[moving]
        target = seen.acceleration[moving]
        if len(target) <= terms.shape[1]:
            continue
        weights, *_ = np.linalg.lstsq(terms, target, rcond=None)
        left = target - terms @ weights
        spread = np.linalg.pinv(terms.T @ terms) * float(left @ left) / (len(target) - terms.shape[1])
        drive, back, dry = (float(value) for value in weights)
        if drive <= 0.0 or back >= 0.0:
            continue
        friction = -dry / drive
        numbers[f"gain_{side}"], numbers[f"tau_{side}"] = -drive / back, -1.0 / back
        numbers[f"coulomb_friction.{side}"] = max(friction, 0.0)
        sure = -dry > _SURE * float(np.sqrt(spread[2, 2]))
        named = named or (sure and friction > _MIN_EFFORT)
    return Opinion(("coulomb_friction",) if named else (), numbers)
