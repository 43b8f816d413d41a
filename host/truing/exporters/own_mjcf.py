"""A user's MJCF file: its driven wheels as MuJoCo compiles them, and a patch put into its text.

What the file inherits from defaults is read from the compiled model; what is written stands at the elements
themselves. The mass of the chassis is written as an `inertial` of its body, with what MuJoCo computed for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from truing.errors import FileError
from truing.extras import require

from .mjcf import FILTER, IMPEDANCE, SOLREF_STEPS
from .own_robot import AxlePatch, OwnAxle, OwnRobot, Patch
from .wheel_names import sides_of
from .xml_edit import Node, XmlEdit, short

if TYPE_CHECKING:
    from mujoco import MjModel


@dataclass(frozen=True, slots=True)
class Drive:
    """A driven wheel in a compiled model: indices, and what turns effort into control and angle into travel.

    Attributes
    ----------
    control : full effort forward, in the actuator's own unit.
    forward : sign of the joint's speed when the wheel rolls forward.
    """

    joint: int
    actuator: int
    control: float
    forward: float


def load(path: Path) -> MjModel:
    """The compiled model; errors name the file."""
    require("engines")
    import mujoco

    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise FileError(path, f"MuJoCo does not load it: {error}") from None


def drives(model: MjModel, path: Path, names: tuple[str, str] | None = None) -> tuple[Drive, Drive]:
    """The driven wheels, left first: hinges with a motor, by the names that are given or their own."""
    import mujoco

    hinge, on_joint = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtTrn.mjTRN_JOINT)
    motors = {
        int(model.actuator_trnid[index, 0]): index
        for index in range(model.nu)
        if int(model.actuator_trntype[index]) == on_joint
    }
    driven = {model.joint(j).name: j for j in motors if int(model.jnt_type[j]) == hinge}
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    across = {name: float(data.xanchor[joint][1]) for name, joint in driven.items()}
    left, right = (driven[name] for name in sides_of(path, across, names))
    lateral = data.xanchor[left] - data.xanchor[right]
    return tuple(  # type: ignore[return-value]
        _drive(model, path, joint, motors[joint], float(data.xaxis[joint] @ lateral))
        for joint in (left, right)
    )


def _drive(model: MjModel, path: Path, joint: int, actuator: int, along: float) -> Drive:
    import mujoco

    kind = int(model.actuator_biastype[actuator])
    gain = float(model.actuator_gear[actuator, 0] * model.actuator_gainprm[actuator, 0])
    if kind != int(mujoco.mjtBias.mjBIAS_NONE) or gain == 0.0:
        raise FileError(
            path,
            f"the actuator of {model.joint(joint).name} is a servo: effort cannot drive it",
            "Give the joint a motor (an actuator whose torque is gear times control)",
        )
    limited = bool(model.actuator_ctrllimited[actuator])
    full = float(model.actuator_ctrlrange[actuator, 1]) if limited else 1.0
    forward = math.copysign(1.0, along)
    return Drive(joint, actuator, math.copysign(full, gain * forward), forward)


def read(path: Path, model: MjModel, pair: tuple[Drive, Drive], radius_m: float) -> OwnRobot:
    """The user's numbers."""
    axles = []
    own_inertia = []
    for drive in pair:
        dof = int(model.jnt_dofadr[drive.joint])
        gain = model.actuator_gear[drive.actuator, 0] * model.actuator_gainprm[drive.actuator, 0]
        axles.append(
            OwnAxle(
                model.joint(drive.joint).name,
                abs(float(gain) * drive.control),
                float(model.dof_damping[dof, 0] if model.dof_damping.ndim > 1 else model.dof_damping[dof]),
                float(model.dof_frictionloss[dof]),
            )
        )
        own_inertia.append(_about_axis(model, drive) + float(model.dof_armature[dof]))
    chassis = _chassis(model, path, pair)
    free = int(model.body_rootid[chassis]) and int(model.body_weldid[chassis])
    total_kg = float(model.body_subtreemass[model.body_rootid[chassis]]) if free else 0.0
    return OwnRobot(
        axles[0],
        axles[1],
        float(np.mean(own_inertia)) + 0.5 * total_kg * radius_m**2,
        float(model.body_mass[chassis]) if free else 0.0,
        radius_m,
    )


def _about_axis(model: MjModel, drive: Drive) -> float:
    """The wheel body's inertia about its joint's axis, kg m^2."""
    import mujoco

    body = int(model.jnt_bodyid[drive.joint])
    turned = np.zeros(9)
    mujoco.mju_quat2Mat(turned, model.body_iquat[body])
    axis = turned.reshape(3, 3).T @ model.jnt_axis[drive.joint]
    return float(model.body_inertia[body] @ axis**2)


