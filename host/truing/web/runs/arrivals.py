"""Checks a file that has arrived from a page, and puts it where its kind belongs; in a helper process."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truing.errors import TruingError
from truing.recording.baseline import read_baseline
from truing.recording.reader import METADATA_SUFFIX, read_run
from truing.web.models.error_model import read_verdict
from truing.web.runs.library import safe_name

if TYPE_CHECKING:
    from truing.importers import ImportOptions

# A baseline or a diagnosis is a few kilobytes, a run's metadata a few hundred at most.
_MAX_TEXT_BYTES = 8_000_000
_MAX_FINDINGS = 6
# What a mapping of messages needs beside the time.
_DUE = ("effort_left", "effort_right", "vel_left_mps", "vel_right_mps")
NUMBERS = {
    "wheelbase_m": "wheelbase, m",
    "metres_per_unit": "wheel travel per unit of position, m",
    "full_speed_mps": "wheel speed of full effort, m/s",
    "nominal_voltage_v": "voltage of full effort, V",
}
"""What a file of another program may leave open, as `ImportOptions` names it, and its label."""


@dataclass(frozen=True, slots=True)
class Wishes:
    """What a page says of a file beside its name.

    Attributes
    ----------
    home : the set that the file belongs to; empty: a new one of the file's own name.
    mapping : which column of a table is which, as TOML; empty: not known.
    numbers : values of `NUMBERS` that the user gave.
    """

    home: str = ""
    mapping: str = ""
    numbers: tuple[tuple[str, float], ...] = ()

    @classmethod
    def of_query(cls, query: dict[str, Any]) -> Wishes:
        """From the parameters of an upload's address; what is no number is not taken."""
        numbers = []
        for name in NUMBERS:
            try:
                value = float(query.get(name, ""))
            except ValueError:
                continue
            if 0.0 < value < 1e6:
                numbers.append((name, value))
        return cls(safe_name(str(query.get("set", ""))), str(query.get("mapping", "")), tuple(numbers))

    def options(self, folder: Path) -> ImportOptions:
        """For the importers; a mapping in the set's folder holds for all its tables."""
        from truing.importers import ImportOptions
        from truing.importers.foreign import NOMINAL_VOLTAGE_V
        from truing.importers.mapping import parse_mapping

        path = folder / "mapping.toml"
        text = self.mapping or (path.read_text("utf-8") if path.is_file() else "")
        try:
            mapping = parse_mapping(tomllib.loads(text), path) if text else None
        except tomllib.TOMLDecodeError as error:
            raise TruingError(f"the mapping is not TOML: {error}") from error
        given = dict(self.numbers)
        return ImportOptions(
            given.get("nominal_voltage_v", NOMINAL_VOLTAGE_V),
            given.get("metres_per_unit"),
            given.get("wheelbase_m"),
            given.get("full_speed_mps"),
            mapping,
        )


def store(
    name: str, part: Path, dropped: Path, diagnoses: Path, wishes: Wishes | None = None
) -> dict[str, Any]:
    """Put a file where its content belongs; returns what became of it, a question, or the error in one line.

    Parameters
    ----------
    name : as the user knows the file.
    part : the file itself.

    Returns
    -------
    `kind` with `path` and `set`; or `ask` (`mapping` or `numbers`) with what is known; or `error`.
    """
    try:
        return _stored(name, part, dropped, diagnoses, wishes or Wishes())
    except TruingError as error:
        text = f"{error.message}. {error.next_step}".rstrip(". ").replace(str(part), name)
        return {"error": f"{text}."}
    except MemoryError:
        return {"error": f"{name}: reading it takes more memory than there is. Split it."}
    except OSError as error:
        return {"error": f"{name}: {error.strerror or error}"}


def _stored(name: str, part: Path, dropped: Path, diagnoses: Path, wishes: Wishes) -> dict[str, Any]:
    from truing.importers import is_foreign

    if name.endswith(".toml"):
        _checked(part, read_baseline)
        folder = dropped / (wishes.home or "baseline")
        return _moved(part, folder / "baseline.toml", "baseline", folder)
    if name.endswith(METADATA_SUFFIX):
        _json(part)
        folder = dropped / (wishes.home or "runs")
        return _moved(part, folder / "runs" / safe_name(name), "metadata", folder)
    if name.endswith(".json"):
        content = _json(part) if part.stat().st_size <= _MAX_TEXT_BYTES else None
        if isinstance(content, dict) and "verdict" in content:
            read_verdict(part)
            return _moved(part, diagnoses / safe_name(name), "diagnosis", diagnoses)
    folder = dropped / wishes.home if wishes.home else _new_folder(dropped, name)
    if is_foreign(part):
        return _imported(name, part, folder, wishes)
    read_run(part)
    safe = safe_name(name) or "run.csv"
    return _moved(part, folder / "runs" / (safe if safe.endswith(".csv") else f"{safe}.csv"), "run", folder)


