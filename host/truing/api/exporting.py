"""`truing.export`: a model as the file of a simulator or a controller."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from truing.api.models import AnyModel, as_robot_model, corrected
from truing.diagnose.present.exports import BOARD, Export, write_export
from truing.diagnose.result import Diagnosis
from truing.errors import OutputError, TruingError
from truing.exporters import ExportOptions, exporter, exporters, write_model
from truing.exporters.into import patched
from truing.exporters.terms import DEFAULTS
from truing.foxglove.recording_file import write_set
from truing.recording.frames import preformatted
from truing.recording.run import RecordingSet
from truing.recording.writer import check_output

MCAP = "mcap"


@dataclass(frozen=True, slots=True)
class Exported:
    """The files that were written, and what their format leaves out, in lines."""

    kind: str
    files: tuple[Path, ...]
    lines: tuple[str, ...]

    def __str__(self) -> str:
        return "\n".join(self.lines)

    def _repr_html_(self) -> str:
        return preformatted(str(self))


def export(
    model: AnyModel | RecordingSet,
    path: str | Path,
    to: str | None = None,
    *,
    options: ExportOptions = DEFAULTS,
    into: str | Path | None = None,
    keep: str | None = None,
) -> Exported:
    """Write a model as a file of another program, and say what the file cannot hold.

    Parameters
    ----------
    model : what `identify`, `fit` or `diagnose` returned, a `RobotModel`, a `Baseline`, or a file of these.
    path : of the file.
    to : the kind: toml, mjcf, urdf, sdf, fmu, c, python, simulink, mat, c-header, ros2-control, wpilib;
        and after a diagnosis params, values for the board. The default is the one kind whose files end
        as `path` does. Recordings (what `read` returned) are written as mcap, for Foxglove: a file per
        run into the folder `path`, or one run to the file.
    options : what a model does not say and some formats need (voltage in V, inertia in kg m^2, lengths in m).
    into : your own MJCF, URDF or SDF file, which `path` then is with the model in it; where both are the same
        file, a backup is kept beside it.
    keep : what is right in that file, masses or motors; the default is what changes it less.

    Returns
    -------
    Exported
        `files`, the main one first, and `lines`.

    Raises
    ------
    TruingError
        The kind is unknown, the model lacks what it needs, or the file would not hold what it claims.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import truing
    >>> folder = Path(tempfile.mkdtemp())
    >>> truing.export("docs/example/baseline.toml", folder / "robot.py").files[0].name
    'robot.py'
    """
    path = Path(path)
    check_output(path)
    if isinstance(model, RecordingSet):
        return _of_recordings(model, path, to)
    if into is not None:
        return _into(model, path, Path(into), options, keep)
    kind = to or _kind(path)
    if isinstance(model, Diagnosis):
        return _of_diagnosis(model, path, kind, options)
    robot, unused = as_robot_model(model)
    files, lines = write_model(kind, robot, path, options)
    return Exported(kind, files, (*(f"note: {note}" for note in unused), *lines))


def _into(model: AnyModel, path: Path, file: Path, options: ExportOptions, keep: str | None) -> Exported:
    robot, unused = as_robot_model(model)
    made = patched(file, robot, options, keep=keep)
    same = path.exists() and path.samefile(file)
    written, backup = made.write(None if same else path)
    lines = [f"note: {note}" for note in (*unused, *made.lines)] + [f"written: {written}"]
    files = (written,) if backup is None else (written, backup)
    return Exported(made.kind, files, tuple(lines))


def _of_recordings(recordings: RecordingSet, path: Path, kind: str | None) -> Exported:
    if kind not in (None, MCAP):
        raise TruingError(f"recordings cannot be written as {kind}", f"Give to={MCAP!r}, or a model")
    files = write_set(recordings, path)
    return Exported(MCAP, files, tuple(f"written: {file}" for file in files))


def _of_diagnosis(diagnosis: Diagnosis, path: Path, kind: str, options: ExportOptions) -> Exported:
    if kind != BOARD:
        exporter(kind)  # an unknown kind is an error before any work
    model = corrected(diagnosis)
    recordings = diagnosis.recordings
    assert recordings is not None
    files, lines = write_export(Export(kind, path), model, recordings, diagnosis, options=options)
    if not files:
        raise OutputError(path, lines[0])
    return Exported(kind, files, (*(f"note: {note}" for note in model.notes), *lines))


def _kind(path: Path) -> str:
    kinds = [kind for kind, one in exporters().items() if path.suffix == one.SUFFIX]
    if len(kinds) == 1:
        return kinds[0]
    which = f"several kinds end in {path.suffix}" if kinds else f"no kind ends in {path.suffix or 'nothing'}"
    raise TruingError(f"{path}: {which}", f"Give to=KIND, one of: {', '.join(kinds or exporters())}")
