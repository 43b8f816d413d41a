"""A single motor or axis: one column of effort, one of speed or position; one side computed, no wheels."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from numpy.typing import NDArray

import truing
from truing.cli import group
from truing.diagnose.applicable import beyond_an_axis
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.result import Diagnosis
from truing.errors import IdentifyError, RecordingError
from truing.identify import identification, model_ladder
from truing.recording.axis import Axis
from truing.recording.reader import read_recording_set, read_run
from truing.recording.writer import write_run

Array = NDArray[np.float64]
GAIN_RADPS, TAU_S, FRICTION = 90.0, 0.12, 0.05
ROBOT = re.compile(r"\b(robot|slips?|floor|tyres?|heading|radii|radius|wheelbase)\b", re.IGNORECASE)
TWO_WHEELS = re.compile(r"\b(left(?!.?out)|right|wheels?|both|chassis|turns?|m/s|mm/s)\b", re.IGNORECASE)


def driven(seed: int) -> tuple[Array, Array, Array]:
    """Time, effort and speed of a motor with dry friction, in small steps, at 50 Hz for 8 s."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 8.0, 0.02)
    effort = np.zeros(len(t))
    for begin in range(20, len(t) - 60, 60):
        effort[begin : begin + 40] = rng.uniform(-0.8, 0.8)
    v, speeds = 0.0, []
    for u in effort:
        for _ in range(20):
            free = v + 1e-3 * (GAIN_RADPS * u - v) / TAU_S
            hold = 1e-3 * GAIN_RADPS * FRICTION / TAU_S
            v = float(np.sign(free) * max(abs(free) - hold, 0.0))
        speeds.append(v)
    # The speed of a row is what the effort of the interval that ends there has made of it.
    return t, effort, np.array(speeds) + 0.1 * rng.standard_normal(len(t))


