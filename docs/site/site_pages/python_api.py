"""The page of the Python interface, from the docstrings of the verbs of `import truing`."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Callable
from typing import Any

import truing.errors
from site_pages.markdown import block, code, escaped, page, table
from truing import api

PATH = "reference/python-api.md"
VERBS = ("read", "identify", "fit", "simulate", "diagnose", "export")
_SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}\n", re.MULTILINE)


def pages() -> dict[str, str]:
    """The one page."""
    parts = []
    for name in VERBS:
        parts += [f"## truing.{name}", *_verb(getattr(api, name))]
    return {
        PATH: page(
            "# Python API",
            "The verbs of `import truing`, from their docstrings. "
            "[From Python](../PYTHON.md) shows them in use.",
            *parts,
            "## Errors",
            "Every mistake of a user's is a `truing.errors.TruingError`: `message` says what went wrong, "
            "`next_step` what to do. The command line ends with `exit_code`.",
            _errors(),
        )
    }


def _verb(function: Callable[..., Any]) -> list[str]:
    """Signature, summary and sections of one function."""
    opening, *sections = _SECTION.split(inspect.getdoc(function) or "")
    parts = [block(_signature(function), "python"), *(escaped(each) for each in opening.split("\n\n"))]
    for title, body in zip(sections[::2], sections[1::2], strict=True):
        parts += [f"### {title} of {function.__name__}", _section(title, body.strip())]
    return parts


def _signature(function: Callable[..., Any]) -> str:
    """The definition's first lines as they stand in the file."""
    source = textwrap.dedent(inspect.getsource(function))
    (definition,) = ast.parse(source).body
    assert isinstance(definition, ast.FunctionDef)
    return "\n".join(source.split("\n")[: definition.body[0].lineno - 1])


def _section(title: str, body: str) -> str:
    if title == "Examples":
        return block(body, "pycon")
    rows = []
    for item in re.split(r"\n(?=\S)", body):
        head, _, rest = item.partition(" : ")
        if not rest:
            head, _, rest = item.partition("\n")
        rows.append((", ".join(code(name.strip()) for name in head.split(",")), escaped(rest) or "–"))
    return table(("name" if title == "Parameters" else "type", "meaning"), rows)


def _errors() -> str:
    found = [
        value
        for _, value in inspect.getmembers(truing.errors, inspect.isclass)
        if issubclass(value, truing.errors.TruingError)
    ]
    found.sort(key=lambda kind: inspect.getsourcelines(kind)[1])
    rows = [
        (code(kind.__name__), escaped((inspect.getdoc(kind) or "").split("\n\n")[0]), str(kind.exit_code))
        for kind in found
    ]
    return table(("error", "meaning", "exit status"), rows)