def _chassis(model: MjModel, path: Path, pair: tuple[Drive, Drive]) -> int:
    parents = {int(model.body_parentid[model.jnt_bodyid[drive.joint]]) for drive in pair}
    if len(parents) != 1:
        raise FileError(path, "the two wheels hang on different bodies", "Their parent must be the chassis")
    return parents.pop()


def write(path: Path, model: MjModel, pair: tuple[Drive, Drive], patch: Patch) -> bytes:
    """The file with the patch in it."""
    edit = XmlEdit(path)
    joints = _named(edit, ("joint", "hinge"))
    actuators = {
        node.attributes.get("joint", ""): node
        for group in edit.root.walk()
        if group.tag == "actuator"
        for node in group.children
    }
    for drive, axle in zip(pair, (patch.left, patch.right), strict=True):
        if axle.joint not in joints or axle.joint not in actuators:
            raise FileError(
                path, f"joint {axle.joint} or its motor stands in an included file", "Patch that file"
            )
        _write_joint(edit, joints[axle.joint], axle, model.opt.timestep)
        _write_motor(edit, actuators[axle.joint], model, drive, axle)
    if patch.chassis_factor != 1.0:
        _write_chassis(edit, path, model, _chassis(model, path, pair), patch.chassis_factor)
    return edit.result()


def _named(edit: XmlEdit, tags: tuple[str, ...]) -> dict[str, Node]:
    return {
        node.attributes["name"]: node
        for top in edit.root.children
        if top.tag == "worldbody"
        for node in top.walk()
        if node.tag in tags and "name" in node.attributes
    }


def _write_joint(edit: XmlEdit, node: Node, axle: AxlePatch, step_s: float) -> None:
    edit.set_attribute(node, "damping", short(axle.damping_nms))
    edit.set_attribute(node, "frictionloss", short(axle.friction_nm))
    if axle.friction_nm > 0.0:
        # Friction is a soft constraint: these hold it as firmly as MuJoCo can (see `mjcf`).
        edit.set_attribute(node, "solreffriction", short(SOLREF_STEPS * step_s, 1.0))
        edit.set_attribute(node, "solimpfriction", short(IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0))


def _write_motor(edit: XmlEdit, node: Node, model: MjModel, drive: Drive, axle: AxlePatch) -> None:
    gear = model.actuator_gear[drive.actuator].copy()
    before = abs(gear[0] * model.actuator_gainprm[drive.actuator, 0] * drive.control)
    if axle.torque_nm != before:
        gear[0] *= axle.torque_nm / before
        count = len(node.attributes.get("gear", "1").split())
        edit.set_attribute(node, "gear", short(*gear[:count].tolist()))
    _write_lag(edit, node, axle.lag_s)
    step_s = float(model.opt.timestep)
    if axle.delay_s > 0.5 * step_s:
        edit.set_attribute(node, "delay", short(axle.delay_s - 0.5 * step_s))
        edit.set_attribute(node, "nsample", str(math.ceil(axle.delay_s / step_s) + 1))
    else:
        edit.remove_attribute(node, "delay")
        edit.remove_attribute(node, "nsample")


def _write_lag(edit: XmlEdit, node: Node, lag_s: float) -> None:
    """A filter ahead of the torque; a `motor`, which has none, becomes the `general` that it is short for."""
    if lag_s > 0.0:
        if node.tag == "motor":
            edit.rename(node, "general")
        edit.set_attribute(node, "dyntype", FILTER)
        edit.set_attribute(node, "dynprm", short(lag_s))
    elif node.attributes.get("dyntype") in (FILTER, "filter"):
        edit.remove_attribute(node, "dyntype")
        edit.remove_attribute(node, "dynprm")


def _write_chassis(edit: XmlEdit, path: Path, model: MjModel, body: int, factor: float) -> None:
    name = model.body(body).name
    nodes = [n for n in edit.root.walk() if n.tag == "body" and n.attributes.get("name") == name]
    if not name or not nodes:
        raise FileError(path, "its chassis body has no name here: its mass cannot be changed")
    inertial = nodes[0].find("inertial")
    if inertial is None:
        text = (
            f'<inertial pos="{short(*model.body_ipos[body])}" quat="{short(*model.body_iquat[body])}" '
            f'mass="{short(factor * model.body_mass[body])}" '
            f'diaginertia="{short(*(factor * model.body_inertia[body]))}"/>'
        )
        edit.add_child(nodes[0], text)
        return
    for name in ("mass", "diaginertia", "fullinertia"):
        if name in inertial.attributes:
            values = [factor * float(word) for word in inertial.attributes[name].split()]
            edit.set_attribute(inertial, name, short(*values))
