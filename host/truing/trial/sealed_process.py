"""The other process of a concealed trial: builds the robot, shows the seal, drives, keeps the answer.

Its standard output is its only face, one JSON object a line: the seal's hash before anything moves, then
that the recordings are written. On its standard input it takes orders, one JSON object a line: `drive` with
a plan adds a run to the recordings; `open` with a folder has the judging runs driven and written there with
the truth, and brings the sealed text.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from truing.errors import BoardFault, Refused, TruingError, WeakEffectError
from truing.plan import Plan, load_plan, parse_plan
from truing.trial.recording_builder import PreparedTrial, RecordingBuilder, answer_of, prepare_trial
from truing.trial.seal import seal
from truing.trial.seeds import seed_of
from truing.trial.spec import Family, draw_trial, judging_plans

_MAX_SEEDS = 20


def _say(**values: Any) -> None:
    sys.stdout.write(json.dumps(values | {"cpu_s": time.process_time()}) + "\n")
    sys.stdout.flush()


def family_of(effect: str) -> tuple[Family, tuple[str, ...] | None]:
    """Return what `--effect` asks for: a family to draw from, or effects by name."""
    from truing.trial.effects import INTERMITTENT, OUTSIDE

    families: dict[str, Family] = {
        "random": "one",
        "pair": "two",
        "several": "several",
        "none": "null",
        "outside": "outside",
        "intermittent": "intermittent",
    }
    if effect in families:
        return families[effect], None
    names = tuple(effect.split(","))
    if len(names) > 1:
        return ("two" if len(names) == 2 else "several"), names
    if effect in INTERMITTENT:
        return "intermittent", names
    return ("outside" if effect in OUTSIDE else "one"), names


def _prepared(
    effect: str, seed: int, attempt: int, plans: tuple[Plan, ...] | None, weak: bool | None
) -> PreparedTrial | None:
    """A robot that has the effect at the strength drawn, or None where this one cannot."""
    family, names = family_of(effect)
    try:
        return prepare_trial(draw_trial(seed_of(seed, attempt), family, names, weak=weak, plans=plans))
    except (WeakEffectError, BoardFault, Refused):
        if attempt == _MAX_SEEDS - 1:
            raise
        return None


def make(
    effect: str,
    seed: int,
    folder: Path,
    *,
    plans: tuple[Plan, ...] | None = None,
    weak: bool | None = None,
    on_board: bool = True,
) -> tuple[RecordingBuilder, str]:
    """Show a seal, drive a trial and write its recordings; return it and the sealed text.

    A robot whose board stops of itself is no trial: its seal is void, and another is drawn.
    """
    for attempt in range(_MAX_SEEDS):
        prepared = _prepared(effect, seed, attempt, plans, weak)
        if prepared is None:
            continue
        shown, text = seal(answer_of(prepared))
        _say(sha256=shown)
        builder = RecordingBuilder(prepared, folder, on_board=on_board)
        try:
            builder.drive(prepared.trial.plans, progress=lambda share: _say(driven=share))
        except (BoardFault, Refused) as fault:
            builder.close()
            _say(void=shown, why=fault.message)
            continue
        builder.write()
        return builder, text
    raise TruingError(f"{effect}: the board stopped on {_MAX_SEEDS} robots", "take another seed")


def obey(builder: RecordingBuilder, text: str) -> None:
    """Take orders until the seal is opened."""
    for line in sys.stdin:
        order = json.loads(line)
        if "drive" in order:
            try:
                builder.drive([parse_plan(order["drive"], order["name"], "proposed run")])
            except (BoardFault, Refused) as fault:
                _say(stopped=fault.message)
                continue
            builder.write()
            _say(added=order["name"])
        if "open" in order:
            if order["open"]:
                _judge(builder, Path(order["open"]))
            _say(sealed=text)
            return


def _judge(builder: RecordingBuilder, folder: Path) -> None:
    """Drive those judging runs that the board lets end, and write the truth about all runs."""
    trial = builder.prepared.trial
    for plan in judging_plans(trial.seed, trial.robot):
        try:
            builder.drive([plan])
        except (BoardFault, Refused):
            continue
    builder.write(folder)
    builder.write_truth(folder)


def main() -> int:
    """Make one trial."""
    parser = argparse.ArgumentParser()
    parser.add_argument("effect")
    parser.add_argument("seed", type=int)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--core", action="store_true")
    parser.add_argument("--strength", choices=("weak", "full"))
    parser.add_argument("--plan", action="append", default=[])
    given = parser.parse_args()
    weak = None if given.strength is None else given.strength == "weak"
    try:
        plans = tuple(load_plan(name) for name in given.plan) or None
        builder, text = make(
            given.effect, given.seed, given.folder, plans=plans, weak=weak, on_board=not given.core
        )
        try:
            _say(written=str(given.folder))
            obey(builder, text)
        finally:
            builder.close()
    except TruingError as error:
        _say(error=error.message, next=error.next_step)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
