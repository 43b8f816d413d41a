"""What can be concealed in a trial's robot: the 27 effects of the catalogue and kinds that no catalogue has.

Of those that no catalogue has some act all the time, others for some time only (`INTERMITTENT`).

Each takes a robot, a strength (1 is about the largest that a robot of this kind has) and a generator
that gives the same draws whatever the strength, and changes the robot. The physics is the plant's;
here are only its numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from truing.trial.robot import Robot

Rng = np.random.Generator
Apply = Callable[[Robot, float, Rng], None]
Domain = Literal["wheel", "pose"]


@dataclass(frozen=True)
class Hidden:
    """One effect that a trial can conceal.

    Attributes
    ----------
    apply : changes the robot, at a strength.
    start : strength that is tried first.
    max_strength : largest strength that is physically plausible.
    domain : where its strength is judged: in the wheels' speeds or in the pose.
    needs : columns without which it is not identifiable: `truth`, `speed` (the recorder's own).
    tied : the baseline has both sides equal.
    outside : no catalogue has it.
    """

    name: str
    apply: Apply
    start: float = 0.3
    max_strength: float = 1.0
    domain: Domain = "wheel"
    needs: tuple[str, ...] = ()
    tied: bool = False
    outside: bool = False


def _sides(rng: Rng, *, one: float = 0.25) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """How strong an effect is left and right, relative to the strength; sometimes on one side alone."""
    sides = rng.uniform(0.75, 1.25, 2)
    alone = rng.integers(0, 2)
    if rng.random() < one:
        sides[alone] = 0.0
    return sides


def _pair(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _bristles(robot: Robot, running: tuple[float, float], breakaway: tuple[float, float], rng: Rng) -> None:
    robot.add_hidden(
        bristle__coulomb_nm=running,
        bristle__breakaway_nm=breakaway,
        bristle__bend_rad=float(rng.uniform(0.0005, 0.002)),
        bristle__stribeck_radps=float(rng.uniform(0.03, 0.1)) / robot.radius_m,
    )


def _coulomb_friction(robot: Robot, strength: float, rng: Rng) -> None:
    running = _pair(robot.effort_nm(0.12 * strength) * _sides(rng))
    _bristles(robot, running, running, rng)


def _stribeck_friction(robot: Robot, strength: float, rng: Rng) -> None:
    breakaway = robot.effort_nm(0.25 * strength) * _sides(rng, one=0.1)
    _bristles(robot, _pair(breakaway * rng.uniform(0.2, 0.4)), _pair(breakaway), rng)


def _turning_scrub(robot: Robot, strength: float, rng: Rng) -> None:
    rim_n = robot.effort_nm(0.2 * strength) / robot.radius_m
    robot.changes["chassis__scrub_nm"] = rim_n * robot.wheelbase_m
    robot.changes["chassis__scrub_curvature_per_m"] = float(rng.uniform(0.3, 1.5))


def _quadratic_drag(robot: Robot, strength: float, rng: Rng) -> None:
    at_one_mps = robot.effort_nm(0.4 * strength) * _sides(rng)
    robot.add_hidden(load__quadratic_nms2=_pair(at_one_mps * robot.radius_m**2))


def _supply_sag(robot: Robot, strength: float, rng: Rng) -> None:
    at_stall = 0.4 * strength
    resistance = robot.supply_v / robot.stall_a
    total = 0.5 * resistance * at_stall / (1.0 - at_stall)
    slow = float(rng.uniform(0.0, 0.3))
    robot.changes["battery__resistance_ohm"] = min(total * (1.0 - slow), 0.35 * resistance)
    robot.add_hidden(
        supply__polarisation_ohm=total * slow, supply__polarisation_s=float(rng.uniform(1.0, 5.0))
    )
    # A set of thirteen runs draws a few per cent of the stall current all along.
    set_as = 0.05 * robot.stall_a * 200.0
    robot.changes["battery__capacity_ah"] = 4.0 * set_as / 3600.0
    robot.changes["battery__empty_v"] = robot.supply_v * (1.0 - float(rng.uniform(0.2, 0.6)) * strength)


def _winding_heating(robot: Robot, strength: float, rng: Rng) -> None:
    # A motor whose load is as much friction as speed: only there does resistance cost speed.
    robot.viscous = float(rng.uniform(0.7, 1.5))
    watts = 0.06 * robot.supply_v * robot.stall_a
    to_case = watts / (120.0 * strength)
    to_air = to_case * float(rng.uniform(0.7, 1.5))
    robot.add_hidden(
        thermal__resistance_per_k=0.0039,
        thermal__winding_w_per_k=to_case,
        thermal__winding_j_per_k=to_case * float(rng.uniform(15.0, 50.0)),
        thermal__case_w_per_k=to_air,
        thermal__case_j_per_k=to_air * float(rng.uniform(120.0, 300.0)),
    )


def _input_delay(robot: Robot, strength: float, _rng: Rng) -> None:
    robot.add_hidden(driver__delay_s=0.2 * strength)


def _driver_lag(robot: Robot, strength: float, _rng: Rng) -> None:
    robot.add_hidden(driver__lag_s=0.25 * strength)


def _driver_deadband(robot: Robot, strength: float, _rng: Rng) -> None:
    robot.add_hidden(driver__deadband=0.2 * strength)


def _current_limit(robot: Robot, strength: float, _rng: Rng) -> None:
    # Full reversals ask for twice the stall current.
    robot.add_hidden(driver__current_limit_a=robot.stall_a * 1.6 * math.exp(-2.6 * strength))


def _speed_limit(robot: Robot, strength: float, _rng: Rng) -> None:
    robot.add_hidden(driver__speed_limit_mps=float(np.mean(robot.gain_mps)) * (1.0 - 0.75 * strength))


def _direction_asymmetry(robot: Robot, strength: float, rng: Rng) -> None:
    sign = -1.0 if rng.random() < 0.6 else 1.0
    gains = 1.0 + sign * 0.35 * strength * _sides(rng)
    robot.add_hidden(driver__reverse_gain=_pair(gains))


def _side_asymmetry(robot: Robot, strength: float, rng: Rng) -> None:
    sign = rng.choice([-1.0, 1.0])
    gain, constant = float(np.mean(robot.gain_mps)), float(np.mean(robot.time_constant_s))
    ratio = math.exp(0.3 * strength * sign * rng.uniform(0.3, 1.0))
    slower = math.exp(0.4 * strength * rng.uniform(-1.0, 1.0))
    robot.gain_mps = (gain * math.sqrt(ratio), gain / math.sqrt(ratio))
    robot.time_constant_s = (constant * math.sqrt(slower), constant / math.sqrt(slower))


def _coast_decay(robot: Robot, strength: float, _rng: Rng) -> None:
    # The less viscous friction, the longer a floating motor rolls on.
    before = robot.viscous
    robot.viscous = 0.06 * math.exp(6.3 * (1.0 - strength))
    # A motor that drives against more friction is a stronger one; the robot's mass stays what it was.
    robot.stall_a *= (1.0 + robot.viscous) / (1.0 + before)
    robot.add_hidden(driver__floats_at_zero=1.0)


def _gear(robot: Robot, hertz: float, damping: float) -> None:
    """Stiffness at which the motor oscillates against a held wheel at that frequency."""
    motor = robot.inertia_kg * robot.rotor_share * robot.radius_m**2
    stiffness = motor * (2.0 * math.pi * hertz) ** 2
    robot.add_hidden(gear__stiffness_nm_per_rad=stiffness, gear__damping=damping)


def _gear_backlash(robot: Robot, strength: float, rng: Rng) -> None:
    _gear(robot, float(rng.uniform(30.0, 60.0)), 0.25)
    robot.add_hidden(gear__lash_rad=_pair(0.5 * strength * _sides(rng)))


def _torque_ripple(robot: Robot, strength: float, rng: Rng) -> None:
    robot.add_hidden(
        load__ripple_nm=_pair(robot.effort_nm(0.2 * strength) * _sides(rng)),
        load__ripple_per_turn=float(rng.integers(2, 9)),
        load__ripple_phase_rad=_pair(rng.uniform(-3.0, 3.0, 2)),
    )


def _encoder_eccentricity(robot: Robot, strength: float, rng: Rng) -> None:
    robot.add_hidden(
        encoder__eccentricity_rad=_pair(0.3 * strength * _sides(rng)),
        encoder__eccentricity_phase_rad=_pair(rng.uniform(-3.0, 3.0, 2)),
    )


def _encoder_dropout(robot: Robot, strength: float, rng: Rng) -> None:
    robot.add_hidden(
        encoder__dropout=_pair(0.4 * strength * _sides(rng, one=0.6)),
        encoder__dropout_at_radps=float(np.mean(robot.gain_mps)) / robot.radius_m,
    )


def _encoder_scale(robot: Robot, strength: float, rng: Rng) -> None:
    side = rng.choice(["left", "right"])
    factor = 1.0 + float(rng.choice([-1.0, 1.0])) * 0.4 * strength
    robot.changes[f"{side}__encoder__counts_per_rev"] = float(round(robot.counts_per_rev * factor))


def _speed_filter(robot: Robot, strength: float, _rng: Rng) -> None:
    robot.filter_s = 0.3 * strength


def _inertia_coupling(robot: Robot, strength: float, rng: Rng) -> None:
    robot.coupling_change = strength * (0.9 if rng.random() < 0.6 else -0.8)


def _wheel_slip(robot: Robot, strength: float, rng: Rng) -> None:
    # Grip at which a standing start at full effort just holds, and down from there.
    push_n = robot.stall_nm / robot.radius_m * (1.0 - robot.rotor_share)
    load_n = 0.5 * robot.body_kg * 9.81 * 0.85
    robot.add_hidden(
        tyre__grip=2.0 * push_n / load_n * math.exp(-3.0 * strength),
        tyre__slip_at_peak=float(rng.uniform(0.03, 0.08)),
        tyre__load_on_wheels=0.85,
    )


def _wheel_radius_error(robot: Robot, strength: float, rng: Rng) -> None:
    factors = 1.0 + 0.15 * strength * _sides(rng) * rng.choice([-1.0, 1.0], 2)
    for side, factor in zip(("left", "right"), factors, strict=True):
        robot.changes[f"{side}__radius_m"] = robot.radius_m * float(factor)


def _wheelbase_error(robot: Robot, strength: float, rng: Rng) -> None:
    factor = 1.0 + float(rng.choice([-1.0, 1.0])) * 0.3 * strength
    robot.changes["chassis__wheelbase_m"] = robot.wheelbase_m * factor
    # The wheels shall not feel it: the yaw inertia that keeps them apart goes with the base.
    robot.coupling_change = factor**2 - 1.0


def _heading_drift(robot: Robot, strength: float, rng: Rng) -> None:
    robot.add_hidden(
        creep__drift_rad_per_m=float(rng.choice([-1.0, 1.0])) * 0.6 * strength,
        creep__distance_scale=float(rng.uniform(-0.1, 0.1)) * strength,
    )


def _floor_slope(robot: Robot, strength: float, rng: Rng) -> None:
    robot.add_hidden(load__slope_rad=0.15 * strength, load__uphill_rad=float(rng.uniform(-math.pi, math.pi)))


def _payload_change(robot: Robot, strength: float, rng: Rng) -> None:
    mass = robot.body_kg * 1.5 * strength
    robot.add_hidden(
        payload__mass_kg=mass,
        payload__yaw_inertia_kgm2=0.25 * mass * robot.wheelbase_m**2,
        payload__at_s=float(rng.uniform(60.0, 140.0)),
    )


# Outside the catalogue.


def _drive_train_resonance(robot: Robot, strength: float, rng: Rng) -> None:
    _gear(robot, float(rng.uniform(6.0, 10.0)) * math.exp(1.5 * (0.5 - strength)), 0.05)


def _square_law_driver(robot: Robot, strength: float, _rng: Rng) -> None:
    robot.add_hidden(driver__square_law=strength)


def _rough_patches(robot: Robot, strength: float, rng: Rng) -> None:
    robot.add_hidden(
        load__patch_n=robot.effort_nm(0.3 * strength) / robot.radius_m,
        load__patch_pitch_m=float(rng.uniform(0.3, 0.8)),
    )


def _effort_dropouts(robot: Robot, strength: float, rng: Rng) -> None:
    wheels = np.ones(2)
    wheels[rng.integers(0, 2)] = float(rng.random() < 0.4)
    every = float(rng.uniform(2.5, 5.0))
    robot.add_hidden(
        driver__dropout_every_s=every,
        driver__dropout_s=0.5 * strength * every,
        driver__dropout_wheels=_pair(wheels),
    )


def _slipping_hub(robot: Robot, strength: float, rng: Rng) -> None:
    _gear(robot, 40.0, 0.3)
    held = np.zeros(2)
    held[rng.integers(0, 2)] = robot.stall_nm * (1.0 - robot.rotor_share) * 1.2 * math.exp(-3.0 * strength)
    robot.add_hidden(gear__slip_nm=_pair(held))


def _one_way_flywheel(robot: Robot, strength: float, _rng: Rng) -> None:
    more = 2.0 * strength * robot.inertia_kg * robot.radius_m**2
    robot.add_hidden(gear__forward_flywheel_kgm2=(more, more))


def _tether(robot: Robot, strength: float, _rng: Rng) -> None:
    robot.add_hidden(load__spring_n_per_m=2.0 * robot.effort_nm(0.5 * strength) / robot.radius_m)


def _swinging_load(robot: Robot, strength: float, rng: Rng) -> None:
    robot.add_hidden(
        load__swing_kg=robot.body_kg * strength,
        load__swing_hz=float(rng.uniform(0.8, 2.0)),
        load__swing_damping=float(rng.uniform(0.02, 0.08)),
    )


# Outside the catalogue, and acting for some time only: when it does in each run is drawn by the plant.


def _carpet_strip(robot: Robot, strength: float, rng: Rng) -> None:
    """Rolling resistance of a carpet, by time in each run or where it lies."""
    top_mps = float(np.mean(robot.gain_mps))
    from_s, for_s = float(rng.uniform(2.0, 4.0)), float(rng.uniform(2.0, 4.0))
    from_m, for_m = top_mps * float(rng.uniform(0.3, 1.0)), top_mps * float(rng.uniform(0.5, 1.2))
    robot.add_hidden(intermittent__carpet_nm=_pair(robot.effort_nm(0.3 * strength) * _sides(rng)))
    if rng.random() < 0.4:
        robot.add_hidden(intermittent__carpet_from_m=from_m, intermittent__carpet_for_m=for_m)
    else:
        robot.add_hidden(
            intermittent__carpet_from_s=from_s,
            intermittent__carpet_room_s=0.5,
            intermittent__carpet_for_s=for_s,
        )


def _push(robot: Robot, strength: float, rng: Rng) -> None:
    robot.add_hidden(
        intermittent__push_n=_pair(robot.effort_nm(0.5 * strength) / robot.radius_m * _sides(rng)),
        intermittent__push_share=float(rng.uniform(0.4, 0.8)),
        intermittent__push_from_s=2.0,
        intermittent__push_room_s=8.0,
        intermittent__push_for_s=float(rng.uniform(1.0, 2.0)),
    )


def _binding_bearing(robot: Robot, strength: float, rng: Rng) -> None:
    robot.add_hidden(
        intermittent__bind_nm=_pair(robot.effort_nm(0.5 * strength) * _sides(rng, one=0.6)),
        intermittent__bind_every_s=float(rng.uniform(1.7, 2.3)),
        intermittent__bind_for_s=float(rng.uniform(0.15, 0.35)),
    )


def _knocks(robot: Robot, strength: float, rng: Rng) -> None:
    robot.add_hidden(
        intermittent__knock_n=_pair(robot.effort_nm(3.0 * strength) / robot.radius_m * _sides(rng)),
        intermittent__knock_every_s=float(rng.uniform(2.0, 5.0)),
        intermittent__knock_for_s=float(rng.uniform(0.02, 0.05)),
    )


_CATALOGUE = (
    Hidden("coulomb_friction", _coulomb_friction),
    Hidden("stribeck_friction", _stribeck_friction),
    Hidden("turning_scrub", _turning_scrub),
    Hidden("quadratic_drag", _quadratic_drag),
    Hidden("supply_sag", _supply_sag),
    Hidden("winding_heating", _winding_heating),
    Hidden("input_delay", _input_delay),
    Hidden("driver_lag", _driver_lag),
    Hidden("driver_deadband", _driver_deadband),
    Hidden("current_limit", _current_limit, start=0.5),
    Hidden("speed_limit", _speed_limit, start=0.4),
    Hidden("direction_asymmetry", _direction_asymmetry),
    Hidden("side_asymmetry", _side_asymmetry, tied=True),
    Hidden("coast_decay", _coast_decay, start=0.7, max_strength=1.15),
    Hidden("gear_backlash", _gear_backlash),
    Hidden("torque_ripple", _torque_ripple),
    Hidden("encoder_eccentricity", _encoder_eccentricity),
    Hidden("encoder_dropout", _encoder_dropout),
    Hidden("encoder_scale", _encoder_scale, domain="pose", needs=("truth",)),
    Hidden("speed_filter", _speed_filter, needs=("speed",)),
    Hidden("inertia_coupling", _inertia_coupling),
    Hidden("wheel_slip", _wheel_slip, start=0.5),
    Hidden("wheel_radius_error", _wheel_radius_error, domain="pose", needs=("truth",)),
    Hidden("wheelbase_error", _wheelbase_error, domain="pose", needs=("truth",)),
    Hidden("heading_drift", _heading_drift, domain="pose", needs=("truth",)),
    Hidden("floor_slope", _floor_slope),
    Hidden("payload_change", _payload_change),
)
_OUTSIDE = (
    Hidden("drive_train_resonance", _drive_train_resonance, outside=True, max_strength=1.5),
    Hidden("square_law_driver", _square_law_driver, outside=True),
    Hidden("rough_patches", _rough_patches, outside=True),
    Hidden("effort_dropouts", _effort_dropouts, outside=True),
    Hidden("slipping_hub", _slipping_hub, start=0.5, outside=True),
    Hidden("one_way_flywheel", _one_way_flywheel, outside=True, max_strength=2.0),
    Hidden("tether", _tether, outside=True),
    Hidden("swinging_load", _swinging_load, outside=True, max_strength=2.0),
)
_INTERMITTENT = (
    Hidden("carpet_strip", _carpet_strip, outside=True),
    Hidden("push", _push, outside=True),
    Hidden("binding_bearing", _binding_bearing, outside=True),
    Hidden("knocks", _knocks, outside=True),
)

CATALOGUE: dict[str, Hidden] = {each.name: each for each in _CATALOGUE}
OUTSIDE: dict[str, Hidden] = {each.name: each for each in _OUTSIDE}
# Apart from `OUTSIDE`, from which campaigns and seeds draw in an order that must not change.
INTERMITTENT: dict[str, Hidden] = {each.name: each for each in _INTERMITTENT}
ALL: dict[str, Hidden] = CATALOGUE | OUTSIDE | INTERMITTENT
