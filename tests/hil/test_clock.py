"""The board's clock is related to the host's within what is stated of offset and drift."""

from __future__ import annotations

import json
import random
import subprocess
import sys
from pathlib import Path

import pytest

from hil_sim import VirtualRobot
from hil_sim.robot import VirtualRobotError
from support.chain import Chain
from support.faulty_stream import FaultyStream
from support.image_variable import member_offset
from truing.board.device import Device
from truing.board.drive import drive
from truing.board.run_saver import fetch_log, run_of, save_run
from truing.clock.probe import ClockProbe
from truing.clock.relation import ClockRelation
from truing.clock.stamp import STAMP_S, clock_stamp
from truing.errors import BoardRebooted
from truing.link.can_stream import CanStream
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing.plan import load_plan
from truing.recording.reader import read_run
from truing.virtual.can import SimulatedBus, free, make_bus_of_boards
from truing.virtual.options import VirtualOptions

START_US = 20_000
CASES = [(ppm, seed) for ppm in (37.0, -80.0) for seed in (1, 2, 3)]


class JitteryStream(FaultyStream):
    """Every request leaves late and every answer is seen late, by up to `max_delay_s`."""

    def __init__(self, inner: VirtualStream, max_delay_s: float, seed: int) -> None:
        super().__init__(inner)
        self._max_delay_s = max_delay_s
        self._late = random.Random(seed)

    def write(self, data: bytes) -> None:
        self.sleep(self._late.uniform(0, self._max_delay_s))
        super().write(data)

    def read(self, timeout_s: float) -> bytes:
        data = super().read(timeout_s)
        if data:
            self.sleep(self._late.uniform(0, self._max_delay_s))
        return data


def offset_error_s(relation: ClockRelation, robot: VirtualRobot, image: Path) -> float:
    """What the relation says of the next tick, beside the tick itself."""
    offset, size = member_offset(image, "controller", "robot", "now_ms")
    address, _ = robot.symbol("controller")
    ticks = int.from_bytes(robot.read_memory(address + offset, size), "little")
    return relation.device_at(robot.next_tick_us() * 1e-6) - (ticks + 1) / 1000


def half_width(relation: ClockRelation) -> float:
    low, high = relation.drift_ci95_ppm
    return (high - low) / 2


def board_with(image: Path, ppm: float, seed: int) -> VirtualRobot:
    robot = VirtualRobot(image, seed=seed, crystal_ppm=ppm)
    robot.run_us(START_US)
    return robot


def check(relations: list[tuple[float, ClockRelation]], max_half_ppm: float) -> None:
    """19 of 20 are due inside; of six, two outside come once in thirty, three once in five hundred."""
    for ppm, relation in relations:
        print(f"{ppm:+.0f} ppm: {relation.drift_ppm:+.3f} +- {half_width(relation):.3f}")
        assert half_width(relation) < max_half_ppm
        assert abs(relation.drift_ppm - ppm) < 2 * half_width(relation)
    inside = sum(r.drift_ci95_ppm[0] <= ppm <= r.drift_ci95_ppm[1] for ppm, r in relations)
    assert inside >= len(relations) - 2


def test_a_crystals_error_is_found_over_the_serial_line(image: Path, native_library: Path) -> None:
    found = []
    for ppm, seed in CASES:
        with board_with(image, ppm, seed) as robot:
            relation, lost = Device(Client(VirtualStream(robot))).clock(10.0, seed=seed)
            assert lost == 0
            error = offset_error_s(relation, robot, image)
            assert abs(error) < relation.uncertainty_s(robot.time_s) < 0.0003
            assert abs(error) < 0.00003  # on a line that takes as long there as back
            found.append((ppm, relation))
    check(found, 0.5)


