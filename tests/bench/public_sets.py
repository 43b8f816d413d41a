"""Public recordings read by one command each: the model found, beside a ladder of least-squares fits.

`python tests/bench/public_sets.py [NAME...]` prints the table of docs/howto/public_sets.md, in some minutes.
Files are looked for under $TRUING_RECORDINGS/raw; sets whose files are not there are left out.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from click.testing import CliRunner

from bench.figure import Figure
from support.public_sets import PUBLIC_SETS, PublicSet
from truing.cli import group
from truing.cli.app import App
from truing.diagnose.diagnosis_input import Options, with_what_to_compare
from truing.diagnose.engine import diagnose
from truing.errors import TruingError
from truing.recording.baseline import RobotGeometry
from truing.recording.reader import read_recording_set
from truing.recording.run import RecordingSet
from truing.studies.real.comparison import OURS, SetComparison, compare, peer_scores
from truing.studies.real.left_out import Score
from truing.studies.real.peers.catalogue import LADDER, PEERS

# The same as another file; and a command held against a pose, which no wheel's ladder follows.
LEFT_OUT = ("romi table", "mrclam")
# A count of whatever length: errors are per cents of the top speed.
COUNTS = RobotGeometry(wheel_radius_m=1.0, counts_per_rev=360.0)


@dataclass(frozen=True)
class Row:
    """One set: what the diagnosis says, its scores and those of the ladder; `why` where there are none."""

    name: str
    comparison: SetComparison
    why: str = ""

    @property
    def best(self) -> tuple[str, Score]:
        """The rung that is best on runs left out; of a single run, on the fitted one."""
        rungs = [(name, self.comparison.scores[name]) for name in LADDER]
        return min(rungs, key=lambda rung: _judged(rung[1]))


def _judged(score: Score) -> float:
    return score.fitted if math.isnan(score.left_out) else score.left_out


def rows(recordings: Path, names: Sequence[str] = ()) -> Iterator[Row]:
    """A row for each set whose files are there."""
    for name, one in PUBLIC_SETS.items():
        if name in LEFT_OUT or (names and name not in names):
            continue
        if all(path.exists() for path in one.paths(recordings)):
            with tempfile.TemporaryDirectory() as folder:
                yield _row(name, _read(one, recordings, Path(folder) / "set"))


def _read(one: PublicSet, recordings: Path, out: Path) -> RecordingSet:
    asks = App.asks
    App.asks = property(lambda self: True)  # type: ignore[method-assign,assignment]
    try:
        said = CliRunner().invoke(group, one.arguments(recordings, out), input=one.answers)
    finally:
        App.asks = asks  # type: ignore[method-assign]
    if said.exit_code:
        raise TruingError(said.output or str(said.exception))
    found = read_recording_set(out)
    counts = all(run.has_pair("ticks") and not run.has_pair("vel") for run in found)
    return found.with_geometry(COUNTS) if counts else found


def _row(name: str, recordings: RecordingSet) -> Row:
    peers = [peer for peer in PEERS if peer.name in LADDER]
    options = Options(jobs=1)
    try:
        known = with_what_to_compare(recordings, options, lambda said: None)
        return Row(name, compare(known, diagnose(known, options), math.nan, peers, peer_scores))
    except TruingError as error:
        return Row(name, SetComparison(name), error.message)


def measure(root: Path) -> list[Figure]:
    """Ours beside the best rung, on runs left out (fitted ones, where a set is a single run)."""
    return [
        Figure(
            f"{row.name}, {'fitted' if math.isnan(row.best[1].left_out) else 'runs left out'}",
            row.comparison.scores[OURS].fitted
            if math.isnan(row.best[1].left_out)
            else row.comparison.scores[OURS].left_out,
            "%",
            "less",
            None,
            f"ladder ({row.best[0]})",
            _judged(row.best[1]),
        )
        for row in rows(folder(root))
        if not row.why
    ]


def folder(root: Path) -> Path:
    """Where the recordings are."""
    named = os.environ.get("TRUING_RECORDINGS")
    return Path(named) if named else root.parent / "shared" / "recordings"


def main(names: Sequence[str]) -> None:
    """Print the table."""
    print("| set | verdict | truing | best of the ladder, by runs left out |\n| --- | --- | --- | --- |")
    for row in rows(folder(Path(__file__).resolve().parents[2]), names):
        if row.why:
            print(f"| {row.name} | none | {row.why} | |", flush=True)
            continue
        rung, best = row.best
        ours = row.comparison.scores[OURS]
        verdict = row.comparison.verdict.replace("_", " ")
        print(f"| {row.name} | {verdict} | {_shown(ours)} | {_shown(best)} ({rung}) |", flush=True)


def _shown(score: Score) -> str:
    return " / ".join(f"{value:.2f}" for value in (score.fitted, score.left_out) if not math.isnan(value))


if __name__ == "__main__":
    main(sys.argv[1:])
