#!/usr/bin/env python3
"""Write everything that follows from schema.toml: `python3 protocol/generate.py`; `--check` only compares."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from generator import c_code, dbc, python_code, spec_tables, vectors  # noqa: E402
from generator.schema import SchemaError, load  # noqa: E402


def outputs() -> dict[Path, str]:
    """Every generated file and the text it should hold."""
    schema = load(HERE / "schema.toml")
    samples = vectors.vectors(schema)
    package = HERE / "python" / "truing_protocol"
    spec = HERE / "SPEC.md"
    return {
        HERE / "c" / "proto.h": c_code.header(schema),
        HERE / "c" / "proto.c": c_code.source(schema),
        package / "__init__.py": python_code.package_init(),
        package / "enums.py": python_code.enums(schema),
        package / "messages.py": python_code.messages(schema),
        package / "tables.py": python_code.tables(schema),
        package / "py.typed": "",
        HERE / "vectors" / "vectors.json": vectors.as_json(samples),
        HERE / "vectors" / "vectors.h": vectors.as_c_header(samples),
        HERE / "truing.dbc": dbc.dbc(schema),
        spec: spec_tables.spec(schema, spec.read_text(encoding="utf-8")),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 when a file is stale")
    arguments = parser.parse_args()
    try:
        wanted = outputs()
    except SchemaError as error:
        print(f"schema.toml: {error}", file=sys.stderr)
        return 2
    stale = [
        path for path, text in wanted.items() if not path.exists() or path.read_text(encoding="utf-8") != text
    ]
    for path in stale:
        if arguments.check:
            print(
                f"{path.relative_to(HERE.parent)} is stale: run python3 protocol/generate.py", file=sys.stderr
            )
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(wanted[path], encoding="utf-8")
            print(f"wrote {path.relative_to(HERE.parent)}")
    return 1 if stale and arguments.check else 0


if __name__ == "__main__":
    sys.exit(main())
