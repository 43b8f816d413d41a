"""Test vectors that both sides must reproduce: sample values, payload bytes, whole frames, and a coded log block.

The encoders here are written from SPEC.md and share nothing with the generated code, so that they can disagree with it.
"""

from __future__ import annotations

import json
import struct
import zlib
from typing import Any

from .log_coder import LogFormat, seal
from .schema import Field, Record, Schema

CODES = {"u8": "<B", "u16": "<H", "u32": "<I", "i16": "<h", "i32": "<i", "f32": "<f"}


def cobs(data: bytes) -> bytes:
    """Consistent overhead byte stuffing (Cheshire and Baker 1999), without the closing zero."""
    out, block = bytearray(), bytearray()
    for byte in data:
        if byte:
            block.append(byte)
        if not byte or len(block) == 254:
            # A full block of 254 stands for no zero at all.
            out += bytes([len(block) + 1]) + block
            block.clear()
            full = byte != 0
        else:
            full = False
    if block or not data or not full:
        out += bytes([len(block) + 1]) + block
    return bytes(out)


def frame(message_id: int, sequence: int, payload: bytes) -> bytes:
    body = struct.pack("<BH", message_id, sequence) + payload
    return cobs(body + struct.pack("<I", zlib.crc32(body))) + b"\0"


def _sample(schema: Schema, field: Field, salt: int) -> Any:
    """A value that is different for every field and exact in its type."""
    if field.scalar == "bytes":
        return [(salt * 37 + i * 11) % 256 for i in range(300)]
    if field.is_tail:
        struct_fields = schema.struct(field.scalar).fields
        return [
            {f.name: _sample(schema, f, salt + 10 * n + i) for i, f in enumerate(struct_fields)}
            for n in range(3)
        ]
    if field.is_text:
        return ("abcdefghijklmnopqrstuvwxyz" * 2)[: min(field.count, 3 + salt % 9)]
    if field.count > 1:
        one = Field(field.name, field.scalar, 1, "")
        return [_sample(schema, one, salt + i) for i in range(field.count)]
    return {
        "u8": (salt * 53) % 256,
        "u16": (salt * 7919) % 65536,
        "u32": (salt * 2654435761) % 2**32,
        "i16": (salt * 7919) % 65536 - 32768,
        "i32": (salt * 2654435761) % 2**32 - 2**31,
        "f32": -1.0 + 0.25 * salt,
    }[field.scalar]


def _pack(schema: Schema, record: Record, values: dict[str, Any]) -> bytes:
    out = b""
    for field in record.fields:
        value = values[field.name]
        if field.scalar == "bytes":
            out += bytes(value)
        elif field.is_tail:
            out += b"".join(_pack(schema, schema.struct(field.scalar), item) for item in value)
        elif field.is_text:
            out += value.encode().ljust(field.count, b"\0")
        else:
            out += b"".join(
                struct.pack(CODES[field.scalar], v) for v in (value if field.count > 1 else [value])
            )
    return out


