"""A program gone wrong on the flashed image: registers are kept, the board starts anew and answers."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

import truing_protocol as tp
from support.gdb_stub import GdbStub
from support.qemu import Qemu

pytestmark = pytest.mark.qemu

# struct fault_record of the image.
FIELDS = (
    *("magic", "count", "exception", "has_frame"),
    *("r0", "r1", "r2", "r3", "r12", "lr", "pc", "xpsr"),
    *("cfsr", "hfsr", "mmfar", "bfar"),
)
MAGIC = 0xFA17ED
SP, PC = 13, 15
INTERRUPT = 28  # TIM2, which the image does not use

# str r1, [r0]; str r3, [r2]; cpsie i; b .
STORE_TWICE = struct.pack("<4H", 0x6001, 0x6013, 0xB662, 0xE7FE)
NVIC_ENABLE, NVIC_PEND = 0xE000E100, 0xE000E200
SCRATCH = 0x20000400  # far down the stack


@pytest.fixture
def qemu(image: Path) -> Iterator[Qemu]:
    with Qemu(image) as running:
        yield running


@pytest.fixture(scope="module")
def record_address(image: Path) -> int:
    with image.open("rb") as file:
        symbols = ELFFile(file).get_section_by_name(".symtab")
        (symbol,) = symbols.get_symbol_by_name("last_fault")
        return int(symbol["st_value"])


def boot_id(qemu: Qemu) -> int:
    board = qemu.connect()
    try:
        return board.request(tp.HelloRequest(tp.PROTOCOL_VERSION, tp.SCHEMA_HASH)).boot_id
    finally:
        board.close()


def provoke(qemu: Qemu, meddle: Callable[[GdbStub], None], record_address: int) -> dict[str, int]:
    """Let something go wrong in a running board; return what it kept, once it answers again."""
    before = boot_id(qemu)
    with qemu.debugger() as processor:
        assert struct.unpack("<I", processor.read_memory(record_address, 4))[0] != MAGIC
        meddle(processor)
    deadline = time.monotonic() + 10.0
    while boot_id(qemu) == before and time.monotonic() < deadline:
        time.sleep(0.05)
    assert boot_id(qemu) != before
    with qemu.debugger() as processor:
        words = struct.unpack(f"<{len(FIELDS)}I", processor.read_memory(record_address, 4 * len(FIELDS)))
    record = dict(zip(FIELDS, words, strict=True))
    assert record["magic"] == MAGIC
    assert record["count"] == 1
    return record


def test_a_jump_into_nowhere_is_recorded_with_its_address(qemu: Qemu, record_address: int) -> None:
    record = provoke(qemu, lambda processor: processor.write_register(PC, 0x30000000), record_address)
    assert record["exception"] in (3, 4, 5)  # the model decides between HardFault, MemManage and BusFault
    assert record["has_frame"] == 1
    assert record["pc"] == 0x30000000


def test_an_overflowing_stack_is_recorded_without_registers(qemu: Qemu, record_address: int) -> None:
    record = provoke(qemu, lambda processor: processor.write_register(SP, 0x20000008), record_address)
    assert record["has_frame"] == 0


def test_an_interrupt_that_nobody_expects_is_recorded_by_number(qemu: Qemu, record_address: int) -> None:
    def pend(processor: GdbStub) -> None:
        processor.write_memory(SCRATCH, STORE_TWICE)
        for register, value in enumerate((NVIC_ENABLE, 1 << INTERRUPT, NVIC_PEND, 1 << INTERRUPT)):
            processor.write_register(register, value)
        processor.write_register(PC, SCRATCH)

    record = provoke(qemu, pend, record_address)
    assert record["exception"] == 16 + INTERRUPT
