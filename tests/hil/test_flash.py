"""`truing flash` with the real stm32flash, OpenOCD and stlink-tools, on chips that are not there."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

from hil_sim import VirtualRobot
from support import fake_probe
from support.rom_loader import RomLoader
from truing.board.device import Device
from truing.flash.image import Image, read_image
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream

FLASH = 0x0800_0000
KEPT = slice(0x4000, 0xC000)
PARAMETERS = bytes(range(256)) * 128
FLOATING = (-1.0, -1.0)  # nothing drives the bridge's inputs


def flash(*arguments: str | Path, path: str | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "truing", "flash", "--yes", *map(str, arguments)]
    environment = {**os.environ, "PATH": path or os.environ["PATH"]}
    return subprocess.run(command, capture_output=True, text=True, timeout=90, check=False, env=environment)


@pytest.fixture
def rom_path(tmp_path: Path) -> str:
    """stm32flash as it is, but without the parity bit, which no pseudo-terminal has."""
    real = shutil.which("stm32flash")
    wrapper = tmp_path / "stm32flash"
    wrapper.write_text(f'#!/bin/sh\nexec {real} -m 8n1 "$@"\n')
    wrapper.chmod(0o755)
    return f"{tmp_path}:{os.environ['PATH']}"


@pytest.fixture
def whole(image: Path) -> Image:
    return read_image(image)


def held(memory: bytes | bytearray, image: Image) -> bool:
    return all(memory[part.address - FLASH : part.end - FLASH] == part.data for part in image.parts)


def boot(image: Path, memory: bytes | bytearray) -> VirtualRobot:
    """A virtual board whose flash holds what the tool left."""
    robot = VirtualRobot(image)
    robot.write_flash(FLASH, bytes(memory))
    robot.power_cycle()
    robot.run_us(400_000)
    return robot


def test_the_rom_loader_takes_the_image_and_the_board_starts_it_with_its_parameters_kept(
    image: Path, native_library: Path, whole: Image, rom_path: str
) -> None:
    with RomLoader() as loader:
        loader.flash[KEPT] = PARAMETERS
        done = flash("--with", "stm32flash", "--port", loader.path, path=rom_path)
        assert done.returncode == 0, done.stderr
        assert "written and verified" in done.stdout
        assert "leaves the option bytes as they are" in done.stderr
        assert held(loader.flash, whole)
        assert loader.flash[KEPT] == PARAMETERS
        assert set(loader.erased) == {0, 3, 4, 5}
        loader.flash[KEPT] = b"\xff" * len(PARAMETERS)
        with boot(image, loader.flash) as robot:
            assert Device(Client(VirtualStream(robot))).info.firmware_version == whole.version


@pytest.mark.parametrize("writes", [0, 1, 30, 145])
def test_a_board_whose_flashing_was_cut_off_runs_nothing_and_takes_the_next_attempt(
    image: Path, native_library: Path, whole: Image, rom_path: str, writes: int
) -> None:
    with RomLoader(writes=writes) as loader:
        for part in whole.parts:  # the board had a program before
            loader.flash[part.address - FLASH : part.end - FLASH] = part.data
        done = flash("--with", "stm32flash", "--port", loader.path, path=rom_path)
        assert done.returncode == 1
        memory = loader.flash
        with boot(image, memory) as robot:
            assert (robot.bridge(0), robot.bridge(1)) == (FLOATING, FLOATING)
            assert robot.link_read() == b""
    with RomLoader() as loader:
        loader.flash[:] = memory
        assert flash("--with", "stm32flash", "--port", loader.path, path=rom_path).returncode == 0
        assert held(loader.flash, whole)


def test_flash_that_does_not_take_a_byte_is_found_by_reading_back(rom_path: str) -> None:
    with RomLoader(broken_at=0xD001) as loader:
        loader.flash[0xD001] = 0x00
        done = flash("--with", "stm32flash", "--port", loader.path, path=rom_path)
    assert done.returncode == 1
    assert "flash at 0x0800d001 does not hold what was written" in done.stderr


def test_another_chip_is_refused_by_its_id_and_nothing_is_written(rom_path: str) -> None:
    with RomLoader(device_id=0x431) as loader:
        done = flash("--with", "stm32flash", "--port", loader.path, path=rom_path)
        assert done.returncode == 1
        assert "for an STM32F405 (0x413), and this chip is 0x431 (STM32F411)" in done.stderr
        assert loader.erased == []


def test_a_board_that_holds_another_boards_image_is_refused_unless_it_is_said_to_be_right(
    image: Path, usb_image: Path, whole: Image, rom_path: str
) -> None:
    with RomLoader() as loader:
        for part in whole.parts:
            loader.flash[part.address - FLASH : part.end - FLASH] = part.data
        way: tuple[str | Path, ...] = (usb_image, "--with", "stm32flash", "--port", loader.path)
        done = flash(*way, path=rom_path)
        assert done.returncode == 1
        assert "is for truing-f405-usb (USB pins free, right bridge on TIM8, 12 MHz)" in done.stderr
        assert "this board holds the image of truing-f405 (Olimex STM32-H405, 8 MHz)" in done.stderr
        assert loader.erased == []
        assert flash(*way, "--other-board", path=rom_path).returncode == 0
        assert held(loader.flash, read_image(usb_image))


def test_a_loader_that_does_not_answer_is_told_with_what_to_check(rom_path: str) -> None:
    with RomLoader() as loader:
        loader.stop()
        done = flash("--with", "stm32flash", "--port", loader.path, path=rom_path)
    assert done.returncode == 1
    assert "the ROM loader does not answer" in done.stderr
    assert "BOOT0 to 1" in done.stderr


@pytest.mark.parametrize("tool", ["openocd", "st-flash"])
def test_a_probe_writes_reads_back_and_leaves_the_parameters(tmp_path: Path, whole: Image, tool: str) -> None:
    memory = fake_probe.install(tmp_path)
    before = bytearray(memory.read_bytes())
    before[KEPT] = PARAMETERS
    memory.write_bytes(before)
    done = flash("--with", tool, path=f"{tmp_path}:{os.environ['PATH']}")
    assert done.returncode == 0, done.stderr
    assert held(memory.read_bytes(), whole)
    assert memory.read_bytes()[KEPT] == PARAMETERS


@pytest.mark.parametrize("tool", ["openocd", "st-flash"])
@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (0x0FFF_AAEC, 0x0FFF_AAE0, "set to its highest level"),
        (0x0FF0_AA44, 0x0FF0_AA40, "set to its highest level"),
        (0x0FFF_AAE0, 0x0FFF_AAE0, "at its highest level already"),
        (0x0FFF_55EC, 0x0FFF_55EC, "left as it is, since the chip is read protected"),
    ],
    ids=["factory", "others kept", "set already", "protected"],
)
def test_a_probe_sets_the_brown_out_reset_and_no_other_option_byte(
    tmp_path: Path, tool: str, before: int, after: int, said: str
) -> None:
    fake_probe.install(tmp_path, option_bytes=before)
    done = flash("--with", tool, path=f"{tmp_path}:{os.environ['PATH']}")
    assert done.returncode == 0, done.stderr
    assert said in done.stderr
    assert fake_probe.option_bytes(tmp_path) == after


@pytest.mark.parametrize("tool", ["openocd", "st-flash"])
@pytest.mark.parametrize(
    ("device_id", "flash_kib", "said"),
    [(0x419, 2048, "0x419 (STM32F42x or F43x)"), (0x413, 64, " KiB of flash, and this chip has 64")],
)
def test_a_probe_that_sees_another_chip_writes_nothing(
    tmp_path: Path, tool: str, device_id: int, flash_kib: int, said: str
) -> None:
    memory = fake_probe.install(tmp_path, device_id, flash_kib)
    done = flash("--with", tool, path=f"{tmp_path}:{os.environ['PATH']}")
    assert done.returncode == 1
    assert said in done.stderr
    assert "nothing was written" in done.stderr
    assert set(memory.read_bytes()) == {0xFF}


@pytest.mark.parametrize("tool", ["openocd", "st-flash"])
def test_a_probe_that_is_not_there_is_told(tool: str) -> None:
    done = flash("--with", tool)
    assert done.returncode == 1
    assert f"{tool}: found no ST-LINK" in done.stderr


@pytest.mark.parametrize("tool", ["openocd", "st-flash", "stm32flash"])
def test_a_tool_that_is_not_installed_is_named_with_its_package(tmp_path: Path, tool: str) -> None:
    done = flash("--with", tool, "--port", "/dev/ttyUSB0", path=str(tmp_path))
    assert done.returncode == 1
    assert f"{tool} is not installed" in done.stderr
    assert "apt-get install" in done.stderr


def test_without_a_choice_the_first_tool_that_is_there_is_taken(tmp_path: Path, whole: Image) -> None:
    memory = fake_probe.install(tmp_path)
    (tmp_path / "openocd").unlink()
    done = flash(path=str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "st-flash: chip 0x413" in done.stderr
    assert held(memory.read_bytes(), whole)
    for name in ("st-flash", "st-info"):
        (tmp_path / name).unlink()
    none = flash(path=str(tmp_path))
    assert "none of openocd, st-flash and (with --port) stm32flash is installed" in none.stderr


Change = Callable[[bytearray, int], None]


def word(number: int, value: int) -> Change:
    def change(elf: bytearray, vectors: int) -> None:
        struct.pack_into("<I", elf, vectors + 4 * number, value)

    return change


def named(name: bytes) -> Change:
    def change(elf: bytearray, _vectors: int) -> None:
        at = elf.index(b"truing-f405 ")  # the loader's, the first in the file
        elf[at : at + len(name)] = name

    return change


def machine(elf: bytearray, _vectors: int) -> None:
    struct.pack_into("<H", elf, 18, 8)  # e_machine: MIPS


def damaged(elf: bytearray, vectors: int) -> None:
    elf[vectors + 0x400] ^= 1  # code


def placed(address: int) -> Change:
    def change(elf: bytearray, _vectors: int) -> None:
        header, size = struct.unpack_from("<I", elf, 28)[0], struct.unpack_from("<H", elf, 42)[0]
        for number in range(struct.unpack_from("<H", elf, 44)[0]):
            at = header + number * size
            if struct.unpack_from("<I", elf, at + 12)[0] == 0x0800_C000:  # p_paddr
                struct.pack_into("<I", elf, at + 12, address)

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (named(b"truing-f411 "), "is an image named 'truing-f411"),
        (named(b"blinky-f405 "), "carries no name behind its vectors"),
        (word(0, 0x2004_0000), "its stack begins at 0x20040000, where an STM32F405 has no memory"),
        (word(1, 0x0800_C100), "its vector 1, 0x0800c100, leads to no code of this image"),
        (word(15, 0x0808_0001), "its vector 15, 0x08080001, leads to no code of this image"),
        (placed(0x0800_4000), "would overwrite the stored parameters"),
        (placed(0x0810_0000), "lie outside the flash of an STM32F405"),
        (damaged, "its header does not fit what follows it"),
        (machine, "is a program for MIPS, not for a Cortex-M"),
    ],
    ids=[
        "another board",
        "another program",
        "stack",
        "start",
        "tick",
        "parameters",
        "size",
        "content",
        "machine",
    ],
)
def test_an_image_for_another_board_is_refused_by_what_it_says_itself(
    tmp_path: Path, image: Path, change: Change, said: str
) -> None:
    elf = bytearray(image.read_bytes())
    with image.open("rb") as file:
        section = ELFFile(file).get_section_by_name(".vectors")
    change(elf, section["sh_offset"])
    other = tmp_path / "other.elf"
    other.write_bytes(elf)
    done = flash(other, "--with", "stm32flash", "--port", "/dev/null")
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_file_that_is_no_elf_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "image.bin"
    other.write_bytes(b"not an image")
    done = flash(other)
    assert done.returncode == 2
    assert "is not an ELF file" in done.stderr


def test_nothing_is_written_before_somebody_says_that_the_motors_are_off() -> None:
    command = [sys.executable, "-m", "truing", "flash", "--with", "openocd"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "motors' supply is off" in done.stderr
