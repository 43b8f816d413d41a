"""A run over a fleet: every set has its row, whatever is wrong with some; a rerun does what is left."""

from __future__ import annotations

import errno
import json
import os
import re
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from click.testing import CliRunner

from support.fleet_sets import cluster_in_this_process, wait_and_return, write_fleet
from truing.cli import group
from truing.errors import OutputError
from truing.fleet.catalogue import read_catalogue
from truing.fleet.engine import ProcessPool

if TYPE_CHECKING:
    from truing.fleet.dask_engine import DaskEngine
    from truing.fleet.run import Ran
    from truing.fleet.tables import Tables


@pytest.fixture(scope="module")
def engine() -> Iterator[DaskEngine]:
    with cluster_in_this_process() as cluster:
        yield cluster


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two robots of two sets each, and three bad sets."""
    root = write_fleet(tmp_path_factory.mktemp("fleet") / "recordings")
    (root / "rover-0/2026-01-03/runs").mkdir(parents=True)
    (root / "rover-0/2026-01-03/runs/x.csv").write_text("t_s,effort_left\n0,0\n")
    (root / "rover-0/2026-01-04/runs").mkdir(parents=True)
    (root / "rover-0/2026-01-04/runs/x.csv").write_bytes(bytes(range(256)))
    (root / "rover-1/2026-01-03/runs").mkdir(parents=True)
    (root / "rover-1/2026-01-03/runs/x.csv").write_text("")
    return root


def run(engine: DaskEngine, source: Path | str, out: Path | str) -> tuple[Ran, Tables]:
    from truing.fleet.run import existing_parts, jobs_of, run_fleet
    from truing.fleet.storage import Place
    from truing.fleet.tables import gather

    place = Place(str(out))
    jobs = jobs_of(read_catalogue([str(source)]).sets, place.url, diagnose=False)
    ran = run_fleet(jobs, place, engine)
    return ran, gather(place, ran.parts, existing_parts(place))


def test_bad_sets_become_rows_with_their_errors_and_stop_nobody(
    engine: DaskEngine, recordings: Path, tmp_path: Path
) -> None:
    ran, tables = run(engine, recordings, tmp_path)
    assert len(ran.outcomes) == 7
    errors = {row["set"]: row["error"] for row in tables.sets.to_pylist() if row["error"]}
    assert set(errors) == {"rover-0/2026-01-03", "rover-0/2026-01-04", "rover-1/2026-01-03"}
    assert "effort_left" in errors["rover-0/2026-01-03"] or "effort_right" in errors["rover-0/2026-01-03"]
    gains = [
        row for row in tables.numbers.to_pylist() if row["parameter"] == "gain_mps" and row["wheel"] == "left"
    ]
    assert [row["set"] for row in gains] == [f"rover-{r}/2026-01-0{d}" for r in (0, 1) for d in (1, 2)]
    assert [row["value"] for row in gains] == pytest.approx([1.4, 1.4, 1.42, 1.42], rel=0.03)
    assert all(row["low"] < row["value"] < row["high"] for row in gains)


def test_a_rerun_does_what_is_new_changed_damaged_or_was_no_fault_of_the_set(
    engine: DaskEngine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The command's own cluster would be of processes, which take seconds to start.
    monkeypatch.setattr("truing.fleet.dask_engine.open_cluster", lambda *_: nullcontext(engine))
    source, out = write_fleet(tmp_path / "in"), tmp_path / "out"
    first, _ = run(engine, source, out)
    assert (first.before, len(first.outcomes)) == (0, 4)
    again, _ = run(engine, source, out)
    assert (again.before, len(again.outcomes)) == (4, 0)
    path = source / "rover-1/2026-01-02/runs/01_steps.csv"
    path.write_text(path.read_text().rsplit("\n", 2)[0] + "\n")
    (out / first.parts["rover-0/2026-01-01"]).rename(
        out / first.parts["rover-0/2026-01-01"].replace(".parquet", ".retry.parquet")
    )
    write_fleet(tmp_path / "more", robots=1, days=1).joinpath("rover-0").rename(source / "rover-2")
    third, tables = run(engine, source, out)
    assert sorted(outcome.name for outcome in third.outcomes) == [
        "rover-0/2026-01-01",
        "rover-1/2026-01-02",
        "rover-2/2026-01-01",
    ]
    assert len(tables.sets) == 5
    part = out / third.parts["rover-0/2026-01-02"]
    part.write_bytes(part.read_bytes()[:100])
    _, damaged = run(engine, source, out)
    assert damaged.missing == ("rover-0/2026-01-02",)
    said = CliRunner().invoke(
        group, ["fleet", str(source), "--out", str(out), "--numbers-only", "--no-report"]
    )
    assert said.exit_code == 0, said.output
    assert "1 results are damaged; made again" in said.output
    _, healed = run(engine, source, out)
    assert (len(healed.sets), healed.missing) == (5, ())


def test_a_full_disk_ends_the_run_and_loses_only_what_was_running(
    engine: DaskEngine, recordings: Path, tmp_path: Path
) -> None:
    from fsspec import register_implementation
    from fsspec.implementations.local import LocalFileSystem

    class FillsUp(LocalFileSystem):  # type: ignore[misc]
        protocol = "fillsup"
        free = 3

        def pipe_file(self, path: str, value: bytes, **more: Any) -> None:
            if FillsUp.free <= 0:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path)
            FillsUp.free -= 1
            super().pipe_file(path, value, **more)

    register_implementation("fillsup", FillsUp, clobber=True)
    with pytest.raises(OutputError, match=r"No space left on device; 3 of 7 sets are written") as caught:
        run(engine, recordings, f"fillsup://{tmp_path}")
    assert "goes on where it stopped" in caught.value.next_step
    FillsUp.free = 100
    ran, tables = run(engine, recordings, f"fillsup://{tmp_path}")
    assert ran.before == 3
    assert len(tables.sets) == 7
    assert not list(tmp_path.rglob("*.part"))


@pytest.fixture(scope="module")
def s3(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A bucket of an S3 server in this process."""
    pytest.importorskip("moto.server", reason="moto, the S3 server of this test, is not installed")
    from moto.server import ThreadedMotoServer
    from s3fs import S3FileSystem

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    with pytest.MonkeyPatch.context() as patch:
        for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
            patch.setenv(name, "testing")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        patch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
        for name in ("HTTP_PROXY", "HTTPS_PROXY", "http_proxy", "https_proxy"):
            patch.delenv(name, raising=False)
        S3FileSystem.clear_instance_cache()
        S3FileSystem().mkdir("lab")
        yield "s3://lab"
        S3FileSystem.clear_instance_cache()
    server.stop()


