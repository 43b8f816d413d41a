"""Turns a refusal on the wire into an exception that names the reason, its cause and the next step."""

from __future__ import annotations

from truing.errors import Refused
from truing_protocol import FAULTS, REFUSAL_MEANING, FaultInfo, ImageDefect, Refusal, RefusalReason, State

_NEXT_STEP: dict[int, str] = {
    RefusalReason.UNKNOWN_REQUEST: "flash the firmware that belongs to this version of truing",
    RefusalReason.BAD_LENGTH: "flash the firmware that belongs to this version of truing",
    RefusalReason.NOT_FINITE: "give a finite number",
    RefusalReason.OUT_OF_RANGE: (
        "`truing params list` shows the limits; change the command, or the limit with `truing params set`"
    ),
    RefusalReason.WRONG_STATE: "`truing stop` ends what the board does now; then try again",
    RefusalReason.FAULT_LATCHED: "put the cause right, then `truing faults --clear`",
    RefusalReason.SELF_CHECK_FAILED: "put the cause right; `truing info` shows what the board measures",
    RefusalReason.UNKNOWN_PARAMETER: "`truing params list` shows the names",
    RefusalReason.SEQUENCE_TOO_LONG: "shorten the plan, or split it into several",
    RefusalReason.SEQUENCE_GAP: "upload the plan again; another host may be using this board",
    RefusalReason.SEQUENCE_INCOMPLETE: "upload the plan again; another host may be using this board",
    RefusalReason.SEQUENCE_BAD_CRC: "upload the plan again; another host may be using this board",
    RefusalReason.SEQUENCE_EMPTY: "upload a plan first (`truing run PLAN` does both)",
    RefusalReason.UNKNOWN_SEGMENT_KIND: "flash the firmware that belongs to this version of truing",
    RefusalReason.LOG_GONE: (
        "`truing log list` shows what the ring still holds; fetch logs sooner, or log at a lower rate"
    ),
    RefusalReason.LOG_BEYOND_END: "`truing log list` shows what the ring holds",
    RefusalReason.STORE_FAILED: (
        "check the board's supply and try again; if it stays so, the flash is worn out: keep the values with "
        "`truing params save --file` and change the board"
    ),
    RefusalReason.NOT_ARMED: "the board has started anew: check why, then give the command again",
    RefusalReason.WRONG_BOOT: "the board has started anew: check why, then give the command again",
    RefusalReason.UPDATE_UNDER_WAY: "let the update end; 10 s after its host fell silent it counts as ended",
    RefusalReason.UPDATE_NONE: "give `truing flash --over-link` again: it goes on where it ended",
    RefusalReason.UPDATE_GAP: (
        "give `truing flash --over-link` again; another host may be updating this board"
    ),
    RefusalReason.UPDATE_BAD_CHUNK: (
        "give `truing flash --over-link` again; another host may be updating this board"
    ),
    RefusalReason.UPDATE_BAD_IMAGE: "`./run setup` builds the update anew",
    RefusalReason.UPDATE_OTHER_BOARD: "name that board's update",
    RefusalReason.UPDATE_FAILED: (
        "check the board's supply and try again; if it stays so, the flash is worn out: change the board"
    ),
    RefusalReason.UPDATE_ON_TRIAL: "any command of truing confirms the image that runs: try again",
    RefusalReason.WHEELS_TURN: "wait until the robot stands, or hold it; then try again",
    RefusalReason.LOG_BUSY: (
        "wait for the sequence to end, or `truing stop`; `truing log disarm` ends an armed log"
    ),
}
_WITH_FAULTS = {RefusalReason.FAULT_LATCHED, RefusalReason.SELF_CHECK_FAILED}


def faults_in(bits: int) -> tuple[FaultInfo, ...]:
    """Return the faults whose bits are set, in the schema's order."""
    return tuple(fault for fault in FAULTS if bits & fault.mask)


def refused(request: str, refusal: Refusal) -> Refused:
    """Return the exception for `refusal` of the request with that name."""
    try:
        reason = RefusalReason(refusal.reason)
    except ValueError:
        text = f"the board refused {request} for reason {refusal.reason}, which truing does not know"
        return Refused(request, str(refusal.reason), text)
    name = reason.name.lower()
    next_step = _NEXT_STEP.get(reason, "")
    meaning = REFUSAL_MEANING[reason].split("; `detail`")[0].split("; clear_faults")[0]
    text = f"the board refused {request}: {name} ({meaning}"
    faults = faults_in(refusal.detail) if reason in _WITH_FAULTS else ()
    if reason in _WITH_FAULTS:
        text += ": " + ", ".join(f"{fault.name}, {fault.cause}" for fault in faults) + ")"
        if faults:
            next_step = "; ".join(fault.next_step for fault in faults) + "; then `truing faults --clear`"
    else:
        text += _detail(reason, request, refusal.detail) + ")"
    return Refused(request, name, text, next_step, tuple(fault.name for fault in faults))


def _detail(reason: RefusalReason, request: str, detail: int) -> str:
    """What the refusal's number says, in words; empty where it says nothing to a person."""
    if reason is RefusalReason.WRONG_STATE:
        states = {int(s): s.name.lower() for s in State}
        return f": it is {states.get(detail, detail)}"
    if reason in (RefusalReason.OUT_OF_RANGE, RefusalReason.NOT_FINITE):
        what = "segment {}" if request == "seq_segments" else "number {} of the request"
        return ": " + what.format(detail + 1)
    if reason is RefusalReason.UPDATE_BAD_IMAGE:
        defects = {int(d): d.name.lower() for d in ImageDefect}
        return f": {defects.get(detail, detail)}"
    if reason is RefusalReason.SEQUENCE_TOO_LONG:
        return f": it holds {detail}"
    if reason is RefusalReason.SEQUENCE_GAP:
        return f": it expects segment {detail + 1}"
    if reason is RefusalReason.SEQUENCE_INCOMPLETE:
        return f": it has {detail}"
    if reason is RefusalReason.UNKNOWN_SEGMENT_KIND:
        return f": segment {detail + 1}"
    if reason is RefusalReason.LOG_GONE:
        return f": the oldest byte left is {detail}"
    if reason is RefusalReason.LOG_BEYOND_END:
        return f": the log's bytes end at {detail}"
    return ""
