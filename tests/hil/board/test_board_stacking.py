"""An exception whose frame does not fit into memory: which fault follows, and what its handler finds."""

from __future__ import annotations

import pytest

STKERR, UNSTKERR, PRECISERR, BFARVALID, FORCED = 1 << 12, 1 << 11, 1 << 9, 1 << 15, 1 << 30
FRAME = 32


@pytest.fixture
def after(board):
    def run(command: int):
        b = board("stacking")
        b.run_us(1_000)
        b.put("command", command)
        b.run_us(1_000)
        return b

    return run


def test_an_interrupt_without_room_for_its_frame_is_a_bus_fault(after):
    b = after(1)
    assert (b.word("bus"), b.word("hard"), b.word("nested")) == (1, 0, 0)
    assert b.word("cfsr") == STKERR
    assert b.word("sp") == 0x20000010 - FRAME, "the stack pointer moves all the same"
    assert b.symbol("bottom")[0] == 0x20000000
    assert b.words("bottom")[3] & 1 << 24, "xPSR, the last word of the half that has room"
    assert not b.stats().locked_up


def test_with_the_bus_fault_off_it_is_a_hard_fault(after):
    b = after(2)
    assert (b.word("bus"), b.word("hard")) == (0, 1)
    assert (b.word("cfsr"), b.word("hfsr")) == (STKERR, FORCED)


def test_a_bus_fault_without_room_for_its_own_frame_is_handled_once(after):
    b = after(3)
    assert (b.word("bus"), b.word("hard")) == (1, 0)
    assert b.word("cfsr") == STKERR | PRECISERR | BFARVALID


def test_a_return_to_a_frame_that_is_nowhere_is_a_bus_fault(after):
    b = after(4)
    assert (b.word("bus"), b.word("hard")) == (1, 0)
    assert b.word("cfsr") == UNSTKERR
    assert b.word("sp") == 0x20020000


def test_a_hard_fault_without_room_locks_up(after):
    assert after(5).stats().locked_up
