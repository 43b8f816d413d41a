"""Scores of concealed trials that nobody ran, for what is reckoned from them."""

from __future__ import annotations

from truing.trial.order import Task
from truing.trial.score import Score, judge


def pretended(each: Task) -> Score:
    """A trial whose verdict is always the truth, of a campaign that takes no time."""
    families = {"none": "null", "pair": "two"}
    family = families.get(each.effect, "outside" if each.weak is None else "one")
    hidden = {"null": (), "two": ("input_delay", "turning_scrub")}.get(family, (each.effect,))
    kind = {"null": "consistent", "outside": "unexplained"}.get(family, "missing_physics")
    said = hidden if kind == "missing_physics" else ()
    worth = judge(kind, said, family, hidden)
    return Score(
        effect=each.effect, seed=each.seed, weak=each.weak, family=family, hidden=hidden,
        strengths=tuple(0.5 if each.weak else 2.0 for _ in hidden), driving="whole", on_board=each.on_board,
        verdict=kind, said=said, named=worth.named, named_alone=worth.named_alone,
        confidently_wrong=worth.confidently_wrong, right=worth.right,
        place_right=True if family == "outside" else None, later=(), resolved=None, seconds=1.0, cpu_s=1.0,
        building_cpu_s=1.0, scoring_cpu_s=1.0, sha256="", measured={"gap_closed": 0.95, "harm": 0.5},
        methods={"guess": (False, True)},
    )  # fmt: skip
