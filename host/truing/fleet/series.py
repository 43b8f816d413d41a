"""The numbers of a fleet in order of time: one series for each robot, parameter and wheel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from truing.arrays import FloatArray

if TYPE_CHECKING:
    import pyarrow as pa

DAY_S = 86_400.0
# Half the width of a 95 % interval, in standard deviations.
Z95 = 1.959964
TITLES = {"gain_mps": "gain", "time_constant_s": "time constant", "friction": "friction", "delay_s": "delay"}


@dataclass(frozen=True, slots=True)
class Series:
    """One parameter of one wheel of one robot, set by set.

    Attributes
    ----------
    t_days : since 1970, shape (n,), in order.
    value : shape (n,), in `unit`.
    sigma : standard deviation of each from its own set's interval, shape (n,).
    """

    robot: str
    group: str
    parameter: str
    wheel: str
    unit: str
    t_days: FloatArray
    value: FloatArray
    sigma: FloatArray

    def __len__(self) -> int:
        return len(self.value)

    @property
    def quantity(self) -> tuple[str, str, str]:
        """What is compared between sisters: group, parameter, wheel."""
        return self.group, self.parameter, self.wheel

    @property
    def title(self) -> str:
        """In words: `friction, left wheel`."""
        return title_of(self.parameter, self.wheel)


def title_of(parameter: str, wheel: str) -> str:
    """A parameter of a wheel in words."""
    return f"{TITLES.get(parameter, parameter.replace('_', ' '))}, {wheel} wheel"


def day_text(day: float) -> str:
    """A day since 1970 as a date."""
    return datetime.fromtimestamp(day * DAY_S, UTC).date().isoformat()


def series_of(numbers: pa.Table) -> list[Series]:
    """Every series, from the table of numbers; numbers without an interval are left out."""
    import pyarrow.compute as pc

    keys = ["robot", "group", "parameter", "wheel"]
    order = [*keys, "recorded"]
    known = numbers.filter(
        pc.and_(
            pc.is_valid(numbers["value"]), pc.and_(pc.is_valid(numbers["low"]), pc.is_valid(numbers["high"]))
        )
    ).sort_by([(name, "ascending") for name in order])
    if not len(known):
        return []
    seconds = known["recorded"].cast("int64").to_numpy() / 1e6
    value, low, high = (known[name].to_numpy() for name in ("value", "low", "high"))
    # An interval of no width is one of a number that a log's rounding holds fast.
    sigma = np.maximum((high - low) / (2.0 * Z95), 1e-9 * np.abs(value) + 1e-12)
    texts = [known[name].to_pylist() for name in (*keys, "unit")]
    rows: list[tuple[str, str, str, str, str]] = list(zip(*texts, strict=True))
    starts = [0, *(k for k in range(1, len(rows)) if rows[k] != rows[k - 1]), len(rows)]
    return [Series(*rows[a], seconds[a:b] / DAY_S, value[a:b], sigma[a:b]) for a, b in pairwise(starts)]


def by_quantity(series: Sequence[Series]) -> dict[tuple[str, str, str], list[Series]]:
    """Sisters' series of one parameter and wheel together."""
    out: dict[tuple[str, str, str], list[Series]] = {}
    for one in series:
        out.setdefault(one.quantity, []).append(one)
    return out
