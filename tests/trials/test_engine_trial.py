"""A physics engine's own robot hides an effect by the engine's own means, sealed, recorded and scored."""

from __future__ import annotations

import dataclasses
import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from support.pretended_trials import pretended_in_engine
from truing.cli import main
from truing.diagnose.catalogue import Catalogue
from truing.errors import LibraryMissingError, TruingError, WeakEffectError
from truing.fleet.engine import ProcessPool
from truing.recording.reader import read_recording_set
from truing.trial.concealed import run_concealed
from truing.trial.engines import load_engine
from truing.trial.engines.asked import EngineAsked
from truing.trial.engines.builder import prepare
from truing.trial.engines.campaign import OTHER_PROOF, other_proof, run_engine_campaign
from truing.trial.engines.driving import Mode, PlanDriver, draw_plans
from truing.trial.engines.mujoco_effects import EFFECTS as MUJOCO_EFFECTS
from truing.trial.engines.mujoco_robot import MujocoRobot
from truing.trial.engines.nominal import draw_nominal
from truing.trial.engines.order import engine_tasks
from truing.trial.engines.proof import shares, wilson
from truing.trial.engines.pybullet_effects import EFFECTS as BULLET_EFFECTS
from truing.trial.engines.pybullet_robot import BulletRobot
from truing.trial.engines.scoring import score
from truing.trial.engines.spec import RATES_HZ, Effects, compatible, draw_engine_trial
from truing.trial.engines.strength import closeness
from truing.trial.score import Score

MUJOCO = load_engine("mujoco")
NOMINAL = draw_nominal(np.random.default_rng(1))
# Of full speed; encoders and disturbance make 0.1 to 0.8 % of it.
CLOSE_SHARE = 0.001


def test_a_sealed_trial_names_the_joint_friction_that_the_engine_was_given(tmp_path: Path) -> None:
    asked = EngineAsked("joint_friction", 3, weak=False, mode="effort", rate_hz=20)
    shown: list[str] = []
    result = run_concealed(asked, tmp_path / "set", tell=shown.append)
    scored = score(asked, result)
    assert shown == [result.sha256]
    assert (scored.hidden, scored.right, scored.confidently_wrong) == (("coulomb_friction",), True, False)
    parameters = scored.measured["parameters"]
    assert set(parameters) == {"coulomb_friction.left", "coulomb_friction.right"}
    assert all(entry["within"] for entry in parameters.values()), parameters
    runs = read_recording_set(tmp_path / "set").runs
    assert len(runs) == 8
    assert all(np.allclose(np.diff(run.t_s), 0.05) for run in runs)
    # Whoever reads the set finds nothing of the answer in it.
    told = "".join(path.read_text() for path in (tmp_path / "set").rglob("*") if path.is_file())
    assert not any(word in told for word in ("joint_friction", "frictionloss", "mujoco", "coulomb"))


@pytest.mark.parametrize(
    ("name", "seed", "mode"), [("mujoco", 0, "effort"), ("mujoco", 5, "velocity"), ("pybullet", 1, "effort")]
)
def test_the_healthy_robot_is_close_to_the_baselines_form(name: str, seed: int, mode: Mode) -> None:
    pytest.importorskip(name)
    engine = load_engine(name)
    rng = np.random.default_rng(seed)
    nominal = draw_nominal(rng)
    drivers = [PlanDriver(plan, nominal) for plan in draw_plans(rng, nominal, mode)]
    found = closeness(engine.simulate(engine.healthy(nominal), drivers), nominal)
    assert found.share < CLOSE_SHARE
    assert found.gain_mps == pytest.approx(nominal.gain_mps, rel=0.002)
    assert found.time_constant_s == pytest.approx(nominal.time_constant_s, rel=0.005)


def test_what_the_baselines_form_can_follow_leaves_nothing_to_name() -> None:
    rng = np.random.default_rng(2)
    nominal = draw_nominal(rng)
    drivers = [PlanDriver(plan, nominal) for plan in draw_plans(rng, nominal, "effort")]
    for name in ("joint_damping", "ballast"):
        robot = MUJOCO.effects[name].apply(MUJOCO.healthy(nominal), 0.4, np.random.default_rng(1))
        found = closeness(MUJOCO.simulate(robot, drivers), nominal)
        assert found.share < CLOSE_SHARE, name
        changed = max(
            abs(found.gain_mps[0] / nominal.gain_mps[0] - 1.0),
            abs(found.time_constant_s[0] / nominal.time_constant_s[0] - 1.0),
        )
        assert changed > 0.1, name


