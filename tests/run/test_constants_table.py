"""docs/CONSTANTS.md names every constant of the diagnosis with its present value, and no other."""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from bench import constants  # noqa: E402


def test_the_table_names_every_constant_and_no_other() -> None:
    listed, file = [], ""
    for line in constants.PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            file = line.removeprefix("## ")
        elif row := re.match(r"\| `(\w+)` \| ([^|]+) \|", line):
            listed.append((file, row[1], row[2]))
    assert sorted(listed) == sorted((c.file, c.name, constants.shown(c.value)) for c in constants.constants())


def test_lines_are_no_longer_than_130_characters() -> None:
    assert max(map(len, constants.PAGE.read_text(encoding="utf-8").splitlines())) <= 130


def test_an_integer_changes_by_at_least_one() -> None:
    assert constants.changed(1, 1.3) == 2
    assert constants.changed((10, -2.0), 0.7) == (7, -1.4)


def test_what_was_measured_is_taken_up_from_the_page() -> None:
    panel, marks = constants.read_page()
    assert constants.page(panel, marks) == constants.PAGE.read_text(encoding="utf-8")
