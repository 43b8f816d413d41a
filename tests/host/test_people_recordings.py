"""Recordings as people have them: short, constant, one wheel, coarse counts, volts, a mode for an effort."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from support.synthetic_wheel import Truth, baseline, record, staircase
from truing.cli import group
from truing.errors import IdentifyError, OutputError, RecordingError
from truing.identify.data_checks import check_set
from truing.identify.effort_checks import looks_like_a_mode
from truing.identify.held_out import simplest_good
from truing.identify.identification import Identification, identify_set
from truing.identify.model_ladder import SetModels, fit_models
from truing.identify.quantity import Quantity
from truing.model.robot_model import read_robot_model
from truing.recording.baseline import read_baseline
from truing.recording.run import RecordingSet, Run
from truing.recording.writer import write_run

TRUTH = Truth(delay=0.03)
STEPS = [(0.0, 0.0), (0.3, 0.4), (0.8, -0.3)]


def driven(seed: int = 0, counts_per_rev: float = 2400.0, duration_s: float = 8.0) -> Run:
    steps = staircase(seed, duration_s)
    return record(TRUTH, steps, seed=seed, counts_per_rev=counts_per_rev, duration_s=duration_s, fine_s=1e-3)


def part(run: Run, start: int, stop: int) -> Run:
    return replace(run, columns={name: values[start:stop] for name, values in run.columns.items()})


def changed(run: Run, **columns: np.ndarray) -> Run:
    return replace(run, columns=run.columns | columns)


def as_set(*runs: Run, counts_per_rev: float = 2400.0) -> RecordingSet:
    named = tuple(replace(run, name=f"{number:02d}") for number, run in enumerate(runs))
    return RecordingSet("a robot", named, baseline(counts_per_rev))


def settled(level: float, seed: int) -> Run:
    """A wheel that has run at one effort for long, under a torque that wanders slowly."""
    truth = Truth(disturbance=0.02, disturbance_memory_s=2.0)
    return part(record(truth, [(0.0, level)], duration_s=9.0, seed=seed, fine_s=1e-3), 60, 180)


@pytest.fixture(scope="module")
def constant() -> SetModels:
    return fit_models(as_set(*(settled(level, k) for k, level in enumerate((0.2, 0.3, 0.4, 0.5)))))


def test_a_run_that_is_shorter_than_the_discrete_models_history_leaves_them_the_others() -> None:
    # Logged ten times as fast as the other runs: at their interval three rows are left of it.
    burst = part(record(TRUTH, [(0.0, 0.0), (0.05, 0.4)], rate_hz=200, duration_s=0.4, fine_s=1e-3), 0, 25)
    models = fit_models(as_set(driven(0), driven(1), burst)).wheels[0]
    assert models.arx is not None
    assert set(models.arx.free_run.by_run_mps) == {"00", "01"}
    assert set(models.steps[0].free_run.by_run_mps) == {"00", "01", "02"}


def test_runs_that_are_all_too_short_say_so_and_still_have_a_physical_model() -> None:
    gaps = driven(0)
    keep = np.arange(len(gaps)) % 18 < 12
    models = fit_models(as_set(replace(gaps, columns={k: v[keep] for k, v in gaps.columns.items()})))
    (note,) = [text for text in models.wheels[0].missing if text.startswith("ARX")]
    assert "rows or more" in note
    assert models.wheels[0].chosen.physics.gain_mps == pytest.approx(1.45, rel=0.02)


def test_a_richer_structure_never_fits_worse_than_one_that_it_contains(constant: SetModels) -> None:
    for wheel in constant.wheels:
        errors = [step.free_run.rms_mps for step in wheel.steps]
        assert errors == sorted(errors, reverse=True)


def test_constant_efforts_give_no_time_constant_and_no_model_file(constant: SetModels) -> None:
    for wheel in constant.wheels:
        found = wheel.chosen.parameters["time_constant_s"]
        assert found.value is None
        assert "efforts are constant" in (found.reason or "")
    with pytest.raises(IdentifyError, match="no model is written") as refused:
        constant.robot_model()
    assert "steps" in refused.value.next_step


def test_constant_efforts_that_start_from_rest_do_give_a_time_constant() -> None:
    runs = [record(TRUTH, [(0.0, level)], duration_s=3.0, fine_s=1e-3) for level in (0.2, 0.3, 0.4)]
    model = fit_models(as_set(*runs)).robot_model()
    assert model.left.time_constant_s == pytest.approx(TRUTH.tau, rel=0.05)


@pytest.fixture
def one_wheel(tmp_path: Path) -> Path:
    text = "[robot]\nwheel_radius_m = 0.0635\nwheelbase_m = 0.283\ncounts_per_rev = 2400\n"
    for side in ("left", "right"):
        text += f"[wheel.{side}]\ngain_mps = 1.45\ntime_constant_s = 0.32\n"
    (tmp_path / "baseline.toml").write_text(text)
    for k in range(2):
        still = np.zeros(len(driven(k)))
        write_run(changed(driven(k), effort_right=still, ticks_right=still), tmp_path / f"runs/0{k}.csv")
    return tmp_path


def truing(*arguments: str) -> Result:
    return CliRunner().invoke(group, arguments)


def test_one_moving_wheel_is_fitted_and_stands_in_for_the_other_and_the_file_says_so(one_wheel: Path) -> None:
    out = one_wheel / "made/for/it/model.toml"
    result = truing("fit", str(one_wheel), "--out", str(out))
    assert result.exit_code == 0, result.output
    assert "right wheel in it is a copy" in result.output
    model = read_robot_model(out)
    assert model.right == model.left
    assert model.source["right"].startswith("a copy of the other wheel, not fitted: the effort never changes")


def test_a_diagnosis_of_one_wheel_speaks_of_that_wheel_alone(tmp_path: Path) -> None:
    example = Path(__file__).parents[2] / "docs/example"
    run = min((example / "runs").glob("*.csv"))
    files = {"--report": "verdict.html", "--export": "toml:" + str(tmp_path / "model.toml")}
    arguments = [text for option, name in files.items() for text in (option, name)]
    arguments[1] = str(tmp_path / "verdict.html")
    baseline = ("--model", str(example / "baseline.toml"))
    result = truing("diagnose", str(run), *baseline, "--wheel", "left", *arguments)
    assert result.exit_code == 0, result.output
    said = result.output.split("What to do next")[0]
    assert "eft 0.0" in said
    assert "ight 0.0" not in said
    assert "right wheel" not in said.lower()
    assert "stribeck_friction" in read_baseline(tmp_path / "model.toml").effects


def intervals(result: Identification) -> list[Quantity]:
    found = [fit.gain for fit in result.fits] + [fit.time_constant for fit in result.fits]
    for run in result.runs:
        for step in (*run.left.steps, *run.right.steps):
            found += [step.gain, step.time_constant, step.dead_time, step.overshoot, step.undershoot]
            found.append(step.ripple)
    return [quantity for quantity in found if quantity.ci95 is not None]


@pytest.mark.parametrize("counts_per_rev", [4.0, 8.0, 16.0, 64.0])
def test_coarse_counts_give_intervals_that_are_possible_and_have_a_width(counts_per_rev: float) -> None:
    levels = [(0.0, 0.0), (1.0, 0.22), (5.0, 0.46), (9.0, -0.5), (13.0, -0.1), (17.0, 0.53), (21.0, 0.0)]
    run = record(TRUTH, levels, duration_s=22.0, counts_per_rev=counts_per_rev, fine_s=1e-3)
    result = identify_set(as_set(run, counts_per_rev=counts_per_rev))
    assert intervals(result)
    for quantity in intervals(result):
        assert quantity.ci95 is not None
        assert quantity.value is not None
        low, high = quantity.ci95
        assert 0.0 <= low <= quantity.value <= high < np.inf
        assert high > low
    steps = [step for step in result.runs[0].left.steps if step.input != 0.0]
    truths = [1000.0 * TRUTH.gain * (abs(s.input) - TRUTH.friction) / abs(s.input) / 100.0 for s in steps]
    told = [(s.gain.ci95, truth) for s, truth in zip(steps, truths, strict=True) if s.gain.ci95]
    assert told
    assert all(low <= truth <= high for (low, high), truth in told)


@pytest.mark.parametrize(("scale", "unit"), [(12.0, "volts"), (100.0, "per cent")])
def test_efforts_in_another_unit_are_questioned_with_the_scale(scale: float, unit: str) -> None:
    run = driven(0)
    scaled = changed(run, **{f"effort_{w}": scale * run.effort(w) for w in ("left", "right")})
    for command in (identify_set, fit_models):
        with pytest.raises(RecordingError, match=f"are these {unit}") as refused:
            command(as_set(scaled))
        assert "Divide volts by the supply voltage" in refused.value.next_step


@pytest.mark.parametrize("value", [1.0, 4.0, 4.0 / 255.0])
def test_a_mode_taken_for_an_effort_is_questioned(value: float) -> None:
    # A trapezium of speed, as a motion controller makes it in one mode: up, along, down to rest.
    levels = np.concatenate(
        (np.zeros(10), np.linspace(0.05, 0.5, 40), np.linspace(0.5, 0.05, 40), np.zeros(20))
    )
    run = record(
        TRUTH, [(0.05 * k, level) for k, level in enumerate(levels.tolist())], duration_s=5.5, fine_s=1e-3
    )
    mode = np.where(np.abs(run.effort("left")) > 1e-3, value, 0.0)
    with pytest.raises(RecordingError, match="mode or an enable flag"):
        identify_set(as_set(changed(run, effort_left=mode, effort_right=mode)))


def test_full_effort_back_and_forth_is_no_mode() -> None:
    steps = [(0.5 * k, (-1.0) ** k) for k in range(16)]
    run = record(TRUTH, steps, duration_s=8.0, fine_s=1e-3)
    assert not looks_like_a_mode(run.t_s, np.sign(run.effort("left")), run.speed("left", baseline()).values)
    one_level = record(TRUTH, [(0.0, 0.0), (1.0, 0.3), (4.0, 0.0)], duration_s=6.0, fine_s=1e-3)
    assert not looks_like_a_mode(
        one_level.t_s, one_level.effort("left"), one_level.speed("left", baseline()).values
    )


def test_a_slow_side_may_as_well_be_another_motor() -> None:
    run = driven(0)
    (finding,) = check_set(as_set(changed(run, ticks_right=np.floor(0.7 * run.columns["ticks_right"]))))
    assert "or the two motors do" in finding.text


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit", "--out", "taken/model.toml"),
        ("fit", "--report", "taken/there"),
        ("identify", "--out", "taken/there"),
        ("diagnose", "--json", "taken/v.json"),
        ("diagnose", "--export", "toml:taken/m.toml"),
    ],
)
def test_an_output_that_cannot_be_written_is_found_before_the_work(
    one_wheel: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, str, str]
) -> None:
    def worked(*_: object, **__: object) -> None:
        raise AssertionError("the work began")

    monkeypatch.setattr("truing.identify.model_ladder.fit_models", worked)
    monkeypatch.setattr("truing.identify.identification.identify_set", worked)
    monkeypatch.setattr("truing.diagnose.engine.diagnose", worked)
    monkeypatch.chdir(one_wheel)
    (one_wheel / "taken").write_text("a file")
    command, option, path = arguments
    result = truing(command, str(one_wheel), option, path)
    assert isinstance(result.exception, OutputError), result.exception


def test_a_model_that_diverges_is_not_chosen_and_ends_no_fit() -> None:
    assert simplest_good([(float("nan"), 1), (2.0, 3), (2.01, 2)]) == 2
    assert simplest_good([(float("nan"), 1), (float("inf"), 2)]) == 0
