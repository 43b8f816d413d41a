"""Programs named openocd, st-flash and st-info that see a chip whose flash is a file.

OpenOCD itself runs, with its commands that need a chip replaced: what truing hands it is parsed as ever.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

FLASH = 0x0800_0000
SECTORS = [16, 16, 16, 16, 64] + [128] * 7  # KiB, RM0090 table 5

_OPENOCD = """#!/bin/sh
test "$1 $2 $3 $4" = "-f interface/stlink.cfg -f target/stm32f4x.cfg" || exit 9
shift 4
exec {openocd} -c "gdb_port disabled; telnet_port disabled; tcl_port disabled" -f {folder}/chip.tcl "$@"
"""
_TCL = """
proc init {{}} {{}}
proc reset {{how}} {{ echo "reset $how" }}
proc mrw {{address}} {{
    if {{$address == 0x40023C14}} {{ return 0x[exec {python} {me} {folder} option {folder} read] }}
    expr {{$address == 0xE0042000 ? 0x10016000 | {device_id} : 0}}
}}
proc mww {{address value}} {{ exec {python} {me} {folder} option $address $value }}
proc sleep {{ms}} {{}}
proc mrh {{address}} {{ expr {{$address == 0x1FFF7A22 ? {flash_kib} : 0}} }}
proc flash {{write_image erase path address bin}} {{ exec {python} {me} {folder} write $path $address }}
proc dump_image {{path address size}} {{ exec {python} {me} {folder} read $path $address $size }}
"""
_ST_FLASH = """#!/bin/sh
test "$1" = reset && exit 0
if test "$1" = --area=option; then
    test "$2" = read && echo "INFO common.c: STM32F4x5_F4x7"
    test "$2" = read && exec {python} {me} {folder} option {folder} read
    for word in 0x08192A3B 0x4C5D6E7F; do {python} {me} {folder} option 0x40023C08 $word || exit 1; done
    exec {python} {me} {folder} option 0x40023C14 $(printf '0x%08x' $(($3 | 2)))
fi
exec {python} {me} {folder} "$@"
"""
_ST_INFO = """#!/bin/sh
echo "Found 1 stlink programmers
  version:    V2J37S7
  flash:      {flash_bytes} (pagesize: 16384)
  sram:       196608
  chipid:     {device_id}
  dev-type:   whatever"
"""


def install(
    folder: Path, device_id: int = 0x413, flash_kib: int = 1024, option_bytes: int = 0x0FFF_AAEC
) -> Path:
    """Put the programs into `folder`; returns the file that is the chip's flash."""
    openocd = shutil.which("openocd")
    assert openocd is not None
    values = {
        "openocd": openocd,
        "folder": folder,
        "python": sys.executable,
        "me": Path(__file__).resolve(),
        "device_id": f"0x{device_id:03x}",
        "flash_kib": flash_kib,
        "flash_bytes": flash_kib * 1024,
    }
    (folder / "chip.tcl").write_text(_TCL.format(**values))
    for name, text in (("openocd", _OPENOCD), ("st-flash", _ST_FLASH), ("st-info", _ST_INFO)):
        program = folder / name
        program.write_text(text.format(**values))
        program.chmod(0o755)
    flash = folder / "flash.bin"
    flash.write_bytes(b"\xff" * (1 << 20))
    set_option_bytes(folder, option_bytes)
    return flash


def set_option_bytes(folder: Path, value: int) -> None:
    """What FLASH_OPTCR holds from now on, locked."""
    (folder / "options").write_text(f"{value | 1:08x} 0")


def option_bytes(folder: Path) -> int:
    """The option bytes that the chip has stored, as FLASH_OPTCR."""
    return int((folder / "options").read_text().split()[0], 16) & ~3


def _option_register(folder: Path, address: str, value: str) -> None:
    """FLASH_OPTKEYR and FLASH_OPTCR (RM0090 3.9.3, 3.9.10): two keys unlock, OPTSTRT stores."""
    stored, keys = (folder / "options").read_text().split()
    if value == "read":
        print(stored)
        return
    written, seen = int(value, 0), int(keys)
    if int(address, 0) == 0x4002_3C08:
        seen = seen + 1 if written == (0x0819_2A3B, 0x4C5D_6E7F)[seen] else 9
    elif seen == 2 and written & 2:
        stored = f"{written & 0x0FFFFFEC | 1:08x}"
    elif written & 1:
        seen = 0
    (folder / "options").write_text(f"{stored} {seen}")


def _main() -> None:
    if sys.argv[2] == "option":
        _option_register(Path(sys.argv[1]), sys.argv[3], sys.argv[4])
        return
    folder, what, path, address, *size = sys.argv[1:]
    file = Path(folder) / "flash.bin"
    flash = bytearray(file.read_bytes())
    at = int(address, 0) - FLASH
    if what == "read":
        Path(path).write_bytes(flash[at : at + int(size[0], 0)])
        return
    data = Path(path).read_bytes()
    begin = 0
    for kib in SECTORS:
        if begin < at + len(data) and at < begin + 1024 * kib:
            flash[begin : begin + 1024 * kib] = b"\xff" * (1024 * kib)
        begin += 1024 * kib
    flash[at : at + len(data)] = data
    file.write_bytes(flash)


if __name__ == "__main__":
    _main()
