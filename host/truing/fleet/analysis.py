"""What a fleet's owner asks: who differs, what drifts and since when, which effects come together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from truing.fleet.drift import Change, change_of
from truing.fleet.series import Series, by_quantity, day_text, series_of
from truing.fleet.sisters import RobotNumber, own_numbers, pooled
from truing.fleet.tables import Tables
from truing.fleet.together import Pair, effects_of_robots, pairs
from truing.fleet.variation import variation_of

if TYPE_CHECKING:
    import pyarrow as pa

# Of what is called found, the share that may be by chance.
FALSE_DISCOVERY_RATE = 0.01


@dataclass(frozen=True, slots=True)
class CommonTrend:
    """The change of all sisters together: mean of their own lines, per year, and its 95 % interval."""

    group: str
    parameter: str
    wheel: str
    unit: str
    robots: int
    rate: float
    ci95: tuple[float, float]
    level: float


@dataclass(frozen=True, slots=True)
class Analysis:
    """The answers, and the series that they come from.

    Attributes
    ----------
    changes : of every series that is long enough, found or not.
    numbers : every robot's number of every quantity.
    robots : each robot's effects.
    """

    series: tuple[Series, ...]
    changes: tuple[Change, ...]
    numbers: tuple[RobotNumber, ...]
    trends: tuple[CommonTrend, ...]
    robots: dict[str, set[str]]
    pairs: tuple[Pair, ...]
    rate: float

    @property
    def drifting(self) -> list[Change]:
        """Found changes, the surest first."""
        return sorted((one for one in self.changes if one.is_found), key=lambda one: one.p)

    @property
    def differing(self) -> list[RobotNumber]:
        """Robots' numbers that are not their sisters', the surest first."""
        return sorted((one for one in self.numbers if one.differs), key=lambda one: one.p)


def analyse(tables: Tables, rate: float = FALSE_DISCOVERY_RATE) -> Analysis:
    """Answer from the fleet's tables.

    Parameters
    ----------
    rate : false discovery rate, over robots and parameters, of drifts and of differences.
    """
    series = series_of(tables.numbers)
    changes: list[Change] = []
    numbers: list[RobotNumber] = []
    trends: list[CommonTrend] = []
    quantities = by_quantity(series)
    variations = {quantity: variation_of(sisters) for quantity, sisters in quantities.items()}
    for quantity, sisters in quantities.items():
        variation = variations[quantity]
        changes += [change for one in sisters if (change := change_of(one, variation)) is not None]
        numbers += own_numbers(sisters, variation)
        trend = _trend(sisters, variation.tau)
        trends += [] if trend is None else [trend]
    found = discoveries([one.p for one in changes], rate)
    changes = [replace(one, is_found=bool(yes)) for one, yes in zip(changes, found, strict=True)]
    differs = discoveries([one.p for one in numbers], rate)
    numbers = [replace(one, differs=bool(yes)) for one, yes in zip(numbers, differs, strict=True)]
    alike: dict[tuple[str, str, str], list[RobotNumber]] = {}
    for number in numbers:
        alike.setdefault((number.group, number.parameter, number.wheel), []).append(number)
    shared = tuple(number for sisters_numbers in alike.values() for number in pooled(sisters_numbers))
    robots = _robots(tables)
    together = pairs(robots)
    sure = discoveries([one.p for one in together], rate)
    together = [replace(one, is_found=bool(yes)) for one, yes in zip(together, sure, strict=True)]
    return Analysis(tuple(series), tuple(changes), shared, tuple(trends), robots, tuple(together), rate)


def discoveries(p: Sequence[float], rate: float) -> list[bool]:
    """Which of these stand at a false discovery rate (Benjamini and Hochberg); NaN does not."""
    from statsmodels.stats.multitest import multipletests

    values = np.array(p, dtype=np.float64)
    known = np.isfinite(values)
    out = np.zeros(len(values), dtype=bool)
    if known.any():
        out[known] = multipletests(values[known], alpha=rate, method="fdr_bh")[0]
    return [bool(one) for one in out]


def _trend(sisters: Sequence[Series], tau: float) -> CommonTrend | None:
    """The mean of the sisters' lines; None with fewer than three."""
    from statsmodels.stats.meta_analysis import combine_effects

    slopes, variances, levels = [], [], []
    for one in sisters:
        if len(one) < 3 or one.t_days[-1] - one.t_days[0] < 1.0:
            continue
        years = (one.t_days - one.t_days[0]) / 365.25
        w = 1.0 / (one.sigma**2 + tau**2)
        mean = float(w @ years) / float(w.sum())
        power = float(w @ (years - mean) ** 2)
        slopes.append(float((w * one.value) @ (years - mean)) / power)
        variances.append(1.0 / power)
        levels.append(float(w @ one.value) / float(w.sum()))
    if len(slopes) < 3:
        return None
    y, v = np.array(slopes), np.array(variances)
    scale = float(np.median(np.abs(y))) or 1.0
    found = combine_effects(y / scale, v / scale**2, method_re="iterated")
    mean = float(found.mean_effect_re) * scale
    # Hartung and Knapp 2001, Sidik and Jonkman 2002.
    half = float(scipy.stats.t.ppf(0.975, len(y) - 1)) * float(found.sd_eff_w_re_hksj) * scale
    first = sisters[0]
    return CommonTrend(
        first.group,
        first.parameter,
        first.wheel,
        first.unit,
        len(y),
        mean,
        (mean - half, mean + half),
        float(np.median(levels)),
    )


