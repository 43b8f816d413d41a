"""Tuning and the check of the wiring in the view's worker, on a board in this process and in virtual time."""

from __future__ import annotations

import asyncio
import time

import pytest

from truing.board.device import Device
from truing.virtual.options import VirtualOptions
from truing.web.process.helper import HelperProcess
from truing.web.process.tuning_job import TuningJob
from truing.web.process.wiring_job import WiringJob
from truing.web.worker.board_worker import BoardWorker

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("image", "native_library")]


class Hand:
    """Turns the wheels of the virtual robot, as `RobotSide.turn` does."""

    def __init__(self) -> None:
        self.device: Device | None = None

    def turn(self, side: int) -> None:
        assert self.device is not None
        self.device.client.stream.board.turn_by_hand(side)


@pytest.fixture
def board():
    hand = Hand()

    def connect() -> Device:
        hand.device = Device.open("sim", VirtualOptions(1))
        return hand.device

    worker = BoardWorker(connect)
    worker.start()
    until = time.monotonic() + 60.0
    while worker.snapshot.link != "connected" and time.monotonic() < until:
        time.sleep(0.02)
    assert worker.snapshot.link == "connected", worker.snapshot
    yield worker, hand
    worker.close()


def test_the_feedforward_is_learnt_and_kept_where_the_wheels_follow_better(board, tmp_path):
    worker, _ = board
    helper = HelperProcess("truing.web.process.simulation_main")
    job = TuningJob(worker, helper)
    try:
        asyncio.run(job.run(worker.run_plan, tmp_path))
    finally:
        helper.close()
    assert job.state.stage == "done", job.state.text
    assert len(list((tmp_path / "runs").glob("*.csv"))) == 3
    assert "tracking error" in job.state.text
    changed = {name for name, (before, after) in job.state.parameters.items() if before != after}
    assert {"ff_kv_left", "ff_ks_right"} <= changed
    assert all(
        worker.parameters[name].value == pytest.approx(after, rel=1e-5)
        for name, (_, after) in job.state.parameters.items()
    )


def test_a_tuning_that_is_stopped_in_its_last_drive_puts_the_old_parameters_back(board, tmp_path):
    worker, _ = board
    old = {name: one.value for name, one in worker.parameters.items()}
    seen = []
    helper = HelperProcess("truing.web.process.simulation_main")
    job = TuningJob(worker, helper)

    def drive(request):
        worker.run_plan(request)
        if request.label == "tune_after":
            seen.append({name: one.value for name, one in worker.parameters.items()})
            worker.stop()

    try:
        asyncio.run(job.run(drive, tmp_path))
    finally:
        helper.close()
    assert job.state.stage == "failed"
    assert "stopped by the user" in job.state.text
    assert not job.state.parameters
    assert seen[0] != old  # what was learned had been in force
    assert {name: one.value for name, one in worker.parameters.items()} == old


def test_a_reversed_encoder_is_found_and_put_right(board):
    worker, hand = board
    job = WiringJob(worker, lambda: hand)
    worker.call(lambda device: device.set_parameter("encoder_left_reversed", 1.0)).result(30.0)
    asyncio.run(job.run())
    assert job.state.stage == "done", job.state
    assert [one.parameter for one in job.state.result.findings] == ["encoder_left_reversed"]
    asyncio.run(job.fix())
    assert worker.parameters["encoder_left_reversed"].value == 0.0


def test_a_stop_ends_the_check_while_it_waits_for_a_hand(board):
    worker, _ = board
    job = WiringJob(worker, lambda: None)

    async def stopped() -> None:
        check = asyncio.create_task(job.run())
        until = time.monotonic() + 30.0
        while not job.state.asks and time.monotonic() < until:
            await asyncio.sleep(0.01)
        assert "left wheel" in job.state.asks
        worker.stop()
        await check

    asyncio.run(stopped())
    assert job.state.stage == "failed"
    assert worker.snapshot.task is not None
    assert worker.snapshot.task.stage == "stopped"
