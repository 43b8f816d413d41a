"""The same image, plan and seed give the same trace, however time is sliced and in whatever process."""

from __future__ import annotations

import random
import subprocess
import sys

from hil_sim import VirtualRobot

SPAN_US = 400_000
WRITE_AT_US = (20_000, 150_000, 333_333)
TALK = b"the same bytes at the same times"


def trace(b, cuts):
    """Run to SPAN_US with stops at `cuts`; talk to the board at the fixed times."""
    b.put("set", 8400, 0)
    for at in sorted({*cuts, *WRITE_AT_US, SPAN_US}):
        b.run_us(at - b.time_us)
        if at in WRITE_AT_US:
            b.link_write(TALK)
    return b.trace_hash(), b.trace_count()


def test_slicing_time_differently_changes_nothing(board):
    dice = random.Random(5)
    whole = trace(board("peripherals"), [])
    assert whole[1] > 1000
    for cuts in (
        range(0, SPAN_US, 1000),
        range(0, SPAN_US, 137),
        [dice.randrange(SPAN_US) for _ in range(3000)],
    ):
        assert trace(board("peripherals"), cuts) == whole


def test_another_seed_or_a_byte_more_gives_another_trace(board):
    base = trace(board("peripherals"), [])
    assert trace(board("peripherals", seed=2), []) != base
    talked_to = board("peripherals")
    talked_to.run_us(10_000)
    talked_to.link_write(b"!")
    assert trace(talked_to, []) != base


PROGRAM = """
import sys
from pathlib import Path
from hil_sim import VirtualRobot
robot = VirtualRobot(Path(sys.argv[1]), seed=3)
robot.run_us(300_000)
robot.link_write(b"hello")
robot.run_us(300_000)
print(robot.trace_hash(), robot.trace_count())
"""


def test_two_processes_give_the_same_trace_of_the_flashed_image(image):
    runs = [
        subprocess.run(
            [sys.executable, "-c", PROGRAM, str(image)],
            capture_output=True,
            text=True,
            check=True,
            timeout=60,
        ).stdout
        for _ in range(2)
    ]
    assert runs[0] == runs[1]
    assert int(runs[0].split()[1]) > 100


def test_the_flashed_image_meets_nothing_unknown(image):
    robot = VirtualRobot(image)
    robot.run_us(500_000)
    assert robot.warnings() == []
    assert not robot.stats().locked_up