def write(path: Path, columns: dict[str, Array]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def motor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A set of three runs with the columns of one axis."""
    folder = tmp_path_factory.mktemp("motor")
    for seed in range(3):
        t, effort, speed = driven(seed)
        columns = {"t_s": t, "effort": effort, "vel_radps": speed}
        write(folder / "runs" / f"{seed + 1:02d}_steps.csv", columns)
    return folder


@pytest.fixture(scope="module")
def done(motor: Path) -> Diagnosis:
    return truing.diagnose(read_recording_set(motor), jobs=1)


def run(*arguments: object) -> Result:
    return CliRunner().invoke(group, [str(a) for a in arguments], catch_exceptions=False)


def test_a_motors_numbers_are_found_and_said_in_its_units_without_wheels(motor: Path) -> None:
    said = run("fit", motor).stdout
    assert said.startswith("The axis: ")
    gain = float(re.search(r"gain +([\d.]+)", said).group(1))  # type: ignore[union-attr]
    assert gain == pytest.approx(GAIN_RADPS, rel=0.03)
    assert "rad/s" in said
    steps = run("identify", motor).stdout
    assert "mrad/s per %" in steps
    for text in (said, steps):
        assert not TWO_WHEELS.search(text.replace(str(motor), "")), TWO_WHEELS.search(text)


def test_one_side_is_computed(motor: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    computed: list[str] = []

    def watched(module: object, name: str, place: int) -> None:
        original: Callable[..., object] = getattr(module, name)

        def counted(*arguments: object, **more: object) -> object:
            computed.append(f"{name} {arguments[place]}")
            return original(*arguments, **more)

        monkeypatch.setattr(module, name, counted)

    watched(model_ladder, "fit_wheel", 1)
    watched(identification, "step_metrics", 1)
    recordings = read_recording_set(motor)
    models = model_ladder.fit_models(recordings)
    identification.identify_set(recordings)
    assert set(computed) == {"fit_wheel left", "step_metrics left"}
    model = models.robot_model()
    assert model.left == model.right
    assert not models.refused


@pytest.mark.slow
def test_a_diagnosis_of_an_axis_speaks_of_it_alone(motor: Path, tmp_path: Path) -> None:
    baseline, out, page = (tmp_path / name for name in ("baseline.toml", "verdict.json", "page.html"))
    assert run("identify", motor, "--write-baseline", baseline).exit_code == 0
    result = run("diagnose", motor, "--model", baseline, "--json", out, "--report", page)
    assert result.exit_code == 0
    said = result.stdout.replace(str(tmp_path), "").replace(str(motor), "")
    assert said.startswith("Verdict\n  The axis: ")
    assert "friction" in said
    assert not TWO_WHEELS.search(said.split("What to do next")[0]), TWO_WHEELS.search(said)
    html = page.read_text()
    shown = re.sub(r"<style.*?</style>|<script.*?</script>|<[^>]+>", " ", html, flags=re.DOTALL)
    assert not TWO_WHEELS.search(shown), TWO_WHEELS.search(shown)
    names = set(re.findall(r'"name":"([^"]+)"', html))
    assert {"measured", "refitted"} <= names
    assert not any("right" in name or "left" in name.split(",")[0].split() for name in names)
    # The JSON keeps its names: an axis is its left wheel.
    tree = json.loads(out.read_text())
    assert {entry["signal"] for entry in tree["mismatch"]} <= {"vel_left_mps"}


@pytest.mark.parametrize("name", ["vel_radps", "pos_rad", "vel_mps", "pos_m", "ticks"])
def test_an_axis_is_written_as_it_was_read(name: str, tmp_path: Path) -> None:
    t, effort, speed = driven(1)
    values = speed if name.startswith("vel") else np.round(np.cumsum(0.02 * speed) * 100.0)
    file = write(tmp_path / "01_a.csv", {"t_s": t, "effort": effort, name: values})
    read = read_run(file)
    motion = "translation" if name in ("vel_mps", "pos_m") else "rotation"
    assert read.axis == Axis(motion)
    assert np.array_equal(read.effort("left"), read.effort("right"))
    again = write_run(read, tmp_path / "02_b.csv")
    assert again.read_text().splitlines()[0] == f"t_s,effort,{name}"
    assert np.array_equal(read_run(again).columns["effort_left"], effort)


def test_counts_of_a_motor_need_no_radius(tmp_path: Path) -> None:
    t, effort, speed = driven(2)
    ticks = np.round(np.cumsum(0.02 * speed) * 4096 / (2.0 * np.pi))
    file = write(tmp_path / "01_a.csv", {"t_s": t, "effort": effort, "ticks": ticks})
    said = run("fit", file, "--counts-per-rev", 4096).stdout
    gain = float(re.search(r"gain +([\d.]+)", said).group(1))  # type: ignore[union-attr]
    assert gain == pytest.approx(GAIN_RADPS, rel=0.03)


def test_a_file_that_holds_its_numbers_twice_is_taken_as_an_axis_where_that_is_said(tmp_path: Path) -> None:
    t, effort, speed = driven(1)
    twice = {"effort_left": effort, "effort_right": effort, "vel_left_mps": speed, "vel_right_mps": speed}
    file = write(tmp_path / "01_a.csv", {"t_s": t, **twice})
    assert "(left / right)" in run("identify", file).stdout or "wheel" in run("identify", file).stdout.lower()
    said = run("identify", file, "--axis", "translation").stdout
    assert said.startswith("The axis: ")
    assert "rad" not in said.splitlines()[0]


def test_an_axis_without_motion_is_refused_by_name(tmp_path: Path) -> None:
    t, effort, _ = driven(1)
    file = write(tmp_path / "01_a.csv", {"t_s": t, "effort": effort})
    with pytest.raises(RecordingError, match="wheel motion is missing"):
        read_run(file)


def test_an_axis_in_memory_is_read_too() -> None:
    t, effort, speed = driven(1)
    found = truing.read({"t_s": t, "effort": effort, "vel_radps": speed}, name="motor")
    assert found.axis == Axis("rotation")
    assert str(truing.identify(found)).startswith("The axis: ")


def test_commands_in_a_sentence_are_left_alone() -> None:
    said = Axis("rotation").text("The robot: 3 m/s (left wheel). Next: `truing fit /data/left wheel`")
    assert said == "The axis: 3 rad/s. Next: `truing fit /data/left wheel`"


def test_no_effect_that_an_axis_may_have_speaks_of_a_robot() -> None:
    titles = {name: Axis("rotation").text(effect.title) for name, effect in CATALOGUE.items()}
    said = {name: title for name, title in titles.items() if name not in beyond_an_axis()}
    assert "payload_change" in said
    assert "wheel_slip" not in said
    odd = [title for title in said.values() if TWO_WHEELS.search(title) or ROBOT.search(title)]
    assert not odd


def test_effects_of_a_robot_are_not_tried_on_an_axis(done: Diagnosis) -> None:
    """Whatever is listed as a candidate was tried: a slip of the axis was, now and then."""
    tried = {name for entry in done.ranking for name in entry.names}
    assert "coulomb_friction" in tried
    assert not tried & beyond_an_axis()


def test_cogging_of_a_motor_is_named_from_its_angle_alone() -> None:
    """Positions of a rotation are its angle: no radius is asked for."""
    runs = [cogging(seed) for seed in range(2)]
    found = truing.diagnose(truing.read(runs, name="motor"), jobs=1)
    assert [effect.name for effect in found.effects] == ["torque_ripple"]
    ripple = found.effects[0].parameters
    assert ripple["per_revolution"].value == pytest.approx(6.0, abs=0.01)
    assert ripple["amplitude_left"].value == pytest.approx(0.08, abs=0.01)


def cogging(seed: int) -> dict[str, Array]:
    """A motor that creeps both ways over six cogs of a turn, 50 Hz, with the noise of its positions."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 10.0, 0.02)
    effort = np.zeros(len(t))
    for begin in range(20, len(t) - 100, 100):
        effort[begin : begin + 90] = rng.choice([-1.0, 1.0]) * rng.uniform(0.14, 0.5)
    v, angle, angles = 0.0, 0.0, []
    for u in effort:
        for _ in range(20):
            torque = u + 0.08 * np.cos(6.0 * angle)
            v += 1e-3 * (20.0 * torque - v) / TAU_S
            angle += 1e-3 * v
        angles.append(angle)
    # A run begins at the angle at which the last one ended; the table counts from its own start.
    return {"t_s": t, "effort": effort, "pos_rad": np.array(angles) + 2e-4 * rng.standard_normal(len(t))}


def test_a_command_cannot_be_held_against_the_pose_of_an_axis(motor: Path) -> None:
    with pytest.raises(IdentifyError, match="an axis has none"):
        truing.diagnose(read_recording_set(motor), commanded=True)


def test_numbers_of_a_model_that_follows_nothing_are_not_said(done: Diagnosis) -> None:
    assert "at full effort, time constant" in str(done)
    lost = replace(done, fit=replace(done.fit, heldout_model_rmse=1.2 * speed_rms(done)))
    assert "The axis: its gain is not known, no simulation follows these runs" in str(lost)


def speed_rms(done: Diagnosis) -> float:
    rows = np.concatenate([trace.measured[trace.valid] for trace in done.traces])
    return float(np.sqrt(np.mean(rows**2)))


def test_in_python_too_one_side_of_an_axis_is_judged(done: Diagnosis) -> None:
    """Both sides hold the same numbers: two of them take longer and say everything twice."""
    assert {entry.wheel for entry in done.numbers} <= {"left", None}
    assert not [name for effect in done.effects for name in effect.parameters if "right" in name]
