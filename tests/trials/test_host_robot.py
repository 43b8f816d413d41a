"""The host robot drives as the flashed image does, and the plant's plain robot is untouched."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil_sim import UnmodelledEffects, VirtualRobot
from hil_sim.host_robot import HostRobot
from truing.board.device import Device
from truing.board.run_saver import fetch_log
from truing.link.client import Client
from truing.link.framing import Frame, encode
from truing.link.virtual_stream import VirtualStream
from truing.log.decode import decode_log
from truing.plan import load_plan
from truing_protocol import SetEffortRequest

START_US = 3_050_250
TICK_US = 1000


@pytest.fixture(scope="module")
def phases_us(image: Path, native_library: Path) -> tuple[float, float]:
    """When the image first ticks, and how long after a tick its efforts reach the bridges."""
    with VirtualRobot(image, seed=3) as board:
        while board.next_tick_us() > board.time_us + TICK_US:  # SysTick has not been started yet
            board.run_us(100)
        first_us = board.next_tick_us()
        Device(Client(VirtualStream(board))).arm()
        board.run_us(START_US - board.time_us)
        board.link_write(encode(Frame(SetEffortRequest.ID, 1, SetEffortRequest(0.5, 0.5).pack())))
        while board.bridge(0) == (1.0, 1.0):
            board.run_us(1)
        return first_us, (board.time_us - first_us) % TICK_US


def log_of(robot: Any, plan_name: str) -> bytes:
    """The bytes of a plan's log, started at one moment of virtual time whatever the upload took."""
    plan = load_plan(plan_name)
    with Device(Client(VirtualStream(robot))) as device:
        sequence = device.upload(plan)
        device.arm()
        robot.run_us(START_US - robot.time_us)
        log_id = device.start(sequence, unattended=True)
        robot.run_us(round(plan.duration_s * 1e6) + 300_000)
        return fetch_log(device, log_id).data


LATE = UnmodelledEffects().changed(
    driver__delay_s=0.05, disturbance__torque_nm=(0.01, 0.01), disturbance__correlation_s=0.2
)
BRISTLES = UnmodelledEffects().changed(
    bristle__coulomb_nm=(0.05, 0.04),
    bristle__breakaway_nm=(0.05, 0.05),
    bristle__bend_rad=1e-3,
    bristle__stribeck_radps=1.0,
)


@pytest.mark.parametrize("effects", [UnmodelledEffects(), LATE], ids=["plain", "late and disturbed"])
def test_host_robot_and_flashed_image_leave_the_same_log_byte_for_byte(
    image: Path, phases_us: tuple[float, float], effects: UnmodelledEffects
) -> None:
    with VirtualRobot(image, seed=3) as board, HostRobot(seed=3, phases_us=phases_us) as on_host:
        board.set_unmodelled_effects(effects)
        on_host.set_unmodelled_effects(effects)
        assert log_of(on_host, "paper/XVII") == log_of(board, "paper/XVII")


def test_an_edge_within_nanoseconds_of_a_tick_may_move_odometrys_last_digit_and_nothing_else(
    image: Path, phases_us: tuple[float, float]
) -> None:
    """The image's tick waits for whole instructions, so that its reading of the counters jitters."""
    with VirtualRobot(image, seed=3) as board, HostRobot(seed=3, phases_us=phases_us) as on_host:
        board.set_unmodelled_effects(BRISTLES)
        on_host.set_unmodelled_effects(BRISTLES)
        seen = decode_log(log_of(board, "paper/XVII")).records
        ours = decode_log(log_of(on_host, "paper/XVII")).records
    for name in seen.dtype.names:
        apart = np.abs(seen[name].astype(np.int64) - ours[name].astype(np.int64))
        assert apart.max() <= (1 if name in ("x_mm", "y_mm", "theta_e4") else 0), name
        assert np.count_nonzero(apart) <= 1, name


def test_a_robot_with_nothing_hidden_is_the_plain_one(native_library: Path) -> None:
    with HostRobot(seed=5) as plain, HostRobot(seed=5, effects=UnmodelledEffects()) as asked:
        assert log_of(plain, "paper/XI") == log_of(asked, "paper/XI")
        assert plain.truth() == asked.truth()
