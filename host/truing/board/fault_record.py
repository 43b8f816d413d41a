"""The registers that a board kept when its program failed, and what they say."""

from __future__ import annotations

from dataclasses import dataclass

from truing_protocol import FaultRecordReply

_EXCEPTIONS = {2: "clock failure (NMI)", 3: "HardFault", 4: "MemManage", 5: "BusFault", 6: "UsageFault"}
# Where the image in slot 1 begins, which is linked for that place (firmware/stm32f405/image_places.h).
_SLOT_1 = 0x0802_0000
# Bits of CFSR, PM0214 section 4.4.10.
_REASONS = {
    0: "instruction fetched from where there is none",
    1: "data access that is forbidden",
    3: "stack lost on return from an exception",
    4: "stack lost on entry of an exception",
    8: "instruction fetched from a dead address",
    9: "data read or written at a dead address",
    10: "data written at a dead address, some instructions before",
    11: "stack lost on return from an exception",
    12: "stack lost on entry of an exception",
    16: "undefined instruction",
    17: "jump to an address without the Thumb bit",
    18: "bad return from an exception",
    19: "coprocessor that is off",
    24: "unaligned access",
    25: "division by zero",
}
_MMFAR_VALID, _BFAR_VALID = 1 << 7, 1 << 15


@dataclass(frozen=True, slots=True)
class FaultRecord:
    """Registers of the last fault of the program since power-up; None where nothing is known."""

    count: int
    exception: str
    reasons: tuple[str, ...]
    pc: int | None
    lr: int | None
    address: int | None
    cfsr: int
    hfsr: int
    registers: dict[str, int]

    @classmethod
    def from_reply(cls, reply: FaultRecordReply) -> FaultRecord | None:
        """Read the wire's words; None when there was no fault."""
        if not reply.present:
            return None
        address = None
        if reply.cfsr & _BFAR_VALID:
            address = reply.bfar
        elif reply.cfsr & _MMFAR_VALID:
            address = reply.mmfar
        known = bool(reply.has_frame)
        names = ("r0", "r1", "r2", "r3", "r12", "lr", "pc", "xpsr") if known else ()
        return cls(
            count=reply.count,
            exception=_EXCEPTIONS.get(reply.exception, f"exception {reply.exception}"),
            reasons=tuple(text for bit, text in _REASONS.items() if reply.cfsr >> bit & 1),
            pc=reply.pc if known else None,
            lr=reply.lr if known else None,
            address=address,
            cfsr=reply.cfsr,
            hfsr=reply.hfsr,
            registers={name: getattr(reply, name) for name in names},
        )

    def lines(self) -> list[str]:
        """The record as a person reads it."""
        why = ", ".join(self.reasons)
        where = f" 0x{self.address:08x}" if self.address is not None else ""
        lines = [f"{self.exception}, {self.count} since power-up" + (f": {why}{where}" if why else "")]
        if self.pc is None or self.lr is None:
            return [*lines, f"no registers; cfsr 0x{self.cfsr:08x}, hfsr 0x{self.hfsr:08x}"]
        slot = "-slot1" if self.pc >= _SLOT_1 else ""
        return [
            *lines,
            f"pc 0x{self.pc:08x}, lr 0x{self.lr:08x}, cfsr 0x{self.cfsr:08x}, hfsr 0x{self.hfsr:08x}",
            f"which line that is: arm-none-eabi-addr2line -fe build/stm32f405/firmware/truing-f405{slot}.elf "
            f"0x{self.pc:08x} 0x{self.lr:08x}",
        ]
