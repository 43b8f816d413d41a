"""`truing fit`: tables and JSON that keep errors apart, and a model file that serves as a baseline."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from support.synthetic_wheel import Truth, record, staircase
from truing.cli import group
from truing.model.robot_model import read_robot_model

BASELINE = """
[robot]
wheel_radius_m = 0.0635
wheelbase_m = 0.283
counts_per_rev = 2400
[wheel.left]
gain_mps = 1.0
time_constant_s = 0.1
[wheel.right]
gain_mps = 1.0
time_constant_s = 0.1
"""


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    folder = tmp_path / "robot"
    (folder / "runs").mkdir(parents=True)
    (folder / "baseline.toml").write_text(BASELINE)
    for k in range(3):
        run = record(Truth(delay=0.03), staircase(k), seed=k, fine_s=1e-3)
        lines = [",".join(run.columns)]
        rows = zip(*run.columns.values(), strict=True)
        lines += [",".join(f"{value:.9g}" for value in row) for row in rows]
        (folder / "runs" / f"{k:02d}.csv").write_text("\n".join(lines) + "\n")
    return folder


def fit(*arguments: str) -> Result:
    return CliRunner().invoke(group, ["fit", *arguments])


def test_the_chosen_model_is_written_as_a_file_that_is_a_baseline_too(robot: Path, tmp_path: Path) -> None:
    result = fit(str(robot), "--out", str(tmp_path / "model.toml"))
    assert result.exit_code == 0, result.output
    assert "delay *" in result.output
    model = read_robot_model(tmp_path / "model.toml")
    assert model.left.gain_mps == pytest.approx(1.45, rel=0.01)
    assert model.right.delay_s == pytest.approx(0.03, abs=0.003)
    assert model.robot.wheelbase_m == 0.283
    again = fit(str(robot), "--model", str(tmp_path / "model.toml"))
    assert again.exit_code == 0, again.output


def test_json_names_every_error_by_its_kind(robot: Path) -> None:
    result = fit(str(robot), "--json")
    assert result.exit_code == 0, result.output
    tree = json.loads(result.stdout)
    left = next(wheel for wheel in tree["wheels"] if wheel["wheel"] == "left")
    assert left["chosen"] == "delay"
    chosen = next(step for step in left["grey_box"] if step["structure"] == "delay")
    low, high = chosen["parameters"]["time_constant_s"]["ci95"]
    assert low < 0.32 < high
    assert chosen["free_run"]["kind"] == "free_run"
    assert chosen["free_run_held_out"]["kind"] == "free_run_held_out"
    assert left["arx"]["one_step_held_out"]["kind"] == "one_step_held_out"
    assert left["state_space"]["free_run_held_out"]["kind"] == "free_run_held_out"


def test_a_wheel_that_never_turned_is_named_and_the_other_is_fitted(robot: Path) -> None:
    for path in (robot / "runs").iterdir():
        lines = path.read_text().splitlines()
        column = lines[0].split(",").index("ticks_right")
        rows = [line.split(",") for line in lines[1:]]
        for row in rows:
            row[column] = "0"
        path.write_text("\n".join([lines[0], *(",".join(row) for row in rows)]) + "\n")
    result = fit(str(robot))
    assert result.exit_code == 0, result.output
    assert "right: not fitted: the measured speed never changes" in result.output


def test_the_report_holds_every_table_and_opens_without_a_network(robot: Path, tmp_path: Path) -> None:
    folder = tmp_path / "report"
    assert fit(str(robot), "--report", str(folder)).exit_code == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count('class="plot"') == 3, "one figure for each run"
    assert "left-out runs" in page
    assert "src=" not in page.split("<script>", 1)[0]
    tables = {path.name for path in (folder / "tables").iterdir()}
    assert sum(name.endswith(".csv") for name in tables) == sum(name.endswith(".png") for name in tables) == 3
    assert json.loads((folder / "fit.json").read_text())["wheels"][0]["wheel"] == "left"
