"""A model put into the user's own MJCF, URDF or SDF file: what changes, and the file as it becomes."""

from __future__ import annotations

import difflib
import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from truing.errors import FileError
from truing.model.robot_model import RobotModel
from truing.recording.writer import replace_file

from .in_mujoco import driven
from .mjcf import HOLDS as MJCF_HOLDS
from .own_joints import HOLDS as JOINTS_HOLD
from .own_joints import SdfFile, UrdfFile
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


@dataclass(frozen=True, slots=True)
class OwnFile:
    """A user's file as it was read, for any number of models.

    Attributes
    ----------
    kind : `MJCF`, `URDF` or `SDF`.
    holds : what of a model the format holds.
    apply : a patch to the file's bytes with it.
    """

    path: Path
    kind: str
    own: OwnRobot
    content: bytes
    holds: frozenset[str]
    apply: Callable[[Patch], bytes]

    def with_model(self, model: RobotModel, keep: str | None = None) -> PatchedFile:
        """The file with a model in it; `keep` as in `patched`."""
        patch = patch_for(model, self.own, keep)
        said = (*patch.lines(self.own), *left_out(model, self.holds))
        joints = (self.own.left.joint, self.own.right.joint)
        after = self.apply(patch)
        return PatchedFile(self.path, self.kind, model, joints, self.own, patch, self.content, after, said)


def own_file(path: Path, radius_m: float, joints: tuple[str, str] | None = None) -> OwnFile:
    """Read a user's file.

    Parameters
    ----------
    joints : of the wheels, left first; None: they are found.

    Raises
    ------
    FileError : it is no robot of a known format, or its wheels are not found.
    """
    edit = XmlEdit(path)
    kind = _ROOTS.get(edit.root.tag)
    if kind == MJCF:
        compiled = load(path)
        pair = drives(compiled, path, joints)
        own = read_mjcf(path, compiled, pair, radius_m)
        return OwnFile(
            path, MJCF, own, edit.source, MJCF_HOLDS, lambda patch: write_mjcf(path, compiled, pair, patch)
        )
    if kind in (URDF, SDF):
        joint_file = UrdfFile if kind == URDF else SdfFile
        file = joint_file(path)
        names = file.pair(joints)
        own = file.robot(names, radius_m)
        # Edits are kept with the file that they are for: every patch has its own.
        return OwnFile(
            path, kind, own, edit.source, JOINTS_HOLD, lambda patch: joint_file(path).patched(names, patch)
        )
    raise FileError(path, f"begins with <{edit.root.tag}>: it is no MJCF, URDF or SDF")


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
    return own_file(path, options.radius(model), joints).with_model(model, keep)
