"""The STM32G474's image on a CPU whose peripherals are memory with a few ready bits.

No emulator of the chip: it shows what the image writes into which register, and that its waits end, not what
a chip would do then. The flash of bank 2 is the exception: it takes a double word once, or zeros, and erases
pages, since the parameter store is about nothing else.
"""

from __future__ import annotations

from bisect import bisect_right
from pathlib import Path
from typing import Any

import unicorn
from elftools.elf.elffile import ELFFile
from unicorn import arm_const

RCC, FLASH, PWR, TIM1, FDCAN1, SCB = 0x40021000, 0x40022000, 0x40007000, 0x40012C00, 0x40006400, 0xE000ED00
TIM17, ADC1, RNG, SYSTICK_VAL, CAN_RAM = 0x40014800, 0x50000000, 0x50060800, 0xE000E018, 0x4000A400
RCC_CR, RCC_CFGR, RCC_PLLCFGR, RCC_CSR = RCC, RCC + 0x08, RCC + 0x0C, RCC + 0x94
FLASH_ACR, FLASH_SR, FLASH_CR, FLASH_ECCR, FLASH_OPTR = (FLASH + at for at in (0, 0x10, 0x14, 0x18, 0x20))
BANK_2, PAGE = 0x0804_0000, 2048
PROGERR = 1 << 3
DBANK = 1 << 22
_MAPPED = (
    *((0x0800_0000, 0x80000), (0x1000_0000, 0x8000), (0x2000_0000, 0x20000), (0x1FFF_7000, 0x1000)),
    *((0x4000_0000, 0x30000), (0x4800_0000, 0x2000), (0x5000_0000, 0x62000), (0xE000_0000, 0x100000)),
)
_RESET = {
    RCC_CR: 0x0000_0563,
    RCC_CFGR: 0x5,
    RCC_CSR: 0x0C00_0000,
    PWR: 0x200,
    PWR + 0x80: 0x100,
    FLASH_ACR: 0x0004_0600,
    FLASH_CR: 0xC000_0000,
    FLASH_OPTR: 0xFFEF_F8AA,
    ADC1 + 0x08: 0x2000_0000,
}
_READY = {16: 17, 24: 25, 8: 10}  # RCC_CR: crystal, PLL, RC oscillator
_BACK = 0x0807_FFF0  # where a called function returns to
_INSTRUCTIONS = 5_000_000


