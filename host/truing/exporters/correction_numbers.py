"""The header that makes the general C source of a correction this model's (`fmu_source/correction.c`)."""

from __future__ import annotations

from collections.abc import Sequence

from truing.model.correction import Correction, Place

from .xml_file import number

_PLACES: dict[Place, str] = {
    "force": "FORCE",
    "friction": "DRY_FRICTION",
    "gain": "GAIN_SHARE",
    "inertia": "INERTIA_SHARE",
    "signal": "SIGNAL_SHARE",
}


def correction_numbers(correction: Correction | None) -> str:
    """Tables and numbers as C."""
    lines = ["/* The lookups of one model. */"]
    if correction is None:
        correction = Correction((1.0, 1.0), (1.0, 1.0), ())
    for k, term in enumerate(correction.terms):
        for name, values in (("grid", term.grid), ("left", term.left), ("right", term.right)):
            lines.append(f"static const double correction_{name}_{k}[] = {_row(values)};")
    pairs = {
        "gain_mps": correction.gain_mps,
        "tau_s": correction.time_constant_s,
        "effort_share": correction.effort_share,
        "drag": correction.drag,
    }
    lines += [f"static const double correction_{name}[2] = {_row(pair)};" for name, pair in pairs.items()]
    rows = [
        f"    {{{_PLACES[term.place]}, {_variable(term.variable)}, {number(term.constant)}, "
        f"{len(term.grid)}, "
        f"correction_grid_{k}, {{correction_left_{k}, correction_right_{k}}}}},"
        for k, term in enumerate(correction.terms)
    ]
    # C has no empty arrays: without terms there is one that nobody reads.
    rows = rows or ["    {FORCE, OWN_SPEED, 0.0, 0, 0, {0, 0}},"]
    lines += ["static const struct correction_term correction_term[] = {", *rows, "};"]
    lines.append(f"enum {{ CORRECTION_TERMS = {len(correction.terms)} }};")
    return "\n".join(lines) + "\n"


def _variable(name: str) -> str:
    return {"speed": "OWN_SPEED", "effort": "OWN_EFFORT"}.get(name, name.upper())


def _row(values: Sequence[float]) -> str:
    return "{" + ", ".join(map(number, values)) + "}"
