"""The 27 effects of docs/DATA_FORMAT.md, each added to a practice robot at a size from 0 (off) to 1."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.random import Generator

from support.practice_robots.physics import Array, Physics, stall_torque

Shape: TypeAlias = dict[str, Any]  # what is drawn once and does not grow with the size
Parameters: TypeAlias = dict[str, float]
Domain: TypeAlias = Literal["wheel", "pose"]


@dataclass(frozen=True)
class Draw:
    """What an effect may depend on when its shape is drawn."""

    rng: Generator
    physics: Physics
    run_ms: tuple[int, ...]  # length of each run


@dataclass(frozen=True)
class Hidden:
    """One way to be different from the baseline.

    `apply(physics, size, shape)` gives the robot with it; `parameters(physics, size, shape)` gives the
    catalogue's parameters of the finished robot, as built. `exact` says that they are also the
    values that the catalogue's equation takes; the others are fitted or marked as approximate.
    """

    name: str
    shape: Callable[[Draw], Shape]
    apply: Callable[[Physics, float, Shape], Physics]
    parameters: Callable[[Physics, float, Shape], Parameters]
    domain: Domain = "wheel"
    exact: bool = False


def _uneven(draw: Draw, spread: float = 0.25, one_sided: float = 0.0) -> Array:
    """Factors per wheel; now and then only one wheel has the effect."""
    factors = np.exp(draw.rng.uniform(-spread, spread, 2))
    if draw.rng.random() < one_sided:
        factors[int(draw.rng.integers(2))] = 0.0
    return np.asarray(factors / factors.max(), dtype=np.float64)


def _both(physics: Physics, size: float, shape: Shape) -> Parameters:
    return {"left": float(size * shape["max"][0]), "right": float(size * shape["max"][1])}


# Friction -----------------------------------------------------------------------------------------


def _coulomb_shape(draw: Draw) -> Shape:
    return {"max": 0.22 * _uneven(draw, one_sided=0.12), "bristle": float(draw.rng.uniform(0.002, 0.008))}


def _coulomb(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(running=size * shape["max"] * stall_torque(physics), bristle_rad=shape["bristle"])


def _stribeck_shape(draw: Draw) -> Shape:
    return {
        "max": 0.12 * _uneven(draw),
        "ratio": draw.rng.uniform(1.7, 3.0) * np.exp(draw.rng.uniform(-0.1, 0.1, 2)),
        "speed": float(draw.rng.uniform(0.02, 0.08) / draw.physics.radius),
        "bristle": float(draw.rng.uniform(0.002, 0.006)),
    }


def _stribeck(physics: Physics, size: float, shape: Shape) -> Physics:
    level = size * shape["max"] * stall_torque(physics)
    return physics._replace(
        running=level,
        breakaway=level * shape["ratio"],
        stribeck_radps=shape["speed"],
        bristle_rad=shape["bristle"],
    )


def _stribeck_parameters(physics: Physics, size: float, shape: Shape) -> Parameters:
    running = size * shape["max"]
    high = running * shape["ratio"]
    return {
        "left": float(running[0]),
        "right": float(running[1]),
        "breakaway_left": float(high[0]),
        "breakaway_right": float(high[1]),
    }


def _scrub(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(
        scrub=float(size * 0.22 * stall_torque(physics).mean()), bristle_rad=shape["bristle"]
    )


def _drag(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(drag=size * shape["max"] * stall_torque(physics) * physics.radius**2)


# Supply and heat ----------------------------------------------------------------------------------


def _sag_shape(draw: Draw) -> Shape:
    return {"charge": float(draw.rng.choice([0.0, draw.rng.uniform(0.2, 1.0), draw.rng.uniform(0.2, 1.0)]))}


def _sag(physics: Physics, size: float, shape: Shape) -> Physics:
    both = float((physics.voltage / physics.resistance).sum())
    drop = 0.6 * size
    ohm = drop / (1 - drop) * physics.voltage / both
    # Some 0.1 of both motors' stall current flows on average over three minutes of driving.
    return physics._replace(source_ohm=ohm, charge_drop=0.4 * size * shape["charge"] / (0.06 * both * 195))


def _sag_parameters(physics: Physics, size: float, shape: Shape) -> Parameters:
    both = float((physics.voltage / physics.resistance).sum())
    ohm = physics.source_ohm
    return {"drop_at_stall": ohm * both / (physics.voltage + ohm * both), "drop_over_set": float("nan")}


def _heat_shape(draw: Draw) -> Shape:
    return {"winding_s": float(np.exp(draw.rng.uniform(np.log(20), np.log(90))))}


def _heat(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(
        heat_rate=0.8 * size, winding_case_s=shape["winding_s"], case_air_s=8 * shape["winding_s"]
    )


def _heat_parameters(physics: Physics, size: float, shape: Shape) -> Parameters:
    return {"gain_drop": float("nan"), "thermal_time_constant": shape["winding_s"]}


# Driver -------------------------------------------------------------------------------------------


def _delay(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(delay_ms=round(350 * size))


def _lag(physics: Physics, size: float, shape: Shape) -> Physics:
    if shape["winding"]:
        # Beyond a quarter of the mechanical time constant it would ring, which is more than a lag.
        constant = physics.torque_constant**2 / physics.resistance + physics.viscous
        mechanical = float((physics.inertia / constant).min())
        return physics._replace(electric_s=np.full(2, 1e-4 + min(0.5 * size, 0.2 * mechanical)))
    return physics._replace(lag_s=0.5 * size)


def _limit_current(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(current_limit=1.9 - 1.75 * size)


def _limit_speed(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(speed_limit=physics.top_mps * (1.0 - 0.8 * size))


def _direction_shape(draw: Draw) -> Shape:
    towards = float(draw.rng.choice([-1.0, 1.0]))
    return {"max": np.log(0.55) * towards * _uneven(draw, 0.5)}


def _direction(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(reverse_supply=np.exp(size * shape["max"]))


def _coast(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(coast_brake=1.0 - size)


def _coast_parameters(physics: Physics, size: float, shape: Shape) -> Parameters:
    brake = physics.torque_constant**2 / physics.resistance
    return {
        "time_constant": float((physics.inertia / (physics.viscous + physics.coast_brake * brake)).mean())
    }


# Drive train --------------------------------------------------------------------------------------


def geared(physics: Physics, resonance_hz: float, damping: float) -> Physics:
    """A spring between gear and wheel, its resonance against the rotor."""
    rotor = float((physics.inertia * physics.rotor_share).mean())
    omega = 2 * np.pi * resonance_hz
    return physics._replace(gear_stiffness=rotor * omega**2, gear_damping=2 * damping * rotor * omega)


def _backlash(physics: Physics, size: float, shape: Shape) -> Physics:
    return geared(physics, shape["resonance_hz"], 0.4)._replace(gap=size * shape["max"])


def _backlash_shape(draw: Draw) -> Shape:
    return {"max": 0.9 * _uneven(draw, one_sided=0.1), "resonance_hz": float(draw.rng.uniform(40, 70))}


def _ripple_shape(draw: Draw) -> Shape:
    return {
        "max": 0.25 * _uneven(draw, one_sided=0.15),
        "per_rev": int(draw.rng.choice([2, 3, 4, 5, 6, 8, 10, 12])),
        "phase": draw.rng.uniform(0, 2 * np.pi, 2),
    }


def _ripple(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(
        ripple=size * shape["max"] * stall_torque(physics),
        ripple_per_rev=float(shape["per_rev"]),
        ripple_phase=shape["phase"],
    )


def _ripple_parameters(physics: Physics, size: float, shape: Shape) -> Parameters:
    return {
        "amplitude_left": float(size * shape["max"][0]),
        "amplitude_right": float(size * shape["max"][1]),
        "per_revolution": float(shape["per_rev"]),
    }


# Sensors ------------------------------------------------------------------------------------------


def _eccentric(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(eccentricity=size * shape["max"], eccentric_phase=shape["phase"])


def _dropout(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(lost_at_top=size * shape["max"])


def _scale_shape(draw: Draw) -> Shape:
    change = np.zeros(2)
    change[int(draw.rng.integers(2))] = np.log(0.5) * float(draw.rng.choice([1.0, 1.0, -0.6]))
    return {"max": change}


def _scale(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(counts_per_rev=physics.counts_per_rev * np.exp(size * shape["max"]))


def _factors(physics: Physics, size: float, shape: Shape) -> Parameters:
    left, right = np.exp(size * shape["max"])
    return {"left": float(left), "right": float(right)}


# Chassis and ground -------------------------------------------------------------------------------


def _side_shape(draw: Draw) -> Shape:
    angle = draw.rng.uniform(0, 2 * np.pi)
    return {"gain": 0.35 * float(np.cos(angle)), "time": 0.9 * float(np.sin(angle))}


def _side(physics: Physics, size: float, shape: Shape) -> Physics:
    """Left and right part, their geometric mean staying. With the same inertia, R scales tau and K both."""
    gain = np.exp(size * shape["gain"] * np.array([0.5, -0.5]))
    time = np.exp(size * shape["time"] * np.array([0.5, -0.5]))
    constant = physics.torque_constant / gain
    resistance = physics.resistance * time / gain**2
    return physics._replace(
        torque_constant=constant,
        resistance=resistance,
        viscous=physics.viscous / time,
    )


def _side_parameters(physics: Physics, size: float, shape: Shape) -> Parameters:
    return {
        "gain_ratio": float(np.exp(size * shape["gain"])),
        "time_constant_ratio": float(np.exp(size * shape["time"])),
    }


def _coupling_shape(draw: Draw) -> Shape:
    return {"max": 0.75 * float(draw.rng.choice([1.0, 1.0, -0.8]))}


def _grip(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(grip=float(1.2 * 0.03**size), slip_slope=shape["slope"])


def _radius_shape(draw: Draw) -> Shape:
    change = draw.rng.normal(0, 1, 2)
    return {"max": 0.25 * change / np.abs(change).max()}


def _drift_shape(draw: Draw) -> Shape:
    return {
        "drift": 2.5 * float(draw.rng.choice([-1.0, 1.0])),
        "scale": float(draw.rng.choice([0.0, 0.3 * draw.rng.uniform(-1, 1)])),
    }


def _slope_shape(draw: Draw) -> Shape:
    return {"uphill": float(draw.rng.uniform(-np.pi, np.pi))}


def _slope(physics: Physics, size: float, shape: Shape) -> Physics:
    chassis = physics.inertia * (1 - physics.rotor_share - physics.wheel_share)
    weight = float(chassis.mean()) / physics.radius**2 * 9.81  # of half of the robot
    return physics._replace(
        slope_torque=weight * physics.radius * float(np.sin(0.35 * size)), uphill=shape["uphill"]
    )


def _slope_parameters(physics: Physics, size: float, shape: Shape) -> Parameters:
    """As an acceleration over g: the rotors' inertia hinders the robot, and gravity does not pull it."""
    weighty = float((1 - physics.rotor_share - physics.wheel_share).mean())
    return {"slope": float(np.arcsin(np.sin(0.35 * size) * weighty)), "uphill_heading": shape["uphill"]}


