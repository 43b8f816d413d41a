"""`import truing` gives six verbs: files, arrays and frames in, what the command line says out."""

from __future__ import annotations

import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest

import truing
from support.shared_diagnosis import GROUP, diagnosed_once
from truing.diagnose.result import Diagnosis
from truing.errors import RecordingError, TruingError
from truing.identify.first_baseline import with_first_baseline
from truing.recording.baseline import RobotGeometry
from truing.recording.run import RecordingSet

pytestmark = pytest.mark.xdist_group(GROUP)

EXAMPLE = Path(__file__).parents[2] / "docs/example"
VERBS = ("diagnose", "export", "fit", "identify", "read", "simulate")


class Frame:
    """What pandas and polars frames have in common: `columns`, and a series by its name."""

    def __init__(self, data: dict[str, object]) -> None:
        self._data = data
        self.columns = list(data)

    def __getitem__(self, name: str) -> object:
        return self._data[name]


@pytest.fixture(scope="module")
def example() -> RecordingSet:
    return truing.read(EXAMPLE)


@pytest.fixture(scope="module")
def diagnosis(example: RecordingSet) -> Diagnosis:
    """One diagnosis for all tests."""
    with diagnosed_once():
        return truing.diagnose(example)


@pytest.fixture
def columns(example: RecordingSet) -> dict[str, np.ndarray]:
    """One run of time, efforts and counts."""
    names = ("t_s", "effort_left", "effort_right", "ticks_left", "ticks_right")
    return {name: example.runs[0].columns[name] for name in names}


GEOMETRY = {"counts_per_rev": 4096, "wheel_radius_m": 0.0457003}


def test_importing_truing_loads_nothing_heavy_and_lists_the_verbs() -> None:
    script = (
        "import sys, truing; assert not {'numpy', 'numba', 'scipy', 'rich', 'truing.api'} & set(sys.modules);"
        f"assert set({VERBS!r}) <= set(dir(truing)); assert truing.__version__"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)


@pytest.mark.parametrize("first", ["import truing.diagnose.engine, truing.identify.tables", "pass"])
def test_a_verb_stays_a_verb_whichever_module_was_imported_first(first: str) -> None:
    script = f"import truing\n{first}\nassert all(callable(getattr(truing, name)) for name in {VERBS!r})"
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="verify"):
        truing.verify  # noqa: B018


@pytest.mark.parametrize("form", ["mapping", "frame", "structured"])
def test_columns_in_memory_are_the_run_that_the_file_holds(columns: dict[str, np.ndarray], form: str) -> None:
    table: object = columns
    if form == "frame":
        table = Frame(dict(columns))
    elif form == "structured":
        rows = np.zeros(len(columns["t_s"]), dtype=[(name, float) for name in columns])
        for name, values in columns.items():
            rows[name] = values
        table = rows
    found = truing.read(table, **GEOMETRY)
    (run,) = found.runs
    assert all(np.array_equal(run.columns[name], columns[name]) for name in columns)
    assert found.robot == RobotGeometry("", 0.0457003, None, 4096)


def test_several_tables_are_several_runs(columns: dict[str, np.ndarray]) -> None:
    assert [run.name for run in truing.read([columns, columns], name="bench")] == ["01_bench", "02_bench"]
    assert [run.name for run in truing.read({"a": columns, "b": Frame(dict(columns))})] == ["a", "b"]


def test_other_names_and_units_are_mapped_as_in_a_mapping_file(columns: dict[str, np.ndarray]) -> None:
    other = {
        "ms": 1e3 * columns["t_s"],
        "l": 255 * columns["effort_left"],
        "r": 255 * columns["effort_right"],
        "cl": columns["ticks_left"],
        "cr": columns["ticks_right"],
    }
    mapping = {
        "t_s": {"column": "ms", "scale": 1e-3},
        "effort_left": {"column": "l", "scale": 1 / 255},
        "effort_right": {"column": "r", "scale": 1 / 255},
        "ticks_left": "cl",
        "ticks_right": "cr",
    }
    plain, mapped = (
        truing.read(table, mapping=how, **GEOMETRY) for table, how in ((columns, None), (other, mapping))
    )
    for name, values in plain.runs[0].columns.items():
        assert mapped.runs[0].columns[name] == pytest.approx(values, abs=1e-12)
    with pytest.raises(RecordingError, match="'ms'"):
        truing.read(columns, mapping=mapping)


