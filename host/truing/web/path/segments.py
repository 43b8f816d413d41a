"""Lines and arcs drawn with the mouse, and the control inputs that drive them within a robot's limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from truing.web.limits import CYCLE_S, Limits
from truing.web.path.trajectory import Cycle
from truing.web.pose import Pose, wrapped

NodeKind: TypeAlias = Literal["line", "arc"]

# Points closer than this are the same point; arcs with a larger radius are lines.
_MIN_SPACING_M = 0.02
_MAX_RADIUS_M = 200.0


@dataclass(frozen=True, slots=True)
class Node:
    """End point of a segment and its kind: straight after a turn in place, or along an arc that starts
    tangentially to the present heading.
    """

    x_m: float
    y_m: float
    kind: NodeKind = "line"


@dataclass(frozen=True, slots=True)
class Line:
    """Straight ahead for `length_m`."""

    length_m: float


@dataclass(frozen=True, slots=True)
class Turn:
    """Turn in place by `angle_rad`, positive to the left."""

    angle_rad: float


@dataclass(frozen=True, slots=True)
class Arc:
    """Along a circle of `radius_m`, positive to the left, through `angle_rad`, positive forwards."""

    radius_m: float
    angle_rad: float


PathSegment: TypeAlias = Line | Turn | Arc


def segments_through(start: Pose, nodes: Sequence[Node]) -> list[PathSegment]:
    """The lines, turns and arcs from `start` through every node in order."""
    found: list[PathSegment] = []
    at = start
    for node in nodes:
        relative = at.inverse().compose(Pose(node.x_m, node.y_m))
        distance = math.hypot(relative.x_m, relative.y_m)
        if distance < _MIN_SPACING_M:
            continue
        bearing = math.atan2(relative.y_m, relative.x_m)
        added: list[PathSegment] = []
        if node.kind == "arc" and abs(bearing) > 1e-3 and abs(bearing) < math.pi - 1e-3:
            # The circle tangential to the heading through the point: its central angle is twice the
            # bearing.
            radius = distance / (2.0 * math.sin(bearing))
            if abs(radius) < _MAX_RADIUS_M:
                added = [Arc(radius, abs(2.0 * bearing))]
        if not added:
            added = [Turn(bearing), Line(distance)] if abs(bearing) > 1e-3 else [Line(distance)]
        for segment in added:
            at = end_of(at, segment)
        found += added
    return found


def end_of(start: Pose, segment: PathSegment) -> Pose:
    """The pose at the end of a segment."""
    if isinstance(segment, Line):
        return start.advanced(segment.length_m, 0.0, 1.0)
    if isinstance(segment, Turn):
        return Pose(start.x_m, start.y_m, start.theta_rad + segment.angle_rad)
    return start.advanced(
        abs(segment.radius_m) * segment.angle_rad,
        math.copysign(segment.angle_rad, segment.radius_m),
        1.0,
    )


def cycles_of(segments: Sequence[PathSegment], limits: Limits, speed_fraction: float = 1.0) -> list[Cycle]:
    """Control inputs that drive each segment from rest to rest, exactly to its end.

    Parameters
    ----------
    speed_fraction : fraction of the speed limits to use.
    """
    found: list[Cycle] = []
    for segment in segments:
        if found:
            found.append(Cycle(0.0, 0.0))  # one cycle at rest between segments
        if isinstance(segment, Line):
            max_speed, accel = limits.on_radius(math.inf)
            found += [Cycle(v, 0.0) for v in _profile(segment.length_m, speed_fraction * max_speed, accel)]
        elif isinstance(segment, Turn):
            angle = wrapped(segment.angle_rad)
            max_speed, accel = limits.turning_in_place()
            rates = _profile(abs(angle), speed_fraction * max_speed, accel)
            found += [Cycle(0.0, math.copysign(rate, angle)) for rate in rates]
        else:
            max_speed, accel = limits.on_radius(segment.radius_m)
            length = abs(segment.radius_m) * segment.angle_rad
            found += [
                Cycle(v, v / segment.radius_m) for v in _profile(length, speed_fraction * max_speed, accel)
            ]
    return found


def _profile(distance: float, max_speed: float, accel: float) -> list[float]:
    """Speed of each cycle: a trapezoidal profile that covers the distance exactly.

    Whole cycles cannot cover any distance at full speed: one cycle is added and all speeds are scaled down
    by the same factor, which keeps every step within the acceleration limit too.
    """
    step = accel * CYCLE_S
    # m - 1 steps up lead to at most speed m * step; with one level cycle they cover step * CYCLE_S * m^2.
    m = min(
        max(1, math.ceil(max_speed / step - 1e-9)), max(1, math.floor(math.sqrt(distance / (step * CYCLE_S))))
    )
    ramp = [step * k for k in range(1, m)]
    top = min(max_speed, step * m)
    rest = distance - 2.0 * sum(ramp) * CYCLE_S
    level = max(1, math.ceil(rest / (top * CYCLE_S) - 1e-9))
    shape = [*ramp, *[top] * level, *ramp[::-1]]
    factor = distance / (sum(shape) * CYCLE_S)
    return [speed * factor for speed in shape]
