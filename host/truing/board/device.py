"""A board as a Python object: typed commands over the link."""

from __future__ import annotations

import difflib
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from truing.board.connect import open_stream
from truing.board.fault_record import FaultRecord
from truing.board.image_slots import ImageSlot, slots_of
from truing.board.log_trigger import LogTrigger, arm_request, max_span_s
from truing.board.signal_stream import SignalStream
from truing.board.state import (
    BoardLog,
    BoardStatus,
    Parameter,
    ParameterStore,
    SavedParameters,
    format_f32,
)
from truing.clock.probe import ClockProbe
from truing.clock.relation import ClockRelation, relate
from truing.errors import (
    BoardRebooted,
    ClockError,
    LinkTimeout,
    LogError,
    PlanError,
    Refused,
    TruingError,
)
from truing.link.client import Client
from truing.link.handshake import BoardInfo, shake_hands
from truing.log.download import DownloadReport, Keeper, LogDownload, MemoryKeeper
from truing.log.partial_file import LogIdentity, PartialFile
from truing.plan import Kind, Plan
from truing.progress import Progress
from truing.virtual.options import VirtualOptions
from truing_protocol import (
    PARAMETERS,
    ArmRequest,
    ClearFaultsRequest,
    FaultRecordRequest,
    LogArmRequest,
    LogEraseRequest,
    LogListReply,
    LogListRequest,
    LogTriggerKind,
    LogTriggerRequest,
    ParamDefaultsRequest,
    ParameterInfo,
    ParameterKind,
    ParamGetRequest,
    ParamListRequest,
    ParamLoadRequest,
    ParamSaveRequest,
    ParamSetRequest,
    ParamStoreRequest,
    Segment,
    SegmentKind,
    SeqAbortRequest,
    SeqBeginRequest,
    SeqCommitRequest,
    SeqSegmentsRequest,
    SeqStartRequest,
    SeqStateReply,
    SeqStateRequest,
    SetEffortRequest,
    SetVelocityRequest,
    StatusRequest,
    StopRequest,
    UpdateStateRequest,
)

_WIRE_KIND = {
    Kind.EFFORT: SegmentKind.EFFORT,
    Kind.VELOCITY: SegmentKind.VELOCITY,
    Kind.TWIST: SegmentKind.TWIST,
}
# Six segments make a frame of 90 bytes: on a clean line a long plan costs a few more round trips, on
# a bad one a longer frame would hardly ever arrive.
_SEGMENTS_PER_FRAME = 6
# While the board erases a sector of its flash, 0.25 to 0.5 s, it hears nothing; what is sent then is lost.
_SAVE_WAIT_S = 0.8
# More logs than any board holds: the answer then has none of them, and is short.
_NONE = 0xFFFF
# A stop is worth more patience than anything else.
_STOP_PATIENCE_S = 6.0
# The board takes braked wheels to stand after 2 s, and wants to have seen them stand for a tenth of one.
_STANDSTILL_S = 2.5
_STANDSTILL_POLL_S = 0.05
_ROLLING = {"encoder_left_implausible", "encoder_right_implausible"}


@dataclass(frozen=True, slots=True)
class UploadedSequence:
    """A sequence that the board holds and has checked."""

    crc32: int
    duration_s: float


