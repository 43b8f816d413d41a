"""Where likelihood and runs left out prefer different effects, the catalogue holds no right equation."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from truing.diagnose.compare import Comparison
from truing.diagnose.verdict import is_contradicted

# Log-likelihood gains over the refitted baseline, nats.
GAINS = {(): 0.0, ("payload_change",): 280.0, ("direction_asymmetry",): 360.0, ("coast_decay",): 275.0}


class Search:
    """A search whose fits have the gains above."""

    def __init__(self, *, exceeds_noise: bool = False, differs: float = 0.7, without: str = "") -> None:
        self.fits = {names: fitted(names) for names in GAINS if without not in names or not without}
        self.problem = SimpleNamespace(exceeds_noise=lambda _: exceeds_noise, evidence=lambda _: 0.0)
        self.differs = differs

    def ranked(self, count: int) -> list[Any]:
        return [one for names, one in self.fits.items() if len(names) == count]

    def compare(self, one: Any, other: Any) -> Comparison:
        gain = GAINS[one.effects] - GAINS[other.effects]
        return Comparison(gain, gain, self.differs)


def fitted(names: tuple[str, ...]) -> Any:
    return SimpleNamespace(effects=names, residual=SimpleNamespace(speeds=np.zeros((1, 2))))


def verdict(search: Search, name: str = "payload_change") -> bool:
    return is_contradicted(search, search.fits[name,])  # type: ignore[arg-type]


def test_an_effect_that_the_likelihood_does_not_prefer_is_contradicted() -> None:
    assert verdict(Search())


def test_the_most_likely_effect_is_not() -> None:
    assert not verdict(Search(), "direction_asymmetry")


def test_a_little_more_likely_is_no_contradiction() -> None:
    assert not verdict(Search(without="direction_asymmetry"), "coast_decay")


@pytest.mark.parametrize("search", [Search(exceeds_noise=True), Search(differs=0.1)])
def test_nor_where_no_noise_model_is_right_or_nothing_changes(search: Search) -> None:
    assert not verdict(search)
