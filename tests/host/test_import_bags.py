"""ROS bags of every generation, and MCAP files with JSON messages, become runs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from truing.errors import RecordingError
from truing.importers import ImportOptions, import_file, is_foreign

RADIUS, WHEELBASE = 0.05, 0.3
START_NS = 1_700_000_000_000_000_000
OPTIONS = ImportOptions(metres_per_unit=RADIUS, wheelbase_m=WHEELBASE)
KINDS = ("ros1", "sqlite3", "mcap")

Write = Callable[[str, str, int, Any], None]


@contextmanager
def bag(folder: Path, kind: str) -> Iterator[tuple[Path, Any, Write]]:
    """An open bag: its path, its message types, and how to write a message."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    path = folder / ("drive.bag" if kind == "ros1" else "drive")
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    writer = Writer1(path) if kind == "ros1" else Writer2(path, version=9, storage_plugin=plugin)
    connections: dict[str, Any] = {}
    with writer:

        def write(topic: str, kind_name: str, time_ns: int, message: Any) -> None:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind_name, typestore=store)
            packed = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
            writer.write(connections[topic], time_ns, packed(message, kind_name))

        yield path, store.types, write


def header(types: Any, kind: str, time_ns: int) -> Any:
    stamp = types["builtin_interfaces/msg/Time"](sec=time_ns // 10**9, nanosec=time_ns % 10**9)
    more = {"seq": 0} if kind == "ros1" else {}
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **more)


def joints(types: Any, kind: str, time_ns: int, names: list[str], angles: Any, rates: Any) -> Any:
    return types["sensor_msgs/msg/JointState"](
        header(types, kind, time_ns), names, np.array(angles), np.array(rates), np.zeros(0)
    )


def twist(types: Any, v: float, w: float) -> Any:
    vector = types["geometry_msgs/msg/Vector3"]
    return types["geometry_msgs/msg/Twist"](linear=vector(v, 0.0, 0.0), angular=vector(0.0, 0.0, w))


