"""The page of what each format carries names every effect, and a measurement made again says the same."""

from __future__ import annotations

import re

import pytest

from bench import carried
from truing.diagnose.catalogue import CATALOGUE
from truing.exporters.consumers import CONSUMERS


def rows() -> dict[str, list[str]]:
    """Cells of each effect's row, own error first."""
    found = {}
    for line in carried.PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == len(CONSUMERS) + 2 and re.fullmatch(r"\d+\.\d+", cells[1]):
            found[cells[0].strip("`")] = cells[1:]
    return found


def test_every_effect_stands_on_the_page_once() -> None:
    text = carried.PAGE.read_text(encoding="utf-8")
    assert list(rows()) == list(carried.EFFECTS)
    listed = re.findall(r"^- `(\w+)`$", text, re.MULTILINE)
    assert listed == carried.unheld()
    assert set(CATALOGUE) <= {*carried.EFFECTS, *carried.ELSEWHERE, *listed}


def test_formats_that_hold_everything_carry_every_effect() -> None:
    for kind in ("python", "fmu"):
        column = list(CONSUMERS).index(kind) + 1
        assert all(cells[column].startswith("carried: ") for cells in rows().values()), kind


@pytest.mark.parametrize("effect", ["driver_lag", "direction_asymmetry"])
def test_measured_again_it_says_the_same(effect: str) -> None:
    found = carried.measured(effect, kinds=("python", "mjcf", "urdf"))
    for kind in ("python", "mjcf", "urdf"):
        told = rows()[effect][list(CONSUMERS).index(kind) + 1]
        again = carried.cell(found, kind)
        assert again.split(":")[0] == told.split(":")[0], f"{kind}: {again}, and the page says {told}"
