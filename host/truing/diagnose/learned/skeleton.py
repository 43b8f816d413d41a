"""A new file for the catalogue from a learned term: its shape as a lookup, its size as the parameter."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np

from truing.diagnose.learned.result import LearnedCorrection, LearnedTerm
from truing.errors import IdentifyError
from truing.model.correction import Term
from truing.recording.writer import replace_file

LINE_WIDTH = 108
# Place and variable: stage, what the hook asks for, the variable in it, and what it returns.
_HOOKS: dict[tuple[str, str], tuple[str, str, str, str]] = {
    ("force", "effort"): ("drive", "effort: float", "effort", "effort + size * value"),
    ("friction", "speed"): (
        "friction",
        "speed: float, direction: float",
        "speed * direction",
        "size * value",
    ),
    ("force", "heading"): ("push", "heading: float", "heading % 6.283185307179586", "size * value"),
    ("gain", "set_time"): ("gain", "elapsed: float", "elapsed", "1.0 + size * value"),
    ("inertia", "set_time"): ("inertia", "elapsed: float", "elapsed", "1.0 / (1.0 + size * value)"),
    ("inertia", "effort"): ("inertia", "command: float", "command", "1.0 / (1.0 + size * value)"),
    ("inertia", "speed"): ("inertia", "direction: float", "direction * MIDDLE", "1.0 / (1.0 + size * value)"),
}


def write_skeleton(learned: LearnedCorrection | None, path: Path) -> None:
    """Write the strongest learned term as a file for `effects/`.

    Raises
    ------
    IdentifyError : nothing was learned, or no stage of the simulation offers the term's variable.
    """
    if learned is None or not learned.terms:
        raise IdentifyError(f"{path}: there is no learned term to write", "Add --learn, or drive more runs")
    first = learned.terms[0]
    if (first.term.place, first.term.variable) not in _HOOKS:
        raise IdentifyError(
            f"{path}: no stage of the simulation offers {first.depends_on}",
            "Add a stage that does (docs/CONTRIBUTING.md, Add an effect to the catalogue)",
        )
    if not path.stem.isidentifier():
        raise IdentifyError(f"{path}: its name is the effect's: letters, digits and underscores")
    replace_file(path, skeleton(first, path.stem).encode("utf-8"))


def skeleton(learned: LearnedTerm, name: str) -> str:
    """The file's text."""
    term = learned.term
    stage, context, variable, result = _HOOKS[(term.place, term.variable)]
    title = name.replace("_", " ")
    known = "; ".join(f"{one.physics or one.shape} ({100.0 * one.share:.0f} %)" for one in learned.resembles)
    step_share = "0.05" if (term.place, term.variable) == ("friction", "speed") else "math.inf"
    return _TEXT.format(
        title=title,
        name=name,
        sentence=_wrapped(f"Written from a learned term: {learned.sentence}"),
        depends_on=learned.depends_on,
        stage=stage,
        context=context,
        variable=variable,
        result=result,
        grid=_row(_grid(term)),
        values=_row(term.values().mean(axis=0).tolist()),
        middle=repr(0.5 * term.grid[-1]),
        step_share=step_share,
        resembles=_wrapped(f"Its shape resembles: {known or 'no known shape'}."),
        needs_math="" if step_share != "math.inf" else "import math\n\n",
    )


def _wrapped(text: str) -> str:
    return textwrap.fill(text, LINE_WIDTH)


def _grid(term: Term) -> list[float]:
    """The grid, a jump drawn as a short slope: a lookup has one value at each place."""
    grid = np.array(term.grid)
    width = 1e-6 * float(np.ptp(grid))
    double = np.flatnonzero(np.diff(grid) == 0.0)
    grid[double] -= width
    grid[double + 1] += width
    return [float(x) for x in grid]


def _row(values: list[float]) -> str:
    # All of one type: a tuple of mixed numbers cannot be indexed in compiled code.
    texts = [repr(float(f"{value:.6g}")) for value in values]
    return "(\n" + "".join(f"    {text},\n" for text in texts) + ")"


_TEXT = '''"""{title}: say what it is, its equation with the source, and what it looks like in data.

{sentence}
{resembles}

The shape stands below as it was learned; `size` 1 is the robot it was learned from. Put the equation that you
recognise in its place, with parameters of its own.
"""

from __future__ import annotations

{needs_math}from truing.diagnose.effect import Effect, Parameter

GRID = {grid}
VALUES = {values}
MIDDLE = {middle}


def {stage}(size: float, {context}) -> float:
    """The learned shape over {depends_on}, times its size."""
    z = {variable}
    value = VALUES[0]
    for k in range(1, len(GRID)):
        if z > GRID[k - 1]:
            share = min((z - GRID[k - 1]) / (GRID[k] - GRID[k - 1]), 1.0)
            value = VALUES[k - 1] + share * (VALUES[k] - VALUES[k - 1])
    return {result}


EFFECT = Effect(
    name="{name}",
    title="{title}",
    equation="a learned shape over {depends_on}",
    source="learned from recordings",
    signature="see the shape",
    separated_by={{}},
    excited_by="Drive through the whole range of {depends_on}.",
    parameters=(Parameter("size", "1", -1.0, 4.0, 0.0, (0.5, 1.0)),),
    step_share={step_share},
)
'''