def _robots(tables: Tables) -> dict[str, set[str]]:
    sets = tables.sets.select(["robot", "verdict"]).to_pylist()
    diagnosed = Counter(row["robot"] for row in sets if row["verdict"] is not None)
    named: dict[str, Counter[str]] = {}
    once = {(row["robot"], row["set"], row["effect"]) for row in _effect_keys(tables.effects)}
    for robot, _, effect in once:
        named.setdefault(robot, Counter())[effect] += 1
    return effects_of_robots(named, diagnosed)


def _effect_keys(effects: pa.Table) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = effects.select(["robot", "set", "effect"]).to_pylist()
    return rows


def to_json(analysis: Analysis) -> dict[str, Any]:
    """What was found, for `--json`."""
    return {
        "false_discovery_rate": analysis.rate,
        "drifting": [_change_json(one) for one in analysis.drifting],
        "differing": [_number_json(one) for one in analysis.differing],
        "common_trends": [
            {"group": one.group, "parameter": one.parameter, "wheel": one.wheel, "robots": one.robots,
             "rate_per_year": one.rate, "ci95": list(one.ci95), "unit": one.unit}
            for one in analysis.trends
        ],
        "together": [
            {"effects": [one.first, one.second], "robots_with_both": one.both, "odds_ratio": one.odds_ratio,
             "p": one.p}
            for one in analysis.pairs
            if one.is_found
        ],
        "effects": {robot: sorted(names) for robot, names in analysis.robots.items() if names},
    }  # fmt: skip


def _change_json(one: Change) -> dict[str, Any]:
    return {
        "robot": one.series.robot,
        "group": one.series.group,
        "parameter": one.series.parameter,
        "wheel": one.series.wheel,
        "unit": one.series.unit,
        "form": one.form,
        "p": one.p,
        "step" if one.form == "step" else "rate_per_year": one.rate,
        "ci95": list(one.ci95),
        "since": day_text(one.since_days),
        "since_ci95": [day_text(day) for day in one.since95],
        "before": one.level,
        "now": one.now,
        "sets": len(one.series),
    }


def _number_json(one: RobotNumber) -> dict[str, Any]:
    return {
        "robot": one.robot,
        "group": one.group,
        "parameter": one.parameter,
        "wheel": one.wheel,
        "unit": one.unit,
        "own": one.own,
        "own_sd": one.own_sd,
        "sisters": one.centre,
        "p": one.p,
        "sets": one.sets,
    }


def analysis_tables(analysis: Analysis) -> dict[str, pa.Table]:
    """The answers as tables by the names of their files: robots' numbers, and changes."""
    import pyarrow as pa

    numbers = [_number_json(one) | {"differs": one.differs, "pooled": one.pooled, "pooled_sd": one.pooled_sd}
               for one in analysis.numbers]  # fmt: skip
    changes = []
    for one in analysis.changes:
        row = _change_json(one) | {"found": one.is_found}
        row["rate"] = row.pop("step", None) if one.form == "step" else row.pop("rate_per_year")
        row["low"], row["high"] = row.pop("ci95")
        row["since_low"], row["since_high"] = row.pop("since_ci95")
        changes.append(row)
    return {"robots": _table(pa, numbers, _NUMBERS), "changes": _table(pa, changes, _CHANGES)}


_TEXTS = ("robot", "group", "parameter", "wheel", "unit", "form", "since", "since_low", "since_high")
_NUMBERS = (
    *("robot", "group", "parameter", "wheel", "unit", "sets", "own", "own_sd", "sisters", "p"),
    *("differs", "pooled", "pooled_sd"),
)
_CHANGES = (
    *("robot", "group", "parameter", "wheel", "unit", "sets", "form", "p", "found", "rate", "low", "high"),
    *("since", "since_low", "since_high", "before", "now"),
)


def _table(arrow: Any, rows: list[dict[str, Any]], names: tuple[str, ...]) -> pa.Table:
    kinds = dict.fromkeys(_TEXTS, arrow.string()) | {"sets": arrow.int64()}
    kinds |= {"differs": arrow.bool_(), "found": arrow.bool_()}
    schema = arrow.schema([(name, kinds.get(name, arrow.float64())) for name in names])
    table: pa.Table = arrow.Table.from_pylist(
        [{name: row[name] for name in names} for row in rows], schema=schema
    )
    return table
