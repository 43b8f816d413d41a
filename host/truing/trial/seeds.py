"""Seeds of robots beyond a trial's first one."""

from __future__ import annotations

import numpy as np


def seed_of(seed: int, attempt: int) -> int:
    """Seed of a further robot for the same trial; the first is the trial's own."""
    if attempt == 0:
        return seed
    return int(np.random.SeedSequence([seed, attempt]).generate_state(1, np.uint64)[0] >> 1)
