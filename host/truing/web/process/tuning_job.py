"""Learning the board's feedforward from the view: the sequence of `truing tune`, with pages that look on."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from truing.board.device import Device
from truing.board.tuning import TuningResult, tune
from truing.errors import TruingError, with_next
from truing.plan import Plan, parse_plan
from truing.web.process.helper import HelperProcess
from truing.web.worker.board_worker import BoardWorker
from truing.web.worker.state import RunRequest

T = TypeVar("T")

_LOG = logging.getLogger("truing.web.tuning")
_LOOK_S = 0.1
# For the board's thread to do what it is asked; it may have to fetch a log first.
_ANSWER_S = 30.0
# A lost link may come back, and a run of somebody else end, before the old parameters are given up.
_RESTORE_S = 120.0
_STEPS = {
    "tune_before": "steps of speed as the board is now (1 of 3)",
    "tune_learning": "steps of effort to learn from (2 of 3)",
    "tune_after": "steps of speed with what was learned (3 of 3)",
}


@dataclass(frozen=True, slots=True)
class TuningState:
    """Progress and result.

    Attributes
    ----------
    stage : `none`, `running`, `done` or `failed`.
    parameters : before and after, by name; empty where the old ones are in force again.
    """

    stage: str = "none"
    text: str = ""
    parameters: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Tracked:
    """A tracking error."""

    both_mps: float


class TuningJob:
    """One tuning at a time, in a thread of its own."""

    def __init__(self, worker: BoardWorker, simulation: HelperProcess) -> None:
        self.state = TuningState()
        self._worker = worker
        self._simulation = simulation
        self._closing = False
        self._ended = threading.Event()
        self._ended.set()

    @property
    def is_running(self) -> bool:
        """Whether it drives or computes."""
        return self.state.stage == "running"

    async def plans(self) -> list[Plan]:
        """Steps of speed that show how the wheels follow, and steps of effort to learn from.

        From the helper process, since what computes them takes long to import.
        """
        found = await self._simulation.ask({"kind": "tuning_plans"})
        return [parse_plan(dict(content), name, name) for name, content in found["plans"]]

    async def run(self, drive: Callable[[RunRequest], None], folder: Path) -> None:
        """Drive, learn and compare; the parameters are changed only where the wheels then follow better.

        Parameters
        ----------
        drive : starts a run.
        """
        if self.is_running:
            raise TruingError("a tuning is under way", "wait until it ends, or press space")
        self.state = TuningState("running")
        try:
            proof, learning = await self.plans()
            result = await asyncio.to_thread(self._tune, _ViewRobot(self, drive, folder), proof, learning)
        except TruingError as error:
            self._fail(with_next(error))
        except Exception as error:
            _LOG.exception("the tuning")
            self._fail(f"{type(error).__name__}: {error}. Next: start the tuning again")
        else:
            self._finish(result)

    def close(self) -> None:
        """End it; the board has its old parameters then."""
        self._closing = True
        if self.is_running:
            self._worker.stop()
            self._ended.wait(_ANSWER_S)

    def _tune(self, robot: _ViewRobot, proof: Plan, learning: Plan) -> TuningResult[_Tracked]:
        self._ended.clear()
        try:
            values = {name: one.value for name, one in self._worker.parameters.items()}
            return tune(robot, values, proof, learning)
        finally:
            self._ended.set()

    def _finish(self, result: TuningResult[_Tracked]) -> None:
        before, after = 1e3 * result.before.both_mps, 1e3 * result.after.both_mps
        said = f"tracking error {before:.1f} mm/s before, {after:.1f} mm/s after"
        if result.is_better:
            said += ": the board holds the new values until it is switched off; Parameters saves them"
            self.state = TuningState("done", said, result.parameters)
        else:
            self.state = TuningState("done", f"{said}: no better, the board has its old values again")

    def _fail(self, text: str) -> None:
        self.state = TuningState("failed", text)

    # ---- for the thread

    def say(self, text: str) -> None:
        """Tell the pages what is done now."""
        self.state = replace(self.state, text=text)

    def saved_run(self, label: str) -> Path:
        """The run that is being driven, once it has been saved."""
        while True:
            time.sleep(_LOOK_S)
            task = self._worker.snapshot.task
            if task is None or task.name != label:
                raise TruingError("the tuning was ended by another task of the board", "start it again")
            if task.is_over:
                break
        if task.stage != "done":
            raise TruingError(f"{label} {task.stage}: {task.problem}", "start the tuning again")
        return Path(task.saved)

    def computed(self, request: Mapping[str, object]) -> dict[str, object]:
        """What the helper process answers."""
        return self._simulation.answer(dict(request))

    def on_board(self, work: Callable[[Device], T]) -> T:
        """Do something with the board, and read its parameters for the pages."""
        done = self._worker.call(work).result(_ANSWER_S)
        self._worker.read_parameters().result(_ANSWER_S)
        return done

    def on_board_at_last(self, work: Callable[[Device], None]) -> None:
        """The same, tried until it is done."""
        until = time.monotonic() + _RESTORE_S
        while True:
            try:
                self.on_board(work)
            except (TruingError, TimeoutError):
                if self._closing or time.monotonic() > until:
                    raise
                time.sleep(_LOOK_S)
            else:
                return


class _ViewRobot:
    """The robot as the view drives it.

    Parameters
    ----------
    drive : starts a run.
    """

    def __init__(self, job: TuningJob, drive: Callable[[RunRequest], None], folder: Path) -> None:
        self._job = job
        self._drive = drive
        self._folder = folder

    def drive(self, plan: Plan, label: str) -> Path:
        """Drive a plan and return its run, saved."""
        self._job.say(_STEPS[label])
        self._drive(RunRequest(plan, self._folder, label))
        return self._job.saved_run(label)

    def learn(self, run: Path) -> dict[str, float]:
        """Return the feedforward parameters that a run shows."""
        self._job.say("learning …")
        found = self._job.computed({"kind": "learn", "run": str(run)})["parameters"]
        assert isinstance(found, dict)
        return found

    def tracking(self, run: Path, parameters: Mapping[str, float]) -> _Tracked:
        """Return the tracking error of a run."""
        found = self._job.computed({"kind": "track", "run": str(run), "parameters": dict(parameters)})
        return _Tracked(float(str(found["both_mps"])))

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Put values into force."""
        self._job.on_board(lambda device: device.set_parameters(values))

    def restore_parameters(self, values: Mapping[str, float]) -> None:
        """Put the old values into force again, also when a stop is pending or the link was lost."""
        self._job.say("putting the old parameters back …")

        def restore(device: Device) -> None:
            with device.client.uninterrupted():
                device.set_parameters(values)

        try:
            self._job.on_board_at_last(restore)
        except (TruingError, TimeoutError) as error:
            raise TruingError(
                f"the board may still hold what was learned ({error})",
                "once it is connected, press Load what is stored on Parameters",
            ) from error
