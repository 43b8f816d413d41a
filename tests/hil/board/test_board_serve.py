"""A served virtual robot can be reached by TCP and by a terminal, one client at a time, again and again."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from hil_sim.serve import ServeOptions, Server
from support.processes import child


@contextlib.contextmanager
def served(robot, options: ServeOptions) -> Iterator[tuple[Server, list[str]]]:
    said: list[str] = []
    server = Server(robot, options, said.append)
    stop = threading.Event()
    thread = threading.Thread(target=server.run, args=(stop.is_set,))
    thread.start()
    try:
        yield server, said
    finally:
        stop.set()
        thread.join(timeout=10)
        assert not thread.is_alive()


@pytest.fixture
def echo(board):
    """An image that answers what it hears, with bit 5 turned over."""
    b = board("echo")
    b.run_us(10_000)
    return b


def ask(stream: socket.socket, data: bytes) -> bytes:
    stream.settimeout(5)
    stream.sendall(data)
    got = b""
    while len(got) < len(data):
        got += stream.recv(100)
    return got


def turned(data: bytes) -> bytes:
    return bytes(b ^ 0x20 for b in data)


def test_a_client_may_leave_and_come_back(echo):
    with served(echo, ServeOptions()) as (server, said):
        for text in (b"one", b"two", b"three"):
            with socket.create_connection(server.tcp.address, timeout=5) as client:
                assert ask(client, text) == turned(text)
        time.sleep(0.05)
    assert sum("connected" in line and "disconnected" not in line for line in said) == 3


def test_a_second_client_is_refused_by_name_and_the_first_one_stays(echo):
    with (
        served(echo, ServeOptions()) as (server, said),
        socket.create_connection(server.tcp.address, timeout=5) as first,
    ):
        assert ask(first, b"hello") == turned(b"hello")
        with socket.create_connection(server.tcp.address, timeout=5) as second:
            refusal = second.makefile("rb").read().decode()
        assert refusal.startswith("refused: this virtual board is in use by 127.0.0.1:")
        assert ask(first, b"still here") == turned(b"still here")
        assert any("refused" in line for line in said)


def test_a_terminal_serves_one_program_after_the_other(echo, tmp_path):
    link = tmp_path / "board"
    with served(echo, ServeOptions(tcp=None, pty_link=link)):
        for text in (b"first", b"second"):
            terminal = os.open(link, os.O_RDWR | os.O_NOCTTY)
            try:
                os.write(terminal, text)
                got = b""
                while len(got) < len(text):
                    got += os.read(terminal, 100)
                assert got == turned(text)
            finally:
                os.close(terminal)
    assert not link.is_symlink(), "the link goes with the server"


def test_time_passes_at_the_pace_asked_for(echo):
    for factor in (1.0, 4.0):
        before_us, begin = echo.time_us, time.monotonic()
        with served(echo, ServeOptions(tcp=None, factor=factor)):
            time.sleep(0.4)
        passed = time.monotonic() - begin
        assert (echo.time_us - before_us) * 1e-6 == pytest.approx(passed * factor, rel=0.25)


def test_without_a_pace_time_runs_as_fast_as_it_can(echo):
    before_us, begin = echo.time_us, time.monotonic()
    with served(echo, ServeOptions(tcp=None, factor=None)):
        time.sleep(0.3)
    assert (echo.time_us - before_us) * 1e-6 > 3 * (time.monotonic() - begin)


PROGRAM = """
import sys
from pathlib import Path
from hil_sim import VirtualRobot
from hil_sim.serve import ServeOptions, serve
robot = VirtualRobot(Path(sys.argv[1]))
serve(robot, ServeOptions(), lambda line: print(line, flush=True))
print("stopped at", robot.time_us)
"""


def test_ctrl_c_ends_it_without_a_traceback(echo):
    path = Path(echo.image.path)
    command = [sys.executable, "-c", PROGRAM, str(path)]
    with child(command) as process:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("listening at tcp:127.0.0.1:")
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=10)
    assert (process.returncode, errors) == (0, "")
    assert "stopped at" in out
