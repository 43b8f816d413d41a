"""Transcripts in the documents: their commands, and whether what a command prints is what the page shows.

Pages show real output in ```console blocks: a command after `$ `, then what it prints; `...` stands for
any text. Output is compared token by token, so that a line may be wrapped elsewhere: words must be equal,
numbers agree to a quarter of their size (or `SMALL`). A page stays true when an estimate moves within its
uncertainty.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

RELATIVE, SMALL = 0.25, 0.015
ELLIPSIS = "..."
TOKEN = re.compile(r"\.\.\.|\d+(?:\.\d+)?|[^\s\d.,;:()]+|[.,;:()]")
# What draws a table says nothing.
RULES = re.compile(r"[─━┏┓┡┩└┘┴┳╇│┃]+")


@dataclass(frozen=True)
class Command:
    """One command of a page, and the output that the page shows."""

    page: str
    line: int
    text: str
    shown: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}: {self.text}"


def commands(page: Path) -> list[Command]:
    """The commands of all ```console blocks of a page, in order."""
    found: list[Command] = []
    lines = page.read_text(encoding="utf-8").splitlines()
    inside = False
    for number, line in enumerate(lines, 1):
        if line.startswith("```"):
            inside = line == "```console"
        elif inside and line.startswith("$ "):
            found.append(Command(page.name, number, line[2:], ""))
        elif inside:
            last = found[-1]
            found[-1] = Command(last.page, last.line, last.text, last.shown + line + "\n")
    return found


def files(page: Path) -> dict[str, str]:
    """Files that a page shows whole: a code block after a line that ends in "`NAME`:"."""
    text = page.read_text(encoding="utf-8")
    return dict(re.findall(r"`([\w./]+)`:\n\n```(?:python|toml)\n(.*?)```", text, re.S))


def difference(shown: str, printed: str) -> str | None:
    """What of the page's output is not in what was printed; None where they agree."""
    have = _tokens(printed)
    chunks: list[list[str]] = [[]]
    for token in _tokens(shown):
        if token == ELLIPSIS:
            chunks.append([])
        else:
            chunks[-1].append(token)
    at = 0
    for number, chunk in enumerate(chunks):
        first, last = number == 0, number == len(chunks) - 1
        if last and chunk and not first:
            at = max(at, len(have) - len(chunk))
        end = at if first or last else len(have) - len(chunk)
        place = next((i for i in range(at, end + 1) if _agree(chunk, have[i : i + len(chunk)])), None)
        if place is None:
            return f"not printed (after {' '.join(have[:at][-8:])!r}): {' '.join(chunk)!r}"
        at = place + len(chunk)
    if (chunks[-1] or len(chunks) == 1) and at != len(have):
        return f"printed, and not on the page: {' '.join(have[at:])!r}"
    return None


def _tokens(text: str) -> list[str]:
    return TOKEN.findall(RULES.sub(" ", text))


def _agree(shown: list[str], printed: list[str]) -> bool:
    return len(shown) == len(printed) and all(map(_same, shown, printed))


def _same(shown: str, printed: str) -> bool:
    if shown == printed:
        return True
    try:
        a, b = float(shown), float(printed)
    except ValueError:
        return False
    return abs(a - b) <= max(RELATIVE * max(a, b), SMALL)
