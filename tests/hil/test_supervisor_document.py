"""The supervisor's diagram and table in firmware/README.md are those of the program."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

import truing_protocol as tp


@pytest.fixture(scope="module")
def program(root: Path) -> list[str]:
    model = root / "build/host/tests/firmware/test_supervisor_model"
    if not model.is_file():
        pytest.skip("the C tests are not built; ./run test builds them")
    return subprocess.run([model, "--edges"], check=True, capture_output=True, text=True).stdout.splitlines()


def test_the_diagram_has_the_edges_that_random_driving_takes_and_no_other(
    root: Path, program: list[str]
) -> None:
    text = (root / "firmware/README.md").read_text()
    drawn = set(re.findall(r"^    (\w+) --> (\w+)", text, re.MULTILINE))
    taken = {tuple(line.split()[1:]) for line in program if line.startswith("edge ")}
    assert drawn == taken
    assert {state for edge in drawn for state in edge} == {state.name.lower() for state in tp.State}


def test_the_table_has_every_fault_as_the_program_holds_it(root: Path, program: list[str]) -> None:
    text = (root / "firmware/README.md").read_text()
    row = r"^\| `(\w+)` \| (\d+) \| (yes|no) \| (when gone|at once|never) \|$"
    rows = re.findall(row, text, re.MULTILINE)
    held = [tuple(line.removeprefix("fault ").split(" | ")) for line in program if line.startswith("fault ")]
    assert rows == held
    assert [row[0] for row in rows] == [fault.name for fault in tp.FAULTS]
    assert [row[2] == "yes" for row in rows] == [fault.stops for fault in tp.FAULTS]
