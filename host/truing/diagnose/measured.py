"""Numbers of the robot that its user measured directly: with a tape measure, by ten turns of a wheel by hand.

No drive distinguishes an encoder's scale from a wheel's radius while the gain is free: both change every
speed and every travel by one factor. A direct measurement of one of the two rules its effect out, and with
it the ambiguity (`--measured`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from truing.errors import IdentifyError
from truing.recording.baseline import RobotGeometry
from truing.recording.run import RecordingSet

# Numbers of [robot] that can be measured, each with the effect that is an error of it.
EFFECT_OF = {
    "wheel_radius_m": "wheel_radius_error",
    "wheelbase_m": "wheelbase_error",
    "counts_per_rev": "encoder_scale",
}


@dataclass(frozen=True, slots=True)
class Measured:
    """A number of the baseline's [robot] table as measured, in the table's unit."""

    name: str
    value: float


def parse_measured(texts: Iterable[str]) -> tuple[Measured, ...]:
    """Measured numbers from `NAME=VALUE`.

    Raises
    ------
    IdentifyError
        A name is unknown, or its value is no positive number.
    """
    return tuple(_parsed(text) for text in texts)


def _parsed(text: str) -> Measured:
    name, _, number = text.partition("=")
    if name not in EFFECT_OF:
        raise IdentifyError(
            f"--measured: {name or text!r} is not a number that can be given",
            f"Take one of: {', '.join(f'{known}=VALUE' for known in EFFECT_OF)}",
        )
    try:
        value = float(number)
    except ValueError:
        value = -1.0
    if not 0.0 < value < float("inf"):
        raise IdentifyError(
            f"--measured {text}: {number or 'nothing'!r} is no positive number", f"Give {name}=VALUE"
        )
    return Measured(name, value)


def with_measured(recordings: RecordingSet, measured: Sequence[Measured]) -> RecordingSet:
    """Recordings whose baseline has the measured numbers."""
    if not measured or recordings.baseline is None:
        return recordings
    values: dict[str, Any] = {one.name: one.value for one in measured}
    return recordings.with_geometry(RobotGeometry(**values))


def ruled_out(measured: Sequence[Measured]) -> frozenset[str]:
    """Effects that the measurements rule out."""
    return frozenset(EFFECT_OF[one.name] for one in measured)


def how_to_resolve(effects: Iterable[str]) -> str:
    """The option that takes a measurement which rules one of these effects out; empty where there is none."""
    names = [name for name, effect in EFFECT_OF.items() if effect in effects]
    return " or ".join(f"--measured {name}=VALUE" for name in names)
