"""The other process of a concealed trial: builds the robot, shows the seal, drives, keeps the answer.

Its standard output is its only face: one JSON line with the seal's hash before anything moves, one when
the recordings are written; after a line on its standard input, one with the sealed text.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from truing.errors import TruingError
from truing.plan import load_plan
from truing.trial.making import answer_of, drive_made, prepare_trial, write_set
from truing.trial.seal import seal
from truing.trial.spec import Family, draw_trial

_MOST_SEEDS = 20


def _say(**values: Any) -> None:
    sys.stdout.write(json.dumps(values) + "\n")
    sys.stdout.flush()


def family_of(effect: str) -> tuple[Family, tuple[str, ...] | None]:
    """Return what `--effect` asks for: a family to draw from, or effects by name."""
    from truing.trial.effects import OUTSIDE

    families: dict[str, Family] = {"random": "one", "pair": "two", "none": "null", "outside": "outside"}
    if effect in families:
        return families[effect], None
    names = tuple(effect.split(","))
    if len(names) > 1:
        return "two", names
    return ("outside" if effect in OUTSIDE else "one"), names


def _run(effect: str, seed: int, folder: Path, plans: tuple[str, ...], *, core: bool) -> None:
    family, names = family_of(effect)
    chosen = tuple(load_plan(name) for name in plans) or None
    for attempt in range(_MOST_SEEDS):
        try:
            # A robot that cannot have the effect at the strength drawn is drawn anew, from a seed of its own.
            trial = draw_trial(seed + attempt * 1_000_003, family, names, plans=chosen)
            prepared = prepare_trial(trial)
            break
        except TruingError:
            if attempt == _MOST_SEEDS - 1:
                raise
    shown, text = seal(answer_of(prepared))
    _say(sha256=shown)
    made = drive_made(prepared, on_board=not core, progress=lambda share: _say(driven=share))
    write_set(made, folder)
    _say(written=str(folder))
    sys.stdin.readline()
    _say(sealed=text)


def main() -> int:
    """Make one trial."""
    parser = argparse.ArgumentParser()
    parser.add_argument("effect")
    parser.add_argument("seed", type=int)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--core", action="store_true")
    parser.add_argument("--plan", action="append", default=[])
    given = parser.parse_args()
    try:
        _run(given.effect, given.seed, given.folder, tuple(given.plan), core=given.core)
    except TruingError as error:
        _say(error=error.message, next=error.next_step)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
