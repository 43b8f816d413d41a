"""Learned corrections on real recordings: whether what the catalogue leaves falls further on runs left out.

    ./run bench learned_real

reads the sets of `TRUING_RECORDINGS` (default: `shared/recordings` beside the repository) and of the folders
in `TRUING_MORE_SETS`, parted by colons; it goes on where it was stopped. `out/bench/learned_real` has a line
per set.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from bench.figure import Figure
from truing.diagnose.diagnosis_input import Options, read_input, with_what_to_compare
from truing.diagnose.engine import diagnose
from truing.errors import TruingError

# Share of the sets in which the error is to fall.
BAR = 0.5


def sets(root: Path) -> list[Path]:
    """All recording sets that are there, each name once."""
    named = os.environ.get("TRUING_RECORDINGS")
    folders = [(Path(named) if named else root.parent / "shared" / "recordings") / "real"]
    folders += [Path(each) for each in os.environ.get("TRUING_MORE_SETS", "").split(":") if each]
    found = {path.name: path for folder in folders if folder.is_dir() for path in sorted(folder.iterdir())}
    return [path for path in found.values() if (path / "runs").is_dir()]


def one_set(path: Path) -> dict[str, Any]:
    """What the diagnosis says of a set, and what a correction brings on runs left out."""
    try:
        options = Options(jobs=1, learn=True, wheels_only=True)
        recordings = with_what_to_compare(read_input(path, None), options, lambda _: None)
        diagnosis = diagnose(recordings, options)
    except TruingError as error:
        return {"set": path.name, "error": str(error)}
    learned = diagnosis.learned
    if learned is None:
        return {"set": path.name, "error": "no wheel is judged"}
    return {
        "set": path.name,
        "verdict": diagnosis.verdict,
        "named": sorted({effect.name for effect in diagnosis.effects}),
        "floor_mmps": 1e3 * diagnosis.fit.noise_floor,
        "heldout_before_mmps": 1e3 * learned.heldout_before,
        "heldout_after_mmps": 1e3 * learned.heldout_after,
        "terms": [[one.term.place, one.term.variable, one.term.constant] for one in learned.terms],
        "seconds": diagnosis.seconds,
    }


def results(root: Path) -> list[dict[str, Any]]:
    """All sets, those that are missing made now."""
    kept = root / "out" / "bench" / "learned_real"
    kept.mkdir(parents=True, exist_ok=True)
    found = []
    for path in sets(root):
        file = kept / f"{path.name}.json"
        if not file.exists():
            file.write_text(json.dumps(one_set(path)) + "\n", encoding="utf-8")
        found.append(json.loads(file.read_text(encoding="utf-8")))
    return found


def measure(root: Path) -> list[Figure]:
    """Share of the sets in which the error on runs left out falls."""
    good = [one for one in results(root) if "error" not in one]
    if not good:
        return []
    falls = sum(bool(one["terms"]) for one in good)
    name = f"learned, real sets ({len(good)}): error on runs left out falls in"
    return [Figure(name, 100.0 * falls / len(good), "%", "more", 100.0 * BAR)]
