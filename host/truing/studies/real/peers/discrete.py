"""What the peers of discrete time share: runs end to end, quiet calls, and free runs of what they find."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray
from truing.errors import PeerFailedError
from truing.studies.real.peers.wheel_runs import WheelRun, at_rows, even_interval, even_run

# A model that diverges is stopped at this many times the largest measured speed: its error is large anyway.
DIVERGED = 100.0


@contextmanager
def quiet(what: str) -> Iterator[None]:
    """Keep a library from printing; its exceptions, `sys.exit` among them, become `PeerFailedError`."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        try:
            yield
        except PeerFailedError:
            raise
        except (Exception, SystemExit) as error:
            raise PeerFailedError(f"{what}: {error or type(error).__name__}") from error


@dataclass(frozen=True, slots=True)
class OneRecord:
    """All runs at even times, one behind the other, for libraries that take one record.

    Attributes
    ----------
    effort : shape (n,), row k acts on the speed of row k + 1 at the latest: the mean effort over the interval
        that begins at row k.
    speed_mps : shape (n,).
    """

    interval_s: float
    effort: FloatArray
    speed_mps: FloatArray


def one_record(runs: Sequence[WheelRun]) -> OneRecord:
    """Lay runs end to end at even times."""
    interval = even_interval(runs)
    evens = [even_run(run, interval) for run in runs]
    effort = np.concatenate([np.append(even.effort[1:], even.effort[-1]) for even in evens])
    return OneRecord(interval, effort, np.concatenate([even.speed_mps for even in evens]))


Step = Callable[[FloatArray, FloatArray], FloatArray]


def free_run(run: WheelRun, interval_s: float, step: Step) -> FloatArray:
    """Speeds at the rows of a run, shape (n,).

    Parameters
    ----------
    step : from efforts (m,), ahead by one row as in `OneRecord`, and an array (m,) whose first element is
        the first speed, to speeds (m,).
    """
    even = even_run(run, interval_s)
    effort = np.append(even.effort[1:], even.effort[-1])
    start = np.full(len(effort), run.initial_mps)
    limit = DIVERGED * float(np.max(np.abs(run.speed_mps), initial=1e-3))
    with np.errstate(all="ignore"):
        speed = np.nan_to_num(step(effort, start), nan=limit, posinf=limit, neginf=-limit)
    return at_rows(run, even, np.clip(speed, -limit, limit))
