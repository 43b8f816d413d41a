"""Every error that `truing` raises on purpose: what went wrong, and what to do next.

The command line prints `TruingError` as one line (plus the next step) and exits with
`exit_code`: 2 where the user's input is wrong, 1 where the board or the link fails; anything
else that escapes is a bug in truing and keeps its traceback.
"""

# ruff: noqa: N818 (these are named for what happened, as users read them)

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path


class TruingError(Exception):
    """What went wrong in the user's words, and the next step that may put it right.

    Parameters
    ----------
    message : what went wrong, one line, without a full stop at its end.
    next_step : what the user can do about it; empty when there is nothing to say.
    """

    exit_code = 2

    def __init__(self, message: str, next_step: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.next_step = next_step

    def __str__(self) -> str:
        return self.message

    def __reduce__(self) -> tuple[Callable[..., TruingError], tuple[object, ...]]:
        # An exception's own way makes the copy from its message alone, which most of those below refuse:
        # then an error in a worker process would end the whole pool.
        return _copied, (type(self), self.args, self.__dict__)


def with_next(error: Exception) -> str:
    """What went wrong, and what to do about it, as a line of text."""
    next_step = error.next_step if isinstance(error, TruingError) else ""
    return f"{error}. Next: {next_step}" if next_step else str(error)


def _copied(kind: type[TruingError], args: tuple[object, ...], state: dict[str, object]) -> TruingError:
    error = kind.__new__(kind)
    error.args = args
    error.__dict__.update(state)
    return error


class FileError(TruingError):
    """A file or folder of the user's cannot be read, written or understood."""

    def __init__(self, path: str | Path, problem: str, next_step: str = "") -> None:
        super().__init__(f"{path}: {problem}", next_step)
        self.path = Path(path)
        self.problem = problem


class RecordingError(FileError):
    """A recording breaks its format (docs/DATA_FORMAT.md); says in which file, column and row.

    Parameters
    ----------
    row : data row, counted from 1; the line in the file is one more (the header is line 1).
    """

    def __init__(
        self,
        path: str | Path,
        problem: str,
        *,
        column: str | None = None,
        row: int | None = None,
        next_step: str = "",
    ) -> None:
        places = []
        if column is not None:
            places.append(f"column {column!r}")
        if row is not None:
            # Columns in memory have a name without an ending, and no lines.
            line = f" (line {row + 1} of the file)" if Path(path).suffix else ""
            places.append(f"row {row}{line}")
        where = ", ".join(places)
        super().__init__(path, f"{where}: {problem}" if where else problem, next_step)
        self.column = column
        self.row = row


class CutOffError(RecordingError):
    """A recording ends early or is damaged; what comes before that place is sound."""


class BaselineError(FileError):
    """A baseline.toml is missing, unreadable, or lacks what the task needs."""


class CatalogueError(FileError):
    """A fleet's folder or table does not say which sets there are, of which robot, recorded when."""


class OutputError(FileError):
    """A result cannot be written (disk full, no permission, a folder in the way)."""


class PlanError(TruingError):
    """A run plan is malformed, unknown, or asks for what the robot may not do."""


class ParameterFileError(FileError):
    """A file of parameters is unreadable, or holds what no board would take."""


class FormError(FileError):
    """A form of a board's bring-up cannot be read, or belongs to another board."""


class IdentifyError(TruingError):
    """A recording is well-formed, but the asked-for quantity cannot be determined from it."""


class PortError(TruingError):
    """A port cannot be opened, or is not of a kind that truing knows."""

    exit_code = 1


class FlashError(TruingError):
    """An image did not get onto a chip: no tool, no probe, another chip, or flash that did not take it."""

    exit_code = 1


class LinkError(TruingError):
    """The link to the board failed: it went silent, closed, or kept corrupting frames."""

    exit_code = 1


class StuffingError(ValueError):
    """Bytes that no encoder of frames makes: a zero among them, or an end within a block."""


class LinkTimeout(LinkError):
    """The board did not answer within the time that was allowed."""


class LinkClosed(LinkError):
    """The link is closed: the cable was pulled, the port vanished, or the peer hung up."""


class BoardRebooted(LinkError):
    """The board started anew in between: what it held in RAM (sequence, logs, unsaved parameters) is gone."""


class ProtocolMismatch(LinkError):
    """The board speaks another version of the protocol than this host."""


class Refused(TruingError):
    """The board refused a request and said why; the motors do what they did before.

    Parameters
    ----------
    request, reason : names from the protocol's schema.
    faults : the names of the faults that the board gives as its reason; none where it gives another.
    """

    exit_code = 1

    def __init__(
        self, request: str, reason: str, message: str, next_step: str = "", faults: tuple[str, ...] = ()
    ) -> None:
        super().__init__(message, next_step)
        self.request = request
        self.reason = reason
        self.faults = faults


class BoardFault(TruingError):
    """The board stopped by itself and latched one or more named faults."""

    exit_code = 1

    def __init__(self, faults: tuple[str, ...], message: str, next_step: str = "") -> None:
        super().__init__(message, next_step)
        self.faults = faults


class SequenceEndedError(TruingError):
    """The sequence was ended by somebody else."""

    exit_code = 1

    def __init__(self) -> None:
        super().__init__(
            "the sequence was ended before its time, by another program or at the board",
            "see that nobody else drives this robot; its log so far is on the board: `truing log fetch`",
        )


class ClockError(TruingError):
    """The board's clock and the host's cannot be related: too few answers, or one of them jumped."""

    exit_code = 1


class LogError(TruingError):
    """A downloaded log does not decode, or its digest differs from the board's."""

    exit_code = 1


class VirtualBoardError(TruingError):
    """The virtual board cannot start or stopped (no image, no native library, a CPU fault)."""

    exit_code = 1


class WeakEffectError(TruingError):
    """The effect cannot be made as strong on this robot as the trial wants it."""


class SealedProcessError(TruingError):
    """The process that makes trials could not make this one."""

    exit_code = 1


class BrokenSealError(TruingError):
    """An opened answer does not have the hash that was shown before."""

    exit_code = 1


class PeerFailedError(TruingError):
    """A method that the diagnosis is compared with gives no model of these recordings; says why in words."""


class ExpressionError(TruingError):
    """An expression that is none; the message says where, the next step what is allowed."""

    def __init__(self, text: str, why: str, allowed: str) -> None:
        super().__init__(f"{text!r}: {why}", f"An expression may hold {allowed}")


class UploadRefusedError(TruingError):
    """A file dropped onto a page is not taken."""


class LibraryMissingError(TruingError):
    """What was asked for needs a library that is not installed (`extras.py`)."""


class SchedulerLostError(TruingError):
    """The scheduler of a cluster cannot be reached, or was lost while tasks ran."""

    exit_code = 1


class WorkerLostError(TruingError):
    """A process that ran tasks has died, or there is none that could run them."""

    exit_code = 1


class Interrupted(TruingError):
    """The user asked to stop (Ctrl-C, or the program was told to end)."""

    exit_code = 130
