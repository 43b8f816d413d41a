"""The diagnosis's model of a set beside every peer: the same rows, the same runs left out."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from truing.diagnose.diagnosis_input import Options
from truing.diagnose.engine import diagnose
from truing.diagnose.result import Diagnosis
from truing.errors import FileError, TruingError
from truing.recording.reader import read_recording_set
from truing.recording.run import RecordingSet
from truing.studies.real.drivetrains import read_drivetrain
from truing.studies.real.left_out import Models, Score, score
from truing.studies.real.peers.catalogue import LADDER, PEERS
from truing.studies.real.peers.peer import Peer
from truing.studies.real.row_set import RowSet, errors_at_every_row, every_row, judged_rows

OURS = "truing"
ScoresOf = Callable[[Sequence[Peer], RowSet], dict[str, Score]]


@dataclass(frozen=True, slots=True)
class SetComparison:
    """One set.

    Attributes
    ----------
    verdict, named : of the diagnosis; the effects of its first explanation.
    scores : by the peer's name, and `OURS`, on the rows that the diagnosis judged.
    every_row : likewise on every row of the files: the ladder, and ours without runs left out.
    why : why there is nothing to compare; empty where there is.
    """

    name: str
    verdict: str = ""
    named: tuple[str, ...] = ()
    scores: Mapping[str, Score] = field(default_factory=dict)
    every_row: Mapping[str, Score] = field(default_factory=dict)
    why: str = ""

    def to_json(self) -> dict[str, Any]:
        """Plain values; NaN becomes None."""
        scores = {"scores": scores_to_json(self.scores), "every_row": scores_to_json(self.every_row)}
        own = {"name": self.name, "verdict": self.verdict, "named": list(self.named), "why": self.why}
        return own | scores

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> SetComparison:
        """What `to_json` wrote."""
        return cls(
            plain["name"],
            plain["verdict"],
            tuple(plain["named"]),
            scores_from_json(plain["scores"]),
            scores_from_json(plain["every_row"]),
            plain["why"],
        )


def scores_to_json(scores: Mapping[str, Score]) -> dict[str, Any]:
    """Plain values by name; NaN becomes None."""
    plain = {name: asdict(score) for name, score in scores.items()}
    return {
        name: {key: None if isinstance(v, float) and math.isnan(v) else v for key, v in one.items()}
        for name, one in plain.items()
    }


def scores_from_json(plain: Mapping[str, Any]) -> dict[str, Score]:
    """What `scores_to_json` wrote."""
    return {
        name: Score(_or_nan(one["fitted"]), _or_nan(one["left_out"]), _or_nan(one["seconds"]), one["why"])
        for name, one in plain.items()
    }


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def compare_set(
    folder: Path, peers: Sequence[Peer] = PEERS, scores_of: ScoresOf | None = None
) -> SetComparison:
    """Diagnose a set from the baseline that lies in it (or a linear one), and fit every peer to it.

    Parameters
    ----------
    scores_of : fits the peers, or knows what they gave before; `peer_scores` where None.
    """
    try:
        recordings = read_recording_set(folder)
        if recordings.baseline is None:
            recordings = read_drivetrain(folder)
        began = time.process_time()
        diagnosis = diagnose(recordings, Options(jobs=1))
        seconds = time.process_time() - began
        return compare(recordings, diagnosis, seconds, peers, scores_of or peer_scores)
    except FileError as error:
        return SetComparison(folder.name, why=error.problem)
    except TruingError as error:
        return SetComparison(folder.name, why=error.message)


def compare(
    recordings: RecordingSet,
    diagnosis: Diagnosis,
    seconds: float,
    peers: Sequence[Peer],
    scores_of: ScoresOf,
) -> SetComparison:
    """Scores of a diagnosis and of the peers.

    Parameters
    ----------
    seconds : processor time of the diagnosis.
    """
    rows = judged_rows(recordings, diagnosis)
    ours = Score(
        100.0 * diagnosis.fit.model_rmse / rows.top_mps,
        100.0 * diagnosis.fit.heldout_model_rmse / rows.top_mps,
        seconds,
    )
    every = every_row(recordings, diagnosis)
    everywhere = Score(every.percent(errors_at_every_row(recordings, diagnosis, every)), math.nan, seconds)
    return SetComparison(
        recordings.name,
        diagnosis.verdict,
        tuple(effect.name for effect in diagnosis.effects if effect.explanation == 0),
        {OURS: ours, **scores_of(peers, rows)},
        {OURS: everywhere, **scores_of([peer for peer in peers if peer.name in LADDER], every)},
    )


def peer_scores(peers: Sequence[Peer], rows: RowSet) -> dict[str, Score]:
    """Scores by the peers' names; each peer may start from those before it."""
    scores: dict[str, Score] = {}
    models: dict[str, Models] = {}
    for peer in peers:
        scores[peer.name], models[peer.name] = score(peer, rows, models)
    return scores
