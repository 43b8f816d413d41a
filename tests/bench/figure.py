"""One measured figure: what it is, what it must reach, and what its peer reaches."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Figure:
    """One line of the table that `./run bench` prints.

    `better` says which way is good, and so which way `bar` and the ratio to the peer are read.
    """

    name: str
    value: float
    unit: str
    better: Literal["more", "less"]
    bar: float | None = None
    peer: str = ""
    peer_value: float | None = None

    @property
    def is_met(self) -> bool:
        """Whether the bar, if there is one, is reached."""
        if self.bar is None:
            return True
        return self.value >= self.bar if self.better == "more" else self.value <= self.bar

    @property
    def ratio(self) -> float | None:
        """This figure over its peer's, in the unit's own direction."""
        return None if self.peer_value is None else self.value / self.peer_value


def median_seconds(action: Callable[[], object], rounds: int) -> float:
    """Run `action` once to warm up, then `rounds` times; the median of its wall time in seconds."""
    action()
    spans = []
    for _ in range(rounds):
        begin = time.perf_counter()
        action()
        spans.append(time.perf_counter() - begin)
    return statistics.median(spans)
