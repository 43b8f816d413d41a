"""Pages of the repository outside docs/ in the site, and links between all of them."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[3]
# Folders of the repository that hold pages, in the order of the navigation.
FOLDERS = ("firmware", "protocol", "hil_sim", "host", "tests")
COPIES = "repository"
HOME = "index.md"
# Files whose contents the site shows as generated pages: a link to the file leads to its page.
SHOWN = {
    "host/truing/cli/__init__.py": "reference/commands/index.md",
    "host/truing/diagnose/catalogue.py": "reference/effects/index.md",
    "host/truing/api/__init__.py": "reference/python-api.md",
    "host/truing/errors.py": "reference/messages.md",
}
_COMMAND = re.compile(r"host/truing/cli/([a-z]+)_?\.py")
_EFFECT = re.compile(r"host/truing/diagnose/effects/([a-z]\w+)\.py")
# Long tables of results, which would come first in every search.
_TABLES = re.compile(r"(RESULTS\w*|BUDGETS|MISRA|REAL)\.md$")
_LINK = re.compile(r"(\]\()([^)\s#]+)((?:#[^)\s]*)?\))")
_NAMED = re.compile(r"(?<![\[`])`((?:[\w.-]+/)*[\w.-]+\.md)`(?!\])")
_FENCE = re.compile(r"(^```.*?^```\s*?$)", re.MULTILINE | re.DOTALL)


def copied_pages() -> list[str]:
    """Pages outside docs/ that the site shows, relative to the root."""
    found = [path.relative_to(ROOT).as_posix() for top in FOLDERS for path in (ROOT / top).rglob("*.md")]
    return ["README.md", *sorted(found, key=_order)]


def _order(page: str) -> tuple[int, str, bool, str]:
    folder, _, name = page.rpartition("/")
    return FOLDERS.index(page.split("/")[0]), folder, name != "README.md", name


def navigation() -> list[object]:
    """The pages outside docs/ by their top folder, each folder's README first."""
    pages = [path for path in copied_pages() if place(path) != HOME]
    return [
        {top: [{_label(path): place(path)} for path in pages if path.startswith(f"{top}/")]}
        for top in FOLDERS
    ]


def _label(path: str) -> str:
    folder, _, name = path.removesuffix(".md").removeprefix("host/truing/").rpartition("/")
    return folder if name == "README" else f"{folder}: {name}"


def place(path: str) -> str:
    """Where a file of the repository stands in the site."""
    if path == "README.md":
        return HOME
    if path in SHOWN:
        return SHOWN[path]
    for pattern, folder in ((_COMMAND, "commands"), (_EFFECT, "effects")):
        match = pattern.fullmatch(path)
        if match:
            return f"reference/{folder}/{match.group(1)}.md"
    return path.removeprefix("docs/") if path.startswith("docs/") else f"{COPIES}/{path}"


def origin(page: str) -> str:
    """The file of the repository that a page of the site shows; generated pages count as pages of docs/."""
    if page == HOME:
        return "README.md"
    return page.removeprefix(f"{COPIES}/") if page.startswith(f"{COPIES}/") else f"docs/{page}"


def copied(path: str) -> str:
    """The text of a page outside docs/, with what the search is to make of it."""
    text = (ROOT / path).read_text(encoding="utf-8")
    if place(path) == HOME:
        return text
    return f"---\nsearch:\n  {'exclude: true' if _TABLES.search(path) else 'boost: 0.3'}\n---\n{text}"


def linked(markdown: str, page: str, pages: set[str], needed: Callable[[str], None]) -> str:
    """A page's text with its links as they hold in the site.

    Parameters
    ----------
    page : where the text stands in the site.
    pages : the site's pages.
    needed : called with each file of the repository, not a page, that the text links to from outside docs/.
    """
    here = PurePosixPath(origin(page)).parent
    start = posixpath.dirname(page) or "."

    def of_link(match: re.Match[str]) -> str:
        target = match.group(2)
        if re.match(r"\w+:", target):
            return match.group()
        path = posixpath.normpath(str(here / target))
        if not (ROOT / path).is_file():
            return match.group()
        if place(path) == f"{COPIES}/{path}" and not path.endswith(".md"):
            needed(path)
        return match.group(1) + posixpath.relpath(place(path), start) + match.group(3)

    def of_name(match: re.Match[str]) -> str:
        for path in (posixpath.normpath(match.group(1)), posixpath.normpath(str(here / match.group(1)))):
            if (ROOT / path).is_file() and place(path) in pages and place(path) != page:
                return f"[`{match.group(1)}`]({posixpath.relpath(place(path), start)})"
        return match.group()

    parts = _FENCE.split(markdown)
    for number in range(0, len(parts), 2):
        parts[number] = _NAMED.sub(of_name, _LINK.sub(of_link, parts[number]))
    return "".join(parts)
