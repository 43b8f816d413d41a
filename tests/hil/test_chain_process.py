"""Real processes on real ports: Ctrl-C, a pulled cable, two hosts, a download that goes on."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from support.processes import child, wait_until_it_says
from support.served_board import ServedBoard
from truing.board.device import Device
from truing.errors import LinkClosed, LinkError, PortError
from truing.plan import load_plan
from truing_protocol import SequenceState, State


@pytest.fixture
def board(image: Path, native_library: Path, tmp_path: Path) -> Iterator[ServedBoard]:
    with ServedBoard(tmp_path) as served:
        yield served


def running(
    port: str, folder: Path, plan: str = "paper/XI", ignoring: Sequence[signal.Signals] = ()
) -> AbstractContextManager[subprocess.Popen[str]]:
    """`truing run`, which notes every request as it sends it."""
    command = [sys.executable, "-m", "truing", "-vv", "--port", port, "run", plan, "--set", str(folder)]
    return child(command, ignoring=ignoring)


IGNORED_IN_BACKGROUND = (signal.SIGINT, signal.SIGHUP)  # as by `nohup truing run ... &`


@pytest.mark.parametrize(
    ("kind", "number", "ignoring"),
    [
        ("tcp", signal.SIGINT, ()),
        ("pty", signal.SIGINT, ()),
        ("tcp", signal.SIGTERM, ()),
        ("tcp", signal.SIGHUP, ()),
        ("tcp", signal.SIGTERM, IGNORED_IN_BACKGROUND),
    ],
)
def test_a_signal_in_the_middle_of_a_run_stops_the_wheels(
    board: ServedBoard,
    tmp_path: Path,
    kind: str,
    number: signal.Signals,
    ignoring: tuple[signal.Signals, ...],
) -> None:
    port = board.tcp if kind == "tcp" else board.pty
    with running(port, tmp_path / "set", ignoring=ignoring) as run:
        wait_until_it_says(run, "seq_start")
        time.sleep(2.0)  # a rest of one second, then one at 35 %
        run.send_signal(number)
        out, err = run.communicate(timeout=5)
    assert run.returncode == 130, err
    assert "wheels stopped: the board has acknowledged the stop" in err
    with Device.open(port) as device:
        status = device.status()
        assert status.state is State.IDLE
        assert status.sequence_state is SequenceState.ABORTED
        assert status.effort == (0.0, 0.0)
        log = device.log()
        assert log.end.name == "STOPPED"
        assert 1.2 < log.end_s - log.start_s < 4.0
    assert "written" not in out


def test_a_signal_stops_the_wheels_within_a_tenth_of_a_second(board: ServedBoard, tmp_path: Path) -> None:
    with running(board.tcp, tmp_path / "set") as run:
        wait_until_it_says(run, "seq_start")
        time.sleep(1.5)
        began = time.monotonic()
        run.send_signal(signal.SIGINT)
        wait_until_it_says(run, "wheels stopped")
        took = time.monotonic() - began
        run.communicate(timeout=5)
    print(f"from signal to acknowledged stop: {took * 1000:.0f} ms")
    assert took < 0.25, "0.1 s, and as much again for a busy machine"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_virtual_board_that_is_ended_takes_its_link_away(
    image: Path, native_library: Path, tmp_path: Path, number: signal.Signals
) -> None:
    link = tmp_path / "robot"
    with child([sys.executable, "-m", "truing", "board", "--tcp", "off", "--link", str(link)]) as served:
        assert served.stdout is not None
        assert str(link) in served.stdout.readline()
        assert link.is_symlink()
        served.send_signal(number)
        _, err = served.communicate(timeout=5)
    assert "virtual board stopped" in err
    assert not link.is_symlink()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_view_that_is_ended_closes_its_session(board: ServedBoard, number: signal.Signals) -> None:
    """The session's end is what stops the wheels; a process that the signal ended would return its number."""
    command = [sys.executable, "-m", "truing", "--port", board.tcp, "view", "--no-browser", "--port", "0"]
    with child(command) as view:
        assert view.stdout is not None
        assert "the view is at http://" in view.stdout.readline()
        view.send_signal(number)
        _, err = view.communicate(timeout=20)
    assert view.returncode == 130, err
    assert "Traceback" not in err


def test_two_hosts_on_one_tcp_port_get_a_clear_answer(board: ServedBoard) -> None:
    with Device.open(board.tcp) as first:
        second = subprocess.run(board.truing("info"), capture_output=True, text=True, timeout=20)
        assert second.returncode == 1
        assert "another host is connected to this board" in second.stderr
        assert "Traceback" not in second.stderr
        assert first.status().state is State.IDLE


def test_two_hosts_on_one_serial_port_get_a_clear_answer(board: ServedBoard) -> None:
    with Device.open(board.pty) as first:
        with pytest.raises(PortError, match="another program is using this port"):
            Device.open(board.pty)
        assert first.status().state is State.IDLE
    with Device.open(board.pty) as third:
        assert third.status().state is State.IDLE


