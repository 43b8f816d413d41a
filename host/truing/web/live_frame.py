"""One frame of the live picture: what a page draws between two refreshes of its screen."""

from __future__ import annotations

from typing import Any

from truing.board_state import BoardStatus
from truing.web.board_worker import Snapshot, Task
from truing.web.live_sample import PlacedSample
from truing.web.session import ViewSession

# More points in one frame than a strip of the chart has pixels are of no use.
_MOST_SAMPLES = 120


class FrameMaker:
    """Makes frames for one page, each with what is new since the last.

    Nothing is queued: a page that asks seldom gets the newest state and an even choice of the samples
    between.
    """

    def __init__(self, session: ViewSession, name: str) -> None:
        self._session = session
        self._name = name
        self._next = max(0, session.worker.history.count - 400)
        self._scan = -1
        self._slow: dict[str, Any] = {}

    def frame(self) -> dict[str, Any]:
        """The next frame."""
        session = self._session
        samples = session.worker.history.since(self._next, _MOST_SAMPLES)
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
        # What seldom changes is sent when it does.
        for name, value in self._rare().items():
            if self._slow.get(name) != value:
                self._slow[name] = content[name] = value
        return content

    def _rare(self) -> dict[str, Any]:
        session = self._session
        snapshot, driver = session.worker.snapshot, session.lock.session
        return {
            "link": _link(snapshot),
            "board": _board(snapshot.status),
            "task": _task(snapshot.task),
            "driver": "nobody" if driver is None else "you" if driver == self._name else "another",
            "share": session.share,
            "world": session.world.version,
            "grids": session.sensing.scan.number // 5,
            "frames": _map_frame(session),
        }


def _sample(placed: PlacedSample) -> list[float | None]:
    """t, speeds, commands, efforts, battery, pose: in the order that `live.js` reads."""
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
        "told": snapshot.told,
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
        "share": round(task.share, 2),
        "problem": task.problem,
        "saved": task.saved,
    }


def _map_frame(session: ViewSession) -> dict[str, Any]:
    world, grid = session.world, session.sensing.by_odometry
    return {
        "world": [*world.origin_m, *world.size_m],
        "grid": [
            *grid.origin_m,
            grid.log_odds.shape[1] * grid.resolution_m,
            grid.log_odds.shape[0] * grid.resolution_m,
        ],
    }
