"""The interpreter of the virtual CPU does what the engine does, instruction by instruction."""

from __future__ import annotations

import random
import struct

import pytest

# Fixed bits and random bits of encodings, as ARMv7-M's Architecture Reference Manual has them (A5.2, A5.3).
NARROW = (
    (0x0000, 0x3FFF),
    (0x4000, 0x03FF),
    (0x4400, 0x027F),
    (0xB200, 0x00FF),
    (0xBA00, 0x007F),
    (0xA000, 0x0FFF),
)
WIDE = (
    (0xEA000000, 0x00FF7FFF),  # data processing, shifted register
    (0xEB000000, 0x00FF7FFF),
    (0xF0000000, 0x04FF7FFF),  # modified constant
    (0xF1000000, 0x04FF7FFF),
    (0xF2000000, 0x05FF7FFF),  # plain constant, fields
    (0xF3400000, 0x009F7FDF),
    (0xFA00F000, 0x007F0F0F),  # shifts by a register
    (0xFA0FF080, 0x00500F3F),  # extensions, reversals
    (0xFA00F080, 0x00FF0F3F),
    (0xFB000000, 0x00FFFFFF),  # products
    (0xFB90F0F0, 0x002F0F0F),  # quotients
    (0xFBA00000, 0x007FFF0F),
    (0xEE200A00, 0x005FF0EF),  # FP arithmetic
    (0xEE800A00, 0x004FF0AF),
    (0xEEB00A00, 0x004FF00F),
    (0xEEB00A40, 0x004DF0AF),
    (0xEEB80A40, 0x0040F0AF),
    (0xEEBC0AC0, 0x0041F02F),
    (0xEE000A10, 0x001FF080),
    (0xEEF10A10, 0x0000F000),
    (0xF3EF8000, 0x00000F1F),  # special registers
    (0xF3808810, 0x000F0003),
)
NARROW_MEMORY = ((0x5000, 0x0FFF), (0x6000, 0x1FFF), (0x8000, 0x1FFF), (0xB400, 0x00FF), (0xC000, 0x0FFF))
WIDE_MEMORY = (
    (0xF8000000, 0x01FFFFFF),  # loads and stores
    (0xF8C00000, 0x003FF00F),
    (0xF8500C00, 0x002FF3FF),
    (0xE8400000, 0x01BFFFFF),
    (0xE8800000, 0x013F1FFF),
    (0xEC000A00, 0x01BFF11F),  # of FP registers
    (0xED000A00, 0x00DFF1FF),
)
SRAM, FLASH = 0x20008000, 0x08000000
FLOATS = (0.0, -0.0, 1.0, -1.5, 3.7e4, 2.0**24 + 2, 1e-20, 1e-38, 3e38, 5e9, float("inf"), float("nan"))
INSTRUCTIONS = 24


def _instruction(random_: random.Random, memory_share: float) -> bytes:
    kind = random_.random()
    if kind < 0.08:
        return struct.pack("<H", 0xBF00 | random_.randrange(14) << 4 | random_.randrange(1, 16))  # IT
    if kind < 0.14:  # a short way forward, if at all
        branches = (
            0xD000 | random_.randrange(14) << 8,
            0xB100 | random_.getrandbits(1) << 11 | random_.randrange(8),
        )
        return struct.pack("<H", random_.choice(branches))
    memory = random_.random() < memory_share
    if kind < 0.5:
        fixed, free = random_.choice(NARROW_MEMORY if memory else NARROW)
        return struct.pack("<H", fixed | random_.getrandbits(16) & free)
    fixed, free = random_.choice(WIDE_MEMORY if memory else WIDE)
    word = fixed | random_.getrandbits(32) & free
    return struct.pack("<HH", word >> 16, word & 0xFFFF)


def _word(random_: random.Random) -> int:
    """A register's content: an address more often than not, so that loads and stores meet memory."""
    kind = random_.random()
    if kind < 0.6:
        return SRAM + random_.randrange(-0x1000, 0x1000) * random_.choice((1, 2, 4, 4, 4))
    if kind < 0.7:
        return random_.choice((FLASH + 64, 0x10000100, 0x40020014, 0xE000E100, 0x22000000 + 64))
    return random_.choice((0, 1, 31, 32, 33, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, random_.getrandbits(32)))


def _fp_word(random_: random.Random) -> int:
    if random_.random() < 0.3:
        return random_.getrandbits(32)
    return struct.unpack("<I", struct.pack("<f", random_.choice(FLOATS) * random_.choice((1, 1, 0.3))))[0]


def _program(seed: int, keep: int, code: int) -> tuple[bytes, bytes]:
    """The code from its place within a page on, and the registers it begins with."""
    random_ = random.Random(seed)
    begin = 2 * random_.randrange(512)
    memory_share = random_.choice((0.0, 0.1, 0.5))
    body = b"".join(_instruction(random_, memory_share) for _ in range(INSTRUCTIONS))
    body += struct.pack("<HHHHI", 0xBF00, 0xBF00, 0xF8DF, 0xF000, keep | 1)  # ldr pc, =keep
    if (begin + len(body)) % 4 != 0:
        body = struct.pack("<H", 0xBF00) + body
    text = b"\x00\xbf" * (begin // 2) + body
    words = [_fp_word(random_) for _ in range(32)]
    words += [random_.getrandbits(5) << 27, *(_word(random_) for _ in range(12)), begin]
    assert len(text) <= 2048, code
    return text.ljust(2048, b"\x00"), struct.pack(f"<{len(words)}I", *words)


def _outcome(board, text: bytes, seeds: bytes, engine_only: bool) -> tuple[object, ...]:
    board.set_power(False)
    board.set_engine_only(engine_only)
    board.write_flash(board.symbol("code")[0], text)
    board.write_flash(board.symbol("seeds")[0], seeds)
    before = board.stats()
    board.set_power(True)
    board.run_us(150)
    memory = board.read_memory(0x20000000, 0x20000), board.read_memory(0x10000000, 0x10000)
    after = board.stats()
    spent = tuple(
        getattr(after, name) - getattr(before, name) for name in ("instructions", "registers", "interrupts")
    )
    return memory, spent, after.locked_up


def _differs(one, other, seed: int) -> bool:
    program = _program(seed, one.symbol("keep")[0], one.symbol("code")[0])
    return _outcome(one, *program, engine_only=False) != _outcome(other, *program, engine_only=True)


def test_random_code_leaves_the_same_registers_memory_and_cycles(board):
    one, other = board("random_code"), board("random_code")
    # Beyond the first thousand: zero divided by infinity; IT blocks before a fault.
    seeds = (*range(1000), 50277, 1123, 2979, 5271, 14659)
    different = [seed for seed in seeds if _differs(one, other, seed)]
    if different:
        # The engine that is compared with, not ours, errs in about one process of seventy. Its lookaside
        # buffer changes size by the host's clock, which may be why. What differs on fresh boards too is ours.
        one, other = board("random_code"), board("random_code")
        again = [seed for seed in seeds if _differs(one, other, seed)]
        different = [seed for seed in different if seed in again]
    assert different == []


@pytest.mark.parametrize("image", ["it_blocks", "fp", "priorities", "faults", "ram_code"])
def test_an_image_runs_alike_on_both(board, image):
    one, other = board(image), board(image)
    other.set_engine_only(True)
    for each in (one, other):
        each.run_us(3000)
    assert one.read_memory(0x20000000, 0x20000) == other.read_memory(0x20000000, 0x20000)
    assert one.trace_hash() == other.trace_hash()
    assert one.stats() == other.stats()
