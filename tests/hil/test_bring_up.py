"""`truing check --log` on virtual boards: the form is begun, gone on with, and tells right from wrong."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hil_sim import VirtualRobot
from support.cli import truing
from support.driving import host
from truing.board.bring_up import BOARD, STEPS, empty, problems, read_board
from truing.board.bring_up_form import read_form, write_form

BY_BOARD = {f"{step.name}.{one.name}" for step in STEPS for one in step.measurements if one.by == BOARD}


def test_the_form_is_written_resumed_and_completed(tmp_path: Path, image: Path, native_library: Path) -> None:
    path = tmp_path / "board.toml"
    first = truing("check", "--log", str(path))
    assert first.returncode == 0, first.stderr
    assert f"{len(BY_BOARD)} of" in first.stdout
    assert "next: power.supply_3v3 (docs/BRINGUP.md)" in first.stdout
    form = read_form(path)
    assert {f"{step}.{name}" for step, values in form.values.items() for name in values} == BY_BOARD
    assert problems(form.values) == {}
    assert form.values["wiring"]["counts_left"] == pytest.approx(2400, abs=2)

    # A person fills the rest in, one value of them wrong; the board's own are spoilt, and measured anew.
    form.person = "Ada"
    for step in STEPS:
        for one in step.measurements:
            if one.by != BOARD:
                limits = [limit for limit in (one.low, one.high) if limit is not None]
                value = one.words[0] if one.words else sum(limits) / len(limits)
                form.values.setdefault(step.name, {})[one.name] = value
    form.values["battery"]["battery_by_meter"] = form.values["battery"]["battery_by_board"]
    form.values["stop"]["stop_to_brake"] = 3.5
    form.values["clock"]["drift"] = 4000.0
    form.notes["stop"] = "measured twice"
    write_form(path, form)
    second = json.loads(truing("check", "--log", str(path), "--json").stdout)["form"]
    assert second["empty"] == []
    assert second["wrong"] == {"stop.stop_to_brake": "3.5 where at most 2 ms is right"}
    resumed = read_form(path)
    assert (resumed.person, resumed.notes["stop"]) == ("Ada", "measured twice")
    assert abs(float(resumed.values["clock"]["drift"])) < 1

    resumed.values["stop"]["stop_to_brake"] = 1.2
    write_form(path, resumed)
    third = truing("check", "--log", str(path))
    assert "the bring-up is complete, and everything is right" in third.stdout

    resumed.board_id = "000000000000000000000000"
    write_form(path, resumed)
    before = path.read_bytes()
    other = truing("check", "--log", str(path))
    assert other.returncode == 2
    assert "is the form of board 0000" in other.stderr
    assert path.read_bytes() == before


def test_a_board_that_is_not_right_says_where(image: Path, native_library: Path) -> None:
    with VirtualRobot(image, crystal=False) as robot:
        robot.set_hsi_hz(15_920_000)
        robot.power_cycle()
        robot.set_battery_sense_connected(False)
        robot.run_us(500_000)
        seen = read_board(host(robot))
    wrong = problems(seen)
    assert wrong["start.clock_source"] == "internal_pll where crystal_pll is right"
    assert "clock_fallback" in wrong["start.faults"]
    assert "battery_low" in wrong["start.faults"]
    assert "battery.battery_by_board" in empty(seen), "it reads nothing"
    assert wrong["can.bus_state"].startswith("no_crystal")
    assert float(wrong["clock.drift"].split()[0]) == pytest.approx(-5000, abs=50)


def test_the_limits_of_the_pwm_are_those_of_the_board(robot: VirtualRobot) -> None:
    """What a scope would show, from the virtual board's pins and timer."""
    device = host(robot)
    device.set_effort(0.25, 0.0)
    robot.run_us(300_000)
    other_input, high_share = robot.bridge(0)
    reload = robot.read_register(0x4001_002C)  # TIM1_ARR
    seen = {
        "pwm": {
            "frequency": robot.stats().cpu_hz / (reload + 1) / 1e3,
            "high_share": 100 * high_share,
            "other_input": 3.3 * other_input,
        }
    }
    assert problems(seen) == {}
    divider = robot.read_register(0x4000_4808)  # USART3_BRR
    assert problems({"serial_line": {"ten_bits": 10e6 * divider / (robot.stats().cpu_hz / 4)}}) == {}
