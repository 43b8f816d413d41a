"""Scores verdicts against what was hidden, and sums them up with 95 % bounds."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

NAMED = ("missing_physics", "ambiguous")
MOST_AMBIGUOUS = 3


@dataclass(frozen=True)
class Score:
    """One trial's score.

    Attributes
    ----------
    named : the hidden effect is named, alone or in a set of at most three; of a pair both, one extra at most.
    named_alone : `missing_physics` with exactly what was hidden.
    confidently_wrong : `missing_physics` with an effect that is not there.
    right : what the family of the trial asks for.
    """

    effect: str
    seed: int
    family: str
    hidden: tuple[str, ...]
    strengths: tuple[float, ...]
    driving: str
    on_board: bool
    verdict: str
    said: tuple[str, ...]
    named: bool
    named_alone: bool
    confidently_wrong: bool
    right: bool
    seconds: float
    sha256: str


def score(
    effect: str,
    seed: int,
    verdict: dict[str, Any],
    answer: dict[str, Any],
    *,
    seconds: float,
    sha256: str,
    on_board: bool,
) -> Score:
    """Compare a verdict (the contract's JSON) with an opened answer."""
    hidden = tuple(str(each["name"]) for each in answer["effects"])
    said = tuple(str(each["name"]) for each in verdict["effects"])
    kind, family = str(verdict["verdict"]), str(answer["family"])
    in_catalogue = family in ("one", "two")
    there = set(hidden) if in_catalogue else set()
    every = bool(there) and there <= set(said) and kind in NAMED
    extras = len(set(said) - there)
    named = every and (len(said) <= MOST_AMBIGUOUS if family == "one" else extras <= 1)
    if family == "null":
        right = kind in ("consistent", "parameters_only")
    elif family == "outside":
        right = kind == "unexplained"
    else:
        right = named
    return Score(
        effect=effect,
        seed=seed,
        family=family,
        hidden=hidden,
        strengths=tuple(float(each["strength"]) for each in answer["effects"]),
        driving=str(answer["driving"]),
        on_board=on_board,
        verdict=kind,
        said=said,
        named=named,
        named_alone=kind == "missing_physics" and bool(there) and set(said) == there,
        confidently_wrong=kind == "missing_physics" and not set(said) <= there,
        right=right,
        seconds=seconds,
        sha256=sha256,
    )


def bounds(hits: int, trials: int) -> tuple[float, float]:
    """95 % bounds of a share (Wilson 1927)."""
    if trials == 0:
        return 0.0, 1.0
    z2 = 1.959964**2
    share = hits / trials
    middle = (share + z2 / (2 * trials)) / (1 + z2 / trials)
    half = math.sqrt(z2 * (share * (1 - share) / trials + z2 / (4 * trials**2))) / (1 + z2 / trials)
    return max(0.0, middle - half), min(1.0, middle + half)


@dataclass(frozen=True)
class Figure:
    """A share of trials beside its bar; `most`: the bar is an upper one."""

    title: str
    hits: int
    trials: int
    bar: float
    most: bool = False


def figures(scores: Iterable[Score]) -> list[Figure]:
    """The campaign's figures that are shares."""
    every = list(scores)
    one = [each for each in every if each.family == "one"]
    full = [each for each in one if each.strengths[0] >= 1.0]
    weak = [each for each in one if each.strengths[0] < 1.0]
    two, null, outside = ([e for e in every if e.family == name] for name in ("two", "null", "outside"))

    def share(title: str, group: list[Score], what: str, bar: float, *, most: bool = False) -> Figure:
        return Figure(title, sum(bool(getattr(each, what)) for each in group), len(group), bar, most)

    return [
        share("one effect, full strength, named", full, "named", 0.95),
        share("one effect, weak, named", weak, "named", 0.85),
        share("one effect, full strength, named alone (of all)", full, "named_alone", 0.85),
        share("one effect, weak, named alone (of all)", weak, "named_alone", 0.70),
        share("two effects, both named, one extra at most", two, "named", 0.75),
        share("nothing hidden, not accused", null, "right", 0.98),
        share("confidently wrong", every, "confidently_wrong", 0.02, most=True),
        share("outside the catalogue, unexplained", outside, "right", 0.80),
    ]


def to_json(scores: list[Score]) -> dict[str, Any]:
    """The campaign as JSON."""
    rows = [{**asdict(each), "bounds95": bounds(each.hits, each.trials)} for each in figures(scores)]
    return {"schema": 1, "figures": rows, "trials": [asdict(each) for each in scores]}


def to_markdown(scores: list[Score]) -> str:
    """The campaign as a page: figures with bounds and bars, what was said of what, by strength, time."""
    lines = [
        f"# Concealed trials: {len(scores)}",
        "",
        "| figure | share | 95 % bounds | bar |",
        "| --- | --- | --- | --- |",
    ]
    for each in figures(scores):
        low, high = bounds(each.hits, each.trials)
        bar = f"{'at most' if each.most else 'at least'} {100 * each.bar:.0f} %"
        share = f"{each.hits} of {each.trials}"
        lines.append(f"| {each.title} | {share} | {100 * low:.0f} to {100 * high:.0f} % | {bar} |")
    seconds = sorted(each.seconds for each in scores)
    if seconds:
        lines.append(f"| time per verdict, median | {seconds[len(seconds) // 2]:.1f} s | | at most 20 s |")
    lines += [
        "",
        "## What was said of what",
        "",
        "| hidden | right | said (number of trials) |",
        "| --- | --- | --- |",
    ]
    groups: dict[str, list[Score]] = {}
    for one in scores:
        groups.setdefault(" + ".join(sorted(one.hidden)) or "nothing", []).append(one)
    for name, group in sorted(groups.items()):
        said = Counter(f"{one.verdict}: {', '.join(one.said) or '-'}" for one in group)
        told = "; ".join(f"{text} ({number})" for text, number in said.most_common())
        lines.append(f"| {name} | {sum(one.right for one in group)} of {len(group)} | {told} |")
    lines += ["", "Seeds: " + ", ".join(f"{one.effect}/{one.seed}" for one in scores), ""]
    return "\n".join(lines)
