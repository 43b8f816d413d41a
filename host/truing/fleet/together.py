"""Which effects come together: over robots, pairs that are named on one robot more often than by chance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy

# A robot has an effect that is named in at least this share of its diagnosed sets.
SHARE_OF_SETS = 0.5


@dataclass(frozen=True, slots=True)
class Pair:
    """Two effects over the robots.

    Attributes
    ----------
    both, first_only, second_only, neither : numbers of robots.
    odds_ratio : above 1, they come together; below 1, one stands for the other.
    p : Fisher's exact test, two-sided.
    is_found : at the false discovery rate asked for, over all pairs.
    """

    first: str
    second: str
    both: int
    first_only: int
    second_only: int
    neither: int
    odds_ratio: float
    p: float
    is_found: bool = False


def effects_of_robots(
    named: Mapping[str, Mapping[str, int]], diagnosed: Mapping[str, int]
) -> dict[str, set[str]]:
    """Each robot's effects.

    Parameters
    ----------
    named : robot to effect to the number of sets that name it; diagnosed: robot to its sets with a verdict.
    """
    return {
        robot: {name for name, count in named.get(robot, {}).items() if count >= SHARE_OF_SETS * sets}
        for robot, sets in diagnosed.items()
        if sets
    }


def pairs(robots: Mapping[str, set[str]]) -> list[Pair]:
    """Every pair of effects of which neither is on all robots nor on none."""
    names = sorted({name for effects in robots.values() for name in effects})
    telling = [name for name in names if any(name not in effects for effects in robots.values())]
    out = []
    for first, second in combinations(telling, 2):
        counts = Counter((first in effects, second in effects) for effects in robots.values())
        both, one, other, none = (
            counts[key] for key in ((True, True), (True, False), (False, True), (False, False))
        )
        ratio, p = scipy.stats.fisher_exact(np.array([[both, one], [other, none]]))
        out.append(Pair(first, second, both, one, other, none, float(ratio), float(p)))
    return out
