"""`truing check` on virtual robots that are wired wrong in each way that it knows, and in several."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from hil_sim import VirtualRobot
from hil_sim.plant import RobotParameters
from hil_sim.robot import EncoderFault
from truing.board.device import Device
from truing.board.wiring_check import CheckResult, check_robot, fix
from truing.cli import ended_like_ctrl_c
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing_protocol import State

LEFT, RIGHT = 0, 1
Wire = Callable[[VirtualRobot], None]


class Hand:
    def __init__(self, robot: VirtualRobot) -> None:
        self.robot = robot

    def turn(self, side: int) -> None:
        self.robot.turn_by_hand(side)


def check(robot: VirtualRobot, device: Device | None = None) -> CheckResult:
    return check_robot(device or Device(Client(VirtualStream(robot))), Hand(robot), print)


def names(result: CheckResult) -> set[str]:
    return {finding.name for finding in result.findings}


def reverse(wheel: int) -> Wire:
    return lambda robot: robot.set_encoder_fault(wheel, EncoderFault.REVERSED)


def broken(wheel: int, fault: EncoderFault) -> Wire:
    return lambda robot: robot.set_encoder_fault(wheel, fault)


def swap_motors(robot: VirtualRobot) -> None:
    robot.set_motors_swapped(True)


def swap_encoders(robot: VirtualRobot) -> None:
    robot.set_encoders_swapped(True)


def unplug_motor(wheel: int) -> Wire:
    return lambda robot: robot.set_motor_connected(wheel, False)


WIRED_WRONG: list[tuple[set[str], list[Wire]]] = [
    (set(), []),
    ({"motors_swapped"}, [swap_motors]),
    ({"encoders_swapped"}, [swap_encoders]),
    ({"motors_swapped", "encoders_swapped"}, [swap_motors, swap_encoders]),
    ({"encoder_left_reversed"}, [reverse(LEFT)]),
    ({"encoder_right_reversed"}, [reverse(RIGHT)]),
    ({"encoder_left_reversed", "encoder_right_reversed"}, [reverse(LEFT), reverse(RIGHT)]),
    ({"encoder_left_dead"}, [broken(LEFT, EncoderFault.UNPLUGGED)]),
    ({"encoder_right_dead"}, [broken(RIGHT, EncoderFault.PHASE_A_DROPPED)]),
    ({"motor_left_dead"}, [unplug_motor(LEFT)]),
    ({"motor_right_dead"}, [unplug_motor(RIGHT)]),
    ({"motors_swapped", "encoder_right_reversed"}, [swap_motors, reverse(RIGHT)]),
    ({"encoder_left_dead", "motor_right_dead"}, [broken(LEFT, EncoderFault.UNPLUGGED), unplug_motor(RIGHT)]),
]


@pytest.mark.parametrize(
    ("expected", "wires"), WIRED_WRONG, ids=["+".join(sorted(w[0])) or "right" for w in WIRED_WRONG]
)
def test_what_is_wired_wrong_is_named_and_nothing_else(
    robot: VirtualRobot, expected: set[str], wires: list[Wire]
) -> None:
    for wire in wires:
        wire(robot)
    assert names(check(robot)) == expected


@pytest.mark.parametrize("wheel", [LEFT, RIGHT])
def test_a_motor_with_its_leads_exchanged_is_named_and_put_right(robot: VirtualRobot, wheel: int) -> None:
    # Leads exchanged at the plug do what the parameter does to a robot that was right.
    side = ("left", "right")[wheel]
    device = Device(Client(VirtualStream(robot)))
    device.set_parameter(f"motor_{side}_reversed", 1.0)
    result = check(robot, device)
    assert names(result) == {f"motor_{side}_reversed"}
    assert fix(device, result) == [f"motor_{side}_reversed"]
    assert device.get_parameter(f"motor_{side}_reversed").value == 0.0
    assert names(check(robot, device)) == set()


def test_reversed_encoders_are_put_right_by_the_fix(robot: VirtualRobot) -> None:
    robot.set_encoder_fault(LEFT, EncoderFault.REVERSED)
    robot.set_encoder_fault(RIGHT, EncoderFault.REVERSED)
    device = Device(Client(VirtualStream(robot)))
    assert fix(device, check(robot, device)) == ["encoder_left_reversed", "encoder_right_reversed"]
    assert names(check(robot, device)) == set()


def test_the_command_says_that_all_is_right_and_what_it_saw(native_library: Path, image: Path) -> None:
    command = [sys.executable, "-m", "truing", "check"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert "motors, encoders and counts per revolution are right" in done.stdout
    assert re.search(r"left wheel turned by hand: left encoder \+(2399|2400|2401), right \+0", done.stderr)


@pytest.mark.parametrize("counts", [1200, 2000, 4800])
def test_wrong_counts_per_revolution_are_measured(image: Path, native_library: Path, counts: int) -> None:
    other = RobotParameters.msrp().changed(
        left__encoder__counts_per_rev=counts, right__encoder__counts_per_rev=counts
    )
    with VirtualRobot(image, robot=other) as robot:
        robot.run_us(300_000)
        result = check(robot)
    assert names(result) == {"counts_per_rev_left", "counts_per_rev_right"}
    assert [wheel.counts for wheel in result.wheels] == pytest.approx([counts, counts], abs=2)


def test_a_check_that_is_told_to_end_brakes_the_motor_it_turns(robot: VirtualRobot) -> None:
    device = Device(Client(VirtualStream(robot)))
    robot.set_encoder_fault(LEFT, EncoderFault.UNPLUGGED)
    driven = []

    def told_to_end_while_a_motor_turns(seconds: float) -> None:
        robot.run_us(round(seconds * 1e6))
        if device.status().effort[LEFT] > 0.08:
            driven.append(device.status().effort)
            signal.raise_signal(signal.SIGTERM)

    device.client.stream.sleep = told_to_end_while_a_motor_turns  # type: ignore[method-assign]
    with ended_like_ctrl_c(), pytest.raises(KeyboardInterrupt):
        check(robot, device)
    assert len(driven) == 1
    status = device.status()
    assert status.effort == (0.0, 0.0)
    assert status.state is State.IDLE
    assert status.latched == ()
