"""Tables of any program become runs through a mapping file; MATLAB files also by a run's own column names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy

from support.foreign_files import drive, drives
from truing.errors import FileError, RecordingError
from truing.importers import ImportOptions, import_file, is_foreign
from truing.importers.tables import read_table

MAPPING = """
[columns]
t_s = { column = "ms", scale = 1e-3 }
effort_left = { column = "pwm", scale = 0.00392156862745098 }
effort_right = { column = "pwm", scale = 0.00392156862745098 }
ticks_left = "left"
ticks_right = { column = "right", scale = -1.0, offset = 5.0 }
"""


def table(rows: int = 100, separator: str = ",") -> str:
    lines = [separator.join(("ms", " pwm", "left", "right", "phase"))]
    for row in range(rows):
        phase = "rest" if row < 30 else "go" if row < 70 else "stop"
        lines.append(separator.join((str(2000 + 10 * row), "51", f" {7 * row}", str(-7 * row), phase)))
    return "\n".join(lines) + "\n"


def place(folder: Path, text: str, mapping: str = MAPPING, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_text(text)
    (folder / "log.mapping.toml").write_text(mapping)
    return path


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_mapping_beside_the_file_says_which_column_is_which(tmp_path: Path, separator: str) -> None:
    path = place(tmp_path, table(separator=separator))
    assert is_foreign(path)
    (run,) = import_file(path).runs
    np.testing.assert_allclose(run.t_s, 0.01 * np.arange(100), atol=1e-12)
    np.testing.assert_allclose(run.columns["effort_left"], 0.2)
    np.testing.assert_array_equal(run.columns["ticks_left"], 7 * np.arange(100))
    np.testing.assert_array_equal(run.columns["ticks_right"], 7 * np.arange(100))


def test_a_mapping_may_be_named_and_may_split_the_table_into_runs(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(table())
    mapping = tmp_path / "elsewhere.toml"
    mapping.write_text(MAPPING + '[split]\ncolumn = "phase"\nskip = ["rest"]\n')
    runs = import_file(path, ImportOptions(mapping=mapping)).runs
    assert [run.name for run in runs] == ["01_go", "02_stop"]
    assert [len(run) for run in runs] == [40, 30]
    assert all(run.columns["ticks_left"][0] == 0 and run.t_s[0] == 0.0 for run in runs)


def test_without_a_mapping_the_error_shows_how_one_begins(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(table())
    with pytest.raises(RecordingError, match=r"there is no mapping: log\.mapping\.toml") as caught:
        import_file(path)
    assert "[columns]" in caught.value.next_step


def test_a_file_of_our_own_form_is_not_foreign(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t_s,effort_left,effort_right,ticks_left,ticks_right\n0,0,0,0,0\n")
    assert not is_foreign(path)
    path.write_text("t_s,effort_left,ticks_left,ticks_right\n0,0,0,0\n")
    assert not is_foreign(path), "a missing column is the reader's to name"
    assert not is_foreign(tmp_path)
    assert not is_foreign(tmp_path / "nothing.csv")


@pytest.mark.parametrize(
    ("mapping", "says"),
    [
        ("", "has no [columns] table"),
        ("[columns", "cannot be read as a mapping"),
        ('[columns]\nspeed = "a"', "speed: a run has no such column"),
        ('[columns]\nt_s = "ms"', "lacks effort_left, effort_right, one of the pairs"),
        (MAPPING.replace('"pwm"', '"PWM"'), "column 'PWM': log.mapping.toml takes effort_left from"),
        (MAPPING.replace("scale = 1e-3", "factor = 1e-3"), "t_s: unknown key 'factor'"),
        (MAPPING.replace("scale = 1e-3", 'scale = "ms"'), "t_s: scale must be a finite number"),
        (MAPPING + "[split]\nskip = []", "[split] needs column = NAME"),
        (MAPPING + '[split]\ncolumn = "stage"', "splits by a column that is not there"),
    ],
)
def test_a_wrong_mapping_is_explained(tmp_path: Path, mapping: str, says: str) -> None:
    path = place(tmp_path, table(), mapping)
    with pytest.raises(FileError) as caught:
        import_file(path)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("2100,51", "2100,", "column 'pwm', row 11 (line 12 of the file): '' is not a number"),
        ("2100,51", "2100,inf", "column 'pwm', row 11 (line 12 of the file): not a finite number"),
        ("2100,51", "2_100,51", "column 'ms', row 11 (line 12 of the file): '2_100' is not a number"),
        ("2100,51,", "2100,51", "row 11 (line 12 of the file): 4 cells where the header has 5"),
        ("2100,51", "1100,51", "time runs backwards in test 'log', its row 11"),
    ],
)
def test_a_damaged_row_is_named(tmp_path: Path, old: str, new: str, says: str) -> None:
    text = table()
    assert old in text
    with pytest.raises(RecordingError) as caught:
        import_file(place(tmp_path, text.replace(old, new, 1)))
    assert says in str(caught.value)


def test_a_table_without_rows_or_with_too_few_is_refused(tmp_path: Path) -> None:
    for rows in (0, 5):
        with pytest.raises(RecordingError, match=r"log\.csv"):
            import_file(place(tmp_path, table(rows)))


def test_a_mat_file_with_a_runs_column_names_needs_no_mapping(tmp_path: Path) -> None:
    truth = drive("fast-forward")
    path = tmp_path / "step.mat"
    effort = truth.volts / 12.0
    columns = {"t_s": truth.t, "effort_left": effort, "effort_right": effort, "notes": "a step", "mass": 3.0}
    columns |= {"vel_left_mps": truth.speed, "vel_right_mps": truth.speed}
    scipy.io.savemat(path, columns)
    (run,) = import_file(path).runs
    np.testing.assert_allclose(run.columns["vel_right_mps"], truth.speed)
    np.testing.assert_allclose(run.columns["effort_left"], effort)


def test_a_mat_file_with_structures_is_read_through_a_mapping(tmp_path: Path) -> None:
    truth = drive("fast-forward")
    path = tmp_path / "step.mat"
    log = {"t": 1e6 * truth.t, "u": truth.volts, "q": truth.travel}
    scipy.io.savemat(path, {"log": log, "gains": np.eye(3)})
    (tmp_path / "step.mapping.toml").write_text(
        '[columns]\nt_s = { column = "log.t", scale = 1e-6 }\n'
        + "".join(
            f'effort_{s} = {{ column = "log.u", scale = 0.08333333333333333 }}\n' for s in ("left", "right")
        )
        + "".join(f'pos_{s}_m = "log.q"\n' for s in ("left", "right"))
    )
    (run,) = import_file(path).runs
    np.testing.assert_allclose(run.t_s, truth.t, atol=1e-9)
    np.testing.assert_allclose(run.columns["pos_left_m"], truth.travel)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
def test_a_truncated_mat_file_is_refused_by_name(tmp_path: Path, share: float) -> None:
    path = tmp_path / "step.mat"
    truth = drives()[2]
    scipy.io.savemat(
        path, {"t_s": truth.t, "effort_left": truth.volts, "speed": truth.speed}, do_compression=True
    )
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(RecordingError, match=r"step\.mat"):
        import_file(path)


def test_a_mat_file_of_version_7_3_is_refused_with_the_way_out(tmp_path: Path) -> None:
    path = tmp_path / "new.mat"
    # The text header of every .mat file, with the version that 7.3 (an HDF5 file) carries.
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + b"\x89HDF\r\n\x1a\n" + bytes(500))
    with pytest.raises(RecordingError, match=r"7\.3") as caught:
        import_file(path)
    assert "-v7" in caught.value.next_step


def test_a_table_that_has_changed_is_read_again(tmp_path: Path) -> None:
    """Proposal, preview and import share what was read; a file that is written meanwhile is another table."""
    path = tmp_path / "log.csv"
    path.write_text("time,left,right\n" + "".join(f"{0.1 * k:.1f},1,2\n" for k in range(30)))
    first = read_table(path)
    assert read_table(path) is first
    path.write_text("time,left,right\n" + "".join(f"{0.1 * k:.1f},1,3_0\n" for k in range(30)))
    again = read_table(path)
    assert first.numbers["right"][0] == 2.0
    # float() would take 3_0 for thirty.
    assert "right" in again.texts
