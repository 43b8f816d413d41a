"""A save may lose its power anywhere: the next start finds the old set or the new one, whole."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import truing_protocol as tp
from support.store_board import BLANK, StoreBoard, Values, faults_of, generation, put_values, values_of
from truing.link.framing import Frame, encode

DAMAGED = next(fault.mask for fault in tp.FAULTS if fault.name == "parameter_store_damaged")
TEARS = 3  # each torn operation stops somewhere else
EVERY_INSTRUCTIONS = 3000  # the three saves start 1000 apart
EVERY_US = 10_000
SAVE = encode(Frame(tp.ParamSaveRequest.ID, 4711))
LONGEST_SAVE_US = 400_000


@dataclass
class Save:
    """One save to be cut off: what it starts from, and what it takes."""

    board: StoreBoard
    slots: bytes
    old: Values
    new: Values
    number: int  # 0 is the first save of a blank board
    instructions: int = 0
    duration_us: int = 0
    outcomes: dict[str, int] = field(default_factory=lambda: {"old": 0, "new": 0})

    def measure(self) -> None:
        """Do it once without a cut."""
        client = self.board.start(self.slots)
        put_values(client, self.new)
        self.new = values_of(client)
        robot = self.board.robot
        before, began = robot.stats().instructions, robot.time_us
        assert client.request(tp.ParamSaveRequest()).written
        self.instructions, self.duration_us = robot.stats().instructions - before, robot.time_us - began
        assert values_of(self.board.start()) == self.new

    def cut(self, arm: Callable[[StoreBoard], object], *, must_fail: bool) -> bool:
        """Do it with a cut, start again, and judge; whether the power failed at all."""
        client = self.board.start(self.slots)
        put_values(client, self.new)
        self.board.robot.link_write(SAVE)  # on its way from now on; time passes only below
        arm(self.board)
        failed = self.board.run_until_dark(LONGEST_SAVE_US)
        assert failed or not must_fail
        self.board.robot.cut_power_at_flash_write(None)
        self.board.robot.cut_power_at_instruction(None)
        client = self.board.start()
        found = values_of(client)
        assert found in (self.old, self.new), "neither the old set nor the new one"
        self.outcomes["new" if found == self.new else "old"] += 1
        # With an older set to fall back on, a cut is no damage.
        assert self.number == 0 or not faults_of(client) & DAMAGED
        return failed


@pytest.fixture(params=["first", "second", "third"])
def save(request: pytest.FixtureRequest, image: Path, native_library: Path) -> Iterator[Save]:
    number = ("first", "second", "third").index(request.param)
    with StoreBoard(image, seed=number + 1) as board:
        client = board.start(BLANK)
        for earlier in range(number):
            put_values(client, generation(earlier))
            client.request(tp.ParamSaveRequest())
        old = values_of(board.start())
        found = Save(board, board.slots, old, generation(number), number)
        found.measure()
        yield found


def cut_every_flash_write(save: Save) -> int:
    """Cut each of them `TEARS` times; how many there are: behind the last, no cut happens."""
    write = 0

    def arm(board: StoreBoard) -> None:
        board.robot.cut_power_at_flash_write(write)

    while save.cut(arm, must_fail=False):
        for _ in range(1, TEARS):
            save.cut(arm, must_fail=True)
        write += 1
    assert save.outcomes["new"] > 0  # at the least by the last, which was not cut
    return write


@pytest.mark.slow
def test_a_save_cut_off_anywhere_leaves_the_old_set_or_the_new_one(save: Save) -> None:
    began = time.monotonic()
    tried = {"flash writes": 0, "instructions": 0, "moments of the erase": 0}

    writes = cut_every_flash_write(save)
    assert writes >= 2 * len(tp.PARAMETERS)
    tried["flash writes"] = TEARS * writes

    for instruction in range(save.number * EVERY_INSTRUCTIONS // 3, save.instructions, EVERY_INSTRUCTIONS):
        save.cut(
            lambda board, n=instruction: board.robot.cut_power_at_instruction(n),  # type: ignore[misc]
            must_fail=instruction < save.instructions - EVERY_INSTRUCTIONS,
        )
        tried["instructions"] += 1

    for moment_us in range(0, save.duration_us, EVERY_US):

        def later(board: StoreBoard, us: int = moment_us) -> None:
            board.robot.run_us(us)
            board.robot.set_power(False)

        save.cut(later, must_fail=True)
        tried["moments of the erase"] += 1

    kinds = ", ".join(f"{count} at {what}" for what, count in tried.items())
    took_s = time.monotonic() - began
    print(
        f"{sum(tried.values())} cuts ({kinds}) of a save of {writes} flash writes, {save.instructions} "
        f"instructions, {save.duration_us / 1000:.1f} ms: {save.outcomes['old']} old sets, "
        f"{save.outcomes['new']} new ones; {took_s:.1f} s"
    )
    assert save.outcomes["old"] > writes
    assert save.outcomes["new"] > 0
