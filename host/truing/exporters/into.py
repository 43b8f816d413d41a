"""A model put into the user's own MJCF, URDF or SDF file: what changes, and the file as it becomes."""

from __future__ import annotations

import difflib
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from truing.errors import FileError
from truing.model.robot_model import RobotModel
from truing.recording.writer import replace_file

from .in_mujoco import driven
from .mjcf import HOLDS as MJCF_HOLDS
from .own_joints import HOLDS as JOINTS_HOLD
from .own_joints import JointFile, SdfFile, UrdfFile
from .own_mjcf import drives, load
from .own_mjcf import read as read_mjcf
from .own_mjcf import write as write_mjcf
from .own_robot import OwnRobot, Patch, patch_for
from .recorded import Simulate, Task, error_mps
from .terms import DEFAULTS, ExportOptions, left_out
from .xml_edit import XmlEdit

MJCF, URDF, SDF = "mjcf", "urdf", "sdf"
_ROOTS = {"mujoco": MJCF, "robot": URDF, "sdf": SDF}


@dataclass(frozen=True, slots=True)
class PatchedFile:
    """A user's file with a model in it; nothing is written yet.

    Attributes
    ----------
    kind : `MJCF`, `URDF` or `SDF`.
    model : what was put in.
    joints : of the wheels, left first.
    before, after : the file's bytes.
    lines : what changes and what the format cannot hold.
    """

    path: Path
    kind: str
    model: RobotModel
    joints: tuple[str, str]
    own: OwnRobot
    patch: Patch
    before: bytes
    after: bytes
    lines: tuple[str, ...]

    def diff(self) -> str:
        """The change as a unified diff."""
        old, new = (text.decode("utf-8").splitlines(keepends=True) for text in (self.before, self.after))
        return "".join(difflib.unified_diff(old, new, str(self.path), f"{self.path} (patched)"))

    def errors_mps(self, all_tasks: Sequence[Task]) -> tuple[float, float] | None:
        """Error on recordings before and after, m/s, in the program that runs the file; None where none does.

        Raises
        ------
        FileError : the program does not load the patched file.
        """
        if self.kind != MJCF:
            return None
        return tuple(  # type: ignore[return-value]
            error_mps(all_tasks, self.simulation(content), self.model)
            for content in (self.before, self.after)
        )

    def simulation(self, content: bytes) -> Simulate:
        """What MuJoCo makes of this content, which may name files beside the user's."""
        handle, name = tempfile.mkstemp(prefix=".truing-", suffix=self.path.suffix, dir=self.path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            compiled = load(Path(name))
        finally:
            Path(name).unlink()
        return driven(compiled, drives(compiled, self.path, self.joints), self.own.radius_m)

    def write(self, out: Path | None = None) -> tuple[Path, Path | None]:
        """Write it: elsewhere, or in place with a backup beside it; the file and the backup."""
        if out is not None:
            replace_file(out, self.after)
            return out, None
        backup = next(
            name
            for number in range(1000)
            if not (name := self.path.with_name(f"{self.path.name}.bak{number or ''}")).exists()
        )
        replace_file(backup, self.before)
        replace_file(self.path, self.after)
        return self.path, backup


def patched(
    path: Path,
    model: RobotModel,
    options: ExportOptions = DEFAULTS,
    *,
    keep: str | None = None,
    joints: tuple[str, str] | None = None,
) -> PatchedFile:
    """Put a model into a user's file.

    Parameters
    ----------
    keep : what is right in the file, `masses` or `motors`; None: what changes it less.
    joints : of the wheels, left first; None: they are found.
    """
    radius = options.radius(model)
    edit = XmlEdit(path)
    kind = _ROOTS.get(edit.root.tag)
    if kind == MJCF:
        compiled = load(path)
        pair = drives(compiled, path, joints)
        own = read_mjcf(path, compiled, pair, radius)
        patch = patch_for(model, own, keep)
        after = write_mjcf(path, compiled, pair, patch)
        holds = MJCF_HOLDS
    elif kind in (URDF, SDF):
        file: JointFile = UrdfFile(path) if kind == URDF else SdfFile(path)
        names = file.pair(joints)
        own = file.robot(names, radius)
        patch = patch_for(model, own, keep)
        after = file.patched(names, patch)
        holds = JOINTS_HOLD
    else:
        raise FileError(path, f"begins with <{edit.root.tag}>: it is no MJCF, URDF or SDF")
    said = (*patch.lines(own), *left_out(model, holds))
    found = (own.left.joint, own.right.joint)
    return PatchedFile(path, str(kind), model, found, own, patch, edit.source, after, said)