def test_a_wrong_table_says_which_column_and_row(columns: dict[str, np.ndarray]) -> None:
    wrong: list[tuple[dict[str, object], str]] = [
        ({k: v for k, v in columns.items() if k != "effort_left"}, "effort_left"),
        (columns | {"t_s": columns["t_s"][:-1]}, "effort_left.*shape"),
        (columns | {"t_s": columns["t_s"][::-1]}, "t_s.*row 2: time runs backwards"),
        (
            columns | {"ticks_left": np.where(columns["t_s"] == 0.5, np.nan, 0.0)},
            "ticks_left.*row 11: nan is not a finite",
        ),
        (
            columns | {"ticks_left": np.array(["x"] * len(columns["t_s"]), dtype=object)},
            "ticks_left.*row 1: 'x'",
        ),
    ]
    for table, said in wrong:
        with pytest.raises(RecordingError, match=said) as caught:
            truing.read(table, name="bench")
        assert "bench" in str(caught.value)
        assert "line" not in str(caught.value)
    with pytest.raises(TruingError, match="int"):
        truing.read(3)


def test_gains_are_found_from_counts_in_memory_and_judge_as_a_baseline(
    example: RecordingSet, columns: dict[str, np.ndarray]
) -> None:
    found = truing.identify(truing.read(columns, **GEOMETRY))
    for wheel in ("left", "right"):
        assert found.whole_fits[wheel].gain.value == pytest.approx(1.2, rel=0.05)
    again = truing.read(example, found)
    assert again.baseline is not None
    assert again.baseline.left.gain_mps == found.whole_fits["left"].gain.value


def test_a_simulated_robot_is_identified_as_what_was_simulated(example: RecordingSet) -> None:
    assert example.baseline is not None
    simulated = truing.simulate(example.baseline, example)
    assert [run.name for run in simulated.runs] == [run.name for run in example]
    found = truing.identify(simulated.recordings).whole_fits
    assert found["left"].gain.value == pytest.approx(example.baseline.left.gain_mps, rel=1e-3)
    assert found["right"].time_constant.value == pytest.approx(
        example.baseline.right.time_constant_s, rel=1e-2
    )


def test_efforts_alone_are_simulated_from_rest(columns: dict[str, np.ndarray]) -> None:
    efforts = {name: columns[name] for name in ("t_s", "effort_left", "effort_right")}
    simulated = truing.simulate(EXAMPLE / "baseline.toml", Frame(dict(efforts)))
    (run,) = simulated.runs
    assert simulated.errors == {}
    assert run.columns["vel_left_mps"][0] == 0.0
    travel = np.sum(run.columns["vel_left_mps"][1:] * np.diff(run.t_s))
    assert run.columns["pos_left_m"][-1] == pytest.approx(travel, abs=1e-3)


def test_the_error_of_a_simulation_is_the_one_that_fit_reports(example: RecordingSet) -> None:
    models = truing.fit(example)
    simulated = truing.simulate(models, example)
    for wheel in models.wheels:
        assert simulated.errors[wheel.wheel].rms_mps == pytest.approx(wheel.chosen.free_run.rms_mps, rel=1e-6)
    assert "friction" in str(models)


