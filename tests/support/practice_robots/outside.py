"""Physics that no entry of the catalogue describes; the right answer is `unexplained`, with the place."""

from __future__ import annotations

from support.practice_robots.effects import Draw, Hidden, Shape, geared
from support.practice_robots.physics import Physics, stall_torque


def _no_parameters(physics: Physics, size: float, shape: Shape) -> dict[str, float]:
    return {}


def _flexible_shape(draw: Draw) -> Shape:
    return {"stiff_hz": 40.0, "soft_hz": float(draw.rng.uniform(1.2, 2.5))}


def _flexible(physics: Physics, size: float, shape: Shape) -> Physics:
    """A shaft as soft as rubber between the encoder and the wheel: it rings after every step."""
    hz = shape["stiff_hz"] * (shape["soft_hz"] / shape["stiff_hz"]) ** size
    return geared(physics, hz, 0.03)


def _hunting_shape(draw: Draw) -> Shape:
    return {"hz": float(draw.rng.uniform(0.7, 3.5))}


def _hunting(physics: Physics, size: float, shape: Shape) -> Physics:
    """The driver's own loop oscillates while it is switched on: negative damping held by its limits."""
    return physics._replace(hunting=0.4 * size, hunting_hz=shape["hz"])


def _square_law_shape(draw: Draw) -> Shape:
    return {"power": float(draw.rng.choice([2.5, 0.3]))}


def _square_law(physics: Physics, size: float, shape: Shape) -> Physics:
    """Voltage is a power of the effort (a PWM stage without current in the valleys)."""
    return physics._replace(effort_power=float(shape["power"] ** size))


def _patch_shape(draw: Draw) -> Shape:
    return {"x": float(draw.rng.uniform(0.2, 0.7)), "width": float(draw.rng.uniform(0.5, 1.2))}


def _patch(physics: Physics, size: float, shape: Shape) -> Physics:
    """Strips of carpet across the floor: rolling resistance that depends on the place."""
    return physics._replace(
        patch=float(0.3 * size * stall_torque(physics).mean()), patch_x=shape["x"], patch_width=shape["width"]
    )


def _screw_shape(draw: Draw) -> Shape:
    return {"hold": float(draw.rng.uniform(0.1, 0.4))}


def _screw(physics: Physics, size: float, shape: Shape) -> Physics:
    """A loose set-screw lets go at a torque peak and slips for 0.3 s."""
    return physics._replace(screw_torque=1.9 * 0.12**size, screw_hold=shape["hold"])


def _jump_shape(draw: Draw) -> Shape:
    total = sum(draw.run_ms)
    return {"at_ms": int(draw.rng.uniform(0.3, 0.7) * total), "low": float(draw.rng.choice([0.5, 1.5]))}


def _jump(physics: Physics, size: float, shape: Shape) -> Physics:
    """From one moment on, in the middle of a run, the same effort gives another voltage."""
    return physics._replace(jump_ms=shape["at_ms"], jump_factor=float(shape["low"] ** size))


def _one_way_shape(draw: Draw) -> Shape:
    return {"ratio": float(draw.rng.choice([3.0, 0.3]))}


def _one_way(physics: Physics, size: float, shape: Shape) -> Physics:
    """A free-wheel couples a flywheel in one direction: the time constant depends on the direction."""
    return physics._replace(reverse_inertia=float(shape["ratio"] ** size))


def _tether_shape(draw: Draw) -> Shape:
    return {"slack": float(draw.rng.uniform(0.1, 0.6))}


def _tether(physics: Physics, size: float, shape: Shape) -> Physics:
    """A rubber band from the start: it pulls back by the distance beyond its slack."""
    max_force = 0.35 * float(stall_torque(physics).mean()) * 2 / physics.radius  # N at 2 m
    return physics._replace(tether=max_force * size / 2, tether_slack=shape["slack"])


def _brownout_shape(draw: Draw) -> Shape:
    return {"effort": float(draw.rng.uniform(0.3, 0.7)), "ms": int(draw.rng.integers(80, 300))}


def _brownout(physics: Physics, size: float, shape: Shape) -> Physics:
    """Under load the supply trips at random and comes back a moment later."""
    return physics._replace(
        brownout_effort=shape["effort"], brownout_rate=1.5 * size, brownout_ms=shape["ms"]
    )


def _nothing(draw: Draw) -> Shape:
    return {}


def _hysteresis(physics: Physics, size: float, shape: Shape) -> Physics:
    """The driver follows the effort with play: what it gives depends on where the effort came from."""
    return physics._replace(hysteresis=0.25 * size)


def _push(physics: Physics, size: float, shape: Shape) -> Physics:
    """Random impulses of torque. (The name takes part in the seeds of the trials.)"""
    return physics._replace(push=float(1.5 * size * stall_torque(physics).mean()), push_every_ms=4000)


OUTSIDE: dict[str, Hidden] = {
    hidden.name: hidden
    for hidden in (
        Hidden("flexible_drive", _flexible_shape, _flexible, _no_parameters),
        Hidden("hunting_driver", _hunting_shape, _hunting, _no_parameters),
        Hidden("square_law_effort", _square_law_shape, _square_law, _no_parameters),
        Hidden("carpet_strips", _patch_shape, _patch, _no_parameters),
        Hidden("set_screw_slip", _screw_shape, _screw, _no_parameters),
        Hidden("gain_jump", _jump_shape, _jump, _no_parameters),
        Hidden("one_way_flywheel", _one_way_shape, _one_way, _no_parameters),
        Hidden("tether_spring", _tether_shape, _tether, _no_parameters),
        Hidden("brown_outs", _brownout_shape, _brownout, _no_parameters),
        Hidden("hysteretic_driver", _nothing, _hysteresis, _no_parameters),
        Hidden("knocks", _nothing, _push, _no_parameters),
    )
}
