"""What the image takes of the chip, each figure beside its limit and beside the committed table.

``budgets.py`` fails when a limit is passed, or when ``firmware/BUDGETS.md`` is not what is measured: a change
shows its cost. ``budgets.py --update`` writes the table.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from elftools.elf.elffile import ELFFile

import stack_depth
from support.busy_board import LOG_RATE_HZ, SYSTICK, Costs, measure

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build" / "stm32f405"
IMAGE = BUILD / "firmware" / "truing-f405.elf"
USB_BUILD = ROOT / "build" / "stm32f405-usb"
USB_IMAGE = USB_BUILD / "firmware" / "truing-f405-usb.elf"
G474_BUILD = ROOT / "build" / "stm32g474"
G474_IMAGE = G474_BUILD / "firmware" / "truing-g474.elf"
FIRMWARE = ROOT / "firmware"
TABLE = ROOT / "firmware" / "BUDGETS.md"
DIGITS = 3

TICK_US = 1000


@dataclass(frozen=True)
class Chip:
    """What a chip has, and what of it an image may take.

    Attributes
    ----------
    folder : its room in firmware/, and of its build.
    vectors, code : name of that part of flash, its size, why no more.
    """

    folder: str
    code_start: int
    vectors: tuple[str, int, str]
    code: tuple[int, str]
    sram: int
    ccm: int


F405 = Chip(
    folder="stm32f405",
    code_start=0x0800C000,
    vectors=("loader", 16 * 1024, "sector 0; parameters follow"),
    code=(80 * 1024, "a slot: sectors 3 and 4"),
    sram=128 * 1024,
    ccm=64 * 1024,
)
G474 = Chip(
    folder="stm32g474",
    code_start=0x08000800,
    vectors=("page 0", 2 * 1024, "the page; code follows"),
    code=(80 * 1024, "the same as for the STM32F405"),
    sram=96 * 1024,
    ccm=32 * 1024,
)
SRAM_START, CCM_START = 0x20000000, 0x10000000


WAITS = ", with wait states"


@dataclass(frozen=True)
class Budget:
    """One figure; `limit` None: it is there to be compared with the table only.

    Attributes
    ----------
    waits : the same with flash wait states counted, for what depends on them.
    """

    name: str
    value: float
    unit: str
    limit: float | None
    why: str
    waits: float | None = None

    @property
    def worst(self) -> float:
        """The figure that the limit applies to."""
        return self.value if self.waits is None else max(self.value, self.waits)

    def figures(self) -> list[tuple[str, float]]:
        """Name and value of each of the two."""
        waits = [] if self.waits is None else [(self.name + WAITS, self.waits)]
        return [(self.name, self.value), *waits]


def rounded(value: float) -> float:
    """To the digits of the table: what is lost is no change worth a line."""
    return float(f"{value:.{DIGITS}g}")


def exact(value: float) -> str:
    return f"{value:,.10g}".replace(",", " ")


def text(value: float) -> str:
    return exact(rounded(value))


def memory(image: Path, chip: Chip) -> list[Budget]:
    used = dict.fromkeys(("vectors", "code", "SRAM", "CCM"), 0)
    memories = {"SRAM": (SRAM_START, chip.sram), "CCM": (CCM_START, chip.ccm)}
    with image.open("rb") as file:
        elf = ELFFile(file)
        for segment in elf.iter_segments("PT_LOAD"):
            where = "code" if segment["p_paddr"] >= chip.code_start else "vectors"
            used[where] += segment["p_filesz"]
        for section in elf.iter_sections():
            for name, (start, size) in memories.items():
                if section["sh_flags"] & 2 and 0 <= section["sh_addr"] - start < size:
                    used[name] += section["sh_size"]
    place, room, why = chip.vectors
    return [
        Budget(f"flash, {place}", used["vectors"], "B", room, why),
        Budget("flash, code and constants", used["code"], "B", *chip.code),
        Budget("SRAM", used["SRAM"], "B", chip.sram, "what there is"),
        Budget("CCM", used["CCM"], "B", chip.ccm, "what there is"),
    ]


def stack(image_path: Path, build: Path, chip: Chip, seen: int | None = None) -> list[Budget]:
    image = stack_depth.Image(image_path, build)
    worst = stack_depth.worst(image, FIRMWARE / "stm32", FIRMWARE / chip.folder)
    reserved = image.values["__stack_top"] - image.values["__stack_limit"]
    below = worst.size - sum(level.size for level in worst.levels)
    print("deepest stack, by call graph:")
    for level in worst.levels:
        print(f"  {level.size:5} B  {' > '.join(level.path)}")
    print(
        f"  {below:5} B  registers that {len(worst.levels) - 1} nested exceptions stack, FP context included"
    )
    names = {"Reset_Handler": "main loop", "SysTick_Handler": "control tick and its level"}
    return [
        *(
            Budget(f"stack, {names[level.path[0]]}", level.size, "B", None, "")
            for level in worst.levels
            if level.path[0] in names
        ),
        Budget("stack, all nested", worst.size, "B", reserved / 2, f"half of the {reserved} B reserved"),
        *([] if seen is None else [Budget("stack, deepest seen", seen, "B", worst.size, _SEEN)]),
    ]


_SEEN = "the call graph's answer"


@dataclass(frozen=True)
class Allowance:
    """Instructions and time that a handler may take, and why no more."""

    name: str
    instructions: int
    us: float
    why: str


HANDLERS = {
    "SysTick_Handler": Allowance("control tick", 10_000, 100, "a tenth of the tick, at 1.7 cycles each"),
    "PVD_Handler": Allowance("supply sags, PVD", 100, 1, "1 us, at 1.7 cycles each"),
    "Serial_Handler": Allowance("serial port, idle line", 100, 1, "1 us, at 1.7 cycles each"),
    "SerialStream_Handler": Allowance("serial port, run sent", 100, 1, "the same; a byte lasts 10.8 us"),
    "CAN1_TX_Handler": Allowance("CAN, sent", 500, 3, "3 us, at 1 cycle each; the shortest frame takes 47"),
    "CAN1_RX0_Handler": Allowance("CAN, received", 500, 3, "the same; three frames wait in hardware"),
    "CAN1_SCE_Handler": Allowance("CAN, errors", 500, 3, "the same; once each time the bus is left"),
    "TIM3_Handler": Allowance("edge, TIM3", 100, 1, "1 us, at 1.7 cycles each"),
    "TIM4_Handler": Allowance("edge, TIM4", 100, 1, "1 us, at 1.7 cycles each"),
}
FIRST_INTERRUPT = 16


def times(image_path: Path, build: Path, costs: Costs, with_waits: Costs) -> list[Budget]:
    image = stack_depth.Image(image_path, build)
    per_us = costs.cpu_hz / 1e6
    rows: list[Budget] = []
    for number, handler in sorted(image.vectors().items()):
        if handler in stack_depth.FAULTS or handler == "Reset_Handler":
            continue
        allowed = HANDLERS.get(handler)
        if allowed is None:
            sys.exit(f"{handler} has no allowance; tests/budgets.py gives it one")
        cost, waits = costs.handlers.get(number), with_waits.handlers.get(number)
        if cost is None or waits is None:
            sys.exit(f"{handler} never ran; tests/support/busy_board.py must make it")
        rows += [
            Budget(
                f"{allowed.name}, worst",
                cost.worst_instructions,
                "instructions",
                allowed.instructions,
                allowed.why,
            ),
            Budget(
                f"{allowed.name}, worst",
                cost.worst_cycles / per_us,
                "us",
                allowed.us,
                "the same",
                waits.worst_cycles / per_us,
            ),
        ]
        if handler == "SysTick_Handler":
            mean = cost.instructions / cost.activations
            rows.append(Budget(f"{allowed.name}, mean", mean, "instructions", None, ""))
    return rows


def loads(costs: Costs, with_waits: Costs) -> list[Budget]:
    def both(
        name: str, unit: str, figure: Callable[[Costs], float], limit: float | None = None, why: str = ""
    ) -> Budget:
        return Budget(name, figure(costs), unit, limit, why, figure(with_waits))

    most, some = "leaves nine tenths to the rest", "a third stays in hand"
    return [
        both("load, ticks at rest", "%", lambda c: 100 * c.resting.ticks, 10, most),
        both("load, all at rest", "%", lambda c: 100 * c.resting.awake, 20, "the core sleeps for the rest"),
        both("load, ticks when driving", "%", lambda c: 100 * c.busy.ticks, 10, most),
        both("load, driving, line and bus full", "%", lambda c: 100 * c.busy.awake, 70, some),
        both("bits on the bus meanwhile", "%", lambda c: 100 * c.bus_share),
        both(
            "power-up to bridges braked",
            "ms",
            lambda c: c.braked_after_us / 1000,
            15,
            "until then they coast",
        ),
        both(
            "power-up to first answer",
            "ms",
            lambda c: c.answers_after_us / 1000,
            20,
            "a host may connect at once",
        ),
    ]


# What the wiring of a board decides; all else is the same code on the same chip.
OF_EACH_BOARD = {
    *("flash, sector 0", "flash, code and constants", "SRAM", "stack, all nested", "stack, deepest seen"),
    *("control tick, worst", "supply sags, PVD, worst", "edge, TIM3, worst", "edge, TIM4, worst"),
    *("load, driving, line and bus full", "power-up to bridges braked", "power-up to first answer"),
}


def of_board(image_path: Path, build: Path, costs: Costs, with_waits: Costs) -> list[Budget]:
    """All figures of one board's image."""
    return [
        *memory(image_path, F405),
        *stack(image_path, build, F405, costs.stack),
        *times(image_path, build, costs, with_waits),
        *loads(costs, with_waits),
    ]


