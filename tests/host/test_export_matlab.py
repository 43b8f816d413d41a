"""Exported .mat files load where MATLAB files are read, and their matrices simulate as our own model."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy

from support.exported import PERIOD_S, PLAIN, RICH, drive, ours, scale
from truing.exporters import ExportOptions, exporter, notes
from truing.model.wheel import PHYSICS_FIELDS


def loaded(path: Path) -> dict[str, np.ndarray]:
    return {name: value for name, value in scipy.io.loadmat(path).items() if not name.startswith("__")}


def test_a_structure_holds_every_parameter_to_the_last_bit(tmp_path: Path) -> None:
    path = tmp_path / "robot.mat"
    exporter("mat").write(RICH, path)
    model = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)["model"]
    for side, wheel in (("left", RICH.left), ("right", RICH.right)):
        for name in PHYSICS_FIELDS:
            assert getattr(getattr(model, side), name) == getattr(wheel, name)
    assert (model.robot.wheel_radius_m, model.robot.name, model.rate_hz) == (0.0635, "stingray", 20.0)


def test_the_discrete_matrices_simulate_as_our_own_model_without_friction(tmp_path: Path) -> None:
    path = tmp_path / "robot.mat"
    simulink = exporter("simulink")
    simulink.write(PLAIN, path, ExportOptions(period_s=PERIOD_S))
    m = loaded(path)
    assert m["Ts"].item() == PERIOD_S
    t, efforts = drive()
    # The input that acts from row k to k + 1 is the effort of row k + 1, so many samples ago.
    delays = m["delay_samples"].ravel().astype(int)
    held = np.array(
        [
            np.concatenate((np.zeros(delay), effort[1:]))[: t.size]
            for delay, effort in zip(delays, efforts, strict=True)
        ]
    )
    _, speeds, _ = scipy.signal.dlsim((m["Ad"], m["Bd"], m["Cd"], m["Dd"], PERIOD_S), held.T)
    error = np.abs(speeds.T - ours(PLAIN, simulink.HOLDS, t, efforts))
    assert error.max() < 1e-9 * scale(PLAIN)


def test_the_continuous_matrices_simulate_as_our_own_model_without_friction_or_delay(tmp_path: Path) -> None:
    path = tmp_path / "robot.mat"
    exporter("simulink").write(PLAIN, path)
    m = loaded(path)
    system = scipy.signal.StateSpace(m["A"], m["B"], m["C"], m["D"])
    t, efforts = drive()
    held = np.concatenate((efforts[:, 1:], efforts[:, -1:]), axis=1)
    _, speeds, _ = scipy.signal.lsim(system, held.T, t, interp=False)
    error = np.abs(speeds.T - ours(PLAIN, frozenset(), t, efforts))
    assert error.max() < 1e-9 * scale(PLAIN)
    np.testing.assert_allclose(m["delay"].ravel(), [0.06, 0.04])
    assert m["Ts"].item() == 1.0 / PLAIN.rate_hz, "unless told otherwise, the log's own interval"


def test_what_is_no_linear_term_is_named_in_both_files_and_friction_stands_beside(tmp_path: Path) -> None:
    path = tmp_path / "robot.mat"
    files = exporter("simulink").write(RICH, path)
    m = loaded(path)
    np.testing.assert_array_equal(m["friction"].ravel(), [0.05, 0.07])
    script = files[1].read_text()
    for text in (" ".join(str(line) for line in m["notes"]), script):
        assert "friction is left out" in text
        assert "breakaway is left out" in text


def test_a_delay_of_no_whole_number_of_samples_is_said_where_it_is_rounded(tmp_path: Path) -> None:
    path = tmp_path / "robot.mat"
    files = exporter("simulink").write(PLAIN, path)
    (said, other) = notes("simulink", PLAIN)[-2:]
    assert "left 0.06 s becomes 0.05 s at Ts = 0.05 s" in said
    assert "right 0.04 s becomes 0.05 s at Ts = 0.05 s" in other
    assert said in files[1].read_text()
    assert not any("becomes" in text for text in notes("simulink", PLAIN, ExportOptions(period_s=PERIOD_S)))


def test_the_script_is_named_as_matlab_wants_and_uses_only_what_it_loads(tmp_path: Path) -> None:
    path = tmp_path / "2 robots-x.mat"
    files = exporter("simulink").write(replace(PLAIN, source={"set": "% odd\nname"}), path)
    assert re.fullmatch(r"[A-Za-z]\w*\.m", files[1].name)
    script = files[1].read_text()
    assert f"'{path.name}'" in script
    code = "\n".join(line for line in script.splitlines() if not line.lstrip().startswith("%"))
    code = re.sub(r"'[^']*'", "''", code)
    known = {"here", "fileparts", "mfilename", "load", "fullfile", "if", "exist", "ss", "end"}
    known |= {"continuous", "discrete"} | set(loaded(path))
    assert set(re.findall(r"[A-Za-z_]\w*", code)) <= known


@pytest.mark.parametrize("kind", ["mat", "simulink"])
def test_the_same_model_gives_the_same_numbers_again(tmp_path: Path, kind: str) -> None:
    for name in ("a.mat", "b.mat"):
        exporter(kind).write(PLAIN, tmp_path / name)
    a, b = loaded(tmp_path / "a.mat"), loaded(tmp_path / "b.mat")
    assert a.keys() == b.keys()
    for name, value in a.items():
        assert np.array_equal(value, b[name])
