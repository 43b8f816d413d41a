"""The learned correction as a part of the result."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from truing.arrays import FloatArray
from truing.model.correction import Correction, Term


@dataclass(frozen=True, slots=True)
class Resemblance:
    """A known shape, the physics that has it there, and the share of the values that it explains."""

    shape: str
    physics: str
    share: float

    def to_json(self) -> dict[str, Any]:
        """Every field by its name."""
        return {"shape": self.shape, "physics": self.physics, "share": float(self.share)}


@dataclass(frozen=True, slots=True)
class LearnedTerm:
    """A term with what is said of it."""

    term: Term
    depends_on: str
    sentence: str
    resembles: tuple[Resemblance, ...]

    def to_json(self) -> dict[str, Any]:
        """The lookup and the words."""
        return self.term.to_dict() | {
            "depends_on": self.depends_on,
            "sentence": self.sentence,
            "resembles": [one.to_json() for one in self.resembles],
        }


@dataclass(frozen=True, slots=True)
class LearnedCorrection:
    """What was asked for with `--learn`.

    Attributes
    ----------
    correction : None where what is left is noise, as far as the variables show.
    heldout_before, heldout_after : m/s, on runs used neither for the physical fit nor for terms and values.
    error_before, error_after : m/s, on all runs.
    effects, theta : the physical model beside which it stands: named effects that stay on, and the whole
        vector of the simulator (p,); the latter is kept out of the JSON.
    """

    correction: Correction | None
    terms: tuple[LearnedTerm, ...]
    heldout_before: float
    heldout_after: float
    error_before: float
    error_after: float
    effects: tuple[str, ...] = ()
    theta: FloatArray | None = field(default=None, repr=False, compare=False)

    def to_json(self) -> dict[str, Any] | None:
        """As docs/verdict.schema.json has it; None where nothing was learned."""
        if self.correction is None:
            return None
        whole = self.correction.to_dict()
        return {
            "depends_on": [one.depends_on for one in self.terms],
            "heldout_rmse_before": float(self.heldout_before),
            "heldout_rmse_after": float(self.heldout_after),
            "rmse_before": float(self.error_before),
            "rmse_after": float(self.error_after),
            "unit": "m/s",
            "beside_effects": list(self.effects),
            **{key: whole[key] for key in ("gain_mps", "time_constant_s", "effort_share", "drag")},
            "terms": [one.to_json() for one in self.terms],
        }