class Device:
    """One board at the other end of a link.

    Parameters
    ----------
    client : an open link; the board is asked who it is at once.
    """

    def __init__(self, client: Client) -> None:
        self.client = client
        self.info: BoardInfo = shake_hands(client)
        self._armed = False

    @classmethod
    def open(cls, port: str = "sim", virtual: VirtualOptions | None = None) -> Device:
        """Open a port and greet the board on it."""
        client = Client(open_stream(port, virtual))
        try:
            return cls(client)
        except BaseException:
            client.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the port."""
        self.client.close()

    # ---- who and how

    def check_same_boot(self) -> None:
        """Greet again; raise `BoardRebooted` when the board started anew since the first greeting."""
        now = shake_hands(self.client)
        if (now.board_id, now.boot_id) != (self.info.board_id, self.info.boot_id):
            same = now.board_id == self.info.board_id
            who = "the board started anew" if same else "another board is on this port"
            raise BoardRebooted(
                f"{now.port}: {who} in between (cause of its last start: {now.reset_cause})",
                "its sequence, logs and unsaved parameters are gone; check its supply and start over",
            )

    def status(self) -> BoardStatus:
        """What the robot does now."""
        return BoardStatus.from_reply(self.client.request(StatusRequest()))

    def clock(
        self, seconds: float = 10.0, progress: Progress | None = None, seed: int = 1
    ) -> tuple[ClockRelation, int]:
        """How the board's clock relates to the stream's, measured for so long; and requests that were lost.

        `seed` draws the moments of the requests.

        Raises
        ------
        ClockError : too few answers, or one of the clocks jumped.
        """
        probe = ClockProbe(self.client, seed)
        probe.run(seconds, progress)
        try:
            return relate(probe.trips), probe.lost
        except ClockError:
            self.check_same_boot()
            raise

    def clear_faults(self) -> None:
        """Unlatch all faults whose cause is gone."""
        self.client.request(ClearFaultsRequest())

    def fault_record(self) -> FaultRecord | None:
        """What the board kept of the last fault of its program since power-up; None: there was none."""
        return FaultRecord.from_reply(self.client.request(FaultRecordRequest()))

    def image_slots(self) -> tuple[ImageSlot, ...]:
        """Which images of the firmware the board holds, and which of them runs."""
        return slots_of(self.client.request(UpdateStateRequest()))

    # ---- parameters

    def parameters(self, progress: Progress | None = None) -> dict[str, Parameter]:
        """All parameters with their values, by name, in the board's order."""
        found: dict[str, Parameter] = {}
        docs = {info.name: info.doc for info in PARAMETERS}
        for index in range(self.info.parameter_count):
            reply = self.client.request(ParamListRequest(index))
            info = ParameterInfo(
                index=index,
                name=reply.name,
                unit=reply.unit,
                kind=ParameterKind(reply.kind),
                minimum=reply.minimum,
                maximum=reply.maximum,
                default=reply.default_value,
                doc=docs.get(reply.name, ""),
            )
            found[reply.name] = Parameter(info, reply.value, reply.stored_value if reply.stored else None)
            if progress is not None:
                progress((index + 1) / self.info.parameter_count)
        return found

    def get_parameter(self, name: str) -> Parameter:
        """One parameter with its value."""
        info = parameter_info(name)
        return Parameter(info, self.client.request(ParamGetRequest(info.index)).value)

    def set_parameter(self, name: str, value: float) -> Parameter:
        """Change one parameter; returns it as the board stored it."""
        info = parameter_info(name)
        if not math.isfinite(value):
            raise TruingError(f"{name}: {value} is not a finite number")
        try:
            return Parameter(info, self.client.request(ParamSetRequest(info.index, value)).value)
        except Refused as refusal:
            if refusal.reason != "out_of_range":
                raise
            raise Refused(
                refusal.request,
                refusal.reason,
                f"the board refused {name} = {format_f32(value)}: it must lie within "
                f"{format_f32(info.minimum)} to {format_f32(info.maximum)} {info.unit}".rstrip(),
                "`truing params list` shows every parameter's limits",
            ) from None
        except (OverflowError, ValueError) as error:
            raise TruingError(f"{name}: {value:g} does not fit a single-precision number") from error

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Change some parameters, one after the other."""
        for name, value in values.items():
            self.set_parameter(name, value)

    def parameter_store(self) -> ParameterStore:
        """How the store is that outlives power."""
        return ParameterStore.from_reply(self.client.request(ParamStoreRequest()))

    def save_parameters(self) -> SavedParameters:
        """Store the values in force. The board brakes and is deaf for up to a second.

        Raises
        ------
        Refused : the robot moves or a log is written, or the flash did not take the values.
        """
        reply = self.client.request(ParamSaveRequest(), first_wait_s=_SAVE_WAIT_S)
        return SavedParameters(reply.sequence, bool(reply.written), reply.stall_ms / 1000)

    def load_parameters(self) -> int:
        """Go back to what the next start would take; returns how many values came from the store."""
        return self.client.request(ParamLoadRequest()).stored

    def default_parameters(self) -> None:
        """Put every default into force; the store keeps what it holds."""
        self.client.request(ParamDefaultsRequest())

    # ---- sequences

    def upload(self, plan: Plan) -> UploadedSequence:
        """Give the board a plan; it checks every segment and the whole's CRC.

        Raises
        ------
        PlanError : more segments than this board holds.
        Refused : a segment is beyond the board's limits, by number.
        """
        if len(plan.segments) > self.info.max_segments:
            raise PlanError(
                f"{plan.name}: {len(plan.segments)} segments are more than the {self.info.max_segments} "
                "that this board holds",
                "split the plan into several runs",
            )
        segments = tuple(
            Segment(_WIRE_KIND[step.kind], step.duration_ms, step.a, step.b) for step in plan.segments
        )
        crc = zlib.crc32(b"".join(segment.pack() for segment in segments))
        self.client.request(SeqBeginRequest(len(segments), plan.log_rate_hz))
        for first in range(0, len(segments), _SEGMENTS_PER_FRAME):
            self.client.request(SeqSegmentsRequest(first, segments[first : first + _SEGMENTS_PER_FRAME]))
        reply = self.client.request(SeqCommitRequest(crc))
        return UploadedSequence(crc, reply.duration_ms / 1000)

    def start(self, sequence: UploadedSequence, *, unattended: bool = False) -> int:
        """Run an uploaded sequence; returns the id of the log that opens.

        The board stops it, latched, once it has heard no request on this link for its
        heartbeat_timeout_s, unless `unattended`.

        The board begins from standstill only, and a wheel that still rolls is to it an encoder that counts
        while the wheels are braked. After a run that ended in motion they get the time that it takes.
        """
        self.arm()
        until_s: float | None = None
        while True:
            try:
                return self.client.request(SeqStartRequest(sequence.crc32, unattended)).log_id
            except Refused as refused:
                self._explain(refused)
                if refused.reason != "self_check_failed" or not set(refused.faults) <= _ROLLING:
                    raise
                # By the board's own clock: a virtual one may run at any pace.
                now_s = self.status().uptime_s
                until_s = now_s + _STANDSTILL_S if until_s is None else until_s
                if now_s >= until_s:
                    raise
            self.client.stream.sleep(_STANDSTILL_POLL_S)

    def sequence_state(self) -> SeqStateReply:
        """Where the sequence is."""
        return self.client.request(SeqStateRequest())

    def abort(self) -> None:
        """Brake, end the sequence, forget an upload in progress."""
        self.client.request(SeqAbortRequest(), patience_s=_STOP_PATIENCE_S)

    def arm(self) -> None:
        """Allow the board to move, once for this object: for the start of the board that it has greeted.

        Whatever drives does this first. A board that has started anew since refuses, and stays refusing: a
        program that goes on as if nothing had happened moves nothing.

        Raises
        ------
        BoardRebooted : it has started anew.
        """
        if self._armed:
            return
        try:
            self.client.request(ArmRequest(self.info.boot_id))
        except Refused as refusal:
            self._explain(refusal)
            raise
        self._armed = True

    def _drive(self, request: SetEffortRequest | SetVelocityRequest) -> None:
        self.arm()
        try:
            self.client.request(request)
        except Refused as refusal:
            self._explain(refusal)
            raise

    def _explain(self, refusal: Refused) -> None:
        """A board that lost its permission has started anew: `BoardRebooted` says so with the cause."""
        if refusal.reason in ("not_armed", "wrong_boot"):
            self.check_same_boot()

    # ---- live

    def set_effort(self, left: float, right: float) -> None:
        """Drive with a share of the supply; must be repeated within the board's command_timeout_s."""
        self._drive(SetEffortRequest(left, right))

    def set_velocity(self, left_mps: float, right_mps: float) -> None:
        """Hold wheel speeds; must be repeated within the board's command_timeout_s."""
        self._drive(SetVelocityRequest(left_mps, right_mps))

    def stop(self) -> None:
        """Brake both wheels now, whatever the board does; asks again until it is acknowledged.

        Not even a pending interrupt keeps this from being sent.
        """
        with self.client.uninterrupted():
            self.client.request(StopRequest(), patience_s=_STOP_PATIENCE_S)

    def stream(self, signals: Sequence[str], rate_hz: int = 200) -> SignalStream:
        """Signals as they happen; a context manager and an iterator of samples.

        Parameters
        ----------
        signals : names out of `truing.board.signal_stream.SIGNALS`, such as `speed_left`.

        Samples also arrive while this device is asked for anything else, a download included, and
        wait until they are taken.
        """
        return SignalStream(self.client, signals, rate_hz)

    # ---- logs

    def logs(self) -> tuple[BoardLog, ...]:
        """The logs in the ring, oldest first."""
        found: list[BoardLog] = []
        while True:
            reply = self._log_list(len(found))
            found += [BoardLog.from_entry(entry) for entry in reply.entries]
            if len(found) >= reply.total or not reply.entries:
                return tuple(found)

    def log(self, log_id: int | None = None) -> BoardLog:
        """The log with that id, or the newest.

        Asks from the newest backwards: a short answer gets through a bad line where the list of
        all logs would not.
        """
        total = self._log_list(_NONE).total
        for first in range(total - 1, -1, -1):
            # Others may have been added or overwritten since `total` was asked.
            entries = self._log_list(first).entries
            if not entries:
                continue
            for entry in entries[::-1] if log_id is None else entries:
                if log_id is None or entry.log_id == log_id:
                    return BoardLog.from_entry(entry)
        if log_id is None:
            raise LogError("the board holds no log", "drive a plan first: `truing run paper/XI`")
        raise LogError(f"the board holds no log {log_id}", "`truing log list` shows the logs it holds")

    def _log_list(self, first: int) -> LogListReply:
        return self.client.request(LogListRequest(first))

    def read_log(
        self,
        log: BoardLog,
        *,
        partial: Path | None = None,
        progress: Progress | None = None,
    ) -> tuple[bytes, DownloadReport]:
        """Bring a log's bytes, checked against the board's digest.

        Parameters
        ----------
        partial : a file that keeps what has arrived, so that a download cut short is resumed by
            the next one with the same file; removed when the download is done.
        """
        if partial is None:
            keeper: Keeper = MemoryKeeper(log.offset, log.length)
            return self._download(keeper, progress)
        identity = LogIdentity(
            self.info.board_id,
            self.info.boot_id,
            log.log_id,
            round(log.start_s * 1000),
            log.offset,
            log.length,
        )
        file = PartialFile(partial, identity)
        try:
            result = self._download(file, progress)
        except LogError:
            # Whatever is in the file, it is not this log: the next try begins afresh.
            file.discard()
            raise
        finally:
            file.close()
        file.discard()
        return result

    def _download(self, keeper: Keeper, progress: Progress | None) -> tuple[bytes, DownloadReport]:
        try:
            report = LogDownload(self.client, keeper).run(progress)
        except (LinkTimeout, Refused):
            # A board that started anew is silent for a while, and then knows nothing of this log.
            self.check_same_boot()
            raise
        return bytes(keeper.spans.data), report

    def erase_logs(self) -> None:
        """Forget all logs."""
        self.client.request(LogEraseRequest())

    def arm_log(
        self,
        on: str,
        *,
        before_s: float = 5.0,
        after_s: float = 2.0,
        signal: str | None = None,
        above: float | None = None,
        below: float | None = None,
    ) -> int:
        """Record from now on and keep what is around a trigger; returns the id of that log.

        It has the board's log_rate_hz. Live drives leave no log of their own meanwhile, and sequences are
        refused. The host may go.

        Parameters
        ----------
        on : "fault", the next one that latches, or "threshold".
        before_s, after_s : what is kept from before the trigger, at least, and recorded after it.
        signal : of a threshold, one of `truing.board.log_trigger.SIGNALS`.
        above, below : its level, one of the two: fires when the signal comes over it from the other side.

        Raises
        ------
        Refused : a log is being written, or the board cannot keep that much.
        """
        request = arm_request(on, before_s, after_s, signal, above, below)
        try:
            return self.client.request(request).log_id
        except Refused as refusal:
            if refusal.reason != "out_of_range":
                raise
            rate_hz = self.get_parameter("log_rate_hz").value
            raise Refused(
                refusal.request,
                refusal.reason,
                f"the board keeps at most {max_span_s(self.info.log_bytes, rate_hz):g} s before and after a "
                f"trigger together at {rate_hz:g} Hz, not {before_s + after_s:g} s",
                "shorten the times, or lower log_rate_hz with `truing params set`",
            ) from None

    def log_trigger_state(self) -> LogTrigger:
        """What is armed, and what came of it."""
        return LogTrigger.from_reply(self.client.request(LogTriggerRequest()))

    def disarm_log(self) -> None:
        """End an armed log: without a trigger it is discarded, after one it is sealed with what it has."""
        self.client.request(LogArmRequest(LogTriggerKind.SEQUENCE, 0, 0, 0, 0, 0))


def parameter_info(name: str) -> ParameterInfo:
    """The schema's description of a parameter.

    Raises
    ------
    TruingError : there is none of that name.
    """
    for info in PARAMETERS:
        if info.name == name:
            return info
    close = difflib.get_close_matches(name, [info.name for info in PARAMETERS], n=3)
    hint = f"did you mean {', '.join(close)}?" if close else "`truing params list` shows them all"
    raise TruingError(f"{name}: the board has no such parameter", hint)
