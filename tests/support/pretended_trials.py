"""Scores of concealed trials that nobody ran, for what is reckoned from them."""

from __future__ import annotations

from pathlib import Path

from truing.trial.engines import load_engine
from truing.trial.engines.order import EngineTask
from truing.trial.engines.spec import draw_engine_trial
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


def pretended_in_engine(each: EngineTask, _folder: Path) -> Score:
    """A trial in an engine whose verdict is always the truth, of a campaign that takes no time."""
    effects = load_engine(each.engine).effects
    trial = draw_engine_trial(each.engine, effects, each.effect, each.seed, weak=each.weak)
    missing = [name for name in trial.names if effects[name].kind != "form"]
    hidden = tuple(effects[name].catalogue for name in missing)
    kind = {"null": "consistent", "outside": "unexplained"}.get(trial.family, "missing_physics")
    said = hidden if kind == "missing_physics" else ()
    worth = judge(kind, said, trial.family, hidden)
    return Score(
        effect=each.effect, seed=each.seed, weak=each.weak, family=trial.family, hidden=hidden,
        strengths=tuple(0.5 if each.weak else 2.0 for _ in hidden),
        driving=f"{each.mode} {each.rate_hz} Hz", on_board=False,
        verdict=kind, said=said, named=worth.named, named_alone=worth.named_alone,
        confidently_wrong=worth.confidently_wrong, right=worth.right, place_right=None, later=(),
        resolved=None, seconds=1.0, cpu_s=1.0, building_cpu_s=1.0, scoring_cpu_s=0.0, sha256="",
        measured={
            "engine": "mujoco 4", "engine_names": list(trial.names), "noise_mps": 0.003,
            "healthy_mps": 0.0003, "healthy_share": 0.0003, "parameters": {},
        },
    )  # fmt: skip
