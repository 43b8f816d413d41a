"""HELLO: learns who the board is, and refuses to go on when the two sides speak different versions."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from truing.errors import LinkTimeout, ProtocolMismatch
from truing.link.client import Client
from truing_protocol import (
    PROTOCOL_VERSION,
    REFUSAL_ID,
    SCHEMA_HASH,
    ClockSource,
    HelloReply,
    HelloRequest,
    PayloadError,
    ResetCause,
)

# The first 6 bytes of HELLO never change (protocol/SPEC.md, "Versions").
_VERSIONS = struct.Struct("<HI")
# Shorter than a request's: the wrong port is a common mistake, and three seconds outlast any start-up.
_PATIENCE_S = 3.0


@dataclass(frozen=True, slots=True)
class BoardInfo:
    """Who a board is, from its HELLO."""

    port: str
    board_name: str
    board_id: str
    boot_id: int
    firmware_version: str
    protocol_version: int
    schema_hash: int
    tick_hz: int
    max_payload: int
    max_segments: int
    parameter_count: int
    log_bytes: int
    reset_cause: str
    clock_source: str


def shake_hands(client: Client) -> BoardInfo:
    """Ask who is there.

    Raises
    ------
    LinkTimeout : nobody answers.
    ProtocolMismatch : somebody does, in another version.
    """
    try:
        answer = client.exchange(HelloRequest(PROTOCOL_VERSION, SCHEMA_HASH), patience_s=_PATIENCE_S)
    except LinkTimeout as error:
        noise = client.bytes_in
        heard = f"{noise} bytes came, and no frame among them" if noise else "not one byte came"
        raise LinkTimeout(
            f"{client.stream.name}: no board answers ({heard} in {_PATIENCE_S:g} s)",
            "check that it is the right port, that the board has power and truing's firmware, "
            "and that no other program talks to it",
        ) from error
    if answer.id == REFUSAL_ID or len(answer.payload) < _VERSIONS.size:
        raise ProtocolMismatch(
            f"{client.stream.name}: something answers, but it is not a truing board",
            "check that it is the right port",
        )
    version, schema_hash = _VERSIONS.unpack_from(answer.payload)
    if (version, schema_hash) != (PROTOCOL_VERSION, SCHEMA_HASH):
        raise _mismatch(client.stream.name, version, schema_hash)
    try:
        hello = HelloReply.unpack(answer.payload)
    except PayloadError:
        raise _mismatch(client.stream.name, version, schema_hash) from None
    return BoardInfo(
        port=client.stream.name,
        board_name=hello.board_name,
        board_id=bytes(hello.board_id).hex(),
        boot_id=hello.boot_id,
        firmware_version=hello.firmware_version,
        protocol_version=version,
        schema_hash=schema_hash,
        tick_hz=hello.tick_hz,
        max_payload=hello.max_payload,
        max_segments=hello.max_segments,
        parameter_count=hello.parameter_count,
        log_bytes=hello.log_cell_count * hello.log_cell_size,
        reset_cause=_name(ResetCause, hello.reset_cause),
        clock_source=_name(ClockSource, hello.clock_source),
    )


def _mismatch(port: str, version: int, schema_hash: int) -> ProtocolMismatch:
    if version > PROTOCOL_VERSION:
        next_step = (
            "this truing is older than the board's firmware: "
            "update truing, or flash the image that came with it"
        )
    elif version < PROTOCOL_VERSION:
        next_step = (
            "the board's firmware is older than this truing: "
            "flash the image that came with it (firmware/README.md)"
        )
    else:
        next_step = "flash the image that was built together with this truing (firmware/README.md)"
    return ProtocolMismatch(
        f"{port}: the board speaks protocol {version} with schema {schema_hash:08x}, "
        f"this truing speaks protocol {PROTOCOL_VERSION} with schema {SCHEMA_HASH:08x}",
        next_step,
    )


def _name(enum: type[ResetCause] | type[ClockSource], value: int) -> str:
    try:
        return enum(value).name.lower()
    except ValueError:
        return f"unknown ({value})"
