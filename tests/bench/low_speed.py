"""How evenly velocity mode crawls on 64 counts a turn, beside plain counts per tick."""

from __future__ import annotations

from pathlib import Path

from bench.figure import Figure
from support.crawl import crawl

SPEEDS_MPS = (0.02, 0.05, 0.10)


def measure(root: Path) -> list[Figure]:
    """Ripple of the true wheel speed, RMS; the bar is a third of what plain counts give."""
    image = root / "build/stm32f405/firmware/truing-f405.elf"
    figures = []
    for speed in SPEEDS_MPS:
        plain = 1e3 * crawl(image, speed, from_edges=False).ripple_mps
        edges = 1e3 * crawl(image, speed, from_edges=True).ripple_mps
        name = f"ripple at {speed:.2f} m/s, 64 counts a turn"
        figures.append(Figure(name, edges, "mm/s", "less", plain / 3, "plain counts per tick", plain))
    return figures
