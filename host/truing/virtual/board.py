"""Makes a virtual board from what the user chose: firmware image, robot, seed."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truing.errors import FileError, VirtualBoardError
from truing.extras import require
from truing.virtual.options import VirtualOptions
from truing.workspace import how_to_build, image_path

if TYPE_CHECKING:
    from hil_sim import VirtualRobot
    from hil_sim.plant import RobotParameters


def require_virtual_board() -> None:
    """Refuse to go on where nothing can be simulated.

    Raises
    ------
    LibraryMissingError : the extra `sim` is not installed.
    VirtualBoardError : there is no native library.
    """
    require("sim")
    from hil_sim import native

    if not native.LIBRARY.is_file():
        raise VirtualBoardError(f"{native.LIBRARY}: there is no virtual board here", how_to_build())


def make_virtual_robot(options: VirtualOptions, number: int = 1) -> VirtualRobot:
    """Return a virtual board that has just been switched on.

    Parameters
    ----------
    number : 1 to 255; boards of different numbers differ in their chip's id.

    Raises
    ------
    LibraryMissingError : the extra `sim` is not installed.
    VirtualBoardError : no image or no native library, or the board does not start.
    """
    require_virtual_board()
    image = options.image or image_path()
    try:
        from hil_sim import DEFAULT_BOARD_ID, VirtualRobot

        board_id = DEFAULT_BOARD_ID[:-1] + bytes([number])
        return VirtualRobot(
            image,
            robot_parameters(options.robot),
            options.seed,
            board_id,
            crystal_ppm=options.crystal_ppm,
        )
    except (OSError, ImportError, RuntimeError, ValueError) as error:
        raise VirtualBoardError(f"the virtual board cannot start: {error}", how_to_build()) from error


def robot_parameters(path: Path | None) -> RobotParameters:
    """Return the paper's robot with what the TOML file at `path` changes of it.

    Tables are named as in `hil_sim.plant.RobotParameters`: `[chassis] mass_kg = 6.0`.
    """
    from hil_sim.plant import PlantError, RobotParameters

    robot = RobotParameters.msrp()
    if path is None:
        return robot
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileError(path, f"is not TOML: {error}") from error
    for name, value in _flat(path, content):
        try:
            robot = robot.changed(**{name.replace(".", "__"): value})
        except (PlantError, TypeError) as error:
            raise FileError(path, f"{name}: {error}", "write for example: [chassis] mass_kg = 6.0") from error
    problem = robot.problem()
    if problem is not None:
        raise FileError(path, problem)
    return robot


def _flat(path: Path, table: dict[str, Any], before: str = "") -> Iterator[tuple[str, float]]:
    """Names with dots, and numbers."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flat(path, value, f"{before}{key}.")
        elif isinstance(value, bool) or not isinstance(value, int | float):
            raise FileError(path, f"{before}{key}: must be a number")
        else:
            yield before + key, float(value)
