"""State shared by the pages (any thread) and the board's thread: requests one way, snapshots the other."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from typing import Any

from truing.board.device import Device
from truing.board.state import Parameter
from truing.errors import LinkError
from truing.web.limits import Limits
from truing.web.pose import Pose
from truing.web.worker.sample import LiveHistory, LiveSample, PoseChain
from truing.web.worker.state import RunRequest, Snapshot


@dataclass(slots=True)
class DriveCommand:
    """Commanded wheel speeds (m/s), valid until `until_s`."""

    left_mps: float
    right_mps: float
    until_s: float


@dataclass(frozen=True, slots=True)
class BoardCall:
    """Something to do with the board that is neither driving nor a plan; the future takes its result.

    Attributes
    ----------
    name : as the task that pages show; empty for what takes no time.
    """

    name: str
    work: Callable[[Device], Any]
    result: Future[Any] = field(default_factory=Future)


@dataclass(slots=True)
class Requests:
    """Pending requests of the pages; the board's thread takes them all at once.

    Attributes
    ----------
    stop : number of the newest stop that has not been acknowledged; 0 for none.
    """

    drive: DriveCommand | None = None
    stop: int = 0
    run: RunRequest | None = None
    clear_faults: bool = False
    calls: list[BoardCall] = field(default_factory=list)


class SharedState:
    """Everything that both sides use; every method may be called from any thread.

    Parameters
    ----------
    start : the robot's initial pose in the world.

    Attributes
    ----------
    snapshot : the newest state; read without waiting.
    stop_reason : reason of the last stop request.
    stop_acknowledged : number of the newest stop that the board has acknowledged.
    """

    def __init__(self, start: Pose | None = None) -> None:
        self.history = LiveHistory()
        self.limits = Limits()
        self.parameters: dict[str, Parameter] = {}
        self.snapshot = Snapshot()
        self.stop_reason = ""
        self.stop_acknowledged = 0
        self._stop_number = 0
        self._chain = PoseChain(start)
        self._requests = Requests()
        self._wait_for_release = False
        self._lock = threading.Lock()

    def publish(self, **changes: object) -> None:
        """Replace the snapshot by one with these changes."""
        with self._lock:
            self.snapshot = replace(self.snapshot, **changes)  # type: ignore[arg-type]

    # ---- requests

    def request_drive(self, command: DriveCommand) -> None:
        """Replace the drive command, unless a stop is pending.

        After a lost link a key that is still held moves nothing until it has been released once.
        """
        with self._lock:
            moving = bool(command.left_mps or command.right_mps)
            self._wait_for_release = self._wait_for_release and moving
            if not self._requests.stop and not self._wait_for_release:
                self._requests.drive = command

    def request_stop(self, reason: str) -> int:
        """Discard everything else that is pending; returns the number of the stop.

        It stays pending until the board acknowledges it, also while the link is lost.
        """
        with self._lock:
            self.stop_reason = reason
            self._stop_number += 1
            self._requests.stop = self._stop_number
            self._requests.drive = None
            self._requests.run = None
            return self._stop_number

    def acknowledge_stop(self, number: int) -> None:
        """Record that the board has braked for stops up to `number`."""
        with self._lock:
            self.stop_acknowledged = max(self.stop_acknowledged, number)
            if self._requests.stop <= number:
                self._requests.stop = 0

    def request_run(self, request: RunRequest) -> None:
        """Replace the drive command by a run."""
        with self._lock:
            self._requests.run = request
            self._requests.drive = None

    def request_clear_faults(self) -> None:
        """Clear latched faults at the next step."""
        with self._lock:
            self._requests.clear_faults = True

    def request_call(self, call: BoardCall) -> None:
        """Do something with the board at the next step."""
        with self._lock:
            self._requests.calls.append(call)

    def return_calls(self, calls: Sequence[BoardCall]) -> None:
        """Do at the next step what this one did not come to, before anything newer."""
        with self._lock:
            self._requests.calls[:0] = calls

    @property
    def stop_pending(self) -> bool:
        """Whether a stop has not been acknowledged yet."""
        return self._requests.stop > 0

    def take_requests(self) -> Requests:
        """The pending requests, which are cleared except for the drive command and a stop."""
        with self._lock:
            taken = self._requests
            self._requests = Requests(drive=taken.drive, stop=taken.stop)
        return taken

    def drop_drive(self, command: DriveCommand | None = None) -> None:
        """Discard the drive command; with `command`, only if it has not been renewed."""
        with self._lock:
            if command is None or self._requests.drive is command:
                self._requests.drive = None

    def drop_requests(self) -> None:
        """Discard what a lost link can no longer execute; a stop is delivered as soon as the link is back."""
        with self._lock:
            self._wait_for_release = True
            self._requests.drive, self._requests.run = None, None
            calls, self._requests.calls = self._requests.calls, []
        for call in calls:
            call.result.set_exception(
                LinkError("the link was lost", "see the link state at the top of the page")
            )

    # ---- samples

    def add_samples(self, samples: Sequence[LiveSample]) -> None:
        """Place samples in the world and append them to the history."""
        with self._lock:
            placed = [(sample, self._chain.place(sample.odometry)) for sample in samples]
        self.history.extend(placed)

    def place(self, pose: Pose) -> None:
        """Set the robot's pose in the world."""
        with self._lock:
            self._chain.reset(pose)
