"""Small XML files, indented, with notes for their readers at the top."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

from truing.recording.writer import replace_file


def number(value: float) -> str:
    """The shortest text that reads back as the same number."""
    return repr(float(value))


def numbers(*values: float) -> str:
    """Several numbers, separated by blanks."""
    return " ".join(number(value) for value in values)


def child(parent: Xml.Element, tag: str, text: str | None = None, **attributes: str) -> Xml.Element:
    """Add an element; attributes that Python keeps for itself end in an underscore."""
    element = Xml.SubElement(parent, tag, {name.rstrip("_"): value for name, value in attributes.items()})
    element.text = text
    return element


def write_xml(root: Xml.Element, path: Path, notes: tuple[str, ...] = ()) -> None:
    """Write a document with one comment per note above its root."""
    Xml.indent(root, "  ")
    # Two hyphens end a comment.
    comments = "".join(f"<!-- {note.replace('--', '- -')} -->\n" for note in notes)
    text = f'<?xml version="1.0" encoding="UTF-8"?>\n{comments}{Xml.tostring(root, encoding="unicode")}\n'
    replace_file(path, text.encode())
