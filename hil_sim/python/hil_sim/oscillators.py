"""Frequencies of a chip's three oscillators, and how far those of a real one may be off."""

from __future__ import annotations

import random
from dataclasses import dataclass

HSI_HZ, LSI_HZ = 16_000_000, 32_000

# Of usual 8 MHz crystals, over temperature and age.
CRYSTAL_PPM = 100.0
# STM32F405 datasheet, section 5.3.9: over the whole range of temperature, and at 25 C.
HSI_PER_CENT = (-8.0, 4.5)
HSI_PER_CENT_AT_25_C = (-1.0, 1.0)
LSI_RANGE_HZ = (17_000, 47_000)


@dataclass(frozen=True)
class Oscillators:
    """True frequencies; the nominal ones when left out.

    Attributes
    ----------
    crystal_ppm : how much faster than 8 MHz the crystal is.
    hsi_hz : of the internal high-speed oscillator, which start-up and the fallback run from.
    lsi_hz : of the internal low-speed oscillator, which the watchdog counts.
    """

    crystal_ppm: float = 0.0
    hsi_hz: int = HSI_HZ
    lsi_hz: int = LSI_HZ

    @classmethod
    def drawn(cls, seed: int, *, at_25_c: bool = False) -> Oscillators:
        """Draw those of one chip and its crystal from within their tolerances, evenly."""
        chance = random.Random(seed)
        hsi = HSI_PER_CENT_AT_25_C if at_25_c else HSI_PER_CENT
        return cls(
            chance.uniform(-CRYSTAL_PPM, CRYSTAL_PPM),
            round(HSI_HZ * (1 + chance.uniform(*hsi) / 100)),
            chance.randint(*LSI_RANGE_HZ),
        )
