"""`truing import` proposes a mapping where there is none: shown, asked about once, kept for the next time."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from click.testing import CliRunner, Result

from truing.cli import group
from truing.cli.app import App
from truing.cli.import_dialogue import QUESTION
from truing.errors import ExpressionError, RecordingError, TruingError
from truing.identify.identification import identify_set
from truing.importers.column_guess import guess_columns, sparkline, words
from truing.importers.expression import Expression
from truing.importers.mapping import filled_pose
from truing.importers.proposal import propose
from truing.importers.text_table import read_text_table
from truing.recording.axis import Axis
from truing.recording.baseline import RobotGeometry
from truing.recording.reader import read_recording_set
from truing.recording.run import RecordingSet

UGLY = Path(__file__).parent / "ugly"


def made() -> ModuleType:
    """The script that made the files: it knows the numbers in them."""
    spec = importlib.util.spec_from_file_location("ugly_make", UGLY / "make.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TRUE = made()
ROBOT = (TRUE.GAIN_LEFT, TRUE.GAIN_RIGHT, TRUE.TAU_S)
MOTOR = (TRUE.MOTOR_GAIN, None, TRUE.MOTOR_TAU_S)
WHEEL = RobotGeometry("", 0.03, TRUE.WHEELBASE_M, 1440.0)
FILES = {
    "decimal_comma.csv": ((), ROBOT),
    "no_header.txt": ((), ROBOT),
    "motor_bench.dat": ((), MOTOR),
    "mocap_gaps.csv": ((), ROBOT),
    "body_twist.tsv": (("--wheelbase", str(TRUE.WHEELBASE_M)), ROBOT),
}


def run(*arguments: object, answers: str | None = None) -> Result:
    return CliRunner().invoke(group, [str(a) for a in arguments], input=answers)


@pytest.fixture
def at_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(App, "asks", property(lambda self: True))


def numbers(folder: Path) -> tuple[RecordingSet, list[float]]:
    """The set, and gains and time constants that are found in it."""
    recordings = read_recording_set(folder)
    if recordings.axis is None:
        recordings = recordings.with_geometry(WHEEL)
    fits = identify_set(recordings).whole_fits.values()
    return recordings, [value for fit in fits for value in (fit.gain.value, fit.time_constant.value) if value]


@pytest.mark.parametrize("name", FILES)
@pytest.mark.usefixtures("at_a_terminal")
def test_an_ugly_file_is_read_by_one_command_with_one_question(name: str, tmp_path: Path) -> None:
    options, (left, right, tau) = FILES[name]
    out = tmp_path / "set"
    result = run("import", UGLY / name, "--out", out, *options, answers="\n")
    assert result.exit_code == 0, result.output
    assert result.output.count(QUESTION) == 1
    assert "Preview: 01_" in result.output
    assert "▁" in result.output
    recordings, found = numbers(out)
    if right is None:
        assert recordings.axis == Axis("rotation")
        assert found == pytest.approx([left, tau], rel=0.02)
    else:
        assert found == pytest.approx([left, tau, right, tau], rel=0.02)
    # The mapping that was used makes the same runs without a question.
    again = tmp_path / "again"
    result = run("import", UGLY / name, "--out", again, "--mapping", out / "mapping.toml")
    assert result.exit_code == 0, result.output
    assert QUESTION not in result.output
    for one, other in zip(read_recording_set(again), recordings, strict=True):
        for column, values in one.columns.items():
            assert np.array_equal(values, other.columns[column])


def test_without_a_terminal_the_proposal_is_printed_and_nothing_is_written(tmp_path: Path) -> None:
    out = tmp_path / "set"
    result = run("import", UGLY / "no_header.txt", "--out", out)
    assert isinstance(result.exception, TruingError)
    assert result.exception.exit_code == 2
    assert "--yes" in result.exception.next_step
    assert 'ticks_left = "column_4"' in result.output
    assert not out.exists()
    assert run("import", UGLY / "no_header.txt", "--out", out, "--yes").exit_code == 0
    value = json.loads(
        run("import", UGLY / "no_header.txt", "--out", tmp_path / "b", "--yes", "--json").stdout
    )
    assert value["runs"][0]["rows"] == 300


@pytest.mark.usefixtures("at_a_terminal")
def test_an_answer_changes_the_mapping(tmp_path: Path) -> None:
    out = tmp_path / "set"
    answers = "effort_left = column_2 / 510\nfrom_s = 2\nnonsense\n\n"
    result = run("import", UGLY / "no_header.txt", "--out", out, answers=answers)
    assert result.exit_code == 0, result.output
    assert "NAME = EXPRESSION is due" in result.output
    (read,) = read_recording_set(out).runs
    assert np.abs(read.effort("left")).max() == pytest.approx(0.35, abs=0.002)
    assert len(read) == 250


def test_the_same_lines_may_stand_on_the_command_line(tmp_path: Path) -> None:
    out = tmp_path / "set"
    lines = ("--set", "b=0.24", "--set", "vel_left_mps=v - w*b/2", "--set", "vel_right_mps=v + w*b/2")
    result = run("import", UGLY / "body_twist.tsv", "--out", out, "--yes", *lines, "--set", "acts=after")
    assert result.exit_code == 0, result.output
    text = (out / "mapping.toml").read_text()
    assert 'effort = "after"' in text
    assert 'expression = "v - w*b/2"' in text


def test_what_is_missing_is_named_with_what_there_is(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("time [s],duty\n" + "\n".join(f"{0.1 * k},{0.5 * (k > 9)}" for k in range(40)) + "\n")
    result = run("import", file, "--out", tmp_path / "set", "--yes")
    assert isinstance(result.exception, RecordingError)
    said = f"{result.exception} {result.exception.next_step}"
    for words_ in ("log.csv", "not found: motion", "time [s], duty", "vel_radps"):
        assert words_ in said


def test_files_of_a_set_have_one_unit_of_time(tmp_path: Path) -> None:
    """By itself the second file would be taken for seconds."""
    files = []
    for number, step in enumerate((20, 20, 1)):
        rows = (f"{step * k},{100 * (k % 20 > 9)},{k * k},{k * k}" for k in range(60))
        files.append(tmp_path / f"{number}.csv")
        files[-1].write_text("time,pwm,encL,encR\n" + "\n".join(rows) + "\n")
    proposal = propose([read_text_table(file) for file in files])
    assert proposal.tree["columns"]["t_s"] == {"column": "time", "scale": 1e-3}
    result = run("import", *files, "--out", tmp_path / "set", "--yes")
    assert result.exit_code == 0, result.output
    durations = [round(one.duration_s, 3) for one in read_recording_set(tmp_path / "set")]
    assert sorted(durations) == [0.059, 1.18, 1.18]


def test_files_with_other_columns_are_refused_by_name(tmp_path: Path) -> None:
    for name, column in (("a.csv", "encR"), ("b.csv", "encRight")):
        rows = "\n".join(f"{k},{k % 3},{k},{k}" for k in range(30))
        (tmp_path / name).write_text(f"time,pwm,encL,{column}\n{rows}\n")
    with pytest.raises(RecordingError, match=r"b\.csv.*encR, encRight"):
        propose([read_text_table(tmp_path / name) for name in ("a.csv", "b.csv")])


@pytest.mark.parametrize("kind", ["html", "png"])
def test_the_preview_is_a_page_or_a_picture(kind: str, tmp_path: Path) -> None:
    picture = tmp_path / f"preview.{kind}"
    arguments = ("import", UGLY / "motor_bench.dat", "--out", tmp_path / "set", "--yes", "--preview", picture)
    assert run(*arguments).exit_code == 0
    assert picture.read_bytes().startswith(b"\x89PNG" if kind == "png" else b"<!DOCTYPE html>")


def test_a_header_in_a_comment_may_have_names_of_several_words(tmp_path: Path) -> None:
    """As in the MRCLAM data set, whose title has as many words as the table has columns."""
    head = "# Some Odometry Data:\n# Time [s]    forward velocity [m/s]    angular velocity[rad/s]\n"
    rows = "\n".join(f"{1248444187.0 + 0.1 * k:.3f} \t  {0.01 * k:.3f} \t -0.398" for k in range(30))
    (tmp_path / "odometry.dat").write_text(head + rows + "\n")
    table = read_text_table(tmp_path / "odometry.dat")
    assert table.names == ("Time [s]", "forward velocity [m/s]", "angular velocity[rad/s]")
    assert [column.unit for column in guess_columns(table)] == ["s", "m/s", "rad/s"]


def test_one_wheel_alone_is_an_axis(tmp_path: Path) -> None:
    rows = "\n".join(f"{0.05 * k:.2f},{0.5 * (k % 40 > 9)},{0.6 * (k % 40 > 12)}" for k in range(120))
    (tmp_path / "a.csv").write_text(f"time [s],duty_left,vel_left [m/s]\n{rows}\n")
    result = run("import", tmp_path / "a.csv", "--out", tmp_path / "set", "--yes")
    assert result.exit_code == 0, result.output
    assert read_recording_set(tmp_path / "set").axis == Axis("translation")


def test_a_pose_is_filled_between_its_samples_and_not_over_what_was_lost() -> None:
    t = np.arange(0.0, 4.0, 0.1)
    x = np.where(np.arange(40) % 3 == 0, 2.0 * t, np.nan)
    x[10:25] = np.nan
    filled = filled_pose({"t_s": t, "truth_x_m": x})["truth_x_m"]
    assert filled[:10] == pytest.approx(2.0 * t[:10])
    assert np.isnan(filled[11:26]).all()
    assert filled[28:37] == pytest.approx(2.0 * t[28:37])
    turning = np.where(np.arange(40) % 2 == 0, np.angle(np.exp(1j * (3.0 + 0.2 * t))), np.nan)
    angle = filled_pose({"t_s": t, "truth_theta_rad": turning})["truth_theta_rad"]
    assert np.exp(1j * angle[:39]) == pytest.approx(np.exp(1j * (3.0 + 0.2 * t[:39])))


def test_an_expression_is_arithmetic_and_nothing_else() -> None:
    found = Expression("`left wheel` - w*b/2 + abs(-1) + pi**0")
    assert found.names == ("left wheel", "w", "b")
    values = {"left wheel": np.array([1.0, 2.0]), "w": np.array([2.0, 4.0]), "b": 0.5}
    assert found.evaluate(values) == pytest.approx([2.5, 3.0])
    for bad in (
        "__import__('os')",
        "a.b",
        "[1]",
        "a if b else c",
        "lambda: 1",
        "open(a)",
        "a[0]",
        "'x'",
        "a ==",
        "(" * 99,
    ):
        with pytest.raises(ExpressionError) as error:
            Expression(bad)
        assert "An expression may hold" in error.value.next_step
    with pytest.raises(ExpressionError, match="no column or constant 'q'"):
        Expression("q + 1").evaluate(values)


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("leftEncoder_cnt [1]", ["left", "encoder", "cnt"]),
        ("pwmL", ["pwm", "l"]),
        ("vel left (m/s)", ["vel", "left"]),
        ("RPM", ["rpm"]),
    ],
)
def test_a_name_falls_into_words(name: str, found: list[str]) -> None:
    assert words(name) == found


def test_a_sparkline_has_its_extremes_and_its_gaps() -> None:
    line = sparkline(np.array([0.0, 1.0, np.nan, 7.0]), 4)
    assert line == "▁▂·█"
    assert sparkline(np.array([np.nan])) == ""
