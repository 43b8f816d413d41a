"""The practice robots: first order with nothing hidden, as strong as drawn, repeatable, fairly judged."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from support.practice_robots import Answer, judge, make_trial
from support.practice_robots.draws import draw_experiment, draw_machine
from support.practice_robots.effects import CATALOGUE
from support.practice_robots.first_order import unit_speed
from support.practice_robots.outside import OUTSIDE
from support.practice_robots.recorder import Layout
from support.practice_robots.strength import Experiment
from truing.recording.reader import read_recording_set

SPANS = {"mismatch": [], "effects": []}


def healthy_experiment(seed: int, noise: float | None) -> tuple[Experiment, np.ndarray]:
    """A robot with nothing hidden on a rich plan, and the exact first-order speeds (rows, 2)."""
    rng = np.random.default_rng(seed)
    machine = draw_machine(rng, sides_equal=False)
    experiment = draw_experiment(rng, machine, "rich", 20.0, noise, sides_equal=False)
    layout: Layout = experiment.layout
    speeds = [
        machine.gain[w]
        * unit_speed(
            np.ascontiguousarray(layout.effort[:, w]),
            layout.start,
            layout.row,
            machine.time_constant[w],
            layout.dt_s,
            False,
        )
        for w in (0, 1)
    ]
    return experiment, np.stack(speeds, axis=1)


@pytest.mark.parametrize("seed", range(6))
def test_with_nothing_hidden_a_gain_and_a_time_constant_explain_a_robot_far_below_its_noise(
    seed: int,
) -> None:
    experiment, _ = healthy_experiment(seed, None)
    assert experiment.wheel_effect(experiment.healthy) < 0.15 * experiment.wheel_noise(experiment.healthy)


@pytest.mark.parametrize("seed", range(6))
def test_without_a_disturbance_only_the_rounding_of_counts_is_left(seed: int) -> None:
    experiment, exact = healthy_experiment(seed, 0.0)
    left = experiment.disturbed(experiment.healthy, quantised=True).speed - exact
    per_count = 2 * np.pi * experiment.healthy.radius / experiment.nominal_counts / experiment.layout.dt_s
    assert np.abs(left).max() < 1.2 * per_count
    assert left.std() < 1.1 * per_count / np.sqrt(6)
    moving = np.abs(exact[:, 0]) > 4 * per_count
    for lag in (3, 5, 10):
        both = moving[:-lag] & moving[lag:]
        assert abs(np.corrcoef(left[:-lag, 0][both], left[lag:, 0][both])[0, 1]) < 0.12


@pytest.mark.slow
@pytest.mark.parametrize("name", [*CATALOGUE, *OUTSIDE])
def test_an_effect_is_hidden_at_its_strength_and_the_set_can_be_read(name: str, tmp_path: Path) -> None:
    answer = make_trial(3, name, "weak", folder=tmp_path)
    assert answer.names == (name,)
    assert 0.3 <= answer.effects[0].strength <= 1.0
    recordings = read_recording_set(tmp_path / "recordings")
    assert len(recordings.runs) == len(answer.energy)
    assert max(max(row["left"]) + max(row["pose"]) for row in answer.energy.values()) > 0
    assert not list((tmp_path / "recordings").rglob("answer*"))


def test_the_same_seed_gives_the_same_files_and_another_seed_others(tmp_path: Path) -> None:
    def files(seed: int, where: str) -> list[bytes]:
        make_trial(seed, "encoder_dropout", "full", folder=tmp_path / where)
        return [path.read_bytes() for path in sorted((tmp_path / where / "recordings").rglob("*.*"))]

    assert files(5, "a") == files(5, "b")
    assert files(5, "a") != files(6, "c")


def test_a_healthy_robots_baseline_is_exact_or_off_by_at_most_8_per_cent(tmp_path: Path) -> None:
    for name, limit in (("null_exact", 1e-4), ("null_numbers", 0.0801)):
        answer = make_trial(9, name, folder=tmp_path / name)
        baseline = tomllib.loads((tmp_path / name / "recordings" / "baseline.toml").read_text())
        for w, wheel in enumerate(("left", "right")):
            assert abs(baseline["wheel"][wheel]["gain_mps"] / answer.gain_mps[w] - 1) <= limit
            assert abs(baseline["wheel"][wheel]["time_constant_s"] / answer.time_constant_s[w] - 1) <= limit


def verdict(name: str, *effects: str, **more: Any) -> dict[str, Any]:
    return {**SPANS, "verdict": name, "effects": [{"name": effect} for effect in effects], **more}


@pytest.fixture(scope="module")
def limited(tmp_path_factory: pytest.TempPathFactory) -> Answer:
    return make_trial(1, "speed_limit", "full", folder=tmp_path_factory.mktemp("limited"))


def test_a_verdict_is_right_alone_or_ambiguous_and_wrong_when_it_names_what_is_not_there(
    limited: Answer,
) -> None:
    alone = judge(limited, verdict("missing_physics", "speed_limit"))
    assert alone["named"]
    assert alone["alone"]
    assert not alone["confidently_wrong"]
    ambiguous = judge(limited, verdict("ambiguous", "quadratic_drag", "speed_limit"))
    assert ambiguous["named"]
    assert not ambiguous["alone"]
    assert not judge(limited, verdict("ambiguous", "speed_limit", *list(CATALOGUE)[:3]))["named"]
    assert judge(limited, verdict("missing_physics", "quadratic_drag"))["confidently_wrong"]
    assert not judge(limited, verdict("unexplained"))["named"]


def test_spans_are_measured_by_the_energy_they_cover_and_by_what_else_they_cover(limited: Answer) -> None:
    def span(run: str, wheel: str, end: float) -> dict[str, Any]:
        return {"run": run, "signal": f"vel_{wheel}_mps", "t_start_s": 0.0, "t_end_s": end}

    everything = [span(run, wheel, 99.0) for run in limited.energy for wheel in ("left", "right")]
    of_all = judge(limited, verdict("unexplained", mismatch=everything))
    assert of_all["covered"] == pytest.approx(1.0)
    assert of_all["pure"] < 0.8
    rest = [span(run, "left", 0.4) for run in limited.energy]
    of_rest = judge(limited, verdict("unexplained", mismatch=rest))
    assert of_rest["covered"] < 0.01
    assert of_rest["pure"] < 0.1


def test_a_parameter_counts_as_inside_only_within_its_interval(limited: Answer) -> None:
    true = limited.effects[0].parameters["limit"]

    def inside(low: float, high: float) -> dict[str, bool]:
        effect = {"name": "speed_limit", "parameters": {"limit": {"value": true, "ci95": [low, high]}}}
        got: dict[str, bool] = judge(limited, {**SPANS, "verdict": "missing_physics", "effects": [effect]})[
            "inside"
        ]
        return got

    assert inside(true - 0.01, true + 0.01) == {"speed_limit.limit": True}
    assert inside(true + 0.01, true + 0.02) == {"speed_limit.limit": False}
