"""A user's URDF or SDF file: its wheel joints, and a patch put into its text.

Both formats hold a joint's damping, dry friction and largest torque, and masses; no delay. The torque at full
effort is the joint's effort limit, as in the files that `urdf` and `sdf` write.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import NoReturn

import numpy as np

from truing.errors import FileError

from .own_robot import KEEP_MASSES, OwnAxle, OwnRobot, Patch
from .wheel_names import sides_of
from .xml_edit import Node, XmlEdit, short

HOLDS = frozenset({"friction"})
_INERTIA = ("inertial", "inertia")
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


class JointFile(ABC):
    """One file of links and joints; its two formats differ in where a number stands."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.edit = XmlEdit(path)
        nodes = list(self.edit.root.walk())
        self.links = {n.attributes.get("name", ""): n for n in nodes if n.tag == "link"}
        turning = ("continuous", "revolute")
        self.joints = {
            n.attributes.get("name", ""): n
            for n in nodes
            if n.tag == "joint" and n.attributes.get("type") in turning
        }

    # ---- what a format says in its own way

    @abstractmethod
    def end(self, joint: Node, which: str) -> str:
        """Name of a joint's `parent` or `child` link."""

    @abstractmethod
    def across(self, name: str) -> float:
        """How far to the left a joint stands, m."""

    @abstractmethod
    def read(self, node: Node, element: tuple[str, ...], name: str) -> float:
        """A number of an element below a joint or link; zero where it is not there."""

    @abstractmethod
    def put(self, node: Node, element: tuple[str, ...], values: dict[str, float]) -> None:
        """Set such numbers, and make the element where there is none."""

    @abstractmethod
    def axis(self, joint: Node) -> tuple[float, ...]:
        """The joint's axis."""

    DYNAMICS: tuple[str, ...]
    LIMIT: tuple[str, ...]
    MASS: tuple[tuple[str, ...], str]

    # ---- what both have in common

    def pair(self, names: tuple[str, str] | None) -> tuple[str, str]:
        """The wheels' joints, left first."""
        return sides_of(self.path, {name: self.across(name) for name in self.joints}, names)

    def robot(self, pair: tuple[str, str], radius_m: float) -> OwnRobot:
        """The user's numbers."""
        axles, inertias = [], []
        for name in pair:
            joint = self.joints[name]
            axles.append(
                OwnAxle(
                    name,
                    self.read(joint, self.LIMIT, "effort"),
                    self.read(joint, self.DYNAMICS, "damping"),
                    self.read(joint, self.DYNAMICS, "friction"),
                )
            )
            inertias.append(self.about_axis(joint))
        total_kg = sum(self.read(link, *self.MASS) for link in self.links.values())
        inertia = float(np.mean(inertias)) + 0.5 * total_kg * radius_m**2
        return OwnRobot(axles[0], axles[1], inertia, self.read(self._chassis(pair), *self.MASS), radius_m)

    def patched(self, pair: tuple[str, str], patch: Patch) -> bytes:
        """The file with the patch in it."""
        for name, axle in zip(pair, (patch.left, patch.right), strict=True):
            joint = self.joints[name]
            found = {"damping": axle.damping_nms, "friction": axle.friction_nm}
            self.put(joint, self.DYNAMICS, found)
            if patch.kept == KEEP_MASSES:
                self.put(joint, self.LIMIT, {"effort": axle.torque_nm})
        if patch.chassis_factor != 1.0:
            chassis, (element, name) = self._chassis(pair), self.MASS
            factor = patch.chassis_factor
            self.put(chassis, element, {name: factor * self.read(chassis, element, name)})
            moments = {m: factor * self.read(chassis, _INERTIA, m) for m in _MOMENTS}
            self.put(chassis, _INERTIA, {m: value for m, value in moments.items() if value != 0.0})
        return self.edit.result()

    def number(self, text: str, what: str) -> float:
        """A number of the file."""
        try:
            return float(text)
        except ValueError:
            self.refuse(f"{what} is no number: {text!r}")

    def refuse(self, problem: str) -> NoReturn:
        """Say what the file has that cannot be patched."""
        expand = "Expand it first (xacro FILE > robot.urdf) and patch the result"
        raise FileError(self.path, problem, expand if "$" in problem else "Look at the file")

    def about_axis(self, joint: Node) -> float:
        """A wheel link's inertia about its joint's axis, kg m^2."""
        link = self._link(joint, "child")
        values = {m: self.read(link, _INERTIA, m) for m in _MOMENTS}
        tensor = np.array(
            [
                [values["ixx"], values["ixy"], values["ixz"]],
                [values["ixy"], values["iyy"], values["iyz"]],
                [values["ixz"], values["iyz"], values["izz"]],
            ]
        )
        axis = np.array(self.axis(joint))
        return float(axis @ tensor @ axis / (axis @ axis))

    def _chassis(self, pair: tuple[str, str]) -> Node:
        """The wheels' parent, or, where that has no mass (a base_footprint), the heaviest other link."""
        parents = {self.end(self.joints[name], "parent") for name in pair}
        wheels = {self.end(self.joints[name], "child") for name in pair}
        if len(parents) == 1:
            link = self._link(self.joints[pair[0]], "parent")
            if self.read(link, *self.MASS) > 0.0:
                return link
        others = [link for name, link in self.links.items() if name not in wheels]
        return max(others, key=lambda link: self.read(link, *self.MASS))

    def _link(self, joint: Node, which: str) -> Node:
        name = self.end(joint, which)
        if name not in self.links:
            self.refuse(f"the {which} link {name!r} of a wheel's joint is not there")
        return self.links[name]


