"""What a board tells of itself: its status with named faults, its parameters, its logs."""

from __future__ import annotations

import math
import struct
from dataclasses import asdict, dataclass
from typing import Any

from truing.link.refusals import faults_in
from truing_protocol import (
    LOG_CELL_SIZE,
    FaultInfo,
    LogEnd,
    LogEntry,
    Mode,
    ParameterInfo,
    ParamStoreReply,
    SequenceState,
    SlotState,
    State,
    StatusReply,
)


@dataclass(frozen=True, slots=True)
class BoardStatus:
    """What the robot does now.

    `active` faults have their cause present, `latched` ones have stopped the wheels. Pairs are
    left and right; `battery_v` is None while it could not be measured. `stray_edges` took no count with
    them: noise on the encoder's lines that passed the inputs' filters.
    """

    uptime_s: float
    state: State
    mode: Mode
    sequence_state: SequenceState
    log_open: bool
    active: tuple[FaultInfo, ...]
    latched: tuple[FaultInfo, ...]
    battery_v: float | None
    effort: tuple[float, float]
    speed_mps: tuple[float, float]
    counts: tuple[int, int]
    x_m: float
    y_m: float
    theta_rad: float
    frames_dropped: int
    stray_edges: tuple[int, int]

    @classmethod
    def from_reply(cls, reply: StatusReply) -> BoardStatus:
        """Read the wire's integers."""
        return cls(
            uptime_s=reply.uptime_ms / 1000,
            state=State(reply.state),
            mode=Mode(reply.mode),
            sequence_state=SequenceState(reply.sequence_state),
            log_open=bool(reply.log_open),
            active=faults_in(reply.faults_active),
            latched=faults_in(reply.faults_latched),
            battery_v=reply.battery_mv / 1000 if reply.battery_mv else None,
            effort=(reply.effort_e4[0] / 1e4, reply.effort_e4[1] / 1e4),
            speed_mps=(reply.speed_mmps[0] / 1000, reply.speed_mmps[1] / 1000),
            counts=(reply.counts[0], reply.counts[1]),
            x_m=reply.x_mm / 1000,
            y_m=reply.y_mm / 1000,
            theta_rad=reply.theta_e4 / 1e4,
            frames_dropped=reply.frames_dropped,
            stray_edges=(reply.stray_edges[0], reply.stray_edges[1]),
        )

    def to_dict(self) -> dict[str, Any]:
        """For JSON: enums and faults by name."""
        content = asdict(self)
        for name in ("state", "mode", "sequence_state"):
            content[name] = getattr(self, name).name.lower()
        for name in ("active", "latched"):
            content[name] = [fault.name for fault in getattr(self, name)]
        return content


@dataclass(frozen=True, slots=True)
class Parameter:
    """One of the board's parameters with its value.

    `stored` is what the board's store holds for it, None when that is nothing or was not asked for.
    """

    info: ParameterInfo
    value: float
    stored: float | None = None

    @property
    def text(self) -> str:
        """The value in the fewest digits that single precision needs."""
        return format_f32(self.value)

    @property
    def after_restart(self) -> float:
        """What the board's next start takes: the stored value, or else the default."""
        return self.info.default if self.stored is None else self.stored

    @property
    def is_kept(self) -> bool:
        """Whether the next start takes the value that is in force."""
        return format_f32(self.value) == format_f32(self.after_restart)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        info = self.info
        return {
            "value": float(self.text),
            "stored": None if self.stored is None else float(format_f32(self.stored)),
            "default": info.default,
            "unit": info.unit,
            "minimum": info.minimum,
            "maximum": info.maximum,
        }


@dataclass(frozen=True, slots=True)
class ParameterStore:
    """How the board's store of parameters is.

    `sequence` numbers the newest set, 0 when there is none; `stored` of this image's parameters are
    in it, `unknown` values belong to parameters that this image does not have, `unfit` ones lie
    beyond this image's limits.
    """

    sequence: int
    slots: tuple[SlotState, SlotState]
    stored: int
    unknown: int
    unfit: int

    @classmethod
    def from_reply(cls, reply: ParamStoreReply) -> ParameterStore:
        """Read the wire's integers."""
        first, second = (SlotState(state) for state in reply.slot_states)
        return cls(reply.sequence, (first, second), reply.stored, reply.unknown, reply.unfit)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self) | {"slots": [slot.name.lower() for slot in self.slots]}


@dataclass(frozen=True, slots=True)
class SavedParameters:
    """What a save did: the set's number, whether it had to be written, how long the board stood still."""

    sequence: int
    written: bool
    stall_s: float


@dataclass(frozen=True, slots=True)
class BoardLog:
    """One log that the board's ring still holds, wholly or in part."""

    log_id: int
    end: LogEnd
    truncated: bool
    rate_hz: int
    offset: int
    length: int
    record_count: int
    start_s: float
    end_s: float
    sequence_crc: int

    @classmethod
    def from_entry(cls, entry: LogEntry) -> BoardLog:
        """Read the wire's integers; offset and length are bytes, as downloads count."""
        return cls(
            log_id=entry.log_id,
            end=LogEnd(entry.end),
            truncated=bool(entry.truncated),
            rate_hz=entry.rate_hz,
            offset=entry.first_cell * LOG_CELL_SIZE,
            length=entry.cell_count * LOG_CELL_SIZE,
            record_count=entry.record_count,
            start_s=entry.start_ms / 1000,
            end_s=entry.end_ms / 1000,
            sequence_crc=entry.sequence_crc,
        )

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self) | {"end": self.end.name.lower()}


def format_f32(value: float) -> str:
    """The shortest decimal that single precision reads back as `value`."""
    if math.isfinite(value) and value == int(value) and abs(value) < 2**24:
        return str(int(value))
    for digits in range(1, 10):
        text = f"{value:.{digits}g}"
        if struct.pack("<f", float(text)) == struct.pack("<f", value):
            return text
    return repr(value)
