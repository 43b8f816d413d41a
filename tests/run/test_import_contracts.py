"""The import contracts of pyproject.toml: the tree keeps them, and an import against one of them fails."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SOURCES = ("host/truing", "hil_sim/python/hil_sim", "protocol/python/truing_protocol")


@pytest.fixture(scope="module")
def copy(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The three packages and their contracts, side by side."""
    folder = tmp_path_factory.mktemp("packages")
    for source in SOURCES:
        shutil.copytree(
            root / source, folder / Path(source).name, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(root / "pyproject.toml", folder)
    return folder


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    """Check the contracts on the packages in `folder`."""
    return subprocess.run(
        [Path(sys.executable).with_name("lint-imports"), "--no-logo", "--no-cache"],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        timeout=60,
    )


def test_the_tree_keeps_its_import_contracts(copy: Path) -> None:
    found = lint(copy)
    assert found.returncode == 0, found.stdout
    assert " 0 broken" in found.stdout


@pytest.mark.parametrize(
    ("file", "line", "contract"),
    [
        ("truing/recording/run.py", "import truing.report.plot", "Rooms import only rooms below them"),
        ("truing/web/server.py", "import truing.trial.robot", "Rooms import only rooms below them"),
        ("truing/web/session.py", "import truing.web.live.frame", "Rooms of the view import only rooms"),
        ("truing/new_room.py", "", "Rooms import only rooms below them"),
        ("truing/diagnose/compare.py", "import hil_sim.plant", "The diagnosis never reaches the plant"),
        ("truing/identify/even.py", "import truing.virtual.board", "The diagnosis never reaches the plant"),
        ("truing/web/server.py", "import truing.cli.app", "No room imports the command line"),
        ("truing/link/client.py", "import truing.board.device", "The link carries bytes and messages"),
        (
            "truing/diagnose/effects/wheel_slip.py",
            "import truing.diagnose.effects.input_delay",
            "Effects know nothing of each other",
        ),
        ("hil_sim/plant.py", "import truing.errors", "The plant and the protocol know nothing of the host"),
    ],
)
def test_an_import_against_a_contract_is_refused(copy: Path, file: str, line: str, contract: str) -> None:
    path = copy / file
    before = path.read_text(encoding="utf-8") if path.exists() else None
    path.write_text(f"{before or ''}\n{line}\n", encoding="utf-8")
    found = lint(copy)
    if before is None:
        path.unlink()
    else:
        path.write_text(before, encoding="utf-8")
    assert found.returncode != 0
    broken = [text for text in found.stdout.splitlines() if "BROKEN" in text]
    assert any(text.startswith(contract) for text in broken), found.stdout + found.stderr
