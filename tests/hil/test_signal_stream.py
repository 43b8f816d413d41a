"""Signals of the board arrive as they happen, without loss, beside a download that fills the line."""

from __future__ import annotations

import subprocess
import sys
from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest

from support.chain import Chain
from support.foxglove_client import FoxgloveClient
from truing.board.drive import drive
from truing.board.signal_stream import SIGNALS, as_columns
from truing.errors import BoardRebooted, Refused, TruingError
from truing.plan import Kind, Plan, Segment
from truing.web.world.map_file import write_world
from truing.web.world.world_map import WorldMap
from truing_protocol import StreamStartRequest

LONG = Plan(
    "long",
    "long",
    tuple(Segment(Kind.VELOCITY, 3.0, speed, speed / 2) for speed in (0.2, 0.4, 0.3, 0.5) * 5),
    200,
)


def test_every_signal_at_200_hz_arrives_without_loss_beside_a_running_download(
    image: Path, native_library: Path
) -> None:
    with Chain(image) as chain:
        device = chain.host()
        log = device.log(drive(device, LONG).log_id)
        with device.stream(list(SIGNALS), 200) as stream:
            began = chain.robot.time_s
            for _ in range(5):
                data, report = device.read_log(log)
                assert data == chain.in_ram(log.offset, log.length)
                assert report.again_bytes == 0
            took = chain.robot.time_s - began
            samples = stream.read()
        print(
            f"{5 * len(data)} bytes of log in {took:.2f} s, {5 * len(data) / took / 1000:.1f} kB/s; "
            f"meanwhile {len(samples)} samples of {len(SIGNALS)} signals, {stream.lost} lost"
        )
        assert stream.lost == 0
        assert [sample.number for sample in samples] == list(range(len(samples)))
        assert len(samples) == pytest.approx(200 * took, abs=30)
        assert set(np.diff(np.round(as_columns(samples)["t_s"] * 1000))) == {5}


def test_a_bad_line_costs_time_and_no_sample(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host_on_bad_line(0.002, 5)
        with device.stream(["speed_left", "effort_left"], 200) as stream:
            samples = []
            while len(samples) < 1000:
                samples += stream.read()
        assert stream.lost == 0
        assert [sample.number for sample in samples] == list(range(len(samples)))


def test_values_are_those_of_the_robot_in_si_units(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        chain.stream.sleep(0.3)
        with device.stream(["mode", "cmd_left", "effort_left", "speed_left", "battery"], 100) as stream:
            for _ in range(10):
                device.set_effort(0.4, 0.2)
                chain.stream.sleep(0.1)
            last = stream.read()[-1].values
            status = device.status()
        assert last["mode"] == 1
        assert last["cmd_left"] == last["effort_left"] == pytest.approx(0.4)
        assert last["speed_left"] == pytest.approx(status.speed_mps[0], abs=0.05)
        assert last["battery"] == pytest.approx(status.battery_v, abs=0.1)


def test_a_host_that_does_not_listen_loses_the_oldest_samples_and_knows_how_many(
    image: Path, native_library: Path
) -> None:
    with Chain(image) as chain:
        device = chain.host()
        with device.stream(list(SIGNALS), 200) as stream:
            stream.read()
            chain.stream.sleep(3.0)
            samples = [*stream.read(), *stream.read(0.2)]
        assert stream.lost > 400
        assert stream.taken + stream.lost == samples[-1].number + 1


def test_a_reset_ends_the_stream_by_name(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        stream = device.stream(["battery"], 50)
        stream.read()
        chain.robot.reset()
        chain.stream.sleep(0.1)
        with pytest.raises(BoardRebooted, match="stream has ended"):
            stream.read()


def test_what_cannot_be_streamed_is_refused(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        with pytest.raises(TruingError, match="no such signal"):
            device.stream(["colour"])
        with pytest.raises(TruingError, match="1 to 200 Hz"):
            device.stream(["battery"], 201)
        for mask, rate in ((1 << 30, 100), (1, 201), (1, 0)):
            with pytest.raises(Refused, match="out_of_range"):
                device.client.request(StreamStartRequest(mask, rate))


def test_the_command_writes_a_csv(image: Path, native_library: Path, tmp_path: Path) -> None:
    path = tmp_path / "live.csv"
    command = [sys.executable, "-m", "truing", "stream", "--signals", "battery,x", "--duration", "1", "--csv"]
    subprocess.run([*command, str(path)], check=True, timeout=60)
    lines = path.read_text().splitlines()
    assert lines[0] == "t_s,battery,x"
    assert len(lines) == 201


def test_foxglove_shows_a_plan_while_it_is_driven(image: Path, native_library: Path, tmp_path: Path) -> None:
    plan = tmp_path / "ahead.toml"
    plan.write_text(Plan("ahead", "ahead", (Segment(Kind.EFFORT, 4.0, 0.4, 0.4),), 20).to_toml())
    room = WorldMap.empty(4.0, 3.0)
    room.paint_room((-1.5, -1.0), (1.5, 1.0), 0.05)
    write_world(tmp_path / "room.yaml", room)
    served = ["--foxglove", "127.0.0.1:0", "--map", str(tmp_path / "room.yaml")]
    command = [sys.executable, "-m", "truing", "run", str(plan), *served, "--set"]
    topics = ("/signals", "/pose", "/faults", "/map")
    with subprocess.Popen([*command, str(tmp_path / "set")], stderr=subprocess.PIPE, text=True) as running:
        assert running.stderr is not None
        line = next(line for line in running.stderr if line.startswith("Foxglove: "))
        with FoxgloveClient(
            next(word for word in line.split() if word.startswith("ws://")), topics
        ) as client:
            messages = list(client.messages(timeout_s=60.0))
        told = running.stderr.read()
    assert running.returncode == 0, told
    by_topic = {topic: [item for item in messages if item.topic == topic] for topic in topics}
    times = [item.time_ns for item in by_topic["/signals"]]
    assert len(times) > 100, "a second of the plan at least, however late the client came"
    assert set(np.diff(times)) == {10_000_000}
    row = by_topic["/signals"][-1].content
    assert row["ticks_left"] > 1000
    assert by_topic["/pose"][-1].content["pose"]["position"]["x"] == pytest.approx(row["x_m"], abs=1e-9)
    assert by_topic["/faults"][0].content["message"] == "no faults"
    grid = by_topic["/map"][0].content
    assert grid["column_count"] == room.occupied.shape[1]
    assert b64decode(grid["data"]).count(255) == room.occupied.sum() > 0
    assert (tmp_path / "set" / "runs" / "01_ahead.csv").is_file()
