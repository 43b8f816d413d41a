"""docs/DATA_FORMAT.md and its schema say what the code reads and writes."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator

from support import diagnoses, recorded_sets
from support.recorded_sets import BASELINE_TOML, Change, Columns, write_set
from support.simulated_runs import fine
from truing.cli.app import App
from truing.cli.diagnose import command
from truing.diagnose.catalogue import CATALOGUE
from truing.diagnose.result import VERDICTS, Diagnosis
from truing.importers.mapping import read_mapping
from truing.plan import parse_plan
from truing.recording.axis import AXIS_COLUMNS
from truing.recording.baseline import read_baseline
from truing.recording.run import NUMERIC_COLUMNS, REQUIRED_COLUMNS

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "DATA_FORMAT.md").read_text(encoding="utf-8")
SCHEMA = json.loads((DOCS / "verdict.schema.json").read_text(encoding="utf-8"))


def section(title: str) -> str:
    """The page from a heading to the next one of its level."""
    return PAGE.split(f"\n## {title}", 1)[1].split("\n## ", 1)[0]


def block(text: str, language: str) -> str:
    """The first code block of a language."""
    return text.split(f"```{language}\n", 1)[1].split("```", 1)[0]


def closed(schema: Any) -> Any:
    """The schema without room for keys that it does not describe."""
    if isinstance(schema, list):
        return [closed(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    tree = {key: closed(value) for key, value in schema.items()}
    if "properties" in tree and "type" in tree:
        tree.setdefault("additionalProperties", False)
    return tree


def check(tree: Any) -> None:
    """A verdict is what the schema says, and holds nothing that it does not describe."""
    Draft202012Validator(SCHEMA).validate(tree)
    Draft202012Validator(closed(SCHEMA)).validate(tree)


@pytest.mark.parametrize(
    "make",
    [
        diagnoses.consistent,
        diagnoses.parameters_only,
        diagnoses.missing_physics,
        diagnoses.ambiguous,
        diagnoses.partly_explained,
        diagnoses.unexplained,
    ],
)
def test_every_kind_of_verdict_is_what_the_schema_says(make: Callable[[], Diagnosis]) -> None:
    check(json.loads(json.dumps(make().to_json(), allow_nan=False)))


def _friction(_name: str, values: Columns) -> None:
    """Replace the plain robot's counts by those of one with dry friction."""
    efforts = np.column_stack([values["effort_left"], values["effort_right"]])
    gain, slope = recorded_sets.GAIN_MPS, recorded_sets.GAIN_MPS / recorded_sets.TAU_S
    speeds = fine(
        efforts,
        lambda _t, v, u: u - v / gain,
        lambda v: np.full_like(v, 0.06),
        slope=np.full(2, slope),
        step_s=1e-3,
    )
    per_count = 2.0 * np.pi * recorded_sets.RADIUS_M / recorded_sets.COUNTS
    travel = np.cumsum(speeds, axis=0) / recorded_sets.RATE_HZ
    for i, side in enumerate(("left", "right")):
        values[f"ticks_{side}"] = np.floor(travel[:, i] / per_count)


@pytest.mark.parametrize(
    ("change", "model", "verdict"),
    [
        (None, BASELINE_TOML, "consistent"),
        (None, BASELINE_TOML.replace("1.45", "1.6"), "parameters_only"),
        (_friction, BASELINE_TOML, "missing_physics"),
    ],
)
def test_what_diagnose_writes_is_what_the_schema_says(
    tmp_path: Path, change: Change | None, model: str, verdict: str
) -> None:
    folder = write_set(tmp_path / "set", change=change, model=model)
    done = CliRunner().invoke(command, [str(folder), "--json", str(tmp_path / "v.json")], obj=App())
    assert done.exit_code == 0, done.output
    tree = json.loads((tmp_path / "v.json").read_text(encoding="utf-8"))
    check(tree)
    assert tree["verdict"] == verdict


def test_the_schema_is_a_schema_and_refuses_what_is_no_verdict() -> None:
    Draft202012Validator.check_schema(SCHEMA)
    good = diagnoses.missing_physics().to_json()
    for change in (
        {"verdict": "fine"},
        {"effects": []},
        {"fit": {"baseline_rmse": 0.1}},
        {"next_experiment": {"plan": {"segment": []}}},
        {"verdict": "consistent"},
    ):
        assert not Draft202012Validator(SCHEMA).is_valid(good | change), change


def test_the_page_names_every_verdict_and_key() -> None:
    text = section("4. A verdict")
    assert set(VERDICTS) <= set(re.findall(r"^\| `(\w+)` \|", text, re.M))
    first_cells = " ".join(re.findall(r"^\| (`.*?) \|", text, re.M))
    keys = {re.split(r"[.\[]", key)[0] for key in re.findall(r"`([\w.\[\]]+)`", first_cells)}
    assert set(SCHEMA["properties"]) - {"verdict"} <= keys


def test_the_verdict_on_the_page_is_one() -> None:
    check(json.loads(block(section("4. A verdict"), "json")))


def test_the_page_lists_the_columns_that_are_read() -> None:
    table = section("2. A run").split("### Metadata")[0]
    rows = re.findall(r"^\| (`.+?`) \| (.+?) \|", table, re.M)
    columns = {name: kind for names, kind in rows for name in re.findall(r"`(\w+)`", names)}
    assert set(columns) == NUMERIC_COLUMNS | {"mode"} | set(AXIS_COLUMNS)
    required = {name for name, kind in columns.items() if kind == "required"}
    assert required == {*REQUIRED_COLUMNS, "effort"}


def test_the_baseline_on_the_page_is_one(tmp_path: Path) -> None:
    file = tmp_path / "baseline.toml"
    file.write_text(block(section("3. A baseline"), "toml"))
    baseline = read_baseline(file)
    assert baseline.wheelbase_m == 0.283
    assert set(baseline.effects) <= set(CATALOGUE)


def test_the_plan_on_the_page_is_one() -> None:
    plan = parse_plan(tomllib.loads(block(section("6. A plan"), "toml")), "page", "DATA_FORMAT.md")
    assert (len(plan.segments), plan.log_rate_hz) == (6, 50)


def test_the_mapping_on_the_page_is_one(tmp_path: Path) -> None:
    file = tmp_path / "mapping.toml"
    file.write_text(block(section("7. A column mapping"), "toml"))
    assert read_mapping(file).split == "test"
