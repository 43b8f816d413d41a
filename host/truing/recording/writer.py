"""Writing recordings: a run's CSV and its metadata appear whole or not at all."""

from __future__ import annotations

import contextlib
import csv
import errno
import io
import json
import math
import os
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from truing.errors import OutputError, RecordingError
from truing.recording.axis import axis_names
from truing.recording.reader import METADATA_SUFFIX
from truing.recording.run import MINIMUM_ROWS, TRUTH_COLUMNS, Run, RunMetadata

METADATA_SCHEMA = 1


def write_run(run: Run, path: str | Path) -> Path:
    """Write a run's CSV and, if it has any, its metadata beside it.

    Numbers are written with the fewest digits that read back as the same number.
    """
    path = Path(path)
    if len(run) < MINIMUM_ROWS:
        raise RecordingError(path, f"only {len(run)} rows of data; at least {MINIMUM_ROWS} are needed")
    if run.metadata is not None:
        write_metadata(run.metadata, path)
    replace_file(path, _to_csv(run).encode("utf-8"))
    return path


def write_metadata(metadata: RunMetadata, run_path: str | Path) -> Path:
    """Write `NAME.meta.json` beside the run `NAME.csv`."""
    run_path = Path(run_path)
    file = run_path.with_name(run_path.stem + METADATA_SUFFIX)
    tree: dict[str, Any] = {
        "schema": METADATA_SCHEMA,
        "firmware": metadata.firmware,
        "parameters": metadata.parameters,
        "plan": metadata.plan,
        "seed": metadata.seed,
        "pause_before_s": metadata.pause_before_s,
        **metadata.extra,
    }
    replace_file(file, (json.dumps(tree, indent=2, ensure_ascii=False) + "\n").encode("utf-8"))
    return file


def next_run_path(folder: str | Path, label: str) -> Path:
    """The path for the next run of a set: `FOLDER/runs/NN_label.csv`, NN after the highest there."""
    runs = Path(folder) / "runs"
    numbers = [int(match[1]) for item in runs.glob("*.csv") if (match := re.match(r"(\d+)_", item.name))]
    safe = re.sub(r"[^A-Za-z0-9.-]+", "_", label).strip("._") or "run"
    return runs / f"{max(numbers, default=0) + 1:02d}_{safe}.csv"


def replace_file(path: str | Path, data: bytes) -> None:
    """Put `data` at `path` in one step: readers see the old file or the new one, never a part.

    The temporary file lies in the same folder, so that the rename cannot cross file systems; it
    is removed when the disk is full.
    """
    path = Path(path)
    temporary: str | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
        temporary = None
    except OSError as error:
        step = "Free some space and try again" if error.errno == errno.ENOSPC else ""
        raise OutputError(path, f"cannot be written: {error.strerror}", step) from None
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                Path(temporary).unlink()


def check_output(path: str | Path, *, folder: bool = False) -> None:
    """Stop before long work where its result could not be written; missing folders are made when it is.

    Parameters
    ----------
    folder : `path` is a folder for several files.

    Raises
    ------
    OutputError : says which folder or file is in the way.
    """
    path = Path(path)
    if path.exists() and path.is_dir() != folder:
        raise OutputError(path, "is a file, not a folder" if folder else "is a folder, not a file")
    above = path if folder else path.parent
    while not above.exists() and above != above.parent:
        above = above.parent
    if not above.is_dir():
        raise OutputError(path, f"cannot be written: {above} is no folder")
    if not os.access(above, os.W_OK | os.X_OK):
        raise OutputError(path, f"cannot be written: no permission in {above}")


def _to_csv(run: Run) -> str:
    names = list(run.order) or [*run.columns, *(["mode"] if run.mode is not None else []), *run.text_columns]
    shown = dict(zip(names, names, strict=True)) if run.axis is None else axis_names(names, run.axis)
    names = list(shown)
    cells = [_cells(run, name) for name in names]
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(shown.values())
    writer.writerows(zip(*cells, strict=True))
    return out.getvalue()


def _cells(run: Run, name: str) -> list[str]:
    if name == "mode" and run.mode is not None:
        return list(run.mode)
    if name in run.text_columns:
        return list(run.text_columns[name])
    values = run.columns[name]
    finite = np.isfinite(values).all()
    if finite and (values == np.rint(values)).all() and np.abs(values).max(initial=0.0) < 2**53:
        return [str(int(value)) for value in values.tolist()]
    if name in TRUTH_COLUMNS:
        return [repr(value) if math.isfinite(value) else "" for value in values.tolist()]
    return [repr(value) for value in values.tolist()]
