"""A peer on a set: both wheels, fitted to every run, then to all runs but those of one part in turn."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.errors import PeerFailedError
from truing.studies.real.peers.peer import Peer, WheelModel
from truing.studies.real.peers.wheel_runs import WheelRun
from truing.studies.real.row_set import RowSet

Models = tuple[WheelModel, ...]


@dataclass(frozen=True, slots=True)
class Score:
    """Errors of one method on one set, both wheels and all judged rows together.

    Attributes
    ----------
    fitted, left_out : RMS of the free run's error on the runs that were fitted, and on each part of the runs
        by the fit to the others; per cent of top speed, NaN where the method fails.
    seconds : processor time of the fit to all runs.
    why : why it fails, in words; empty where it does not.
    """

    fitted: float
    left_out: float
    seconds: float
    why: str = ""


def score(peer: Peer, rows: RowSet, below: Mapping[str, Models]) -> tuple[Score, Models]:
    """Errors of a peer, and its models of the two wheels; no models where it fails.

    Parameters
    ----------
    below : models of the peers before it, by name.
    """
    began = time.process_time()
    starts = below.get(peer.starts_from, ())
    try:
        models = tuple(
            peer.fit(runs, starts[wheel] if starts else None) for wheel, runs in enumerate(rows.wheels)
        )
        seconds = time.process_time() - began
        fitted = [_errors(models[wheel], runs) for wheel, runs in enumerate(rows.wheels)]
        left_out = [
            error
            for wheel, runs in enumerate(rows.wheels)
            for error in _left_out(peer, runs, rows.part_of_run, models[wheel])
        ]
    except PeerFailedError as failure:
        return Score(math.nan, math.nan, time.process_time() - began, str(failure)), ()
    unseen = rows.percent(left_out) if left_out else math.nan
    return Score(rows.percent(fitted), unseen, seconds), models


def _left_out(
    peer: Peer, runs: Sequence[WheelRun], part_of_run: Sequence[int], near: WheelModel
) -> list[FloatArray]:
    errors = []
    for part in sorted(set(part_of_run)):
        seen = [run for run in runs if part_of_run[run.run] != part]
        if not seen:
            # A single run: the methods are fitted to whole ones.
            return []
        errors.append(_errors(peer.fit(seen, near), [run for run in runs if part_of_run[run.run] == part]))
    return errors


def _errors(model: WheelModel, runs: Sequence[WheelRun]) -> FloatArray:
    return np.concatenate([run.judge(model.simulate(run)) for run in runs])
