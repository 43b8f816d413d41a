"""A two-wheel robot of MuJoCo's own: free chassis, two driven wheels and two casters on a floor.

Wheels are spheres, which touch the floor at one point each as a rounded tread does: a cylinder's edge would
scrub in turns. A motor is MuJoCo's general actuator with a bias in velocity (back-EMF), or its `dcmotor` for
cogging and brush friction. Contacts are stiff, friction cones elliptic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree import ElementTree as Xml

from truing.trial.engines.nominal import WHEEL_SHARE
from truing.trial.engines.robot import GRAVITY, EngineRobot

STEP_S = 0.001
# MuJoCo allows no time constant of a constraint below two steps, and no impedance above 0.9999.
_STIFF = f"{2.0 * STEP_S:g} 1"
_IMPEDANCE = "0.9999 0.9999 0.001 0.5 2"
_CONTACT_S = 0.004
_SUPPLY_V = 12.0


@dataclass(frozen=True)
class Brush:
    """LuGre friction of the dcmotor (Canudas de Wit et al. 1995), at the axle."""

    coulomb_nm: float
    breakaway_nm: float
    stribeck_radps: float


@dataclass(frozen=True)
class MujocoRobot(EngineRobot):
    """What MuJoCo can change beyond what all engines can; the delay is the actuators'.

    Attributes
    ----------
    play_rad : gap between motor and wheel, left and right; 0: none.
    shaft_nm_per_rad : stiffness of a shaft between motor and wheel; 0: it is rigid.
    filter_s : of the actuators.
    torque_limit : largest torque of the actuators over the stall torque; 0: none.
    air_kgpm3 : density of the medium.
    caster_trail_m, caster_load : of a swivel caster in front, and the share of the weight on it.
    cogging_nm, cogging_per_rev : of the motors.
    brush : friction of the motors.
    """

    play_rad: tuple[float, float] = (0.0, 0.0)
    shaft_nm_per_rad: float = 0.0
    filter_s: float = 0.0
    torque_limit: float = 0.0
    air_kgpm3: float = 0.0
    caster_trail_m: float = 0.0
    caster_load: float = 0.0
    cogging_nm: tuple[float, float] = (0.0, 0.0)
    cogging_per_rev: int = 0
    brush: tuple[Brush, Brush] | None = None

    @property
    def split(self) -> bool:
        """Whether motor and wheel are bodies of their own."""
        return any(self.play_rad) or self.shaft_nm_per_rad > 0.0

    @property
    def has_dcmotor(self) -> bool:
        """Whether the motors are `dcmotor`s."""
        return any(self.cogging_nm) or self.brush is not None

    @property
    def full_control(self) -> float:
        """Control value of full effort."""
        return _SUPPLY_V if self.has_dcmotor else 1.0

    @property
    def wheel_kg(self) -> float:
        """Mass of one wheel, a disc of the share of inertia that is its own."""
        return 2.0 * self._wheel_inertia / self.nominal.radius_m**2

    @property
    def _wheel_inertia(self) -> float:
        return WHEEL_SHARE * self.nominal.axle_inertia_kgm2

    @property
    def chassis(self) -> tuple[float, tuple[float, float, float]]:
        """Mass and inertia (roll, pitch, yaw) of the chassis about its centre."""
        nominal = self.nominal
        kilograms = nominal.mass_kg - 2.0 * self.wheel_kg
        at_wheels = 2.0 * (0.25 * self.wheel_kg * self.track_m**2 + 0.5 * self._wheel_inertia)
        scale = self.yaw_factor * self.track_factor**2
        yaw = max(scale * nominal.yaw_inertia_kgm2 - at_wheels, 0.05 * nominal.yaw_inertia_kgm2)
        # A flat body: roll and pitch make up the yaw, as those of a plate do, but for its height.
        return kilograms, (0.55 * yaw, 0.55 * yaw, yaw)

    def mjcf(self, run: int = 0) -> str:
        """The robot and its floor as MJCF, as they are in this run."""
        root = Xml.Element("mujoco", {"model": "trial robot"})
        Xml.SubElement(root, "compiler", {"angle": "radian", "autolimits": "true"})
        option = {"timestep": STEP_S, "integrator": "implicitfast", "cone": "elliptic", "impratio": 20}
        _add(root, "option", gravity=(0.0, 0.0, -GRAVITY), density=self.air_kgpm3, **option)
        world = Xml.SubElement(root, "worldbody")
        self._floor(world)
        body = _add(world, "body", name="chassis", pos=(0.0, 0.0, self.nominal.radius_m))
        Xml.SubElement(body, "freejoint")
        self._chassis(body, run)
        actuators = Xml.Element("actuator")
        for wheel, side in enumerate(("left", "right")):
            self._wheel(body, wheel, side)
            self._motor(actuators, wheel, side)
        root.append(actuators)
        return Xml.tostring(root, encoding="unicode")

    def _floor(self, world: Xml.Element) -> None:
        contact = {"solref": (_CONTACT_S, 1.0)}
        _add(world, "geom", name="floor", type="plane", size=(50, 50, 0.1), friction=(0, 0, 0), **contact)
        if self.bump_m > 0.0:
            size = (0.04, 20.0, self.bump_m)
            place = (self.bump_at_m, 0.0, 0.0)
            _add(world, "geom", name="step", type="box", size=size, pos=place, friction=(0, 0, 0), **contact)

    def _chassis(self, body: Xml.Element, run: int) -> None:
        nominal, r = self.nominal, self.nominal.radius_m
        kilograms, inertia = self.chassis
        load = self.load_kg if run >= self.load_from_run else 0.0
        reach = 0.5 * nominal.wheelbase_m
        place = (self.caster_load * reach, 0.0, -0.4 * r)
        kilograms -= self.pendulum_kg
        # A load over both wheels keeps the wheels from feeling each other.
        yaw = inertia[2] + 0.25 * load * self.track_m**2
        roll = inertia[0] + 0.25 * load * self.track_m**2
        _add(body, "inertial", pos=place, mass=kilograms + load, diaginertia=(roll, inertia[1], yaw))
        small = 0.25 * r
        caster = {"type": "sphere", "size": small, "priority": 1, "solref": (_CONTACT_S, 1.0)}
        _add(body, "geom", name="rear", pos=(-reach, 0.0, small - r), condim=1, **caster)
        if self.caster_trail_m > 0.0:
            self._swivel(body, reach, small)
        else:
            _add(body, "geom", name="front", pos=(reach, 0.0, small - r), condim=1, **caster)
        if self.pendulum_kg > 0.0:
            bob = _add(body, "body", name="load", pos=(0.0, 0.0, -0.4 * r + self.pendulum_m))
            size = 0.2 * r
            own = 0.4 * self.pendulum_kg * size**2
            _add(bob, "joint", name="swing", type="hinge", axis=(0, 1, 0), damping=1e-4 * self.pendulum_kg)
            down = (0.0, 0.0, -self.pendulum_m)
            _add(bob, "inertial", pos=down, mass=self.pendulum_kg, diaginertia=(own, own, own))

    def _swivel(self, body: Xml.Element, reach: float, small: float) -> None:
        """A caster on a vertical axis, its wheel behind that axis by the trail."""
        fork = _add(body, "body", name="fork", pos=(reach, 0.0, small - self.nominal.radius_m))
        light = 0.01 * self.nominal.mass_kg
        own = 0.4 * light * (small**2 + self.caster_trail_m**2)
        _add(fork, "joint", name="swivel", type="hinge", axis=(0, 0, 1), damping=0.5 * own)
        _add(fork, "inertial", pos=(0, 0, 0), mass=light, diaginertia=(own, own, own))
        wheel = _add(fork, "body", name="caster", pos=(-self.caster_trail_m, 0.0, 0.0))
        _add(wheel, "joint", name="caster", type="hinge", axis=(0, 1, 0))
        _add(wheel, "inertial", pos=(0, 0, 0), mass=light, diaginertia=(own, own, own))
        tyre = {"friction": (0.8, 0, 0), "priority": 2, "solref": (_CONTACT_S, 1.0)}
        _add(wheel, "geom", name="caster", type="sphere", size=small, condim=3, **tyre)

    def _wheel(self, body: Xml.Element, wheel: int, side: str) -> None:
        nominal = self.nominal
        own = self._wheel_inertia
        y = (0.5 if wheel == 0 else -0.5) * self.track_m
        rotor = nominal.rotor_share * nominal.axle_inertia_kgm2
        bearing = nominal.damping_nms(wheel) * nominal.viscous / (1.0 + nominal.viscous)
        bearing += self.damping_nms[wheel]
        axle = {
            "name": f"{side}_motor",
            "type": "hinge",
            "axis": (0, 1, 0),
            "armature": rotor,
            "damping": bearing,
            "frictionloss": self.friction_nm[wheel],
            "solreffriction": _STIFF,
            "solimpfriction": _IMPEDANCE,
        }
        # The axle is as high as the tyre wants it, so that wheels and casters still share the weight.
        lift = nominal.radius_m * (self.radius_factor[wheel] - 1.0)
        outer = _add(body, "body", name=f"{side}_wheel", pos=(0.0, y, lift))
        _add(outer, "joint", **axle)
        disc = {"pos": (0, 0, 0), "mass": self.wheel_kg, "diaginertia": (0.51 * own, own, 0.51 * own)}
        if self.split:
            tiny = {"pos": (0, 0, 0), "mass": 1e-3 * self.wheel_kg}
            _add(outer, "inertial", diaginertia=(1e-3 * own, 1e-3 * own, 1e-3 * own), **tiny)
            outer = _add(outer, "body", name=f"{side}_tyre")
            self._shaft(outer, wheel, side)
        _add(outer, "inertial", **disc)
        _add(
            outer,
            "geom",
            name=f"{side}_tyre",
            type="sphere",
            size=nominal.radius_m * self.radius_factor[wheel],
            condim=6 if self.rolling_m > 0.0 else 4 if self.torsion_m > 0.0 else 3,
            friction=(self.grip, self.torsion_m, self.rolling_m),
            solref=(_CONTACT_S, 1.0),
            priority=1,
        )

    def _shaft(self, outer: Xml.Element, wheel: int, side: str) -> None:
        """What lies between motor and wheel: a gap, or a spring."""
        made = {"name": f"{side}_shaft", "type": "hinge", "axis": (0, 1, 0)}
        rotor = self.nominal.rotor_share * self.nominal.axle_inertia_kgm2
        if self.shaft_nm_per_rad > 0.0:
            damping = 0.1 * math.sqrt(self.shaft_nm_per_rad * rotor)
            _add(outer, "joint", stiffness=self.shaft_nm_per_rad, damping=damping, **made)
            return
        half = max(0.5 * self.play_rad[wheel], 1e-4)
        stiff = {"solreflimit": (4.0 * STEP_S, 1.0), "solimplimit": "0.99 0.999 0.001 0.5 2"}
        _add(outer, "joint", range=(-half, half), damping=1e-3 * rotor / STEP_S, **made, **stiff)

    def _motor(self, actuators: Xml.Element, wheel: int, side: str) -> None:
        nominal = self.nominal
        stall = nominal.stall_nm(wheel)
        emf = nominal.damping_nms(wheel) / (1.0 + nominal.viscous)
        full = self.full_control
        motor = _add(
            actuators,
            "dcmotor" if self.has_dcmotor else "general",
            name=f"{side}_motor",
            joint=f"{side}_motor",
            ctrlrange=(-full, full),
        )
        if self.has_dcmotor:
            # stall = K V / R and back-EMF damping = K² / R.
            constant = emf * _SUPPLY_V / stall
            _set(motor, motorconst=(constant, constant), resistance=constant * _SUPPLY_V / stall)
            if self.cogging_nm[wheel] > 0.0:
                _set(motor, cogging=(self.cogging_nm[wheel], self.cogging_per_rev, 0.0))
            if self.brush is not None:
                brush = self.brush[wheel]
                stiffness = brush.breakaway_nm / 0.002
                damping = 2.0 * math.sqrt(stiffness * nominal.axle_inertia_kgm2)
                _set(motor, lugre=(stiffness, damping, brush.coulomb_nm, brush.breakaway_nm))
                motor.set("lugre", motor.get("lugre", "") + f" {brush.stribeck_radps:.10g}")
        else:
            _set(motor, gainprm=stall, biastype="affine", biasprm=(0.0, 0.0, -emf))
            if self.filter_s > 0.0:
                _set(motor, dyntype="filterexact", dynprm=self.filter_s)
        if self.torque_limit > 0.0:
            most = self.torque_limit * stall
            _set(motor, forcerange=(-most, most))
        if self.delay_s > 0.5 * STEP_S:
            # MuJoCo delays by whole steps and rounds up: half a step less gives the nearest number.
            _set(motor, delay=self.delay_s - 0.5 * STEP_S, nsample=math.ceil(self.delay_s / STEP_S) + 1)


def _text(value: object) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, tuple):
        return " ".join(_text(each) for each in value)
    return f"{value:.10g}"


def _set(element: Xml.Element, **values: object) -> None:
    for name, value in values.items():
        element.set(name, _text(value))


def _add(parent: Xml.Element, tag: str, **values: object) -> Xml.Element:
    element = Xml.SubElement(parent, tag)
    _set(element, **values)
    return element
