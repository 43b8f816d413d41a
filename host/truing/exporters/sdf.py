"""SDFormat: two wheel joints with damping and friction (see `joint` for where the numbers come from).

As in URDF, all of an axle's inertia is the wheel link's own, and the torque at full effort is the joint's
effort limit.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

from truing.model.robot_model import RobotModel

from .joint import joint_notes, joints
from .joint import remarks as remarks
from .terms import DEFAULTS, ExportOptions
from .xml_file import child, number, numbers, write_xml

KIND = "sdf"
TITLE = "joint damping, friction, limits and inertia for Gazebo"
SUFFIX = ".sdf"
HOLDS = frozenset({"friction"})
# Read by Gazebo 9 and everything after it.
VERSION = "1.6"


def write(model: RobotModel, path: Path, options: ExportOptions = DEFAULTS) -> tuple[Path, ...]:
    """A base with two wheels that turn about y; forward is x."""
    radius, half = options.radius(model), 0.5 * options.wheelbase(model)
    root = Xml.Element("sdf", {"version": VERSION})
    robot = child(root, "model", name=model.robot.name or "robot")
    base = child(robot, "link", name="base_link")
    _inertial(base, 1.0, (half**2,) * 3)
    made = joints(model, options)
    for joint, y in zip(made, (half, -half), strict=True):
        link = child(robot, "link", name=f"{joint.side}_wheel_link")
        child(link, "pose", numbers(0.0, y, radius, 0.0, 0.0, 0.0))
        mass = 2.0 * joint.inertia_kgm2 / radius**2
        _inertial(link, mass, (0.5 * joint.inertia_kgm2, joint.inertia_kgm2, 0.5 * joint.inertia_kgm2))
        visual = child(link, "visual", name="wheel")
        child(visual, "pose", numbers(0.0, 0.0, 0.0, 1.5707963267948966, 0.0, 0.0))
        cylinder = child(child(visual, "geometry"), "cylinder")
        child(cylinder, "radius", number(radius))
        child(cylinder, "length", number(0.3 * radius))
    for joint in made:
        element = child(robot, "joint", name=joint.name, type="revolute")
        child(element, "parent", "base_link")
        child(element, "child", f"{joint.side}_wheel_link")
        axis = child(element, "axis")
        child(axis, "xyz", "0 1 0")
        limit = child(axis, "limit")
        child(limit, "lower", "-1e16")
        child(limit, "upper", "1e16")
        child(limit, "effort", number(joint.torque_nm))
        child(limit, "velocity", number(joint.top_radps))
        dynamics = child(axis, "dynamics")
        child(dynamics, "damping", number(joint.damping_nms))
        child(dynamics, "friction", number(joint.friction_nm))
    write_xml(root, path, joint_notes(model, options, HOLDS))
    return (path,)


def _inertial(link: Xml.Element, mass: float, diagonal: tuple[float, float, float]) -> None:
    inertial = child(link, "inertial")
    child(inertial, "mass", number(mass))
    inertia = child(inertial, "inertia")
    for name, value in zip(("ixx", "iyy", "izz"), diagonal, strict=True):
        child(inertia, name, number(value))
    for name in ("ixy", "ixz", "iyz"):
        child(inertia, name, "0")
