"""A diagnosis in a process of its own: progress as lines of JSON on standard output, results as files."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

from truing.errors import TruingError

# The board's thread and the virtual board go first.
_NICENESS = 10


def main(arguments: list[str]) -> int:
    """Diagnose the recordings of the first argument; results go beside the second, a JSON file's path."""
    runs, target = (Path(argument) for argument in arguments)
    os.nice(_NICENESS)
    # Before numpy is loaded: the matrices are small, and threads of their own only get in the way.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    said = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def say(content: dict[str, Any]) -> None:
        print(json.dumps(content), file=said)

    try:
        _diagnose(runs, target, lambda share: say({"share": share}))
    except TruingError as error:
        say({"error": error.message, "next": error.next_step})
        return error.exit_code
    except Exception as error:
        say({"error": f"{type(error).__name__}: {error}", "next": "run `truing diagnose` to see more"})
        return 1
    say({"share": 1.0, "done": True})
    return 0


def _diagnose(runs: Path, target: Path, progress: Any) -> None:
    from truing.diagnose.report import save_report
    from truing.diagnose.report_cells import locate
    from truing.diagnose.report_charts import heat_map
    from truing.diagnose.session import diagnose_recordings, read_for_diagnosis
    from truing.diagnose.words import HEADINGS, sections
    from truing.recording_writer import replace_file
    from truing.web.figures import darkened

    progress(0.0)
    recordings = read_for_diagnosis(runs, None)
    found = diagnose_recordings(recordings, progress=lambda share: progress(0.98 * share))
    before = locate(found)
    after = locate(found, after=True) if found.effects else None
    heat = heat_map(before.cells, after.cells if after else ()) if before.cells else None
    page = {
        "runs": str(runs),
        "heading": HEADINGS[found.verdict],
        "sections": [[section.title, list(section.lines)] for section in sections(found)],
        "heat": None if heat is None else darkened(heat),
        "has_next": found.next_experiment is not None,
    }
    target.parent.mkdir(parents=True, exist_ok=True)
    (target.parent / "pages").mkdir(exist_ok=True)
    save_report(recordings, found, target.with_suffix(".html"))
    plan = target.with_suffix(".next.toml")
    if found.next_experiment is not None:
        replace_file(plan, found.next_experiment.plan.to_toml().encode("utf-8"))
    else:
        plan.unlink(missing_ok=True)
    replace_file(target, (json.dumps(found.to_json(), indent=2, allow_nan=False) + "\n").encode())
    replace_file(target.parent / "pages" / target.name, json.dumps(page).encode())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
