"""`truing export` writes every kind from a fitted model or a baseline, and says what each leaves out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from support.exported import PLAIN, RICH
from truing.cli import group
from truing.cli.export import KINDS
from truing.errors import BaselineError, TruingError
from truing.exporters import ExportOptions, exporter, exporters, notes, read_model
from truing.exporters.terms import EVERYTHING
from truing.model.robot_model import RobotModel
from truing.recording.baseline import read_baseline

BASELINE = """
[robot]
name = "stingray"
wheel_radius_m = 0.0635
wheelbase_m = 0.283
[wheel.left]
gain_mps = 1.45
time_constant_s = 0.35
[wheel.right]
gain_mps = 1.5
time_constant_s = 0.3
[effect.stribeck_friction]
left = 0.04
right = 0.05
breakaway_left = 0.06
breakaway_right = 0.05
[effect.input_delay]
delay = 0.04
[effect.wheel_slip]
grip = 0.6
"""


def saved(folder: Path, model: RobotModel) -> Path:
    path = folder / "model.toml"
    model.save(path)
    return path


def run(*arguments: object) -> str:
    result = CliRunner().invoke(group, [str(item) for item in arguments])
    if result.exception is not None:
        raise result.exception
    assert result.exit_code == 0
    return result.stdout


def test_the_command_offers_exactly_the_exporters_there_are() -> None:
    assert {kind: item.TITLE for kind, item in exporters().items()} == KINDS
    assert "FMI 2.0 co-simulation unit" in run("export", "--help")


def test_every_kind_is_written_into_a_folder_at_once(tmp_path: Path) -> None:
    out = tmp_path / "out"
    text = run("export", saved(tmp_path, RICH), "--to", "all", "--out", out)
    for kind, item in exporters().items():
        path = out / f"stingray_{kind}{item.SUFFIX}"
        assert path.stat().st_size > 100, kind
        assert f"written: {path}" in text
        for sentence in notes(kind, RICH):
            assert f"note: {kind}: {sentence}" in text


def test_json_lists_files_and_what_they_leave_out(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    value = json.loads(run("export", saved(tmp_path, PLAIN), "--to", "urdf", "--out", path, "--json"))
    (export,) = value["exports"]
    assert export["files"] == [str(path)]
    assert export["notes"][0].startswith("delay is left out")
    assert "inertia per axle is 0.0100806 kg m^2, a free choice" in export["notes"][1]


def test_toml_reads_back_as_the_same_model_and_is_a_baseline_too(tmp_path: Path) -> None:
    path = tmp_path / "again.toml"
    run("export", saved(tmp_path, RICH), "--to", "toml", "--out", path)
    model, notes = read_model(path)
    assert model == RICH
    assert notes == ()
    assert read_baseline(path).left.gain_mps == RICH.left.gain_mps


def test_a_baseline_is_exported_with_the_effects_that_a_wheel_can_have(tmp_path: Path) -> None:
    path = tmp_path / "baseline.toml"
    path.write_text(BASELINE)
    model, notes = read_model(path)
    assert (model.left.friction, model.left.breakaway_excess) == (0.04, pytest.approx(0.02))
    assert (model.right.friction, model.right.breakaway_excess) == (0.05, 0.0)
    assert model.left.delay_s == model.right.delay_s == 0.04
    assert notes == ("[effect.wheel_slip] is no part of a wheel's model; left out",)
    text = run("export", path, "--to", "wpilib", "--out", tmp_path / "gains.json")
    assert "note: [effect.wheel_slip]" in text


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "[wheel] is missing"),
        ("[wheel.left", "not valid TOML"),
        ("schema = 9", "its schema is 9"),
        (
            BASELINE.replace("left = 0.04", 'left = "much"'),
            "[effect.stribeck_friction] left must be a number",
        ),
    ],
)
def test_a_wrong_model_is_explained(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "model.toml"
    path.write_text(text)
    with pytest.raises(BaselineError) as caught:
        run("export", path, "--to", "python", "--out", tmp_path / "robot.py")
    assert says in str(caught.value)
    assert "model.toml" in str(caught.value)


def test_a_folder_instead_of_a_model_is_answered_with_the_way_to_one(tmp_path: Path) -> None:
    with pytest.raises(BaselineError, match="is a folder") as caught:
        run("export", tmp_path, "--to", "python", "--out", tmp_path / "robot.py")
    assert "truing fit" in caught.value.next_step


def test_a_kind_that_cannot_be_written_does_not_keep_the_others_from_it(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    RobotModel(PLAIN.left, PLAIN.right).save(path)
    value = json.loads(run("export", path, "--to", "all", "--out", tmp_path / "out", "--json"))
    written = {item["kind"] for item in value["exports"] if item["files"]}
    assert set(KINDS) - written == {"urdf", "sdf", "mjcf", "ros2-control"}
    notes = {item["kind"]: item["notes"] for item in value["exports"]}
    assert notes["urdf"] == ["not written: the model has no wheel radius, and this format needs one"]


def test_an_unknown_kind_is_answered_with_those_there_are() -> None:
    with pytest.raises(TruingError, match="no export kind 'modelica'") as caught:
        exporter("modelica")
    assert "mjcf" in caught.value.next_step


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_what_a_kind_holds_is_known_and_what_it_leaves_out_is_said_per_term(kind: str) -> None:
    holds = exporter(kind).HOLDS
    assert holds <= EVERYTHING
    present = {"friction", "delay", "breakaway", "drag", "offset", "lag", "deadband", "direction"}
    said = [sentence.split(" ")[0] for sentence in notes(kind, RICH) if "is left out" in sentence]
    assert said == [
        term
        for term in ("friction", "delay", "breakaway", "drag", "offset", "lag", "deadband", "direction")
        if term in present - holds
    ]


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_disk_that_refuses_is_named_and_leaves_nothing_behind(tmp_path: Path, kind: str) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    with pytest.raises(TruingError, match="file"):
        exporter(kind).write(PLAIN, blocked / "robot.out", ExportOptions())
    assert list(tmp_path.iterdir()) == [blocked]
