"""A campaign as a page and as JSON: figures beside their bars, other methods, verdicts by effect."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from truing.trial.figures import Figure, bounds, by_method, figures
from truing.trial.order import Block
from truing.trial.reliability import reliability_table
from truing.trial.score import Score

# Rows of the table of verdicts for sets of effects.
_SETS = {"two": "two effects", "several": "three or four effects"}
_STRENGTHS = (0.3, 0.5, 1.0, 2.0, 4.0, math.inf)


def to_json(scores: Sequence[Score]) -> dict[str, Any]:
    """The campaign as JSON."""
    return {
        "schema": 2,
        "figures": [{**asdict(each), "met": each.met} for each in figures(scores)],
        "methods": by_method(scores),
        "trials": [each.to_json() for each in scores],
    }


def to_markdown(scores: Sequence[Score], *, trials: int, seed: int, block: Block) -> str:
    """The campaign as a page."""
    last = "" if block == "main" else f" --block {block}"
    lines = [
        f"# Concealed trials: {len(scores)} of {trials}",
        "",
        f"`truing trial --campaign {trials} --seed {seed}{last}` makes them again;",
        "`truing trial --effect E --seed S` with a line of the last table makes one of them (`--core` unless",
        "it ran on the board, and `--strength` where it says weak or full). S: RMS that the effect leaves",
        "when the baseline's numbers are refitted, over noise and disturbance. Bounds are 95 % (Clopper and",
        "Pearson; medians by order).",
        "",
        *_figure_table(figures(scores)),
        "",
        "## Beside other methods",
        "",
        "The same recordings. `right`: the effect alone for one (ours also in a set of at most three, first",
        "line), both with at most one extra for two, none named where nothing is concealed, `unexplained`",
        "outside the catalogue, which the others cannot say. The picker has the diagnosis' own fits and",
        "takes the one with the smallest training error.",
        "",
        *_method_table(scores),
        "",
        *_gap_lines(scores),
        "## Stated confidence",
        "",
        "Effects that the verdicts list, by the confidence stated in each. It holds where the bounds of the",
        "share that is concealed in its trial contain the mean stated one.",
        "",
        *reliability_table(scores),
        "## By strength",
        "",
        "| S | trials | named | alone | ambiguous | gap closed, median |",
        "| --- | --- | --- | --- | --- | --- |",
        *_strength_rows(scores),
        "",
        "## Verdicts by concealed effect",
        "",
        "| concealed | trials | right | verdicts (number of trials) |",
        "| --- | --- | --- | --- |",
        *_confusion_rows(scores),
        "",
        "## Every trial",
        "",
        "| E | S | strength | driving | board | concealed (S) | verdict |",
        "| --- | --- | --- | --- | --- | --- | --- |",
        *(_trial_row(each) for each in scores),
        "",
    ]
    return "\n".join(lines)


def _figure_table(rows: Sequence[Figure]) -> list[str]:
    out = ["| figure | value | 95 % bounds | trials | bar | met |", "| --- | --- | --- | --- | --- | --- |"]
    for each in rows:
        if each.number == 0:
            out.append(f"| {each.title} | - | - | 0 | {_bar(each)} | - |")
            continue
        met = {None: "", True: "yes", False: "no"}[each.met]
        value, limits = _number(each, each.value), f"{_number(each, each.low)} to {_number(each, each.high)}"
        out.append(f"| {each.title} | {value} | {limits} | {each.number} | {_bar(each)} | {met} |")
    return out


def _number(figure: Figure, value: float) -> str:
    return f"{100 * value:.0f} %" if figure.share else f"{value:.3g}"


def _bar(figure: Figure) -> str:
    if figure.bar is None:
        return ""
    if figure.upper_bar is not None:
        return f"{_number(figure, figure.bar)} to {_number(figure, figure.upper_bar)}"
    return f"{'at most' if figure.is_max else 'at least'} {_number(figure, figure.bar)}"


def _method_table(scores: Sequence[Score]) -> list[str]:
    table = by_method(scores)
    titles = [title for title, _, _ in next(iter(table.values()))]
    out = ["| method | " + " | ".join(titles) + " |", "| --- |" + " --- |" * len(titles)]
    for name, cells in table.items():
        out.append(f"| {name} | " + " | ".join(_cell(hits, number) for _, hits, number in cells) + " |")
    return out


def _cell(hits: int, number: int) -> str:
    if number == 0:
        return "-"
    low, high = bounds(hits, number)
    return f"{hits} of {number} ({100 * low:.0f} to {100 * high:.0f} %)"


def _gap_lines(scores: Sequence[Score]) -> list[str]:
    """The gap closed by methods that have a model to simulate; the true structure refitted closes all."""
    gaps: dict[str, list[float]] = {"truing": []}
    for each in scores:
        own = each.measured.get("gap_closed")
        if own is None:
            continue
        gaps["truing"].append(float(own))
        for name, value in each.measured.get("opinion_gaps", {}).items():
            gaps.setdefault(name, []).append(float(value))
    listed = [f"{name} {np.median(values):.2f} (of {len(values)})" for name, values in gaps.items() if values]
    if not listed:
        return []
    return [f"Gap closed, median: {', '.join(listed)}; the true structure refitted 1 by definition.", ""]


def _strength_rows(scores: Sequence[Score]) -> list[str]:
    one = [each for each in scores if each.family == "one"]
    rows = []
    for low, high in itertools.pairwise(_STRENGTHS):
        group = [each for each in one if low <= each.strength < high]
        title = f"{low:g} to {high:g}" if math.isfinite(high) else f"{low:g} and more"
        gaps = [float(e.measured["gap_closed"]) for e in group if e.measured.get("gap_closed") is not None]
        cells = [
            title,
            str(len(group)),
            *(_cell(sum(hits), len(group)) for hits in (
                [e.named for e in group],
                [e.named_alone for e in group],
                [e.verdict == "ambiguous" for e in group],
            )),
            f"{np.median(gaps):.2f}" if gaps else "-",
        ]  # fmt: skip
        rows.append("| " + " | ".join(cells) + " |")
    return rows


def _confusion_rows(scores: Sequence[Score]) -> list[str]:
    groups: dict[str, list[Score]] = {}
    for each in scores:
        title = " + ".join(sorted(each.hidden)) or "nothing"
        groups.setdefault(_SETS.get(each.family, title), []).append(each)
    rows = []
    for name, group in sorted(groups.items()):
        said = Counter(f"{one.verdict}: {', '.join(one.said) or '-'}" for one in group)
        told = "; ".join(f"{text} ({number})" for text, number in said.most_common())
        rows.append(f"| {name} | {len(group)} | {sum(one.right for one in group)} | {told} |")
    return rows


def _trial_row(each: Score) -> str:
    strength = {None: "", True: "weak", False: "full"}[each.weak]
    pairs = zip(each.hidden, each.strengths, strict=True)
    hidden = ", ".join(f"{name} ({value:.2f})" for name, value in pairs) or "nothing"
    verdict = f"{each.verdict}: {', '.join(each.said) or '-'}"
    cells = (each.effect, str(each.seed), strength, each.driving, "yes" if each.on_board else "", hidden)
    return "| " + " | ".join((*cells, verdict)) + " |"
