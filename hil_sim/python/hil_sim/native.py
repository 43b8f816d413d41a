"""The native libraries: where the build puts them, and their C structs as this package's dataclasses.

Structs, functions and constants are read from the C headers (`c_headers`): none is written down twice.
"""

from __future__ import annotations

import ctypes
import dataclasses
import functools
import importlib.util
import typing
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from hil_sim.c_headers import Headers

# What a wheel carries (host/hatch_build.py puts it there); else the repository's sources and their build.
_PACKAGED = Path(__file__).resolve().parent / "built"
IS_PACKAGED = _PACKAGED.is_dir()
_SOURCES = _PACKAGED if IS_PACKAGED else Path(__file__).resolve().parents[2]
_BUILT = _PACKAGED if IS_PACKAGED else _SOURCES.parent / "build" / "host" / "hil_sim"

LIBRARY = _BUILT / "libhil_sim.so"
"""Virtual board, plant and rig."""

HOST_ROBOT_LIBRARY = _BUILT / "libhost_robot.so"
"""Firmware core, built for this machine, and plant."""

HEADERS = Headers(_SOURCES / "rig" / "can_bus.h", _SOURCES / "host_robot" / "host_robot.h")

T = TypeVar("T")
_structs: dict[type[Any], type[ctypes.Structure]] = {}
_hints: dict[type[Any], dict[str, Any]] = {}


@functools.cache
def load(path: Path = LIBRARY) -> ctypes.CDLL:
    """Return a library with its functions declared.

    Raises
    ------
    OSError : the library is not built or cannot be loaded.
    """
    if IS_PACKAGED and path == LIBRARY:
        _load_unicorn()
    library = ctypes.CDLL(str(path))
    for name, (result, arguments) in HEADERS.functions.items():
        if hasattr(library, name):
            function = getattr(library, name)
            function.restype = result
            function.argtypes = arguments
    return library


def _load_unicorn() -> None:
    """Load the CPU engine out of the package `unicorn`, wherever that lies.

    A wheel's library does not know the place; the loader takes one of the same name that is there already.
    """
    package = importlib.util.find_spec("unicorn")
    if package is None or package.origin is None:
        raise OSError("the package unicorn is not installed")
    ctypes.CDLL(str(Path(package.origin).parent / "lib" / "libunicorn.so.2"))


def mirror(struct: str) -> Callable[[type[T]], type[T]]:
    """Declare a dataclass, and those within it, to be a C struct: the same names in the same order.

    Raises
    ------
    TypeError : it is not.
    """

    def register(kind: type[T]) -> type[T]:
        _register(kind, HEADERS.structs[struct])
        return kind

    return register


def _register(kind: type[Any], struct: type[ctypes.Structure]) -> None:
    there = [field.name for field in dataclasses.fields(kind)]
    wanted = [str(field[0]) for field in struct._fields_]
    if there != wanted:
        raise TypeError(f"{kind.__name__} has the fields {there}, struct {struct.__name__} has {wanted}")
    _structs[kind] = struct
    _hints[kind] = typing.get_type_hints(kind)
    inner: dict[str, Any] = {str(field[0]): field[1] for field in struct._fields_}
    for name, hint in _hints[kind].items():
        if dataclasses.is_dataclass(hint):
            assert isinstance(hint, type)
            _register(hint, inner[name])


def new(kind: type[Any]) -> ctypes.Structure:
    """Return the empty C struct of a dataclass, to be passed by reference."""
    return _structs[kind]()


def to_struct(values: Any) -> ctypes.Structure:
    """Return a dataclass' values as its C struct, to be passed by reference."""
    struct = new(type(values))
    fill(struct, values)
    return struct


def fill(struct: ctypes.Structure, values: Any) -> None:
    """Set a C struct to a dataclass' values."""
    for field in dataclasses.fields(values):
        value = getattr(values, field.name)
        if dataclasses.is_dataclass(value):
            fill(getattr(struct, field.name), value)
        elif isinstance(value, tuple):
            getattr(struct, field.name)[:] = value
        else:
            setattr(struct, field.name, value)


def from_struct(kind: type[T], struct: ctypes.Structure) -> T:
    """Return a C struct's values as a dataclass; arrays are tuples."""
    values: dict[str, Any] = {}
    for name, hint in _hints[kind].items():
        value = getattr(struct, name)
        if isinstance(value, ctypes.Structure):
            value = from_struct(hint, value)
        elif isinstance(value, ctypes.Array):
            value = tuple(value)
        values[name] = value
    return kind(**values)
