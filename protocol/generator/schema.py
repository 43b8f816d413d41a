"""The schema as typed objects: what every generator reads, and the only place that knows the TOML's shape."""

from __future__ import annotations

import json
import re
import tomllib
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SCALAR_SIZES = {"u8": 1, "u16": 2, "u32": 4, "i16": 2, "i32": 4, "f32": 4}

_ARRAY = re.compile(r"^(\w+)\[(\d+)\]$")
_STRUCT_TAIL = re.compile(r"^\[(\w+)\]$")


class SchemaError(ValueError):
    """The schema contradicts itself; the message names the entry."""


@dataclass(frozen=True)
class Field:
    """One field of a message: `count` scalars, text, or the variable rest of the payload."""

    name: str
    scalar: str  # u8, u16, u32, i16, i32, f32, char; "bytes" or a struct's name for a tail
    count: int  # 1 for a plain scalar; array length; 0 for a tail
    doc: str
    scale: float = 1.0  # of a broadcast's field: physical value of one step
    unit: str = ""
    signals: str = ""  # of a broadcast's field: the enum that names its values, or "fault" for bits

    @property
    def is_tail(self) -> bool:
        return self.count == 0

    @property
    def is_text(self) -> bool:
        return self.scalar == "char"

    @property
    def size(self) -> int:
        """Bytes on the wire; 0 for a tail."""
        return self.count * SCALAR_SIZES.get(self.scalar, 1)


@dataclass(frozen=True)
class Record:
    """An ordered list of fields: a request, a reply, or a struct that repeats."""

    name: str
    doc: str
    fields: tuple[Field, ...]

    @property
    def size(self) -> int:
        """Bytes of the fixed part."""
        return sum(field.size for field in self.fields)

    @property
    def tail(self) -> Field | None:
        return self.fields[-1] if self.fields and self.fields[-1].is_tail else None

    def offsets(self) -> list[tuple[int, Field]]:
        at, placed = 0, []
        for field in self.fields:
            placed.append((at, field))
            at += field.size
        return placed


@dataclass(frozen=True)
class Message:
    name: str
    id: int
    doc: str
    changes: bool
    request: Record
    reply: Record | None  # None: an empty acknowledgement


@dataclass(frozen=True)
class Broadcast:
    """A CAN frame that a board sends unasked; its id is `base` plus the node."""

    base: int
    record: Record


@dataclass(frozen=True)
class Enum:
    name: str
    doc: str
    first: int
    members: tuple[str, ...]
    docs: tuple[str, ...]


@dataclass(frozen=True)
class Parameter:
    name: str
    unit: str
    kind: str
    minimum: float
    maximum: float
    default: float
    doc: str

    @property
    def key(self) -> int:
        """What the board's store knows it by; it outlives the parameter's place in the table."""
        return zlib.crc32(self.name.encode())


@dataclass(frozen=True)
class Fault:
    name: str
    stops: bool
    cause: str
    next_step: str


@dataclass(frozen=True)
class Schema:
    limits: dict[str, int]
    enums: tuple[Enum, ...]
    structs: tuple[Record, ...]
    messages: tuple[Message, ...]
    refusal_id: int
    refusal: Record
    log_header: Record
    log_record: Record
    can: dict[str, int]
    broadcasts: tuple[Broadcast, ...]
    parameters: tuple[Parameter, ...]
    faults: tuple[Fault, ...]
    hash: int

    def records(self) -> list[Record]:
        """Everything that is packed into bytes, in the schema's order."""
        found = [*self.structs, *(b.record for b in self.broadcasts)]
        for message in self.messages:
            if message.request.fields:
                found.append(message.request)
            if message.reply is not None:
                found.append(message.reply)
        return [*found, self.refusal, self.log_header, self.log_record]

    def struct(self, name: str) -> Record:
        for record in self.structs:
            if record.name == name:
                return record
        raise SchemaError(f"no struct is called {name}")


def _field(raw: dict[str, Any], owner: str) -> Field:
    text, name, doc = raw["type"], raw["name"], raw["doc"]
    if text in SCALAR_SIZES:
        physical = raw.get("scale", 1.0), raw.get("unit", ""), raw.get("signals", "")
        return Field(name, text, 1, doc, *physical)
    if text == "bytes":
        return Field(name, "bytes", 0, doc)
    if match := _STRUCT_TAIL.match(text):
        return Field(name, match[1], 0, doc)
    if (match := _ARRAY.match(text)) and (match[1] in SCALAR_SIZES or match[1] == "char"):
        return Field(name, match[1], int(match[2]), doc)
    raise SchemaError(f"{owner}.{name}: unknown type {text!r}")


