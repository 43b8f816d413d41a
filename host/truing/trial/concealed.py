"""One concealed trial from the user's side: seal shown, recordings made elsewhere, diagnosed, seal opened."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truing.errors import SealedProcessError
from truing.plan import Plan
from truing.progress import Progress
from truing.trial.seal import open_seal

if TYPE_CHECKING:
    from truing.diagnose.result import Diagnosis

Tell = Callable[[str], None]
Diagnose = Callable[[Path, Path], "Diagnosis"]


@dataclass(frozen=True)
class Asked:
    """What one trial is asked to be.

    Attributes
    ----------
    effect : `random`, `pair`, `several`, `outside`, `intermittent`, `none`, or names with commas between.
    plans : drive these instead of drawn ones.
    weak : S below 1; drawn where None.
    core : on the host robot (the firmware core on this machine) instead of the flashed image.
    more_runs : so many of the runs that an undecided verdict proposes are driven on the same robot.
    judged : where the judging runs and the truth go once the seal is opened; None: there are none.
    """

    effect: str
    seed: int
    plans: tuple[str, ...] = ()
    weak: bool | None = None
    core: bool = False
    more_runs: int = 0
    judged: Path | None = None

    def command(self, folder: Path) -> list[str]:
        """What starts the process that makes it."""
        module = "truing.trial.sealed_process"
        command = [sys.executable, "-m", module, self.effect, str(self.seed), str(folder)]
        command += ["--core"] if self.core else []
        if self.weak is not None:
            command += ["--strength", "weak" if self.weak else "full"]
        for plan in self.plans:
            command += ["--plan", plan]
        return command


@dataclass(frozen=True)
class Verdict:
    """One diagnosis, and what it took."""

    diagnosis: Diagnosis
    seconds: float
    cpu_s: float


@dataclass(frozen=True)
class TrialResult:
    """What the diagnosis said, and what was concealed.

    Attributes
    ----------
    first : on the trial's recordings.
    more : after each of the proposed runs that were driven.
    """

    sha256: str
    first: Verdict
    more: tuple[Verdict, ...]
    answer: dict[str, Any]
    building_cpu_s: float


def run_concealed(
    asked: Asked,
    folder: Path,
    *,
    tell: Tell = lambda _text: None,
    progress: Progress | None = None,
    diagnose: Diagnose | None = None,
) -> TrialResult:
    """Run a trial. The diagnosis gets a folder and a baseline; the answer stays in the other process.

    Parameters
    ----------
    folder : where the recording set goes.
    tell : told the seal's hash before the robot moves.
    diagnose : another diagnosis than the product's.
    """
    with _SealedProcess(asked, folder, tell, progress) as process:
        first = _timed(diagnose or _diagnose, folder)
        more: list[Verdict] = []
        while len(more) < asked.more_runs:
            last = more[-1] if more else first
            proposed = last.diagnosis.next_experiment
            if last.diagnosis.verdict != "ambiguous" or proposed is None:
                break
            if not process.drive(proposed.plan, f"proposed_{len(more) + 1}"):
                break
            more.append(_timed(diagnose or _diagnose, folder))
        answer = process.open(asked.judged)
        return TrialResult(process.shown, first, tuple(more), answer, process.cpu_s)


class _SealedProcess:
    """The process that knows the answer, as long as it runs."""

    def __init__(self, asked: Asked, folder: Path, tell: Tell, progress: Progress | None) -> None:
        self.shown = ""
        self._tell = tell
        self._progress = progress
        self._process = subprocess.Popen(
            asked.command(folder), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.cpu_s = 0.0

    def __enter__(self) -> _SealedProcess:
        try:
            self._hear("written")
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def _end(self) -> None:
        if self._process.poll() is None:
            self._process.terminate()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()

    def drive(self, plan: Plan, name: str) -> bool:
        """Add a run to the recordings; False: the board stopped."""
        content = {key: value for key, value in plan.to_dict().items() if key != "name"}
        self._order(drive=content, name=name)
        return self._hear("added", "stopped")[0] == "added"

    def open(self, judged: Path | None) -> dict[str, Any]:
        """Have the seal opened, and check it."""
        self._order(open=None if judged is None else str(judged))
        _, text = self._hear("sealed")
        return open_seal(self.shown, str(text))

    def _order(self, **values: Any) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(values) + "\n")
        self._process.stdin.flush()

    def _hear(self, *keys: str) -> tuple[str, Any]:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            said = json.loads(line)
            if "error" in said:
                raise SealedProcessError(said["error"], said.get("next", ""))
            if "sha256" in said:
                self.shown = str(said["sha256"])
                self._tell(self.shown)
            if "driven" in said and self._progress is not None:
                self._progress(float(said["driven"]))
            self.cpu_s = float(said.get("cpu_s", self.cpu_s))
            for key in keys:
                if key in said:
                    return key, said[key]
        raise SealedProcessError("the process that builds the trial ended too early", "run it again with -v")


def _timed(diagnose: Diagnose, folder: Path) -> Verdict:
    began, cpu_began = time.monotonic(), time.process_time()
    diagnosis = diagnose(folder, folder / "baseline.toml")
    return Verdict(diagnosis, time.monotonic() - began, time.process_time() - cpu_began)


def _diagnose(folder: Path, baseline: Path) -> Diagnosis:
    from truing.diagnose.diagnosis_input import Options, read_input
    from truing.diagnose.engine import diagnose

    return diagnose(read_input(folder, baseline), Options(jobs=1))
