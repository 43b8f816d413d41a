"""The host's half of the wire reproduces every test vector."""

import json
import zlib
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest
from cobs import cobs

import truing_protocol

VECTORS = json.loads(
    (Path(__file__).resolve().parents[2] / "protocol" / "vectors" / "vectors.json").read_text()
)


def _class_of(name: str) -> Any:
    class_name = "".join(part.capitalize() for part in name.split("_"))
    return getattr(truing_protocol, class_name, truing_protocol.Ack)


def _build(cls: Any, values: dict[str, Any]) -> Any:
    """A message from the vectors' plain values; lists become what the class declares."""
    arguments = {}
    for field in fields(cls):
        value = values[field.name]
        if isinstance(value, list) and value and isinstance(value[0], dict):
            inner = truing_protocol.Segment if "kind" in value[0] else truing_protocol.LogEntry
            value = tuple(_build(inner, item) for item in value)
        elif isinstance(value, list):
            value = bytes(value) if field.type == "bytes" else tuple(value)
        arguments[field.name] = value
    return cls(**arguments)


@pytest.mark.parametrize("vector", VECTORS["messages"], ids=lambda v: str(v["name"]))
def test_messages_pack_and_unpack_to_the_vectors_bytes(vector: dict[str, Any]) -> None:
    cls = _class_of(vector["name"])
    assert is_dataclass(cls)
    message = _build(cls, vector["values"])
    assert message.pack().hex() == vector["payload"]
    assert cls.unpack(bytes.fromhex(vector["payload"])) == message


@pytest.mark.parametrize("vector", VECTORS["messages"], ids=lambda v: str(v["name"]))
def test_frames_are_stuffed_and_checked_as_in_the_vectors(vector: dict[str, Any]) -> None:
    body = bytes([vector["id"]]) + vector["sequence"].to_bytes(2, "little") + bytes.fromhex(vector["payload"])
    framed = cobs.encode(body + zlib.crc32(body).to_bytes(4, "little")) + b"\0"
    assert framed.hex() == vector["frame"]


@pytest.mark.parametrize("vector", VECTORS["messages"], ids=lambda v: str(v["name"]))
def test_a_payload_of_the_wrong_length_is_refused(vector: dict[str, Any]) -> None:
    cls = _class_of(vector["name"])
    payload = bytes.fromhex(vector["payload"])
    if payload:
        with pytest.raises(truing_protocol.PayloadError):
            cls.unpack(payload[: cls.SIZE - 1] if cls.SIZE else payload[:-1])


def test_stuffing_matches_the_cobs_package_on_every_vector() -> None:
    for vector in VECTORS["cobs"]:
        plain, stuffed = bytes.fromhex(vector["plain"]), bytes.fromhex(vector["stuffed"])
        assert cobs.encode(plain) == stuffed
        assert cobs.decode(stuffed) == plain


def test_the_crc_is_the_one_every_zip_tool_uses() -> None:
    for vector in VECTORS["crc32"]:
        assert zlib.crc32(bytes.fromhex(vector["data"])) == vector["crc32"]
