"""A cluster in other processes, found by its address: killed workers and a killed scheduler lose nothing."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from support.dask_cluster import Cluster, cluster_of_processes, wait_for
from support.fleet_sets import always_die, cluster_in_this_process, die_once, wait_and_return, write_fleet
from truing.cli import group
from truing.errors import SchedulerLostError, WorkerLostError

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("dask")]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with cluster_of_processes(tmp_path_factory.mktemp("cluster")) as found:
        yield found


def test_a_killed_worker_costs_its_task_only(cluster: Cluster, tmp_path: Path) -> None:
    from truing.fleet.dask_engine import open_cluster

    with open_cluster(scheduler=cluster.address) as engine:
        ended = list(engine.run(die_once, [str(tmp_path / name) for name in "abc"]))
        assert sorted(one.value() for one in ended) == ["a", "b", "c"]
        # A task that kills every worker is given up, and the others are not.
        lethal, harmless = list(engine.run(always_die, ["x"])), list(engine.run(wait_and_return, ["y"]))
        assert isinstance(lethal[0].error, WorkerLostError)
        assert harmless[0].value() == "y"


def test_a_killed_scheduler_ends_the_command_and_a_rerun_goes_on(cluster: Cluster, tmp_path: Path) -> None:
    """The last test of this cluster: it kills the scheduler while the command runs on it."""
    from truing.fleet.catalogue import read_catalogue
    from truing.fleet.run import jobs_of, run_fleet
    from truing.fleet.storage import Place

    source, out = write_fleet(tmp_path / "in", robots=4, days=10), tmp_path / "out"
    parts = out / "parts"

    def kill_after_the_first() -> None:
        wait_for(lambda: list(parts.rglob("*.parquet")))
        cluster.kill_scheduler()

    killer = threading.Thread(target=kill_after_the_first)
    killer.start()
    arguments = ["fleet", str(source), "--out", str(out), "--numbers-only", "--scheduler", cluster.address]
    said = CliRunner().invoke(group, arguments)
    killer.join()
    assert isinstance(said.exception, SchedulerLostError), said.output
    assert said.exception.exit_code == 1
    assert "goes on where it stopped" in said.exception.next_step
    written = {path: path.stat().st_mtime_ns for path in parts.rglob("*.parquet")}
    assert 0 < len(written) < 40
    place = Place(str(out))
    jobs = jobs_of(read_catalogue([str(source)]).sets, place.url, diagnose=False)
    with cluster_in_this_process() as engine:
        ran = run_fleet(jobs, place, engine)
    assert ran.before >= len(written)
    assert len(list(parts.rglob("*.parquet"))) == 40
    assert {path: path.stat().st_mtime_ns for path in written} == written, "what was done is not done again"


def test_no_scheduler_at_the_address_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("truing.fleet.dask_engine.CONNECT_S", 0.5)
    source = write_fleet(tmp_path / "in", robots=1, days=1)
    arguments = ["fleet", str(source), "--out", str(tmp_path / "out"), "--scheduler", "tcp://127.0.0.1:1"]
    said = CliRunner().invoke(group, arguments)
    assert isinstance(said.exception, SchedulerLostError)
    assert "no scheduler answers at tcp://127.0.0.1:1" in str(said.exception)
