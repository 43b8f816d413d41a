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
proc mrw {{address}} {{ expr {{$address == 0xE0042000 ? 0x10016000 | {device_id} : 0}} }}
proc mrh {{address}} {{ expr {{$address == 0x1FFF7A22 ? {flash_kib} : 0}} }}
proc flash {{write_image erase path address bin}} {{ exec {python} {me} {folder} write $path $address }}
proc dump_image {{path address size}} {{ exec {python} {me} {folder} read $path $address $size }}
"""
_ST_FLASH = """#!/bin/sh
test "$1" = reset && exit 0
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


def install(folder: Path, device_id: int = 0x413, flash_kib: int = 1024) -> Path:
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
    return flash


def _main() -> None:
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
