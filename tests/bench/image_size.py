"""What the image takes of the chip."""

from __future__ import annotations

import subprocess
from pathlib import Path

from bench.figure import Figure

FLASH_BYTES = 1024 * 1024  # STM32F405RG
SRAM_BYTES = 128 * 1024  # without the 64 KiB of CCM


def measure(root: Path) -> list[Figure]:
    """Read the sections' sizes off the image."""
    image = root / "build/stm32f405/firmware/truing-f405.elf"
    listing = subprocess.run(
        ["arm-none-eabi-size", image], check=True, capture_output=True, text=True
    ).stdout.splitlines()
    text, data, bss = (int(cell) for cell in listing[1].split()[:3])
    return [
        Figure(
            "image in flash",
            (text + data) / 1024,
            "KiB",
            "less",
            FLASH_BYTES / 1024,
            "the chip's flash",
            1024,
        ),
        Figure(
            "image in RAM",
            (data + bss) / 1024,
            "KiB",
            "less",
            peer="the chip's SRAM",
            peer_value=SRAM_BYTES / 1024,
        ),
    ]
