"""Writes the byte tables between the markers of SPEC.md."""

from __future__ import annotations

from .schema import Record, Schema

BEGIN, END = "<!-- tables: written by protocol/generate.py -->", "<!-- end of tables -->"


def _type(scalar: str, count: int) -> str:
    if count == 0:
        return "bytes" if scalar == "bytes" else f"{scalar}, repeated"
    return scalar if count == 1 else f"{scalar}[{count}]"


def _record(record: Record) -> list[str]:
    if not record.fields:
        return ["empty", ""]
    lines = ["| byte | field | type | meaning |", "| --- | --- | --- | --- |"]
    lines += [f"| {at} | `{f.name}` | {_type(f.scalar, f.count)} | {f.doc} |" for at, f in record.offsets()]
    return [*lines, ""]


def _messages(schema: Schema) -> list[str]:
    lines = ["### Requests", ""]
    for m in schema.messages:
        once = " Executed once, however often the same frame arrives." if m.changes else ""
        lines += [
            f"#### `{m.id:#04x}` {m.name}",
            "",
            f"{m.doc[0].upper() + m.doc[1:]}.{once}",
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
        lines += [f"#### {enum.name}: {enum.doc}", "", "| value | name | meaning |", "| --- | --- | --- |"]
        docs = enum.docs or ("",) * len(enum.members)
        lines += [
            f"| {enum.first + i} | `{name}` | {doc} |"
            for i, (name, doc) in enumerate(zip(enum.members, docs, strict=True))
        ]
        lines.append("")
    return lines


def _tables(schema: Schema) -> list[str]:
    lines = [
        "### Log block header",
        "",
        *_record(schema.log_header),
        "### Log record",
        "",
        "| field | type | meaning |",
        "| --- | --- | --- |",
    ]
    lines += [f"| `{f.name}` | {f.scalar} | {f.doc} |" for f in schema.log_record.fields]
    lines += [
        "",
        "### Faults",
        "",
        "| bit | name | stops | cause | next step |",
        "| --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {i} | `{f.name}` | {'yes' if f.stops else 'no'} | {f.cause} | {f.next_step} |"
        for i, f in enumerate(schema.faults)
    ]
    lines += [
        "",
        "### Parameters",
        "",
        "| index | name | unit | kind | range | default | meaning |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {i} | `{p.name}` | {p.unit} | {p.kind} | {p.minimum:g} to {p.maximum:g} | {p.default:g} | {p.doc} |"
        for i, p in enumerate(schema.parameters)
    ]
    return [*lines, ""]


def spec(schema: Schema, current: str) -> str:
    """SPEC.md with its tables made anew; the prose around the markers stays."""
    before, rest = current.split(BEGIN)
    after = rest.split(END)[1]
    limits = [f"Protocol version {schema.limits['version']}, schema hash `{schema.hash:#010x}`.", ""]
    lines = [BEGIN, "", *limits, *_messages(schema), *_enums(schema), *_tables(schema), END]
    return before + "\n".join(lines) + after
