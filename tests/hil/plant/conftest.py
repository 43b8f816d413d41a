"""The plant as the native library has it, and builds of its sources with a finer step."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from hil_sim.plant import Plant, RobotParameters


@pytest.fixture(scope="session")
def robot(native_library: Path) -> RobotParameters:
    """The paper's robot."""
    return RobotParameters.msrp(native_library)


@pytest.fixture(scope="session")
def place(robot: RobotParameters, native_library: Path) -> Callable[..., Plant]:
    """Put a robot on the ground: the paper's, or another."""

    def place(changed: RobotParameters | None = None, seed: int = 1) -> Plant:
        return Plant(changed or robot, seed, native_library)

    return place


@pytest.fixture(scope="session")
def plant_build(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Path]:
    """Build the plant alone with a step of so many microseconds."""
    folder = tmp_path_factory.mktemp("plant")
    sources = sorted((root / "hil_sim" / "plant").glob("*.c"))

    def build(step_us: int) -> Path:
        library = folder / f"libplant-{step_us}.so"
        if not library.exists():
            flags = ["-std=c11", "-O2", "-fPIC", "-shared", "-ffp-contract=off", f"-DPLANT_STEP_US={step_us}"]
            subprocess.run(
                ["cc", *flags, *map(str, sources), "-lm", "-o", str(library)], check=True, timeout=60
            )
        return library

    return build
