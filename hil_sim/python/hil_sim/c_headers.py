"""The C headers of the native libraries as ctypes needs them: constants, structs and functions.

Reads the form that this project's public headers have: enums, flat structs and prototypes, no typedefs, no
macros but ``#define NAME NUMBER``. A struct with function pointers is left out, and so is one that holds it.
"""

from __future__ import annotations

import ctypes
import re
from pathlib import Path
from typing import Any

_BASIC: dict[str, Any] = {
    "void": None,
    "bool": ctypes.c_bool,
    "char": ctypes.c_char,
    "int": ctypes.c_int,
    "unsigned": ctypes.c_uint,
    "float": ctypes.c_float,
    "double": ctypes.c_double,
    "size_t": ctypes.c_size_t,
    **{f"int{bits}_t": getattr(ctypes, f"c_int{bits}") for bits in (8, 16, 32, 64)},
    **{f"uint{bits}_t": getattr(ctypes, f"c_uint{bits}") for bits in (8, 16, 32, 64)},
}
_LEFT_OUT = re.compile(r"/\*.*?\*/|#ifdef __cplusplus.*?#endif", re.DOTALL)
_INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)
_DEFINE = re.compile(r"^#define (\w+) (\d+)$", re.MULTILINE)
_DIRECTIVE = re.compile(r"^\s*#.*$", re.MULTILINE)
_STATEMENT = re.compile(r"\s*([^;{}]*)(?:\{([^{}]*)\})?\s*;")
_DECLARATOR = re.compile(r"(\w+)((?:\[\w+\])*)$")


class Headers:
    """What some headers, and those they include, declare.

    Parameters
    ----------
    paths : the headers.

    Attributes
    ----------
    constants : enumerators and numbers that are defined, by name.
    structs : ctypes structures, by tag.
    functions : result and argument types of ctypes, by name.

    Raises
    ------
    ValueError : a declaration of another form.
    """

    def __init__(self, *paths: Path) -> None:
        self.constants: dict[str, int] = {}
        self.structs: dict[str, type[ctypes.Structure]] = {}
        self.functions: dict[str, tuple[Any, list[Any]]] = {}
        self._read: set[Path] = set()
        for path in paths:
            self._take(path.resolve())

    def _take(self, path: Path) -> None:
        if path in self._read:
            return
        self._read.add(path)
        text = _LEFT_OUT.sub("", path.read_text(encoding="utf-8"))
        for name in _INCLUDE.findall(text):
            self._take((path.parent / name).resolve())
        self.constants.update((name, int(value)) for name, value in _DEFINE.findall(text))
        text = _DIRECTIVE.sub("", text)
        end = 0
        for match in _STATEMENT.finditer(text):
            if match.start() != end:
                break
            end = match.end()
            self._declare(match[1].strip(), match[2])
        if text[end:].strip():
            raise ValueError(f"{path}: cannot read {text[end:].strip()[:60]!r}")

    def _declare(self, head: str, body: str | None) -> None:
        if body is None:
            if "(" in head:
                self._function(head)
        elif head.startswith("enum"):
            self._enum(body)
        else:
            self._struct(head.removeprefix("struct "), body)

    def _enum(self, body: str) -> None:
        value = -1
        for each in filter(None, map(str.strip, body.split(","))):
            name, _, number = (part.strip() for part in each.partition("="))
            value = self._number(number) if number else value + 1
            self.constants[name] = value

    def _struct(self, tag: str, body: str) -> None:
        fields: list[tuple[str, Any]] = []
        for line in filter(None, map(str.strip, body.split(";"))):
            if "(" in line:
                return
            first, *others = (part.strip() for part in line.split(","))
            words, _, declarator = first.rpartition(" ")
            for each in (declarator, *others):
                kind = self._type(words + (" *" if each.startswith("*") else ""))
                if kind is None:
                    return
                fields.append(self._field(kind, each.lstrip("*")))
        self.structs[tag] = type(tag, (ctypes.Structure,), {"_fields_": fields})

    def _field(self, kind: Any, declarator: str) -> tuple[str, Any]:
        match = _DECLARATOR.match(declarator)
        if match is None:
            raise ValueError(f"cannot read the field {declarator!r}")
        for size in reversed(re.findall(r"\w+", match[2])):
            kind = kind * self._number(size)
        return match[1], kind

    def _function(self, head: str) -> None:
        before, _, arguments = head.removesuffix(")").partition("(")
        result, name = re.split(r"\b(?=\w+$)", before)
        kinds = [] if arguments == "void" else [self._argument(each) for each in arguments.split(",")]
        self.functions[name] = (self._type(result), kinds)

    def _argument(self, text: str) -> Any:
        if "(*" in text or "[" in text:
            return ctypes.c_void_p
        words = text.strip()
        return self._type(words.rpartition("*")[0] + "*" if "*" in words else words.rpartition(" ")[0])

    def _type(self, text: str) -> Any:
        """The ctypes type; None for void, and for a struct that was left out."""
        words = text.replace("*", " * ").split()
        if "*" in words:
            return ctypes.c_char_p if words == ["const", "char", "*"] else ctypes.c_void_p
        words = [word for word in words if word != "const"]
        if words[0] == "enum":
            return ctypes.c_int
        if words[0] == "struct":
            return self.structs.get(words[1])
        return _BASIC[words[0]]

    def _number(self, text: str) -> int:
        return self.constants[text] if text in self.constants else int(text, 0)
