"""The answers about a fleet in sentences and tables, the same for the terminal and the pages."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from truing.diagnose.present.text import effect_title
from truing.fleet.analysis import Analysis, CommonTrend
from truing.fleet.drift import Change
from truing.fleet.series import day_text, title_of
from truing.fleet.sisters import MIN_SISTERS, RobotNumber
from truing.fleet.together import Pair
from truing.identify.tables import PlainTable

UNITS = {"effort": "of full effort"}
_SMALLER = {"s": ("ms", 1e3), "effort": ("% of full effort", 1e2)}


def amount(value: float, unit: str) -> str:
    """A number with its unit: `4.71 % of full effort`."""
    small, scale = _SMALLER.get(unit, (unit, 1.0))
    return f"{value * scale:.3g} {UNITS.get(small, small)}"


def cell(value: float, unit: str) -> str:
    """A number with its unit as a table has it: `4.71 %`, of full effort."""
    return amount(value, unit).removesuffix(" of full effort")


def span(low: float, high: float, unit: str) -> str:
    """Both ends of an interval, without the unit."""
    scale = _SMALLER.get(unit, (unit, 1.0))[1]
    return f"{low * scale:.3g} to {high * scale:.3g}"


def summary_lines(analysis: Analysis, sets: int, robots: int, failed: int) -> list[str]:
    """What the fleet shows, in three lines."""
    drifting, differing = analysis.drifting, analysis.differing
    first = f"{sets} sets of {robots} robots" + (f", {failed} of them with an error." if failed else ".")
    if drifting:
        worst = drifting[0]
        names = len({one.series.robot for one in drifting})
        second = f"{names} of {robots} robots change with time; the surest: {change_text(worst)}."
    else:
        tested = len(analysis.changes)
        second = f"No robot's numbers change with time, of {tested} series that are long enough to say."
    if differing:
        one = differing[0]
        names = len({number.robot for number in differing})
        third = f"{names} of {robots} robots differ from their sisters; the surest: {difference_text(one)}."
    elif any(math.isfinite(one.p) for one in analysis.numbers):
        third = "No robot differs from its sisters by more than they differ from each other."
    else:
        third = f"There are too few sisters to compare: at least {MIN_SISTERS} robots of a group are needed."
    return [first, second, third]


def change_text(one: Change) -> str:
    """A change in words."""
    series = one.series
    grown = f"{100.0 * one.relative:+.0f} %" if math.isfinite(one.relative) else "changed"
    if one.form == "line":
        when = f"from the first set ({day_text(one.since_days)}) on"
    else:
        low, high = (day_text(day) for day in one.since95)
        when = (
            f"{'at once on' if one.form == 'step' else 'since'} {day_text(one.since_days)} ({low} to {high})"
        )
    return f"{series.robot}, {series.title}: {grown}, {amount(one.level, series.unit)} to " + (
        f"{amount(one.now, series.unit)}, {when}"
    )


def difference_text(one: RobotNumber) -> str:
    """A difference in words."""
    return (
        f"{one.robot}, {title_of(one.parameter, one.wheel)}: {amount(one.own, one.unit)}, its sisters "
        f"{amount(one.centre, one.unit)}"
    )


def change_table(changes: Sequence[Change], rate: float) -> PlainTable:
    """Found changes."""
    table = PlainTable(
        "What changes with time",
        ["Robot", "Number", "Form", "Before", "Now", "Change", "Per year (95 %)", "Since (95 %)", "Sets"],
        [False, False, False, True, True, True, True, False, True],
    )
    for one in changes:
        unit = one.series.unit
        low, high = (day_text(day) for day in one.since95)
        since = day_text(one.since_days) + ("" if one.form == "line" else f" ({low} to {high})")
        per_year = "–" if one.form == "step" else f"{cell(one.rate, unit)} ({span(*one.ci95, unit)})"
        grown = f"{100.0 * one.relative:+.1f} %" if math.isfinite(one.relative) else "–"
        table.rows.append(
            [
                *(one.series.robot, one.series.title, one.form, cell(one.level, unit), cell(one.now, unit)),
                *(grown, per_year, since, str(len(one.series))),
            ]
        )
    table.remarks = [
        f"False discovery rate {100.0 * rate:g} % over all robots and parameters. line: from the first "
        "set on; hinge: constant, then a line; step: at once. The rate's interval holds for the date given. "
        "Friction in per cent of full effort."
    ]
    return table


def difference_table(numbers: Sequence[RobotNumber], rate: float) -> PlainTable:
    """Robots that differ."""
    table = PlainTable(
        "Who differs from the sisters",
        ["Robot", "Number", "Own", "Sisters' median", "Difference", "Sets"],
        [False, False, True, True, True, True],
    )
    for one in numbers:
        apart = f"{100.0 * one.relative:+.1f} %" if math.isfinite(one.relative) else "–"
        title = title_of(one.parameter, one.wheel)
        table.rows.append(
            [one.robot, title, cell(one.own, one.unit), cell(one.centre, one.unit), apart, str(one.sets)]
        )
    table.remarks = [
        f"Beyond the spread among the sisters and the robot's own uncertainty, at a false discovery rate of "
        f"{100.0 * rate:g} % over all robots and parameters."
    ]
    return table


def trend_table(trends: Sequence[CommonTrend]) -> PlainTable:
    """What changes on all sisters together."""
    table = PlainTable(
        "What changes on all sisters together",
        ["Number", "Robots", "Level", "Per year (95 %)", "Other than zero"],
        [False, True, True, True, False],
    )
    for one in trends:
        group = f"{one.group}: " if one.group else ""
        sure = "yes" if one.ci95[0] > 0.0 or one.ci95[1] < 0.0 else "no"
        rate = f"{cell(one.rate, one.unit)} ({span(*one.ci95, one.unit)})"
        title = group + title_of(one.parameter, one.wheel)
        table.rows.append([title, str(one.robots), cell(one.level, one.unit), rate, sure])
    table.remarks = [
        "Mean of the robots' own lines (random-effects meta-analysis): season, floor, common wear."
    ]
    return table


def effect_table(robots: dict[str, set[str]]) -> PlainTable:
    """How many robots have each effect."""
    table = PlainTable(
        "Effects that the simulation lacks", ["Effect", "Robots", "Share"], [False, True, True]
    )
    for name, count in Counter(name for names in robots.values() for name in names).most_common():
        table.rows.append([effect_title(name), str(count), f"{100.0 * count / len(robots):.0f} %"])
    table.remarks = ["A robot has an effect that at least half of its diagnosed sets name."]
    return table


def pair_table(pairs: Sequence[Pair], rate: float) -> PlainTable:
    """Effects that come together, or exclude each other."""
    table = PlainTable(
        "Effects that come together",
        ["Effects", "Both", "One alone", "Neither", "Odds ratio"],
        [False, True, True, True, True],
    )
    for one in pairs:
        odds = "∞" if math.isinf(one.odds_ratio) else f"{one.odds_ratio:.2g}"
        names = f"{effect_title(one.first)} + {effect_title(one.second)}"
        alone = str(one.first_only + one.second_only)
        table.rows.append([names, str(one.both), alone, str(one.neither), odds])
    table.remarks = [
        f"Fisher's exact test over robots, at a false discovery rate of {100.0 * rate:g} % over all pairs. "
        "An odds ratio below one: one is named where the other is not."
    ]
    return table


def own_table(numbers: Sequence[RobotNumber]) -> PlainTable:
    """A robot's numbers: its own, its sisters', and pooled."""
    table = PlainTable(
        "Its numbers",
        ["Number", "Own (95 %)", "Sets", "Sisters' median", "Pooled with the sisters (95 %)"],
        [False, True, True, True, True],
    )
    for one in numbers:
        own = f"{cell(one.own, one.unit)} ± {_half(one.own_sd, one.unit)}"
        shared = (
            "differs: its own"
            if one.differs
            else (f"{cell(one.pooled, one.unit)} ± {_half(one.pooled_sd, one.unit)}")
        )
        centre = cell(one.centre, one.unit) if math.isfinite(one.centre) else "–"
        table.rows.append([title_of(one.parameter, one.wheel), own, str(one.sets), centre, shared])
    table.remarks = [
        "Mean over its sets. Pooled: the estimate to use where the robot has few sets of its own."
    ]
    return table


def _half(sd: float, unit: str) -> str:
    return f"{1.96 * sd * _SMALLER.get(unit, (unit, 1.0))[1]:.2g}"
