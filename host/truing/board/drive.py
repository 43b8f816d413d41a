"""Drives a plan on a board: uploads it, starts it, watches it, and stops the wheels when told to."""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

from truing.board.device import Device
from truing.board.state import BoardStatus
from truing.errors import BoardFault, BoardRebooted, Interrupted, LinkError, SequenceEndedError, TruingError
from truing.plan import Plan
from truing.progress import Progress
from truing_protocol import SequenceState

_LOG = logging.getLogger("truing.board.drive")
# Each question is also the heartbeat that the board wants at least every 0.5 s (heartbeat_timeout_s).
_POLL_S = 0.1
_SLICE_S = 0.02
# The board ends a sequence by the same clock, to the millisecond.
_OVERTIME_S = 2.0


@dataclass(frozen=True, slots=True)
class Drive:
    """What came of a drive: the log it left, and how the board was right before it started."""

    log_id: int
    sequence_crc: int
    status_before: BoardStatus


class Interrupts:
    """Remembers that the user asked to stop, instead of raising wherever the program happens to be.

    A second Ctrl-C while the wheels are being stopped changes nothing: stopping goes first.
    """

    def __init__(self) -> None:
        self.requested = False

    @contextmanager
    def caught(self) -> Iterator[Interrupts]:
        """Catch SIGINT, SIGTERM and SIGHUP while the block runs."""
        if threading.current_thread() is not threading.main_thread():
            yield self  # only the main thread may catch signals; whoever runs this one asks in another way
            return
        # Windows has no SIGHUP.
        signals = {signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)}
        before = {number: signal.signal(number, self._remember) for number in signals}
        try:
            yield self
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _remember(self, _number: int, _frame: FrameType | None) -> None:
        self.requested = True


def drive(
    device: Device,
    plan: Plan,
    *,
    interrupts: Interrupts | None = None,
    progress: Progress | None = None,
    say: Callable[[str], None] = _LOG.warning,
) -> Drive:
    """Run a plan to its end.

    Parameters
    ----------
    interrupts : asked all the time; when it says so the wheels are stopped and `Interrupted` raised.
    progress : called with the share of the plan's time that has passed.
    say : told in one line what was done about the wheels when something went wrong.

    Raises
    ------
    Interrupted : the user asked to stop; the wheels are braked.
    BoardFault : the board stopped by itself, and why.
    LinkError : the link failed; the message says what the robot does now.
    Refused : the board would not start; nothing has moved.
    """
    interrupts = interrupts or Interrupts()
    moving = False
    with device.client.interrupted_by(lambda: interrupts.requested):
        try:
            status_before = device.status()
            sequence = device.upload(plan)
            if plan.unattended:
                say(
                    f"{plan.name} runs unattended: the board drives it to its end, "
                    f"{plan.duration_s:.0f} s, also when this program or the link fails"
                )
            # From here on the wheels may turn, whether or not the answer arrives.
            moving = True
            log_id = device.start(sequence, unattended=plan.unattended)
            _watch(device, sequence.duration_s, progress)
            moving = False
            return Drive(log_id, sequence.crc32, status_before)
        except BoardFault:
            raise
        except BaseException:
            if moving:
                _stop_for_certain(device, plan, say)
            raise


def _watch(device: Device, duration_s: float, progress: Progress | None) -> None:
    """Follow a running sequence to its end, by the board's own clock: a virtual one may run at any pace."""
    began: float | None = None
    while True:
        if device.client.is_interrupted:
            raise Interrupted("interrupted")
        status = device.status()
        if status.latched:
            raise board_fault(status)
        if status.sequence_state is SequenceState.DONE:
            break
        if status.sequence_state is not SequenceState.RUNNING:
            device.check_same_boot()
            raise SequenceEndedError()
        began = status.uptime_s if began is None else began
        elapsed = status.uptime_s - began
        if elapsed > duration_s + _OVERTIME_S:
            raise LinkError(
                f"{device.info.port}: the sequence should have ended {elapsed - duration_s:.1f} s ago "
                "by the board's own clock, and still runs",
                "report this with the firmware version",
            )
        if progress is not None:
            progress(min(elapsed / duration_s, 1.0))
        _pause(device, min(_POLL_S, max(duration_s - elapsed, _SLICE_S)))
    if progress is not None:
        progress(1.0)


def _pause(device: Device, seconds: float) -> None:
    """Let time pass in slices so short that a stop is not kept waiting."""
    while seconds > 0 and not device.client.is_interrupted:
        device.client.stream.sleep(min(seconds, _SLICE_S))
        seconds -= _SLICE_S


def board_fault(status: BoardStatus) -> BoardFault:
    """The exception for a board that has stopped by itself."""
    names = tuple(fault.name for fault in status.latched)
    causes = "; ".join(f"{fault.name}: {fault.cause}" for fault in status.latched)
    steps = "; ".join(fault.next_step for fault in status.latched)
    return BoardFault(
        names,
        f"the board stopped the wheels: {causes}",
        f"{steps}; `truing faults --clear` when the cause is gone; the log so far: `truing log fetch`",
    )


def _stop_for_certain(device: Device, plan: Plan, say: Callable[[str], None]) -> None:
    """Stop the wheels, asking until the board acknowledges, and say how that went."""
    try:
        device.stop()
    except BoardRebooted:
        say("the board started anew: its wheels are braked")
    except TruingError as error:
        until = (
            "It runs unattended, and may drive on until its plan ends, "
            f"{plan.duration_s:.0f} s after the start. Cut its power if that is not safe."
            if plan.unattended
            else "The board stops it by itself when it has heard no host for its heartbeat_timeout_s (0.5 s)."
        )
        say(f"COULD NOT STOP THE ROBOT: {error}. {until}")
    else:
        say("wheels stopped: the board has acknowledged the stop")
