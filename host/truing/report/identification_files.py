"""Writes everything that an identification found into a folder."""

from __future__ import annotations

import json
import re
from pathlib import Path

from truing.identify.identification import Identification
from truing.identify.tables import fits_csv, result_tables, steps_csv
from truing.progress import Progress
from truing.recording.run import RecordingSet
from truing.recording.writer import replace_file
from truing.report.overlays import overlays, save_overlay
from truing.report.plot import save_png
from truing.report.png import save_table
from truing.report.run_page import save_report
from truing.report.run_view import view_run


def save_identification(
    recordings: RecordingSet,
    result: Identification,
    folder: str | Path,
    progress: Progress | None = None,
) -> list[Path]:
    """Write report.html, identification.json, steps.csv, first_order.csv and a PNG of each run.

    Every printed table goes to tables/ as CSV and PNG; runs of one kind laid over each other become
    overlay-*.png.

    Returns
    -------
    The files that were written, the report first.
    """
    folder = Path(folder)
    written = [save_report(recordings, result, folder / "report.html")]
    texts = {
        "identification.json": json.dumps(result.to_json(), indent=2, allow_nan=False) + "\n",
        "steps.csv": steps_csv(result),
        "first_order.csv": fits_csv(result),
    }
    for name, text in texts.items():
        if text:
            replace_file(folder / name, text.encode("utf-8"))
            written.append(folder / name)
    for table in result_tables(result):
        name = re.sub(r"[^a-z0-9]+", "_", table.title.split(" (")[0].lower())
        replace_file(folder / "tables" / f"{name}.csv", table.to_csv().encode("utf-8"))
        written += [folder / "tables" / f"{name}.csv", save_table(table, folder / "tables" / f"{name}.png")]
    if len(recordings) > 1:
        written += [
            save_overlay(overlay, folder / f"{overlay.name}.png") for overlay in overlays(recordings, result)
        ]
    for number, run in enumerate(recordings, start=1):
        view = view_run(run, recordings.robot, result.whole_fits)
        written.append(save_png(view, folder / f"{run.name}.png"))
        if progress is not None:
            progress(number / len(recordings))
    return written
