"""The files of `--export KIND:FILE`: checked before the diagnosis, written after it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from truing.diagnose.present.compensation import compensate
from truing.diagnose.present.corrected_model import CorrectedModel, corrected_model
from truing.diagnose.present.export_check import FAILED, check_baseline, check_format
from truing.diagnose.result import Diagnosis
from truing.errors import TruingError
from truing.exporters import ExportOptions, exporter, exporters, write_model
from truing.exporters.terms import CORRECTION, DEFAULTS
from truing.recording.run import RecordingSet, Wheel
from truing.recording.writer import replace_file
from truing_protocol import PARAMETERS

BOARD = "params"


@dataclass(frozen=True, slots=True)
class Export:
    """One file that is wanted."""

    kind: str
    path: Path


def parse_exports(texts: Sequence[str]) -> tuple[Export, ...]:
    """`KIND:FILE` each; an unknown kind is an error that lists the kinds."""
    kinds = (*exporters(), BOARD)
    found = []
    for text in texts:
        kind, separator, file = text.partition(":")
        if not separator or not file:
            raise TruingError(
                f"--export {text}: it must be KIND:FILE", "for example --export toml:model.toml"
            )
        if kind not in kinds:
            raise TruingError(f"--export {text}: there is no kind {kind!r}", f"There are: {', '.join(kinds)}")
        found.append(Export(kind, Path(file)))
    return tuple(found)


def write_exports(
    wanted: Sequence[Export], recordings: RecordingSet, diagnosis: Diagnosis, wheel: Wheel | None = None
) -> list[str]:
    """Write each file; one line for each, one for everything that a format cannot hold, and what that costs.

    Parameters
    ----------
    wheel : the one that was diagnosed alone; None: both.
    """
    baseline = recordings.baseline
    assert baseline is not None
    corrected = corrected_model(diagnosis, baseline)
    lines = [f"note: {note}" for note in corrected.notes]
    for export in wanted:
        lines += write_export(export, corrected, recordings, diagnosis, wheel)[1]
    return lines


def write_export(
    export: Export,
    corrected: CorrectedModel,
    recordings: RecordingSet,
    diagnosis: Diagnosis,
    wheel: Wheel | None = None,
    options: ExportOptions = DEFAULTS,
) -> tuple[tuple[Path, ...], list[str]]:
    """Write one file: the files written, none where it would be wrong, and the lines that say so."""
    path = export.path
    if export.kind == BOARD:
        lines = _write_parameters(path, recordings, diagnosis)
        return ((path,) if lines[0].startswith("written: ") else ()), lines
    if export.kind == "toml":
        text = corrected.to_toml()
        checked = check_baseline(text, path, recordings, diagnosis, wheel)
        if any(line.startswith(FAILED) for line in checked):
            return (), [f"not written: {path} ({line.removeprefix(FAILED)})" for line in checked]
        replace_file(path, text.encode("utf-8"))
        return (path,), [f"written: {path}", *checked]
    files, said = write_model(export.kind, corrected.model, path, options)
    checked = check_format(export.kind, corrected, diagnosis)
    if corrected.model.correction is not None and CORRECTION in exporter(export.kind).HOLDS:
        checked = [f"{line}, both without the learned correction" for line in checked]
    return files, [*said, *checked]


def _write_parameters(path: Path, recordings: RecordingSet, diagnosis: Diagnosis) -> list[str]:
    assert recordings.baseline is not None
    found = diagnosis.compensation or compensate(diagnosis, recordings.baseline)
    if found is None or not found.parameters:
        return [f"not written: {path} (there is nothing that the board can compensate)"]
    documents = {item.name: item for item in PARAMETERS}
    lines = [f"# From the diagnosis of {diagnosis.name}".replace("\n", " ")]
    lines += ["# `truing params load --file` puts them into force.", "", "[parameters]"]
    for name, value in found.parameters.items():
        item = documents[name]
        unit = f"{item.unit}; " if item.unit else ""
        lines.append(f"{name} = {value:.6g}  # {unit}{item.doc}")
    replace_file(path, ("\n".join(lines) + "\n").encode("utf-8"))
    return [f"written: {path}", *(f"note: params: {note}" for note in found.notes)]
