"""The topics that a dashboard finds, the same ones live and in a file.

| topic | schema | what |
| --- | --- | --- |
| `/signals` | `truing.Signals` (JSON) | one message a row, its fields named as a run's columns |
| `/pose` | `foxglove.PoseInFrame` | the board's odometry, in the frame `odom` |
| `/pose_outside` | `foxglove.PoseInFrame` | a pose from outside the robot, in the frame `map` |
| `/tf` | `foxglove.FrameTransforms` | `map` to `odom` (the same), `odom` to `base_link` |
| `/robot` | `foxglove.SceneUpdate` | a box as wide as the wheels are apart, with an arrow ahead |
| `/map` | `foxglove.Grid` | the floor: 255 where a cell is occupied, else 0 |
| `/faults` | `foxglove.Log` | each fault with cause and next step when it comes, and that it has gone |

A topic that nothing is known of is not there. Numbers that are not finite are left out of `/signals`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from truing.arrays import BoolArray
from truing.extras import require
from truing.importers.mcap_json import OWN_TOPIC
from truing_protocol import FaultInfo

if TYPE_CHECKING:
    import foxglove
    from foxglove import messages

MAP_FRAME, ODOMETRY_FRAME, BODY_FRAME = "map", "odom", "base_link"
# Width of a body whose wheelbase is not known, and its height, m.
BODY_WIDTH_M, BODY_HEIGHT_M = 0.3, 0.08
OCCUPIED = 255
_NANOSECONDS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Floor:
    """Occupied cells of a floor: shape (rows, columns), row 0 lowest in y; m; m of the lower left corner."""

    occupied: BoolArray
    resolution_m: float
    origin_m: tuple[float, float]


class Channels:
    """Writes what is given to the topics of one context; every time is in nanoseconds.

    Parameters
    ----------
    units : of each field of `/signals`; "" where it has none.
    width_m : of the robot, m.
    """

    def __init__(
        self, context: foxglove.Context, units: Mapping[str, str], width_m: float | None = None
    ) -> None:
        require("foxglove")
        import foxglove
        from foxglove import channels

        self._channels, self._context = channels, context
        self._typed: dict[str, Any] = {}
        self._width_m = width_m or BODY_WIDTH_M
        self._signals = foxglove.Channel(OWN_TOPIC, schema=_schema(units), context=context)

    def signals(self, time_ns: int, values: Mapping[str, float | str]) -> None:
        """One row of signals."""
        sound = {name: value for name, value in values.items() if _is_sound(value)}
        self._signals.log(sound, log_time=time_ns)

    def pose(self, time_ns: int, x_m: float, y_m: float, theta_rad: float) -> None:
        """The board's odometry: the pose, and the transforms that place the robot's body by it."""
        from foxglove.messages import FrameTransform, FrameTransforms, Vector3

        if not all(map(math.isfinite, (x_m, y_m, theta_rad))):
            return
        self._pose("/pose", time_ns, ODOMETRY_FRAME, (x_m, y_m, theta_rad))
        stamp = _stamp(time_ns)
        transforms = [
            FrameTransform(
                timestamp=stamp,
                parent_frame_id=MAP_FRAME,
                child_frame_id=ODOMETRY_FRAME,
                translation=Vector3(),
                rotation=_turned(0.0),
            ),
            FrameTransform(
                timestamp=stamp,
                parent_frame_id=ODOMETRY_FRAME,
                child_frame_id=BODY_FRAME,
                translation=Vector3(x=x_m, y=y_m),
                rotation=_turned(theta_rad),
            ),
        ]
        channel = self._channel("/tf", "FrameTransformsChannel")
        channel.log(FrameTransforms(transforms=transforms), log_time=time_ns)

    def outside_pose(self, time_ns: int, x_m: float, y_m: float, theta_rad: float) -> None:
        """A pose from outside the robot; nothing where it is not known."""
        if all(map(math.isfinite, (x_m, y_m, theta_rad))):
            self._pose("/pose_outside", time_ns, MAP_FRAME, (x_m, y_m, theta_rad))

    def robot(self, time_ns: int) -> None:
        """The robot's body, which moves with its frame."""
        from foxglove import messages as m

        width, tall = self._width_m, BODY_HEIGHT_M
        box = m.CubePrimitive(
            pose=_placed(0.0, 0.0, 0.0, height_m=0.5 * tall),
            size=m.Vector3(x=width, y=width, z=tall),
            color=m.Color(r=0.25, g=0.45, b=0.75, a=0.9),
        )
        arrow = m.ArrowPrimitive(
            pose=_placed(0.0, 0.0, 0.0, height_m=tall),
            shaft_length=0.5 * width,
            shaft_diameter=0.08 * width,
            head_length=0.2 * width,
            head_diameter=0.2 * width,
            color=m.Color(r=0.95, g=0.75, b=0.2, a=1.0),
        )
        body = m.SceneEntity(
            timestamp=_stamp(time_ns),
            frame_id=BODY_FRAME,
            id="body",
            frame_locked=True,
            cubes=[box],
            arrows=[arrow],
        )
        self._channel("/robot", "SceneUpdateChannel").log(m.SceneUpdate(entities=[body]), log_time=time_ns)

    def floor(self, time_ns: int, floor: Floor) -> None:
        """The map of the floor."""
        from foxglove import messages as m

        grid = m.Grid(
            timestamp=_stamp(time_ns),
            frame_id=MAP_FRAME,
            pose=_placed(*floor.origin_m, 0.0),
            column_count=floor.occupied.shape[1],
            cell_size=m.Vector2(x=floor.resolution_m, y=floor.resolution_m),
            row_stride=floor.occupied.shape[1],
            cell_stride=1,
            fields=[
                m.PackedElementField(name="occupied", offset=0, type=m.PackedElementFieldNumericType.Uint8)
            ],
            data=np.where(floor.occupied, np.uint8(OCCUPIED), np.uint8(0)).tobytes(),
        )
        self._channel("/map", "GridChannel").log(grid, log_time=time_ns)

    def fault(self, time_ns: int, fault: FaultInfo, *, gone: bool) -> None:
        """A fault that has come or gone."""
        text = f"{fault.name} has gone" if gone else f"{fault.name}: {fault.cause}. Next: {fault.next_step}"
        self._log(time_ns, text, "Info" if gone else "Error")

    def no_fault(self, time_ns: int) -> None:
        """That there is no fault."""
        self._log(time_ns, "no faults", "Info")

    def _log(self, time_ns: int, message: str, level: str) -> None:
        from foxglove.messages import Log, LogLevel

        log = Log(timestamp=_stamp(time_ns), level=getattr(LogLevel, level), message=message, name="faults")
        self._channel("/faults", "LogChannel").log(log, log_time=time_ns)

    def _pose(self, topic: str, time_ns: int, frame: str, pose: tuple[float, float, float]) -> None:
        from foxglove.messages import PoseInFrame

        message = PoseInFrame(timestamp=_stamp(time_ns), frame_id=frame, pose=_placed(*pose))
        self._channel(topic, "PoseInFrameChannel").log(message, log_time=time_ns)

    def _channel(self, topic: str, kind: str) -> Any:
        """The topic's channel; made when it is first written to."""
        if topic not in self._typed:
            self._typed[topic] = getattr(self._channels, kind)(topic, context=self._context)
        return self._typed[topic]


def _schema(units: Mapping[str, str]) -> dict[str, Any]:
    """The JSON schema of a row of signals."""
    fields = {
        name: {"type": "string"} if name == "mode" else {"type": "number", "description": unit}
        for name, unit in units.items()
    }
    return {"type": "object", "title": "truing.Signals", "properties": fields}


def _is_sound(value: float | str) -> bool:
    return isinstance(value, str) or math.isfinite(value)


def _stamp(time_ns: int) -> messages.Timestamp:
    from foxglove.messages import Timestamp

    return Timestamp(time_ns // _NANOSECONDS, time_ns % _NANOSECONDS)


def _turned(theta_rad: float) -> messages.Quaternion:
    """A turn about the upward axis."""
    from foxglove.messages import Quaternion

    return Quaternion(x=0.0, y=0.0, z=math.sin(0.5 * theta_rad), w=math.cos(0.5 * theta_rad))


def _placed(x_m: float, y_m: float, theta_rad: float, height_m: float = 0.0) -> messages.Pose:
    from foxglove.messages import Pose, Vector3

    return Pose(position=Vector3(x=x_m, y=y_m, z=height_m), orientation=_turned(theta_rad))
