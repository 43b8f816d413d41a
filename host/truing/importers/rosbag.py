"""ROS 1 and ROS 2 bags, MCAP files of ROS among them.

Wheels come from sensor_msgs/JointState, the pose from nav_msgs/Odometry, commands from
geometry_msgs/Twist. A bag rarely holds the effort that a motor got. The commanded wheel speed, from the
twist and the wheelbase, stands in as the input, as a share of full speed; that is another input than a
motor's effort, and the findings say so.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import RecordingError
from truing.extras import require

from .foreign import Finding, ForeignTest, ImportOptions

KIND = "ROS bag"

JOINT_STATE = "sensor_msgs/msg/JointState"
ODOMETRY = "nav_msgs/msg/Odometry"
TWISTS = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")


@dataclass(slots=True)
class Series:
    """Messages of one topic as rows: time (s, since the bag's first message) and numbers."""

    times: list[float] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)

    def arrays(self) -> tuple[FloatArray, FloatArray]:
        """Times, shape (n,), and numbers, shape (columns, n), sorted by time."""
        times = np.array(self.times)
        order = np.argsort(times, kind="stable")
        return times[order], np.array(self.rows, dtype=np.float64)[order].T


def matches(path: Path, head: bytes) -> bool:
    """A bag file, an MCAP file, or a ROS 2 bag's folder."""
    if path.is_dir():
        return (path / "metadata.yaml").exists()
    return path.suffix.lower() in (".bag", ".mcap", ".db3") or head.startswith((b"#ROSBAG", b"\x89MCAP0"))


def read(path: Path, options: ImportOptions) -> tuple[list[ForeignTest], list[Finding]]:
    """The whole bag as one test at the joint states' (else the odometry's) times."""
    bag = _collect(path)
    if not bag.twist.times:
        raise RecordingError(path, f"no geometry_msgs/Twist tells what was commanded; it has {bag.types}")
    findings: list[Finding] = []
    position, speed = None, None
    if bag.joints.times:
        times, wheels = bag.joints.arrays()
        per_radian = 1.0 if options.metres_per_unit is None else options.metres_per_unit
        if options.metres_per_unit is None:
            text = "angles (rad) are taken as metres: truing import --metres-per-unit takes the wheel radius"
            findings.append(Finding("position_unit", text))
        position, speed = (
            block * per_radian if np.isfinite(block).all() else None for block in (wheels[0:2], wheels[2:4])
        )
        if position is None and speed is None:
            raise RecordingError(path, "JointState has neither positions nor velocities in every message")
        findings += bag.joint_findings
    elif bag.odometry.times:
        times, pose = bag.odometry.arrays()
        half = 0.5 * _wheelbase(path, options)
        speed = np.array([pose[3] - half * pose[4], pose[3] + half * pose[4]])
        text = "no JointState: wheel speeds are reckoned back from the odometry's twist"
        findings.append(Finding("no_joints", text))
    else:
        raise RecordingError(
            path, f"neither sensor_msgs/JointState nor nav_msgs/Odometry tells the motion; it has {bag.types}"
        )
    effort, finding = _effort(path, times, bag.twist, options)
    findings.append(finding)
    name = path.name.split(".")[0].lower()
    test = ForeignTest(name, times, effort=effort, position=position, speed=speed, time_known=True)
    if bag.odometry.times:
        pose_times, pose = bag.odometry.arrays()
        test.extra = {
            column: np.interp(times, pose_times, pose[i])
            for i, column in enumerate(("x_m", "y_m", "theta_rad"))
        }
    return [test], findings


@dataclass(slots=True)
class Bag:
    """What a bag holds of use, and the types of everything in it."""

    joints: Series = field(default_factory=Series)
    odometry: Series = field(default_factory=Series)
    twist: Series = field(default_factory=Series)
    joint_findings: list[Finding] = field(default_factory=list)
    types: str = ""


def _collect(path: Path) -> Bag:
    require("bags")
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    bag = Bag()
    origin: int | None = None
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            bag.types = ", ".join(sorted({item.msgtype for item in reader.connections})) or "nothing"
            wanted = [item for item in reader.connections if item.msgtype in (JOINT_STATE, ODOMETRY, *TWISTS)]
            _one_topic_each(path, [(item.msgtype, item.topic) for item in wanted])
            for connection, stamp, raw in reader.messages(connections=wanted) if wanted else ():
                message: Any = reader.deserialize(raw, connection.msgtype)
                now = _time_ns(message, stamp)
                # A double holds nanoseconds since a bag's beginning, but not since 1970.
                origin = now if origin is None else origin
                time = 1e-9 * (now - origin)
                if connection.msgtype == JOINT_STATE:
                    _add_joints(path, bag, time, message)
                elif connection.msgtype == ODOMETRY:
                    _add_odometry(bag.odometry, time, message)
                else:
                    body = getattr(message, "twist", message)
                    bag.twist.times.append(time)
                    bag.twist.rows.append([body.linear.x, body.angular.z])
    except RecordingError:
        raise
    except Exception as error:
        # A damaged bag fails in its index, database, compression or messages, each in its own way.
        raise RecordingError(path, f"not readable as a bag, damaged or cut off: {error}") from None
    return bag


