"""`truing real` as a user calls it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from support.cli import truing
from truing.cli.app import App
from truing.cli.real import command
from truing.diagnose.result import Diagnosis, FitErrors
from truing.studies.real.study import DriftStudy
from truing.studies.real.tables import RealStudy, markdown, undecided


def test_the_papers_runs_need_no_recordings_and_make_a_page(tmp_path: Path) -> None:
    page = tmp_path / "real.md"
    arguments = [str(tmp_path), "--only", "mom", "--markdown", str(page), "--json"]
    done = CliRunner().invoke(command, arguments, obj=App())
    assert done.exit_code == 0, done.output
    tables = json.loads(done.stdout)["tables"]
    assert [table["title"][:9] for table in tables] == ["MOM paper"]
    text = page.read_text()
    assert "fitted to the real end" in text
    assert "heading_drift" in text


def test_a_folder_without_sets_is_named(tmp_path: Path) -> None:
    done = truing("real", str(tmp_path))
    assert done.returncode == 2
    assert "holds no recording set" in done.stderr


def test_a_set_that_is_not_there_is_named(tmp_path: Path) -> None:
    (tmp_path / "real" / "robot" / "runs").mkdir(parents=True)
    done = truing("real", str(tmp_path), "--only", "unicycle")
    assert done.returncode == 2
    assert "unicycle" in done.stderr


@pytest.mark.parametrize("verdict", ["consistent", "unexplained"])
def test_a_page_says_the_verdict_as_it_is(verdict: str) -> None:
    diagnosis = Diagnosis("MOM", verdict, ("01",), FitErrors(1.0, 1.0, 1.0, 1.0))  # type: ignore[arg-type]
    study = RealStudy(drift=DriftStudy(diagnosis, ()))
    assert undecided(study) == []
    assert "What could not be decided" in markdown(study)