def odometry(types: Any, kind: str, time_ns: int, yaw: float) -> Any:
    pose = types["geometry_msgs/msg/Pose"](
        types["geometry_msgs/msg/Point"](0.1 * yaw, 0.0, 0.0),
        types["geometry_msgs/msg/Quaternion"](0.0, 0.0, np.sin(0.5 * yaw), np.cos(0.5 * yaw)),
    )
    return types["nav_msgs/msg/Odometry"](
        header(types, kind, time_ns),
        "base",
        types["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36)),
        types["geometry_msgs/msg/TwistWithCovariance"](twist(types, 0.2, 1.0), np.zeros(36)),
    )


def write_drive(folder: Path, kind: str, with_joints: bool = True) -> Path:
    """Four seconds at 50 Hz; the command steps to 0.4 m/s and 1 rad/s in the middle of row 50's interval."""
    with bag(folder, kind) as (path, types, write):
        for row in range(200):
            now = START_NS + 20_000_000 * row
            if row == 0:
                write("/cmd_vel", "geometry_msgs/msg/Twist", now, twist(types, 0.0, 0.0))
            if row == 50:
                write("/cmd_vel", "geometry_msgs/msg/Twist", now - 10_000_000, twist(types, 0.4, 1.0))
            if with_joints:
                angle, rate = [0.1 * row, 0.2 * row], [5.0, 10.0]
                message = joints(types, kind, now, ["wheel_left", "wheel_right"], angle, rate)
                # Received late: the header's time counts.
                write("/joint_states", "sensor_msgs/msg/JointState", now + 3_000_000, message)
            write("/odom", "nav_msgs/msg/Odometry", now, odometry(types, kind, now, 0.05 * row))
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_joints_commands_and_pose_of_a_bag_become_a_run(tmp_path: Path, kind: str) -> None:
    path = write_drive(tmp_path, kind)
    assert is_foreign(path)
    imported = import_file(path, OPTIONS)
    (run,) = imported.runs
    assert len(run) == 200
    np.testing.assert_allclose(run.t_s, 0.02 * np.arange(200), atol=1e-9)
    np.testing.assert_allclose(run.columns["pos_right_m"], RADIUS * 0.2 * np.arange(200), atol=1e-9)
    np.testing.assert_allclose(run.columns["vel_left_mps"], RADIUS * 5.0)
    np.testing.assert_allclose(run.columns["theta_rad"], 0.05 * np.arange(200), atol=1e-9)
    # Full effort is the fastest commanded wheel, the right one: 0.4 + 1.0 * 0.3 / 2 m/s.
    left, right = run.columns["effort_left"], run.columns["effort_right"]
    assert left[49] == right[49] == 0.0
    assert left[50] == pytest.approx(0.5 * 0.25 / 0.55, rel=1e-6), "the mean over the interval"
    assert (left[100], right[100]) == (pytest.approx(0.25 / 0.55), pytest.approx(1.0))
    (said,) = [finding.text for finding in imported.findings if finding.code == "command_as_effort"]
    assert "commanded wheel speed over 0.55 m/s, not a motor's effort" in said


def test_a_single_storage_file_of_a_bag_is_read_without_its_folder(tmp_path: Path) -> None:
    for kind, suffix in (("sqlite3", "db3"), ("mcap", "mcap")):
        (tmp_path / kind).mkdir()
        (file,) = write_drive(tmp_path / kind, kind).glob(f"*.{suffix}")
        assert len(import_file(file, OPTIONS).runs[0]) == 200


def test_without_joints_the_odometry_gives_the_wheels_and_that_is_said(tmp_path: Path) -> None:
    imported = import_file(write_drive(tmp_path, "sqlite3", with_joints=False), OPTIONS)
    (run,) = imported.runs
    np.testing.assert_allclose(run.columns["vel_left_mps"], 0.2 - 0.5 * WHEELBASE, atol=1e-12)
    np.testing.assert_allclose(run.columns["vel_right_mps"], 0.2 + 0.5 * WHEELBASE, atol=1e-12)
    assert "no_joints" in [finding.code for finding in imported.findings]


def test_body_commands_without_a_wheelbase_ask_for_it(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="wheelbase") as caught:
        import_file(write_drive(tmp_path, "sqlite3"), ImportOptions(metres_per_unit=RADIUS))
    assert "--wheelbase" in caught.value.next_step


def test_a_bag_without_commands_says_what_it_has(tmp_path: Path) -> None:
    with bag(tmp_path, "sqlite3") as (path, types, write):
        for row in range(30):
            message = odometry(types, "sqlite3", START_NS + row, 0.0)
            write("/odom", "nav_msgs/msg/Odometry", START_NS + 10**7 * row, message)
    with pytest.raises(RecordingError, match=r"no geometry_msgs/Twist .* nav_msgs/msg/Odometry"):
        import_file(path, OPTIONS)


def test_joints_without_sides_and_ambiguous_topics_are_named(tmp_path: Path) -> None:
    for folder, names, topics, says in (
        ("a", ["arm", "hand"], ["/cmd_vel"], "no joint whose name holds 'left'; it has: arm, hand"),
        (
            "b",
            ["left", "right"],
            ["/cmd_vel", "/joy_vel"],
            "2 topics of geometry_msgs/msg/Twist: /cmd_vel, /joy_vel",
        ),
    ):
        (tmp_path / folder).mkdir()
        with bag(tmp_path / folder, "sqlite3") as (path, types, write):
            for row in range(30):
                now = START_NS + 10**7 * row
                for topic in topics:
                    write(topic, "geometry_msgs/msg/Twist", now, twist(types, 0.1, 0.0))
                message = joints(types, "sqlite3", now, names, [0.0, 0.0], [0.0, 0.0])
                write("/joint_states", "sensor_msgs/msg/JointState", now, message)
        with pytest.raises(RecordingError) as caught:
            import_file(path, OPTIONS)
        assert says in str(caught.value)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.0, 0.3, 0.7])