def _one_topic_each(path: Path, found: list[tuple[str, str]]) -> None:
    """Two topics of one kind cannot be distinguished: say so rather than mix them."""
    for kinds in ((JOINT_STATE,), (ODOMETRY,), TWISTS):
        topics = sorted({topic for kind, topic in found if kind in kinds})
        if len(topics) > 1:
            raise RecordingError(
                path,
                f"{len(topics)} topics of {kinds[0]}: {', '.join(topics)}",
                next_step="Keep one of them: ros2 bag convert, or rosbag filter",
            )


def _time_ns(message: Any, received_ns: int) -> int:
    """When it was measured, if the header says so; else when it was received."""
    header = getattr(message, "header", None)
    if header is not None and (header.stamp.sec or header.stamp.nanosec):
        return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)
    return received_ns


def _add_joints(path: Path, bag: Bag, time: float, message: Any) -> None:
    names = [str(name).lower() for name in message.name]
    indices = []
    for word in ("left", "right"):
        found = [i for i, name in enumerate(names) if word in name]
        if not found:
            has = ", ".join(names) or "no names"
            raise RecordingError(path, f"JointState has no joint whose name holds {word!r}; it has: {has}")
        if len(found) > 1 and not bag.joints.times:
            others = ", ".join(repr(names[i]) for i in found[1:])
            text = f"the {word} wheel is taken from {names[found[0]]!r}; it could also be {others}"
            bag.joint_findings.append(Finding("several_channels", text))
        indices.append(found[0])
    row = []
    for values in (message.position, message.velocity):
        row += [float(values[i]) if i < len(values) else np.nan for i in indices]
    bag.joints.times.append(time)
    bag.joints.rows.append(row)


def _add_odometry(odometry: Series, time: float, message: Any) -> None:
    position, q = message.pose.pose.position, message.pose.pose.orientation
    yaw = float(np.arctan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z)))
    if odometry.rows:
        before = odometry.rows[-1][2]
        yaw = before + (yaw - before + np.pi) % (2.0 * np.pi) - np.pi
    odometry.times.append(time)
    odometry.rows.append(
        [position.x, position.y, yaw, message.twist.twist.linear.x, message.twist.twist.angular.z]
    )


def _wheelbase(path: Path, options: ImportOptions) -> float:
    if options.wheelbase_m is None:
        raise RecordingError(
            path,
            "body speeds need the wheelbase to become wheel speeds",
            next_step="Give truing import --wheelbase METRES",
        )
    return options.wheelbase_m


def _effort(
    path: Path, times: FloatArray, twist: Series, options: ImportOptions
) -> tuple[FloatArray, Finding]:
    """Commanded wheel speeds over full speed, mean over the interval that ends at each time."""
    command_times, command = twist.arrays()
    half = 0.5 * _wheelbase(path, options)
    wheels = np.array([command[0] - half * command[1], command[0] + half * command[1]])
    largest = float(np.abs(wheels).max())
    if largest == 0.0:
        raise RecordingError(path, "every command is zero: nothing was driven")
    full = options.full_speed_mps or largest
    held = np.array([_interval_mean(times, command_times, wheel) for wheel in wheels])
    text = (
        f"the input is the commanded wheel speed over {full:.4g} m/s, not a motor's effort: "
        "gains are those of a speed loop"
    )
    return np.clip(held / full, -1.0, 1.0), Finding("command_as_effort", text)


def _interval_mean(times: FloatArray, command_times: FloatArray, command: FloatArray) -> FloatArray:
    """Mean of a held command over each sampling interval, shape of `times`; zero before the first command."""
    edges = np.concatenate(([-np.inf], command_times))
    held = np.concatenate(([0.0], command))

    integral = np.concatenate(([0.0], np.cumsum(command[:-1] * np.diff(command_times))))

    def area(at: FloatArray) -> FloatArray:
        index = np.searchsorted(edges, at, side="right") - 1
        inside = index > 0
        begin = np.where(inside, command_times[np.maximum(index - 1, 0)], at)
        before = np.where(inside, integral[np.maximum(index - 1, 0)], 0.0)
        total: FloatArray = before + held[index] * (at - begin)
        return total

    begins = np.concatenate(([times[0] - float(np.median(np.diff(times)))], times[:-1]))
    spans = times - begins
    now = held[np.searchsorted(edges, times, side="right") - 1]
    return np.where(spans > 0.0, (area(times) - area(begins)) / np.where(spans > 0.0, spans, 1.0), now)
