"""Each board drives, counts and measures on its own pins, and its header may not say what cannot be."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hil_sim import Target, VirtualRobot
from support.driving import BRAKE, bridges, host

F405_USB, G474 = "stm32f405/boards/f405_usb.h", "stm32g474/boards/nucleo_g474re.h"
COMPILER = ["arm-none-eabi-gcc", "-std=c11", "-fsyntax-only", "-mcpu=cortex-m4", "-xc", "-I.", "-I../stm32"]


@pytest.fixture
def image(each_image: Path) -> Path:
    """The image of each board."""
    return each_image


def test_each_wheel_turns_the_way_it_is_told_and_its_own_encoder_counts(robot: VirtualRobot) -> None:
    device = host(robot)
    assert device.info.clock_source == "crystal_pll"
    for left, right in ((0.5, 0.0), (0.0, 0.5), (-0.5, 0.0), (0.0, -0.5)):
        before = device.status().counts
        for _ in range(4):
            device.set_effort(left, right)
            robot.run_us(100_000)
        moved = [now - then for now, then in zip(device.status().counts, before, strict=True)]
        device.stop()
        robot.run_us(400_000)
        driven, braked = moved if left else reversed(moved)
        assert driven * (left + right) > 200, moved
        assert abs(braked) < abs(driven) / 4, moved  # the chassis turns it a little
    assert robot.warnings() == []


def test_the_supply_is_measured_through_the_boards_own_divider(robot: VirtualRobot) -> None:
    device = host(robot)
    for volts in (7.0, 12.6, 25.0):
        robot.set_bench_voltage(volts)
        robot.run_us(10_000)
        assert device.status().battery_v == pytest.approx(volts, abs=0.01)


def test_stop_and_a_silent_host_brake_both_bridges(robot: VirtualRobot) -> None:
    device = host(robot)
    device.set_effort(0.5, -0.5)
    robot.run_us(100_000)
    assert bridges(robot)[0] != BRAKE[0]
    assert bridges(robot)[1] != BRAKE[1]
    device.stop()
    assert bridges(robot) == BRAKE
    device.set_effort(0.5, -0.5)
    robot.run_us(510_000)
    assert bridges(robot) == BRAKE
    assert [fault.name for fault in device.status().latched] == ["host_silent"]


def test_info_and_check_name_the_board_and_check_finds_nothing_wrong(
    image: Path, native_library: Path
) -> None:
    name = {"truing-f405": "stm32f405", "truing-f405-usb": "stm32f405-usb"}[image.stem]
    for command in (["info"], ["check", "--yes"]):
        run = subprocess.run(
            [sys.executable, "-m", "truing", "--port", "sim", *command, "--json"],
            env={**os.environ, "TRUING_IMAGE": str(image)},
            capture_output=True,
            text=True,
            check=True,
        )
        said = json.loads(run.stdout)
        assert (said["board"]["board_name"] if command == ["info"] else said["board"]) == name
    assert said["findings"] == []


def test_another_boards_image_finds_another_crystal_and_says_so(image: Path, native_library: Path) -> None:
    other = {Target.OLIMEX_H405: Target.F405_USB, Target.F405_USB: Target.OLIMEX_H405}
    with VirtualRobot(image) as own:
        target = other[own.target]
    with VirtualRobot(image, target=target) as robot:
        robot.run_us(300_000)
        assert robot.stats().cpu_hz == 158_000_000


def compile_board(root: Path, folder: Path, board: str, old: str, new: str) -> str:
    """What the compiler says of a board's header in which one thing is said otherwise."""
    path = root / "firmware" / board
    text = path.read_text()
    assert text.count(old) == 1
    header = folder / "board.h"
    header.write_text(text.replace(old, new))
    run = subprocess.run(
        [*COMPILER, f'-DTRUING_BOARD_HEADER="{header}"', "-"],
        input='#include "wiring.h"\n',
        cwd=path.parents[1],
        capture_output=True,
        text=True,
        check=False,
    )
    return run.stderr


