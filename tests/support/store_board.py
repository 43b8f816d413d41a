"""A virtual board that is started again and again on chosen contents of its parameter store."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import truing_protocol as tp
from hil_sim import VirtualRobot
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream

SLOTS = 0x0800_4000
SLOT_SIZE = 0x4000
BLANK = b"\xff" * (2 * SLOT_SIZE)
BOOT_US = 14_000

Values = tuple[float, ...]


class StoreBoard:
    """The flashed image, and what lies in flash sectors 1 and 2."""

    def __init__(self, image: Path, seed: int = 1) -> None:
        self.robot = VirtualRobot(image, seed=seed)

    def __enter__(self) -> StoreBoard:
        return self

    def __exit__(self, *_: object) -> None:
        self.robot.close()

    @property
    def slots(self) -> bytes:
        """Both slots as they are in flash."""
        return self.robot.read_memory(SLOTS, 2 * SLOT_SIZE)

    def start(self, slots: bytes | None = None) -> Client:
        """Switch on, on the store as it is or on that one, and connect."""
        self.robot.set_power(False)
        if slots is not None:
            self.robot.write_flash(SLOTS, slots)
        self.robot.set_power(True)
        self.robot.run_us(BOOT_US)
        return Client(VirtualStream(self.robot))

    def run_until_dark(self, limit_us: int) -> bool:
        """Let time pass until the power fails; False: it did not within the limit."""
        for _ in range(0, limit_us, 2000):
            if not self.robot.stats().powered:
                return True
            self.robot.run_us(2000)
        return not self.robot.stats().powered


def values_of(client: Client) -> Values:
    """All parameters as they are in force."""
    return tuple(client.request(tp.ParamGetRequest(info.index)).value for info in tp.PARAMETERS)


def put_values(client: Client, values: Sequence[float]) -> None:
    """Set all parameters."""
    for info, value in zip(tp.PARAMETERS, values, strict=True):
        client.request(tp.ParamSetRequest(info.index, value))


def generation(number: int) -> Values:
    """Values of which no two generations share one, so that a mix of two looks like neither."""
    share = 0.1 + 0.05 * number
    values = []
    for info in tp.PARAMETERS:
        value = info.minimum + (info.maximum - info.minimum) * share
        if info.kind == tp.ParameterKind.FLAG:
            value = number % 2
        elif info.kind == tp.ParameterKind.INTEGER:
            value = round(value)
        values.append(value)
    return tuple(values)


def faults_of(client: Client) -> int:
    """Bits of the active faults."""
    return client.request(tp.StatusRequest()).faults_active
