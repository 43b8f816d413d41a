"""A drawn path as a short text for a page's address, and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

from truing.web.limits import CYCLE_S
from truing.web.path.segments import Node
from truing.web.path.trajectory import Cycle

# Longer addresses are refused by some browsers and servers.
_MAX_LENGTH = 6000
_KINDS = {"l": "line", "a": "arc"}


def nodes_text(nodes: Sequence[Node]) -> str:
    """Nodes as `0.5_1.25_l,...`: x and y in m, line or arc."""
    return ",".join(f"{node.x_m:.4g}_{node.y_m:.4g}_{node.kind[0]}" for node in nodes)


def nodes_of(text: str, limit: int) -> list[Node]:
    """From `nodes_text`; none from another text."""
    try:
        parts = [part.split("_") for part in text.split(",") if part]
        found = [Node(float(x), float(y), "arc" if _KINDS[kind] == "arc" else "line") for x, y, kind in parts]
    except (ValueError, KeyError):
        return []
    return found[:limit]


def cycles_text(cycles: Sequence[Cycle]) -> str:
    """Control inputs as `0.2_0_15,...`: speed (m/s), yaw rate (rad/s), how many cycles; empty if too long."""
    parts = []
    for (v, omega, duration), same in groupby(
        cycles, lambda one: (one.v_mps, one.omega_radps, one.duration_s)
    ):
        count = len(list(same))
        parts.append(f"{v:g}_{omega:g}_{count}" + ("" if duration == CYCLE_S else f"_{duration:g}"))
    text = ",".join(parts)
    return text if len(text) <= _MAX_LENGTH else ""


def cycles_of_text(text: str, limit: int) -> list[Cycle]:
    """From `cycles_text`; none from another text."""
    found: list[Cycle] = []
    try:
        for part in filter(None, text.split(",")):
            v, omega, count, duration = (part + f"_{CYCLE_S:g}").split("_")[:4]
            if part.count("_") > 3 or not all(math.isfinite(float(one)) for one in (v, omega, duration)):
                return []
            found += [Cycle(float(v), float(omega), float(duration))] * min(int(count), limit)
    except ValueError:
        return []
    return found[:limit]
