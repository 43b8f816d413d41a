"""A two-wheel robot of Bullet's own, as URDF: chassis with two casters, and two driven wheels.

Wheels are spheres, which touch the floor at one point each. Bullet has no armature: rotors are in the wheels.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree as Xml

from truing.trial.engines.nominal import WHEEL_SHARE
from truing.trial.engines.robot import EngineRobot

# Transverse over axial inertia of a wheel: a disc's half, and a little for the triangle inequality.
_TRANSVERSE = 0.51


@dataclass(frozen=True)
class BulletRobot(EngineRobot):
    """What all engines can change; the delay is a buffer in the stepping loop."""

    def joint_damping_nms(self, wheel: int) -> float:
        """Back-EMF, bearing, and what is hidden."""
        return self.nominal.damping_nms(wheel) + self.damping_nms[wheel]

    def urdf(self, run: int = 0) -> str:
        """The robot as it is in this run."""
        nominal, r = self.nominal, self.nominal.radius_m
        turning = (nominal.rotor_share + WHEEL_SHARE) * nominal.axle_inertia_kgm2
        wheel_kg = 2.0 * WHEEL_SHARE * nominal.axle_inertia_kgm2 / r**2
        at_wheels = 2.0 * (0.25 * wheel_kg * self.track_m**2 + _TRANSVERSE * turning)
        yaw = max(
            self.yaw_factor * self.track_factor**2 * nominal.yaw_inertia_kgm2 - at_wheels,
            0.05 * nominal.yaw_inertia_kgm2,
        )
        load = self.load_kg if run >= self.load_from_run else 0.0
        # A load over both wheels keeps the wheels from feeling each other.
        at_load = 0.25 * load * self.track_m**2
        kilograms = nominal.mass_kg - 2.0 * wheel_kg - self.pendulum_kg + load
        root = Xml.Element("robot", {"name": "trial"})
        roll = 0.55 * yaw + at_load
        base = _link(root, "chassis", kilograms, (roll, 0.55 * yaw, yaw + at_load), height=-0.4 * r)
        reach, small = 0.5 * nominal.wheelbase_m, 0.25 * r
        for x in (reach, -reach):
            _sphere(base, small, (x, 0.0, small - r))
        for wheel, side in enumerate(("left", "right")):
            link = _link(
                root, f"{side}_wheel", wheel_kg, (_TRANSVERSE * turning, turning, _TRANSVERSE * turning)
            )
            _sphere(link, r * self.radius_factor[wheel], (0.0, 0.0, 0.0))
            lift = r * (self.radius_factor[wheel] - 1.0)
            y = (0.5 if wheel == 0 else -0.5) * self.track_m
            _joint(root, f"{side}_wheel", (0.0, y, lift))
        if self.pendulum_kg > 0.0:
            own = 0.4 * self.pendulum_kg * (0.2 * r) ** 2
            _link(root, "load", self.pendulum_kg, (own, own, own), height=-self.pendulum_m)
            _joint(root, "load", (0.0, 0.0, -0.4 * r + self.pendulum_m))
        return Xml.tostring(root, encoding="unicode")


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.10g}" for value in values)


def _link(
    root: Xml.Element,
    name: str,
    kilograms: float,
    inertia: tuple[float, float, float],
    *,
    height: float = 0.0,
) -> Xml.Element:
    link = Xml.SubElement(root, "link", {"name": name})
    made = Xml.SubElement(link, "inertial")
    Xml.SubElement(made, "origin", {"xyz": _numbers(0.0, 0.0, height)})
    Xml.SubElement(made, "mass", {"value": f"{kilograms:.10g}"})
    x, y, z = (f"{value:.10g}" for value in inertia)
    Xml.SubElement(made, "inertia", {"ixx": x, "iyy": y, "izz": z, "ixy": "0", "ixz": "0", "iyz": "0"})
    return link


def _sphere(link: Xml.Element, radius: float, place: tuple[float, float, float]) -> None:
    collision = Xml.SubElement(link, "collision")
    Xml.SubElement(collision, "origin", {"xyz": _numbers(*place)})
    Xml.SubElement(Xml.SubElement(collision, "geometry"), "sphere", {"radius": f"{radius:.10g}"})


def _joint(root: Xml.Element, child: str, place: tuple[float, float, float]) -> None:
    joint = Xml.SubElement(root, "joint", {"name": child, "type": "continuous"})
    Xml.SubElement(joint, "parent", {"link": "chassis"})
    Xml.SubElement(joint, "child", {"link": child})
    Xml.SubElement(joint, "origin", {"xyz": _numbers(*place)})
    Xml.SubElement(joint, "axis", {"xyz": "0 1 0"})
