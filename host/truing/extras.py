"""What only some tasks need: the extras of the package, and one way to say which is missing."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass

from truing.errors import LibraryMissingError


@dataclass(frozen=True, slots=True)
class Extra:
    """An extra of the package `truing`.

    Attributes
    ----------
    purpose : what needs it, as the subject of a sentence.
    modules : what is imported from it.
    """

    purpose: str
    modules: tuple[str, ...]


EXTRAS = {
    "sim": Extra("the virtual board", ("unicorn",)),
    "view": Extra("the view in the browser", ("nicegui", "PIL", "yaml")),
    "can": Extra("a CAN bus", ("can", "isotp")),
    "bags": Extra("reading MCAP files and ROS bags", ("mcap", "rosbags")),
    "plots": Extra("drawing pictures", ("matplotlib",)),
    "fleet": Extra("a fleet of robots", ("distributed", "pyarrow", "statsmodels")),
    "s3": Extra("reading and writing S3", ("s3fs",)),
    "foxglove": Extra("serving Foxglove and writing MCAP files", ("foxglove",)),
    "bullet": Extra("simulating a robot in Bullet", ("pybullet",)),
    "engines": Extra("simulating a robot in a physics engine", ("mujoco",)),
}


def require(name: str) -> None:
    """Refuse to go on without an extra.

    Raises
    ------
    LibraryMissingError : a package of it is not installed.
    """
    extra = EXTRAS[name]
    missing = [module for module in extra.modules if importlib.util.find_spec(module) is None]
    if missing:
        what = f"the package {missing[0]}" if len(missing) == 1 else f"the packages {', '.join(missing)}"
        raise LibraryMissingError(
            f"{extra.purpose} needs {what}, which {'is' if len(missing) == 1 else 'are'} not installed",
            f"pip install 'truing[{name}]'",
        )
