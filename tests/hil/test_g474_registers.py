"""What the STM32G474's image writes into which register, on a CPU whose peripherals are memory."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.g474_registers import (
    BANK_2,
    CAN_RAM,
    DBANK,
    FDCAN1,
    FLASH_ACR,
    FLASH_ECCR,
    FLASH_OPTR,
    PWR,
    RCC_CFGR,
    RCC_PLLCFGR,
    SCB,
    TIM1,
    G474Registers,
)

BRAKED, MAIN_OUTPUT = 0x3400, 0x8000  # BDTR: OSSI, BKE, BKP; MOE
GPIOA_MODER, GPIOC_MODER = 0x4800_0000, 0x4800_0800
COMMIT = 24  # offset of a slot's commit word
SLOT_SIZE = 32 << 10  # in flash
ERASED = 0xFFFF_FFFF


@pytest.fixture
def started(g474_image: Path) -> G474Registers:
    """After its start, with the crystal."""
    board = G474Registers(g474_image)
    assert board.start() == "main"
    return board


def test_start_up_brakes_both_bridges_before_it_waits_for_a_clock(started: G474Registers) -> None:
    order = [address for _, address, _ in started.writes]
    first_clock = order.index(RCC_CFGR)
    assert started.values(TIM1 + 0x04)[0] == 0x5500  # idle levels of all four channels: high, high
    assert started.values(TIM1 + 0x44)[:2] == [BRAKED, BRAKED | MAIN_OUTPUT]
    handed_over = next(
        number
        for number, (_, address, value) in enumerate(started.writes)
        if address == GPIOC_MODER and value & 0xFF == 0xAA
    )
    assert order.index(TIM1 + 0x44) < handed_over < first_clock
    compared = [started.get(TIM1 + 0x34 + 4 * channel) for channel in range(4)]
    assert compared == [started.get(TIM1 + 0x2C) + 1] * 4  # beyond the period: high throughout
    assert started.get(TIM1 + 0x2C) + 1 == 170_000_000 // 20_000


def test_it_runs_from_the_crystal_at_170_mhz_in_range_1_boost(started: G474Registers) -> None:
    assert started.values(RCC_PLLCFGR) == [3 | 5 << 4 | 85 << 8 | 1 << 24]
    assert started.get(RCC_CFGR) & 0xF3 == 3  # PLL, undivided
    halved = [value & 0xF3 for value in started.values(RCC_CFGR)]
    assert halved[-3:] == [0x81, 0x83, 0x03]  # half speed on the way
    assert started.get(PWR + 0x80) == 0
    assert started.get(FLASH_ACR) & 0xF == 4
    assert started.get(FLASH_ACR) & 1 << 18  # the debugger's bit, which reset sets, is still there


def test_without_a_crystal_it_runs_from_the_rc_oscillator_and_leaves_the_bus_alone(g474_image: Path) -> None:
    board = G474Registers(g474_image, crystal=False)
    assert board.start() == "main"
    assert board.values(RCC_PLLCFGR) == [2 | 3 << 4 | 82 << 8 | 1 << 24]
    board.put(0x2000_1000, 0x0601_0600)
    board.call("hal_can_start", 1_000_000, 0x2000_1000)
    assert not [address for _, address, _ in board.writes if FDCAN1 <= address < FDCAN1 + 0x400]
    assert board.get(GPIOA_MODER) >> 22 & 0xF == 0  # PA11, PA12


def test_it_joins_the_bus_with_classic_frames_and_one_filter_of_two_ids(started: G474Registers) -> None:
    started.put(0x2000_1000, 0x0610_0600)
    started.writes.clear()
    started.call("hal_can_start", 1_000_000, 0x2000_1000)
    assert started.values(FDCAN1 + 0x18) == [1, 3, 0]  # INIT; INIT and CCE; on the bus
    assert started.values(FDCAN1 + 0x1C) == [4 << 25 | 0 << 16 | 17 << 8 | 4]  # 1 + 18 + 5 quanta of 24 MHz
    assert started.values(FDCAN1 + 0x80) == [1 << 16 | 2 << 4 | 2 << 2 | 3]
    assert started.values(CAN_RAM) == [1 << 30 | 1 << 27 | 0x600 << 16 | 0x610]
    order = [address for _, address, _ in started.writes]
    assert order.index(FDCAN1 + 0x80) > order.index(FDCAN1 + 0x18)


def test_a_frame_leaves_by_the_buffer_that_is_free_and_one_is_taken_from_its_place(
    started: G474Registers,
) -> None:
    frame = 0x2000_1000  # struct hal_can_frame: id, length, bytes from 3 on
    started.put(frame, 0x0610_0600)
    started.call("hal_can_start", 1_000_000, frame)
    started.put(FDCAN1 + 0xC4, 1 << 16 | 2)  # two buffers are free, the next is 1
    started.put(frame, 0x01 << 24 | 5 << 16 | 0x581)
    started.put(frame + 4, 0x0504_0302)
    started.call("hal_can_write", frame)
    element = CAN_RAM + 0x278 + 18 * 4
    assert [started.get(element + at) for at in (0, 4, 8)] == [0x581 << 18, 5 << 16, 0x0403_0201]
    assert started.get(element + 12) & 0xFF == 0x05
    assert started.get(FDCAN1 + 0xCC) == 1 << 1
    place = CAN_RAM + 0xB0 + 2 * 18 * 4
    for at, word in enumerate((0x600 << 18, 3 << 16, 0x00CC_BBAA, 0)):
        started.put(place + 4 * at, word)
    started.put(FDCAN1 + 0x50, 1)  # IR: a frame has come...
    started.put(FDCAN1 + 0x90, 2 << 8 | 1)  # ...into element 2
    assert not started.call("hal_can_peek", frame)
    started.call("FDCAN1_IT0_Handler")
    assert started.get(FDCAN1 + 0x94) == 2
    assert started.call("hal_can_peek", frame)
    assert started.get(frame) == 0xAA << 24 | 3 << 16 | 0x600
    assert started.get(frame + 4) & 0xFFFF == 0xCCBB


def test_an_effort_is_a_share_of_the_period_and_the_rest_of_it_brakes(started: G474Registers) -> None:
    started.put(0x2000_1000, (-5000 & 0xFFFF) << 16 | 2500)
    started.call("hal_drive", 0x2000_1000)
    assert [started.get(TIM1 + 0x34 + 4 * channel) for channel in range(4)] == [8500, 6375, 4250, 8500]


def test_a_word_of_the_store_is_written_once_and_cleared_at_any_time(started: G474Registers) -> None:
    assert started.call("hal_store_program", 1, COMMIT, 0x5AA5_C33C)
    place = BANK_2 + SLOT_SIZE + 2 * COMMIT
    assert [started.get(place), started.get(place + 4)] == [0x5AA5_C33C] * 2
    assert not started.call("hal_store_program", 1, COMMIT, 0x1AA5_C33C)
    assert started.flash_errors == 0  # it was not even tried
    started.call("hal_store_read", 1, COMMIT - 1, 0x2000_1000, 6)
    assert started.get(0x2000_1000) == 0xA5C3_3CFF
    assert started.get(0x2000_1004) & 0xFFFF == 0xFF5A
    assert started.call("hal_store_program", 1, COMMIT, 0)
    assert [started.get(place), started.get(place + 4)] == [0, 0]


def test_an_erase_takes_its_slot_and_not_the_other(started: G474Registers) -> None:
    for slot in (0, 1):
        for offset in (0, 16380):
            assert started.call("hal_store_program", slot, offset, 0x1234_5678)
    assert started.call("hal_store_erase", 1, 0x2000_1000)
    first, second = (
        [started.get(BANK_2 + slot * SLOT_SIZE + offset) for offset in (0, SLOT_SIZE - 8)] for slot in (0, 1)
    )
    assert first == [0x1234_5678] * 2
    assert second == [ERASED] * 2
    assert started.get(TIM1 + 0x44) & MAIN_OUTPUT  # the bridges were held meanwhile, and follow again
    assert BRAKED in started.values(TIM1 + 0x44)[-2:]


def test_one_bank_of_flash_refuses_a_save_and_erases_nothing(started: G474Registers) -> None:
    assert started.call("hal_store_program", 0, 0, 0x1234_5678)
    started.put(FLASH_OPTR, started.get(FLASH_OPTR) & ~DBANK)
    assert not started.call("hal_store_erase", 0, 0x2000_1000)
    assert not started.call("hal_store_program", 0, 4, 0x1234_5678)
    assert started.get(BANK_2) == 0x1234_5678


def test_two_wrong_bits_are_a_fault_but_where_a_parameter_is_read(started: G474Registers) -> None:
    two_wrong_bits, reset = 1 << 31, 0x05FA_0004
    started.put(FLASH_ECCR, two_wrong_bits)
    started.put(started.symbols["store_reads"], 1)
    started.writes.clear()
    started.call("NMI_Handler")
    assert started.values(FLASH_ECCR) == [two_wrong_bits]
    assert reset not in started.values(SCB + 0x0C)
    started.put(started.symbols["store_reads"], 0)
    started.call("NMI_Handler")  # does not return: it waits for the reset
    assert reset in started.values(SCB + 0x0C)
    assert started.values(TIM1 + 0x44)[-1] == BRAKED
