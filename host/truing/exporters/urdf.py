"""URDF: two wheel joints with damping and friction (see `joint` for where the numbers come from).

URDF has no motor and no armature: all of an axle's inertia is the wheel link's own, and the torque at full
effort is the joint's effort limit, which whoever drives the joint multiplies by the effort.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

from truing.model.robot_model import RobotModel

from .joint import joint_notes, joints
from .joint import remarks as remarks
from .terms import DEFAULTS, ExportOptions
from .xml_file import child, number, numbers, write_xml

KIND = "urdf"
TITLE = "joint damping, friction, limits and inertia"
SUFFIX = ".urdf"
HOLDS = frozenset({"friction"})


def write(model: RobotModel, path: Path, options: ExportOptions = DEFAULTS) -> tuple[Path, ...]:
    """A base with two wheels that turn about y; forward is x."""
    radius, half = options.radius(model), 0.5 * options.wheelbase(model)
    root = Xml.Element("robot", {"name": model.robot.name or "robot"})
    base = child(root, "link", name="base_link")
    _inertial(base, 1.0, (half**2,) * 3)
    for joint, y in zip(joints(model, options), (half, -half), strict=True):
        link = child(root, "link", name=f"{joint.side}_wheel_link")
        # A disc of this inertia about its axle: mass 2 J / r^2, and half of J about the other axes.
        mass = 2.0 * joint.inertia_kgm2 / radius**2
        _inertial(link, mass, (0.5 * joint.inertia_kgm2, joint.inertia_kgm2, 0.5 * joint.inertia_kgm2))
        visual = child(link, "visual")
        child(visual, "origin", xyz="0 0 0", rpy=numbers(1.5707963267948966, 0.0, 0.0))
        geometry = child(visual, "geometry")
        child(geometry, "cylinder", radius=number(radius), length=number(0.3 * radius))
        element = child(root, "joint", name=joint.name, type="continuous")
        child(element, "parent", link="base_link")
        child(element, "child", link=f"{joint.side}_wheel_link")
        child(element, "origin", xyz=numbers(0.0, y, radius), rpy="0 0 0")
        child(element, "axis", xyz="0 1 0")
        child(element, "limit", effort=number(joint.torque_nm), velocity=number(joint.top_radps))
        child(element, "dynamics", damping=number(joint.damping_nms), friction=number(joint.friction_nm))
    write_xml(root, path, joint_notes(model, options, HOLDS))
    return (path,)


def _inertial(link: Xml.Element, mass: float, diagonal: tuple[float, float, float]) -> None:
    inertial = child(link, "inertial")
    child(inertial, "origin", xyz="0 0 0", rpy="0 0 0")
    child(inertial, "mass", value=number(mass))
    ixx, iyy, izz = (number(value) for value in diagonal)
    child(inertial, "inertia", ixx=ixx, ixy="0", ixz="0", iyy=iyy, iyz="0", izz=izz)
