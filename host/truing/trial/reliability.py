"""Reliability diagram: how often effects named with a stated confidence are concealed."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from truing.trial.figures import bounds
from truing.trial.score import IN_CATALOGUE, Score

# Edges of the bins of stated confidence; most effects are named with a high one.
EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.98, 1.0)


@dataclass(frozen=True)
class Bin:
    """Named effects whose confidence lies between two edges.

    Attributes
    ----------
    low, high : the edges; `high` belongs to the last bin only.
    stated : mean stated confidence.
    true, number : how many of the effects are concealed in their trial, of how many.
    """

    low: float
    high: float
    stated: float
    true: int
    number: int

    @property
    def is_calibrated(self) -> bool:
        """Whether the 95 % bounds of the observed share contain the mean stated confidence."""
        low, high = bounds(self.true, self.number)
        return low <= self.stated <= high


def reliability(scores: Sequence[Score]) -> list[Bin]:
    """The bins that hold any named effect, in rising order.

    Effects concealed outside the catalogue have no name there: whatever is named in their trials is wrong.
    """
    pairs = [
        (stated, each.family in IN_CATALOGUE and name in each.hidden)
        for each in scores
        for name, stated in each.confidences.items()
    ]
    out = []
    for low, high in itertools.pairwise(EDGES):
        inside = [(p, hit) for p, hit in pairs if low <= p < high or (p == high == EDGES[-1])]
        if inside:
            stated = sum(p for p, _ in inside) / len(inside)
            out.append(Bin(low, high, stated, sum(hit for _, hit in inside), len(inside)))
    return out


def reliability_table(scores: Sequence[Score]) -> list[str]:
    """The diagram as lines of Markdown; a bar of ten characters shows the observed share."""
    bins = reliability(scores)
    if not bins:
        return ["No trial of this campaign holds confidences.", ""]
    lines = [
        "| stated | mean | named effects | concealed there | 95 % bounds | holds | |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for one in bins:
        low, high = bounds(one.true, one.number)
        share = one.true / one.number
        bar = ("#" * round(10 * share)).ljust(10, ".")
        lines.append(
            f"| {one.low:g} to {one.high:g} | {100 * one.stated:.0f} % | {one.number} | {100 * share:.0f} % "
            f"| {100 * low:.0f} % to {100 * high:.0f} % | {'yes' if one.is_calibrated else 'no'} | `{bar}` |"
        )
    return [*lines, ""]
