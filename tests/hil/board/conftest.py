"""Builds the small test images and puts them on virtual boards."""

from __future__ import annotations

import os
import struct
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hil_sim import VirtualRobot

ROOT = Path(__file__).resolve().parents[3]
IMAGES = Path(__file__).resolve().parent / "images"
COMPILER = "arm-none-eabi-gcc"
FLAGS = [
    *("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"),
    *("-O2", "-g", "-std=gnu11", "-Wall", "-Wextra", "-Werror"),
    *("-ffreestanding", "-nostdlib", "-nostartfiles"),
]


class TestBoard(VirtualRobot):
    """A virtual board with a test image, read and written by the names of the image's variables."""

    __test__ = False

    def words(self, name: str, count: int | None = None) -> list[int]:
        """Unsigned words of a variable."""
        address, size = self.symbol(name)
        count = size // 4 if count is None else count
        return list(struct.unpack(f"<{count}I", self.read_memory(address, 4 * count)))

    def word(self, name: str) -> int:
        """The first word of a variable."""
        return self.words(name, 1)[0]

    def put(self, name: str, value: int, index: int = 0) -> None:
        """Change one word of a variable."""
        self.write_memory(self.symbol(name)[0] + 4 * index, struct.pack("<I", value & 0xFFFFFFFF))


def build(name: str) -> Path:
    """Compile images/NAME.c with the common start-up, when it is newer than its image."""
    folder = ROOT / "build" / "board_images"
    folder.mkdir(parents=True, exist_ok=True)
    image = folder / f"{name}.elf"
    sources = [IMAGES / f"{name}.c", IMAGES / "start.c"]
    needs = [*sources, IMAGES / "chip.h", IMAGES / "image.ld", Path(__file__)]
    if not image.exists() or image.stat().st_mtime < max(path.stat().st_mtime for path in needs):
        partial = folder / f"{name}.{os.getpid()}.elf"
        command = [
            COMPILER,
            *FLAGS,
            "-T",
            str(IMAGES / "image.ld"),
            *map(str, sources),
            "-lgcc",
            "-o",
            str(partial),
        ]
        subprocess.run(command, check=True, timeout=60)
        partial.rename(image)
    return image


@pytest.fixture
def board(native_library: Path) -> Iterator[Callable[..., TestBoard]]:
    """Make boards: `board("fp", seed=2)` runs images/fp.c."""
    made: list[TestBoard] = []

    def make(name: str, **options: object) -> TestBoard:
        made.append(TestBoard(build(name), library=native_library, **options))  # type: ignore[arg-type]
        return made[-1]

    yield make
    for one in made:
        one.close()