def _imported(name: str, part: Path, folder: Path, wishes: Wishes) -> dict[str, Any]:
    """A file of another program, by the importers of `truing import`."""
    from truing.importers import import_file, messages_without_mapping, without_mapping
    from truing.recording.writer import next_run_path, replace_file, write_run

    options = wishes.options(folder)
    if without_mapping([part], options):
        return _proposal(name, part, wishes)
    messages = messages_without_mapping(part, options)
    if messages:
        return _message_columns(name, messages)
    try:
        found = import_file(part, options)
    except TruingError as error:
        if "--wheelbase" in error.next_step and not dict(wishes.numbers).get("wheelbase_m"):
            why = error.message.replace(str(part), name)
            return {
                "ask": "numbers",
                "name": name,
                "numbers": {"wheelbase_m": NUMBERS["wheelbase_m"]},
                "why": why,
            }
        raise
    path = folder
    for run in found.runs:
        path = write_run(run, next_run_path(folder, run.name.split("_", 1)[-1]))
    if wishes.mapping:
        replace_file(folder / "mapping.toml", wishes.mapping.encode("utf-8"))
    findings = [str(finding).replace(str(part), name) for finding in found.findings]
    return {
        "kind": "run",
        "path": str(path),
        "set": folder.name,
        "runs": len(found.runs),
        "form": found.kind,
        "findings": findings[:_MAX_FINDINGS],
    }


def _proposal(name: str, part: Path, wishes: Wishes) -> dict[str, Any]:
    """The columns of a table and what they are taken for, to be agreed to."""
    from truing.importers.proposal import check_complete, propose
    from truing.importers.tables import read_table

    table = read_table(part)
    numbers = dict(wishes.numbers)
    given = {key: numbers[key] for key in ("nominal_voltage_v", "wheelbase_m") if key in numbers}
    proposal = propose([table], **given)
    try:
        check_complete(proposal, part)
        problem = ""
    except TruingError as error:
        problem = f"{error.message}. {error.next_step}".replace(str(part), name)
    columns = [
        [one.name, one.unit, *(f"{end:.6g}" if end == end else "–" for end in (one.low, one.high)), one.spark]
        for one in proposal.columns
    ]
    return {
        "ask": "mapping",
        "name": name,
        "toml": proposal.to_toml(),
        "columns": columns,
        "notes": [*table.notes, *proposal.notes],
        "why": problem,
    }


def _message_columns(name: str, messages: dict[str, tuple[float, float]]) -> dict[str, Any]:
    """The columns of a file of messages, whose mapping the user writes."""
    stamp = next(column for column in messages if column.endswith(".log_time"))
    lines = ["[columns]", f't_s = "{stamp}"', *(f'# {due} = "TOPIC.FIELD"' for due in _DUE)]
    columns = [[column, "", f"{low:.6g}", f"{high:.6g}", ""] for column, (low, high) in messages.items()]
    why = f"{name}: which message holds what is not known. Name a column for each line."
    return {
        "ask": "mapping",
        "name": name,
        "toml": "\n".join(lines) + "\n",
        "columns": columns,
        "notes": [],
        "why": why,
    }


def _moved(part: Path, target: Path, kind: str, folder: Path) -> dict[str, Any]:
    target.parent.mkdir(parents=True, exist_ok=True)
    part.replace(target)
    return {"kind": kind, "path": str(target), "set": folder.name}


def _new_folder(dropped: Path, name: str) -> Path:
    """A set of the file's own name; a number is added where there is one already."""
    stem = safe_name(name).split(".")[0] or "run"
    number, folder = 2, dropped / stem
    while folder.exists():
        folder, number = dropped / f"{stem}-{number}", number + 1
    return folder


def _checked(part: Path, read: Callable[[Path], object]) -> None:
    if part.stat().st_size > _MAX_TEXT_BYTES:
        raise TruingError(f"{part}: too large for what it should be")
    read(part)


def _json(part: Path) -> Any:
    """The content of a file of JSON.

    Raises
    ------
    TruingError : it is not JSON, or too large for one of ours.
    """
    if part.stat().st_size > _MAX_TEXT_BYTES:
        raise TruingError(f"{part}: too large for a diagnosis or for metadata")
    try:
        return json.loads(part.read_bytes())
    except RecursionError:
        raise TruingError(f"{part}: nested too deeply to be a diagnosis or metadata") from None
    except ValueError as error:
        raise TruingError(f"{part}: is not JSON ({error})") from None
