"""What the data cache still holds after an erase, until it is emptied or written to."""

from __future__ import annotations

OLD, OTHER, BLANK = 0xCAFE0FF0, 0x12345678, 0xFFFFFFFF


def test_the_data_cache_serves_what_was_erased_until_it_is_emptied_while_off(board):
    b = board("flash_cache")
    b.run_us(1_000_000)
    assert b.word("state") == 1
    assert b.word("stale") == OLD
    assert b.word("off") == BLANK
    assert b.word("on_again") == OLD
    assert b.word("emptied") == BLANK
    assert b.word("rewritten") == 0x5555AAAA, "a store updates the cache"
    assert b.word("beside") == OTHER
    assert b.warnings() == []


def test_emptying_the_cache_while_it_is_on_does_nothing_and_is_reported(board):
    b = board("flash_cache")
    b.run_us(10_000)
    b.put("command", 1)
    b.run_us(1_000_000)
    assert b.word("reset_while_on") == OLD
    assert b.word("emptied") == BLANK
    assert [w.text for w in b.warnings()] == ["FLASH_ACR.DCRST while the data cache is on: ignored"]


def test_a_power_cut_leaves_what_the_array_holds(board):
    b = board("flash_cache")
    b.run_us(10_000)
    b.put("command", 2)
    b.run_us(500_000)
    assert b.word("stale") == OLD
    b.set_power(False)
    assert b.read_memory(0x08004000, 4) == BLANK.to_bytes(4, "little")
