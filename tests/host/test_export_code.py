"""The exported C header and Python file do what our own model says."""

from __future__ import annotations

import ast
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from support.exported import PERIOD_S, PLAIN, RICH, drive, ours, scale
from truing.errors import TruingError
from truing.exporters import exporter
from truing.model.robot_model import RobotModel
from truing.model.wheel import WheelPhysics
from truing.recording.baseline import RobotGeometry
from truing_protocol import PARAMETERS

PRINTER = r"""
#include <stdio.h>
#define TRUING_WITH_PROTOCOL
#include "robot.h"
int main(void)
{
    for (unsigned k = 0; k < sizeof truing_parameters / sizeof truing_parameters[0]; k++) {
        printf("%u %.9g\n", truing_parameters[k].index, (double)truing_parameters[k].value);
    }
    return 0;
}
"""


def compiled_values(folder: Path, root: Path) -> dict[str, float]:
    """What a C program sees of the header, by the protocol's names."""
    (folder / "printer.c").write_text(PRINTER)
    strict = ("-std=c11", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror")
    includes = (f"-I{root / 'protocol/c'}", f"-I{folder}")
    subprocess.run(["gcc", *strict, *includes, "printer.c", "-o", "printer"], cwd=folder, check=True)
    printed = subprocess.run([folder / "printer"], capture_output=True, text=True, check=True).stdout
    pairs = (line.split() for line in printed.splitlines())
    return {PARAMETERS[int(index)].name: float(np.float32(value)) for index, value in pairs}


def test_the_header_holds_the_boards_parameters_in_single_precision(tmp_path: Path, root: Path) -> None:
    exporter("c-header").write(PLAIN, tmp_path / "robot.h")
    values = compiled_values(tmp_path, root)
    expected = {
        "wheel_radius_m": 0.0635,
        "wheelbase_m": 0.283,
        "counts_per_rev": 2400,
        "ff_ks_left": 0.05,
        "ff_kv_left": 1 / 1.45,
        "ff_ka_left": 0.21 / 1.45,
        "ff_ks_right": 0.07,
        "ff_kv_right": 1 / 1.52,
        "ff_ka_right": 0.24 / 1.52,
    }
    assert values == {name: float(np.float32(value)) for name, value in expected.items()}


def test_feedforward_with_the_headers_values_drives_our_model_along_a_trapezium(
    tmp_path: Path, root: Path
) -> None:
    exporter("c-header").write(PLAIN, tmp_path / "robot.h")
    values = compiled_values(tmp_path, root)
    t = 0.001 * np.arange(2000)
    wanted = np.clip(np.minimum(2.0 * t, 2.0 * (2.0 - t)), 0.0, 0.8)
    # The mean over each interval, which is what an effort that is held stands for.
    speed = np.concatenate(([0.0], 0.5 * (wanted[1:] + wanted[:-1])))
    acceleration = np.concatenate(([0.0], np.diff(wanted) / 0.001))
    efforts = np.array(
        [
            values[f"ff_ks_{side}"] * np.sign(speed)
            + values[f"ff_kv_{side}"] * speed
            + values[f"ff_ka_{side}"] * acceleration
            for side in ("left", "right")
        ]
    )
    error = np.abs(ours(PLAIN, exporter("c-header").HOLDS, t, efforts) - wanted)
    assert error.max() < 1e-4, "m/s: a held effort follows a ramp to within a sample's curvature"


def test_a_header_without_geometry_or_with_a_term_it_cannot_hold_says_so(tmp_path: Path, root: Path) -> None:
    exporter("c-header").write(replace(RICH, robot=RobotGeometry()), tmp_path / "robot.h")
    assert len(compiled_values(tmp_path, root)) == 6
    text = (tmp_path / "robot.h").read_text()
    for term in ("delay", "breakaway", "drag", "offset", "lag", "direction"):
        assert f"{term} is left out, this format has no place for it" in text


def test_values_that_the_board_would_refuse_are_refused_here(tmp_path: Path) -> None:
    backwards = replace(PLAIN, left=WheelPhysics(-1.0, 0.2))
    with pytest.raises(TruingError, match=r"ff_kv_left would be -1; the board takes 0 to 100"):
        exporter("c-header").write(backwards, tmp_path / "robot.h")
    assert not (tmp_path / "robot.h").exists()


SCRIPT = """
import json, sys
sys.path.insert(0, sys.argv[1])
import robot
given = json.load(sys.stdin)
print(json.dumps(robot.simulate(given["t"], *given["efforts"])))
"""


@pytest.mark.parametrize("model", [PLAIN, RICH], ids=["plain", "rich"])
def test_the_python_file_alone_simulates_as_our_own_model(tmp_path: Path, model: RobotModel) -> None:
    import json

    exporter("python").write(model, tmp_path / "robot.py")
    t, efforts = drive()
    given = json.dumps({"t": t.tolist(), "efforts": efforts.tolist()})
    # -I -S: no site packages, no path of ours.
    command = [sys.executable, "-I", "-S", "-c", SCRIPT, str(tmp_path)]
    done = subprocess.run(command, input=given, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    speeds = np.array(json.loads(done.stdout)).T
    error = np.abs(speeds - ours(model, exporter("python").HOLDS, t, efforts))
    # Constant friction is solved in closed form here and there; the rest by steps of 2.5 ms at most.
    assert error.max() < (1e-9 if model is PLAIN else 1e-4) * scale(model)


def test_the_python_file_reads_well_and_imports_only_pythons_own(tmp_path: Path) -> None:
    path = tmp_path / "robot.py"
    exporter("python").write(replace(RICH, source={"set": 'a "quoted" \\ name'}), path)
    tree = ast.parse(path.read_text())
    imported = {
        name.split(".")[0]
        for node in ast.walk(tree)
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [str(node.module)]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    assert imported <= {"__future__", "math", "collections"}
    assert 'a "quoted"' in str(ast.get_docstring(tree))


def test_a_wheel_of_the_python_file_may_be_stepped_as_one_likes() -> None:
    from truing.exporters.standalone_wheel import Robot

    t, efforts = drive()
    tables = [wheel.to_table() for wheel in (PLAIN.left, PLAIN.right)]
    coarse, fine = (Robot(*tables, wheelbase_m=0.283) for _ in range(2))
    for row in range(1, t.size):
        coarse.step(*efforts[:, row], PERIOD_S)
        for _ in range(7):
            fine.step(*efforts[:, row], PERIOD_S / 7.0)
    assert coarse.left.speed_mps == pytest.approx(fine.left.speed_mps, abs=1e-9)
    assert coarse.left.travel_m == pytest.approx(fine.left.travel_m, abs=1e-9)
    assert coarse.theta_rad == pytest.approx(fine.theta_rad, abs=1e-9)
