"""Scores one trial: what the diagnosis and other methods said, against what was concealed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

NAMED = ("missing_physics", "partly_explained", "ambiguous")
NO_EFFECT_NAMED = ("consistent", "parameters_only")
MAX_AMBIGUOUS = 3
IN_CATALOGUE = ("one", "two", "several")
OUT_OF_CATALOGUE = ("outside", "intermittent")
# A place is right when the spans hold this much of the effect's energy, and are this much of it.
PLACE_RIGHT = 0.5
# A model that is worse than the baseline by more than this share does harm.
HARM = 1.01


@dataclass(frozen=True)
class Score:
    """One trial's score.

    Attributes
    ----------
    effect, seed, weak, on_board : what was asked for.
    named : the concealed effect is named, alone or among three at most; of a pair both, one extra at most; of
        several all, at most as many extra.
    named_alone : `missing_physics` with exactly what was concealed.
    confidently_wrong : `missing_physics` with an effect that is not there.
    right : what the family of the trial asks for.
    place_right : of the outside: the spans are where the effect is.
    later : verdicts after each proposed run that was driven.
    resolved : whether an ambiguity that held the truth ended with it, after at most two proposed runs.
    measured : figures beside the truth (`measure.Measured`).
    methods : for each other method, whether it is right, and whether it names what is not there.
    confidences : stated confidence, 0 to 1, in each effect that the verdict lists.
    """

    effect: str
    seed: int
    weak: bool | None
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
    place_right: bool | None
    later: tuple[str, ...]
    resolved: bool | None
    seconds: float
    cpu_s: float
    building_cpu_s: float
    scoring_cpu_s: float
    sha256: str
    measured: dict[str, Any] = field(default_factory=dict)
    methods: dict[str, tuple[bool, bool]] = field(default_factory=dict)
    confidences: dict[str, float] = field(default_factory=dict)

    @property
    def strength(self) -> float:
        """S of the weakest concealed effect."""
        return min(self.strengths, default=math.nan)

    def to_json(self) -> dict[str, Any]:
        """As a line of a campaign's file."""
        return asdict(self)

    @staticmethod
    def from_json(values: dict[str, Any]) -> Score:
        """The other way; keys of other versions are passed over."""
        known = {each.name for each in fields(Score)}
        kept = {key: value for key, value in values.items() if key in known}
        for name in ("hidden", "strengths", "said", "later"):
            kept[name] = tuple(kept[name])
        kept["methods"] = {name: (bool(a), bool(b)) for name, (a, b) in kept["methods"].items()}
        return Score(**kept)


@dataclass(frozen=True)
class Judgement:
    """A verdict compared with what was concealed."""

    named: bool
    named_alone: bool
    confidently_wrong: bool
    right: bool


def judge(
    kind: str,
    said: tuple[str, ...],
    family: str,
    hidden: tuple[str, ...],
    sure: tuple[str, ...] | None = None,
) -> Judgement:
    """Compare a verdict and its names with what was concealed.

    Parameters
    ----------
    sure : those of `said` that are named without an alternative; all where None.
    """
    there = set(hidden) if family in IN_CATALOGUE else set()
    every = bool(there) and there <= set(said) and kind in NAMED
    extras = len(set(said) - there)
    max_extras = {"one": MAX_AMBIGUOUS - 1, "two": 1}.get(family, len(there))
    named = every and extras <= max_extras
    if family == "null":
        right = kind in NO_EFFECT_NAMED
    elif family in OUT_OF_CATALOGUE:
        right = kind in ("unexplained", "partly_explained")
    else:
        right = named
    certain = kind in ("missing_physics", "partly_explained")
    return Judgement(
        named=named,
        named_alone=certain and bool(there) and set(said) == there,
        confidently_wrong=certain and not set(said if sure is None else sure) <= there,
        right=right,
    )


def judge_method(names: list[str], family: str, hidden: tuple[str, ...]) -> tuple[bool, bool]:
    """Whether a method that knows no ambiguity is right, and whether it names what is not there."""
    kind = "missing_physics" if names else "parameters_only"
    worth = judge(kind, tuple(names), family, hidden)
    # For a single effect a method must name it alone: it has no way to say that several explain as much.
    right = worth.named_alone if family == "one" else worth.right
    return right, worth.confidently_wrong


def place_right(measured: dict[str, Any]) -> bool:
    """Whether the spans are where the effect is."""
    return (measured.get("covered") or 0.0) >= PLACE_RIGHT and (
        measured.get("effect_share") or 0.0
    ) >= PLACE_RIGHT


def resolved(kinds: Sequence[tuple[str, tuple[str, ...]]], hidden: tuple[str, ...]) -> bool:
    """Whether the last of these verdicts is the truth, without ambiguity."""
    kind, said = kinds[-1]
    return kind == "missing_physics" and set(said) == set(hidden)
