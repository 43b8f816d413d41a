"""The programs that reach a chip's flash: OpenOCD and st-flash by a probe, stm32flash by the ROM loader."""

from __future__ import annotations

import logging
import re
import shutil
import subprocess
import tempfile
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

from truing.errors import FlashError
from truing.flash.image import Chip, Part

LOGGER = logging.getLogger("truing.flash")
TIMEOUT_S = 180.0
# RM0090 3.9.3 and 3.9.10.
_OPTKEYR, _OPTCR = 0x4002_3C08, 0x4002_3C14
_OPTION_KEYS = (0x0819_2A3B, 0x4C5D_6E7F)
_OPTLOCK, _OPTSTRT = 1, 2
_SEE_LOG = "`truing -vv flash` shows all that the tool says"
_PROBE_NEXT = "plug the probe in (SWDIO, SWCLK, ground, NRST); `--with stm32flash` needs none"
_CHIP_NEXT = "is the board powered, and are SWDIO, SWCLK, ground and NRST connected?"
_LOADER_NEXT = (
    "BOOT0 to 1, BOOT1 (PB2) to 0, press reset, encoders still; the adapter's TX to PB11, RX to PB10, ground"
)


@dataclass(frozen=True, slots=True)
class ChipSeen:
    """What a tool has read from the chip: its device id, and its flash in KiB if the tool tells."""

    device_id: int
    flash_kib: int | None


@dataclass(frozen=True, slots=True)
class Complaint:
    """What a tool says when something is not there, and that in the user's words."""

    pattern: str
    message: str
    next_step: str


class Tool(ABC):
    """One program, found on the path; each call runs it once.

    Parameters
    ----------
    chip_of : the chip that the image is for.
    port : the serial port of the ROM loader; probes take none.
    """

    name: str
    programs: tuple[str, ...]
    package: str
    complaints: tuple[Complaint, ...]
    needs_port = False
    after = "the board has started the new image"

    def __init__(self, chip_of: Chip, port: str = "") -> None:
        self.chip_of = chip_of
        self.port = port

    @classmethod
    def installed(cls) -> bool:
        """Whether all of its programs are on the path."""
        return all(shutil.which(program) for program in cls.programs)

    @abstractmethod
    def chip(self) -> ChipSeen:
        """Stop the chip and read who it is."""

    @abstractmethod
    def write(self, part: Part) -> None:
        """Erase the sectors under the part and write it."""

    @abstractmethod
    def read(self, address: int, size: int) -> bytes:
        """Read flash."""

    def option_bytes(self) -> int | None:
        """FLASH_OPTCR (RM0090 3.9.10); None: the tool does not reach it."""
        return None

    def set_option_bytes(self, value: int) -> None:
        """Store the option bytes; `value` as FLASH_OPTCR, its lock and start bits zero."""
        raise FlashError(f"{self.name} does not set option bytes ({value:#010x})")

    def start(self) -> None:  # noqa: B027 (the ROM loader is left by its user)
        """Let the new image run."""

    def run(self, *arguments: str) -> str:
        """Run a program of the tool and return all that it says.

        Raises
        ------
        FlashError : it did not succeed.
        """
        LOGGER.info("%s", " ".join(arguments))
        try:
            done = subprocess.run(
                arguments,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                timeout=TIMEOUT_S,
                check=False,
            )
        except OSError as error:
            problem = f"{arguments[0]} cannot be run ({error.strerror})"
            raise FlashError(problem, self.how_to_install()) from error
        except subprocess.TimeoutExpired as error:
            raise FlashError(f"{arguments[0]} did not end within {TIMEOUT_S:.0f} s", _SEE_LOG) from error
        said = done.stdout.decode(errors="replace")
        LOGGER.debug("%s", said)
        for complaint in self.complaints:
            if re.search(complaint.pattern, said):
                raise FlashError(f"{self.name}: {complaint.message}", complaint.next_step)
        if done.returncode:
            last = next((line.strip() for line in reversed(said.splitlines()) if line.strip()), "nothing")
            raise FlashError(f"{arguments[0]} failed (exit status {done.returncode}): {last}", _SEE_LOG)
        return said

    @classmethod
    def how_to_install(cls) -> str:
        """The next step when it is missing."""
        return f"on Debian: apt-get install {cls.package}"

    def found(self, pattern: str, said: str, base: int = 0) -> int:
        """The number that the pattern's group matches; base 0: hexadecimal with 0x, else decimal."""
        match = re.search(pattern, said)
        if match is None:
            raise FlashError(f"{self.name} does not tell which chip it sees", _SEE_LOG)
        return int(match[1], base)


