"""Small pieces of Markdown: tables, code blocks, text that is not Markdown itself."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

_SPECIAL = re.compile(r"([\\*\[\]>|_])")


def escaped(text: str) -> str:
    """Plain text as Markdown that reads the same; what stands in backticks stays code, unescaped."""
    parts = re.split(r"(`[^`]+`)", " ".join(text.split()))
    return "".join(
        part if number % 2 else _SPECIAL.sub(r"\\\1", part).replace("<", "&lt;")
        for number, part in enumerate(parts)
    )


def code(text: str) -> str:
    """A code span."""
    return f"`{text}`"


def block(text: str, language: str = "text") -> str:
    """A code block."""
    return f"```{language}\n{text.rstrip()}\n```"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; its cells are Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def page(*parts: str) -> str:
    """The parts that are not empty, an empty line between them."""
    return "\n\n".join(part for part in parts if part) + "\n"


def sentence(text: str) -> str:
    """The text on one line, with a capital letter first and a full stop at its end."""
    text = " ".join(text.split())
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", ":", "?")) else ".")
