"""The examples of the six verbs, of docs/PYTHON.md and of the notebooks do what they show."""

from __future__ import annotations

import contextlib
import doctest
import importlib
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from support.console import difference
from support.shared_diagnosis import GROUP, diagnosed_once

pytestmark = pytest.mark.xdist_group(GROUP)

ROOT = Path(__file__).parents[2]
MODULES = ("reading", "identifying", "simulating", "exporting", "diagnosing")
PAGE = ROOT / "docs/PYTHON.md"
# Of each notebook: what it needs besides a bare installation.
NOTEBOOKS = {"from_csv_to_verdict": (), "from_verdict_to_mujoco": ("mujoco",)}


class Checker(doctest.OutputChecker):
    """As the transcripts of the other pages: words are equal, numbers agree to a quarter."""

    def check_output(self, want: str, got: str, optionflags: int) -> bool:
        return super().check_output(want, got, optionflags) or difference(want, got) is None


def run(test: doctest.DocTest) -> int:
    """Run one set of examples; the number that ran."""
    said = io.StringIO()
    runner = doctest.DocTestRunner(Checker(), optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    failed, tried = runner.run(test, out=said.write)
    assert not failed, said.getvalue()
    return tried


@pytest.fixture(scope="module", autouse=True)
def _diagnosed_once() -> Iterator[None]:
    with diagnosed_once():
        yield


@pytest.fixture(autouse=True)
def at_the_root(monkeypatch: pytest.MonkeyPatch) -> None:
    """The examples name docs/example."""
    monkeypatch.chdir(ROOT)


@pytest.mark.parametrize("module", MODULES)
def test_the_examples_of_each_verb_print_what_they_show(module: str) -> None:
    found = importlib.import_module(f"truing.api.{module}")
    tests = [test for test in doctest.DocTestFinder().find(found) if test.examples]
    assert sum(map(run, tests)) >= 2


@pytest.mark.slow
def test_the_page_shows_what_its_lines_print(tmp_path: Path) -> None:
    text = PAGE.read_text(encoding="utf-8").replace("out/", f"{tmp_path}/")
    # A block's end is an empty line to doctest.
    text = text.replace("```", "\n")
    assert run(doctest.DocTestParser().get_doctest(text, {}, PAGE.name, str(PAGE), 0)) > 8


def code_cells(name: str) -> list[dict[str, Any]]:
    tree = json.loads((ROOT / "docs/notebooks" / f"{name}.ipynb").read_text(encoding="utf-8"))
    assert tree["nbformat"] == 4
    return [cell for cell in tree["cells"] if cell["cell_type"] == "code"]


def stored(cell: dict[str, Any]) -> str:
    """What the notebook shows below a cell."""
    return "".join("".join(output["text"]) for output in cell["outputs"])


def test_every_notebook_is_run_here() -> None:
    assert {path.stem for path in (ROOT / "docs/notebooks").glob("*.ipynb")} == NOTEBOOKS.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_runs_from_top_to_bottom_and_shows_what_it_prints(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for package in NOTEBOOKS[name]:
        pytest.importorskip(package, reason=f"{name}.ipynb needs {package}: pip install 'truing[engines]'")
    monkeypatch.setenv("TRUING_EXAMPLE", str(ROOT / "docs/example"))
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    code = code_cells(name)
    assert len(code) > 4
    for cell in code:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec("".join(cell["source"]), names)
        wrong = difference(stored(cell), printed.getvalue())
        assert wrong is None, f"{''.join(cell['source'])}\n{wrong}\n\n{printed.getvalue()}"
