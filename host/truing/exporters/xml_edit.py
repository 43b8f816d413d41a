"""Changes to a user's XML file that leave all else in it as it stands: comments, order, white space."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from truing.errors import FileError


def short(*values: float) -> str:
    """Numbers for a person's file: six digits each, far below what recordings tell."""
    return " ".join(f"{value:.6g}" for value in values)


@dataclass(eq=False, slots=True)
class Node:
    """One element: its name and attributes, and where it stands in the file, in bytes.

    Attributes
    ----------
    start, tag_end : of the start tag, "<" and behind ">".
    text_end : where the end tag begins; `tag_end` for an element without content.
    """

    tag: str
    attributes: dict[str, str]
    parent: Node | None
    start: int
    tag_end: int = 0
    text_end: int = 0
    children: list[Node] = field(default_factory=list)

    def walk(self) -> Iterator[Node]:
        """The element and all below it, in the file's order."""
        yield self
        for child in self.children:
            yield from child.walk()

    def find(self, *tags: str) -> Node | None:
        """The first child of that name, its first child of the next name, and so on."""
        node: Node | None = self
        for tag in tags:
            node = None if node is None else next((c for c in node.children if c.tag == tag), None)
        return node


class XmlEdit:
    """A file's elements, and edits that are put into its text in the end."""

    def __init__(self, path: Path) -> None:
        try:
            self.source = path.read_bytes()
        except OSError as error:
            raise FileError(path, f"cannot be read: {error.strerror}") from None
        self._edits: list[tuple[int, int, bytes]] = []
        self.root = self._parsed(path)

    def text(self, node: Node) -> str:
        """What stands between start and end tag."""
        return self.source[node.tag_end : node.text_end].decode("utf-8").strip()

    def set_attribute(self, node: Node, name: str, value: str) -> None:
        """Give an attribute another value, or add it behind the others."""
        tag = self.source[node.start : node.tag_end]
        found = re.search(rb"\s" + name.encode() + rb"\s*=\s*(\"[^\"]*\"|'[^']*')", tag)
        if found is not None:
            start, end = (node.start + position for position in found.span(1))
            self._edits.append((start + 1, end - 1, value.encode()))
            return
        end = node.tag_end - (2 if tag.endswith(b"/>") else 1)
        while self.source[end - 1 : end].isspace():
            end -= 1
        self._edits.append((end, end, f' {name}="{value}"'.encode()))

    def remove_attribute(self, node: Node, name: str) -> None:
        """Take an attribute away, if it is there."""
        tag = self.source[node.start : node.tag_end]
        found = re.search(rb"\s+" + name.encode() + rb"\s*=\s*(\"[^\"]*\"|'[^']*')", tag)
        if found is not None:
            self._edits.append((node.start + found.start(), node.start + found.end(), b""))

    def rename(self, node: Node, tag: str) -> None:
        """Give an element another name, at its end tag too."""
        size = len(node.tag.encode())
        self._edits.append((node.start + 1, node.start + 1 + size, tag.encode()))
        if not self.source[node.start : node.tag_end].endswith(b"/>"):
            self._edits.append((node.text_end + 2, node.text_end + 2 + size, tag.encode()))

    def set_text(self, node: Node, value: str) -> None:
        """Give an element without children another content."""
        self._edits.append((node.tag_end, node.text_end, value.encode()))

    def add_child(self, node: Node, xml: str) -> None:
        """Put an element in front of an element's content, on a line of its own."""
        line = self.source[: node.start].rpartition(b"\n")[2]
        indent = line[: len(line) - len(line.lstrip())].decode("utf-8")
        added = f"\n{indent}  {xml}"
        if self.source[node.start : node.tag_end].endswith(b"/>"):
            closed = f">{added}\n{indent}</{node.tag}>"
            self._edits.append((node.tag_end - 2, node.tag_end, closed.encode()))
        else:
            self._edits.append((node.tag_end, node.tag_end, added.encode()))

    def result(self) -> bytes:
        """The file with all edits."""
        parts, position = [], 0
        for start, end, replacement in sorted(self._edits, key=lambda edit: edit[0]):
            parts += [self.source[position:start], replacement]
            position = end
        return b"".join([*parts, self.source[position:]])

    def _parsed(self, path: Path) -> Node:
        parser = expat.ParserCreate()
        open_nodes: list[Node] = []
        roots: list[Node] = []

        def begin(tag: str, attributes: dict[str, str]) -> None:
            parent = open_nodes[-1] if open_nodes else None
            node = Node(tag, attributes, parent, parser.CurrentByteIndex)
            node.tag_end = _tag_end(self.source, node.start)
            (parent.children if parent else roots).append(node)
            open_nodes.append(node)

        def end(_: str) -> None:
            node = open_nodes.pop()
            # Of an element without content, expat gives the start tag's place, or that behind it.
            node.text_end = max(parser.CurrentByteIndex, node.tag_end)

        parser.StartElementHandler, parser.EndElementHandler = begin, end
        try:
            parser.Parse(self.source, True)
        except expat.ExpatError as error:
            raise FileError(path, f"is no XML: {error}") from None
        return roots[0]


def _tag_end(source: bytes, start: int) -> int:
    """Behind the ">" that ends the start tag; one inside quotes ends nothing."""
    quote = 0
    for position in range(start, len(source)):
        byte = source[position]
        if quote:
            quote = 0 if byte == quote else quote
        elif byte in b"\"'":
            quote = byte
        elif byte == ord(">"):
            return position + 1
    return len(source)
