"""`truing diagnose` as a user or a program calls it: exit status, one line for bad input, files written."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from support import diagnoses
from support.cli import truing_within
from support.recorded_sets import BASELINE_TOML, Columns, recordings, write_csv, write_set
from truing.board.parameter_file import read_parameter_file
from truing.cli.app import App
from truing.cli.diagnose import command
from truing.diagnose import engine
from truing.diagnose.simulator_baseline import equivalent_baseline
from truing.errors import TruingError
from truing.exporters.source import read_model
from truing.plan import load_plan
from truing.recording.baseline import read_baseline


@pytest.fixture
def verdict(monkeypatch: pytest.MonkeyPatch):
    """Puts a made-up diagnosis in place of the engine's, whose own tests stand elsewhere."""

    def put(diagnosis) -> None:
        monkeypatch.setattr(engine, "analyse", lambda *arguments, **options: diagnosis)

    return put


def run(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(a) for a in arguments], obj=App())


def test_a_verdict_exits_with_0_and_reads_as_sentences(tmp_path: Path, verdict) -> None:
    verdict(diagnoses.missing_physics())
    result = run(write_set(tmp_path / "set"))
    assert result.exit_code == 0, result.output
    assert "Missing from the simulation on both wheels: dry friction (98 % sure)." in result.output
    assert "What to do next" in result.output


def test_json_report_export_and_next_run_are_written_where_asked(tmp_path: Path, verdict) -> None:
    verdict(diagnoses.ambiguous())
    out = tmp_path / "new" / "folder"
    result = run(
        write_set(tmp_path / "set"), "--json", out / "v.json", "--report", out / "v.html",
        "--export", f"toml:{out / 'm.toml'}", "--next-run", out / "next.toml",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    tree = json.loads((out / "v.json").read_text())
    assert tree["verdict"] == "ambiguous"
    assert tree["next_experiment"]["plan"]["segment"]
    assert (out / "v.html").read_text().startswith("<!DOCTYPE html>")
    assert load_plan(str(out / "next.toml")).duration_s == pytest.approx(diagnoses.plan().duration_s)
    assert "dry friction is taken, the likeliest" in result.output


def test_the_corrected_model_is_a_baseline_that_contains_what_was_missing(tmp_path: Path, verdict) -> None:
    drop = {"drop_at_stall": diagnoses.EffectParameter(0.1, (0.09, 0.11), "1")}
    sag = diagnoses.deadband(name="supply_sag", parameters=drop)
    verdict(diagnoses.missing_physics(effects=(diagnoses.friction(), sag), traces=()))
    file = tmp_path / "m.toml"
    result = run(write_set(tmp_path / "set"), "--export", f"toml:{file}")
    baseline = read_baseline(file)
    assert baseline.left.gain_mps == pytest.approx(1.52)
    assert baseline.effects["coulomb_friction"] == {"left": 0.051, "right": 0.047}
    assert baseline.effects["supply_sag"] == {"drop_at_stall": 0.1}
    model, _ = read_model(file)
    assert model.left.friction == pytest.approx(0.051)
    assert "[effect.supply_sag] is no part of a wheel's model" in result.output


def test_board_values_counter_friction_with_feedforward(tmp_path: Path, verdict) -> None:
    verdict(diagnoses.missing_physics())
    file = tmp_path / "board.toml"
    result = run(write_set(tmp_path / "set"), "--export", f"params:{file}")
    assert result.exit_code == 0, result.output
    values = read_parameter_file(file)
    assert values["ff_ks_left"] == pytest.approx(0.051)
    assert values["ff_ks_right_reverse"] == pytest.approx(0.047)
    assert values["ff_kv_left"] == pytest.approx(1.0 / 1.52, rel=1e-5)


def test_a_dead_band_adds_to_the_feedforward_against_friction(tmp_path: Path, verdict) -> None:
    verdict(diagnoses.missing_physics(effects=(diagnoses.friction(), diagnoses.deadband())))
    file = tmp_path / "board.toml"
    run(write_set(tmp_path / "set"), "--export", f"params:{file}")
    assert read_parameter_file(file)["ff_ks_left"] == pytest.approx(0.101)


def test_every_exporter_takes_the_corrected_model(tmp_path: Path, verdict) -> None:
    verdict(diagnoses.missing_physics())
    kinds = ("mjcf", "urdf", "wpilib", "python")
    options = [f"--export={kind}:{tmp_path / f'robot.{kind}'}" for kind in kinds]
    result = run(write_set(tmp_path / "set"), *options)
    assert result.exit_code == 0, result.output
    assert result.output.count("written: ") == 4


@pytest.mark.parametrize("spec", ["toml", "toml:", "parquet:x"])
def test_a_wrong_export_is_refused_before_any_work(tmp_path: Path, monkeypatch, spec: str) -> None:
    monkeypatch.setattr(engine, "analyse", lambda *a, **k: pytest.fail("the work was begun"))
    result = run(write_set(tmp_path / "set"), "--export", spec)
    assert isinstance(result.exception, TruingError)


def _missing_column(folder: Path) -> None:
    file = folder / "runs/01_levels.csv"
    file.write_text(file.read_text().replace("effort_right", "power_right", 1))


def _nan(folder: Path) -> None:
    file = folder / "runs/02_levels.csv"
    lines = file.read_text().split("\n")
    lines[5] = lines[5].replace(lines[5].split(",")[1], "nan", 1)
    file.write_text("\n".join(lines))


def _three_samples(folder: Path) -> None:
    file = folder / "runs/01_levels.csv"
    file.write_text("\n".join(file.read_text().split("\n")[:4]) + "\n")


def _no_wheel(folder: Path) -> None:
    (folder / "baseline.toml").write_text(BASELINE_TOML.replace("[wheel.right]", "[wheel.third]"))


def _no_baseline(folder: Path) -> None:
    (folder / "baseline.toml").unlink()


def _backwards(folder: Path) -> None:
    file = folder / "runs/01_levels.csv"
    lines = file.read_text().split("\n")
    lines[4], lines[5] = lines[5], lines[4]
    file.write_text("\n".join(lines))


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (_missing_column, ("01_levels.csv", "effort_right")),
        (_nan, ("02_levels.csv", "row 5")),
        (_three_samples, ("01_levels.csv", "only 3 rows")),
        (_no_wheel, ("baseline.toml", "wheel.right")),
        (_no_baseline, ("baseline",)),
        (_backwards, ("01_levels.csv", "backwards")),
    ],
)
def test_bad_input_exits_with_2_and_one_line_that_names_the_place(tmp_path: Path, damage, words) -> None:
    folder = write_set(tmp_path / "set")
    damage(folder)
    done = truing_within("diagnose", str(folder), "--json", str(tmp_path / "v.json"))
    assert done.returncode == 2
    assert len(done.stderr.strip().split("\n")) == 1, done.stderr
    assert all(word in done.stderr for word in words), done.stderr
    assert done.stdout == ""
    assert not (tmp_path / "v.json").exists()


