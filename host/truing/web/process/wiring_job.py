"""The check of a board's wiring, as `truing check` does it: a hand turns each wheel, then each motor does."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

from truing.board.device import Device
from truing.board.wiring_check import SIDES, CheckResult, check_robot, fix
from truing.errors import Interrupted, TruingError, with_next
from truing.web.process.robot_side import RobotSide
from truing.web.worker.board_worker import BoardWorker

NAME = "check"


@dataclass(frozen=True, slots=True)
class WiringState:
    """Progress and result.

    Attributes
    ----------
    stage : `none`, `running`, `done` or `failed`.
    asks : what somebody beside the robot has to do now; empty for nothing.
    said : what was seen so far.
    """

    stage: str = "none"
    asks: str = ""
    said: tuple[str, ...] = ()
    result: CheckResult | None = None


class WiringJob:
    """One check at a time.

    Parameters
    ----------
    robot : returns the virtual robot, whose wheels are turned here; None: somebody turns the wheels.
    """

    def __init__(self, worker: BoardWorker, robot: Callable[[], RobotSide | None]) -> None:
        self.state = WiringState()
        self._worker = worker
        self._robot = robot
        self._turned = threading.Event()

    @property
    def is_running(self) -> bool:
        """Whether it is under way."""
        return self.state.stage == "running"

    def turned(self) -> None:
        """Somebody has turned the wheel."""
        self._turned.set()

    async def run(self) -> None:
        """Check; the result is in the state."""
        self.state = WiringState("running")
        try:
            result = await asyncio.wrap_future(self._worker.call(self._check, NAME))
        except TruingError as error:
            self.state = replace(
                self.state,
                stage="failed",
                asks="",
                said=(*self.state.said, with_next(error)),
            )
        else:
            said = [f"{one.name}: {one.text}. Change: {one.change}" for one in result.findings]
            said = said or ["motors, encoders and counts per revolution are right"]
            self.state = WiringState("done", "", (*self.state.said, *said), result)

    async def fix(self) -> None:
        """Set the parameters that the findings name, until the board is switched off."""
        result = self.state.result
        if result is None:
            return
        done = await asyncio.wrap_future(self._worker.call(lambda device: fix(device, result)))
        await asyncio.wrap_future(self._worker.read_parameters())
        text = f"set: {', '.join(done)}. Run the check again; Parameters saves them."
        self.state = WiringState("done", "", (*self.state.said, text))

    def _check(self, device: Device) -> CheckResult:
        return check_robot(device, _Hand(self, device), self._say)

    def _say(self, text: str) -> None:
        self.state = replace(self.state, said=(*self.state.said, text))

    def turn(self, side: int, device: Device) -> None:
        """Have a wheel turned, by the virtual robot's hand or by somebody's."""
        robot = self._robot()
        if robot is not None:
            robot.turn(side)
            return
        self._turned.clear()
        text = f"Turn the {SIDES[side]} wheel FORWARD by one whole turn, by hand; then press Turned."
        self.state = replace(self.state, asks=text)
        while not self._turned.wait(0.05):
            if device.client.is_interrupted:
                raise Interrupted("the check was stopped", "start it again")
        self.state = replace(self.state, asks="")


class _Hand:
    """Whoever turns the wheels."""

    def __init__(self, job: WiringJob, device: Device) -> None:
        self._job = job
        self._device = device

    def turn(self, side: int) -> None:
        """Have it turned, and return then."""
        self._job.turn(side, self._device)