@pytest.mark.parametrize(
    ("effects", "healthy"), [(MUJOCO_EFFECTS, MujocoRobot(NOMINAL)), (BULLET_EFFECTS, BulletRobot(NOMINAL))]
)
def test_every_effect_of_an_engine_has_its_name_and_parameters_in_the_catalogue(
    effects: Effects, healthy: Any
) -> None:
    catalogue = Catalogue()
    for name, effect in effects.items():
        assert (effect.catalogue in catalogue) == (effect.kind == "catalogue"), name
        robot = effect.apply(healthy, 0.4, np.random.default_rng(1))
        assert robot != healthy, name
        expected = effect.expected(robot)
        assert (effect.kind == "catalogue") == bool(expected), name
        assert all(np.isfinite(value) for value in expected.values()), name
        if expected:
            entry = catalogue[effect.catalogue]
            own = {parameter.name for parameter in entry.parameters} | set(entry.units)
            assert set(expected) <= own, name


def test_effects_of_one_name_or_the_same_means_are_no_pair() -> None:
    effects = MUJOCO.effects
    assert compatible(effects, "joint_friction", "actuator_delay")
    assert not compatible(effects, "joint_friction", "rolling_friction")
    assert not compatible(effects, "brush_friction", "actuator_filter")
    assert not compatible(effects, "joint_friction", "pendulum")
    with pytest.raises(TruingError):
        draw_engine_trial("mujoco", effects, "hinge_play,compliant_shaft", 1)
    with pytest.raises(TruingError):
        draw_engine_trial("mujoco", effects, "glue", 1)


def test_a_pair_of_which_one_effect_hides_the_other_is_no_trial() -> None:
    drawn = draw_engine_trial(
        "mujoco", MUJOCO.effects, "low_grip,actuator_filter", 2, mode="effort", rate_hz=50
    )
    with pytest.raises(WeakEffectError, match="low_grip: beside actuator_filter"):
        prepare(MUJOCO, dataclasses.replace(drawn, wanted=(1.2, 8.0)))


def test_without_the_engine_the_extra_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *rest: None if name == "mujoco" else found(name, *rest)
    )
    with pytest.raises(LibraryMissingError) as missing:
        load_engine("mujoco")
    assert missing.value.next_step == "pip install 'truing[engines]'"
    if found("pybullet") is None:
        with pytest.raises(LibraryMissingError, match="pybullet"):
            load_engine("pybullet")
    with pytest.raises(SystemExit) as ended:
        main(["trial", "--engine", "mujoco"])
    assert ended.value.code == missing.value.exit_code
    assert "truing[engines]" in capsys.readouterr().err


def test_a_campaigns_beginning_has_every_kind_mode_and_rate() -> None:
    tasks = engine_tasks(MUJOCO, 45, 1)
    assert len({task.seed for task in tasks}) == 45
    assert {task.mode for task in tasks} == {"effort", "velocity", "mixed"}
    assert {task.rate_hz for task in tasks} == set(RATES_HZ)
    singles = [task for task in tasks if task.weak is not None]
    inside = {name for name, effect in MUJOCO.effects.items() if effect.kind == "catalogue"}
    assert {task.effect for task in singles[: len(inside)]} == inside
    assert {task.effect for task in tasks} >= {"pair", "none", "joint_damping", "floor_step"}
    assert engine_tasks(MUJOCO, 300, 1)[:45] == tasks


def test_the_page_has_every_figure_with_its_bounds_and_every_trial(tmp_path: Path) -> None:
    table = tmp_path / "PROOF.md"
    scores = run_engine_campaign(
        "mujoco", 20, 1, tmp_path, lambda _share: None, lambda _text: None,
        engine=ProcessPool(1), table=table, run=pretended_in_engine,
    )  # fmt: skip
    page = table.read_text()
    assert all(share.row() in page for share in shares(scores))
    assert all(f"| {each.effect} | {each.seed} |" in page for each in scores)
    assert "300 trials are wanted; this page rests on 20." in page
    assert f"--campaign 20 --seed 1 --table {table}" in page
    written = json.loads((tmp_path / "results.json").read_text())["trials"]
    assert [Score.from_json(each) for each in written] == scores
    table.write_text(f"{page}\n{OTHER_PROOF}\n\n# Learned\n")
    assert other_proof(table) == f"\n{OTHER_PROOF}\n\n# Learned\n", "what other commands proved stays"


def test_bounds_are_wilsons() -> None:
    # Newcombe (1998), Statistics in Medicine 17, table I, method 3: 81 of 263, 15 of 148, 0 of 20, 1 of 29.
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert wilson(15, 148) == pytest.approx((0.0624, 0.1605), abs=5e-5)
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=5e-5)
    assert wilson(1, 29) == pytest.approx((0.0061, 0.1718), abs=5e-5)
    assert wilson(20, 20)[1] == 1.0
