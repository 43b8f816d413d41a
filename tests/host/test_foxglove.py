"""Foxglove's own messages: recordings as MCAP, live signals over its WebSocket protocol."""

from __future__ import annotations

import importlib.util
import math
import socket
from base64 import b64decode
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from support.foxglove_client import FoxgloveClient, decode
from truing.board.signal_stream import SIGNALS
from truing.cli import group
from truing.errors import LibraryMissingError, OutputError, TruingError
from truing.foxglove.channels import Floor
from truing.foxglove.live_server import COLUMNS, LiveServer
from truing.importers import read_runs
from truing.recording.reader import read_recording_set
from truing.recording.run import NUMERIC_COLUMNS, ODOMETRY_COLUMNS, TRUTH_COLUMNS
from truing_protocol import FAULTS, Mode

EXAMPLE = Path(__file__).parents[2] / "docs" / "example"
TOPICS = {
    "/signals": "truing.Signals",
    "/pose": "foxglove.PoseInFrame",
    "/pose_outside": "foxglove.PoseInFrame",
    "/tf": "foxglove.FrameTransforms",
    "/robot": "foxglove.SceneUpdate",
}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example's runs as MCAP files, by the command."""
    folder = tmp_path_factory.mktemp("mcap")
    done = CliRunner().invoke(group, ["export", str(EXAMPLE), "--to", "mcap", "--out", str(folder)])
    assert done.exit_code == 0, done.output
    return folder


def read_mcap(path: Path) -> dict[str, list[tuple[int, dict[str, Any]]]]:
    """Log time and content of every message by topic, by the schemas in the file."""
    from mcap.reader import make_reader

    found: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            assert schema.name == TOPICS[channel.topic]
            content = decode(channel.message_encoding, schema.name, schema.data, message.data)
            found.setdefault(channel.topic, []).append((message.log_time, content))
    return found


def yaw(orientation: dict[str, float]) -> float:
    return 2.0 * math.atan2(orientation.get("z", 0.0), orientation["w"])


def test_an_mcap_file_holds_every_row_of_its_run(written: Path) -> None:
    run = read_recording_set(EXAMPLE).runs[0]
    found = read_mcap(written / f"{run.name}.mcap")
    assert set(found) == set(TOPICS)
    assert [time_ns for time_ns, _ in found["/signals"]] == [round(1e9 * t) for t in run.t_s]
    for name, column in run.columns.items():
        assert [row[name] for _, row in found["/signals"]] == column.tolist()
    assert tuple(row["mode"] for _, row in found["/signals"]) == run.mode
    for topic, frame, names in (("/pose", "odom", ODOMETRY_COLUMNS), ("/pose_outside", "map", TRUTH_COLUMNS)):
        poses = [message for _, message in found[topic]]
        assert {message["frame_id"] for message in poses} == {frame}
        for axis, name in zip("xy", names, strict=False):
            placed = [message["pose"]["position"].get(axis, 0.0) for message in poses]
            assert placed == pytest.approx(run.columns[name])
        turned = np.array([yaw(message["pose"]["orientation"]) for message in poses])
        assert np.cos(turned - run.columns[names[2]]) == pytest.approx(1.0)
    last = found["/tf"][-1][1]["transforms"][1]
    assert (last["parent_frame_id"], last["child_frame_id"]) == ("odom", "base_link")
    assert last["translation"]["x"] == pytest.approx(run.columns["x_m"][-1])


def test_an_mcap_file_of_ours_is_read_back_without_a_mapping(written: Path) -> None:
    run = read_recording_set(EXAMPLE).runs[0]
    back = read_runs(written / f"{run.name}.mcap").runs[0]
    wanted = NUMERIC_COLUMNS & set(run.columns) - {"cmd_left", "cmd_right"}
    assert wanted <= set(back.columns)
    for name in wanted:
        assert back.columns[name].tolist() == run.columns[name].tolist(), name


