"""The thread that owns the board connection: state snapshots out, commands in, independent of the pages."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from typing import TypeVar

from truing.board.device import Device
from truing.board.state import Parameter
from truing.errors import LinkError, TruingError
from truing.web.limits import Limits
from truing.web.pose import Pose
from truing.web.worker.connection import BoardConnection
from truing.web.worker.sample import LiveHistory
from truing.web.worker.shared import BoardCall, DriveCommand, SharedState
from truing.web.worker.source import LiveSource, open_source
from truing.web.worker.state import RunRequest, Snapshot, Task

T = TypeVar("T")

_LOG = logging.getLogger("truing.web.board")

# Maximum age of a key command: several heartbeat intervals of a page, and within the board's own command
# timeout, which is the second line of defence.
COMMAND_TIMEOUT_S = 0.3
_RETRY_S = (0.3, 0.5, 1.0, 2.0)


class BoardWorker:
    """Connects, reconnects and serves the board in a thread; its methods are for the pages.

    Parameters
    ----------
    connect : opens the board; called again after each loss of the link.
    start : the robot's initial pose in the world.
    each_step : called many times a second while a board is connected.
    """

    def __init__(
        self,
        connect: Callable[[], Device],
        start: Pose | None = None,
        source: Callable[[Device], LiveSource] = open_source,
        each_step: Callable[[], None] = lambda: None,
    ) -> None:
        self._connect = connect
        self._open_source = source
        self._each_step = each_step
        self._shared = SharedState(start)
        self._wake = threading.Event()
        self._closing = False
        self._disconnected = False
        self._thread = threading.Thread(target=self._run, name="board", daemon=True)

    # ---- for the pages

    @property
    def snapshot(self) -> Snapshot:
        """The newest state; never blocks."""
        return self._shared.snapshot

    @property
    def history(self) -> LiveHistory:
        """The newest samples."""
        return self._shared.history

    @property
    def limits(self) -> Limits:
        """The robot's limits; defaults until a board has been connected."""
        return self._shared.limits

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The board's parameters; empty until a board has been connected."""
        return self._shared.parameters

    def start(self) -> None:
        """Start to connect."""
        self._thread.start()

    def close(self) -> None:
        """Stop the wheels and close the connection."""
        self._closing = True
        self.stop()
        if self._thread.is_alive():
            self._thread.join(8.0)

    def drive(self, v_mps: float, omega_radps: float, timeout_s: float = COMMAND_TIMEOUT_S) -> None:
        """Command a body speed and yaw rate; it must be repeated within `timeout_s`, or the wheels stop."""
        half = 0.5 * omega_radps * self.limits.wheelbase_m
        self._shared.request_drive(DriveCommand(v_mps - half, v_mps + half, time.monotonic() + timeout_s))
        self._wake.set()

    def stop(self, reason: str = "stopped by the user") -> int:
        """Brake now; pending requests are discarded. Returns the number of the stop."""
        number = self._shared.request_stop(reason)
        self._wake.set()
        return number

    @property
    def stop_acknowledged(self) -> int:
        """Number of the newest stop that the board has acknowledged."""
        return self._shared.stop_acknowledged

    def run_plan(self, request: RunRequest) -> None:
        """Upload, drive, fetch and save.

        Raises
        ------
        TruingError : the board is busy or not connected.
        """
        self._require_idle()
        self._shared.request_run(request)
        self._shared.publish(task=Task(request.label, "waiting"))
        self._wake.set()

    def call(self, work: Callable[[Device], T], name: str = "") -> Future[T]:
        """Do something with the board in its thread, while no plan runs; a stop ends it.

        Parameters
        ----------
        name : as the task that pages show, for what takes time.

        Raises
        ------
        TruingError : the board is busy or not connected.
        """
        self._require_idle()
        call = BoardCall(name, work)
        self._shared.request_call(call)
        if name:
            self._shared.publish(task=Task(name, "waiting"))
        self._wake.set()
        return call.result

    def read_parameters(self) -> Future[dict[str, Parameter]]:
        """Read the parameters, for pages and for driving."""
        return self.call(self._read_parameters)

    def clear_faults(self) -> None:
        """Ask the board to clear latched faults whose cause no longer exists."""
        self._shared.request_clear_faults()

    def disconnect(self) -> None:
        """Close the connection until `reconnect`."""
        self._disconnected = True
        self._wake.set()

    def reconnect(self) -> None:
        """Connect again."""
        self._disconnected = False
        self._wake.set()

    def place(self, pose: Pose) -> None:
        """Set the robot's pose in the world."""
        self._shared.place(pose)

    def _require_idle(self) -> None:
        snapshot = self.snapshot
        if snapshot.link != "connected":
            raise LinkError("no board is connected", "see the link state at the top of the page")
        if snapshot.task is not None and not snapshot.task.is_over:
            raise TruingError(
                f"the board is busy with {snapshot.task.name}", "wait until it ends, or press space"
            )

    # ---- the thread

    def _read_parameters(self, device: Device) -> dict[str, Parameter]:
        shared = self._shared
        shared.parameters = device.parameters()
        shared.limits = Limits.of_board(
            {name: parameter.value for name, parameter in shared.parameters.items()}
        )
        return shared.parameters

    def _run(self) -> None:
        failures = 0
        while not self._closing:
            if self._disconnected:
                self._shared.publish(
                    link="lost", message="disconnected by the user", next_step="press Connect", status=None
                )
                self._wake.wait(0.5)
                self._wake.clear()
                continue
            try:
                device = self._connect()
            except TruingError as error:
                self._report_loss(error)
                self._sleep(_RETRY_S[min(failures, len(_RETRY_S) - 1)])
                failures += 1
                continue
            failures = 0
            try:
                with device:
                    self._serve(device)
            except TruingError as error:
                self._report_loss(error)
            except Exception as error:
                _LOG.exception("the board's thread")
                self._report_loss(LinkError(f"{type(error).__name__}: {error}"))

    def _report_loss(self, error: TruingError) -> None:
        task = self.snapshot.task
        if task is not None and not task.is_over:
            task = replace(task, stage="failed", problem=error.message)
        self._shared.drop_requests()
        self._shared.publish(
            link="lost", message=error.message, next_step=error.next_step, status=None, task=task, rate_hz=0.0
        )

    def _serve(self, device: Device) -> None:
        shared = self._shared
        shared.publish(link="connecting", message=f"{device.info.board_name} answers", next_step="")
        self._read_parameters(device)
        source = self._open_source(device)
        shared.publish(
            link="connected",
            message=f"{device.info.board_name} on {device.info.port}",
            info=device.info,
            rate_hz=source.rate_hz,
            reconnects=shared.snapshot.reconnects + 1,
        )
        connection = BoardConnection(shared, device, source)
        try:
            with device.client.interrupted_by(lambda: shared.stop_pending):
                while not self._closing and not self._disconnected:
                    self._each_step()
                    connection.step()
                    self._wake.clear()
        finally:
            connection.close()

    def _sleep(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while not self._closing and time.monotonic() < until:
            time.sleep(0.05)
