"""Process that runs one diagnosis: progress as lines of JSON on standard output, results as files."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

from truing.errors import TruingError

# The board's thread and the virtual board have priority.
_NICENESS = 10


def main(arguments: list[str]) -> int:
    """Diagnose the recordings of the first argument; the second is the path of the resulting JSON file."""
    runs, target = (Path(argument) for argument in arguments)
    os.nice(_NICENESS)
    # Before numpy is loaded: the matrices are small, and BLAS threads would only compete for the CPU.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    output = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def write(content: dict[str, Any]) -> None:
        print(json.dumps(content), file=output)

    try:
        _diagnose(runs, target, lambda progress: write({"progress": progress}))
    except TruingError as error:
        write({"error": error.message, "next": error.next_step})
        return error.exit_code
    except Exception as error:
        write({"error": f"{type(error).__name__}: {error}", "next": "run `truing diagnose` for details"})
        return 1
    write({"progress": 1.0, "done": True})
    return 0


def _diagnose(runs: Path, target: Path, progress: Any) -> None:
    from truing.diagnose.diagnosis_input import read_input
    from truing.diagnose.engine import diagnose
    from truing.diagnose.present.cells import locate
    from truing.diagnose.present.page import save_report
    from truing.diagnose.present.text import HEADINGS, sections
    from truing.recording.writer import replace_file
    from truing.web.views.finding import finding, stretches
    from truing.web.views.mismatch_map import mismatch_map

    progress(0.0)
    recordings = read_input(runs, None)
    found = diagnose(recordings, progress=lambda fraction: progress(0.98 * fraction))
    before = locate(found)
    after = locate(found, after=True) if found.effects else None
    mismatch = mismatch_map(before.cells, after.cells if after else ()) if before.cells else None
    page = {
        "runs": str(runs),
        "heading": HEADINGS[found.verdict],
        "finding": finding(found),
        "stretches": stretches(found),
        "sections": [[section.title, list(section.lines)] for section in sections(found, board=True)],
        "map": mismatch,
        "has_next": found.next_experiment is not None,
    }
    target.parent.mkdir(parents=True, exist_ok=True)
    (target.parent / "pages").mkdir(exist_ok=True)
    save_report(recordings, found, target.with_suffix(".html"), board=True)
    plan = target.with_suffix(".next.toml")
    if found.next_experiment is not None:
        replace_file(plan, found.next_experiment.plan.to_toml().encode("utf-8"))
    else:
        plan.unlink(missing_ok=True)
    replace_file(target, (json.dumps(found.to_json(), indent=2, allow_nan=False) + "\n").encode())
    replace_file(target.parent / "pages" / target.name, json.dumps(page).encode())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
