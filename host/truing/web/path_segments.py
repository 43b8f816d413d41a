"""Lines and arcs drawn with the mouse, and the control inputs that drive them within a robot's limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from truing.web.limits import CYCLE_S, Limits
from truing.web.pose import Pose, wrapped
from truing.web.trajectory import Cycle

NodeKind: TypeAlias = Literal["line", "arc"]

# Clicks closer than this mean the same point; arcs flatter than this are lines.
_SAME_M = 0.02
_FLATTEST_M = 200.0


@dataclass(frozen=True, slots=True)
class Node:
    """Where a segment ends, and how it gets there: straight after a turn on the spot, or along an arc that
    leaves in the direction the robot already faces.
    """

    x_m: float
    y_m: float
    kind: NodeKind = "line"


@dataclass(frozen=True, slots=True)
class Line:
    """Straight on for `length_m`."""

    length_m: float


@dataclass(frozen=True, slots=True)
class Turn:
    """On the spot by `angle_rad`, positive to the left."""

    angle_rad: float


@dataclass(frozen=True, slots=True)
class Arc:
    """Along a circle of `radius_m`, positive to the left, through `angle_rad`, positive forwards."""

    radius_m: float
    angle_rad: float


PathSegment: TypeAlias = Line | Turn | Arc


def segments_through(start: Pose, nodes: Sequence[Node]) -> list[PathSegment]:
    """The lines, turns and arcs that lead from `start` through every node in order."""
    found: list[PathSegment] = []
    at = start
    for node in nodes:
        seen = at.inverse().compose(Pose(node.x_m, node.y_m))
        distance = math.hypot(seen.x_m, seen.y_m)
        if distance < _SAME_M:
            continue
        bearing = math.atan2(seen.y_m, seen.x_m)
        added: list[PathSegment] = []
        if node.kind == "arc" and abs(bearing) > 1e-3 and abs(bearing) < math.pi - 1e-3:
            # The circle that touches the heading and goes through the point: a chord of angle twice the
            # bearing.
            radius = distance / (2.0 * math.sin(bearing))
            if abs(radius) < _FLATTEST_M:
                added = [Arc(radius, abs(2.0 * bearing))]
        if not added:
            added = [Turn(bearing), Line(distance)] if abs(bearing) > 1e-3 else [Line(distance)]
        for segment in added:
            at = end_of(at, segment)
        found += added
    return found


def end_of(start: Pose, segment: PathSegment) -> Pose:
    """Where a segment ends."""
    if isinstance(segment, Line):
        return start.advanced(segment.length_m, 0.0, 1.0)
    if isinstance(segment, Turn):
        return Pose(start.x_m, start.y_m, start.theta_rad + segment.angle_rad)
    return start.advanced(
        abs(segment.radius_m) * segment.angle_rad,
        math.copysign(segment.angle_rad, segment.radius_m),
        1.0,
    )


def cycles_of(segments: Sequence[PathSegment], limits: Limits, share: float = 1.0) -> list[Cycle]:
    """Control inputs that drive each segment from rest to rest, exactly to its end.

    Parameters
    ----------
    share : of the limits' speeds to use.
    """
    found: list[Cycle] = []
    for segment in segments:
        if found:
            found.append(
                Cycle(0.0, 0.0)
            )  # from one sense of turning to the other the robot stands for a cycle
        if isinstance(segment, Line):
            fastest, accel = limits.on_radius(math.inf)
            found += [Cycle(v, 0.0) for v in _profile(segment.length_m, share * fastest, accel)]
        elif isinstance(segment, Turn):
            angle = wrapped(segment.angle_rad)
            fastest, accel = limits.on_the_spot()
            rates = _profile(abs(angle), share * fastest, accel)
            found += [Cycle(0.0, math.copysign(rate, angle)) for rate in rates]
        else:
            fastest, accel = limits.on_radius(segment.radius_m)
            length = abs(segment.radius_m) * segment.angle_rad
            found += [Cycle(v, v / segment.radius_m) for v in _profile(length, share * fastest, accel)]
    return found


def _profile(distance: float, fastest: float, accel: float) -> list[float]:
    """Speed of each cycle: up in steps that the acceleration allows, level, down; their sum is the distance.

    Steps of one cycle cannot hit any distance at full speed: a cycle more is taken and all speeds shrink
    alike, which keeps every step within the acceleration too.
    """
    step = accel * CYCLE_S
    # m - 1 steps up lead to a level of m steps at most; they cover step * CYCLE_S * m^2 with one level cycle.
    m = min(
        max(1, math.ceil(fastest / step - 1e-9)), max(1, math.floor(math.sqrt(distance / (step * CYCLE_S))))
    )
    ramp = [step * k for k in range(1, m)]
    top = min(fastest, step * m)
    rest = distance - 2.0 * sum(ramp) * CYCLE_S
    level = max(1, math.ceil(rest / (top * CYCLE_S) - 1e-9))
    shape = [*ramp, *[top] * level, *ramp[::-1]]
    factor = distance / (sum(shape) * CYCLE_S)
    return [speed * factor for speed in shape]