class G474Registers:
    """One image, its registers, and all that it writes into them.

    Attributes
    ----------
    writes : function, address and value of each write to a peripheral.
    flash_errors : FLASH_SR's error bits, which ones clear.
    """

    def __init__(self, image: Path, *, crystal: bool = True) -> None:
        self.writes: list[tuple[str, int, int]] = []
        self.flash_errors = 0
        self._crystal = crystal
        self._ticks = self._captured = 0
        self._half: tuple[int, int] | None = None
        self._waiting: tuple[int, bytes] | None = None
        self._cpu: Any = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self._cpu.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M4)
        for start, size in _MAPPED:
            self._cpu.mem_map(start, size)
        self._cpu.mem_write(0x0800_0000, b"\xff" * 0x80000)
        with image.open("rb") as file:
            elf = ELFFile(file)
            symbols = list(elf.get_section_by_name(".symtab").iter_symbols())
            for segment in elf.iter_segments("PT_LOAD"):
                self._cpu.mem_write(segment["p_paddr"], segment.data())
        self.symbols = {symbol.name: int(symbol["st_value"]) for symbol in symbols}
        functions = [symbol for symbol in symbols if symbol["st_info"]["type"] == "STT_FUNC"]
        self._functions = sorted((int(each["st_value"]) & ~1, each.name) for each in functions)
        for address, value in _RESET.items():
            self.put(address, value)
        self._cpu.hook_add(unicorn.UC_HOOK_MEM_READ, self._reads, begin=0x4000_0000, end=0xE010_0000)
        self._cpu.hook_add(unicorn.UC_HOOK_MEM_WRITE, self._writes, begin=0x4000_0000, end=0xE010_0000)
        self._cpu.hook_add(unicorn.UC_HOOK_MEM_WRITE, self._programs, begin=BANK_2, end=_BACK)

    def get(self, address: int) -> int:
        """A word of memory."""
        return int.from_bytes(self._cpu.mem_read(address, 4), "little")

    def put(self, address: int, value: int) -> None:
        """Set a word of memory."""
        self._cpu.mem_write(address, (value & 0xFFFF_FFFF).to_bytes(4, "little"))

    def values(self, address: int) -> list[int]:
        """All that was written into a register, in order."""
        return [value for _, at, value in self.writes if at == address]

    def start(self) -> str:
        """Run from reset until the CPU sleeps; returns the function in which it does."""
        self._cpu.reg_write(arm_const.UC_ARM_REG_SP, self.get(0x0800_0000))
        self._cpu.emu_start(self.get(0x0800_0004) | 1, 0, 0, _INSTRUCTIONS)
        return self._function()

    def call(self, name: str, *arguments: int) -> int:
        """Call a function of the image; returns what it returns."""
        for number, value in enumerate(arguments):
            self._cpu.reg_write(getattr(arm_const, f"UC_ARM_REG_R{number}"), value)
        self._cpu.reg_write(arm_const.UC_ARM_REG_LR, _BACK | 1)
        self._cpu.emu_start(self.symbols[name] | 1, _BACK, 0, _INSTRUCTIONS)
        return int(self._cpu.reg_read(arm_const.UC_ARM_REG_R0))

    def _function(self) -> str:
        at = self._cpu.reg_read(arm_const.UC_ARM_REG_PC)
        return str(self._functions[bisect_right(self._functions, (at, "~")) - 1][1])

    def _reads(self, _cpu: object, _kind: int, address: int, _size: int, _value: int, _data: object) -> None:
        if address == SYSTICK_VAL:
            self._ticks += 40
            self.put(address, -self._ticks & 0xFF_FFFF)
        elif address == RCC_CR:
            control = self.get(address)
            for on, ready in _READY.items():
                is_ready = control >> on & 1 and (on != 16 or self._crystal)
                control = control | 1 << ready if is_ready else control & ~(1 << ready)
            self.put(address, control)
        elif address == RCC_CFGR:  # the clock is switched at once
            self.put(address, self.get(address) & ~12 | (self.get(address) & 3) << 2)
        elif address == TIM17 + 0x10:  # an edge of the crystal over 32 and 8...
            self.put(address, 2)
        elif address == TIM17 + 0x34:  # ...each 171 periods of 16 MHz: 24 MHz
            self._captured = (self._captured + 171) & 0xFFFF
            self.put(address, self._captured)
        elif address == ADC1 + 0x08:  # a calibration is over
            self.put(address, self.get(address) & ~(1 << 31))
        elif address == RNG + 0x04:
            self.put(address, 1)
        elif address == FLASH_SR:
            self._finish()
            self.put(address, self.flash_errors)

    def _writes(self, _cpu: object, _kind: int, address: int, _size: int, value: int, _data: object) -> None:
        self.writes.append((self._function(), address, value & 0xFFFF_FFFF))
        if address == FLASH_SR:
            self.flash_errors &= ~value
        elif address == FLASH_CR and value & (1 << 16 | 1 << 11 | 2) == 1 << 16 | 1 << 11 | 2:
            self._waiting = (BANK_2 + (value >> 3 & 0x7F) * PAGE, b"\xff" * PAGE)

    def _programs(self, _cpu: object, _kind: int, address: int, size: int, value: int, _data: object) -> None:
        """Two halves, the lower first; what flash then holds lies there when its status is read."""
        assert size == 4
        assert self.get(FLASH_CR) & 1, "flash is written without PG"
        if address % 8 == 0:
            held = bytes(self._cpu.mem_read(address, 8))
            self._half = (int.from_bytes(held, "little"), value & 0xFFFF_FFFF)
            return
        assert self._half is not None, "the upper half of a double word is written first"
        held_before, lower = self._half
        wanted = lower | (value & 0xFFFF_FFFF) << 32
        takes = held_before == 2**64 - 1 or wanted == 0
        if not takes:
            self.flash_errors |= PROGERR
        self._waiting = (address - 4, (wanted if takes else held_before).to_bytes(8, "little"))
        self._half = None

    def _finish(self) -> None:
        if self._waiting is not None:
            self._cpu.mem_write(*self._waiting)
            self._waiting = None
