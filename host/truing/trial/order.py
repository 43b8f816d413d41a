"""The order of a campaign's trials: any beginning of it has every kind in its share.

Kinds follow one another so that none ever lags by more than one trial. Single effects come in rounds, each
effect once a round, in an order that the seed shuffles; full and weak strength take turns along a round, and
for each effect from round to round.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from truing.trial.effects import CATALOGUE, INTERMITTENT, OUTSIDE

Block = Literal["main", "last", "several", "intermittent", "backlash"]

# Of 470 trials: ten for each of 27 effects, the healthy, the pairs, and those that no catalogue has.
SHARES = {"random": 270, "none": 100, "pair": 60, "outside": 40}
# Blocks that are campaigns of their own: three and four effects at once, effects outside the catalogue that
# act for some time only, gear backlash of full strength.
OWN_SHARES: dict[Block, dict[str, int]] = {
    "several": {"several": 60},
    "intermittent": {"intermittent": 60},
    "backlash": {"gear_backlash": 40},
}
# One in so many goes through the flashed image; with the shares above no kind is passed over.
ON_BOARD_EVERY = 10
# Seeds of the last block lie beyond all others.
_LAST = 10**12
_PER_CAMPAIGN = 1_000_000


@dataclass(frozen=True)
class Task:
    """One trial of a campaign."""

    number: int
    effect: str
    seed: int
    weak: bool | None
    on_board: bool


@functools.cache
def _kinds(trials: int, block: Block) -> tuple[str, ...]:
    return shared_out(_shares(block), trials)


def shared_out(shares: Mapping[str, int], trials: int) -> tuple[str, ...]:
    """Return the kinds of a campaign's trials in order: none ever lags its share by more than one trial."""
    total = sum(shares.values())
    counts = dict.fromkeys(shares, 0)
    kinds = []
    for number in range(trials):
        kind = max(shares, key=lambda name: shares[name] * (number + 1) / total - counts[name])
        counts[kind] += 1
        kinds.append(kind)
    return tuple(kinds)


def _shares(block: Block) -> dict[str, int]:
    return OWN_SHARES.get(block, SHARES)


def tasks(trials: int, seed: int, block: Block = "main") -> list[Task]:
    """Return the first trials of a campaign.

    Parameters
    ----------
    block : `last` has seeds that no other campaign has, for one evaluation, after all tuning; of the others
        beside `main` each has its own kinds of trial (`OWN_SHARES`).
    """
    first = seed * _PER_CAMPAIGN + (_LAST if block == "last" else 0)
    rng = np.random.default_rng([first, 0x6F72646572])
    inside, outside, intermittent = sorted(CATALOGUE), sorted(OUTSIDE), sorted(INTERMITTENT)
    rng.shuffle(inside)
    rng.shuffle(outside)
    rng.shuffle(intermittent)
    counts = dict.fromkeys(_shares(block), 0)
    out = []
    for number, kind in enumerate(_kinds(trials, block)):
        at = counts[kind]
        counts[kind] += 1
        effect, weak = kind, None
        if kind == "random":
            turn, place = divmod(at, len(inside))
            effect, weak = inside[place], (turn + place) % 2 == 1
        elif kind == "outside":
            effect = outside[at % len(outside)]
        elif kind == "intermittent":
            effect = intermittent[at % len(intermittent)]
        elif kind in CATALOGUE:
            weak = False
        on_board = number % ON_BOARD_EVERY == ON_BOARD_EVERY // 2
        out.append(Task(number, effect, first + number, weak, on_board))
    return out
