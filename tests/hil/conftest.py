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


@pytest.fixture(params=["olimex_h405", "f405_usb"])
def each_image(request: pytest.FixtureRequest) -> Path:
    """The image of each board, for what a board's wiring decides: a test module makes it its `image`."""
    name = {"olimex_h405": "image", "f405_usb": "usb_image"}[request.param]
    path: Path = request.getfixturevalue(name)
    return path
