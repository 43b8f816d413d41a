"""What tests of the flashed image share: a robot that has started and stands."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from hil_sim import VirtualRobot


@pytest.fixture
def robot(image: Path, native_library: Path) -> Iterator[VirtualRobot]:
    """A fresh robot, 0.3 s after its start."""
    with VirtualRobot(image) as fresh:
        fresh.run_us(300_000)
        yield fresh
