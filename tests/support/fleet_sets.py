"""Small recording sets of a fleet, without a plant, and engines that cost little to start."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from support.first_order_robot import BASELINE, TEST_XI, FirstOrderRobot
from truing.recording.writer import write_run

if TYPE_CHECKING:
    from truing.fleet.dask_engine import DaskEngine


def write_set(folder: Path, gain_mps: float = 1.45, seed: int = 1) -> Path:
    """One run of a first-order robot, with its baseline."""
    run = FirstOrderRobot(gain_mps, disturbance=0.01).drive(TEST_XI, seed=seed)
    write_run(run, folder / "runs" / "01_steps.csv")
    lines = ["[robot]"]
    lines += [
        f"{name} = {getattr(BASELINE.robot, name)}"
        for name in ("wheel_radius_m", "wheelbase_m", "counts_per_rev")
    ]
    for wheel in ("left", "right"):
        lines += [f"[wheel.{wheel}]", "gain_mps = 1.45", "time_constant_s = 0.3"]
    (folder / "baseline.toml").write_text("\n".join([*lines, ""]))
    return folder


def write_fleet(root: Path, robots: int = 2, days: int = 2) -> Path:
    """ROBOT/DATE/ with a set in each."""
    for robot in range(robots):
        for day in range(days):
            write_set(
                root / f"rover-{robot}" / f"2026-01-{day + 1:02d}", 1.4 + 0.02 * robot, seed=10 * robot + day
            )
    return root


@contextmanager
def cluster_in_this_process(threads: int = 2) -> Iterator[DaskEngine]:
    """A whole cluster, scheduler and worker, in threads."""
    from distributed import Client, LocalCluster

    from truing.fleet.dask_engine import DaskEngine

    with (
        LocalCluster(
            n_workers=1, threads_per_worker=threads, processes=False, dashboard_address=":0"
        ) as cluster,
        Client(cluster) as client,
    ):
        yield DaskEngine(client, "this process")


def die_once(mark: str) -> str:
    """Kill the process that runs this, the first time; `mark` is a file that remembers."""
    path = Path(mark)
    if not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return path.name


def always_die(_item: str) -> str:
    """Kill the process that runs this."""
    os.kill(os.getpid(), signal.SIGKILL)
    return ""


def wait_and_return(item: str) -> str:
    """Take a moment."""
    time.sleep(0.2)
    return item
