"""Which effects of the catalogue are identifiable from these recordings with this baseline."""

from __future__ import annotations

from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.data.set_data import SetData
from truing.diagnose.effect import Effect, Need

# Effects that need measured wheels: without them they are invisible, or not distinguishable from a gain.
NEED_MEASURED_WHEELS = frozenset(
    {
        *("encoder_scale", "encoder_dropout", "encoder_eccentricity", "speed_filter"),
        *("gear_backlash", "torque_ripple", "wheel_slip", "wheel_radius_error"),
    }
)
# Effects between the two wheels.
NEED_BOTH_WHEELS = frozenset({"turning_scrub", "inertia_coupling", "side_asymmetry"})
# Effects of a second wheel, of grip on the floor or of its slope: a single motor or axis has none of them.
NO_AXIS_HAS = (*sorted(NEED_BOTH_WHEELS), "wheel_slip", "floor_slope")
# Effects that each wheel's own gain stands for, unless a pose from outside separates them.
ONE_WITH_FREE_GAINS = frozenset({"encoder_scale"})
# Excitation below which an effect of moderate strength is lost in the noise.
EXCITED = 1.0


def beyond_an_axis() -> frozenset[str]:
    """Effects that concern no single motor or axis: those between two wheels, of a floor, or of a pose."""
    return frozenset(
        name for name, effect in CATALOGUE.items() if name in NO_AXIS_HAS or effect.domain != "wheel"
    )


def applicable_effects(data: SetData) -> list[str]:
    """Effects to test, in the catalogue's order: not in the baseline, identifiable, excited."""
    return [
        name
        for name, effect in CATALOGUE.items()
        if name not in data.baseline.effects
        and not missing_needs(data, effect)
        and effect.exercised(data) > 0.0
        and name not in _unidentifiable(data)
    ]


def _unidentifiable(data: SetData) -> frozenset[str]:
    """Effects that these signals cannot show, whatever the excitation."""
    if data.commanded:
        return NEED_MEASURED_WHEELS
    found = frozenset() if data.valid.any(axis=0).all() else NEED_BOTH_WHEELS
    return found if data.has_pose or data.baseline.has_equal_wheels else found | ONE_WITH_FREE_GAINS


def not_exercised(data: SetData) -> tuple[str, ...]:
    """Effects that these recordings could not have shown: the verdict makes no statement about them."""
    applicable = applicable_effects(data)
    return tuple(name for name in CATALOGUE if name not in applicable and name not in data.baseline.effects)


def weakly_exercised(data: SetData) -> tuple[str, ...]:
    """Effects that would have shown only if strong."""
    return tuple(name for name in applicable_effects(data) if CATALOGUE[name].exercised(data) < EXCITED)


def missing_needs(data: SetData, effect: Effect) -> tuple[Need, ...]:
    """Data that the effect needs and that recordings or baseline lack."""
    there: dict[Need, bool] = {
        "pose": data.has_pose,
        "heading": data.heading_rad is not None,
        "geometry": data.baseline.wheelbase_m is not None,
        "angle": data.angle_rad is not None,
        "vel": data.source == "vel",
        "equal_wheels": data.baseline.has_equal_wheels,
    }
    return tuple(need for need in effect.needs if not there[need])
