"""Brings a board's firmware up to date over the link, into the slot that does not run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from truing.board.image_slots import slots_of
from truing.errors import FlashError, LinkError, LinkTimeout, PortError, Refused
from truing.flash.update_file import Chunk, UpdateFile, chain
from truing.link.client import Client
from truing.progress import Progress, ignore_progress
from truing_protocol import (
    PROTOCOL_VERSION,
    SCHEMA_HASH,
    HelloRequest,
    RestartRequest,
    UpdateBeginRequest,
    UpdateDataRequest,
    UpdateFinishRequest,
    UpdateStateReply,
    UpdateStateRequest,
)

# The board is deaf while it erases its two sectors or its large one: 1 s, at most 2.
_ERASE_WAIT_S = 4.0
_ERASE_PATIENCE_S = 9.0
# Writing a chunk takes 2 ms, at most 13; judging the whole 10.
_WRITE_WAIT_S = 0.15
# An image that starts and never answers uses its three trials up in a minute.
_START_PATIENCE_S = 90.0
_START_POLL_S = 0.3
_AGAIN = "give the same command again: it goes on where this one ended"


@dataclass(frozen=True, slots=True)
class Updated:
    """What an update did."""

    slot: int
    name: str
    bytes: int
    resumed_at: int  # bytes that the board had already
    stall_s: float


def update_over_link(
    client: Client,
    file: UpdateFile,
    say: Callable[[str], None],
    progress: Progress = ignore_progress,
) -> Updated:
    """Send the image for the slot that does not run, start it, and see that it stays.

    These requests never change, so that the firmware's schema need not be the one of this truing.

    Raises
    ------
    FlashError : another board's image, an image that was rolled back, or a link that was cut.
    Refused : the robot moves, its wheels turn, or a log is being written.
    """
    _greet(client)
    state = _state(client)
    runs = slots_of(state)[state.running]
    if runs.name.partition(" ")[0] != file.header.board:
        raise FlashError(
            f"{file.path.name} is for {file.header.board}, and this board runs "
            f"{runs.name or 'no named image'}; nothing was written",
            "name that board's update",
        )
    slot = 1 - state.running
    image = file.images[slot]
    if len(image) > state.slot_size:
        raise FlashError(f"{file.path.name} needs {len(image)} bytes, and a slot holds {state.slot_size}")
    say(f"slot {state.running} runs {runs.name}; {file.header.name} goes into slot {slot}")
    try:
        resumed_at, stall_s = _send(client, image, state.chunk_size, progress)
        _restart(client, state.boot_id)
    except LinkError as error:
        raise FlashError(f"the link was cut: {error}; the board runs as before", _AGAIN) from error
    say("the board starts the new image on trial")
    _see_it_stay(client, slot, file, state.boot_id)
    return Updated(slot, file.header.name, len(image), resumed_at, stall_s)


def _greet(client: Client, patience_s: float = 3.0) -> None:
    """Confirm the image that runs, where it is on trial; the answer may be of any version."""
    client.exchange(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH), patience_s=patience_s)


def _state(client: Client) -> UpdateStateReply:
    try:
        return client.request(UpdateStateRequest())
    except Refused as refused:
        if refused.reason != "unknown_request":
            raise
        raise FlashError(
            "this board's firmware is older than updates over the link",
            "flash it with a probe or the ROM loader once: `truing flash`",
        ) from refused


def _send(client: Client, image: bytes, chunk_size: int, progress: Progress) -> tuple[int, float]:
    """All chunks that the board does not have; returns how many bytes it had, and its stall, s."""
    head, chunks = chain(image, chunk_size)
    begun = client.request(
        UpdateBeginRequest(tuple(head), len(image)), first_wait_s=_ERASE_WAIT_S, patience_s=_ERASE_PATIENCE_S
    )
    for index in range(begun.next, len(chunks)):
        _send_one(client, index, chunks[index])
        progress((index + 1) / len(chunks))
    client.request(UpdateFinishRequest(), first_wait_s=_WRITE_WAIT_S)
    return begun.next * chunk_size, begun.stall_ms / 1000


def _send_one(client: Client, index: int, chunk: Chunk) -> None:
    request = UpdateDataRequest(index, tuple(chunk.next), chunk.data)
    client.request(request, first_wait_s=_WRITE_WAIT_S)


def _restart(client: Client, boot_id: int) -> None:
    try:
        client.request(RestartRequest(boot_id))
    except Refused as refused:
        if refused.reason != "wrong_boot":  # it has started anew already, and the reply was lost
            raise


def _see_it_stay(client: Client, slot: int, file: UpdateFile, before: int) -> None:
    """Greet the board until it has started anew and answers, and ask which image does.

    Raises
    ------
    FlashError : it is the one from before, or nobody answers.
    """
    until_s = client.stream.now_s() + _START_PATIENCE_S
    while True:
        client.stream.sleep(_START_POLL_S)
        try:
            _greet(client, _START_POLL_S)
            state = _state(client)
            if state.boot_id != before:
                break
        except (LinkTimeout, PortError):
            pass
        if client.stream.now_s() >= until_s:
            raise FlashError(
                f"the board has not answered for {_START_PATIENCE_S:g} s since it was told to start "
                f"{file.header.name}",
                "switch it off and on: an image that does not answer is given up after three starts",
            )
    if state.running != slot:
        raise FlashError(
            f"{file.header.name} did not check in and was rolled back: the board runs "
            f"{slots_of(state)[state.running].name} from slot {state.running} again",
            "`truing faults` shows what stopped it; the image itself is at fault",
        )
