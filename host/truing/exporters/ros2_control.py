"""ros2_control: parameters of a diff_drive_controller, geometry and the limits that the model implies.

The controller has no place for a wheel's dynamics; what it can use of them are limits. At full effort the
slower wheel ends at gain (1 - friction), and starts with an acceleration of gain (1 - friction) / time
constant. Turning on the spot both wheels run at that speed in opposite directions.
"""

from __future__ import annotations

from pathlib import Path

from truing.model.robot_model import RobotModel
from truing.recording.writer import replace_file

from .terms import DEFAULTS, ExportOptions, headline, left_out, wheels

KIND = "ros2-control"
TITLE = "diff_drive_controller parameters: geometry, speed and acceleration limits"
SUFFIX = ".yaml"
# Friction lowers the limits; that is all of it that is used.
HOLDS: frozenset[str] = frozenset()

TEMPLATE = """\
{notes}diff_drive_controller:
  ros__parameters:
    left_wheel_names: ["left_wheel_joint"]
    right_wheel_names: ["right_wheel_joint"]
    wheel_separation: {separation!r}
    wheel_radius: {radius!r}
    wheel_separation_multiplier: 1.0
    left_wheel_radius_multiplier: 1.0
    right_wheel_radius_multiplier: 1.0
    publish_rate: {rate!r}
    open_loop: false
    cmd_vel_timeout: 0.5
    linear.x.max_velocity: {speed!r}
    linear.x.min_velocity: {back!r}
    linear.x.max_acceleration: {acceleration!r}
    linear.x.min_acceleration: {deceleration!r}
    angular.z.max_velocity: {turn!r}
    angular.z.min_velocity: {turn_back!r}
    angular.z.max_acceleration: {turn_acceleration!r}
    angular.z.min_acceleration: {turn_deceleration!r}
"""


def write(model: RobotModel, path: Path, options: ExportOptions = DEFAULTS) -> tuple[Path, ...]:
    """The parameters as YAML, the wheels' dynamics as comments."""
    radius, base = options.radius(model), options.wheelbase(model)
    share = {side: max(1.0 - wheel.friction, 0.0) for side, wheel in wheels(model)}
    speed = min(wheel.gain_mps * share[side] for side, wheel in wheels(model))
    start = min(wheel.gain_mps * share[side] / wheel.time_constant_s for side, wheel in wheels(model))
    notes = [headline(model), "Limits are what the slower wheel reaches at full effort."]
    for side, wheel in wheels(model):
        notes.append(
            f"Not held by this controller, {side} wheel: gain {wheel.gain_mps:.6g} m/s, "
            f"time constant {wheel.time_constant_s:.6g} s"
        )
    notes += left_out(model, HOLDS)
    turn = 2.0 / base
    text = TEMPLATE.format(
        notes="".join(f"# {note}\n" for note in notes),
        separation=base,
        radius=radius,
        rate=float(model.rate_hz or 50.0),
        speed=speed,
        back=-speed,
        acceleration=start,
        deceleration=-start,
        turn=speed * turn,
        turn_back=-speed * turn,
        turn_acceleration=start * turn,
        turn_deceleration=-start * turn,
    )
    replace_file(path, text.encode())
    return (path,)
