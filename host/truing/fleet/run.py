"""A run over a fleet: what is done already, the tasks that are left, and when to stop."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field

from truing.errors import OutputError
from truing.fleet.catalogue import SetEntry
from truing.fleet.engine import Engine
from truing.fleet.part import FOLDER, part_name
from truing.fleet.storage import Place
from truing.fleet.task import Job, Outcome, empty_row, process, write_row
from truing.progress import Progress, ignore_progress

# Tasks that wait beside each running one: a worker that ends one has the next already.
AHEAD = 1


@dataclass
class Ran:
    """What a run did.

    Attributes
    ----------
    before : sets that were done already.
    outcomes : of the tasks that ended now.
    """

    parts: dict[str, str]
    before: int
    outcomes: list[Outcome] = field(default_factory=list)

    @property
    def failed(self) -> list[Outcome]:
        """The sets of this run without numbers, or without a verdict for an error."""
        return [outcome for outcome in self.outcomes if outcome.error]


def jobs_of(sets: Sequence[SetEntry], out: str, *, diagnose: bool) -> list[Job]:
    """A job for each set."""
    return [Job(entry, out, part_name(entry, diagnose=diagnose), diagnose) for entry in sets]


def run_fleet(
    jobs: Sequence[Job],
    out: Place,
    engine: Engine,
    progress: Progress = ignore_progress,
    note: Callable[[str], None] = lambda _text: None,
    redo: Collection[str] = (),
) -> Ran:
    """Run the jobs whose rows are not in `out` yet.

    Parameters
    ----------
    redo : sets to run though their row is there, since it is damaged.

    Raises
    ------
    OutputError : a row could not be written; says how many sets are done. Nothing but the running tasks is
        lost.
    SchedulerLostError : likewise, the cluster is gone.
    """
    done = existing_parts(out)
    todo = [job for job in jobs if job.part not in done or job.entry.name in redo]
    ran = Ran({job.entry.name: job.part for job in jobs}, len(jobs) - len(todo))
    finished = ran.before
    if jobs:
        progress(finished / len(jobs))
    not_written: list[OutputError] = []

    def while_written() -> Iterator[Job]:
        for job in todo:
            if not_written:
                return
            yield job

    ended = engine.run(process, while_written(), ahead=AHEAD)
    try:
        for each in ended:
            outcome = each.result
            if outcome is None:  # the worker died of it, or did not hold this version's code
                row = empty_row(each.item.entry) | {"error": f"{type(each.error).__name__}: {each.error}"}
                outcome = write_row(each.item, row, again=True)
            if outcome.not_written is not None:
                not_written.append(outcome.not_written)  # what runs already is waited for
                continue
            finished += 1
            ran.outcomes.append(outcome)
            if outcome.error:
                note(f"{outcome.name}: {outcome.error}")
            progress(finished / len(jobs))
    finally:
        ended.close()  # type: ignore[attr-defined]
    if not_written:
        raise _cannot_go_on(not_written[0], finished, len(jobs))
    return ran


def existing_parts(out: Place) -> set[str]:
    """Names of the rows that are there."""
    folder = out / FOLDER
    return {f"{FOLDER}/{name}" for name in folder.listing()} if folder.exists() else set()


def _cannot_go_on(error: OutputError, done: int, total: int) -> OutputError:
    return OutputError(
        error.path,
        f"{error.problem}; {done} of {total} sets are written",
        error.next_step or "Make it writable, then run the same command again: it goes on where it stopped",
    )
