"""Every module and folder is in the table of its README, and no line of a README is too long to read."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

# README, and the folder whose modules its tables name.
MODULE_TABLES = {
    "firmware/core/README.md": "firmware/core",
    "firmware/stm32/README.md": "firmware/stm32",
    "firmware/stm32f405/README.md": "firmware/stm32f405",
    "firmware/stm32g474/README.md": "firmware/stm32g474",
    "hil_sim/board/README.md": "hil_sim/board",
    "hil_sim/host_robot/README.md": "hil_sim/host_robot",
    "hil_sim/plant/README.md": "hil_sim/plant",
    "hil_sim/python/README.md": "hil_sim/python/hil_sim",
    "hil_sim/rig/README.md": "hil_sim/rig",
    "protocol/README.md": "protocol/generator",
}
# Rooms of the host package whose README names their modules, in any place.
HOST_ROOMS = (
    "exporters",
    "fleet",
    "identify",
    "importers",
    "model",
    "studies/real",
    "trial",
    "trial/engines",
)
# Rooms without a README: host/README.md names their modules.
PLAIN_ROOMS = ("api", "board", "clock", "flash", "link", "log", "recording", "report", "studies", "virtual")
# README whose table names the folders beside it.
FOLDER_TABLES = ("firmware/README.md", "hil_sim/README.md", "tests/README.md")
# Markdown files, or folders of them.
NARROW = (
    *("firmware", "hil_sim", "protocol"),
    *("tests/README.md", "tests/firmware", "tests/fuzz"),
)
MODULES = {".c", ".py"}
FILES = {".c", ".h", ".py", ".S", ".ld"}
MAX_COLUMNS = 130


def named_in_tables(readme: Path) -> set[str]:
    """What stands in backticks in the first column of any table."""
    rows = [line for line in readme.read_text(encoding="utf-8").splitlines() if line.startswith("|")]
    return {name for row in rows for name in re.findall(r"`([^`]+)`", row.split("|")[1])}


@pytest.mark.parametrize("readme", MODULE_TABLES)
def test_every_module_of_the_folder_is_in_the_table(root: Path, readme: str) -> None:
    named = named_in_tables(root / readme)
    modules = {path for path in (root / MODULE_TABLES[readme]).iterdir() if path.suffix in MODULES}
    missing = {
        path.name
        for path in modules
        if path.name not in named and path.stem not in named and not path.name.startswith("__")
    }
    assert not missing, f"{readme} does not name {', '.join(sorted(missing))}"


@pytest.mark.parametrize("readme", MODULE_TABLES)
def test_every_file_in_the_table_is_there(root: Path, readme: str) -> None:
    folder = root / MODULE_TABLES[readme]
    files = {path.name for path in folder.iterdir() if path.suffix in FILES}
    there = files | {Path(name).stem for name in files}
    named = {name for name in named_in_tables(root / readme) if re.fullmatch(r"\w+(\.(c|h|py|S|ld))?", name)}
    assert not named - there, f"{readme} names {', '.join(sorted(named - there))}"


def unnamed(folder: Path, text: str) -> list[str]:
    """Modules of a folder that stand nowhere in backticks, whole or as a pattern."""
    patterns = re.findall(r"`([\w*]+\.py)`", text)
    modules = [path for path in folder.glob("*.py") if not path.name.startswith("__")]
    return sorted(path.name for path in modules if not any(path.match(each) for each in patterns))


@pytest.mark.parametrize("room", HOST_ROOMS)
def test_the_readme_of_a_room_names_every_module(root: Path, room: str) -> None:
    folder = root / "host/truing" / room
    assert not unnamed(folder, (folder / "README.md").read_text(encoding="utf-8"))


@pytest.mark.parametrize("room", PLAIN_ROOMS)
def test_the_readme_of_the_host_names_every_module_of_a_room_without_one(root: Path, room: str) -> None:
    folder = root / "host/truing" / room
    assert not (folder / "README.md").exists()
    assert not unnamed(folder, (root / "host/README.md").read_text(encoding="utf-8"))


def test_the_readme_of_the_host_names_every_room_and_module_beside_them(root: Path) -> None:
    package = root / "host/truing"
    named = named_in_tables(root / "host/README.md")
    rooms = {f"{path.name}/" for path in package.iterdir() if path.is_dir()} - {"__pycache__/"}
    modules = {path.name for path in package.glob("*.py") if not path.name.startswith("__")}
    assert not (rooms | modules) - named


@pytest.mark.parametrize("readme", FOLDER_TABLES)
def test_every_folder_is_in_the_table(root: Path, readme: str) -> None:
    named = named_in_tables(root / readme)
    folders = {path.name for path in (root / readme).parent.iterdir() if path.is_dir()} - {"__pycache__"}
    missing = {name for name in folders if f"{name}/" not in named}
    assert not missing, f"{readme} does not name {', '.join(sorted(missing))}"


@pytest.mark.parametrize("where", NARROW)
def test_no_line_is_longer_than_a_screen_is_wide(root: Path, where: str) -> None:
    path = root / where
    files = sorted(path.rglob("*.md")) if path.is_dir() else [path]
    assert files
    long = [
        f"{file.relative_to(root)}:{number}: {len(line)} columns"
        for file in files
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1)
        if len(line) > MAX_COLUMNS
    ]
    assert not long, "\n".join(long)