def second_board() -> list[Budget]:
    """Those that the wiring decides, of the board whose USB pins are free."""
    costs, waiting = (measure(USB_IMAGE, flash_waits=waits) for waits in (False, True))
    rows = of_board(USB_IMAGE, USB_BUILD, costs, waiting)
    return [replace(row, name=f"f405_usb: {row.name}") for row in rows if row.name in OF_EACH_BOARD]


def second_family() -> list[Budget]:
    """Those that an image says without running; the STM32G474 has no emulator."""
    rows = [*memory(G474_IMAGE, G474), *stack(G474_IMAGE, G474_BUILD, G474)]
    return [replace(row, name=f"g474: {row.name}") for row in rows]


NOT_MEASURED = "| g474: ticks, interrupts, loads | not measured |  |  |  |  | the chip has no emulator |\n"

HEADER = f"""# Budgets

Generated and checked by `tests/budgets.py` (part of `./run test`), arm-none-eabi-gcc 12.2 at `-O2`: it fails
when a limit is passed, and when this table is not what it measures, rounded to {DIGITS} digits. After a
change that is worth its cost: `./run setup && .venv/bin/python tests/budgets.py --update`; the commit then
shows it.

- **Stack**: call graph of the linked image (`tests/stack_depth.py`), with no recursion in it; the main loop
  at its deepest is interrupted by one handler of each priority, each at its own deepest, up to the fault
  handler;
  {stack_depth.EXCEPTION_FRAME} B of registers, FP context included, go with each.
- **Instructions**: most that one run of a handler took on the virtual board, those of handlers that
  interrupted it not counted: a log at {{rate}} Hz, both wheels driven in both modes, both directions of the
  line full, statuses over CAN at 1 Mbit/s as fast as they are answered, a shorted bus, then a fault that
  stops and a sag of the supply.
- **Boards**: the rows are those of the Olimex STM32-H405; `f405_usb` begins those of the board whose USB pins
  are free, as far as its wiring decides them; `g474` those of the NUCLEO-G474RE, of which there is no
  emulator: what is read off its image is here, and nothing of it has been timed.
- **Times and loads**: at 168 MHz, with the virtual board's cycles (`hil_sim/README.md`: one an instruction;
  loads, stores and branches more), first as if flash had no wait states, then with its 5 and with the
  accelerator's prefetch and caches, as RM0090 section 3.5.2 has them: {{cpi:.2f}} and {{waiting_cpi:.2f}}
  cycles an instruction over the ticks. The limit applies to the second. Good to tens of per cent; a chip is
  yet to say.

| what | measured | with wait states | unit | limit | share | limit, because |
| --- | --- | --- | --- | --- | --- | --- |
"""
ROW = re.compile(r"^\| (.+?) \| ([\d. ]+) \| ([\d. ]*) ?\| (\S+) \| ", re.MULTILINE)


