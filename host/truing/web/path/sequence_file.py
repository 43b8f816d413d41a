"""Conversion of control inputs to a sequence (the plan that a board runs) and its file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from truing.errors import PlanError
from truing.plan import MAX_SEGMENTS, Kind, Plan, Segment, load_plan
from truing.recording.writer import replace_file
from truing.web.path.trajectory import Cycle

# Of the plans that are drawn.
LOG_RATE_HZ = 20
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,60}")


def plan_of(name: str, cycles: Sequence[Cycle]) -> Plan:
    """The plan of these control inputs; consecutive equal ones become one segment.

    Raises
    ------
    PlanError : there is no motion, or the inputs change more often than a board has segments.
    """
    segments: list[Segment] = []
    for cycle in cycles:
        last = segments[-1] if segments else None
        if last is not None and (last.a, last.b) == (cycle.v_mps, cycle.omega_radps):
            segments[-1] = Segment(Kind.TWIST, round(last.duration_s + cycle.duration_s, 3), last.a, last.b)
        else:
            segments.append(Segment(Kind.TWIST, round(cycle.duration_s, 3), cycle.v_mps, cycle.omega_radps))
    if not any(segment.a or segment.b for segment in segments):
        raise PlanError("the trajectory is empty", "drive the model robot with the keys, or draw a path")
    if len(segments) > MAX_SEGMENTS:
        raise PlanError(
            f"the trajectory has {len(segments)} different control inputs; a board holds {MAX_SEGMENTS}",
            "undo a part of it, or draw it with lines and arcs",
        )
    return Plan(name, f"{name}: drawn in the view", tuple(segments), LOG_RATE_HZ)


def cycles_of_plan(plan: Plan, wheelbase_m: float) -> list[Cycle]:
    """The control inputs of a plan of twists and wheel speeds.

    Raises
    ------
    PlanError : it contains efforts, whose speeds only a model could predict.
    """
    found = []
    for segment in plan.segments:
        if segment.kind is Kind.EFFORT:
            raise PlanError(
                f"{plan.name}: efforts cannot be converted to control inputs [v, omega]",
                "choose a plan of twists",
            )
        if segment.kind is Kind.TWIST:
            v, omega = segment.a, segment.b
        else:
            v, omega = 0.5 * (segment.a + segment.b), (segment.b - segment.a) / wheelbase_m
        found.append(Cycle(v, omega, segment.duration_s))
    return found


def to_toml(plan: Plan) -> str:
    """The plan as TOML, which `load_plan` reads back unchanged."""
    lines = [f"# {len(plan.segments)} control inputs u(t) = [v, omega], {plan.duration_s:.1f} s", ""]
    lines.append(f"title = {_quoted(plan.title)}")
    if plan.log_rate_hz:
        lines.append(f"log_rate_hz = {plan.log_rate_hz}")
    if plan.unattended:
        lines.append("unattended = true")
    for segment in plan.segments:
        pair = f"{{ v_mps = {segment.a!r}, omega_radps = {segment.b!r} }}"
        value = pair if segment.kind is Kind.TWIST else f"[{segment.a!r}, {segment.b!r}]"
        lines += [
            "",
            "[[segment]]",
            f"duration_s = {segment.duration_s!r}",
            f"{segment.kind.value} = {value}",
        ]
    return "\n".join(lines) + "\n"


def save_sequence(plan: Plan, folder: Path) -> Path:
    """Write a plan under its own name into `folder`, and check that it can be read back."""
    path = folder / f"{checked_name(plan.name)}.toml"
    replace_file(path, to_toml(plan).encode())
    load_plan(str(path))
    return path


def checked_name(name: str) -> str:
    """`name` if it is valid as a file name: no folder, not hidden.

    Raises
    ------
    PlanError : it is not valid.
    """
    if not _NAME.fullmatch(name):
        raise PlanError(f"{name!r} is not a valid file name", "use letters, digits, _ - and . (up to 61)")
    return name


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ")
    return f'"{escaped}"'
