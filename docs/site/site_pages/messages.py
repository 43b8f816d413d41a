"""The page of messages: what the code can raise, with its next step, read from the syntax trees."""

from __future__ import annotations

import ast
import functools
import inspect
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import truing
import truing.errors
from site_pages.markdown import escaped, page, table

PATH = "reference/messages.md"
PACKAGE = Path(truing.__file__).parent
VARIES = "…"
# Where a class takes its message, where another position than the first, and its next step right after it.
MESSAGE_AT = {
    **{
        name: 1
        for name, kind in vars(truing.errors).items()
        if inspect.isclass(kind) and issubclass(kind, truing.errors.FileError)
    },
    "Refused": 2,
    "BoardFault": 1,
    "Check": 1,
}
# A check's severity stands between its text and its next step.
STEP_AFTER = {"Check": 2}
_MAY_SAY = re.compile(
    "Check\\(|"
    + "|".join(rf"\b{name}\(" for name, kind in vars(truing.errors).items() if inspect.isclass(kind))
)
TITLES = {
    "recording": "Recordings and baselines",
    "importers": "Import of other programs' files",
    "identify": "Identification",
    "model": "Models",
    "diagnose": "Diagnosis, and checks of its data",
    "exporters": "Export",
    "api": "Python verbs",
    "cli": "Command line",
    "plan.py": "Run plans",
    "link": "The link to a board",
    "board": "Boards",
    "log": "Logs of a board",
    "clock": "A board's clock",
    "flash": "Flashing",
    "virtual": "Virtual boards",
    "report": "Reports and pictures",
    "web": "View in the browser",
    "trial": "Concealed trials",
    "workspace.py": "Builds and folders",
    "studies": "Papers and real recordings",
}


@dataclass(frozen=True, slots=True, order=True)
class Message:
    """One message that the code can give: its text, `…` for what varies; the next step; class and room."""

    text: str
    next_step: str
    kind: str
    room: str


def pages() -> dict[str, str]:
    """The one page, by the room of the host package that says it."""
    found = messages()
    parts = []
    for room in sorted({one.room for one in found}, key=_place):
        rows = [
            (escaped(one.text), escaped(one.next_step) or "–", f"`{one.kind}`")
            for one in found
            if one.room == room
        ]
        parts += [f"## {TITLES.get(room, room)}", table(("message", "next step", "kind"), rows)]
    return {
        PATH: page(
            "# All messages",
            f"The {len(found)} messages that stand in the code of the host package, with the next step "
            f"that is printed below them; `{VARIES}` stands for what varies: a file, a row, a number. "
            "[Troubleshooting](../TROUBLESHOOTING.md) explains the most frequent ones. A `Check` is a "
            "finding about the data that does not end the command; every other kind does.",
            *parts,
        )
    }


@functools.cache
def messages() -> tuple[Message, ...]:
    """Every message whose text stands in the code, sorted by text."""
    return tuple(sorted({message for path in PACKAGE.rglob("*.py") for message in _of_file(path)}))


def _place(room: str) -> tuple[int, str]:
    titles = list(TITLES)
    return (titles.index(room) if room in titles else len(titles), room)


def _of_file(path: Path) -> Iterator[Message]:
    source = path.read_text(encoding="utf-8")
    if not _MAY_SAY.search(source):
        return
    tree = ast.parse(source)
    room = path.relative_to(PACKAGE).parts[0]
    outside = _texts(tree.body)
    for scope in ast.walk(tree):
        if isinstance(scope, ast.FunctionDef):
            known = outside | _texts(list(ast.walk(scope)))
            for node in ast.walk(scope):
                if isinstance(node, ast.Call):
                    yield from _of_call(node, known, room)


def _texts(nodes: list[ast.AST] | list[ast.stmt]) -> dict[str, str]:
    """Names that are given a text, once."""
    texts: dict[str, str] = {}
    seen: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            name, text = node.targets[0].id, _text(node.value, texts)
            if name in seen:
                texts.pop(name, None)
            elif text:
                texts[name] = text
            seen.add(name)
    return texts


def _of_call(call: ast.Call, known: dict[str, str], room: str) -> Iterator[Message]:
    kind = call.func.id if isinstance(call.func, ast.Name) else ""
    error = getattr(truing.errors, kind, None) if kind else None
    if kind != "Check" and not (inspect.isclass(error) and issubclass(error, truing.errors.TruingError)):
        return
    at = MESSAGE_AT.get(kind, 0)
    if len(call.args) <= at:
        return
    text = _text(call.args[at], known)
    step_at = at + STEP_AFTER.get(kind, 1)
    step = call.args[step_at] if len(call.args) > step_at else None
    for keyword in call.keywords:
        if keyword.arg == "next_step":
            step = keyword.value
    if text and len(text.replace(VARIES, "").split()) > 1:
        yield Message(text, (_text(step, known) if step is not None else None) or "", kind, room)


def _joined(parts: Iterable[str | None]) -> str:
    """The parts in one, each stretch that is computed as one `…`."""
    return re.sub(f"{VARIES}+", VARIES, "".join(part or VARIES for part in parts))


def _text(node: ast.expr, known: dict[str, str]) -> str | None:
    """The text of an expression, with `…` for the parts that are computed; None where all of it is."""
    match node:
        case ast.Constant(value=str(value)):
            return value
        case ast.JoinedStr(values=values):
            return _joined(_text(value, known) for value in values)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            parts = [_text(part, known) for part in (left, right)]
            return _joined(parts) if any(parts) else None
        case ast.Name(id=name):
            return known.get(name)
    return None
