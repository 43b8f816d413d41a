"""The paper's tests I to XVII, driven through the flashed image: Tables III and IV, and the run format."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from truing.cli import group
from truing.cli.app import App
from truing.recording.reader import read_recording_set


@pytest.fixture(scope="module")
def paper(image: Path, native_library: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The command's JSON value, and of the same drive what it prints without `--json`."""
    folder = tmp_path_factory.mktemp("paper") / "set"
    values: list[dict[str, Any]] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(App, "emit", lambda _, value: values.append(value))
        done = CliRunner().invoke(group, ["paper", "--set", str(folder)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return json.loads(json.dumps(values[0], allow_nan=False)) | {"folder": folder, "printed": done.stdout}


def test_effort_gains_are_the_papers_within_three_per_cent_and_eight_at_worst(paper: dict[str, Any]) -> None:
    levels = [level for level in paper["levels"] if level["mode"].startswith("E")]
    assert len(levels) == 22
    for level in paper["levels"]:
        print(
            f"{level['test']:>5} {level['mode']} {level['input']:5.2f}  gain {level['gain']:7.3f} "
            f"paper {level['gain_paper']:7.3f}  tau {level['tau_s'] or float('nan'):.3f} "
            f"paper {level['tau_paper_s']:.3f}"
        )
    errors = [abs(level["gain"] / level["gain_paper"] - 1) for level in levels]
    print(f"mean {sum(errors) / len(errors):.2%}, worst {max(errors):.2%}")
    assert sum(errors) / len(errors) <= 0.03
    assert max(errors) <= 0.08


def test_velocity_gains_are_one_as_integral_action_makes_them(paper: dict[str, Any]) -> None:
    levels = [level for level in paper["levels"] if level["mode"].startswith("V")]
    assert len(levels) == 16
    for level in levels:
        assert level["gain"] == pytest.approx(1.0, abs=0.005)


def test_the_three_gains_at_fifteen_per_cent_differ_as_the_papers_do(paper: dict[str, Any]) -> None:
    """Friction, the scrub of a pivot and the supply: 9.132 pivoting, 12.131 from rest, 13.338 coming down."""
    at_15 = {level["test"]: level["gain"] for level in paper["levels"] if level["input"] == 0.15}
    assert at_15["I"] < at_15["IX"] < at_15["XVII"]


def test_every_run_passes_the_reader_and_knows_the_pause_before_it(paper: dict[str, Any]) -> None:
    recordings = read_recording_set(paper["folder"])
    assert len(recordings.runs) == 17
    pauses = [run.metadata.pause_before_s for run in recordings.runs if run.metadata is not None]
    assert pauses[0] is None
    assert all(pause is not None and 0.0 < pause < 5.0 for pause in pauses[1:])
    for run in recordings.runs:
        assert not run.warnings
        assert run.rate_hz == pytest.approx(20.0)
        assert run.pose() is not None
        assert run.mode is not None
        assert run.mode[-1] == "idle" or run.mode[-1] == "effort"


def test_the_table_is_printed_beside_the_papers(paper: dict[str, Any]) -> None:
    for word in ("Table III", "Table IV", "9.13", "14.83", "1.076", "not bent", "on average"):
        assert word in paper["printed"]