def test_a_crystals_error_is_found_over_can(image: Path, native_library: Path) -> None:
    found = []
    for ppm, seed in CASES:
        options = VirtualOptions(seed=seed, image=image, crystal_ppm=ppm)
        bus = make_bus_of_boards(options, (1,), 1_000_000)
        try:
            relation, lost = Device(Client(CanStream(SimulatedBus(bus), 1))).clock(10.0, seed=seed)
            assert lost == 0
            robot = bus.robots[0]
            assert abs(offset_error_s(relation, robot, image)) < relation.uncertainty_s(robot.time_s) < 0.0006
            found.append((ppm, relation))
        finally:
            free(bus)
    check(found, 0.5)


def test_jittered_round_trips_widen_the_interval_and_it_still_holds(
    image: Path, native_library: Path
) -> None:
    found = []
    for ppm, seed in CASES:
        with board_with(image, ppm, seed) as robot:
            relation, _ = Device(Client(JitteryStream(VirtualStream(robot), 0.0005, seed))).clock(
                10.0, seed=seed
            )
            assert abs(offset_error_s(relation, robot, image)) < relation.uncertainty_s(robot.time_s)
            found.append((ppm, relation))
    check(found, 10.0)
    assert all(half_width(relation) > 1.0 for _, relation in found)


def test_a_line_that_loses_requests_costs_some_of_them_only(image: Path, native_library: Path) -> None:
    with board_with(image, 37.0, 1) as robot:
        relation, lost = Device(Client(FaultyStream(VirtualStream(robot), 0.002, 3))).clock(10.0)
    assert lost > 0
    assert abs(relation.drift_ppm - 37.0) < 2 * half_width(relation) < 1.0


def test_the_drift_follows_the_crystals_temperature(image: Path, native_library: Path) -> None:
    with board_with(image, 0.0, 1) as robot:
        device = Device(Client(VirtualStream(robot)))
        robot.set_crystal_ppm(12.5)
        assert device.clock(10.0)[0].drift_ppm == pytest.approx(12.5, abs=0.4)


def test_a_board_that_starts_anew_meanwhile_is_told(image: Path, native_library: Path) -> None:
    with board_with(image, 0.0, 1) as robot:
        device = Device(
            Client(VirtualStream(robot, on_time=lambda t: robot.reset() if 2.0 < t < 2.0003 else None))
        )
        with pytest.raises(BoardRebooted):
            device.clock(4.0)


def test_no_crystal_is_that_far_off(image: Path, native_library: Path) -> None:
    with pytest.raises(VirtualRobotError, match="a crystal error of 600 ppm is beyond 500 ppm"):
        VirtualRobot(image, crystal_ppm=600.0)


def test_the_command_says_offset_drift_and_uncertainty(image: Path, native_library: Path) -> None:
    command = [sys.executable, "-m", "truing", "clock", "--crystal-ppm", "37", "--json"]
    done = subprocess.run(command, check=True, timeout=60, capture_output=True, text=True)
    said = json.loads(done.stdout)
    low, high = said["drift_ci95_ppm"]
    assert low <= 37.0 <= high
    assert high - low < 1.0
    assert said["uncertainty_s"] < 0.0003
    assert said["host_utc"] is None
    assert said["lost"] == 0


def test_a_fetched_run_knows_its_device_time_in_the_hosts(
    image: Path, native_library: Path, tmp_path: Path
) -> None:
    with Chain(image) as chain:
        chain.robot.set_crystal_ppm(37.0)
        device = chain.host()
        driven = drive(device, load_plan("paper/I"))
        probe = ClockProbe(device.client)
        probe.run(STAMP_S)
        fetched = fetch_log(device, driven.log_id)
        probe.run(STAMP_S)
        stamp = clock_stamp(chain.stream, probe)
        run = run_of(device, fetched, "I", parameters=device.parameters(), clock=stamp)
        path = save_run(run, tmp_path, "I", "")
    clock = read_run(path).metadata.extra["clock"]
    print(clock)
    assert clock["round_trips"] > 30
    assert clock["device_s"] == pytest.approx(clock["host_s"], abs=0.03)
    assert 0 < clock["uncertainty_s"] < 0.0003
    low, high = clock["drift_ci95_ppm"]
    assert low - 3 < 37.0 < high + 3
    assert clock["host_utc"] is None  # virtual time has no date
