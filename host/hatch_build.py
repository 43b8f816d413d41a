"""Puts the virtual board and the firmware's image into the wheel, where they are built or can be built.

Without a compiler the wheel is one of plain Python, with the six verbs and without the virtual board; the
build says so. With it the wheel is one for this system (its C library's version or later) and any Python 3.
"""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

LIBRARIES = ("libhil_sim.so", "libhost_robot.so")
IMAGES = ("truing-f405.elf", "truing-f405.update")
# The rooms whose public headers hil_sim reads its structs from.
HEADERS = ("board", "plant", "rig", "host_robot")


class NotBuiltError(Exception):
    """A part of the wheel cannot be built here; says why."""


class CustomBuildHook(BuildHookInterface[Any]):
    """What hatchling calls for a wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add what is built to the files of the wheel."""
        if version == "editable":
            return  # the repository's own folders serve
        root = Path(self.root)
        into = build_data["force_include"]
        for room in HEADERS:
            for header in sorted((root / "hil_sim" / room).glob("*.h")):
                into[str(header)] = f"hil_sim/built/{room}/{header.name}"
        try:
            for library in self._native(root):
                into[str(library)] = f"hil_sim/built/{library.name}"
            build_data["pure_python"] = False
            build_data["tag"] = f"py3-none-{_platform()}"
        except NotBuiltError as error:
            self._say(f"a wheel without the virtual board: {error}")
        try:
            for image in self._images(root):
                into[str(image)] = f"truing/built/{image.name}"
        except NotBuiltError as error:
            self._say(f"a wheel without the firmware's image: {error}")

    def _native(self, root: Path) -> list[Path]:
        """Build the native libraries; return them stripped, in a folder of their own."""
        if not sys.platform.startswith("linux"):
            raise NotBuiltError(f"it is made for Linux, and this is {sys.platform}")
        _need("cmake", "ninja", "gcc", "strip")
        _build(root, "host", "hil_sim/all")
        folder = root / "build" / "wheel"
        shutil.rmtree(folder, ignore_errors=True)
        install = ("--component", "wheel", "--strip", "--prefix", str(folder))
        _call(root, "cmake", "--install", "build/host", *install)
        return [folder / "hil_sim" / name for name in LIBRARIES]

    def _images(self, root: Path) -> list[Path]:
        """Build the firmware's image, and the same as an update."""
        _need("cmake", "ninja", "arm-none-eabi-gcc")
        _build(root, "stm32f405", "all")
        return [root / "build/stm32f405/firmware" / name for name in IMAGES]

    def _say(self, text: str) -> None:
        self.app.display_warning(f"truing: {text}")


def _platform() -> str:
    """The tag of this system: the C library that was linked against, or a later one."""
    library, version = platform.libc_ver()
    machine = sysconfig.get_platform().partition("-")[2].replace("-", "_").replace(".", "_")
    if library != "glibc":
        return f"linux_{machine}"
    major, minor = version.split(".")[:2]
    return f"manylinux_{major}_{minor}_{machine}"


def _need(*programs: str) -> None:
    missing = [name for name in programs if shutil.which(name) is None]
    if missing:
        raise NotBuiltError(f"{', '.join(missing)} not found")


def _build(root: Path, preset: str, target: str) -> None:
    folder = root / "build" / preset
    if not (folder / "build.ninja").is_file():
        # The project's own Python if it is set up, else the one that builds: both have `unicorn`.
        own = root / ".venv/bin/python"
        python = own if own.is_file() else Path(sys.executable)
        _call(root, "cmake", "--preset", preset, f"-DTRUING_VENV_PYTHON={python}")
    _call(root, "cmake", "--build", str(folder), "--target", target)


def _call(root: Path, *command: str) -> None:
    done = subprocess.run(command, cwd=root, env=os.environ, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = (done.stdout + done.stderr).strip().splitlines()
        raise NotBuiltError(f"`{' '.join(command)}` failed: {' | '.join(said[-3:])}")
