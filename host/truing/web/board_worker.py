"""The one thread that talks to the board: newest snapshots out, commands in, whatever the browsers do."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from truing.board_state import BoardStatus, Parameter
from truing.device import Device
from truing.drive import board_fault
from truing.errors import Interrupted, LinkError, PortError, TruingError, VirtualBoardError
from truing.link.handshake import BoardInfo
from truing.plan import Kind, Plan
from truing.run_saver import baseline_text, fetch_log, run_of, save_run
from truing.web.limits import Limits
from truing.web.live_sample import LiveHistory, PoseChain
from truing.web.live_source import LiveSource, open_source
from truing.web.pose import Pose
from truing_protocol import LogEnd, SequenceState, State

_LOG = logging.getLogger("truing.web.board")

# How long a key press may be old: twice what a page takes to say it is still held, and within the board's own
# command time-out, which stands behind it.
COMMAND_LIFE_S = 0.3
_SEND_EVERY_S = 0.05
# Without a key the wheels are held at zero for so long before the drive ends: each new drive opens a new log.
_IDLE_STOP_S = 3.0
_POLL_S = 0.02
_RETRY_S = (0.3, 0.5, 1.0, 2.0)


@dataclass(frozen=True, slots=True)
class Task:
    """What the board is busy with beyond being driven by hand: a plan, or its log on the way here."""

    name: str
    stage: str
    share: float = 0.0
    problem: str = ""
    saved: str = ""

    @property
    def is_over(self) -> bool:
        """Whether it ended, well or badly."""
        return self.stage in ("done", "failed", "stopped")


@dataclass(frozen=True, slots=True)
class Snapshot:
    """All that a page needs to know at a moment; immutable.

    Attributes
    ----------
    link : `connecting`, `connected` or `lost`.
    told : what happened to the link, in words.
    """

    link: str = "connecting"
    told: str = "connecting"
    next_step: str = ""
    info: BoardInfo | None = None
    status: BoardStatus | None = None
    task: Task | None = None
    rate_hz: float = 0.0
    reconnects: int = 0


@dataclass(slots=True)
class _Drive:
    """A wish for wheel speeds (m/s), good until `until_s`."""

    left_mps: float
    right_mps: float
    until_s: float


@dataclass(frozen=True, slots=True)
class RunOrder:
    """A plan to drive, and where its run goes."""

    plan: Plan
    folder: Path
    label: str
    seed: int | None = None


@dataclass
class _Orders:
    """What the pages ask for; every field is taken by the worker under the lock."""

    drive: _Drive | None = None
    stop: bool = False
    run: RunOrder | None = None
    clear_faults: bool = False
    disconnect: bool = False
    calls: list[Callable[[Device], None]] = field(default_factory=list)


class BoardWorker:
    """Owns the device.

    Parameters
    ----------
    connect : opens the board; called again after every loss.
    start : the robot's pose in the world at the beginning.
    each_step : called many times a second while a board is connected.
    """

    def __init__(
        self,
        connect: Callable[[], Device],
        start: Pose | None = None,
        source: Callable[[Device], LiveSource] = open_source,
        each_step: Callable[[], None] = lambda: None,
    ) -> None:
        self.history = LiveHistory()
        self.limits = Limits()
        self.parameters: dict[str, Parameter] = {}
        self._connect = connect
        self._open_source = source
        self._each_step = each_step
        self._chain = PoseChain(start)
        self._orders = _Orders()
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._why = ""
        self._closing = False
        self._unplugged = False
        self._snapshot = Snapshot()
        self._thread = threading.Thread(target=self._run, name="board", daemon=True)

    # ---- for the pages

    @property
    def snapshot(self) -> Snapshot:
        """The newest state; never waits."""
        return self._snapshot

    def start(self) -> None:
        """Begin to connect."""
        self._thread.start()

    def close(self) -> None:
        """Stop the wheels and let the board go."""
        self._closing = True
        self.stop()
        if self._thread.is_alive():
            self._thread.join(8.0)

    def drive(self, v_mps: float, omega_radps: float, life_s: float = COMMAND_LIFE_S) -> None:
        """Ask for a body speed and yaw rate; asked again within `life_s`, or the wheels stop."""
        half = 0.5 * omega_radps * self.limits.wheelbase_m
        wish = _Drive(v_mps - half, v_mps + half, time.monotonic() + life_s)
        with self._lock:
            if not self._orders.stop:
                self._orders.drive = wish
        self._wake.set()

    def stop(self, why: str = "stopped by you") -> None:
        """Brake now; whatever was asked before is forgotten."""
        with self._lock:
            self._why = why
            self._orders.stop = True
            self._orders.drive = None
            self._orders.run = None
        self._wake.set()

    def run_plan(self, order: RunOrder) -> None:
        """Upload, drive, fetch and save.

        Raises
        ------
        TruingError : the board is busy or not there.
        """
        snapshot = self._snapshot
        if snapshot.link != "connected":
            raise LinkError("no board is connected", "see the link's state at the top of the page")
        if snapshot.task is not None and not snapshot.task.is_over:
            raise TruingError(
                f"the board is busy with {snapshot.task.name}", "wait for its end, or press space"
            )
        with self._lock:
            self._orders.run = order
            self._orders.drive = None
        self._publish(task=Task(order.label, "waiting"))
        self._wake.set()

    def clear_faults(self) -> None:
        """Ask the board to unlatch the faults whose cause is gone."""
        with self._lock:
            self._orders.clear_faults = True

    def unplug(self) -> None:
        """Let the board go until `plug`."""
        self._unplugged = True
        with self._lock:
            self._orders.disconnect = True
        self._wake.set()

    def plug(self) -> None:
        """Connect again."""
        self._unplugged = False
        self._wake.set()

    def place(self, pose: Pose) -> None:
        """Say where the robot stands in the world."""
        with self._lock:
            self._chain.reset(pose)

    # ---- the thread

    def _run(self) -> None:
        failures = 0
        while not self._closing:
            if self._unplugged:
                self._publish(link="lost", told="disconnected by you", next_step="press Connect", status=None)
                self._wake.wait(0.5)
                self._wake.clear()
                continue
            try:
                device = self._connect()
            except TruingError as error:
                self._tell_loss(error)
                self._sleep(_RETRY_S[min(failures, len(_RETRY_S) - 1)])
                failures += 1
                continue
            failures = 0
            try:
                with device:
                    self._serve(device)
            except TruingError as error:
                self._tell_loss(error)
            except Exception as error:
                _LOG.exception("the board's thread")
                self._tell_loss(LinkError(f"{type(error).__name__}: {error}"))

    def _tell_loss(self, error: TruingError) -> None:
        task = self._snapshot.task
        if task is not None and not task.is_over:
            task = replace(task, stage="failed", problem=error.message)
        with self._lock:
            self._orders.drive, self._orders.run, self._orders.stop = None, None, False
        self._publish(
            link="lost", told=error.message, next_step=error.next_step, status=None, task=task, rate_hz=0.0
        )

    def _serve(self, device: Device) -> None:
        self._publish(link="connecting", told=f"{device.info.board_name} answers", next_step="")
        self.parameters = device.parameters()
        values = {name: parameter.value for name, parameter in self.parameters.items()}
        self.limits = Limits.of_board(values)
        source = self._open_source(device)
        device.client.interrupted = self._is_interrupted
        reconnects = self._snapshot.reconnects + 1
        self._publish(
            link="connected",
            told=f"{device.info.board_name} on {device.info.port}",
            info=device.info,
            rate_hz=source.rate_hz,
            reconnects=reconnects,
        )
        session = _Session(self, device, source)
        try:
            while not self._closing and not self._unplugged:
                self._each_step()
                session.step()
                self._wake.wait(0.0)
                self._wake.clear()
        finally:
            device.client.interrupted = lambda: False
            session.leave()

    def _is_interrupted(self) -> bool:
        return self._orders.stop

    def _take(self) -> _Orders:
        with self._lock:
            taken = self._orders
            self._orders = _Orders(drive=taken.drive)
        return taken

    def _publish(self, **changes: object) -> None:
        with self._lock:
            self._snapshot = replace(self._snapshot, **changes)  # type: ignore[arg-type]

    def _sleep(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while not self._closing and time.monotonic() < until:
            time.sleep(0.05)


class _Session:
    """One connection's time with the board."""

    def __init__(self, worker: BoardWorker, device: Device, source: LiveSource) -> None:
        self._worker = worker
        self._device = device
        self._source = source
        self._sent_s = 0.0
        self._driven_s = 0.0
        self._live = False
        self._running: _Running | None = None
        self._status: BoardStatus | None = None

    def step(self) -> None:
        """Do what was ordered, then look at the board."""
        orders = self._worker._take()
        try:
            if orders.stop:
                self._brake()
            elif orders.run is not None:
                self._begin(orders.run)
            elif self._running is None:
                self._drive(orders.drive)
            if orders.clear_faults:
                self._device.clear_faults()
            self._look()
        except Interrupted:
            return  # a stop came while something was under way: it is the next step's first deed
        except (LinkError, PortError, VirtualBoardError):
            raise
        except TruingError as error:
            # The board said no (a fault, a limit): the link is well, the page says why.
            self._fail(error)

    def leave(self) -> None:
        """Stop what drives, as far as the link still carries it."""
        try:
            if self._live or self._running is not None:
                self._device.stop()
            self._source.close()
        except TruingError as error:
            _LOG.info("leaving the board: %s", error)

    def _brake(self) -> None:
        self._device.stop()
        self._source.commanded(None)
        self._live = False
        if self._running is not None:
            self._worker._publish(task=Task(self._running.order.label, "stopped", 1.0, self._worker._why))
            self._running = None
        elif (task := self._worker.snapshot.task) is not None and not task.is_over:
            self._worker._publish(task=replace(task, stage="stopped", problem=self._worker._why))

    def _drive(self, wish: _Drive | None) -> None:
        now = time.monotonic()
        if wish is None:
            return
        latched = self._status is not None and bool(self._status.latched)
        if latched:
            self._live = False
            return
        if now > wish.until_s:
            # The page fell silent with a key held: that is a lost page, and the wheels stop.
            with self._worker._lock:
                if self._worker._orders.drive is wish:
                    self._worker._orders.drive = None
            if self._live:
                self._brake()
            return
        moving = bool(wish.left_mps or wish.right_mps)
        if moving:
            self._driven_s = now
        elif not self._live:
            return
        elif now - self._driven_s > _IDLE_STOP_S:
            self._brake()
            return
        if now - self._sent_s >= _SEND_EVERY_S:
            self._device.set_velocity(wish.left_mps, wish.right_mps)
            self._source.commanded((wish.left_mps, wish.right_mps))
            self._sent_s, self._live = now, True

    def _begin(self, order: RunOrder) -> None:
        task = Task(order.label, "uploading")
        self._worker._publish(task=task)
        if self._live:
            self._brake()
        sequence = self._device.upload(order.plan)
        log_id = self._device.start(sequence)
        self._running = _Running(order, log_id, sequence.duration_s)
        self._worker._publish(task=replace(task, stage="driving"))

    def _look(self) -> None:
        samples, status = self._source.poll(_POLL_S)
        worker = self._worker
        if samples:
            with worker._lock:
                placed = [(sample, worker._chain.place(sample.odometry)) for sample in samples]
            worker.history.extend(placed)
        if status is None:
            return
        self._status = status
        worker._publish(status=status)
        if self._live and status.state is not State.LIVE:
            self._live = False
            self._source.commanded(None)
        if self._running is not None:
            self._watch(self._running, status)

    def _watch(self, running: _Running, status: BoardStatus) -> None:
        worker, order = self._worker, running.order
        if running.began_s is None:
            running.began_s = status.uptime_s
        elapsed = status.uptime_s - running.began_s
        if status.latched:
            self._running = None
            raise board_fault(status)
        if status.sequence_state is SequenceState.RUNNING:
            self._source.commanded(running.command(elapsed, worker.limits.wheelbase_m))
            share = min(1.0, elapsed / max(running.duration_s, 0.001))
            worker._publish(task=Task(order.label, "driving", share))
            return
        self._source.commanded(None)
        self._running = None
        if status.sequence_state is not SequenceState.DONE:
            raise TruingError(
                "the sequence was ended before its time, by another program or at the board",
                "see that nobody else drives this robot",
            )
        self._fetch(running)

    def _fetch(self, running: _Running) -> None:
        worker, order, device = self._worker, running.order, self._device

        def progress(share: float) -> None:
            worker._publish(task=Task(order.label, "fetching", share))

        progress(0.0)
        fetched = fetch_log(device, running.log_id, progress)
        run = run_of(
            device, fetched, order.label, parameters=worker.parameters, plan=order.plan, seed=order.seed
        )
        baseline = baseline_text(device.info.board_name, worker.parameters, fetched.log.rate_hz)
        path = save_run(run, order.folder, order.label, baseline)
        ended = (
            "" if fetched.log.end is LogEnd.FINISHED else f"the log ends with {fetched.log.end.name.lower()}"
        )
        worker._publish(task=Task(order.label, "done", 1.0, ended, str(path)))

    def _fail(self, error: TruingError) -> None:
        task = self._worker.snapshot.task
        name = task.name if task is not None and not task.is_over else "driving"
        self._running, self._live = None, False
        self._source.commanded(None)
        text = f"{error.message} ({error.next_step})" if error.next_step else error.message
        self._worker._publish(task=Task(name, "failed", problem=text))
        with self._worker._lock:
            self._worker._orders.drive = None


@dataclass
class _Running:
    """A plan that the board drives."""

    order: RunOrder
    log_id: int
    duration_s: float
    began_s: float | None = None

    def command(self, elapsed_s: float, wheelbase_m: float) -> tuple[float, float] | None:
        """Wheel speeds (m/s) that the plan asks for now; None for efforts."""
        for segment in self.order.plan.segments:
            elapsed_s -= segment.duration_s
            if elapsed_s < 0.0:
                if segment.kind is Kind.EFFORT:
                    return None
                if segment.kind is Kind.VELOCITY:
                    return segment.a, segment.b
                half = 0.5 * segment.b * wheelbase_m
                return segment.a - half, segment.a + half
        return None
