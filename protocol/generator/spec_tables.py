"""Writes the byte tables between the markers of SPEC.md."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

from .schema import Record, Schema

BEGIN, END = "<!-- tables: written by protocol/generate.py -->", "<!-- end of tables -->"
WIDTH, LIMIT = 120, 130
"""Columns that a paragraph is wrapped at, and columns that no line exceeds."""


def _table(head: str, rows: Iterable[tuple[object, ...]], name: int = 1) -> list[str]:
    """A table with `head`, its columns divided by bars; the last cell of a long row stands below the table.

    Parameters
    ----------
    name : the column by which a row is named below the table.
    """
    columns = head.split("|")
    lines = ["| " + " | ".join(columns) + " |", "| " + " | ".join(["---"] * len(columns)) + " |"]
    below: list[str] = []
    for row in rows:
        line = "| " + " | ".join(map(str, row)) + " |"
        if len(line) > LIMIT:
            below += _item(f"{row[name]}: {row[-1]}")
            line = "| " + " | ".join(map(str, row[:-1])) + " | (below) |"
        lines.append(line)
    return [*lines, "", *below, *([""] if below else [])]


def _item(text: str) -> list[str]:
    return textwrap.wrap(f"- {text}", WIDTH, subsequent_indent="  ", break_on_hyphens=False)


def _type(scalar: str, count: int) -> str:
    if count == 0:
        return "bytes" if scalar == "bytes" else f"{scalar}, repeated"
    return scalar if count == 1 else f"{scalar}[{count}]"


def _record(record: Record) -> list[str]:
    if not record.fields:
        return ["empty", ""]
    rows = ((at, f"`{f.name}`", _type(f.scalar, f.count), f.doc) for at, f in record.offsets())
    return _table("byte|field|type|meaning", rows)


def _messages(schema: Schema) -> list[str]:
    lines = ["### Requests", ""]
    for m in schema.messages:
        once = " Executed once, however often the same frame arrives." if m.changes else ""
        lines += [
            f"#### `{m.id:#04x}` {m.name}",
            "",
            *textwrap.wrap(f"{m.doc[0].upper() + m.doc[1:]}.{once}", WIDTH, break_on_hyphens=False),
            "",
            "Request:",
            "",
            *_record(m.request),
            f"Reply `{m.id | 0x80:#04x}`:",
            "",
            *(_record(m.reply) if m.reply else ["empty", ""]),
        ]
    lines += [
        f"#### `{schema.refusal_id:#04x}` refusal",
        "",
        f"{schema.refusal.doc[0].upper() + schema.refusal.doc[1:]}.",
        "",
        *_record(schema.refusal),
        "### Structs inside messages",
        "",
    ]
    for struct in schema.structs:
        lines += [f"#### {struct.name}: {struct.doc} ({struct.size} bytes)", "", *_record(struct)]
    lines += ["### CAN broadcasts", "", "The id of each is its base plus the board's node, 1 to 63.", ""]
    for broadcast in schema.broadcasts:
        record = broadcast.record
        doc = record.doc[0].upper() + record.doc[1:]
        lines += [f"#### `{broadcast.base:#x}` + node: {record.name}", "", f"{doc}.", "", *_record(record)]
    return lines


def _enums(schema: Schema) -> list[str]:
    lines = ["### Named numbers", ""]
    for enum in schema.enums:
        docs = enum.docs or ("",) * len(enum.members)
        rows = (
            (enum.first + i, f"`{name}`", doc)
            for i, (name, doc) in enumerate(zip(enum.members, docs, strict=True))
        )
        lines += [f"#### {enum.name}: {enum.doc}", "", *_table("value|name|meaning", rows)]
    return lines


def _tables(schema: Schema) -> list[str]:
    log_fields = ((f"`{f.name}`", f.scalar, f.doc) for f in schema.log_record.fields)
    faults = ((i, f"`{f.name}`", "yes" if f.stops else "no") for i, f in enumerate(schema.faults))
    parameters = (
        (i, f"`{p.name}`", p.unit, p.kind, f"{p.minimum:g} to {p.maximum:g}", f"{p.default:g}", p.doc)
        for i, p in enumerate(schema.parameters)
    )
    return [
        "### Log block header",
        "",
        *_record(schema.log_header),
        "### Log record",
        "",
        *_table("field|type|meaning", log_fields, name=0),
        "### Faults",
        "",
        *_table("bit|name|stops", faults),
        "Causes and next steps:",
        "",
        *(line for f in schema.faults for line in _item(f"`{f.name}`: {f.cause}. Next: {f.next_step}.")),
        "",
        "### Parameters",
        "",
        *_table("index|name|unit|kind|range|default|meaning", parameters),
    ]


def spec(schema: Schema, current: str) -> str:
    """SPEC.md with its tables made anew; the prose around the markers stays."""
    before, rest = current.split(BEGIN)
    after = rest.split(END)[1]
    limits = [f"Protocol version {schema.limits['version']}, schema hash `{schema.hash:#010x}`.", ""]
    lines = [BEGIN, "", *limits, *_messages(schema), *_enums(schema), *_tables(schema), END]
    return before + "\n".join(lines) + after
