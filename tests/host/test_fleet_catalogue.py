"""The catalogue of a fleet: sets by their folders or from a table, and what is wrong with them."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest

from truing.errors import CatalogueError
from truing.fleet.catalogue import date_in, read_catalogue


def touch(root: Path, *names: str) -> Path:
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text("t_s\n")
    return root


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2026-03-01", datetime(2026, 3, 1, tzinfo=UTC)),
        ("20260301_lab", datetime(2026, 3, 1, tzinfo=UTC)),
        ("2026-03-01T14-30", datetime(2026, 3, 1, 14, 30, tzinfo=UTC)),
        ("2026-03-01_14:30:05 wet floor", datetime(2026, 3, 1, 14, 30, 5, tzinfo=UTC)),
        ("2026-13-01", None),
        ("march", None),
    ],
)
def test_a_folder_begins_with_its_date(text: str, expected: datetime | None) -> None:
    assert date_in(text) == expected


def test_folders_of_robots_and_dates_are_a_fleet(tmp_path: Path) -> None:
    touch(
        tmp_path,
        "a/2026-02-01/runs/1.csv",
        "a/2026-01-01/2.csv",
        "b/2026-01-01/runs/1.csv",
        "b/notes/runs/1.csv",
    )
    touch(tmp_path, "b/baseline.toml", "baseline.toml", "a/2026-01-01/baseline.toml", "readme.csv")
    found = read_catalogue([str(tmp_path)])
    assert [entry.name for entry in found.sets] == ["a/2026-01-01", "a/2026-02-01", "b/2026-01-01"]
    assert [entry.model and Path(entry.model).relative_to(tmp_path).as_posix() for entry in found.sets] == [
        None,
        "baseline.toml",
        "b/baseline.toml",
    ]
    assert found.robots == ("a", "b")
    assert len(found.left_out) == 1
    assert "notes" in found.left_out[0]


def test_a_set_whose_file_changes_is_another(tmp_path: Path) -> None:
    touch(tmp_path, "a/2026-02-01/runs/1.csv", "a/2026-02-02/runs/1.csv", "baseline.toml")
    before = [entry.stamp for entry in read_catalogue([str(tmp_path)]).sets]
    (tmp_path / "a/2026-02-01/runs/1.csv").write_text("t_s,more\n")
    after = [entry.stamp for entry in read_catalogue([str(tmp_path)]).sets]
    assert [x == y for x, y in zip(before, after, strict=True)] == [False, True]
    (tmp_path / "baseline.toml").write_text("[robot]\n")
    assert all(x != y.stamp for x, y in zip(after, read_catalogue([str(tmp_path)]).sets, strict=True))


CSV = (
    "path,robot,recorded,group,model\nold/x,anna,2024-05-01 08:00,big,m.toml\nold/y.json,anna,2024-05-02,,\n"
)
TOML = """
[[set]]
path = "old/x"
robot = "anna"
recorded = 2024-05-01T10:00:00+02:00
group = "big"
model = "m.toml"

[[set]]
path = "old/y.json"
robot = "anna"
recorded = 2024-05-02
"""


@pytest.mark.parametrize(("name", "text"), [("sets.csv", CSV), ("sets.toml", TOML)])
def test_a_table_names_sets_wherever_they_lie(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    first, second = read_catalogue([str(tmp_path / name)]).sets
    assert (first.name, first.group, first.recorded) == ("anna/x", "big", datetime(2024, 5, 1, 8, tzinfo=UTC))
    assert (first.url, first.model) == (f"{tmp_path}/old/x", f"{tmp_path}/m.toml")
    assert (second.name, second.group, second.model) == ("anna/y.json", "", None)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("sets.csv", "path,robot\nx,a\n", "its header lacks recorded"),
        ("sets.csv", "path,robot,recorded\nx,a,soon\n", "set 1: recorded = 'soon' is no date"),
        ("sets.csv", "path,robot,recorded\nx,,2026-01-01\n", "set 1 has no robot"),
        ("sets.csv", "path,robot,recorded\nx,a,2026-01-01\nd/x,a,2026-01-02\n", "sets 1 and 2 are both a/x"),
        ("sets.csv", "path,robot,recorded\n", "there is no recording set here"),
        ("sets.toml", "[[set]\n", "is no TOML"),
        ("sets.toml", "set = 3\n", "no array of tables"),
    ],
)
def test_a_table_that_is_wrong_says_where(tmp_path: Path, name: str, text: str, said: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(CatalogueError, match=said) as caught:
        read_catalogue([str(tmp_path / name)])
    assert caught.value.next_step


def test_folders_that_are_no_fleet_say_what_one_looks_like(tmp_path: Path) -> None:
    with pytest.raises(CatalogueError, match="there is nothing here") as nothing:
        read_catalogue([str(tmp_path / "missing")])
    assert "ROBOT/DATE/" in nothing.value.next_step
    with pytest.raises(CatalogueError, match="is one recording set"):
        read_catalogue([str(touch(tmp_path / "set", "runs/1.csv"))])
    with pytest.raises(CatalogueError, match="does not begin with a date"):
        read_catalogue([str(touch(tmp_path / "odd", "a/b/runs/1.csv"))])
    touch(tmp_path / "one", "a/2026-01-01/runs/1.csv")
    with pytest.raises(CatalogueError, match="two sets are called a/2026-01-01"):
        read_catalogue([str(tmp_path / "one"), str(tmp_path / "one")])
