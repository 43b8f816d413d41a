"""Flash wait states and the accelerator's caches, after RM0090 section 3.5.2, where they are counted."""

from __future__ import annotations

import pytest

WAIT_STATES = 5
PREFETCH, CODE_CACHE, DATA_CACHE = 1 << 8, 1 << 9, 1 << 10
LINES, LONGER, ROUNDS = 32, 72, 20
NARROW, NARROW_AGAIN, WIDE, LONG, LONG_AGAIN, LOOP, EIGHT, NINE = range(8)
AROUND = 6 * WAIT_STATES  # the call, its literals and the return


@pytest.fixture
def waits(board):
    """The cycles of each kind beyond those that it takes without wait states, at these bits of FLASH_ACR."""
    counted, plain = board("flash_waits"), board("flash_waits")
    counted.count_flash_waits()
    for b in (counted, plain):
        b.run_us(5000)

    def measure(bits: int) -> list[int]:
        for b in (counted, plain):
            b.put("acr", bits | WAIT_STATES)
            b.put("command", 1)
            b.run_us(5000)
            assert b.word("command") == 0
        return [a - b for a, b in zip(counted.words("cycles"), plain.words("cycles"), strict=True)]

    return measure


def test_without_the_accelerator_each_line_of_code_and_each_load_waits(waits):
    found = waits(0)
    assert WAIT_STATES * LINES <= found[NARROW] <= WAIT_STATES * LINES + AROUND
    assert WAIT_STATES * LINES <= found[WIDE] <= WAIT_STATES * LINES + AROUND
    assert found[LOOP] <= 2 * AROUND, "a loop within the line that is executed"
    assert found[EIGHT] >= WAIT_STATES * 8 * ROUNDS


def test_prefetching_hides_the_waits_of_narrow_code_and_most_of_wide(waits):
    found = waits(PREFETCH)
    assert found[NARROW] <= 2 * AROUND, "eight cycles of a line hide the six of the next"
    assert 2 * LINES <= found[WIDE] <= 2 * LINES + 2 * AROUND, "four cycles of a line leave two of the next"


def test_eight_lines_of_data_are_kept_and_nine_drive_each_other_out(waits):
    found = waits(PREFETCH | CODE_CACHE | DATA_CACHE)
    assert found[EIGHT] <= WAIT_STATES * 2 * 8 + 2 * AROUND, "read once"
    assert found[NINE] >= WAIT_STATES * 9 * ROUNDS, "read each time"


def test_64_lines_of_code_are_kept_and_more_drive_each_other_out(waits):
    found = waits(CODE_CACHE)
    assert found[NARROW] >= WAIT_STATES * LINES, "the first time"
    assert found[NARROW_AGAIN] <= 2 * AROUND
    assert found[LONG_AGAIN] >= WAIT_STATES * LONGER
    assert waits(CODE_CACHE)[NARROW] >= WAIT_STATES * LINES, "emptied in between"


def test_wait_states_are_counted_on_request_only_and_change_no_result(board):
    for count in (False, True):
        b = board("it_blocks")
        if count:
            b.count_flash_waits()
        b.run_us(200_000)
        assert b.word("wrong") == 0
        assert b.word("pages_wrong") == 0