@pytest.mark.parametrize(
    ("board", "old", "new", "complaint"),
    [
        (F405_USB, "PB(8)", "PB(8)", ""),
        (F405_USB, "BOARD_LED       PC(13)", "BOARD_LED PC(8)", "a pin is given twice"),
        (F405_USB, "BOARD_LED       PC(13)", "BOARD_LED PA(13)", "a pin is given twice, or is one of SWDIO"),
        (F405_USB, "BOARD_LED       PC(13)", "BOARD_LED PA(12)", "a pin that is to stay free"),
        (F405_USB, "BOARD_RIGHT_PIN_2   PC(7)", "BOARD_RIGHT_PIN_2 PC(9)", "right bridge: .* second pin"),
        (F405_USB, "BOARD_LEFT_CHANNEL  1u", "BOARD_LEFT_CHANNEL 3u", "left bridge: .* first pin"),
        (F405_USB, "BOARD_LEFT_TIMER    1u", "BOARD_LEFT_TIMER 2u", "TIM1 or TIM8, which have a break"),
        (F405_USB, "BOARD_ENABLE_PIN     PC(8)", "BOARD_ENABLE_PIN PB(0)", "driver enable: .* on the pin"),
        (F405_USB, "BOARD_LEFT_ENCODER_A      PB(6)", "BOARD_LEFT_ENCODER_A PA(0)", "left encoder"),
        (F405_USB, "BOARD_TIM8_BREAK_PIN PA(6)", "BOARD_TIM8_BREAK_PIN PB(13)", "TIM8_BKIN is on PA6"),
        (F405_USB, "BOARD_BATTERY_PIN       PC(0)", "BOARD_BATTERY_PIN PB(2)", "no input of ADC1"),
        (F405_USB, "BOARD_SERIAL_TX PC(10)", "BOARD_SERIAL_TX PA(2)", "USART3 is on"),
        (F405_USB, "12000000u", "11000000u", "even number of MHz"),
        (G474, "PA(5)", "PA(5)", ""),
        (G474, "BOARD_LED       PA(5)", "BOARD_LED PB(8)", "a pin that is to stay free"),
        (G474, "BOARD_LEFT_PIN_2     PC(1)", "BOARD_LEFT_PIN_2 PC(2)", "left bridge: .* second pin"),
        (G474, "BOARD_TIM1_BREAK_PIN PB(12)", "BOARD_TIM1_BREAK_PIN PA(6)", "TIM1_BKIN is on PB12"),
        (G474, "BOARD_CAN_RX    PA(11)", "BOARD_CAN_RX PB(9)", "FDCAN1 is on PA11, PA12"),
        (G474, "BOARD_SERIAL_TX PA(2)", "BOARD_SERIAL_TX PB(10)", "USART2 is on PA2, PA3"),
        (G474, "BOARD_BATTERY_PIN       PA(0)", "BOARD_BATTERY_PIN PA(7)", "no input of ADC1"),
        (G474, "24000000u", "25000000u", "a multiple of 4 MHz"),
    ],
)
def test_a_header_that_the_chip_cannot_follow_does_not_compile(
    root: Path, tmp_path: Path, board: str, old: str, new: str, complaint: str
) -> None:
    said = compile_board(root, tmp_path, board, old, new)
    if complaint:
        assert "static assertion failed" in said
        assert re.search(complaint, said), said
    else:
        assert said == ""


@pytest.mark.parametrize(("port", "number", "first"), [("B", 12, 0), ("A", 6, 1)])
def test_one_broken_wire_of_the_emergency_stop_holds_its_bridge_at_once_and_both_within_a_tick(
    usb_image: Path, native_library: Path, port: str, number: int, first: int
) -> None:
    with VirtualRobot(usb_image) as robot:
        robot.run_us(300_000)
        device = host(robot)
        device.set_effort(0.5, -0.5)
        robot.run_us(100_100)
        robot.open_pin(port, number)
        assert bridges(robot)[first] == BRAKE[first]
        assert bridges(robot)[1 - first] != BRAKE[1 - first]
        robot.run_us(1_100)
        assert bridges(robot) == BRAKE
        assert [fault.name for fault in device.status().latched] == ["emergency_stop"]
