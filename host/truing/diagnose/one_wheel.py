"""The result for one wheel: what a diagnosis of one wheel alone says nothing about is left out of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

from truing.diagnose.result import Compensation, Diagnosis
from truing.recording.run import Wheel

Value = TypeVar("Value")


def without_wheel(values: Mapping[str, Value], other: Wheel) -> dict[str, Value]:
    """The values whose names do not say that they are the other wheel's."""
    return {name: value for name, value in values.items() if other not in name.split("_")}


def of_one_wheel(diagnosis: Diagnosis, wheel: Wheel) -> Diagnosis:
    """The diagnosis without parameters, signals and findings of the other wheel, which was not looked at."""
    other: Wheel = "left" if wheel == "right" else "right"

    def kept(values: Mapping[str, Value]) -> dict[str, Value]:
        return without_wheel(values, other)

    compensation = diagnosis.compensation
    if compensation is not None:
        compensation = Compensation(kept(compensation.parameters), compensation.notes)
    return replace(
        diagnosis,
        effects=tuple(replace(one, parameters=kept(one.parameters)) for one in diagnosis.effects),
        baseline_effects={name: kept(values) for name, values in diagnosis.baseline_effects.items()},
        mismatch=tuple(span for span in diagnosis.mismatch if other not in span.signal.split("_")),
        recorder=kept(diagnosis.recorder),
        noise=tuple(one for one in diagnosis.noise if other not in one.signal.split("_")),
        numbers=tuple(one for one in diagnosis.numbers if one.wheel != other),
        checks=tuple(check for check in diagnosis.checks if check.wheel != other),
        compensation=compensation,
    )
