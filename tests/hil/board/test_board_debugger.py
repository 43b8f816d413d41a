"""What a debugger that halts the core stops with it, by the bits of DBGMCU (RM0090 section 38.16)."""

from __future__ import annotations

import pytest

from support.board_registers import Registers

APB1_FZ, APB2_FZ = 0xE0042008, 0xE004200C
AHB1ENR, APB1ENR, APB2ENR = 0x40023830, 0x40023840, 0x40023844
DEMCR, DWT_CTRL, DWT_CYCCNT, SYST_CVR = 0xE000EDFC, 0xE0001000, 0xE0001004, 0xE000E018
GPIOB_MODER, GPIOB_AFRL = 0x40020400, 0x40020420
TIM3, CNT = 0x40000400, 0x24
# Where each lies, and its bit: the same for its clock and for its freezing.
APB1_TIMERS = {0x40000000: 0, 0x40000C00: 3, 0x40001000: 4, 0x40001800: 6, 0x40001C00: 7, 0x40002000: 8}
APB2_TIMERS = {0x40014000: 16, 0x40014400: 17, 0x40014800: 18}
CASES = [
    *((base, bit, APB1ENR, APB1_FZ) for base, bit in APB1_TIMERS.items()),
    *((base, bit, APB2ENR, APB2_FZ) for base, bit in APB2_TIMERS.items()),
]


@pytest.fixture
def r(board):
    b = board("dma")
    b.run_us(5_000)
    return Registers(b)


def halted_us(r, span: int, registers: tuple[int, ...]) -> list[tuple[int, int]]:
    """Halt the core for so long; each register as the debugger reads it at the beginning and at the end."""
    r.board.set_halted(True)
    before = [r.board.read_register(address) for address in registers]
    r.board.run_us(span)
    after = [r.board.read_register(address) for address in registers]
    r.board.set_halted(False)
    return list(zip(before, after, strict=True))


@pytest.mark.parametrize(("base", "bit", "clock", "freeze"), CASES)
def test_a_timer_stops_where_its_bit_says_so_and_goes_on_from_there(r, base, bit, clock, freeze):
    r[clock] |= 1 << bit
    r[base] = 1
    ((before, after),) = halted_us(r, 50, (base + CNT,))
    assert before != after, "without its bit it counts on"
    r[freeze] = 1 << bit
    ((before, after),) = halted_us(r, 50, (base + CNT,))
    assert before == after
    assert r[base + CNT] != before, "and goes on with the core"
    assert r.board.warnings() == []


@pytest.mark.parametrize("frozen", [False, True])
def test_an_encoder_that_is_turned_meanwhile(r, frozen):
    r[AHB1ENR] |= 1 << 1
    r[APB1ENR] |= 1 << 1
    r[GPIOB_AFRL] = 2 << 16 | 2 << 20
    r[GPIOB_MODER] = r[GPIOB_MODER] & ~0xF00 | 0xA00
    r[TIM3 + 0x08], r[TIM3 + 0x18], r[TIM3 + 0x2C] = 3, 0x0101, 0xFFFF
    r[TIM3] = 1
    r[APB1_FZ] = 1 << 1 if frozen else 0
    r.board.turn_by_hand(0, 0.05, 0.01)
    assert r[TIM3 + CNT] > 50
    r.board.set_halted(True)
    before = r.board.read_register(TIM3 + CNT)
    r.board.turn_by_hand(0, 0.05, 0.01)
    turned = r.board.read_register(TIM3 + CNT) - before
    assert turned == 0 if frozen else turned > 50


def test_the_core_s_own_counters_stop_with_it(r):
    r[DEMCR] = 1 << 24
    r[DWT_CTRL] = 1
    (cycles, tick) = halted_us(r, 5_000, (DWT_CYCCNT, SYST_CVR))
    assert cycles[0] == cycles[1]
    assert tick[0] == tick[1]
    assert r[DWT_CYCCNT] - cycles[0] < 168 * 100


def test_what_does_not_stop_here_but_on_the_chip_is_reported(r):
    r[APB1_FZ] = 1 << 25  # CAN1
    assert [w.text for w in r.board.warnings()] == [
        "DBGMCU: only timers and IWDG stop while the core is halted"
    ]
