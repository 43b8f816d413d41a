"""The rows of a fleet as flat tables: sets, numbers, effects; each one Parquet file."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from truing.fleet.part import EFFECT, NUMBER, PART, from_bytes, retry_name, table_bytes
from truing.fleet.storage import Place

READERS = 16
_KEYS = ("set", "robot", "group", "recorded")
_NESTED = ("numbers", "effects")


@dataclass(frozen=True, slots=True)
class Tables:
    """The fleet's results.

    Attributes
    ----------
    sets : a row for each set: verdict, errors, its error text.
    numbers : a row for each parameter, wheel and set.
    effects : a row for each named effect, its parameter and set.
    missing : sets whose row is not there, or damaged.
    """

    sets: pa.Table
    numbers: pa.Table
    effects: pa.Table
    missing: tuple[str, ...]

    def named(self) -> dict[str, pa.Table]:
        """Each by the name of its file."""
        return {"sets": self.sets, "numbers": self.numbers, "effects": self.effects}


def gather(out: Place, parts: dict[str, str], there: Iterable[str]) -> Tables:
    """Read the rows of these sets.

    Parameters
    ----------
    parts : set to the name of its file.
    there : the files that `out` holds.
    """
    known = set(there)
    found = {
        name: part if part in known else retry_name(part)
        for name, part in parts.items()
        if part in known or retry_name(part) in known
    }

    def read(name: str) -> pa.Table | None:
        return from_bytes((out / found[name]).read())

    with ThreadPoolExecutor(READERS) as pool:
        read_tables = list(pool.map(read, found))
    damaged = [name for name, table in zip(found, read_tables, strict=True) if table is None]
    rows = pa.concat_tables([table for table in read_tables if table is not None] or [PART.empty_table()])
    rows = rows.sort_by([("robot", "ascending"), ("recorded", "ascending"), ("set", "ascending")])
    missing = (*(name for name in parts if name not in found), *damaged)
    return Tables(
        rows.drop_columns(list(_NESTED)),
        _unnested(rows, "numbers", NUMBER),
        _effect_rows(rows),
        tuple(missing),
    )


def write_tables(out: Place, tables: dict[str, pa.Table], say: Callable[[str], None]) -> None:
    """Write each table as `NAME.parquet`."""
    for name, table in tables.items():
        place = out / f"{name}.parquet"
        place.write(table_bytes(table))
        say(f"written: {place.url}")


def _unnested(rows: pa.Table, column: str, kind: pa.StructType) -> pa.Table:
    """A row for each entry of a column of lists, with the keys of its set."""
    chunked = rows[column].combine_chunks()
    lists = chunked if not isinstance(chunked, pa.ChunkedArray) else pa.concat_arrays(chunked.chunks)
    parents = lists.value_parent_indices()
    keys = rows.select(list(_KEYS)).take(parents)
    entries = lists.flatten()
    columns: dict[str, Any] = {name: keys[name] for name in _KEYS}
    columns |= {kind.field(k).name: entries.field(k) for k in range(kind.num_fields)}
    return pa.table(columns)


def _effect_rows(rows: pa.Table) -> pa.Table:
    """A row for each parameter of each effect."""
    effects = _unnested(rows, "effects", EFFECT)
    lists = pa.concat_arrays(effects["parameters"].chunks) if effects["parameters"].num_chunks else None
    plain = effects.drop_columns(["parameters"])
    kind = EFFECT.field("parameters").type.value_type
    if lists is None:
        names = [f"parameter_{kind.field(k).name}" for k in range(kind.num_fields)]
        for k, name in enumerate(names):
            plain = plain.append_column(_of_parameter(name), pa.array([], kind.field(k).type))
        return plain
    out = plain.take(lists.value_parent_indices())
    entries = lists.flatten()
    for k in range(kind.num_fields):
        out = out.append_column(_of_parameter(kind.field(k).name), entries.field(k))
    return out


def _of_parameter(name: str) -> str:
    return "parameter" if name.endswith("name") else name.removeprefix("parameter_")
