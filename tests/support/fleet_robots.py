"""A simulated fleet: sister robots of the plant, recorded week after week; the friction of one of them grows.

Robots differ from each other by some per cent, and each differs a little from day to day, as temperature and
floor make them. Each recording is a drive of the controller's core on the plant, fetched down the link.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from truing.plan import Plan, parse_plan
from truing.recording.writer import replace_file, write_run
from truing.trial.drives import drive_set, host_robot
from truing.trial.robot import Robot
from truing.trial.user_baseline import baseline_text

BEGIN = datetime(2025, 1, 6, tzinfo=UTC)
GAIN_MPS, TIME_CONSTANT_S, FRICTION = 1.3, 0.25, 0.05
# Spread of gain, time constant and friction between robots, and from day to day.
BETWEEN = (0.03, 0.04, 0.08)
FROM_DAY_TO_DAY = (0.004, 0.006, 0.02)
# Weak and strong, both ways, together and apart: what shows gain, lag, friction and delay.
LEVELS = (0.0, 0.5, -0.4, 0.25, 0.0, 0.15, -0.2, 0.7, 0.1, -0.6, 0.0)
LEVEL_S = 0.7


@dataclass(frozen=True)
class Fleet:
    """What is simulated.

    Attributes
    ----------
    weeks : of each recording since the begin.
    worn : the number of the robot that wears; per_week: by how much its friction grows, of the first day's.
    """

    robots: int
    weeks: tuple[float, ...]
    worn: int | None = None
    per_week: float = 0.01
    from_week: float = 0.0
    seed: int = 1

    def name(self, robot: int) -> str:
        return f"rover-{robot:03d}"

    def folder(self, robot: int, week: float) -> str:
        return f"{self.name(robot)}/{(BEGIN + timedelta(weeks=week)).date().isoformat()}"

    def worn_share(self, robot: int, week: float) -> float:
        """Friction over that of a robot that does not wear."""
        return 1.0 + (self.per_week * max(week - self.from_week, 0.0) if robot == self.worn else 0.0)


def plan() -> Plan:
    """One short drive of both wheels."""
    segments = [{"duration_s": LEVEL_S, "effort": [level, level]} for level in LEVELS]
    return parse_plan({"title": "Levels", "log_rate_hz": 20, "segment": segments}, "levels", "levels")


def spec_of(fleet: Fleet, robot: int, number: int) -> Robot:
    """The robot as it is on the day of its recording `number`."""
    own = np.random.default_rng([fleet.seed, robot, 0]).normal(0.0, BETWEEN, (2, 3))
    day = np.random.default_rng([fleet.seed, robot, 1, number]).normal(0.0, FROM_DAY_TO_DAY, (1, 3))
    share = np.exp(own + day)
    spec = Robot(
        gain_mps=(GAIN_MPS * share[0, 0], GAIN_MPS * share[1, 0]),
        time_constant_s=(TIME_CONSTANT_S * share[0, 1], TIME_CONSTANT_S * share[1, 1]),
    )
    worn = fleet.worn_share(robot, fleet.weeks[number])
    for side, wheel in (("left", 0), ("right", 1)):
        torque_nm = spec.effort_nm(FRICTION * float(share[wheel, 2]) * worn)
        spec.changes[f"{side}__friction__coulomb_nm"] = torque_nm
        spec.changes[f"{side}__friction__breakaway_nm"] = torque_nm
    return spec


def record(fleet: Fleet, robot: int, number: int, root: Path) -> Path:
    """Drive one recording set and write it."""
    folder = root / fleet.folder(robot, fleet.weeks[number])
    spec = spec_of(fleet, robot, number)
    seed = int(np.random.default_rng([fleet.seed, robot, 2, number]).integers(1, 2**31))
    driven = drive_set(host_robot(spec, seed), [plan()], spec, seed)
    for one in driven.runs:
        write_run(one.run, folder / "runs" / f"{one.run.name}.csv")
    text = baseline_text(spec, (GAIN_MPS, GAIN_MPS), (TIME_CONSTANT_S, TIME_CONSTANT_S), 20.0)
    replace_file(folder / "baseline.toml", text.encode())
    return folder


def record_fleet(fleet: Fleet, root: Path) -> None:
    """Drive every recording of every robot."""
    for robot in range(fleet.robots):
        for number in range(len(fleet.weeks)):
            record(fleet, robot, number, root)
