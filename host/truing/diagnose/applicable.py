"""Which effects of the catalogue these recordings and this baseline allow to be judged at all."""

from __future__ import annotations

from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data import SetData
from truing.diagnose.effect import Effect, Need

# What only measured wheels show, or what is one thing with a gain where none is measured.
OF_MEASURED_WHEELS = frozenset(
    {
        *("encoder_scale", "encoder_dropout", "encoder_eccentricity", "speed_filter"),
        *("gear_backlash", "torque_ripple", "wheel_slip", "wheel_radius_error"),
    }
)
# What is between two wheels.
OF_TWO_WHEELS = frozenset({"turning_scrub", "inertia_coupling", "side_asymmetry"})
# Below this an effect of ordinary strength would not rise out of the noise.
FULLY = 1.0


def applicable_effects(data: SetData) -> list[str]:
    """Effects to try, in the catalogue's order: not in the baseline, judgeable, exercised."""
    return [
        name
        for name, effect in CATALOGUE.items()
        if name not in data.baseline.effects
        and not missing_needs(data, effect)
        and effect.exercised(data) > 0.0
        and name not in _out_of_reach(data)
    ]


def _out_of_reach(data: SetData) -> frozenset[str]:
    """Effects of which these signals say nothing, whatever was driven."""
    if data.commanded:
        return OF_MEASURED_WHEELS
    return frozenset() if data.usable.any(axis=0).all() else OF_TWO_WHEELS


def not_exercised(data: SetData) -> tuple[str, ...]:
    """Effects that these recordings could not have shown, so that silence about them means nothing."""
    applicable = applicable_effects(data)
    return tuple(name for name in CATALOGUE if name not in applicable and name not in data.baseline.effects)


def weakly_exercised(data: SetData) -> tuple[str, ...]:
    """Effects that only a strong form would have shown."""
    return tuple(name for name in applicable_effects(data) if CATALOGUE[name].exercised(data) < FULLY)


def missing_needs(data: SetData, effect: Effect) -> tuple[Need, ...]:
    """What the recordings or the baseline would have to hold before the effect can be judged."""
    there: dict[Need, bool] = {
        "pose": data.has_truth or data.has_gyro,
        "heading": data.heading_rad is not None,
        "geometry": data.baseline.wheelbase_m is not None,
        "angle": data.angle_rad is not None,
        "vel": data.source == "vel",
        "equal_wheels": data.baseline.left == data.baseline.right,
    }
    return tuple(need for need in effect.needs if not there[need])
