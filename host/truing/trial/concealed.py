"""One concealed trial from the user's side: seal shown, recordings made elsewhere, diagnosed, seal opened."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from truing.errors import TruingError
from truing.trial.seal import open_seal

Tell = Callable[[str], None]
Diagnose = Callable[[Path, Path], dict[str, Any]]


class TrialMakerError(TruingError):
    """The process that makes trials could not make this one."""

    exit_code = 1


@dataclass(frozen=True)
class TrialResult:
    """What the diagnosis said, and what was hidden."""

    sha256: str
    verdict: dict[str, Any]
    answer: dict[str, Any]
    seconds: float


def run_concealed(
    effect: str,
    seed: int,
    folder: Path,
    *,
    plans: tuple[str, ...] = (),
    core: bool = False,
    tell: Tell = lambda _text: None,
    progress: Callable[[float], None] | None = None,
    diagnose: Diagnose | None = None,
) -> TrialResult:
    """Run a trial. The diagnosis gets a folder and a baseline; the answer stays in the other process.

    Parameters
    ----------
    folder : where the recording set goes.
    plans : drive these instead of drawn ones.
    core : on the controller's core alone instead of the flashed image.
    tell : told the seal's hash before the robot moves.
    diagnose : another diagnosis than the product's.
    """
    command = [sys.executable, "-m", "truing.trial.maker", effect, str(seed), str(folder)]
    command += ["--core"] if core else []
    for plan in plans:
        command += ["--plan", plan]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as maker:
        try:
            shown = str(_hear(maker, "sha256", None))
            tell(shown)
            _hear(maker, "written", progress)
            began = time.monotonic()
            verdict = (diagnose or _diagnose)(folder, folder / "baseline.toml")
            seconds = time.monotonic() - began
            assert maker.stdin is not None
            maker.stdin.write("\n")
            maker.stdin.flush()
            answer = open_seal(shown, str(_hear(maker, "sealed", None)))
        finally:
            if maker.poll() is None:
                maker.terminate()
    return TrialResult(shown, verdict, answer, seconds)


def _diagnose(folder: Path, baseline: Path) -> dict[str, Any]:
    from truing.diagnose.engine import diagnose

    found: dict[str, Any] = diagnose(folder, baseline, jobs=1).to_json()
    return found


def _hear(maker: subprocess.Popen[str], key: str, progress: Callable[[float], None] | None) -> Any:
    assert maker.stdout is not None
    for line in maker.stdout:
        said = json.loads(line)
        if "error" in said:
            raise TrialMakerError(said["error"], said.get("next", ""))
        if "driven" in said and progress is not None:
            progress(float(said["driven"]))
        if key in said:
            return said[key]
    raise TrialMakerError("the process that makes the trial ended before its time", "run it again with -v")
