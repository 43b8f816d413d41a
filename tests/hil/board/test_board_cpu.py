"""The virtual CPU takes, nests, chains and leaves exceptions as the Cortex-M4 does."""

from __future__ import annotations


def test_interrupts_nest_and_chain_in_the_order_of_their_priorities(board):
    b = board("priorities")
    b.run_us(2000)
    assert b.word("done") == 1, b.warnings()
    marks = b.words("marks", b.word("mark_count"))
    nested = [1, 100, 120, 121, 101, 102, 110, 130, 140, 2]
    supervisor = [150, 3]
    # PRIMASK: both wait, interrupt 1 comes first although it was pended last.
    masked = [4, 110, 130, 5]
    # BASEPRI 0x60 holds interrupt 3 (0x80) back, not interrupt 1 (0x40).
    based = [6, 110, 7, 130, 8]
    # PRIGROUP 7: interrupt 2 is more urgent than 0 but waits for it; it is then the first of those waiting.
    grouped = [100, 101, 102, 120, 121, 110, 130, 140, 9]
    assert marks == nested + supervisor + masked + based + grouped
    assert b.stats().tail_chains >= 8


def test_fp_registers_and_flags_survive_interrupts_that_use_them(board):
    b = board("fp")
    b.run_us(100_000)
    assert b.word("ticks") > 3000
    assert b.word("rounds") > 1000
    assert (b.word("wrong"), b.word("wrong_flags")) == (0, 0)


def test_it_blocks_give_the_same_result_wherever_an_interrupt_falls(board):
    b = board("it_blocks")
    b.run_us(500_000)
    assert b.word("ticks") > 20_000
    assert b.word("rounds") > 1_000
    assert b.word("wrong") == 0
    assert b.word("pages_wrong") == 0


def test_a_bus_fault_names_its_address_and_its_handler_can_repair_it(board):
    b = board("faults")
    b.run_us(100)
    b.put("command", 1)
    b.run_us(5000)
    assert b.word("stray") == 0
    count, cfsr, bfar, pc, xpsr, _ = b.words("bus")
    assert count == 2
    assert cfsr == 1 << 9 | 1 << 15  # PRECISERR, BFARVALID
    assert bfar == 0x60000000
    assert b.word("value") == 0x12345678
    # The second one lay inside an IT block: its condition went with the frame, and the block went on.
    assert pc == b.symbol("bad_load_in_it")[0]
    assert xpsr & 0x0600FC00 != 0
    assert b.word("in_it") == 3


def test_an_undefined_instruction_and_a_sleeping_fpu_are_usage_faults(board):
    b = board("faults")
    b.run_us(100)
    b.put("command", 1)
    b.run_us(5000)
    assert b.word("done") == 1
    assert b.words("usage")[0] == 2
    assert b.word("after_udf") == 1
    assert b.words("usage")[1] == 1 << 19  # NOCP was the last
    assert b.word("fp_off_pc_good") == 1


def test_a_fault_without_its_own_handler_becomes_a_hard_fault(board):
    b = board("faults")
    b.run_us(100)
    b.put("command", 3)
    b.run_us(5000)
    count, cfsr, bfar, pc, _, hfsr = b.words("hard")
    assert (count, hfsr, bfar) == (1, 1 << 30, 0x60000000)
    assert cfsr == 1 << 9 | 1 << 15
    assert pc == b.symbol("bad_load")[0]
    assert b.word("done") == 1
    assert b.word("value") == 0x12345678


def test_a_fault_in_the_hard_fault_handler_locks_the_core_up(board):
    b = board("faults")
    b.run_us(100)
    b.put("command", 2)
    b.run_us(5000)
    assert b.stats().locked_up
    assert any("locked up" in w.text for w in b.warnings())


def test_a_chip_with_erased_flash_locks_up_and_drives_no_pin(board):
    b = board("faults")
    b.write_flash(0x08000000, b"\xff" * 0x4000)
    b.power_cycle()
    b.run_us(1000)
    assert b.stats().locked_up
    assert b.bridge(0) == (-1.0, -1.0)


def test_systick_ticks_every_millisecond_of_the_core_clock(board):
    b = board("peripherals")
    b.run_us(5000)
    before = b.words("get")[0]
    b.run_us(1_000_000)
    assert b.words("get")[0] - before == 1000
    assert abs(b.words("get")[1] - 168_000) < 100


def test_the_books_tell_what_each_exception_costs(board):
    b = board("fp")
    b.run_us(50_000)
    tick = b.cost(15)
    assert tick.activations == b.word("ticks")
    # 24 instructions and the return, give or take what the compiler puts around them.
    assert 20 <= tick.worst_instructions <= 40
    assert tick.instructions <= tick.activations * tick.worst_instructions
    stats = b.stats()
    assert stats.instructions == sum(cost.instructions for cost in b.costs().values())
    assert stats.cycles == stats.sleep_cycles + sum(cost.cycles for cost in b.costs().values())


def test_code_in_sram_runs_and_what_is_written_over_it_runs_next(board):
    b = board("ram_code")
    b.run_us(2000)
    assert b.words("results") == [1, 2, 3, 4]


def test_bit_aliases_reach_one_bit_of_sram(board):
    b = board("ram_code")
    b.run_us(2000)
    assert b.words("bits") == [1, 1 << 9, 0x47702001]


def test_code_in_ccm_is_an_instruction_bus_fault(board):
    b = board("ram_code")
    b.run_us(2000)
    assert b.word("faulted") == 1 << 8  # IBUSERR
