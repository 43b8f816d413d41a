"""What makes a board's armed log worth keeping: what to ask for, and what came of it."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from truing.board.signal_stream import STEPS
from truing.errors import TruingError
from truing.link.refusals import faults_in
from truing_protocol import (
    FaultInfo,
    LogArmRequest,
    LogEdge,
    LogTriggerKind,
    LogTriggerReply,
    LogTriggerState,
    Signal,
)

# A set of bits crosses no level, and a command's unit changes with the mode.
_WITHOUT_LEVEL = (Signal.FAULTS, Signal.CMD_LEFT, Signal.CMD_RIGHT)
SIGNALS = tuple(signal.name.lower() for signal in Signal if signal not in _WITHOUT_LEVEL)
# What the board reckons for a record before it has seen it; SPEC.md says so.
_RECORD_BYTES = 16


@dataclass(frozen=True, slots=True)
class LogTrigger:
    """What is armed on a board, and what came of it.

    `signal`, `edge` and `level` belong to a threshold. Once it has fired: `fired_s` is device time,
    `fired_t_s` the same from the log's opening on, `value` the signal then, `faults` what had latched.
    `level` and `value` are in the signal's unit.
    """

    state: LogTriggerState
    kind: LogTriggerKind
    signal: str | None
    edge: LogEdge | None
    level: float | None
    before_s: float
    after_s: float
    log_id: int | None
    fired_s: float | None
    fired_t_s: float | None
    value: float | None
    faults: tuple[FaultInfo, ...]

    @classmethod
    def from_reply(cls, reply: LogTriggerReply) -> LogTrigger:
        """Read the wire's integers."""
        state, kind = LogTriggerState(reply.state), LogTriggerKind(reply.kind)
        has_fired = state in (LogTriggerState.FIRED, LogTriggerState.DONE)
        watched = Signal(reply.signal) if kind is LogTriggerKind.THRESHOLD else None
        step = 1.0 if watched is None else STEPS[watched][0]
        return cls(
            state=state,
            kind=kind,
            signal=None if watched is None else watched.name.lower(),
            edge=None if watched is None else LogEdge(reply.edge),
            level=None if watched is None else round(reply.level * step, 9),
            before_s=reply.before_ms / 1000,
            after_s=reply.after_ms / 1000,
            log_id=reply.log_id or None,
            fired_s=reply.fired_ms / 1000 if has_fired else None,
            fired_t_s=reply.fired_t_ms / 1000 if has_fired else None,
            value=round(reply.value * step, 9) if has_fired and watched is not None else None,
            faults=faults_in(reply.faults),
        )

    def to_dict(self) -> dict[str, Any]:
        """For JSON: enums and faults by name."""
        return asdict(self) | {
            "state": self.state.name.lower(),
            "kind": self.kind.name.lower(),
            "edge": None if self.edge is None else self.edge.name.lower(),
            "faults": [fault.name for fault in self.faults],
        }

    @property
    def cause(self) -> str:
        """What it waits for, in words."""
        if self.signal is not None and self.edge is not None and self.level is not None:
            unit = STEPS[Signal[self.signal.upper()]][1]
            return f"{self.signal} {self.edge.name.lower()} {self.level:g} {unit}".rstrip()
        return "a fault"


def arm_request(
    on: str, before_s: float, after_s: float, signal: str | None, above: float | None, below: float | None
) -> LogArmRequest:
    """Return the request that arms a log.

    Raises
    ------
    TruingError : these numbers and names make no trigger.
    """
    before_ms, after_ms = (
        _milliseconds(name, value) for name, value in (("before", before_s), ("after", after_s))
    )
    if on == "fault":
        if signal is not None or above is not None or below is not None:
            raise TruingError("a signal and its level belong to a threshold, and this is to wait for a fault")
        return LogArmRequest(LogTriggerKind.FAULT, 0, 0, 0, before_ms, after_ms)
    if on != "threshold":
        raise TruingError(f"{on}: a log waits for a fault or a threshold")
    if signal not in SIGNALS:
        what = "no signal is named" if signal is None else f"{signal}: no such signal has a level"
        raise TruingError(what, f"there are {', '.join(SIGNALS)}")
    if (above is None) == (below is None):
        raise TruingError(f"{signal}: give one level, that it rises above or falls below")
    edge, level = (LogEdge.ABOVE, above) if above is not None else (LogEdge.BELOW, below)
    assert level is not None
    return LogArmRequest(
        LogTriggerKind.THRESHOLD,
        Signal[signal.upper()],
        edge,
        _wire_level(signal, edge, level),
        before_ms,
        after_ms,
    )


def max_span_s(memory_bytes: int, rate_hz: float) -> float:
    """Seconds before and after the trigger, together, that a board with so much log memory admits."""
    return memory_bytes // _RECORD_BYTES * 1000 // round(rate_hz) / 1000


def _milliseconds(name: str, seconds: float) -> int:
    if not (math.isfinite(seconds) and 0 <= seconds <= 4_000_000):
        raise TruingError(f"{name}: {seconds} is no time to keep; give seconds, 0 or more")
    return math.ceil(round(seconds * 1000, 6))


def _wire_level(signal: str, edge: LogEdge, level: float) -> int:
    """The integer that a signal's integers pass exactly where its values pass `level`."""
    if not math.isfinite(level):
        raise TruingError(f"{signal}: {level} is no level; give a finite number")
    steps = round(level / STEPS[Signal[signal.upper()]][0], 6)
    wire = math.floor(steps) if edge is LogEdge.ABOVE else math.ceil(steps)
    if not -(2**31) <= wire < 2**31:
        raise TruingError(f"{signal}: no value reaches {level:g}")
    return wire