def _log_samples() -> list[list[int]]:
    """A start, drives in both modes, a stop, extremes of every type and the wrap of the counters."""
    rows = [[0] * 15 + [1200]]
    left = right = 0
    for k in range(1, 120):
        velocity, driven = k > 60, k % 60 < 50
        before = left, right
        left += (k * k) % 7 + 60 if driven else 0
        right += (k * 5) % 4 + 66 if driven else 0
        command = [0, 0] if not driven else [180, -200] if velocity else [3500, 2500]
        effort = (
            [1500 + k * k % 11, -1700 + k % 5] if velocity and driven else [0, 0] if velocity else command
        )
        speeds = [round((left - before[0]) * 3.324), round((right - before[1]) * 3.324)]
        # Neither the pose nor the speeds are a real robot's: every branch of the coding is to be met.
        pose = [left // 6 + k // 9, k * k // 50, round((right - left) * 5.8743) + k // 40]
        rows.append(
            [
                50 * k,
                1 + velocity,
                k // 20,
                k // 100,
                *command,
                *effort,
                left,
                right,
                *speeds,
                *pose,
                1190 + k * k % 4,
            ]
        )
    highest = [350, 2, 2**16 - 1, 2**32 - 1, *[-(2**15), 2**15 - 1] * 2]
    highest += [2**31 - 1, -(2**31), 2**15 - 1, -(2**15), 2**31 - 1, -(2**31), 2**31 - 1, 2**16 - 1]
    return [
        *rows,
        highest,
        [2**32 - 1, *[0] * 7, -(2**31), 2**31 - 1, 0, 0, -(2**31), 2**31 - 1, -(2**31), 0],
        [0] * 16,
    ]


def _log() -> dict[str, Any]:
    """One block: the paper's robot, at a rate that does not divide a second, in the middle of its log."""
    log = LogFormat(0.00016624259, 9.3492346e-05, 30, log_id=7, start_ms=123456, sequence_crc=0x89ABCDEF)
    rows = _log_samples()
    block = log.coder(41)
    for row in rows:
        block.add(row)
    return {
        "metres_per_count": log.metres_per_count,
        "turns_per_count": log.turns_per_count,
        "rate_hz": log.rate_hz,
        "first_record": 41,
        "cell": 1234,
        "records": rows,
        "block": seal(log, block, 1234, end=1).hex(),
    }


def vectors(schema: Schema) -> dict[str, Any]:
    messages = []
    ids: list[tuple[int, Record]] = []
    for m in schema.messages:
        ids.append((m.id, m.request))
        ids.append((m.id | 0x80, m.reply or Record(f"{m.name}_reply", "", ())))
    ids.append((schema.refusal_id, schema.refusal))
    for salt, (message_id, record) in enumerate(ids, start=1):
        values = {f.name: _sample(schema, f, salt + i) for i, f in enumerate(record.fields)}
        payload = _pack(schema, record, values)
        sequence = salt * 1021 % 65536
        messages.append(
            {
                "name": record.name,
                "id": message_id,
                "sequence": sequence,
                "values": values,
                "payload": payload.hex(),
                "frame": frame(message_id, sequence, payload).hex(),
            }
        )
    stuffing = [
        b"",
        b"\0",
        b"\0\0",
        b"\x01",
        b"\x01\0\x02",
        bytes(range(1, 255)),
        bytes(range(1, 256)),
        bytes(254),
        bytes(range(256)) * 2,
        b"\x01" * 254 + b"\0",
        b"\x01" * 508,
    ]
    return {
        "cobs": [{"plain": raw.hex(), "stuffed": cobs(raw).hex()} for raw in stuffing],
        "crc32": [{"data": b"123456789".hex(), "crc32": 0xCBF43926}, {"data": "", "crc32": 0}],
        "messages": messages,
        "log": {"fields": [f.name for f in schema.log_record.fields], **_log()},
    }


def as_json(data: dict[str, Any]) -> str:
    return json.dumps(data, indent=1) + "\n"


def _bytes_c(name: str, data: bytes) -> str:
    body = ", ".join(f"0x{b:02x}" for b in data) or "0"
    return f"static const uint8_t {name}[] = {{{body}}};"


def as_c_header(data: dict[str, Any]) -> str:
    """The same vectors for tests written in C."""
    lines = [
        "/* vectors.h: the vectors of vectors.json for tests in C.",
        " * Generated by protocol/generate.py; edit schema.toml, not this. */",
        "#ifndef TRUING_VECTORS_H",
        "#define TRUING_VECTORS_H",
        "",
        "#include <stddef.h>",
        "#include <stdint.h>",
        "",
    ]
    rows = []
    for i, m in enumerate(data["messages"]):
        payload, whole = bytes.fromhex(m["payload"]), bytes.fromhex(m["frame"])
        lines += [_bytes_c(f"vector_payload_{i}", payload), _bytes_c(f"vector_frame_{i}", whole)]
        rows.append(
            f'    {{"{m["name"]}", {m["id"]:#04x}, {m["sequence"]}, vector_payload_{i}, {len(payload)}, vector_frame_{i}, {len(whole)}}},'
        )
    lines += [
        "",
        "struct message_vector {",
        "    const char *name;",
        "    uint8_t id;",
        "    uint16_t sequence;",
        "    const uint8_t *payload;",
        "    size_t payload_length;",
        "    const uint8_t *frame; /* stuffed, with its closing zero */",
        "    size_t frame_length;",
        "};",
        "",
        "static const struct message_vector message_vectors[] = {",
        *rows,
        "};",
        "",
    ]
    rows = []
    for i, c in enumerate(data["cobs"]):
        plain, stuffed = bytes.fromhex(c["plain"]), bytes.fromhex(c["stuffed"])
        lines += [_bytes_c(f"vector_plain_{i}", plain), _bytes_c(f"vector_stuffed_{i}", stuffed)]
        rows.append(f"    {{vector_plain_{i}, {len(plain)}, vector_stuffed_{i}, {len(stuffed)}}},")
    lines += [
        "",
        "struct cobs_vector {",
        "    const uint8_t *plain;",
        "    size_t plain_length;",
        "    const uint8_t *stuffed;",
        "    size_t stuffed_length;",
        "};",
        "",
        "static const struct cobs_vector cobs_vectors[] = {",
        *rows,
        "};",
        "",
    ]
    records = ",\n".join(
        "    {" + ", ".join(f"{v % 2**32}u" for v in row) + "}" for row in data["log"]["records"]
    )
    lines += [
        f"static const uint32_t log_vector_records[{len(data['log']['records'])}][16] = {{",
        records,
        "};",
        _bytes_c("log_vector_block", bytes.fromhex(data["log"]["block"])),
        f"#define LOG_VECTOR_METRES_PER_COUNT {data['log']['metres_per_count']!r}f",
        f"#define LOG_VECTOR_TURNS_PER_COUNT {data['log']['turns_per_count']!r}f",
        f"#define LOG_VECTOR_RATE_HZ {data['log']['rate_hz']}u",
        f"#define LOG_VECTOR_FIRST_RECORD {data['log']['first_record']}u",
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)