def test_recordings_and_results_may_lie_in_s3(engine: DaskEngine, s3: str, recordings: Path) -> None:
    from s3fs import S3FileSystem

    S3FileSystem().put(f"{recordings}/", f"{s3}/recordings/", recursive=True)
    ran, tables = run(engine, f"{s3}/recordings", f"{s3}/out")
    assert (len(ran.outcomes), len(tables.sets)) == (7, 7)
    assert sum(row["status"] == "not_diagnosed" for row in tables.sets.to_pylist()) == 4
    again, _ = run(engine, f"{s3}/recordings", f"{s3}/out")
    assert (again.before, again.outcomes) == (7, [])


def test_a_bucket_that_is_not_there_is_one_line(s3: str) -> None:
    said = CliRunner().invoke(group, ["fleet", "s3://no-such-bucket/x", "--out", f"{s3}/other"])
    assert said.exception is not None
    assert "Traceback" not in said.output
    assert "no-such-bucket" in str(said.exception)


def test_the_command_writes_tables_and_pages_and_says_the_same_as_json(
    engine: DaskEngine, recordings: Path, tmp_path: Path
) -> None:
    run(engine, recordings, tmp_path)  # so that the command finds all done and starts no cluster
    arguments = ["fleet", str(recordings), "--out", str(tmp_path), "--numbers-only"]
    said = CliRunner().invoke(group, arguments)
    assert said.exit_code == 0, said.output
    assert "7 sets of 2 robots, 3 of them with an error." in said.output
    assert "too few sisters" in said.output
    told = json.loads(CliRunner().invoke(group, [*arguments, "--json"]).stdout)
    assert (told["sets"], told["robots"], told["done_before"], len(told["errors"])) == (7, 2, 7, 3)
    assert told["missing"] == []
    index = (tmp_path / "report/index.html").read_text()
    pages = re.findall(r'<a href="(robots/[^"]+)">', index)
    assert sorted(set(pages)) == ["robots/rover-0.html", "robots/rover-1.html"]
    page = (tmp_path / "report" / pages[0]).read_text()
    assert "Its numbers" in page
    assert "over-friction" in page


def test_the_queries_of_the_page_run_on_what_is_written(
    engine: DaskEngine, recordings: Path, tmp_path: Path, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    duckdb = pytest.importorskip("duckdb")
    run(engine, recordings, tmp_path / "out/fleet")
    arguments = [
        "fleet",
        str(recordings),
        "--out",
        str(tmp_path / "out/fleet"),
        "--numbers-only",
        "--no-report",
    ]
    assert CliRunner().invoke(group, arguments).exit_code == 0
    monkeypatch.chdir(tmp_path)
    page = (root / "docs/FLEET.md").read_text(encoding="utf-8")
    queries = re.findall(r"```sql\n(.*?)```", page, re.S)
    answers = [duckdb.sql(query).fetchall() for query in queries]
    assert len(answers) == 6
    month, own, sisters = answers[1][0]
    assert (month.year, month.month) == (2026, 1)
    assert own == pytest.approx(sisters, abs=0.01)
    assert len(answers[2]) == 10
    assert sum(row[2] for row in answers[4]) == 3
    assert [(row[0], row[1]) for row in answers[5]] == [("rover-0", 4), ("rover-1", 3)]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["fleet"], "Missing parameter: sets"),
        (
            ["fleet", "x", "--workers", "2", "--scheduler", "tcp://a:1"],
            "--workers is for the embedded cluster",
        ),
        (["trial", "--scheduler", "tcp://a:1"], "--scheduler goes with --campaign"),
        (["fleet", "/no/such/folder"], "there is nothing here"),
    ],
)
def test_a_mistake_of_the_user_is_said_in_one_line(arguments: list[str], said: str) -> None:
    result = CliRunner().invoke(group, arguments, standalone_mode=False)
    assert said in str(result.exception)


def test_an_engine_takes_an_item_only_when_a_worker_can_have_it(engine: DaskEngine) -> None:
    """A campaign whose time is over begins no more trials, whichever engine runs them."""
    for each in (engine, ProcessPool(2)):
        taken: list[str] = []

        def items(taken: list[str] = taken) -> Iterator[str]:
            for k in range(8):
                taken.append(str(k))
                yield str(k)

        ended = each.run(wait_and_return, items())
        assert next(ended).value() in ("0", "1")
        assert len(taken) <= 3
        assert len([one.value() for one in ended]) == 7
        assert taken == list("01234567")
