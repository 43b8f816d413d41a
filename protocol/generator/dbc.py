"""Writes truing.dbc: the broadcasts of the first few nodes, for tools that draw CAN signals."""

from __future__ import annotations

from .schema import SCALAR_SIZES, Broadcast, Field, Schema

NODES = range(1, 9)
"""Nodes that the file describes; a DBC file has no way to say "any"."""

_HEAD = """VERSION ""

NS_ :

BS_:
"""


def _signal(name: str, start: int, bits: int, field: Field, receiver: str = "host") -> str:
    signed = field.scalar.startswith("i")
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    span = f"[{low * field.scale:.10g}|{high * field.scale:.10g}]"
    sign = "-" if signed else "+"
    return f' SG_ {name} : {start}|{bits}@1{sign} ({field.scale:g},0) {span} "{field.unit}" {receiver}'


def _signals(schema: Schema, broadcast: Broadcast) -> list[str]:
    lines = []
    for at, field in broadcast.record.offsets():
        if field.signals == "fault":
            bit = Field(field.name, "u8", 1, "")
            lines += [_signal(f.name, 8 * at + i, 1, bit) for i, f in enumerate(schema.faults)]
        else:
            lines.append(_signal(field.name, 8 * at, 8 * SCALAR_SIZES[field.scalar], field))
    return lines


def _values(schema: Schema, can_id: int, broadcast: Broadcast) -> list[str]:
    named = {enum.name: enum for enum in schema.enums}
    lines = []
    for field in broadcast.record.fields:
        if field.signals in named:
            enum = named[field.signals]
            pairs = " ".join(f'{enum.first + i} "{name}"' for i, name in enumerate(enum.members))
            lines.append(f"VAL_ {can_id} {field.name} {pairs} ;")
    return lines


def dbc(schema: Schema) -> str:
    """The whole file, in the order messages, comments, values."""
    messages: list[str] = []
    comments: list[str] = []
    values: list[str] = []
    for node in NODES:
        for broadcast in schema.broadcasts:
            record, can_id = broadcast.record, broadcast.base + node
            name = f"{record.name.removeprefix('can_')}_{node}"
            messages += [f"BO_ {can_id} {name}: {record.size} board_{node}", *_signals(schema, broadcast), ""]
            comments.append(f'CM_ BO_ {can_id} "{record.doc}";')
            values += _values(schema, can_id, broadcast)
    nodes = "BU_: host " + " ".join(f"board_{node}" for node in NODES)
    return "\n".join([_HEAD, nodes, "", *messages, *comments, "", *values, ""])
