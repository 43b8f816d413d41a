"""The result of one set as a Parquet file of one row: its schema, its name, its bytes."""

from __future__ import annotations

import hashlib
import re
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from truing import __version__
from truing.fleet.catalogue import SetEntry

SCHEMA_VERSION = 2
FOLDER = "parts"
_NUMBER = [("value", pa.float64()), ("low", pa.float64()), ("high", pa.float64()), ("unit", pa.string())]
NUMBER = pa.struct([("parameter", pa.string()), ("wheel", pa.string()), *_NUMBER, ("reason", pa.string())])
EFFECT = pa.struct(
    [
        ("effect", pa.string()),
        ("scope", pa.string()),
        ("confidence", pa.float64()),
        ("indistinguishable_from", pa.list_(pa.string())),
        ("parameters", pa.list_(pa.struct([("name", pa.string()), *_NUMBER]))),
    ]
)
PART = pa.schema(
    [
        ("set", pa.string()),
        ("robot", pa.string()),
        ("group", pa.string()),
        # In UTC, without a zone: readers need no tables of zones.
        ("recorded", pa.timestamp("us")),
        ("url", pa.string()),
        # ok; not_diagnosed: numbers, but no verdict, or none was asked for; failed: neither.
        ("status", pa.string()),
        ("error", pa.string()),
        ("runs", pa.int64()),
        ("rows", pa.int64()),
        ("verdict", pa.string()),
        ("baseline_rmse", pa.float64()),
        ("refit_rmse", pa.float64()),
        ("model_rmse", pa.float64()),
        ("noise_floor", pa.float64()),
        ("rmse_unit", pa.string()),
        ("seconds", pa.float64()),
        ("cpu_s", pa.float64()),
        ("truing", pa.string()),
        ("numbers", pa.list_(NUMBER)),
        ("effects", pa.list_(EFFECT)),
    ]
)
# Of a set whose error lay not in its data: the next run of the command tries it again.
RETRY_SUFFIX = ".retry.parquet"


def part_name(entry: SetEntry, *, diagnose: bool) -> str:
    """Where the result of a set lies below the output's folder.

    The name holds a digest of all that the result depends on, so that a listing says which sets are done.
    """
    wanted = (
        SCHEMA_VERSION,
        __version__,
        diagnose,
        entry.name,
        entry.stamp,
        entry.group,
        entry.recorded.isoformat(),
    )
    key = hashlib.sha256("\0".join(map(str, wanted)).encode()).hexdigest()[:16]
    return f"{FOLDER}/{plain(entry.robot)}/{plain(entry.name.rsplit('/', 1)[-1])}-{key}.parquet"


def retry_name(part: str) -> str:
    """The same for a result that is to be tried again."""
    return part.removesuffix(".parquet") + RETRY_SUFFIX


def plain(text: str) -> str:
    """A text as a file name on every system; different texts have different names."""
    safe = re.sub(r"[^A-Za-z0-9._-]+", "_", text).strip(".") or "_"
    return safe if safe == text else f"{safe}-{hashlib.sha256(text.encode()).hexdigest()[:6]}"


def to_bytes(row: dict[str, Any]) -> bytes:
    """A row as a Parquet file."""
    table = pa.Table.from_pylist([row], schema=PART)
    return table_bytes(table)


def table_bytes(table: pa.Table) -> bytes:
    """A table as a Parquet file."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    data: bytes = sink.getvalue().to_pybytes()
    return data


def from_bytes(data: bytes) -> pa.Table | None:
    """The table of a part, or None where it is damaged."""
    try:
        return pq.read_table(pa.BufferReader(data), schema=PART)
    except (pa.ArrowInvalid, OSError):
        return None
