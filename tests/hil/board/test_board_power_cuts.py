"""Power that fails on the virtual board: torn flash content, and cuts at a chosen instruction."""

from __future__ import annotations

import pytest

from hil_sim import ResetCause

SECTOR, WORD = 0x08004000, 0x08004004
WRITTEN = 0x12345678
ERASE_US = 250_000


def erased(board, **options):
    """A board whose image has erased sector 1 and waits before it programs."""
    b = board("flash", **options)
    b.run_us(1000)
    b.put("command", 1)
    b.run_us(400_000)
    assert b.word("state") == 1
    return b


def word_at(b, address: int = WORD) -> int:
    return int.from_bytes(b.read_memory(address, 4), "little")


def torn_word(board, seed: int) -> int:
    b = erased(board, seed=seed)
    b.cut_power_at_flash_write(1)
    b.put("command", 2)
    b.run_us(1000)
    assert not b.stats().powered
    assert word_at(b, SECTOR) == 0xCAFE0FF0, "the write before it is whole"
    return word_at(b)


def test_a_torn_word_lies_between_old_and_new_another_time_elsewhere_and_the_same_for_the_same_seed(board):
    words = [torn_word(board, seed) for seed in range(1, 9)]
    assert all(word & WRITTEN == WRITTEN for word in words), "programming makes no ones"
    assert len(set(words)) > 4
    assert words == [torn_word(board, seed) for seed in range(1, 9)]


def start_erase(board, seed: int, past_us: int):
    """A sector full of zeros, and an erase of it that has gone on for so long."""
    b = board("flash", seed=seed)
    b.set_power(False)
    b.write_flash(SECTOR, bytes(0x4000))
    b.set_power(True)
    b.run_us(1000)
    b.put("command", 1)
    b.run_us(past_us)
    return b


def share_of_ones(b) -> float:
    sector = b.read_memory(SECTOR, 0x4000)
    return sum(byte.bit_count() for byte in sector) / (8 * len(sector))


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_power_that_fails_during_an_erase_leaves_it_as_far_as_it_had_got(board, share):
    b = start_erase(board, 1, round(share * ERASE_US))
    b.set_power(False)
    assert share_of_ones(b) == pytest.approx(share, abs=0.02)


def test_a_reset_during_an_erase_tears_it_too_and_nothing_after_it_does(board):
    b = start_erase(board, 1, ERASE_US // 2)
    b.reset(ResetCause.PIN)
    torn = b.read_memory(SECTOR, 0x4000)
    assert share_of_ones(b) == pytest.approx(0.5, abs=0.02)
    b.reset(ResetCause.PIN)
    b.power_cycle()
    assert b.read_memory(SECTOR, 0x4000) == torn


def test_an_operation_that_is_over_is_not_torn(board):
    b = erased(board)
    b.power_cycle()
    assert share_of_ones(b) == 1.0


def test_slow_flash_takes_the_longest_times_of_the_datasheet(board):
    b = board("flash")
    b.set_flash_slow(True)
    b.run_us(1000)
    b.put("command", 1)
    b.run_us(600_000)
    assert b.word("erase_cycles") == pytest.approx(0.5 * 16e6, rel=0.001)
    b.put("command", 2)
    b.run_us(1000)
    assert b.word("program_cycles") == pytest.approx(100e-6 * 16e6, abs=60)


@pytest.mark.parametrize("instructions", [0, 1, 1000, 54_321])
def test_power_fails_at_the_instruction_asked_for_to_within_a_stretch_of_code(board, instructions):
    b = board("flash")
    b.run_us(1000)
    before = b.stats().instructions
    b.cut_power_at_instruction(instructions)
    b.run_us(100_000)
    assert not b.stats().powered
    assert 0 <= b.stats().instructions - before - instructions < 10
    b.set_power(True)
    b.run_us(1000)
    assert b.stats().powered, "one cut is one cut"


def test_a_cut_called_off_does_not_happen(board):
    b = board("flash")
    b.run_us(1000)
    b.cut_power_at_instruction(1000)
    b.cut_power_at_flash_write(0)
    b.cut_power_at_instruction(None)
    b.cut_power_at_flash_write(None)
    b.put("command", 1)
    b.run_us(400_000)
    assert b.stats().powered
    assert b.word("state") == 1
