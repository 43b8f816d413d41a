"""An effect's table in a baseline that behaves exactly as a fit did, unreported numbers included."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.result import EffectParameter
from truing.recording.baseline import Baseline


def effect_table(
    name: str,
    parameters: Mapping[str, EffectParameter],
    exact: Mapping[str, float],
    baseline: Baseline,
) -> dict[str, Any]:
    """The table of one effect.

    Parameters
    ----------
    parameters : as reported. A wheel that was not diagnosed has none: it keeps the baseline's, or no effect.
    exact : the fit's own numbers (`Diagnosis.exact`). Those that the reported ones do not hold, such as the
        speed over which breakaway friction fades or the phase of a ripple, are written beside them.
    """
    numbers = {"gain_left": baseline.left.gain_mps, "gain_right": baseline.right.gain_mps}
    numbers |= {"tau_left": baseline.left.time_constant_s, "tau_right": baseline.right.time_constant_s}
    entry = CATALOGUE[name]
    absent = entry.reported({item.name: item.off for item in entry.parameters} | numbers)
    of_a_wheel = {key: value for key, value in absent.items() if {"left", "right"} & set(key.split("_"))}
    table = of_a_wheel | baseline.effects.get(name, {}) | {key: one.value for key, one in parameters.items()}
    held = entry.from_baseline(table | numbers)
    more = {
        key: value for key, value in exact.items() if key not in absent and _differs(held.get(key), value)
    }
    return table | more


def _differs(held: float | None, value: float) -> bool:
    return held is None or abs(held - value) > 1e-9 * max(abs(value), 1e-9)
