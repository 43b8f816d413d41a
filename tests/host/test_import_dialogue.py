"""`truing import` proposes a mapping where there is none: shown, asked about once, kept for the next time."""

from __future__ import annotations

import gzip
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
from truing.importers.mapping import filled_pose, thinned
from truing.importers.proposal import propose
from truing.importers.text_table import TextTable, read_text_table
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
            assert np.array_equal(values, other.columns[column], equal_nan=True)


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


def test_rows_are_put_together_by_means_of_efforts_and_last_positions() -> None:
    t = np.arange(0.0, 2.0005, 0.001)
    effort = np.where(t > 1.0045, 1.0, 0.0)
    travel = np.cumsum(effort) * 0.001
    put = thinned({"t_s": t, "effort_left": effort, "pos_left_m": travel}, 100.0)
    assert put["t_s"] == pytest.approx(np.arange(0.0, 2.005, 0.01))
    row = int(np.searchsorted(put["t_s"], 1.0099))
    assert put["effort_left"][row - 1 : row + 2] == pytest.approx([0.0, 0.6, 1.0]), "six of ten samples"
    assert put["pos_left_m"][-1] == travel[-1]
    # What the efforts sum up to over time stays.
    assert np.sum(put["effort_left"][1:]) * 0.01 == pytest.approx(travel[-1], abs=1e-9)
    assert thinned({"t_s": t[::100]}, 1000.0)["t_s"] == pytest.approx(t[::100])


def test_a_pose_from_a_file_of_its_own_joins_the_command_that_it_judges(tmp_path: Path) -> None:
    """Only a body's motion was commanded, on a clock that both files share; the camera is blind for 2 s."""
    t = np.arange(100.0, 130.0, 0.1)
    seen = np.arange(99.5, 129.0, 0.04)
    seen = seen[(seen < 110.0) | (seen > 112.0)]
    v = np.where((t > 105.0) & (t < 120.0), 0.2, 0.0)
    x = 0.2 * np.clip(seen - 105.0, 0.0, 15.0)
    log, pose = tmp_path / "log.csv.gz", tmp_path / "mocap.csv"
    rows = "\n".join(f"{a:.2f},{b},0.0" for a, b in zip(t, v, strict=True))
    log.write_bytes(gzip.compress(f"time [s],v [m/s],w [rad/s]\n{rows}\n".encode()))
    rows = "\n".join(f"{a:.2f},{b:.5f},0.0,0.0" for a, b in zip(seen, x, strict=True))
    pose.write_text(f"time [s],x [m],y [m],yaw [rad]\n{rows}\n")
    out = tmp_path / "set"
    result = run("import", log, "--pose", pose, "--wheelbase", 0.2, "--out", out, "--yes")
    assert result.exit_code == 0, result.output
    steps = [line.split("next: ")[1] for line in result.output.splitlines() if "next: " in line]
    assert steps == [f"truing diagnose {out} --commanded"], "no wheel was measured"
    recordings = read_recording_set(out)
    assert recordings.baseline is not None
    assert recordings.baseline.left.gain_mps == pytest.approx(0.2), "the fastest command is full effort"
    (read,) = recordings.runs
    blind = ~np.isfinite(read.columns["truth_x_m"])
    assert np.all((read.t_s[blind] > 9.9) & (read.t_s[blind] < 12.1))
    assert blind.sum() >= 18
    known = read.columns["truth_x_m"][~blind]
    # Between two samples of the camera, 8 mm at most, at the corners.
    assert known == pytest.approx(0.2 * np.clip(read.t_s[~blind] - 5.0, 0.0, 15.0), abs=0.004)
    for name in ("effort_left", "vel_right_mps"):
        assert np.isfinite(read.columns[name]).all()


@pytest.mark.parametrize(
    ("counts", "options"),
    [
        (("enc_left", "enc_right"), " --counts-per-rev N --wheel-radius METRES"),
        (("enc",), " --counts-per-rev N"),
        (("vel_left_mps", "vel_right_mps"), ""),
    ],
)
def test_the_next_command_has_the_options_that_counts_need(
    counts: tuple[str, ...], options: str, tmp_path: Path
) -> None:
    log, out = tmp_path / "log.csv", tmp_path / "set"
    efforts = ["effort"] if len(counts) == 1 else ["effort_left", "effort_right"]
    rows = [[0.05 * k, *(0.5 for _ in efforts), *(30 * k for _ in counts)] for k in range(60)]
    text = "\n".join(",".join(map(str, row)) for row in [["t_s", *efforts, *counts], *rows])
    log.write_text(text + "\n")
    said = run("import", log, "--out", out, "--yes")
    assert said.exit_code == 0, said.output
    assert said.output.rstrip().endswith(f"next: truing identify {out}{options}")


