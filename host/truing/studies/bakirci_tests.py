"""Tests I to XVII of Bakirci 2023: what Tables III and IV print, and how a drive of them compares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from truing.identify.identification import RunIdentification


@dataclass(frozen=True, slots=True)
class PaperLevel:
    """One level of a test as the paper prints it.

    `input` is an effort fraction or m/s; `gain` is in mm/s per per cent, or a ratio; `tau_s` is the
    time constant of the step into the level.
    """

    input: float
    gain: float
    tau_s: float


@dataclass(frozen=True, slots=True)
class PaperTest:
    """One test; `mode` is the paper's label (E-L: effort, left wheel; V-B: velocity, both wheels)."""

    name: str
    mode: Literal["E-L", "V-L", "E-B", "V-B"]
    levels: tuple[PaperLevel, ...]
    tau_to_zero_s: float | None = None

    @property
    def plan(self) -> str:
        """The name of its plan."""
        return f"paper/{self.name}"

    @property
    def is_effort(self) -> bool:
        """Whether it is driven in effort mode."""
        return self.mode.startswith("E")

    @property
    def table(self) -> str:
        """The paper's table that holds it."""
        return "III" if self.mode.endswith("L") else "IV"


_L = PaperLevel
PAPER_TESTS = (
    PaperTest("I", "E-L", (_L(0.15, 9.132, 0.603),), 0.247),
    PaperTest("II", "E-L", (_L(0.30, 13.353, 0.616),), 0.231),
    PaperTest("III", "E-L", (_L(0.45, 14.544, 0.415),), 0.452),
    PaperTest("IV", "E-L", (_L(0.60, 14.177, 0.305),), 0.339),
    PaperTest("V", "V-L", (_L(0.15, 1.054, 0.528),), 0.228),
    PaperTest("VI", "V-L", (_L(0.30, 1.022, 0.257),), 0.313),
    PaperTest("VII", "V-L", (_L(0.35, 1.009, 0.524),), 0.455),
    PaperTest("VIII", "V-L", (_L(0.60, 1.017, 0.443),), 0.222),
    PaperTest("IX", "E-B", (_L(0.15, 12.131, 0.218), _L(0.30, 14.175, 0.237), _L(0.25, 14.075, 0.554))),
    PaperTest("X", "E-B", (_L(0.25, 14.225, 0.241), _L(0.40, 14.506, 0.584), _L(0.35, 14.281, 0.534))),
    PaperTest("XI", "E-B", (_L(0.35, 14.283, 0.525), _L(0.50, 14.402, 0.697), _L(0.45, 14.446, 0.571))),
    PaperTest("XII", "E-B", (_L(0.45, 14.454, 0.633), _L(0.60, 14.673, 0.635), _L(0.55, 14.558, 0.786))),
    PaperTest("XIII", "V-B", (_L(0.15, 1.039, 0.507), _L(0.30, 1.057, 0.457), _L(0.25, 1.033, 0.566))),
    PaperTest("XIV", "V-B", (_L(0.25, 1.026, 0.515), _L(0.40, 1.038, 0.447), _L(0.35, 1.069, 0.374))),
    PaperTest("XV", "V-B", (_L(0.35, 1.077, 0.504), _L(0.50, 1.011, 0.524), _L(0.45, 1.053, 0.277))),
    PaperTest("XVI", "V-B", (_L(0.45, 1.054, 0.445), _L(0.60, 1.076, 0.446), _L(0.55, 1.053, 0.161))),
    PaperTest(
        "XVII",
        "E-B",
        (
            *(_L(0.25, 14.078, 0.624), _L(0.40, 14.757, 0.675), _L(0.30, 13.839, 0.453)),
            *(_L(0.35, 14.313, 0.417), _L(0.15, 13.338, 0.362), _L(0.60, 14.831, 1.057)),
        ),
    ),
)


@dataclass(frozen=True, slots=True)
class LevelComparison:
    """One level as it was driven, beside the paper's; None where a number could not be determined.

    With both wheels driven, gain and time constant are the mean of the two.
    """

    test: PaperTest
    paper: PaperLevel
    gain: float | None
    tau_s: float | None

    @property
    def gain_error(self) -> float | None:
        """Relative deviation of the gain from the paper's."""
        return None if self.gain is None else self.gain / self.paper.gain - 1.0


@dataclass(frozen=True, slots=True)
class GainErrors:
    """How far the gains of a set of levels lie from the paper's: mean and worst absolute deviation."""

    count: int
    mean: float
    worst: float
    worst_level: str


def compare(test: PaperTest, run: RunIdentification) -> list[LevelComparison]:
    """Set each level of a driven test beside the paper's.

    A level that was not found in the run keeps its row, without numbers.
    """
    sides = [run.left] if test.mode.endswith("L") else [run.left, run.right]
    driven = [[step for step in side.steps if step.input != 0.0] for side in sides]
    compared = []
    for number, level in enumerate(test.levels):
        steps = [steps[number] for steps in driven if len(steps) == len(test.levels)]
        compared.append(
            LevelComparison(
                test,
                level,
                _mean([step.gain.value for step in steps]),
                _mean([step.time_constant.value for step in steps]),
            )
        )
    return compared


def tau_to_zero_s(test: PaperTest, run: RunIdentification) -> float | None:
    """The time constant of the last step, back to zero, s."""
    sides = [run.left] if test.mode.endswith("L") else [run.left, run.right]
    ends = [side.steps[-1] for side in sides if side.steps and side.steps[-1].input == 0.0]
    return _mean([step.time_constant.value for step in ends])


def gain_errors(levels: Sequence[LevelComparison]) -> GainErrors:
    """Mean and worst deviation; a level without a gain counts as infinitely wrong."""
    errors = [(math.inf if c.gain_error is None else abs(c.gain_error), c) for c in levels]
    worst, level = max(errors, key=lambda pair: pair[0])
    unit = f"{level.paper.input:.0%}" if level.test.is_effort else f"{level.paper.input:.2f} m/s"
    return GainErrors(
        len(errors), sum(e for e, _ in errors) / len(errors), worst, f"{level.test.name} at {unit}"
    )


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known and len(known) == len(values) else None
