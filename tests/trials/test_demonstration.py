"""`truing demo` ends with a concealed effect: sealed, located, named, modelled, and judged on unseen runs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from support.console import commands, difference
from truing.cli.app import App
from truing.cli.demo import command
from truing.recording.baseline import read_baseline
from truing.trial import demonstration
from truing.trial.demonstration import Demonstration, demonstrate

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "docs/example"


@pytest.mark.slow
def test_the_demo_finds_what_is_concealed_and_lowers_the_error_on_unseen_runs(
    image: Path, native_library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Demonstration] = []

    def watched(*arguments: object, **options: object) -> Demonstration:
        seen.append(demonstrate(*arguments, **options))  # type: ignore[arg-type]
        return seen[-1]

    monkeypatch.setattr(demonstration, "demonstrate", watched)
    monkeypatch.setenv("TRUING_OUT", str(tmp_path / "out"))
    monkeypatch.setenv("TRUING_RECORDINGS", str(tmp_path / "none"))
    result = CliRunner().invoke(command, [], obj=App())
    assert result.exit_code == 0, result.output

    # The first part comes first, the seal before the verdict, and the picture with all that was written.
    order = (
        "The robot just driven",
        "sealed answer, SHA-256",
        "Verdict",
        "The seal is opened",
        "that nothing was fitted to",
        "concealed.png",
    )
    places = [result.stdout.index(words) for words in order]
    assert places == sorted(places)

    shown = seen[0]
    hidden = {name for name, _ in shown.concealed}
    assert hidden
    assert hidden == {effect.name for effect in shown.diagnosis.effects}
    assert shown.place is not None
    assert shown.result.sha256 in result.stdout
    assert not set(shown.unseen_runs) & set(shown.diagnosis.runs)
    assert shown.refitted_mps < shown.given_mps
    assert shown.model_mps < 0.5 * shown.refitted_mps
    assert shown.model_mps < 1.5 * shown.noise_mps
    assert f"{1e3 * shown.model_mps:.1f} with what was found" in result.stdout
    json.dumps(shown.to_json(), allow_nan=False)

    out = tmp_path / "out" / "demo"
    assert (out / "concealed.png").read_bytes().startswith(b"\x89PNG")
    assert hidden <= set(read_baseline(out / "concealed" / "model.toml").effects)

    # docs/example holds what the demo drives, and the main page what is said of it.
    driven = out / "concealed" / "set"
    names = sorted(path.name for path in (driven / "runs").iterdir())
    assert names == sorted(path.name for path in (EXAMPLE / "runs").iterdir())
    for file in ("baseline.toml", *(f"runs/{name}" for name in names)):
        assert (EXAMPLE / file).read_bytes() == (driven / file).read_bytes(), f"copy {file} to {EXAMPLE}"
    shown_on_page = commands(ROOT / "README.md")[0]
    assert shown_on_page.text == "./run truing diagnose docs/example"
    printed = result.stdout[result.stdout.index("\nVerdict\n") :]
    assert difference(shown_on_page.shown, printed) is None