def _payload_shape(draw: Draw) -> Shape:
    first = len(draw.run_ms) // 4
    run = int(draw.rng.integers(first, len(draw.run_ms) - first))
    at = sum(draw.run_ms[:run])
    if draw.rng.random() < 0.4:
        at += int(draw.rng.integers(4, 11)) * 1000
    return {"at_ms": at, "sign": float(draw.rng.choice([1.0, 1.0, -1.0]))}


def _payload_ratio(size: float, shape: Shape) -> float:
    return 1 + 1.5 * size if shape["sign"] > 0 else 1 - 0.6 * size


def _payload(physics: Physics, size: float, shape: Shape) -> Physics:
    return physics._replace(payload_ratio=_payload_ratio(size, shape), payload_ms=shape["at_ms"])


def _max(value: float, one_sided: float = 0.0) -> Callable[[Draw], Shape]:
    return lambda draw: {
        "max": value * _uneven(draw, one_sided=one_sided),
        "phase": draw.rng.uniform(0, 2 * np.pi, 2),
        "bristle": float(draw.rng.uniform(0.002, 0.008)),
        "winding": bool(draw.rng.random() < 0.4),
        "slope": float(draw.rng.uniform(10, 25)),
    }


_plain = _max(1.0)

CATALOGUE: dict[str, Hidden] = {
    hidden.name: hidden
    for hidden in (
        Hidden("coulomb_friction", _coulomb_shape, _coulomb, _both),
        Hidden("stribeck_friction", _stribeck_shape, _stribeck, _stribeck_parameters),
        Hidden("turning_scrub", _plain, _scrub, lambda _p, size, _s: {"scrub": 0.22 * size}),
        Hidden("quadratic_drag", _max(0.6), _drag, _both, exact=True),
        Hidden("supply_sag", _sag_shape, _sag, _sag_parameters),
        Hidden("winding_heating", _heat_shape, _heat, _heat_parameters),
        Hidden("input_delay", _plain, _delay, lambda p, _size, _s: {"delay": p.delay_ms / 1000}, exact=True),
        Hidden("driver_lag", _plain, _lag, lambda _p, size, _s: {"time_constant": 0.5 * size}),
        Hidden(
            "driver_deadband",
            _plain,
            lambda p, size, _s: p._replace(deadband=0.25 * size),
            lambda _p, size, _s: {"deadband": 0.25 * size},
            exact=True,
        ),
        Hidden("current_limit", _plain, _limit_current, lambda p, _size, _s: {"limit": p.current_limit}),
        Hidden(
            "speed_limit", _plain, _limit_speed, lambda p, _size, _s: {"limit": p.speed_limit}, exact=True
        ),
        Hidden("direction_asymmetry", _direction_shape, _direction, _factors, exact=True),
        Hidden("side_asymmetry", _side_shape, _side, _side_parameters, exact=True),
        Hidden("coast_decay", _plain, _coast, _coast_parameters),
        Hidden("gear_backlash", _backlash_shape, _backlash, _both),
        Hidden("torque_ripple", _ripple_shape, _ripple, _ripple_parameters),
        Hidden(
            "encoder_eccentricity",
            _max(0.8, one_sided=0.3),
            _eccentric,
            lambda _p, size, shape: {
                "amplitude_left": float(size * shape["max"][0]),
                "amplitude_right": float(size * shape["max"][1]),
            },
            exact=True,
        ),
        Hidden("encoder_dropout", _max(0.7, one_sided=0.5), _dropout, _both, exact=True),
        Hidden("encoder_scale", _scale_shape, _scale, _factors, domain="pose", exact=True),
        Hidden(
            "speed_filter",
            _plain,
            lambda p, size, _s: p._replace(speed_filter_s=0.5 * size),
            lambda _p, size, _s: {"time_constant": 0.5 * size},
            exact=True,
        ),
        Hidden(
            "inertia_coupling",
            _coupling_shape,
            lambda p, size, shape: p._replace(coupling=size * shape["max"]),
            lambda p, _size, _s: {"coupling": p.coupling},
            exact=True,
        ),
        Hidden("wheel_slip", _plain, _grip, lambda p, _size, _s: {"grip": p.grip}),
        Hidden(
            "wheel_radius_error",
            _radius_shape,
            lambda p, size, shape: p._replace(ground_scale=np.exp(size * shape["max"])),
            _factors,
            domain="pose",
            exact=True,
        ),
        Hidden(
            "wheelbase_error",
            _coupling_shape,
            lambda p, size, shape: p._replace(wheelbase_factor=float(np.exp(0.6 * size * shape["max"]))),
            lambda p, _size, _s: {"factor": p.wheelbase_factor},
            domain="pose",
            exact=True,
        ),
        Hidden(
            "heading_drift",
            _drift_shape,
            lambda p, size, shape: p._replace(
                heading_drift=size * shape["drift"], distance_scale=1 + size * shape["scale"]
            ),
            lambda p, _size, _s: {"drift": p.heading_drift, "distance_scale": p.distance_scale},
            domain="pose",
            exact=True,
        ),
        Hidden(
            "floor_slope",
            _slope_shape,
            _slope,
            _slope_parameters,
            exact=True,
        ),
        Hidden(
            "payload_change",
            _payload_shape,
            _payload,
            lambda p, _size, shape: {
                "time_constant_ratio": p.payload_ratio,
                "at": shape["at_ms"] / 1000,
            },
            exact=True,
        ),
    )
}