def test_a_wheel_that_turns_backwards_exits_with_2(tmp_path: Path) -> None:
    def change(name: str, values: Columns) -> None:
        values["ticks_left"] *= -1.0

    done = truing_within("diagnose", str(write_set(tmp_path / "set", 4, change)))
    assert done.returncode == 2
    assert "the left wheel turns against its effort" in done.stderr


def test_runs_that_another_simulator_lacks_are_named(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set")
    simulated = write_set(tmp_path / "sim", 3)
    done = truing_within("diagnose", str(folder), "--sim-runs", str(simulated))
    assert done.returncode == 2
    assert "no 04_levels.csv" in done.stderr


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda values: values.update({k: v[:-5] for k, v in values.items()}), "155 rows"),
        (lambda values: values.update(t_s=values["t_s"] * 1.1), "'t_s'"),
        (lambda values: values.update(effort_left=values["effort_left"] * 0.9), "'effort_left'"),
    ],
)
def test_rows_of_another_simulator_must_be_those_of_the_recording(tmp_path: Path, change, words: str) -> None:
    folder = write_set(tmp_path / "set")
    other = tmp_path / "sim"
    other.mkdir()
    for one in recordings(4):
        values = dict(one.columns)
        change(values)
        write_csv(other / f"{one.name}.csv", values)
    done = truing_within("diagnose", str(folder), "--sim-runs", str(other))
    assert done.returncode == 2
    assert words in done.stderr
    assert "01_levels.csv" in done.stderr


def test_another_simulators_own_error_is_the_error_as_given(tmp_path: Path, verdict) -> None:
    verdict(diagnoses.missing_physics())
    folder = write_set(tmp_path / "set")
    other = tmp_path / "sim"
    other.mkdir()
    for one in recordings(4):
        values = {k: v for k, v in one.columns.items() if not k.startswith("ticks")}
        for side in ("left", "right"):
            values[f"vel_{side}_mps"] = one.speed(side, recordings(1).baseline).values + 0.1
        write_csv(other / f"{one.name}.csv", values)
    result = run(folder, "--sim-runs", other, "--json", tmp_path / "v.json")
    assert result.exit_code == 0, result.output
    fit = json.loads((tmp_path / "v.json").read_text())["fit"]
    assert fit["baseline_rmse"] == pytest.approx(0.1, rel=1e-3)


def test_the_equivalent_baseline_contains_the_effects_of_the_other_simulator() -> None:
    baseline, checks = equivalent_baseline(recordings(1).baseline, diagnoses.missing_physics())
    assert baseline.left.gain_mps == pytest.approx(1.52)
    assert baseline.effects == {"coulomb_friction": {"left": 0.051, "right": 0.047}}
    assert "contains coulomb_friction" in checks[0].text


def test_wheels_only_hides_the_outside_pose() -> None:
    def change(name: str, values: Columns) -> None:
        for column in ("truth_x_m", "truth_y_m", "truth_theta_rad", "gyro_z_radps"):
            values[column] = np.zeros_like(values["t_s"])

    stripped = recordings(2, change).without_pose()
    assert not any("truth" in column or "gyro" in column for one in stripped for column in one.columns)


def test_help_shows_examples() -> None:
    done = truing_within("diagnose", "--help")
    assert done.returncode == 0
    assert "truing diagnose my_robot --sim-runs" in done.stdout


def test_a_plan_survives_its_own_file(tmp_path: Path) -> None:
    file = tmp_path / "coast_down_40.toml"
    file.write_text(diagnoses.plan().to_toml())
    assert load_plan(str(file)) == diagnoses.plan()
    assert tomllib.loads(file.read_text())["log_rate_hz"] == 20
