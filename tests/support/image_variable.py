"""Where a variable's member lies in the board's memory, from the image's debug information."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from elftools.dwarf.die import DIE
from elftools.elf.elffile import ELFFile


@cache  # reading the image's debug information takes a quarter of a second
def member_offset(image: Path, variable: str, *members: str) -> tuple[int, int]:
    """Offset of `variable.a.b.c` from the variable's address, and the size of that member, bytes."""
    with image.open("rb") as file:
        dwarf = ELFFile(file).get_dwarf_info()
        for unit in dwarf.iter_CUs():
            for die in unit.iter_DIEs():
                if die.tag == "DW_TAG_variable" and _name(die) == variable and "DW_AT_type" in die.attributes:
                    return _walk(die.get_DIE_from_attribute("DW_AT_type"), members)
    raise LookupError(f"the image has no variable {variable}")


def _walk(kind: DIE, members: tuple[str, ...]) -> tuple[int, int]:
    offset = 0
    for member in members:
        kind = _element(_plain(kind))
        child = next(child for child in kind.iter_children() if _name(child) == member)
        offset += child.attributes["DW_AT_data_member_location"].value
        kind = child.get_DIE_from_attribute("DW_AT_type")
    return offset, _size(_plain(kind))


def _plain(kind: DIE) -> DIE:
    while kind.tag in ("DW_TAG_typedef", "DW_TAG_const_type", "DW_TAG_volatile_type"):
        kind = kind.get_DIE_from_attribute("DW_AT_type")
    return kind


def _element(kind: DIE) -> DIE:
    """An array's first element, which lies where the array does; others as they are."""
    return _plain(kind.get_DIE_from_attribute("DW_AT_type")) if kind.tag == "DW_TAG_array_type" else kind


def _size(kind: DIE) -> int:
    if kind.tag != "DW_TAG_array_type":
        return int(kind.attributes["DW_AT_byte_size"].value)
    count = 1
    for dimension in kind.iter_children():
        count *= dimension.attributes["DW_AT_upper_bound"].value + 1
    return count * _size(_plain(kind.get_DIE_from_attribute("DW_AT_type")))


def _name(die: DIE) -> str:
    attribute = die.attributes.get("DW_AT_name")
    return attribute.value.decode() if attribute else ""
