"""The other process of a trial in an engine: builds the robot, shows the seal, drives, keeps the answer.

It speaks as that of a trial on the own plant does (`truing.trial.sealed_process`): one JSON object a line,
the seal's hash before anything moves; it takes the order to open the seal. It never loads the diagnosis.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from truing.errors import TruingError, WeakEffectError
from truing.trial.engines import ENGINES, load_engine
from truing.trial.engines.builder import Prepared, answer_of, prepare, write_set
from truing.trial.engines.engine import Engine
from truing.trial.engines.spec import MODES, RATES_HZ, draw_engine_trial
from truing.trial.seal import seal
from truing.trial.seeds import seed_of

_MAX_SEEDS = 12


def _face() -> TextIO:
    """Standard output as it was; what an engine's library prints there goes nowhere from now on."""
    sys.stdout.flush()
    face = os.fdopen(os.dup(1), "w", encoding="utf-8")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)
    return face


def _sayer(face: TextIO) -> Callable[..., None]:
    def say(**values: Any) -> None:
        face.write(json.dumps(values | {"cpu_s": time.process_time()}) + "\n")
        face.flush()

    return say


def prepared_trial(engine: Engine[Any], effect: str, seed: int, **asked: Any) -> Prepared:
    """A robot that has the effects at the strengths drawn; others are drawn until one can have them.

    Raises
    ------
    WeakEffectError : none of them can.
    """
    for attempt in range(_MAX_SEEDS):
        trial = draw_engine_trial(engine.name, engine.effects, effect, seed_of(seed, attempt), **asked)
        try:
            return prepare(engine, trial)
        except WeakEffectError:
            if attempt == _MAX_SEEDS - 1:
                raise
    raise AssertionError("unreachable")


def main() -> int:
    """Make one trial."""
    parser = argparse.ArgumentParser()
    parser.add_argument("engine", choices=ENGINES)
    parser.add_argument("effect")
    parser.add_argument("seed", type=int)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--strength", choices=("weak", "full"))
    parser.add_argument("--mode", choices=MODES)
    parser.add_argument("--rate", type=int, choices=RATES_HZ)
    given = parser.parse_args()
    say = _sayer(_face())
    weak = None if given.strength is None else given.strength == "weak"
    try:
        engine = load_engine(given.engine)
        asked = {"weak": weak, "mode": given.mode, "rate_hz": given.rate}
        prepared = prepared_trial(engine, given.effect, given.seed, **asked)
        shown, text = seal(answer_of(prepared))
        say(sha256=shown)
        write_set(prepared, given.folder, lambda share: say(driven=share))
        say(written=str(given.folder))
        for line in sys.stdin:
            if "open" in json.loads(line):
                say(sealed=text)
                break
    except TruingError as error:
        say(error=error.message, next=error.next_step)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
