"""MuJoCo MJCF: wheel joints with damping, frictionloss and armature, and a motor for each (see `joint`).

MuJoCo's frictionloss is a constraint that is solved softly: it holds a wheel by letting it creep, the less
so the closer its impedance is to 1 and the shorter its time constant; both are set near the ends of what
MuJoCo allows. The integrator is implicit in damping, and its step is short against the time constant: its
error in speed during a step response stays below timestep / (2 e tau) of the step, 1 part in 2000 here.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree as Xml

from truing.model.robot_model import RobotModel
from truing.recording.writer import replace_file

from .joint import WHEEL_SHARE, joints
from .joint import remarks as joint_remarks
from .terms import CORRECTION, DEFAULTS, ExportOptions, headline, left_out, wheels
from .xml_file import child, number, numbers, write_xml

KIND = "mjcf"
TITLE = "damping, frictionloss, armature and actuators for MuJoCo"
SUFFIX = ".xml"
HOLDS = frozenset({"friction", "delay", "lag", CORRECTION})

LONGEST_STEP_S = 1e-3
STEPS_PER_TIME_CONSTANT = 400
# MuJoCo allows no time constant of a constraint below two steps, and no impedance above 0.9999.
SOLREF_STEPS = 2.0
IMPEDANCE = 0.9999
# First-order dynamics of an actuator, integrated in closed form.
FILTER = "filterexact"


def timestep(model: RobotModel) -> float:
    """A step short against both time constants, s; a round number, so that periods hold a whole count."""
    shortest = min(wheel.time_constant_s for _, wheel in wheels(model))
    limit_s = min(LONGEST_STEP_S, shortest / STEPS_PER_TIME_CONSTANT)
    decade = math.floor(math.log10(limit_s))
    return max(step for step in (float(f"{d}e{decade}") for d in (1, 2, 5)) if step <= limit_s)


def write(model: RobotModel, path: Path, options: ExportOptions = DEFAULTS) -> tuple[Path, ...]:
    """A base that stands still, two wheels that turn about y (forward is x), and a motor on each."""
    radius, half = options.radius(model), 0.5 * options.wheelbase(model)
    step = timestep(model)
    root = Xml.Element("mujoco", {"model": model.robot.name or "robot"})
    child(root, "compiler", angle="radian", autolimits="true")
    child(root, "option", timestep=number(step), integrator="implicitfast")
    base = child(child(root, "worldbody"), "body", name="base", pos=numbers(0.0, 0.0, radius))
    size = numbers(half, 0.8 * half, 0.5 * radius)
    child(base, "geom", name="chassis", type="box", size=size, contype="0", conaffinity="0")
    made = joints(model, options)
    actuators = Xml.Element("actuator")
    for joint, y in zip(made, (half, -half), strict=True):
        wheel = child(base, "body", name=f"{joint.side}_wheel", pos=numbers(0.0, y, 0.0))
        own = WHEEL_SHARE * joint.inertia_kgm2
        child(
            wheel,
            "inertial",
            pos="0 0 0",
            mass=number(2.0 * own / radius**2),
            diaginertia=numbers(0.5 * own, own, 0.5 * own),
        )
        child(
            wheel,
            "joint",
            name=joint.name,
            type="hinge",
            axis="0 1 0",
            damping=number(joint.damping_nms),
            armature=number(joint.inertia_kgm2 - own),
            frictionloss=number(joint.friction_nm),
            solreffriction=numbers(SOLREF_STEPS * step, 1.0),
            solimpfriction=numbers(IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0),
        )
        tyre = {"size": numbers(radius, 0.15 * radius), "euler": numbers(0.5 * math.pi, 0.0, 0.0)}
        child(wheel, "geom", name=f"{joint.side}_tyre", type="cylinder", contype="0", conaffinity="0", **tyre)
        # A motor is a general actuator without dynamics; the driver's lag is a filter ahead of its torque.
        motor = child(
            actuators,
            "general" if joint.lag_s else "motor",
            name=f"{joint.side}_motor",
            joint=joint.name,
            gear=number(joint.torque_nm),
        )
        motor.set("ctrlrange", "-1 1")
        if joint.lag_s:
            motor.set("dyntype", FILTER)
            motor.set("dynprm", number(joint.lag_s))
        if joint.delay_s > 0.5 * step:
            # MuJoCo delays by whole steps and rounds up (measured on 4.0, where round-off in its clock adds a
            # step to a delay that is a whole number of them): half a step less gives the nearest number.
            motor.set("delay", number(joint.delay_s - 0.5 * step))
            motor.set("nsample", str(math.ceil(joint.delay_s / step) + 1))
    root.append(actuators)
    write_xml(
        root,
        path,
        (
            headline(model),
            "ctrl is the effort (-1..1); the gear is the torque at full effort, N m",
            "armature is the axle's inertia without the wheel body's own",
            *remarks(model, options),
            *left_out(model, HOLDS),
        ),
    )
    return (path,) if model.correction is None else (path, write_callback(model, path, options))


def write_callback(model: RobotModel, path: Path, options: ExportOptions) -> Path:
    """Write the learned correction as a Python file beside the MJCF, to be called before every step."""
    from . import standalone_correction

    assert standalone_correction.__file__ is not None
    assert model.correction is not None
    made = joints(model, options)
    beside = path.with_name(f"{path.stem}_correction.py")
    values = {
        "TABLE: dict[str, Any]": model.correction.to_dict(),
        "JOINTS": tuple(joint.name for joint in made),
        "RADIUS_M": options.radius(model),
        "TORQUE_NM": tuple(joint.torque_nm for joint in made),
        "FRICTION_NM": tuple(joint.friction_nm for joint in made),
        "WHEELBASE_M": model.robot.wheelbase_m or options.wheelbase_m or 0.0,
    }
    lines = []
    for line in Path(standalone_correction.__file__).read_text(encoding="utf-8").split("\n"):
        name = line.split(" = ")[0]
        lines.append(f"{name} = {values[name]!r}" if name in values else line)
    replace_file(beside, "\n".join(lines).replace("NAME", path.stem).encode("utf-8"))
    return beside


def remarks(model: RobotModel, options: ExportOptions) -> tuple[str, ...]:
    """The free choice of inertia, and what a delay or a correction asks of MuJoCo."""
    said = joint_remarks(model, options)
    if model.correction is not None:
        said += (
            "MJCF holds no lookup: the learned correction acts where the Python file beside this one is "
            "called before every step (it says how)",
        )
    if any(wheel.delay_s > 0.5 * timestep(model) for _, wheel in wheels(model)):
        said += (
            "delay and nsample of the motors need MuJoCo 3.5 or later; an older one wants them removed",
            "each delay is written half a step short, since MuJoCo rounds up to whole steps",
        )
    return said
