"""Learning the board's feedforward: three drives and, between them, parameters; as `truing tune` does it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from truing.errors import TruingError
from truing.plan import Plan, parse_plan
from truing.web.process.helper import HelperProcess
from truing.web.worker.board_worker import BoardWorker
from truing.web.worker.state import RunRequest

_LOOK_S = 0.1


@dataclass(frozen=True, slots=True)
class TuningState:
    """Progress and result.

    Attributes
    ----------
    stage : `none`, `running`, `done` or `failed`.
    parameters : before and after, by name.
    """

    stage: str = "none"
    text: str = ""
    parameters: Mapping[str, tuple[float, float]] = field(default_factory=dict)


class TuningJob:
    """One tuning at a time."""

    def __init__(self, worker: BoardWorker, simulation: HelperProcess) -> None:
        self.state = TuningState()
        self._worker = worker
        self._simulation = simulation

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
        try:
            await self._run(drive, folder)
        except TruingError as error:
            self.state = replace(self.state, stage="failed", text=f"{error.message}. Next: {error.next_step}")

    async def _run(self, drive: Callable[[RunRequest], None], folder: Path) -> None:
        self.state = TuningState("running", "steps of speed as the board is now (1 of 3)")
        proof, learning = await self.plans()
        values = {name: one.value for name, one in self._worker.parameters.items()}
        before = await self._track(await self._drive(drive, proof, folder, "tune_before"), values)
        self.state = replace(self.state, text="steps of effort to learn from (2 of 3)")
        run = await self._drive(drive, learning, folder, "tune_learning")
        self.state = replace(self.state, text="learning …")
        found = await self._simulation.ask({"kind": "learn", "run": str(run)})
        learned: dict[str, float] = found["parameters"]
        old = {name: values[name] for name in learned}
        await self._set(learned)
        self.state = replace(self.state, text="steps of speed with what was learned (3 of 3)")
        try:
            again = await self._drive(drive, proof, folder, "tune_after")
            after = await self._track(again, values)
        except TruingError:
            await self._set(old)
            raise
        said = f"tracking error {1e3 * before:.1f} mm/s before, {1e3 * after:.1f} mm/s after"
        if after < before:
            pairs = {name: (old[name], value) for name, value in learned.items()}
            said += ": the board holds the new values until it is switched off; Parameters saves them"
            self.state = TuningState("done", said, pairs)
        else:
            await self._set(old)
            self.state = TuningState("done", f"{said}: no better, the board has its old values again")

    async def _drive(self, drive: Callable[[RunRequest], None], plan: Plan, folder: Path, label: str) -> Path:
        drive(RunRequest(plan, folder, label))
        while True:
            await asyncio.sleep(_LOOK_S)
            task = self._worker.snapshot.task
            if task is None or task.name != label:
                raise TruingError("the tuning was ended by another task of the board", "start it again")
            if task.is_over:
                break
        if task.stage != "done":
            raise TruingError(f"{label} {task.stage}: {task.problem}", "start the tuning again")
        return Path(task.saved)

    async def _track(self, run: Path, values: Mapping[str, float]) -> float:
        found = await self._simulation.ask({"kind": "track", "run": str(run), "parameters": dict(values)})
        return float(found["both_mps"])

    async def _set(self, values: Mapping[str, float]) -> None:
        await asyncio.wrap_future(self._worker.call(lambda device: device.set_parameters(values)))
        await asyncio.wrap_future(self._worker.read_parameters())
