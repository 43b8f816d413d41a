"""What every test may ask for: the image, the native library and the real recordings."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
IMAGE = ROOT / "build/stm32f405/firmware/truing-f405.elf"
NATIVE_LIBRARY = ROOT / "build/host/hil_sim/libhil_sim.so"

# A bare `pytest` keeps its caches inside the repository too, as `./run test` does.
for _variable, _folder in {
    "MPLCONFIGDIR": "matplotlib",
    "NUMBA_CACHE_DIR": "numba",
    "HYPOTHESIS_STORAGE_DIRECTORY": "hypothesis",
    "XDG_CACHE_HOME": "",
}.items():
    os.environ.setdefault(_variable, str(ROOT / ".cache" / _folder))
os.environ.setdefault("MPLBACKEND", "agg")


def _built(path: Path) -> Path:
    if not path.is_file():
        pytest.fail(f"{path.relative_to(ROOT)} is not built; run ./run setup", pytrace=False)
    return path


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository's root."""
    return ROOT


@pytest.fixture(scope="session")
def image() -> Path:
    """The image that is flashed."""
    return _built(IMAGE)


@pytest.fixture(scope="session")
def native_library() -> Path:
    """The virtual robot: board, plant and the wires between them."""
    return _built(NATIVE_LIBRARY)


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recording sets."""
    named = os.environ.get("TRUING_RECORDINGS")
    beside = ROOT.parent / "shared" / "recordings"
    folder = Path(named) if named else beside
    if not folder.is_dir():
        says = f"is {named}, no folder" if named else f"is not set, and {beside} is not there"
        pytest.skip(f"no real recordings: TRUING_RECORDINGS {says}")
    return folder