class UrdfFile(JointFile):
    """Numbers are attributes: `<dynamics damping="0.1"/>`, `<mass value="2"/>`."""

    DYNAMICS, LIMIT, MASS = ("dynamics",), ("limit",), (("inertial", "mass"), "value")

    def end(self, joint: Node, which: str) -> str:
        """Name of a joint's `parent` or `child` link."""
        node = joint.find(which)
        return "" if node is None else node.attributes.get("link", "")

    def across(self, name: str) -> float:
        """The second number of the joint's origin."""
        origin = self.joints[name].find("origin")
        words = ["0", "0", "0"] if origin is None else origin.attributes.get("xyz", "0 0 0").split()
        return self.number(words[1], f"the origin of {name}")

    def axis(self, joint: Node) -> tuple[float, ...]:
        """The joint's axis; x where the file does not say."""
        node = joint.find("axis")
        words = ["1", "0", "0"] if node is None else node.attributes.get("xyz", "1 0 0").split()
        return tuple(self.number(word, "an axis") for word in words)

    def read(self, node: Node, element: tuple[str, ...], name: str) -> float:
        """An attribute of an element below a joint or link; zero where it is not there."""
        found = node.find(*element)
        text = None if found is None else found.attributes.get(name)
        return 0.0 if text is None else self.number(text, name)

    def put(self, node: Node, element: tuple[str, ...], values: dict[str, float]) -> None:
        """Set attributes; an element that is missing is added with them."""
        found = node.find(*element)
        if found is None:
            attributes = "".join(f' {name}="{short(value)}"' for name, value in values.items())
            self.edit.add_child(node, f"<{element[-1]}{attributes}/>")
            return
        for name, value in values.items():
            self.edit.set_attribute(found, name, short(value))


class SdfFile(JointFile):
    """Numbers are texts: `<dynamics><damping>0.1</damping></dynamics>`, `<mass>2</mass>`."""

    DYNAMICS, LIMIT, MASS = ("axis", "dynamics"), ("axis", "limit"), (("inertial",), "mass")

    def end(self, joint: Node, which: str) -> str:
        """Name of a joint's `parent` or `child` link."""
        node = joint.find(which)
        return "" if node is None else self.edit.text(node)

    def across(self, name: str) -> float:
        """The second number of the child link's pose, or of the joint's."""
        joint = self.joints[name]
        link = self.links.get(self.end(joint, "child"))
        for node in (link, joint):
            pose = None if node is None else node.find("pose")
            if pose is not None:
                return self.number(self.edit.text(pose).split()[1], f"the pose of {name}")
        return 0.0

    def axis(self, joint: Node) -> tuple[float, ...]:
        """The joint's axis; z where the file does not say."""
        node = joint.find("axis", "xyz")
        words = ["0", "0", "1"] if node is None else self.edit.text(node).split()
        return tuple(self.number(word, "an axis") for word in words)

    def read(self, node: Node, element: tuple[str, ...], name: str) -> float:
        """The text of an element below a joint or link; zero where it is not there."""
        found = node.find(*element, name)
        return 0.0 if found is None else self.number(self.edit.text(found), name)

    def put(self, node: Node, element: tuple[str, ...], values: dict[str, float]) -> None:
        """Set elements' texts; elements that are missing are added."""
        known = next(n for n in range(len(element), -1, -1) if not n or node.find(*element[:n]) is not None)
        holder = node.find(*element[:known]) if known else node
        assert holder is not None
        missing = element[known:]
        added = {name: value for name, value in values.items() if missing or holder.find(name) is None}
        for name in values.keys() - added.keys():
            found = holder.find(name)
            assert found is not None
            self.edit.set_text(found, short(values[name]))
        if added:
            xml = "".join(f"<{name}>{short(value)}</{name}>" for name, value in added.items())
            xml = "".join(f"<{tag}>" for tag in missing) + xml
            self.edit.add_child(holder, xml + "".join(f"</{tag}>" for tag in reversed(missing)))
