"""Where the tasks of a fleet, or of a campaign of trials, run: an interface, and a pool of processes.

`dask_engine.py` is the other implementation: a cluster. This one serves where `distributed` is not
installed, since a campaign of trials must not need the extra `[fleet]`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Generic, Protocol, TypeVar

from truing.errors import WorkerLostError

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Ended(Generic[Item, Result]):
    """A task that has ended: its result, or the error that it raised."""

    item: Item
    result: Result | None = None
    error: BaseException | None = None

    def value(self) -> Result:
        """The result; raises the task's error."""
        if self.error is not None:
            raise self.error
        assert self.result is not None
        return self.result


class Engine(Protocol):
    """Runs a function on many items at once."""

    @property
    def workers(self) -> int:
        """How many tasks run at the same time."""

    def run(
        self, function: Callable[[Item], Result], items: Iterable[Item], *, ahead: int = 0
    ) -> Iterator[Ended[Item, Result]]:
        """Run `function` on each item, and yield each as it ends, in whatever order.

        An item is taken only when a worker can have it: what `items` decides, it decides late. An error of a
        task is yielded with its item. Closing the iterator gives up what has not begun.

        Parameters
        ----------
        function : importable by name, as its items are sent to other processes.
        ahead : tasks that wait beside the running ones, for each worker, so that none is idle.

        Raises
        ------
        SchedulerLostError : the cluster is gone.
        """


class ProcessPool:
    """Processes of this computer.

    Parameters
    ----------
    workers : None: one for each processor.
    """

    def __init__(self, workers: int | None = None) -> None:
        self._workers = workers or os.cpu_count() or 1

    @property
    def workers(self) -> int:
        """How many processes there are."""
        return self._workers

    def run(
        self, function: Callable[[Item], Result], items: Iterable[Item], *, ahead: int = 0
    ) -> Iterator[Ended[Item, Result]]:
        """See `Engine`."""
        waiting = iter(items)
        max_running = self._workers * (1 + ahead)
        running: dict[Future[Result], Item] = {}
        with ProcessPoolExecutor(max_workers=self._workers) as pool:
            try:
                while True:
                    while len(running) < max_running and (item := next(waiting, _NONE)) is not _NONE:
                        running[pool.submit(function, item)] = item  # type: ignore[assignment,arg-type]
                    if not running:
                        return
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        yield _ended(running.pop(future), future)
            finally:
                pool.shutdown(wait=True, cancel_futures=True)


_NONE = object()


def _ended(item: Item, future: Future[Result]) -> Ended[Item, Result]:
    error = future.exception()
    if isinstance(error, BrokenProcessPool):
        raise WorkerLostError(
            "a process of the pool was killed, and the pool ended with it",
            "run the same command again: it goes on where it stopped; with `pip install 'truing[fleet]'` a "
            "killed process costs its own task only",
        )
    return Ended(item, error=error) if error is not None else Ended(item, future.result())


@contextmanager
def open_engine(workers: int | None = None, scheduler: str | None = None) -> Iterator[Engine]:
    """A cluster where `distributed` is installed, embedded unless an address is given; else a pool.

    Parameters
    ----------
    workers : processes; None: one for each processor. A cluster that runs already has its own.
    scheduler : address of a cluster that runs already, `tcp://HOST:PORT`.
    """
    if scheduler is None and find_spec("distributed") is None:
        yield ProcessPool(workers)
        return
    from truing.fleet.dask_engine import open_cluster

    with open_cluster(workers, scheduler) as engine:
        yield engine
