"""Models for simulators and controllers: one exporter per format, all of one form."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, cast

from truing.errors import TruingError
from truing.model.robot_model import RobotModel

from .source import read_model
from .terms import DEFAULTS, ExportOptions, left_out

__all__ = ["ExportOptions", "Exporter", "exporter", "exporters", "notes", "read_model", "write_model"]


class Exporter(Protocol):
    """What a module of this package offers.

    Attributes
    ----------
    KIND : the word for `--to`.
    TITLE : what it is for, one line.
    SUFFIX : how the file's name ends.
    HOLDS : the terms of the model that the format has a place for (see `terms.TERMS`).
    """

    KIND: str
    TITLE: str
    SUFFIX: str
    HOLDS: frozenset[str]

    def write(self, model: RobotModel, path: Path, options: ExportOptions = ...) -> tuple[Path, ...]:
        """Write the model; the paths written, the main one first."""


def exporters() -> dict[str, Exporter]:
    """Every exporter by its kind."""
    from . import (
        c_header,
        c_source,
        fmu,
        mjcf,
        model_mat,
        model_toml,
        python_function,
        ros2_control,
        sdf,
        state_space,
        urdf,
        wpilib_gains,
    )

    modules = (
        model_mat,
        model_toml,
        c_header,
        c_source,
        python_function,
        state_space,
        urdf,
        sdf,
        mjcf,
        ros2_control,
        wpilib_gains,
        fmu,
    )
    return {module.KIND: cast("Exporter", module) for module in modules}


def notes(kind: str, model: RobotModel, options: ExportOptions = DEFAULTS) -> tuple[str, ...]:
    """What a format leaves out of a model, and what else its user should know.

    A module says the latter with `remarks(model, options)`, where it has something to say.
    """
    module = exporter(kind)
    remarks = getattr(module, "remarks", None)
    more: tuple[str, ...] = remarks(model, options) if remarks is not None else ()
    return (*left_out(model, module.HOLDS), *more)


def write_model(
    kind: str, model: RobotModel, path: Path, options: ExportOptions = DEFAULTS
) -> tuple[tuple[Path, ...], list[str]]:
    """Write a model as one kind: the paths written, and lines that say so and what the kind leaves out."""
    files = exporter(kind).write(model, path, options)
    lines = [f"written: {file}" for file in files]
    return files, lines + [f"note: {kind}: {note}" for note in notes(kind, model, options)]


def exporter(kind: str) -> Exporter:
    """The exporter of this kind."""
    known = exporters()
    if kind not in known:
        raise TruingError(f"there is no export kind {kind!r}", f"There are: {', '.join(known)}")
    return known[kind]