def test_a_pose_on_another_clock_is_refused_with_both_times(tmp_path: Path) -> None:
    log, pose = tmp_path / "log.csv", tmp_path / "mocap.csv"
    log.write_text("time [s],v,w\n" + "\n".join(f"{0.1 * k:.1f},0.1,0" for k in range(50)))
    pose.write_text("time [s],x,y\n" + "\n".join(f"{900 + 0.1 * k:.1f},{k},0" for k in range(50)))
    result = run("import", log, "--pose", pose, "--wheelbase", 0.2, "--out", tmp_path / "set", "--yes")
    assert isinstance(result.exception, RecordingError)
    assert "shares no time with log.csv: 900 to 904.9, 0 to 4.9" in str(result.exception)


def test_the_wiring_is_what_all_files_say_together(tmp_path: Path) -> None:
    """A load is lifted in one file and lowered in the other, under a current of the same sign."""
    t = np.arange(0.0, 4.0, 0.02)
    for name, way, level in (("up", 1.0, 6.0), ("down", -1.0, 1.5)):
        moving = (t > 1.0) & (t < 3.0)
        current = np.where(moving, level, 3.5)
        speed = way * 2.0 * moving
        rows = "\n".join(f"{a:.2f},{b},{c}" for a, b, c in zip(t, current, speed, strict=True))
        (tmp_path / f"{name}.csv").write_text(f"time [s],Iq,vel [rad/s]\n{rows}\n")
    out = tmp_path / "set"
    result = run("import", tmp_path / "up.csv", tmp_path / "down.csv", "--out", out, "--yes")
    assert result.exit_code == 0, result.output
    said = " ".join(result.output.split())
    assert "drive and motion agree in sign only at times (50% of the moving samples agree)" in said
    assert all((one.effort("left") > 0.0).all() for one in read_recording_set(out))
    assert "a current, full effort taken as 6 A" in result.output


def test_a_mat_file_is_proposed_as_a_table_is(tmp_path: Path) -> None:
    from scipy.io import savemat

    t = np.arange(0.0, 10.0, 0.01)
    vir = 4.0 * np.sign(np.sin(t))
    savemat(tmp_path / "axis.mat", {"t": t, "qm": 0.1 * np.cumsum(vir), "vir": vir, "gtau": 35.0})
    result = run("import", tmp_path / "axis.mat", "--out", tmp_path / "set", "--yes")
    assert result.exit_code == 0, result.output
    assert "vir: the only column left, taken as effort" in result.output
    assert read_recording_set(tmp_path / "set").axis == Axis("translation")


def test_a_mode_is_not_taken_for_an_effort_and_says_how_it_could_be(tmp_path: Path) -> None:
    rows = "\n".join(f"{5 * k},{k * k},{4 * (k > 20)}" for k in range(60))
    (tmp_path / "mouse.csv").write_text(f"time,leftEncoder,leftMode\n{rows}\n")
    result = run("import", tmp_path / "mouse.csv", "--out", tmp_path / "set", "--yes")
    assert isinstance(result.exception, RecordingError)
    assert "effort = leftMode / 4 * E takes it" in result.exception.next_step
    edit = ("--set", "effort = leftMode/4*0.39; from_s = 0")
    assert run("import", tmp_path / "mouse.csv", "--out", tmp_path / "set", "--yes", *edit).exit_code == 0


def test_names_of_an_odrive_are_estimates_and_its_setpoints_are_not() -> None:
    names = ["axis0.encoder.pos_estimate", "axis0.encoder.vel_estimate", "axis0.controller.vel_setpoint"]
    names += ["axis0.motor.current_control.Iq_measured", "odrive vel"]
    values = {name: np.linspace(0.0, 1.0, 30) for name in ("time", *names)}
    table = TextTable(Path("o.csv"), values, {}, {}, tuple(range(30)))
    found = {column.name: (column.kind, column.unit) for column in guess_columns(table)}
    assert [found[name][0] for name in names[:4]] == ["pos", "vel", "other", "effort"]
    assert found[names[3]][1] == "A"
    assert found["odrive vel"] == ("vel", "rot/s")
