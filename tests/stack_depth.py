"""The deepest that the image's stack can get: its call graph from the disassembly, frames from the compiler.

Calls are read off the linked image, library and assembly included. A call through a pointer goes to every
function of the constant tables that the calling function refers to. Frame sizes are the compiler's
(``-fstack-usage``); of what it did not compile, all pushes of the function together.
"""

import json
import re
import subprocess
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from elftools.elf.elffile import ELFFile

EXCEPTION_FRAME = 108
"""Bytes that exception entry stacks: 26 words with the FP context, one more to align (PM0214 2.3.7)."""
VECTORS = 98
RESET, UNEXPECTED = "Reset_Handler", "unexpected_interrupt"
LOADER = "-loader.dir/"  # the folder of its objects ends like this
FAULTS = ("fault_entry", UNEXPECTED, "NMI_Handler")  # above every priority; each ends in a reset


class StackError(Exception):
    """The call graph has no deepest path, or not one that can be read off the image."""


@dataclass
class Function:
    """What a function puts on the stack, and whom it calls."""

    name: str
    frame: int = 0  # as its own pushes say
    calls: set[int] = field(default_factory=set)
    tail_calls: set[int] = field(default_factory=set)
    by_pointer: bool = False
    refers: set[int] = field(default_factory=set)  # words among its code: addresses of tables, if any


@dataclass(frozen=True)
class Depth:
    """Bytes of the deepest path below an entry, and that path."""

    size: int
    path: tuple[str, ...]


_LINE = re.compile(r"^\s*([0-9a-f]+):\s+(\S+)(?:\s+(.*))?$")
_TARGET = re.compile(r"\b([0-9a-f]+) <")
_CALL = re.compile(r"^blx?(\.[nw])?$")
_BRANCH = re.compile(r"^(b([a-z]{2})?(\.[nw])?|cbn?z)$")


def parse(listing: str, functions: dict[int, str]) -> dict[int, Function]:
    """Functions by address, from objdump's listing; `functions` are the symbols."""
    starts = sorted(functions)
    found = {start: Function(functions[start]) for start in starts}
    for line in listing.splitlines():
        match = _LINE.match(line)
        if match is None:
            continue
        at, operation, operands = int(match[1], 16), match[2], match[3] or ""
        index = bisect_right(starts, at) - 1
        if index >= 0:
            _take(found[starts[index]], starts[index], operation, operands, functions)
    return found


def _take(function: Function, start: int, operation: str, operands: str, functions: dict[int, str]) -> None:
    target = _TARGET.search(operands)
    if operation == ".word":
        function.refers.add(int(operands.split()[0], 16))
    elif _CALL.match(operation) and target:
        function.calls.add(int(target[1], 16))
    elif operation == "blx":
        function.by_pointer = True
    elif _BRANCH.match(operation) and target:
        to = int(target[1], 16)
        if to in functions and to != start:
            function.tail_calls.add(to)
    elif (operation == "bx" and operands != "lr") or (operation.startswith("mov") and operands[:3] == "pc,"):
        raise StackError(f"{function.name} jumps to a place that nobody can tell: {operation} {operands}")
    else:
        function.frame += _pushed(function.name, operation, operands)


def _registers(text: str) -> int:
    count = 0
    for part in re.sub(r"[{}\s]", "", text).split(","):
        ends = [int(re.sub(r"\D", "", end) or 0) for end in part.split("-")]
        count += ends[-1] - ends[0] + 1
    return count


def _pushed(name: str, operation: str, operands: str) -> int:
    operands = operands.split("@")[0].strip()
    if operation.startswith(("push", "vpush")):
        return (8 if "{d" in operands else 4) * _registers(operands)
    if operation.startswith("stmdb") and operands.startswith("sp!"):
        return 4 * _registers(operands.partition(",")[2])
    if operation.startswith("str") and operands.endswith("]!") and "[sp, #-" in operands:
        return int(operands.rpartition("#-")[2][:-2])
    if operation.startswith("sub") and operands.startswith("sp"):
        amount = operands.rpartition("#")
        if not amount[1]:
            raise StackError(f"{name} takes an amount of stack that nobody can tell: {operation} {operands}")
        return int(amount[2], 0)
    return 0