def test_a_truncated_bag_is_refused_by_name(tmp_path: Path, kind: str, share: float) -> None:
    path = write_drive(tmp_path, kind)
    file = path if kind == "ros1" else next(item for item in path.iterdir() if item.suffix != ".yaml")
    file.write_bytes(file.read_bytes()[: int(share * file.stat().st_size)])
    with pytest.raises(RecordingError, match="drive"):
        import_file(path, OPTIONS)


MCAP_MAPPING = """
[columns]
t_s = "/wheels.log_time"
effort_left = "/drive.effort.0"
effort_right = "/drive.effort.1"
vel_left_mps = { column = "/wheels.left.speed", scale = 1e-3 }
vel_right_mps = { column = "/wheels.right.speed", scale = 1e-3 }
"""


def write_json_mcap(path: Path, mapping: str = MCAP_MAPPING) -> Path:
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("wheels", "jsonschema", b"{}")
        ids = {
            name: writer.register_channel(name, "json", schema) for name in ("/wheels", "/drive", "/stage")
        }

        def write(topic: str, time_ns: int, message: Any) -> None:
            writer.add_message(ids[topic], time_ns, json.dumps(message).encode(), time_ns)

        write("/stage", START_NS, {"name": "first"})
        for row in range(100):
            now = START_NS + 10_000_000 * row
            if row % 10 == 0:
                write("/drive", now - 1_000_000, {"effort": [0.01 * row, -0.01 * row]})
            if row == 60:
                write("/stage", now, {"name": "second"})
            write("/wheels", now, {"left": {"speed": 3 * row}, "right": {"speed": -3 * row}, "ok": True})
        writer.finish()
    path.with_suffix(".mapping.toml").write_text(mapping)
    return path


def test_json_messages_of_several_topics_come_together_on_the_rows_of_one(tmp_path: Path) -> None:
    (run,) = import_file(write_json_mcap(tmp_path / "log.mcap")).runs
    np.testing.assert_allclose(run.t_s, 0.01 * np.arange(100), atol=1e-9)
    np.testing.assert_allclose(run.columns["vel_left_mps"], 3e-3 * np.arange(100))
    np.testing.assert_allclose(run.columns["effort_left"], 0.1 * (np.arange(100) // 10))


def test_json_messages_split_into_runs_by_a_text(tmp_path: Path) -> None:
    mapping = MCAP_MAPPING + '[split]\ncolumn = "/stage.name"\n'
    imported = import_file(write_json_mcap(tmp_path / "log.mcap", mapping))
    assert [(run.name, len(run)) for run in imported.runs] == [("01_first", 60), ("02_second", 40)]


def test_an_unknown_field_is_answered_with_the_fields_that_are_there(tmp_path: Path) -> None:
    mapping = MCAP_MAPPING.replace("/wheels.left.speed", "/wheels.left.rate")
    with pytest.raises(RecordingError, match=r"/wheels\.left\.rate") as caught:
        import_file(write_json_mcap(tmp_path / "log.mcap", mapping))
    assert "/wheels.left.speed" in str(caught.value)


def test_a_truncated_json_mcap_is_read_up_to_there_and_that_is_said_or_it_is_refused(tmp_path: Path) -> None:
    whole = write_json_mcap(tmp_path / "log.mcap").read_bytes()
    path = tmp_path / "log.mcap"
    refused, lengths = [], []
    for size in range(0, len(whole), max(len(whole) // 40, 1)):
        path.write_bytes(whole[:size])
        try:
            imported = import_file(path)
        except RecordingError as error:
            refused.append(str(error))
        else:
            assert "cut_off" in [finding.code for finding in imported.findings]
            lengths.append(len(imported.runs[0]))
    assert all("log.mcap" in text for text in refused)
    assert refused, "nothing but the first bytes is no recording"
    assert lengths == sorted(lengths)
