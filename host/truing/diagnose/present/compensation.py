"""Board parameters that compensate a diagnosed effect, and which effects no parameter compensates."""

from __future__ import annotations

from truing.diagnose.data.set_data import GRAVITY
from truing.diagnose.present.corrected_model import corrected_model
from truing.diagnose.present.text import effect_title
from truing.diagnose.result import Compensation, Diagnosis
from truing.identify.feedforward import feedforward_of
from truing.recording.baseline import Baseline
from truing.recording.run import WHEELS
from truing_protocol import PARAMETERS

# Longest kick: a wheel that was stuck has turned a few counts by then.
KICK_LIMIT_S = 0.1
# Share of what grip or current allow that a commanded acceleration may use.
MARGIN = 0.8

# Why the board does not compensate these.
_NOT_COMPENSATED = {
    "turning_scrub": "the controller's integral part takes it up; no parameter knows whether the robot turns",
    "quadratic_drag": "the feedforward is linear in speed; the controller's integral part takes it up",
    "supply_sag": "no parameter scales the effort with the supply; the integral part takes it up",
    "winding_heating": "no parameter follows the motor's temperature; the integral part takes it up",
    "input_delay": "nothing undoes a delay; lower velocity_kp and velocity_ki if velocity mode oscillates",
    "driver_lag": "nothing undoes a lag; lower velocity_kp and velocity_ki if velocity mode oscillates",
    "coast_decay": "the board brakes at zero effort unless the driver floats; see the driver's wiring",
    "gear_backlash": "no parameter knows the gap; a lower velocity_kp reduces the impacts",
    "torque_ripple": "no parameter knows the wheel's angle",
    "encoder_eccentricity": "a measurement error: repair the encoder, not the control",
    "encoder_dropout": "a measurement error: repair the encoder, not the control",
    "encoder_scale": "counts_per_rev is one for both wheels; repair the wheel that differs",
    "speed_filter": "the recorder's, not the robot's",
    "inertia_coupling": "the feedforward treats each wheel alone",
    "heading_drift": "odometry has no parameter for it",
    "floor_slope": "the floor's, not the robot's",
    "payload_change": "the acceleration feedforward holds for one load only",
}


def compensate(diagnosis: Diagnosis, baseline: Baseline) -> Compensation | None:
    """Board parameters for a verdict that changes parameters or names effects; None for the others."""
    if diagnosis.verdict not in ("missing_physics", "parameters_only"):
        return None
    corrected = corrected_model(diagnosis, baseline)
    effects = corrected.baseline.effects
    values: dict[str, float] = {}
    for wheel in WHEELS:
        values |= feedforward_of(corrected.model.wheel(wheel), wheel)
    notes = []
    if "driver_deadband" in effects:
        # Above the band the driver gives less by its width, so that it adds to what friction takes.
        for name in [name for name in values if name.startswith("ff_ks")]:
            values[name] += float(effects["driver_deadband"]["deadband"])
    if "stribeck_friction" in effects:
        table = effects["stribeck_friction"]
        excess = [float(table[f"breakaway_{wheel}"]) - float(table[wheel]) for wheel in WHEELS]
        if min(excess) > 0.0:
            values["kick_effort"], values["kick_limit_s"] = min(excess), KICK_LIMIT_S
            notes.append("the kick is that of the wheel that breaks away more easily, so that neither jumps")
    if "speed_limit" in effects:
        values["speed_limit_mps"] = MARGIN * float(effects["speed_limit"]["limit"])
    hardest = _hardest(effects, corrected.model.left.gain_mps, corrected.model.left.time_constant_s)
    if hardest is not None:
        values["accel_limit_mps2"] = MARGIN * hardest
    robot = corrected.baseline.robot
    if robot is not None and any(effect.name == "wheelbase_error" for effect in diagnosis.effects):
        assert robot.wheelbase_m is not None
        values["wheelbase_m"] = robot.wheelbase_m
    if "wheel_radius_error" in effects and robot is not None and robot.wheel_radius_m is not None:
        factors = [float(effects["wheel_radius_error"][wheel]) for wheel in WHEELS]
        values["wheel_radius_m"] = robot.wheel_radius_m * sum(factors) / 2.0
        notes.append("the board knows one radius: it gets the mean of both wheels'")
    for effect in diagnosis.effects:
        reason = _NOT_COMPENSATED.get(effect.name)
        if reason is not None:
            notes.append(f"{effect_title(effect.name)}: {reason}")
    return Compensation(_within_limits(values, notes), tuple(notes))


def _hardest(effects: dict[str, dict[str, float]], gain_mps: float, time_constant_s: float) -> float | None:
    """Acceleration that grip or current allow, m/s^2."""
    limits = []
    if "current_limit" in effects:
        limits.append(float(effects["current_limit"]["limit"]) * gain_mps / time_constant_s)
    if "wheel_slip" in effects:
        limits.append(float(effects["wheel_slip"]["grip"]) * GRAVITY)
    return min(limits) if limits else None


def _within_limits(values: dict[str, float], notes: list[str]) -> dict[str, float]:
    known = {item.name: item for item in PARAMETERS}
    kept = {}
    for name, value in values.items():
        item = known[name]
        kept[name] = min(max(value, item.minimum), item.maximum)
        if kept[name] != value:
            notes.append(f"{name} would be {value:.4g}; the board takes {item.minimum:g} to {item.maximum:g}")
    return kept