@pytest.mark.parametrize("kind", ["tcp", "pty"])
def test_unplugging_while_running_is_said_with_what_the_robot_does_now(
    board: ServedBoard, tmp_path: Path, kind: str
) -> None:
    with running(board.tcp if kind == "tcp" else board.pty, tmp_path / "set") as run:
        wait_until_it_says(run, "seq_start")
        time.sleep(1.3)
        board.kill()
        began = time.monotonic()
        _, err = run.communicate(timeout=20)
    assert time.monotonic() - began < 10
    assert run.returncode == 1
    assert "COULD NOT STOP THE ROBOT" in err
    assert "the link to the board is gone" in err
    assert "Traceback" not in err


def test_a_host_that_dies_stops_a_sequence_within_its_heartbeat(board: ServedBoard, tmp_path: Path) -> None:
    with running(board.tcp, tmp_path / "set", "paper/I") as run:
        wait_until_it_says(run, "seq_start")
        time.sleep(1.5)
        run.kill()
    time.sleep(1.0)
    with Device.open(board.tcp) as device:
        status = device.status()
        assert status.state is State.STOPPED
        assert [fault.name for fault in status.latched] == ["host_silent"]
        assert status.effort == (0.0, 0.0)
        log = device.log()
        assert log.end.name == "FAULT"
        assert log.end_s - log.start_s < 1.5 + 0.5 + 0.5  # the last half for a busy machine


def test_a_host_that_dies_leaves_an_unattended_sequence_to_end_and_its_log_to_be_fetched(
    board: ServedBoard, tmp_path: Path
) -> None:
    plan = tmp_path / "alone.toml"
    plan.write_text("unattended = true\n" + load_plan("paper/I").to_toml())
    with running(board.tcp, tmp_path / "set", str(plan)) as run:
        wait_until_it_says(run, "runs unattended")
        wait_until_it_says(run, "seq_start")
        time.sleep(1.5)
        run.kill()
    time.sleep(4.5)
    fetched = subprocess.run(
        board.truing("log", "fetch", "--set", str(tmp_path / "set"), "--json"),
        capture_output=True,
        text=True,
        timeout=20,
        check=True,
    )
    answer = json.loads(fetched.stdout)
    assert answer["log"]["end"] == "finished"
    assert answer["records"] == 101


def test_a_download_that_is_cut_goes_on_with_the_next_command(board: ServedBoard, tmp_path: Path) -> None:
    """The link is closed in the middle of a download, from the host's side of the socket."""
    plan = tmp_path / "long.toml"
    plan.write_text(
        "log_rate_hz = 200\n[[segment]]\nduration_s = 8.0\nvelocity_mps = 0.3\n"
        "[[segment]]\nduration_s = 1\neffort = 0.0\n"
    )
    subprocess.run(board.truing("run", str(plan), "--set", str(tmp_path / "set")), check=True, timeout=30)
    with Device.open(board.tcp) as device:
        log = device.log()
        partial = tmp_path / "cut.part"
        read = device.client.stream.read
        taken = 0

        def cut_half_way(timeout_s: float) -> bytes:
            nonlocal taken
            data = read(timeout_s)
            taken += len(data)
            if taken > log.length // 2:
                raise LinkClosed("the cable was pulled")
            return data

        device.client.stream.read = cut_half_way  # type: ignore[method-assign]
        with pytest.raises(LinkClosed):
            device.read_log(log, partial=partial)
    with Device.open(board.tcp) as device:
        data, report = device.read_log(device.log(), partial=partial)
    assert len(data) == log.length
    assert 0 < report.resumed_bytes < log.length
    assert report.asked_bytes == log.length - report.resumed_bytes


def test_live_commands_stop_when_their_host_dies(board: ServedBoard) -> None:
    program = (
        "import sys, time\nfrom truing.board.device import Device\n"
        "d = Device.open(sys.argv[1])\n"
        "while True:\n    d.set_effort(0.3, 0.3); print('.', flush=True); time.sleep(0.05)\n"
    )
    host = subprocess.Popen([sys.executable, "-c", program, board.tcp], stdout=subprocess.PIPE, text=True)
    assert host.stdout is not None
    for _ in range(10):
        host.stdout.readline()
    host.kill()
    host.communicate()
    time.sleep(1.0)
    with Device.open(board.tcp) as device:
        status = device.status()
        assert status.state is State.STOPPED
        assert [fault.name for fault in status.latched] == ["host_silent"]
        assert status.effort == (0.0, 0.0)
    refused = subprocess.run(board.truing("run", "paper/I"), capture_output=True, text=True, timeout=20)
    assert refused.returncode == 1
    assert "host_silent" in refused.stderr
    assert "faults --clear" in refused.stderr
    subprocess.run(board.truing("faults", "--clear"), check=True, timeout=20)
    with Device.open(board.tcp) as device:
        assert device.status().state is State.IDLE


def test_a_port_where_nobody_speaks_the_protocol_is_told_from_a_board(tmp_path: Path) -> None:
    master, slave = os.openpty()
    try:
        with pytest.raises(LinkError, match="no board answers"):
            Device.open(os.ttyname(slave))
    finally:
        os.close(master)
        os.close(slave)
