"""Checks a file that has arrived from a page, and puts it where its kind belongs; in a helper process."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from truing.errors import TruingError
from truing.recording.baseline import read_baseline
from truing.recording.reader import read_run
from truing.web.models.error_model import read_verdict
from truing.web.runs.library import safe_name

# A baseline or a diagnosis is a few kilobytes, a run's metadata a few hundred at most.
_MAX_TEXT_BYTES = 8_000_000


def store(name: str, part: Path, dropped: Path, diagnoses: Path) -> dict[str, Any]:
    """Move a file to where its content belongs; returns its path, or the error in one line.

    Parameters
    ----------
    name : as the user knows the file.
    part : the file itself.
    """
    try:
        if name.endswith(".toml"):
            target = dropped / "baseline.toml"
            _checked(part, read_baseline)
            kind = "baseline"
        elif name.endswith(".json"):
            if _is_verdict(part):
                target, kind = diagnoses / safe_name(name), "diagnosis"
                _checked(part, read_verdict)
            else:
                target, kind = dropped / "runs" / safe_name(name), "metadata"
        else:
            safe = safe_name(name) or "run.csv"
            target = dropped / "runs" / (safe if safe.endswith(".csv") else f"{safe}.csv")
            kind = "run"
            read_run(part)
        target.parent.mkdir(parents=True, exist_ok=True)
        part.replace(target)
    except TruingError as error:
        text = f"{error.message}. {error.next_step}".rstrip(". ").replace(str(part), name)
        return {"error": f"{text}."}
    except MemoryError:
        return {"error": f"{name}: reading it takes more memory than there is. Split it."}
    except OSError as error:
        return {"error": f"{name}: {error.strerror or error}"}
    return {"path": str(target), "kind": kind}


def _checked(part: Path, read: Callable[[Path], object]) -> None:
    if part.stat().st_size > _MAX_TEXT_BYTES:
        raise TruingError(f"{part}: too large for what it should be")
    read(part)


def _is_verdict(part: Path) -> bool:
    """Whether a file of JSON is a diagnosis.

    Raises
    ------
    TruingError : it is not JSON.
    """
    if part.stat().st_size > _MAX_TEXT_BYTES:
        raise TruingError(f"{part}: too large for a diagnosis or for metadata")
    try:
        content = json.loads(part.read_bytes())
    except RecursionError:
        raise TruingError(f"{part}: nested too deeply to be a diagnosis or metadata") from None
    except ValueError as error:
        raise TruingError(f"{part}: is not JSON ({error})") from None
    return isinstance(content, dict) and "verdict" in content