class Image:
    """An image's functions, tables and vectors.

    Parameters
    ----------
    elf : the linked image.
    usage : folder of the compiler's `.su` files, and what is under it.
    """

    def __init__(self, elf: Path, usage: Path) -> None:
        with elf.open("rb") as file:
            image = ELFFile(file)
            symbols = list(image.get_section_by_name(".symtab").iter_symbols())
            self._code = {
                symbol["st_value"] & ~1: symbol.name
                for symbol in symbols
                if symbol["st_info"]["type"] == "STT_FUNC"
            }
            self._objects = sorted(
                (symbol["st_value"], symbol["st_size"])
                for symbol in symbols
                if symbol["st_info"]["type"] == "STT_OBJECT"
            )
            self._sections = [
                (section["sh_addr"], section.data())
                for section in image.iter_sections()
                if section["sh_type"] == "SHT_PROGBITS" and section["sh_flags"] & 2
            ]
            self.values = {symbol.name: int(symbol["st_value"]) for symbol in symbols}
        listing = subprocess.run(
            ["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", elf],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        self.functions = parse(listing, self._code)
        self._frames = frames(usage)
        self._follow_pointers()
        self._check_frames()

    def _word(self, address: int) -> int | None:
        for start, data in self._sections:
            if start <= address and address + 4 <= start + len(data):
                return int.from_bytes(data[address - start : address - start + 4], "little")
        return None

    def _table(self, address: int) -> Iterator[int]:
        """The functions that a constant table points to."""
        index = bisect_right(self._objects, (address, 1 << 32)) - 1
        if index < 0:
            return
        start, size = self._objects[index]
        if not start <= address <= start + size:
            return
        for place in range(start, start + size - 3, 4):
            word = self._word(place)
            if word is not None and word & 1 and word & ~1 in self._code:
                yield word & ~1

    def _follow_pointers(self) -> None:
        for function in self.functions.values():
            if not function.by_pointer:
                continue
            targets = {target for address in function.refers for target in self._table(address)}
            if not targets:
                raise StackError(f"{function.name} calls by a pointer, and refers to no table of functions")
            function.calls |= targets

    def _check_frames(self) -> None:
        for function in self.functions.values():
            told = self._frames.get(function.name)
            if told is not None and told > function.frame:
                raise StackError(
                    f"{function.name}: the compiler says {told} bytes, its code pushes {function.frame}"
                )

    def compiled(self) -> int:
        """Of how many functions the compiler has told the frame."""
        return sum(function.name in self._frames for function in self.functions.values())

    def frame(self, function: Function) -> int:
        """Bytes of a function's own frame."""
        return self._frames.get(function.name, function.frame)

    def deepest(self, name: str) -> Depth:
        """The deepest path below a function."""
        addresses = [address for address, found in self._code.items() if found == name]
        if not addresses:
            raise StackError(f"the image has no function {name}")
        return deepest(self.functions, addresses[0], self.frame)

    def vectors(self) -> dict[int, str]:
        """The function that each exception number leads to; those that nobody expects are left out."""
        start = self.values["__vectors"]
        found = {}
        for number in range(1, VECTORS):
            word = self._word(start + 4 * number)
            if word and self._code[word & ~1] != UNEXPECTED:
                found[number] = self._code[word & ~1]
        return found


def _usage_files(folder: Path) -> list[Path]:
    """Those of the build as it is now; what an earlier one left, and the loader's, are of other code."""
    files = list(folder.rglob("*.su"))
    commands = folder / "compile_commands.json"
    if not commands.is_file():
        return files
    of_now = {
        (folder / made[1]).with_suffix(".su")
        for entry in json.loads(commands.read_text())
        if (made := re.search(r" -o (\S+)", entry["command"]))
    }
    return [file for file in files if file in of_now and LOADER not in file.as_posix()]


def frames(folder: Path) -> dict[str, int]:
    """The compiler's frame of each function, bytes; of two static ones of one name, the larger."""
    found: dict[str, int] = defaultdict(int)
    for file in _usage_files(folder):
        for line in file.read_text().splitlines():
            place, size, kind = line.split("\t")
            if kind != "static":
                raise StackError(f"{place} takes an amount of stack that is known only when it runs")
            name = place.rpartition(":")[2]
            found[name] = max(found[name], int(size))
    if not found:
        raise StackError(f"{folder} holds no .su files")
    return dict(found)


def deepest(functions: dict[int, Function], entry: int, frame: Callable[[Function], int]) -> Depth:
    """The deepest path from `entry`; a tail call leaves its caller's frame first."""
    known: dict[int, Depth] = {}
    under_way: list[int] = []

    def visit(address: int) -> Depth:
        if address in known:
            return known[address]
        if address not in functions:
            raise StackError(f"something calls 0x{address:08x}, where no function begins")
        function = functions[address]
        if address in under_way:
            chain = [functions[place].name for place in under_way[under_way.index(address) :]]
            raise StackError(f"recursion: {' -> '.join([*chain, function.name])}")
        under_way.append(address)
        own = frame(function)
        best = Depth(own, (function.name,))
        for target in sorted(function.calls):
            below = visit(target)
            best = max(best, Depth(own + below.size, (function.name, *below.path)), key=lambda d: d.size)
        for target in sorted(function.tail_calls):
            below = visit(target)
            best = max(best, Depth(below.size, (function.name, *below.path)), key=lambda d: d.size)
        under_way.pop()
        known[address] = best
        return best

    return visit(entry)


def priorities(shared: Path, chip: Path) -> dict[str, int]:
    """The priority of each handler: the one that its own file hands to the interrupt controller."""
    header = (shared / "cortex.h").read_text()
    macros = dict(re.findall(r"^#define (PRIORITY_\w+)\s+(\w+)", header, re.MULTILINE))

    def value(name: str) -> int:
        text = macros[name]
        return value(text) if text in macros else int(text.rstrip("u"), 0)

    found: dict[str, int] = {}
    for source in sorted([*shared.glob("*.c"), *chip.glob("*.c")]):
        text = source.read_text()
        used = set(re.findall(r"(?:NVIC_IPR|SCB_SHPR)\([^)]*\)?\) = (PRIORITY_\w+);", text))
        if len(used) > 1:
            raise StackError(f"{source.name} sets several priorities; which handler has which?")
        for handler in re.findall(r"^void (\w+_Handler)\(void\)\n{", text, re.MULTILINE):
            if used:
                found[handler] = value(next(iter(used)))
    return found


@dataclass(frozen=True)
class Worst:
    """The whole stack at its deepest: the program, and one handler of each level on top of it."""

    size: int
    levels: tuple[Depth, ...]


def worst(image: Image, shared: Path, chip: Path) -> Worst:
    """The program at its deepest, interrupted there, and each handler at its own deepest."""
    priority = priorities(shared, chip)
    levels: dict[int, Depth] = {}
    for handler in sorted(set(image.vectors().values()) - {RESET, *FAULTS}):
        if handler not in priority:
            raise StackError(f"{handler}: its file sets no priority")
        depth = image.deepest(handler)
        levels[priority[handler]] = max(levels.get(priority[handler], depth), depth, key=lambda d: d.size)
    above = max((image.deepest(name) for name in FAULTS), key=lambda d: d.size)
    stacked = [levels[level] for level in sorted(levels, reverse=True)] + [above]
    program = image.deepest(RESET)
    size = program.size + sum(EXCEPTION_FRAME + depth.size for depth in stacked)
    return Worst(size, (program, *stacked))