def _with_file(part: Part, folder: str) -> Path:
    path = Path(folder) / "part.bin"
    path.write_bytes(part.data)
    return path


class OpenOcd(Tool):
    """OpenOCD with an ST-LINK."""

    name = "openocd"
    programs = ("openocd",)
    package = "openocd"
    complaints = (
        Complaint(r"Error: open failed|unable to find a matching", "found no ST-LINK", _PROBE_NEXT),
        Complaint(r"init mode failed|unable to connect", "the probe sees no chip", _CHIP_NEXT),
    )

    def _do(self, *commands: str) -> str:
        # `reset halt`, not `halt`: a program that is only halted leaves its last effort on the bridges.
        all_commands = ("init", "reset halt", *commands, "shutdown")
        options = [word for command in all_commands for word in ("-c", command)]
        return self.run(
            "openocd", "-f", "interface/stlink.cfg", "-f", f"target/{self.chip_of.openocd}.cfg", *options
        )

    def chip(self) -> ChipSeen:
        """DBGMCU_IDCODE and the flash size register (RM0090 38.6.1, 39.2; RM0440 has them as well)."""
        said = self._do(
            'echo "device [format 0x%03x [expr {[mrw 0xE0042000] & 0xFFF}]]"',
            f'echo "flash [format %d [mrh 0x{self.chip_of.flash_size_at:08X}]]"',
        )
        return ChipSeen(self.found(r"device (0x[0-9a-f]+)", said), self.found(r"flash (\d+)", said))

    def write(self, part: Part) -> None:
        """`flash write_image erase` takes whole sectors, and only those that the part touches."""
        with tempfile.TemporaryDirectory() as folder:
            path = _with_file(part, folder)
            self._do(f"flash write_image erase {{{path}}} 0x{part.address:08x} bin")

    def read(self, address: int, size: int) -> bytes:
        """`dump_image`."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "read.bin"
            self._do(f"dump_image {{{path}}} 0x{address:08x} {size}")
            return path.read_bytes()

    def option_bytes(self) -> int | None:
        """The register itself."""
        said = self._do(f'echo "options [format 0x%08x [mrw 0x{_OPTCR:08x}]]"')
        return self.found(r"options (0x[0-9a-f]+)", said)

    def set_option_bytes(self, value: int) -> None:
        """Unlock, write, start, and lock again (RM0090 3.7.2); the start takes under a second."""
        self._do(
            *(f"mww 0x{_OPTKEYR:08x} 0x{key:08x}" for key in _OPTION_KEYS),
            f"mww 0x{_OPTCR:08x} 0x{value:08x}",
            f"mww 0x{_OPTCR:08x} 0x{value | _OPTSTRT:08x}",
            "sleep 1000",
            f"mww 0x{_OPTCR:08x} 0x{value | _OPTLOCK:08x}",
        )

    def start(self) -> None:
        """A reset, with nothing that halts it."""
        self._do("reset run")


class StFlash(Tool):
    """st-flash and st-info of stlink-tools."""

    name = "st-flash"
    programs = ("st-flash", "st-info")
    package = "stlink-tools"
    complaints = (
        Complaint(r"Couldn't find any ST-Link|Found 0 stlink", "found no ST-LINK", _PROBE_NEXT),
        Complaint(
            r"chipid:\s+0x0*\s|[Uu]nknown chip|Failed to connect to target",
            "the probe sees no chip",
            _CHIP_NEXT,
        ),
    )

    def chip(self) -> ChipSeen:
        """What `st-info --probe` says."""
        said = self.run("st-info", "--probe")
        return ChipSeen(
            self.found(r"chipid:\s+(0x[0-9a-fA-F]+)", said) & 0xFFF,
            self.found(r"flash:\s+(\d+)", said) // 1024,
        )

    def write(self, part: Part) -> None:
        """Erases what it writes over."""
        with tempfile.TemporaryDirectory() as folder:
            self.run("st-flash", "write", str(_with_file(part, folder)), f"0x{part.address:08x}")

    def read(self, address: int, size: int) -> bytes:
        """`st-flash read`."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "read.bin"
            self.run("st-flash", "read", str(path), f"0x{address:08x}", f"0x{size:x}")
            return path.read_bytes()

    def option_bytes(self) -> int | None:
        """The last line that `st-flash --area=option read` prints."""
        said = self.run("st-flash", "--area=option", "read")
        return self.found(r"(?:^|\n)(?:0x)?([0-9a-fA-F]{8})\s*$", said, 16)

    def set_option_bytes(self, value: int) -> None:
        """`st-flash --area=option write`, which unlocks, starts and locks by itself."""
        self.run("st-flash", "--area=option", "write", f"0x{value:08x}")

    def start(self) -> None:
        """A reset."""
        self.run("st-flash", "reset")


