"""Tasks on a Dask cluster: embedded in this process's children, or one that runs already at an address."""

from __future__ import annotations

import asyncio
import logging
import os
import queue
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from truing import __version__
from truing.errors import SchedulerLostError, WorkerLostError
from truing.extras import require
from truing.fleet.engine import Ended, Item, Result

if TYPE_CHECKING:
    from distributed import Client

# How long a cluster may take to answer, to have its first worker, and to say farewell.
CONNECT_S, WORKER_S, CLOSE_S = 10.0, 60.0, 2.0
# How often a run that waits looks whether its scheduler is still there.
LOOK_EVERY_S = 0.5
# Workers that may die with a task before it is given up: a crash may be another task's, or the machine's.
DEATHS_ALLOWED = 2


class DaskEngine:
    """A client's cluster as an engine.

    Parameters
    ----------
    client : connected; whoever made it closes it.
    address : how the cluster is called in messages.
    """

    def __init__(self, client: Client, address: str) -> None:
        self._client, self._address = client, address
        self._counted_at, self._threads = -LOOK_EVERY_S, 1

    @property
    def workers(self) -> int:
        """Threads of all workers, at the moment: workers come and go."""
        now = time.monotonic()
        if now - self._counted_at >= LOOK_EVERY_S:
            with self._reaching():
                self._threads = max(1, sum(int(threads) for threads in self._client.nthreads().values()))
            self._counted_at = now
        return self._threads

    def run(
        self, function: Callable[[Item], Result], items: Iterable[Item], *, ahead: int = 0
    ) -> Iterator[Ended[Item, Result]]:
        """See `Engine`. A bounded number of tasks is at the scheduler, whose memory so stays constant."""
        waiting = iter(items)
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        running: dict[Any, tuple[Any, Item]] = {}
        try:
            more = True
            while more or running:
                max_running = self.workers * (1 + ahead)
                while more and len(running) < max_running:
                    item = next(waiting, _NONE)
                    if item is _NONE:
                        more = False
                        break
                    # Not pure: the same item again is meant to run again.
                    with self._reaching():
                        future = self._client.submit(function, item, pure=False)
                    running[future.key] = (future, item)
                    future.add_done_callback(done.put)
                if not running:
                    return
                future, item = self._next(done, running)
                yield self._ended(future, item)
        finally:
            for future, _ in running.values():
                with suppress(Exception):
                    future.cancel(force=True)

    def _next(self, done: queue.SimpleQueue[Any], running: dict[Any, tuple[Any, Item]]) -> tuple[Any, Item]:
        """The next task that has ended."""
        while True:
            try:
                future = done.get(timeout=LOOK_EVERY_S)
            except queue.Empty:
                if self._client.status != "running":
                    raise self._lost() from None
                continue
            if future.key in running:
                return running.pop(future.key)

    def _ended(self, future: Any, item: Item) -> Ended[Item, Result]:
        from distributed import KilledWorker

        error = self._waited(future.exception)
        if isinstance(error, (CancelledError, asyncio.CancelledError)):
            raise self._lost()
        if isinstance(error, KilledWorker):
            died = "its workers died, one after the other, while they ran it"
            return Ended(item, error=WorkerLostError(died, "See the workers' logs; is there enough memory?"))
        return Ended(item, error=error) if error is not None else Ended(item, self._waited(future.result))

    def _waited(self, fetch: Callable[..., Any]) -> Any:
        """What a future gives; where the worker that held it has died, its task runs again first."""
        with self._reaching():
            while True:
                try:
                    return fetch(timeout=LOOK_EVERY_S)
                except TimeoutError:
                    if self._client.status != "running":
                        raise

    @contextmanager
    def _reaching(self) -> Iterator[None]:
        """What ends the talk with the scheduler says that it is gone; a task's error is never raised here."""
        try:
            yield
        except (OSError, TimeoutError, CancelledError, asyncio.CancelledError):
            raise self._lost() from None

    def _lost(self) -> SchedulerLostError:
        return SchedulerLostError(
            f"the scheduler at {self._address} is gone",
            "start it again, then run the same command: it goes on where it stopped",
        )


_NONE: Any = object()


@contextmanager
def open_cluster(workers: int | None = None, scheduler: str | None = None) -> Iterator[DaskEngine]:
    """The cluster at an address, or an embedded one of `workers` processes (None: one for each processor).

    Raises
    ------
    SchedulerLostError : nobody answers at the address.
    WorkerLostError : the cluster has no workers, or others than this version of truing.
    """
    require("fleet")
    import dask
    from distributed import Client, LocalCluster

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    # Matrices are small here: threads of a BLAS would only take processors from each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with dask.config.set({"distributed.scheduler.allowed-failures": DEATHS_ALLOWED}):
        if scheduler is None:
            count = workers or os.cpu_count() or 1
            with (
                LocalCluster(
                    n_workers=count,
                    threads_per_worker=1,
                    dashboard_address=":0",
                    silence_logs=logging.CRITICAL,
                ) as cluster,
                Client(cluster) as client,
            ):
                yield DaskEngine(client, str(cluster.scheduler_address))
            return
        try:
            client = Client(scheduler, timeout=CONNECT_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise SchedulerLostError(
                f"no scheduler answers at {scheduler} ({' '.join(str(error).split())})",
                "`dask scheduler` starts one and prints its address, `dask worker ADDRESS` a worker",
            ) from None
        try:
            _check_workers(client, scheduler)
            yield DaskEngine(client, scheduler)
        finally:
            # A scheduler that was killed does not answer to a farewell.
            with suppress(Exception):
                client.close(timeout=CLOSE_S)


def _check_workers(client: Client, address: str) -> None:
    """Refuse a cluster without workers, or whose workers have another truing than this one."""
    try:
        client.wait_for_workers(1, timeout=WORKER_S)
    except TimeoutError:
        raise WorkerLostError(
            f"the scheduler at {address} has no workers", f"`dask worker {address} --nthreads 1` starts one"
        ) from None
    for worker, version in client.run(version_here).items():
        if version != __version__:
            raise WorkerLostError(
                f"the worker at {worker} has truing {version}, and this is {__version__}",
                "Install the same version with the extra [fleet] on every worker",
            )


def version_here() -> str:
    """The version of truing in the process that runs this."""
    return __version__
