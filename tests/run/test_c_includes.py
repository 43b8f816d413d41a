"""C files include only what their folder may know, and the check says where one does not."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TOP_FOLDERS = ("firmware", "hil_sim", "protocol")


def check(root: Path, tree: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, root / "tests" / "c_includes.py", tree]
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


@pytest.fixture
def tree(root: Path, tmp_path: Path) -> Path:
    """A copy of every C file."""
    for top in TOP_FOLDERS:
        for file in (root / top).rglob("*.[ch]"):
            copy = tmp_path / file.relative_to(root)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, copy)
    return tmp_path


def test_every_include_keeps_the_rules(root: Path) -> None:
    done = check(root, root)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("file", "header", "named"),
    [
        ("hil_sim/board/rcc.c", '"hal.h"', "hil_sim/board may not include firmware/hal/hal.h"),
        ("hil_sim/board/usart.c", '"controller.h"', "may not include firmware/core/controller.h"),
        ("hil_sim/plant/motor.c", '"../board/board.h"', "may not include hil_sim/board/board.h"),
        ("hil_sim/plant/plant.h", '"proto.h"', "hil_sim/plant may not include protocol/c/proto.h"),
        ("firmware/core/robot.c", '"cortex.h"', "may not include firmware/stm32/cortex.h"),
        ("firmware/core/drive.c", '"hal_host.h"', "may not include firmware/hal/host/hal_host.h"),
        ("firmware/core/log.c", '"plant.h"', "firmware/core may not include hil_sim/plant/plant.h"),
        ("firmware/stm32/main.c", '"robot.h"', "may not include firmware/core/robot.h"),
        ("firmware/hal/hal.h", '"proto.h"', "firmware/hal may not include protocol/c/proto.h"),
        ("protocol/c/proto.c", '"crc32.h"', "protocol/c may not include firmware/core/crc32.h"),
        ("hil_sim/rig/rig.c", '"../board/machine.h"', "may not include hil_sim/board/machine.h"),
        ("firmware/core/frame.c", "<unistd.h>", "<unistd.h> is not of the C standard library"),
        ("firmware/core/crc32.c", '"nowhere.h"', 'there is no header "nowhere.h"'),
        ("firmware/core/crc32.h", '"frame.h"', "a circle of includes: crc32 -> frame -> crc32"),
    ],
)
def test_a_forbidden_include_is_named_with_its_line(
    root: Path, tree: Path, file: str, header: str, named: str
) -> None:
    path = tree / file
    text = path.read_text()
    line = text.count("\n") + 1
    path.write_text(f"{text}#include {header}\n")
    done = check(root, tree)
    assert done.returncode == 1
    assert named in done.stdout
    assert f"{file}:{line}:" in done.stdout or "circle" in named
    assert len(done.stdout.splitlines()) == 1, done.stdout


def test_a_new_folder_of_c_needs_rules_of_its_own(root: Path, tree: Path) -> None:
    (tree / "firmware" / "bootloader").mkdir()
    (tree / "firmware" / "bootloader" / "main.c").write_text('#include "hal.h"\n')
    done = check(root, tree)
    assert done.returncode == 1
    assert "firmware/bootloader has no line in the table" in done.stdout