class RomLoader(Tool):
    """stm32flash, which talks to the chip's own loader (AN2606, AN3155)."""

    name = "stm32flash"
    programs = ("stm32flash",)
    package = "stm32flash"
    complaints = (
        Complaint(
            r"Failed to open port|Cannot handle device", "cannot open the serial port", "see `truing ports`"
        ),
        Complaint(r"Failed to init device", "the ROM loader does not answer", _LOADER_NEXT),
    )
    needs_port = True
    after = "BOOT0 back to 0 and press reset: the board then starts the new image"

    def __init__(self, chip_of: Chip, port: str = "") -> None:
        super().__init__(chip_of, port)
        self._connected = False

    def _do(self, *options: str) -> str:
        # The loader takes its baud rate from the first byte of the first connection, and from no other.
        resume = ("-c",) if self._connected else ()
        said = self.run("stm32flash", *resume, "-b", "115200", *options, self.port)
        self._connected = True
        return said

    def chip(self) -> ChipSeen:
        """What the loader answers to Get ID; it does not tell how much flash there is."""
        return ChipSeen(self.found(r"Device ID\s*: (0x[0-9a-fA-F]+)", self._do()), None)

    def write(self, part: Part) -> None:
        """Erases the sectors that the part touches."""
        span = f"0x{part.address:08x}:{len(part.data)}"
        with tempfile.TemporaryDirectory() as folder:
            self._do("-S", span, "-w", str(_with_file(part, folder)))

    def read(self, address: int, size: int) -> bytes:
        """`-r`."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "read.bin"
            self._do("-S", f"0x{address:08x}:{size}", "-r", str(path))
            return path.read_bytes()


TOOLS: tuple[type[Tool], ...] = (OpenOcd, StFlash, RomLoader)


def choose(name: str | None, port: str, chip: Chip) -> Tool:
    """The tool of that name; without a name, the first that is installed (stm32flash: and has a port).

    Raises
    ------
    FlashError : it, or each of them, is missing; or the ROM loader has no serial port, or is not known.
    """
    serial = "" if port == "sim" else port
    for tool in TOOLS:
        if name not in (None, tool.name):
            continue
        if name is None and not (tool.installed() and (serial or not tool.needs_port)):
            continue
        if not tool.installed():
            raise FlashError(f"{tool.name} is not installed", tool.how_to_install())
        if tool.needs_port and not serial:
            raise FlashError("the ROM loader is reached over a serial port", "name it with --port")
        if tool is RomLoader and not chip.tested_ways:
            problem = f"the ROM loader of an {chip.title} is not known to truing"
            raise FlashError(problem, "a probe flashes it: openocd, st-flash")
        return tool(chip, serial)
    packages = ", ".join(tool.package for tool in TOOLS)
    raise FlashError(
        "none of openocd, st-flash and (with --port) stm32flash is installed",
        f"on Debian: apt-get install one of {packages}",
    )
