"""A client of the Foxglove WebSocket protocol, written from its specification, and a decoder of its messages.

https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md: JSON texts for `serverInfo`, `advertise` and
`subscribe`; a message arrives as a binary frame: opcode 1, subscription (u32), log time (u64, ns), payload.
"""

from __future__ import annotations

import json
import struct
from base64 import b64decode
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Self

SUBPROTOCOLS = ("foxglove.sdk.v1", "foxglove.websocket.v1")
MESSAGE_DATA = 1


def decode(encoding: str, schema_name: str, schema: bytes, payload: bytes) -> dict[str, Any]:
    """A message by the schema that came with it: JSON, or a set of protobuf descriptors."""
    if encoding == "json":
        found: dict[str, Any] = json.loads(payload)
        return found
    from google.protobuf import descriptor_pb2, json_format, message_factory

    files = descriptor_pb2.FileDescriptorSet.FromString(schema).file
    message = message_factory.GetMessages(files)[schema_name].FromString(payload)
    told: dict[str, Any] = json_format.MessageToDict(message, preserving_proto_field_name=True)
    return told


@dataclass(frozen=True)
class Received:
    """One message: topic, log time in ns, content."""

    topic: str
    time_ns: int
    content: dict[str, Any]


class FoxgloveClient:
    """Connects, and subscribes to each of `topics` as soon as the server has advertised it."""

    def __init__(self, url: str, topics: tuple[str, ...]) -> None:
        from websockets.sync.client import connect

        self._open = ExitStack()
        connection = connect(url, subprotocols=SUBPROTOCOLS, open_timeout=30.0)
        self._socket = self._open.enter_context(connection)
        self._wanted = dict(enumerate(topics, start=1))
        self.info: dict[str, Any] = json.loads(self._socket.recv(timeout=30.0))
        self.channels: dict[str, dict[str, Any]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def messages(self, timeout_s: float = 30.0) -> Iterator[Received]:
        """Messages as they come; ends after a time without any, and where the server has gone."""
        from websockets.exceptions import ConnectionClosed

        while True:
            try:
                frame = self._socket.recv(timeout=timeout_s)
            except (TimeoutError, ConnectionClosed):
                return
            if isinstance(frame, str):
                self._take(json.loads(frame))
            elif frame[0] == MESSAGE_DATA:
                subscription, time_ns = struct.unpack_from("<IQ", frame, 1)
                topic = self._wanted[subscription]
                channel = self.channels[topic]
                schema = channel["schema"]
                raw = b64decode(schema) if channel["encoding"] == "protobuf" else schema.encode()
                yield Received(
                    topic, time_ns, decode(channel["encoding"], channel["schemaName"], raw, frame[13:])
                )

    def first(self, topic: str) -> Received:
        """The next message of one topic."""
        return next(item for item in self.messages() if item.topic == topic)

    def wait_for(self, topic: str) -> None:
        """Wait until the server has advertised a topic, and subscribe to it."""
        while topic not in self.channels:
            self._take(json.loads(self._socket.recv(timeout=30.0)))

    def _take(self, told: dict[str, Any]) -> None:
        if told["op"] != "advertise":
            return
        for channel in told["channels"]:
            self.channels[channel["topic"]] = channel
            for subscription, topic in self._wanted.items():
                if topic == channel["topic"]:
                    asked = [{"id": subscription, "channelId": channel["id"]}]
                    self._socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
