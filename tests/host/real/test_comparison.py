"""The comparison of `truing real`: the same rows for all methods, kept between calls, and who is better."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from support.driven_wheel import Truth, ramps_and_steps
from truing.cli.app import App
from truing.cli.real import command
from truing.diagnose.data.set_data import set_data
from truing.diagnose.data.traces import RunTraces
from truing.diagnose.held_out import folds_of
from truing.diagnose.result import Diagnosis, FitErrors, Split
from truing.errors import FileError
from truing.recording.baseline import Baseline, RobotGeometry, WheelModel
from truing.recording.reader import read_recording_set
from truing.recording.run import RecordingSet, Run
from truing.studies.real import comparison_cache
from truing.studies.real.comparison import OURS, SetComparison, compare, peer_scores
from truing.studies.real.comparison_cache import compare_sets, kept_scores
from truing.studies.real.comparison_tables import comparison_tables, where_peers_are_better
from truing.studies.real.drivetrains import all_set_folders
from truing.studies.real.left_out import Score
from truing.studies.real.peers import catalogue
from truing.studies.real.peers.catalogue import LADDER, PEERS
from truing.studies.real.peers.peer import Peer
from truing.studies.real.row_set import errors_at_every_row, every_row, judged_rows

RUNGS = [peer for peer in PEERS if peer.name in LADDER]
TRUTH = Truth(friction=0.05, delay=0.04, noise=0.01)
TEAM_2881 = "frc_frc2881_2022__sysid_data20220227-150426"


def recorded() -> RecordingSet:
    """Four runs whose wheels are alike."""
    wheel = WheelModel(TRUTH.gain, TRUTH.tau)
    baseline = Baseline(Path("baseline.toml"), wheel, wheel, RobotGeometry("wheels", None, None, None), 50.0)
    runs = []
    for number, one in enumerate(ramps_and_steps(TRUTH), start=1):
        columns = {"t_s": one.t_s}
        for side in ("left", "right"):
            columns[f"effort_{side}"], columns[f"vel_{side}_mps"] = one.effort, one.speed_mps
        runs.append(Run(f"{number:02d}", columns, order=tuple(columns)))
    return RecordingSet("wheels", tuple(runs), baseline)


def diagnosed(recordings: RecordingSet, error_mps: float, every: int = 1) -> Diagnosis:
    """A diagnosis whose model is off by a constant on the rows that it judges, and wrong elsewhere."""
    traces = []
    for run in recordings.runs:
        measured = np.stack([run.columns["vel_left_mps"], run.columns["vel_right_mps"]], axis=1)
        valid = np.zeros(measured.shape, dtype=bool)
        valid[every::every] = True
        model = np.where(valid, measured + error_mps, 99.0)
        model[0] = measured[0]
        effort = np.stack([run.columns["effort_left"], run.columns["effort_right"]], axis=1)
        zeros = np.zeros_like(measured)
        traces.append(
            RunTraces(
                run.name, run.t_s, zeros[:, 0] + 0.02, effort, measured, zeros, zeros, model, zeros, valid
            )
        )
    names = tuple(run.name for run in recordings.runs)
    splits = tuple(Split(tuple(set(names) - {name}), (name,), 0.1, 0.1) for name in names)
    fit = FitErrors(1.0, 1.0, error_mps, 0.0, heldout_model_rmse=2.0 * error_mps)
    return Diagnosis("wheels", "missing_physics", names, fit, splits=splits, traces=tuple(traces))


def compared(name: str = "robot", ours: float = 1.0, left_out: float = 1.2) -> SetComparison:
    scores = {peer.name: Score(2.0, 2.0, 0.1) for peer in PEERS}
    scores[OURS] = Score(ours, left_out, 5.0)
    return SetComparison(name, "missing_physics", ("input_delay",), scores, scores)


def test_our_errors_are_those_that_the_verdict_states() -> None:
    recordings = recorded()
    one = compare(recordings, diagnosed(recordings, 0.03), 4.0, RUNGS, peer_scores)
    top = judged_rows(recordings, diagnosed(recordings, 0.03)).top_mps
    assert one.scores[OURS].fitted == pytest.approx(3.0 / top)
    assert one.scores[OURS].left_out == pytest.approx(6.0 / top)
    assert one.every_row[OURS].fitted == pytest.approx(3.0 / top, rel=1e-3)
    assert one.scores["delay"].fitted < 0.5 * one.scores["friction"].fitted < one.scores["linear"].fitted
    assert one.scores["delay"].fitted == pytest.approx(100.0 * TRUTH.noise / top, rel=0.1)


def test_peers_are_judged_on_the_rows_that_the_diagnosis_judged() -> None:
    recordings = recorded()
    rows = judged_rows(recordings, diagnosed(recordings, 0.03, every=3))
    for runs in rows.wheels:
        assert [int(run.judged.sum()) for run in runs] == [len(range(3, len(run), 3)) for run in runs]
        assert all(run.initial_mps == 0.0 for run in runs)


def test_between_measurements_our_model_is_held_as_the_recorder_holds() -> None:
    recordings = recorded()
    held = []
    for run in recordings.runs:
        columns = dict(run.columns)
        for side in ("left", "right"):
            values = columns[f"vel_{side}_mps"]
            columns[f"vel_{side}_mps"] = values[np.arange(len(values)) // 3 * 3]
        held.append(replace(run, columns=columns))
    recordings = replace(recordings, runs=tuple(held))
    one = compare(recordings, diagnosed(recordings, 0.03, every=3), 4.0, RUNGS[:1], peer_scores)
    assert one.every_row[OURS].fitted == pytest.approx(one.scores[OURS].fitted, rel=0.02)


def test_a_side_that_the_diagnosis_left_out_counts_on_no_row() -> None:
    """The second side of an axis, or a wheel whose encoder is at fault."""
    recordings = recorded()
    both = diagnosed(recordings, 0.03)
    traces = []
    for trace in both.traces:
        valid = trace.valid.copy()
        valid[:, 1] = False
        traces.append(replace(trace, valid=valid, model=np.where(valid, trace.model, 99.0)))
    alone = compare(recordings, replace(both, traces=tuple(traces)), 4.0, RUNGS[:1], peer_scores)
    assert alone.every_row[OURS].fitted == pytest.approx(alone.scores[OURS].fitted, rel=0.01)


def test_rows_that_the_diagnosis_put_together_are_interpolated() -> None:
    """At 1 kHz a model held over 18 ms would be wrong by what a wheel gains in that time."""
    recordings = recorded()
    every = 5
    reduced = []
    for trace in diagnosed(recordings, 0.0).traces:
        at = np.arange(0, len(trace.t_s), every)
        mean = np.array([trace.measured[max(i - every + 1, 0) : i + 1].mean(axis=0) for i in at])
        valid = np.ones((len(at), 2), dtype=bool)
        reduced.append(
            replace(trace, t_s=trace.t_s[at], measured=mean, model=mean, valid=valid, effort=trace.effort[at])
        )
    diagnosis = replace(diagnosed(recordings, 0.0), traces=tuple(reduced))
    rows = every_row(recordings, diagnosis)
    slowest = 100.0 * TRUTH.noise / rows.top_mps
    assert rows.percent(errors_at_every_row(recordings, diagnosis, rows)) < 1.5 * slowest


def test_runs_are_left_out_as_the_diagnosis_leaves_them_out() -> None:
    recordings = recorded()
    data = set_data(recordings)
    rows = every_row(recordings, diagnosed(recordings, 0.03))
    folds = folds_of(data)
    assert [int(folds[data.run_of_row == run][0]) for run in range(4)] == list(rows.part_of_run)


def test_a_finished_set_is_not_compared_again_until_its_files_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "robot"
    (folder / "runs").mkdir(parents=True)
    (folder / "runs" / "01.csv").write_text("t_s\n0\n")
    calls: list[Path] = []

    def count(path: Path, **_: object) -> SetComparison:
        calls.append(path)
        return replace(compared(path.name), every_row={OURS: Score(1.0, math.nan, 5.0)})

    monkeypatch.setattr(comparison_cache, "compare_set", count)
    shares: list[float] = []
    first = compare_sets([folder], shares.append, kept=tmp_path / "kept")
    again = compare_sets([folder], shares.append, kept=tmp_path / "kept")
    assert len(calls) == 1
    assert again[0].scores == first[0].scores
    assert math.isnan(again[0].every_row[OURS].left_out)
    assert shares[-1] == 1.0
    (folder / "runs" / "01.csv").write_text("t_s\n1\n")
    assert compare_sets([folder], shares.append, kept=tmp_path / "kept", resume=False) == []
    compare_sets([folder], shares.append, kept=tmp_path / "kept")
    assert len(calls) == 2


def test_a_set_that_is_refused_is_listed_and_stops_no_other(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    (folder / "runs").mkdir(parents=True)
    (folder / "runs" / "01.csv").write_text("t_s,effort_left\n0,0\n")
    found = compare_sets([folder], lambda share: None, kept=tmp_path / "kept")
    assert "effort_right" in found[0].why
    assert str(tmp_path) not in found[0].why


def test_peers_are_fitted_again_only_when_their_rows_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recordings = recorded()
    rows = judged_rows(recordings, diagnosed(recordings, 0.03))
    other_model = judged_rows(recordings, diagnosed(recordings, 0.5))
    other_rows = judged_rows(recordings, diagnosed(recordings, 0.03, every=2))
    calls: list[int] = []

    def count(peers: object, rows: object) -> dict[str, Score]:
        calls.append(1)
        return {"linear": Score(1.0, 2.0, 0.1)}

    monkeypatch.setattr(comparison_cache, "peer_scores", count)
    for used in (rows, other_model, rows, other_rows):
        found = kept_scores(tmp_path / "robot.json", RUNGS, used)
        assert found == {"linear": Score(1.0, 2.0, 0.1)}
    assert len(calls) == 2


def test_the_tables_say_where_a_peer_is_better() -> None:
    worse = compared("frc_team__file", ours=3.0, left_out=1.0)
    lines = where_peers_are_better([compared(), worse])
    assert any(line.startswith("SysId, on the fitted runs: better on 1 of 2 sets") for line in lines)
    assert any("team file (2.00, ours 3.00 %)" in line for line in lines)
    assert not any("left-out" in line for line in lines)


def test_the_summary_counts_sets_and_names_what_could_not_be_compared() -> None:
    lost = SetComparison("frc_lost__file", why="no wheel moves")
    summary, by_set = comparison_tables([compared(), lost])
    ladder = next(row for row in summary.rows if row[0] == "best rung of the ladder")
    assert ladder[1:7] == ["2.00", "2.00", "0.50", "0.60", "100 %", "100 %"]
    assert [row[0] for row in by_set.rows] == ["robot", "lost file"]
    assert any("no wheel moves" in remark for remark in by_set.remarks)
    assert comparison_tables([lost]) == []


def test_sets_of_all_folders_are_found_once(tmp_path: Path) -> None:
    for place in ("real/a", "more/sets/a", "other/sets/b"):
        (tmp_path / place / "runs").mkdir(parents=True)
    (tmp_path / "mine" / "c" / "runs").mkdir(parents=True)
    found = all_set_folders(tmp_path, [tmp_path / "mine"])
    assert [path.relative_to(tmp_path).as_posix() for path in found] == ["real/a", "other/sets/b", "mine/c"]
    with pytest.raises(FileError, match="holds no recording set"):
        all_set_folders(tmp_path, [tmp_path / "real" / "a"])


def test_a_missing_library_is_said_before_anything_is_diagnosed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "real" / "robot" / "runs").mkdir(parents=True)
    missing = Peer("other", "Other method", PEERS[0].fit, module="no_such_module", library="no-such")
    monkeypatch.setattr(catalogue, "PEERS", (missing,))
    done = CliRunner().invoke(command, [str(tmp_path), "--only", "peers"], obj=App())
    assert type(done.exception).__name__ == "LibraryMissingError"
    assert "no-such" in str(done.exception)


def test_the_command_writes_the_comparison_as_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robots = tmp_path / "robots"
    (robots / "robot" / "runs").mkdir(parents=True)
    monkeypatch.setattr(catalogue, "PEERS", PEERS[:1])

    def worse(folders: list[Path], *_: object, **__: object) -> list[SetComparison]:
        return [compared(folder.name, ours=3.0) for folder in folders]

    monkeypatch.setattr(comparison_cache, "compare_sets", worse)
    page = tmp_path / "page.md"
    arguments = [str(tmp_path), "--only", "peers", "--sets", str(robots), "--markdown", str(page)]
    done = CliRunner().invoke(command, [*arguments, "--json"], obj=App())
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert [one["name"] for one in found["comparisons"]] == ["robot"]
    assert "## Where another method is better" in page.read_text()
    assert "| robot | missing physics | input_delay | 3.00 / 1.20 |" in page.read_text()


@pytest.mark.recordings
def test_the_ladder_reaches_what_is_known_of_a_drivetrain(recordings: Path) -> None:
    one = read_recording_set(recordings / "real" / TEAM_2881)
    names = tuple(run.name for run in one.runs)
    splits = tuple(Split((), (name,), 0.0, 0.0) for name in names)
    fit = FitErrors(1.0, 1.0, 1.0, 1.0)
    rows = every_row(one, Diagnosis("2881", "unexplained", names, fit, splits=splits))
    scores = peer_scores(RUNGS, rows)
    known = {"linear": (2.44, 2.68), "friction": (2.03, 2.09), "delay": (0.81, 1.07), "filter": (0.69, 0.95)}
    for name, (fitted, left_out) in known.items():
        assert scores[name].fitted <= 1.02 * fitted
        assert scores[name].left_out <= 1.03 * left_out
