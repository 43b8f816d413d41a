"""What a practice robot is made of: one flat record of SI numbers that the integrator reads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WHEELS = 2  # 0 left, 1 right
NEVER = 1e9  # a time, limit or count that is never reached


class Physics(NamedTuple):
    """The robot, its surroundings and its sensors. Arrays are (2,): left, right; torques act at the wheel.

    "Effort" units are fractions of the wheel's own stall torque.
    """

    # motor, gear, chassis
    radius: float  # m, nominal
    wheelbase: float  # m, nominal
    voltage: float  # V, open circuit
    resistance: Array  # ohm, cold
    torque_constant: Array  # N m per A at the wheel = V s per rad
    viscous: Array  # N m s per rad
    inertia: Array  # kg m2 at the wheel, with half of the chassis
    rotor_share: Array  # of it, ahead of the gear's gap
    wheel_share: Array  # of it, behind the gap and ahead of the tyre
    electric_s: Array  # L / R
    # dry friction
    running: Array  # N m
    breakaway: Array  # N m
    stribeck_radps: float
    bristle_rad: float  # deflection at which a bristle slides
    scrub: float  # N m
    drag: Array  # N m s2 per rad2
    # supply
    source_ohm: float
    charge_drop: float  # fraction of the open-circuit voltage per A s
    # heat: relative rise of the winding's resistance
    heat_rate: float  # 1/s at stall current
    winding_case_s: float
    case_air_s: float
    case_ratio: float  # heat capacity of the winding over the case's
    # driver
    delay_ms: int
    lag_s: float
    deadband: float
    current_limit: float  # fraction of stall current
    speed_limit: float  # m/s
    reverse_supply: Array  # factor on the voltage at negative effort
    coast_brake: float  # share of the short-circuit braking that is left at zero effort
    # drive train
    gap: Array  # rad
    gear_stiffness: float  # N m per rad, 0 = rigid
    gear_damping: float
    ripple: Array  # N m
    ripple_per_rev: float
    ripple_phase: Array
    # chassis and ground
    coupling: float
    grip: float
    slip_slope: float
    slope_torque: float  # N m per wheel, straight uphill
    uphill: float  # rad, from the heading at a run's start
    payload_ratio: float
    payload_ms: int
    ground_scale: Array  # true over nominal wheel radius
    wheelbase_factor: float
    heading_drift: float  # rad per m
    distance_scale: float
    # sensors
    counts_per_rev: Array
    eccentricity: Array  # rad
    eccentric_phase: Array
    lost_at_top: Array  # fraction of the counts
    top_mps: float
    speed_filter_s: float
    # outside the catalogue
    effort_power: float
    hysteresis: float  # effort
    hunting: float  # effort
    hunting_hz: float
    patch: float  # N m per wheel on the carpet
    patch_x: float  # m
    patch_width: float  # m
    screw_torque: float  # N m at which the set-screw lets go
    screw_hold: float  # share of it that is left while it slips
    jump_factor: float
    jump_ms: int
    reverse_inertia: float
    tether: float  # N per m beyond its slack
    tether_slack: float  # m
    brownout_effort: float  # sum of both efforts above which the supply may trip
    brownout_rate: float  # 1/s
    brownout_ms: int
    push: float  # N m of an impulse from the side or the front
    push_every_ms: int


def pair(left: float, right: float | None = None) -> Array:
    """Two wheels' values."""
    return np.array([left, left if right is None else right], dtype=np.float64)


def healthy(
    *,
    radius: float,
    wheelbase: float,
    gain: Array,
    time_constant: Array,
    viscous_share: Array,
    rotor_share: Array,
    mass: float,
    counts_per_rev: float,
    electric_s: float = 2e-4,
    voltage: float = 12.0,
) -> Physics:
    """A robot whose wheels are first order with these gains (m/s) and time constants (s), nothing hidden.

    `viscous_share` is viscous torque over back-EMF braking, which no recording can distinguish.
    """
    torque_constant = radius * voltage / (gain * (1 + viscous_share))
    chassis = mass * radius**2 / 2
    wheel_share = np.full(WHEELS, 0.04)
    inertia = chassis / (1 - rotor_share - wheel_share)
    resistance = time_constant * torque_constant**2 * (1 + viscous_share) / inertia
    none = np.zeros(WHEELS)
    one = np.ones(WHEELS)
    return Physics(
        radius=radius,
        wheelbase=wheelbase,
        voltage=voltage,
        resistance=resistance,
        torque_constant=torque_constant,
        viscous=viscous_share * torque_constant**2 / resistance,
        inertia=inertia,
        rotor_share=rotor_share,
        wheel_share=wheel_share,
        electric_s=np.full(WHEELS, electric_s),
        running=none,
        breakaway=none,
        stribeck_radps=0.5,
        bristle_rad=0.004,
        scrub=0.0,
        drag=none,
        source_ohm=0.0,
        charge_drop=0.0,
        heat_rate=0.0,
        winding_case_s=40.0,
        case_air_s=400.0,
        case_ratio=0.2,
        delay_ms=0,
        lag_s=0.0,
        deadband=0.0,
        current_limit=NEVER,
        speed_limit=NEVER,
        reverse_supply=one,
        coast_brake=1.0,
        gap=none,
        gear_stiffness=0.0,
        gear_damping=0.0,
        ripple=none,
        ripple_per_rev=1.0,
        ripple_phase=none,
        coupling=0.0,
        grip=0.0,
        slip_slope=15.0,
        slope_torque=0.0,
        uphill=0.0,
        payload_ratio=1.0,
        payload_ms=int(NEVER),
        ground_scale=one,
        wheelbase_factor=1.0,
        heading_drift=0.0,
        distance_scale=1.0,
        counts_per_rev=np.full(WHEELS, counts_per_rev),
        eccentricity=none,
        eccentric_phase=none,
        lost_at_top=none,
        top_mps=float(np.mean(gain)),
        speed_filter_s=0.0,
        effort_power=1.0,
        hysteresis=0.0,
        hunting=0.0,
        hunting_hz=2.0,
        patch=0.0,
        patch_x=NEVER,
        patch_width=1.0,
        screw_torque=NEVER,
        screw_hold=0.3,
        jump_factor=1.0,
        jump_ms=int(NEVER),
        reverse_inertia=1.0,
        tether=0.0,
        tether_slack=0.0,
        brownout_effort=NEVER,
        brownout_rate=0.0,
        brownout_ms=150,
        push=0.0,
        push_every_ms=int(NEVER),
    )


def stall_torque(physics: Physics) -> Array:
    """Torque (N m) of each wheel at standstill and full effort, cold."""
    return physics.torque_constant * physics.voltage / physics.resistance