def _record(name: str, doc: str, raw_fields: list[dict[str, Any]]) -> Record:
    fields = tuple(_field(raw, name) for raw in raw_fields)
    if any(field.is_tail for field in fields[:-1]):
        raise SchemaError(f"{name}: only the last field may take the rest of the payload")
    return Record(name, doc, fields)


def _message(raw: dict[str, Any]) -> Message:
    name = raw["name"]
    reply = None
    if raw["reply"] != "ack":
        reply = _record(f"{name}_reply", f"reply: {raw['doc']}", raw["reply"])
    request = _record(f"{name}_request", raw["doc"], raw["request"])
    return Message(name, raw["id"], raw["doc"], raw.get("changes", False), request, reply)


def _without_docs(node: Any) -> Any:
    if isinstance(node, dict):
        words = {"doc", "docs", "cause", "next_step"}
        return {key: _without_docs(value) for key, value in node.items() if key not in words}
    if isinstance(node, list):
        return [_without_docs(item) for item in node]
    return node


def schema_hash(raw: dict[str, Any]) -> int:
    """CRC-32 of the schema without its explanations: equal hashes mean equal bytes on the wire."""
    canonical = json.dumps(_without_docs(raw), sort_keys=True, separators=(",", ":"))
    return zlib.crc32(canonical.encode())


def _check_ids(messages: tuple[Message, ...], refusal_id: int) -> None:
    seen: dict[int, str] = {refusal_id: "refusal"}
    for message in messages:
        if not 0 < message.id < 0x7F:
            raise SchemaError(f"{message.name}: id {message.id:#x} is outside 0x01..0x7e")
        if message.id in seen:
            raise SchemaError(f"{message.name} and {seen[message.id]} share id {message.id:#x}")
        seen[message.id] = message.name


def _check_keys(parameters: tuple[Parameter, ...]) -> None:
    seen: dict[int, str] = {}
    for parameter in parameters:
        if parameter.key in seen:
            raise SchemaError(
                f"{parameter.name} and {seen[parameter.key]} share the store's key {parameter.key:#x}"
            )
        seen[parameter.key] = parameter.name


def _broadcast(raw: dict[str, Any]) -> Broadcast:
    record = _record(raw["name"], raw["doc"], raw["fields"])
    if record.size > 8 or record.tail is not None:
        raise SchemaError(f"{record.name}: a CAN frame holds 8 bytes")
    return Broadcast(raw["base"], record)


def load(path: Path) -> Schema:
    """Read and check the schema file; raises SchemaError naming the entry that is wrong."""
    raw = tomllib.loads(path.read_text(encoding="utf-8"))
    enums = tuple(
        Enum(e["name"], e["doc"], e.get("first", 0), tuple(e["members"]), tuple(e.get("docs", ())))
        for e in raw["enum"]
    )
    messages = tuple(_message(m) for m in raw["message"])
    _check_ids(messages, raw["refusal"]["id"])
    if len(raw["fault"]) > 32 or len(raw["log_record"]["fields"]) != 16:
        raise SchemaError("at most 32 faults fit their bit mask, and the log has 16 fields")
    parameters = tuple(
        Parameter(
            p["name"],
            p["unit"],
            p["kind"],
            float(p["range"][0]),
            float(p["range"][1]),
            float(p["default"]),
            p["doc"],
        )
        for p in raw["parameter"]
    )
    _check_keys(parameters)
    return Schema(
        limits=raw["protocol"],
        enums=enums,
        structs=tuple(_record(s["name"], s["doc"], s["fields"]) for s in raw["struct"]),
        messages=messages,
        refusal_id=raw["refusal"]["id"],
        refusal=_record("refusal", raw["refusal"]["doc"], raw["refusal"]["fields"]),
        log_header=_record("log_header", raw["log_header"]["doc"], raw["log_header"]["fields"]),
        log_record=_record("log_record", raw["log_record"]["doc"], raw["log_record"]["fields"]),
        can=raw["can"],
        broadcasts=tuple(_broadcast(b) for b in raw["broadcast"]),
        parameters=parameters,
        faults=tuple(Fault(f["name"], f["stops"], f["cause"], f["next_step"]) for f in raw["fault"]),
        hash=schema_hash(raw),
    )