def test_a_gap_starts_the_simulation_afresh(example: RecordingSet) -> None:
    run = example.runs[0]
    late = np.where(np.arange(len(run)) < 100, 0.0, 5.0)
    moved = truing.read(run.to_dict() | {"t_s": run.t_s + late}, example.baseline)
    simulated = truing.simulate(EXAMPLE / "baseline.toml", moved).runs[0]
    measured = moved.runs[0].speed("left", moved.robot).values
    assert simulated.columns["vel_left_mps"][100] == measured[100]


def test_columns_become_a_frame_of_the_library_that_is_there(
    example: RecordingSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(TruingError, match="pandas or polars"):
        example.runs[0].to_frame()
    monkeypatch.setitem(sys.modules, "polars", types.SimpleNamespace(DataFrame=Frame))
    frame = example.runs[0].to_frame()
    assert truing.read(frame, example.baseline).runs[0].columns.keys() == example.runs[0].columns.keys()


def test_the_diagnosis_prints_the_sentences_of_the_command(diagnosis: Diagnosis) -> None:
    from truing.diagnose.present.text import headline

    assert diagnosis.verdict == "missing_physics"
    text = str(diagnosis)
    assert " ".join(text.split()).startswith("Verdict The robot: ")
    assert headline(diagnosis) in " ".join(text.split()[:60])
    assert len(text.splitlines()) < 30
    assert "What to do next" in text


def test_results_show_themselves_in_a_notebook(example: RecordingSet, diagnosis: Diagnosis) -> None:
    for result in (example, truing.identify(example), diagnosis, truing.simulate(diagnosis, example)):
        page = result._repr_html_()
        assert page.startswith("<pre>")
        assert str(result).splitlines()[0].split(":")[0] in page


def test_the_corrected_model_simulates_better_than_the_baseline(
    example: RecordingSet, diagnosis: Diagnosis
) -> None:
    before, after = (truing.simulate(model, example).errors for model in (example.baseline, diagnosis))
    for wheel in ("left", "right"):
        assert after[wheel].rms_mps < 0.4 * before[wheel].rms_mps


def test_a_diagnosis_is_exported_with_its_check_and_read_back(diagnosis: Diagnosis, tmp_path: Path) -> None:
    done = truing.export(diagnosis, tmp_path / "model.toml")
    assert done.files == (tmp_path / "model.toml",)
    assert f"written: {tmp_path / 'model.toml'}" in str(done)
    again = truing.read(EXAMPLE, tmp_path / "model.toml")
    assert again.baseline is not None
    assert "stribeck_friction" in again.baseline.effects
    board = truing.export(diagnosis, tmp_path / "board.toml", "params")
    assert "[parameters]" in board.files[0].read_text(encoding="utf-8")


def test_an_export_says_which_kinds_there_are(diagnosis: Diagnosis, tmp_path: Path) -> None:
    with pytest.raises(TruingError, match=r"several kinds end in \.mat") as caught:
        truing.export(diagnosis, tmp_path / "model.mat")
    assert "simulink" in caught.value.next_step
    with pytest.raises(TruingError, match="'obj'"):
        truing.export(EXAMPLE / "baseline.toml", tmp_path / "model.obj", "obj")


def test_a_pose_is_not_judged_against_commands_without_a_baseline(columns: dict[str, np.ndarray]) -> None:
    """What full effort means in metres per second is in no recording of a command."""
    with pytest.raises(TruingError, match="baseline") as caught:
        truing.diagnose(truing.read(columns, **GEOMETRY), commanded=True)
    assert caught.value.next_step


def test_without_a_baseline_the_best_first_order_model_is_what_a_diagnosis_compares_with(
    columns: dict[str, np.ndarray],
) -> None:
    found = with_first_baseline(truing.read(columns, **GEOMETRY))
    assert found.baseline is not None
    known = truing.identify(found).whole_fits["left"]
    assert found.baseline.left.gain_mps == pytest.approx(known.gain.value, rel=0.05)
    assert found.baseline.robot.counts_per_rev == GEOMETRY["counts_per_rev"]
    assert with_first_baseline(found) is found
