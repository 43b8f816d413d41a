"""Pages name files that exist, keep to one width, and say of the rooms what the import contracts say."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WIDTH = 130
TOP_FOLDERS = ("docs", "firmware", "hil_sim", "host", "protocol", "tests")
# `NAME`, `NEWCHIP` and stars stand for any; a colon or dots end a path.
PLACEHOLDER = re.compile(r"(?<![A-Za-z])[A-Z]{4,}(?![A-Za-z]|\.md)|\*|\.\.\.|[<>{}$]")


def pages() -> list[str]:
    """Every tracked page, relative to the root."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return sorted(listed.stdout.split())


def prose(page: str) -> str:
    """A page without its code blocks."""
    return re.sub(r"^```.*?^```", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.M | re.S)


@pytest.mark.parametrize("page", pages())
def test_files_that_a_page_names_exist(page: str) -> None:
    text = prose(page)
    named = [
        token
        for token in re.findall(r"`([\w./*-]+)`", text)
        if token.startswith(tuple(f"{top}/" for top in TOP_FOLDERS)) and not PLACEHOLDER.search(token)
    ]
    linked = [
        (ROOT / page).parent / target.split("#")[0]
        for target in re.findall(r"\]\(([^)\s]+)\)", text)
        if not re.match(r"\w+:|#", target)
    ]
    places = (ROOT, (ROOT / page).parent)
    missing = [token for token in named if not any((place / token).exists() for place in places)]
    missing += [str(path) for path in linked if not path.exists()]
    assert not missing


@pytest.mark.parametrize("page", [page for page in pages() if page.startswith("docs/")])
def test_no_line_of_a_page_is_wider_than_a_screen(page: str) -> None:
    lines = (ROOT / page).read_text(encoding="utf-8").split("\n")
    assert [number for number, line in enumerate(lines, 1) if len(line) > WIDTH] == []


def test_the_architecture_lists_the_rooms_as_the_import_contract_does() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    floors = next(one for one in settings["tool"]["importlinter"]["contracts"] if one["id"] == "floors")
    expected = [set(re.findall(r"\w+", layer)) for layer in floors["layers"] if layer != "__main__"]
    page = (ROOT / "docs/ARCHITECTURE.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \d+ \| (.+?) \|", page, re.M)
    assert [set(re.findall(r"`(\w+)`", row)) for row in rows] == expected


def test_the_architecture_names_every_import_contract() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    ids = {one["id"] for one in settings["tool"]["importlinter"]["contracts"]}
    assert ids <= set(re.findall(r"`([\w-]+)`", (ROOT / "docs/ARCHITECTURE.md").read_text(encoding="utf-8")))