def table(budgets: list[Budget], costs: Costs, with_waits: Costs) -> str:
    per_tick = [
        tick.cycles / tick.instructions for c in (costs, with_waits) for tick in (c.handlers[SYSTICK],)
    ]
    lines = [HEADER.format(rate=LOG_RATE_HZ, cpi=per_tick[0], waiting_cpi=per_tick[1])]
    for b in budgets:
        waits = "" if b.waits is None else text(b.waits)
        limit = "" if b.limit is None else exact(b.limit)
        share = "" if b.limit is None else f"{100 * b.worst / b.limit:.0f} %"
        lines.append(f"| {b.name} | {text(b.value)} | {waits} | {b.unit} | {limit} | {share} | {b.why} |\n")
    return "".join([*lines, NOT_MEASURED])


def read(path: Path) -> dict[tuple[str, str], float]:
    if not path.is_file():
        return {}
    found: dict[tuple[str, str], float] = {}
    for name, value, waits, unit in ROW.findall(path.read_text(encoding="utf-8")):
        found[name, unit] = float(value.replace(" ", ""))
        if waits.strip():
            found[name + WAITS, unit] = float(waits.replace(" ", ""))
    return found


def compare(budgets: list[Budget], committed: dict[tuple[str, str], float]) -> tuple[list[str], list[str]]:
    """What has changed against the table, and which limits are passed, a line each."""
    changes, passed = [], []
    for b in budgets:
        for name, value in b.figures():
            before = committed.pop((name, b.unit), None)
            now = rounded(value)
            if before is None:
                changes.append(f"{name}: {text(now)} {b.unit}, new")
            elif before != now:
                change = f"{100 * (now - before) / before:+.1f} %" if before else "from nothing"
                changes.append(f"{name}: {text(before)} -> {text(now)} {b.unit}, {change}")
        if b.limit is not None and b.worst > b.limit:
            passed.append(f"{b.name}: {text(b.worst)} {b.unit}, limit {exact(b.limit)} ({b.why})")
    changes += [
        f"{name}: {text(value)} {unit}, measured no more" for (name, unit), value in committed.items()
    ]
    return changes, passed


def main() -> int:
    try:
        costs = measure(IMAGE, flash_waits=False)
        waiting = measure(IMAGE, flash_waits=True)
        budgets = [*of_board(IMAGE, BUILD, costs, waiting), *second_board(), *second_family()]
    except stack_depth.StackError as error:
        sys.exit(f"the stack cannot be judged: {error}")
    for b in budgets:
        waits = "" if b.waits is None else text(b.waits)
        limit = "" if b.limit is None else f"of {exact(b.limit):>8} {100 * b.worst / b.limit:5.1f} %"
        print(f"{b.name:36} {text(b.value):>8} {waits:>8} {b.unit:12} {limit}".rstrip())
    changes, passed = compare(budgets, read(TABLE))
    if "--update" in sys.argv:
        TABLE.write_text(table(budgets, costs, waiting))
    for line in changes:
        print(f"changed: {line}")
    for line in passed:
        print(f"LIMIT PASSED: {line}")
    if changes and "--update" not in sys.argv:
        print(
            "firmware/BUDGETS.md is not what is measured; when the change is worth its cost: "
            ".venv/bin/python tests/budgets.py --update"
        )
        return 1
    return int(bool(passed))


if __name__ == "__main__":
    sys.exit(main())
