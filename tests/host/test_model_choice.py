"""The choice of a model is the same whether all are judged on runs left out or only those that matter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from support.synthetic_wheel import Truth, baseline, record, staircase
from truing.identify import model_ladder
from truing.identify.grey_box import SharedFits, fit_structure
from truing.identify.held_out import simplest_good
from truing.identify.signals import wheel_signal
from truing.identify.structures import BREAKAWAY, DELAY, STRUCTURES, Structure


@dataclass(frozen=True)
class Error:
    rms_mps: float


@dataclass(frozen=True)
class Step:
    """A fitted structure whose error on runs left out is known, and told only when it is asked for."""

    structure: Structure
    free_run: Error
    held_out: Error | None
    hidden: float
    search: None = None

    def with_runs_left_out(self, shared: list[str]) -> Step:
        shared.append(self.structure.name)
        return replace(self, held_out=Error(self.hidden))


def ladder(rng: np.random.Generator) -> list[Step]:
    """Steps of random errors, near enough to each other that the 2 % matter; left out is never better."""
    steps = []
    for name, structure in STRUCTURES.items():
        fitted = 1.0 + 0.05 * rng.random()
        hidden = fitted * (1.0 + 0.03 * rng.random())
        judged = Error(hidden) if name in model_ladder.BASIC else None
        steps.append(Step(structure, Error(fitted), judged, hidden))
    return steps


def test_what_is_not_judged_could_not_have_changed_the_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(model_ladder, "at_a_bound", lambda search: None)
    rng = np.random.default_rng(3)
    judged: list[str] = []
    for _ in range(2000):
        steps = ladder(rng)
        scores = [(step.hidden, len(step.structure.free)) for step in steps]
        expected = steps[simplest_good(scores)].structure
        given: Any = list(steps)
        shared: Any = judged
        assert model_ladder._choose(given, shared).structure is expected
    # Otherwise nothing was spared, or nothing was ever asked.
    assert 0 < len(judged) < 0.9 * 2000 * len(model_ladder.RICHER)


def test_structures_share_the_fit_that_they_are_searched_for_from(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nine of them need the fit of friction and delay: it is made once."""
    made: list[tuple[str, ...]] = []
    whole = model_ladder.fit_wheel.__globals__["fit_physics"]

    def counted(signal: Any, structure: Structure, **more: Any) -> Any:
        if "start" not in more:
            made.append(structure.free)
        return whole(signal, structure, **more)

    monkeypatch.setitem(model_ladder.fit_wheel.__globals__, "fit_physics", counted)
    runs = [record(Truth(), staircase(k, 4.0), seed=k, duration_s=4.0, fine_s=1e-3) for k in range(2)]
    shared = SharedFits(wheel_signal(runs, "left", baseline()))
    for structure in (DELAY, BREAKAWAY, STRUCTURES["offset"], STRUCTURES["drag"]):
        assert fit_structure(shared, structure).structure.free == structure.free
    assert made == [DELAY.free]


def test_one_run_gets_a_delay_only_where_it_fits_better() -> None:
    """Friction and delay were taken of one run whatever they brought."""
    chosen = {}
    for delay_s in (0.0, 0.12):
        run = record(Truth(delay=delay_s, breakaway=0.0), staircase(2), seed=2)
        steps = [model_ladder.fit_wheel([run], "left", name, baseline()) for name in model_ladder.BASIC]
        chosen[delay_s] = model_ladder._choose(steps, SharedFits(steps[0].signal)).structure.name
    assert chosen == {0.0: "friction", 0.12: "delay"}
