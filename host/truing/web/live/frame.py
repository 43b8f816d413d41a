"""One frame of live data: everything a page draws at one screen refresh."""

from __future__ import annotations

from typing import Any

from truing.board.state import BoardStatus
from truing.web.session import ViewSession
from truing.web.worker.sample import PlacedSample
from truing.web.worker.state import Snapshot, Task

# More samples per frame than the strip chart has pixels add nothing.
_MAX_SAMPLES = 120


class FrameMaker:
    """Builds frames for one page, each with the changes since the last.

    Nothing is queued: a slow page gets the newest state and an evenly decimated selection of the samples
    between.
    """

    def __init__(self, session: ViewSession, name: str) -> None:
        self._session = session
        self._name = name
        self._next = max(0, session.worker.history.count - 400)
        self._scan = -1
        self._sent: dict[str, Any] = {}
        self._stop_id, self._stop_number = 0, 0

    def stopping(self, stop_id: int, number: int) -> None:
        """Report the stop `number` of the session as the page's own `stop_id` once it is delivered."""
        self._stop_id, self._stop_number = stop_id, number

    def frame(self) -> dict[str, Any]:
        """The next frame."""
        session = self._session
        samples = session.worker.history.since(self._next, _MAX_SAMPLES)
        self._next = session.worker.history.count
        odometry, corrected = session.odometry_pose(), session.corrected_pose()
        content: dict[str, Any] = {
            "odometry": None if odometry is None else odometry.as_list(),
            "corrected": None if corrected is None else corrected.as_list(),
            "samples": [_sample(placed) for placed in samples],
        }
        scan = session.sensing.scan
        if scan.number != self._scan:
            self._scan = scan.number
            content["scan"] = scan.to_json(session.sensing.sensors)
        # State that changes rarely is sent only when it has changed.
        for name, value in self._state().items():
            if self._sent.get(name) != value:
                self._sent[name] = content[name] = value
        return content

    def _state(self) -> dict[str, Any]:
        session = self._session
        snapshot, driver = session.worker.snapshot, session.lock.session
        return {
            "link": _link(snapshot) | {"virtual": session.virtual is not None},
            "board": _board(snapshot.status),
            "task": _task(snapshot.task),
            "driver": "none" if driver is None else "you" if driver == self._name else "other",
            "speed_fraction": session.speed_fraction,
            "stop": {
                "state": session.stop_state,
                "delivered": self._stop_id if session.worker.stop_acknowledged >= self._stop_number else 0,
            },
            "world": session.world.version,
            "grids": session.sensing.scan.number // 5,
            "frames": _map_frame(session),
        }


def _sample(placed: PlacedSample) -> list[float | None]:
    """t, speeds, commands, efforts, battery, pose: in the order that `live.js` expects."""
    s = placed.sample
    command = s.command_mps or (None, None)
    return [
        round(s.t_s, 3),
        *(round(value, 4) for value in s.speed_mps),
        *(None if value is None else round(value, 4) for value in command),
        *(round(value, 4) for value in s.effort),
        s.battery_v,
        *placed.pose.as_list(),
    ]


def _link(snapshot: Snapshot) -> dict[str, Any]:
    info = snapshot.info
    return {
        "state": snapshot.link,
        "message": snapshot.message,
        "next": snapshot.next_step,
        "board": None if info is None else f"{info.board_name} {info.firmware_version}",
        "port": None if info is None else info.port,
        "rate_hz": snapshot.rate_hz,
        "reconnects": snapshot.reconnects,
    }


def _board(status: BoardStatus | None) -> dict[str, Any] | None:
    if status is None:
        return None
    return {
        "state": status.state.name.lower(),
        "mode": status.mode.name.lower(),
        "sequence": status.sequence_state.name.lower(),
        "log_open": status.log_open,
        "faults": [
            {"name": f.name, "cause": f.cause, "next": f.next_step, "active": f in status.active}
            for f in status.latched or status.active
        ],
    }


def _task(task: Task | None) -> dict[str, Any] | None:
    if task is None:
        return None
    return {
        "name": task.name,
        "stage": task.stage,
        "progress": round(task.progress, 2),
        "problem": task.problem,
        "saved": task.saved,
    }


def _map_frame(session: ViewSession) -> dict[str, Any]:
    world, grid = session.world, session.sensing.odometry_map
    return {
        "world": [*world.origin_m, *world.size_m],
        "grid": [
            *grid.origin_m,
            grid.log_odds.shape[1] * grid.resolution_m,
            grid.log_odds.shape[0] * grid.resolution_m,
        ],
    }