def test_counts_become_speeds_where_the_robot_is_known_and_unknown_numbers_are_left_out(
    tmp_path: Path,
) -> None:
    rows = ["t_s,effort_left,effort_right,ticks_left,ticks_right,truth_x_m,truth_y_m,truth_theta_rad"]
    rows += [f"{0.05 * k},0.5,0.5,{10 * k},{20 * k},{',,' if k % 2 else '1,2,0'}" for k in range(20)]
    (tmp_path / "run.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "baseline.toml").write_text((EXAMPLE / "baseline.toml").read_text())
    arguments = ["export", str(tmp_path / "run.csv"), "--to", "mcap", "--out", str(tmp_path / "one.mcap")]
    done = CliRunner().invoke(group, arguments)
    assert done.exit_code == 0, done.output
    found = read_mcap(tmp_path / "one.mcap")
    assert set(found) == {"/signals", "/pose_outside"}
    per_count = read_recording_set(EXAMPLE).robot.metres_per_count  # type: ignore[union-attr]
    assert found["/signals"][5][1]["vel_right_mps"] == pytest.approx(20 * per_count / 0.05)
    assert "truth_x_m" not in found["/signals"][1][1]
    assert len(found["/pose_outside"]) == 10


def test_several_runs_are_not_written_into_one_file(tmp_path: Path) -> None:
    from truing import export, read

    with pytest.raises(OutputError, match="has 3 runs"):
        export(read(EXAMPLE), tmp_path / "all.mcap")
    with pytest.raises(TruingError, match="cannot be written as mjcf"):
        export(read(EXAMPLE), tmp_path / "all.xml", "mjcf")


def sample(number: int, faults: int = 0) -> dict[str, float]:
    values = dict.fromkeys(SIGNALS, 0.0)
    values |= {"mode": float(Mode.EFFORT), "faults": float(faults), "effort_left": 0.25, "counts_left": 7.0}
    return values | {"x": 0.1 * number, "theta": 0.5}


def test_a_client_finds_signals_pose_map_and_faults() -> None:
    occupied = np.zeros((3, 4), dtype=np.bool_)
    occupied[0, 1] = True
    floor = Floor(occupied, 0.05, (-1.0, -2.0))
    fault = FAULTS[0]
    with LiveServer(tuple(SIGNALS), port=0, floor=floor, width_m=0.2) as server:
        server.publish(100.0, sample(0))
        topics = ("/signals", "/pose", "/tf", "/map", "/robot", "/faults")
        with FoxgloveClient(server.url, topics) as client:
            assert client.info["name"] == "truing"
            for topic in topics:
                client.wait_for(topic)
            # The map was sent before this client was there; its subscription has it sent again.
            got: dict[str, Any] = {}
            for number in range(1, 3000):
                server.publish(100.0 + 0.01 * number, sample(number))
                for item in client.messages(timeout_s=0.01):
                    got.setdefault(item.topic, item)
                if len(got) == len(topics):
                    break
            assert set(got) == set(topics)
            server.publish(200.0, sample(1, fault.mask))
            raised = client.first("/faults")
            server.publish(200.5, sample(1))
            gone = client.first("/faults")
    row = got["/signals"].content
    assert (row["mode"], row["ticks_left"], row["effort_left"]) == ("effort", 7.0, 0.25)
    assert set(row) == {"t_s", *(COLUMNS[name] for name in SIGNALS)}
    pose = got["/pose"].content
    assert pose["frame_id"] == "odom"
    assert yaw(pose["pose"]["orientation"]) == pytest.approx(0.5)
    grid = got["/map"].content
    assert (grid["column_count"], grid["cell_size"]["x"]) == (4, 0.05)
    assert (grid["pose"]["position"]["x"], grid["pose"]["position"]["y"]) == (-1.0, -2.0)
    assert b64decode(grid["data"]) == bytes([0, 255, *[0] * 10])
    assert got["/robot"].content["entities"][0]["cubes"][0]["size"]["x"] == 0.2
    assert got["/faults"].content["message"] == "no faults"
    told = raised.content["message"]
    assert fault.name in told
    assert fault.cause in told
    assert fault.next_step in told
    assert raised.content["level"] == "ERROR"
    assert gone.content["message"] == f"{fault.name} has gone"
    assert gone.time_ns - raised.time_ns == 500_000_000


def test_columns_are_those_of_a_run() -> None:
    assert set(COLUMNS) == set(SIGNALS)
    assert set(COLUMNS.values()) <= NUMERIC_COLUMNS | {"mode", "faults"}


def test_a_port_that_is_taken_and_a_library_that_is_missing_are_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(TruingError, match="no server can be started"):
            LiveServer(("x",), port=taken.getsockname()[1])
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(LibraryMissingError, match="package foxglove") as error:
        LiveServer(("x",), port=0)
    assert error.value.next_step == "pip install 'truing[foxglove]'"
