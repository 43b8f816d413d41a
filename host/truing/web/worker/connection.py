"""One open connection to the board: driving, plans, download of logs, status."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, replace

from truing.board.device import Device
from truing.board.drive import board_fault
from truing.board.run_saver import baseline_text, fetch_log, run_of, save_run
from truing.board.state import BoardStatus
from truing.errors import Interrupted, LinkError, PortError, TruingError, VirtualBoardError
from truing.plan import Kind
from truing.web.worker.shared import BoardCall, DriveCommand, SharedState
from truing.web.worker.source import LiveSource
from truing.web.worker.state import RunRequest, Task
from truing_protocol import LogEnd, SequenceState, State

_LOG = logging.getLogger("truing.web.board")

_SEND_EVERY_S = 0.05
# Without a key the wheels are held at zero this long before the drive ends: each new drive opens a new log.
_IDLE_STOP_S = 3.0
_POLL_S = 0.02


class BoardConnection:
    """One connection to the board, from open to close."""

    def __init__(self, shared: SharedState, device: Device, source: LiveSource) -> None:
        self._shared = shared
        self._device = device
        self._source = source
        self._sent_s = 0.0
        self._driven_s = 0.0
        self._live = False
        self._running: _Running | None = None
        self._status: BoardStatus | None = None

    def step(self) -> None:
        """Execute the pending requests, then poll the board."""
        requests = self._shared.take_requests()
        try:
            if requests.stop:
                self._brake()
                self._shared.acknowledge_stop(requests.stop)
            elif requests.run is not None:
                self._start_sequence(requests.run)
            elif self._running is None:
                self._drive(requests.drive)
            if requests.clear_faults:
                self._device.clear_faults()
            while requests.calls:
                self._call(requests.calls.pop(0))
            self._poll()
        except Interrupted:
            return  # a stop arrived during a transfer: the next step executes it first
        except (LinkError, PortError, VirtualBoardError):
            raise
        except TruingError as error:
            # The board refused (a fault, a limit): the link is intact, and the page shows the reason.
            self._fail(error)
        finally:
            # What a stop or an error kept from its turn: whoever asked still waits for an answer.
            self._shared.return_calls(requests.calls)

    def close(self) -> None:
        """Stop the robot, if the link still works."""
        try:
            if self._live or self._running is not None:
                self._device.stop()
            self._source.close()
        except TruingError as error:
            _LOG.info("closing the connection: %s", error)

    def _brake(self) -> None:
        self._device.stop()
        self._source.set_command(None)
        self._live = False
        if self._running is not None:
            self._shared.publish(
                task=Task(self._running.request.label, "stopped", 1.0, self._shared.stop_reason)
            )
            self._running = None
        elif (task := self._shared.snapshot.task) is not None and not task.is_over:
            self._shared.publish(task=replace(task, stage="stopped", problem=self._shared.stop_reason))

    def _drive(self, command: DriveCommand | None) -> None:
        now = time.monotonic()
        if command is None:
            return
        latched = self._status is not None and bool(self._status.latched)
        if latched:
            self._live = False
            return
        if now > command.until_s:
            # No renewal while a key was held: the page is lost, and the wheels stop.
            self._shared.drop_drive(command)
            if self._live:
                self._brake()
            return
        moving = bool(command.left_mps or command.right_mps)
        if moving:
            self._driven_s = now
        elif not self._live:
            return
        elif now - self._driven_s > _IDLE_STOP_S:
            self._brake()
            return
        if now - self._sent_s >= _SEND_EVERY_S:
            self._device.set_velocity(command.left_mps, command.right_mps)
            self._source.set_command((command.left_mps, command.right_mps))
            self._sent_s, self._live = now, True

    def _start_sequence(self, request: RunRequest) -> None:
        task = Task(request.label, "uploading")
        self._shared.publish(task=task)
        if self._live:
            self._brake()
        sequence = self._device.upload(request.plan)
        log_id = self._device.start(sequence, unattended=request.plan.unattended)
        self._running = _Running(request, log_id, sequence.duration_s)
        self._shared.publish(task=replace(task, stage="driving"))

    def _call(self, call: BoardCall) -> None:
        """Do what a page has asked for; its own errors are for that page, a lost link is for all."""
        if call.name:
            self._shared.publish(task=Task(call.name, "driving"))
        # Whoever waits for the result may ask for the next at once: the task is over before it is given.
        try:
            result = call.work(self._device)
        except BaseException as error:
            self._end_call(call, "stopped" if isinstance(error, Interrupted) else "failed", str(error))
            call.result.set_exception(error)
            if isinstance(error, (Interrupted, LinkError, PortError)):
                raise
        else:
            self._end_call(call, "done", "")
            call.result.set_result(result)

    def _end_call(self, call: BoardCall, stage: str, problem: str) -> None:
        if call.name:
            problem = self._shared.stop_reason if stage == "stopped" else problem
            self._shared.publish(task=Task(call.name, stage, 1.0, problem))

    def _poll(self) -> None:
        samples, status = self._source.poll(_POLL_S)
        shared = self._shared
        if samples:
            shared.add_samples(samples)
        if status is None:
            return
        self._status = status
        shared.publish(status=status)
        if self._live and status.state is not State.LIVE:
            self._live = False
            self._source.set_command(None)
        if self._running is not None:
            self._monitor(self._running, status)

    def _monitor(self, running: _Running, status: BoardStatus) -> None:
        shared, request = self._shared, running.request
        if running.started_s is None:
            running.started_s = status.uptime_s
        elapsed = status.uptime_s - running.started_s
        if status.latched:
            self._running = None
            raise board_fault(status)
        if status.sequence_state is SequenceState.RUNNING:
            self._source.set_command(running.command(elapsed, shared.limits.wheelbase_m))
            progress = min(1.0, elapsed / max(running.duration_s, 0.001))
            shared.publish(task=Task(request.label, "driving", progress))
            return
        self._source.set_command(None)
        self._running = None
        if status.sequence_state is not SequenceState.DONE:
            raise TruingError(
                "the sequence ended early: stopped by another program or at the board",
                "make sure that no other program drives this robot",
            )
        self._fetch(running)

    def _fetch(self, running: _Running) -> None:
        shared, request, device = self._shared, running.request, self._device

        def progress(fraction: float) -> None:
            shared.publish(task=Task(request.label, "fetching", fraction))

        progress(0.0)
        fetched = fetch_log(device, running.log_id, progress)
        run = run_of(
            device, fetched, request.label, parameters=shared.parameters, plan=request.plan, seed=request.seed
        )
        baseline = baseline_text(device.info.board_name, shared.parameters, fetched.log.rate_hz)
        path = save_run(run, request.folder, request.label, baseline)
        ended = (
            "" if fetched.log.end is LogEnd.FINISHED else f"the log ended with {fetched.log.end.name.lower()}"
        )
        shared.publish(task=Task(request.label, "done", 1.0, ended, str(path)))

    def _fail(self, error: TruingError) -> None:
        task = self._shared.snapshot.task
        name = task.name if task is not None and not task.is_over else "driving"
        self._running, self._live = None, False
        self._source.set_command(None)
        text = f"{error.message} ({error.next_step})" if error.next_step else error.message
        self._shared.publish(task=Task(name, "failed", problem=text))
        self._shared.drop_drive()


@dataclass
class _Running:
    """A plan that the board is executing."""

    request: RunRequest
    log_id: int
    duration_s: float
    started_s: float | None = None

    def command(self, elapsed_s: float, wheelbase_m: float) -> tuple[float, float] | None:
        """Wheel speeds (m/s) that the plan commands now; None for efforts."""
        for segment in self.request.plan.segments:
            elapsed_s -= segment.duration_s
            if elapsed_s < 0.0:
                if segment.kind is Kind.EFFORT:
                    return None
                if segment.kind is Kind.VELOCITY:
                    return segment.a, segment.b
                half = 0.5 * segment.b * wheelbase_m
                return segment.a - half, segment.a + half
        return None
