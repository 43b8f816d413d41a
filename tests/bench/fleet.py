"""A fleet on a Dask cluster: cost per robot, memory, efficiency, recovery, a year in which a robot wears.

`./run bench fleet` measures (about half an hour on two free cores) and writes the tables of docs/FLEET.md.
`python tests/bench/fleet.py PART...` measures parts alone (`year`, `scale` or `scale:100`, `efficiency`,
`bare`, `recovery`), keeps what it finds in out/bench/fleet.json, and `page` writes the tables from there.
"""

from __future__ import annotations

import csv
import json
import os
import re
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from datetime import date
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import psutil

from bench.figure import Figure
from support.dask_cluster import Cluster, cluster_of_processes, wait_for
from support.fleet_robots import Fleet, record
from truing.fleet.run import AHEAD

ROOT = Path(__file__).resolve().parents[2]
KEPT, PAGE = ROOT / "out/bench/fleet.json", ROOT / "docs/FLEET.md"
YEAR = Fleet(robots=50, weeks=tuple(2.0 * k for k in range(27)), worn=17)
# Robots, whether each set is also diagnosed, and whether all robots share the files of ten.
SCALES = ((10, True, False), (100, True, False), (1_000, False, False), (10_000, False, True))
DISTINCT_OF_SHARED = 10
BAR_EFFICIENCY = 0.9
BARE_TASKS = 1_000
NIGHT_ROBOTS, NIGHT_H = 100_000, 10.0


def year(kept: dict[str, Any]) -> None:
    """50 robots recorded every second week for a year; the friction of one grows by 1 % a week."""
    from truing.fleet.analysis import analyse, to_json
    from truing.fleet.run import existing_parts
    from truing.fleet.storage import Place
    from truing.fleet.tables import gather

    source, out = ROOT / "out/bench/fleet-year", ROOT / "out/bench/fleet-year-results"
    wall = time.perf_counter()
    _record_all(YEAR, source)
    making_s = time.perf_counter() - wall
    shutil.rmtree(out, ignore_errors=True)
    with tempfile.TemporaryDirectory() as folder, cluster_of_processes(Path(folder), 2) as cluster:
        ran, elapsed = _run([str(source)], out, cluster, diagnose=False)
    tables = gather(Place(str(out)), ran.parts, existing_parts(Place(str(out))))
    cpu = time.process_time()
    analysis = analyse(tables)
    told = to_json(analysis)
    worn = YEAR.name(YEAR.worn or 0)
    tested = {(one.series.robot, one.series.parameter, one.series.wheel) for one in analysis.changes}
    kept["year"] = {
        "robots": YEAR.robots,
        "sets": len(tables.sets),
        "failed": sum(row["error"] is not None for row in tables.sets.to_pylist()),
        "series": len(tested),
        "making_s": making_s,
        "seconds": elapsed,
        "task_cpu_s": statistics.median(outcome.cpu_s for outcome in ran.outcomes),
        "analysis_cpu_s": time.process_time() - cpu,
        "worn": worn,
        "truth_per_year": 100.0 * YEAR.per_week * 365.25 / 7.0,
        "drifting": told["drifting"],
        "differing": told["differing"],
        "false": sorted({one["robot"] for one in told["drifting"]} - {worn}),
    }


def _record_all(fleet: Fleet, source: Path) -> None:
    from concurrent.futures import ProcessPoolExecutor

    todo = [
        (robot, number)
        for robot in range(fleet.robots)
        for number, week in enumerate(fleet.weeks)
        if not (source / fleet.folder(robot, week) / "baseline.toml").exists()
    ]
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(_record_one, [(fleet, *one, source) for one in todo], chunksize=20))


def _record_one(job: tuple[Fleet, int, int, Path]) -> None:
    record(*job)


def _run(sources: Sequence[str], out: Path, cluster: Cluster, *, diagnose: bool) -> tuple[Any, float]:
    """Run sets on the cluster; what the run says, and its seconds."""
    from truing.fleet.catalogue import read_catalogue
    from truing.fleet.dask_engine import open_cluster
    from truing.fleet.run import jobs_of, run_fleet
    from truing.fleet.storage import Place

    place = Place(str(out))
    jobs = jobs_of(read_catalogue(sources).sets, place.url, diagnose=diagnose)
    with open_cluster(scheduler=cluster.address) as engine:
        begin = time.perf_counter()
        ran = run_fleet(jobs, place, engine)
        return ran, time.perf_counter() - begin


def scale(kept: dict[str, Any]) -> None:
    """Cost per robot, from the catalogue to the report, at 10 to 10,000 robots of one set each."""
    for robots, diagnose, shared in SCALES:
        kept.setdefault("scale", {})[str(robots)] = _scale(robots, diagnose=diagnose, shared=shared)
        _keep(kept)


def _scale(robots: int, *, diagnose: bool, shared: bool) -> dict[str, Any]:
    from truing.fleet.analysis import analyse, analysis_tables
    from truing.fleet.report import write_report
    from truing.fleet.run import existing_parts
    from truing.fleet.storage import Place
    from truing.fleet.tables import gather, write_tables

    source = ROOT / "out/bench/fleet-robots"
    distinct = DISTINCT_OF_SHARED if shared else robots
    _record_all(Fleet(robots=distinct, weeks=(0.0,), seed=2), source)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        out, place = folder / "out", Place(str(folder / "out"))
        table = folder / "sets.csv"
        _write_table(table, robots, source, distinct)
        (folder / "cluster").mkdir()
        with cluster_of_processes(folder / "cluster", 2) as cluster:
            begin = time.perf_counter()
            _run(
                [str(_one_set(folder, source))], folder / "warm", cluster, diagnose=diagnose
            )  # compiled code
            before = _rss(cluster.scheduler.pid)
            begin = time.perf_counter()
            ran, elapsed = _run([str(table)], out, cluster, diagnose=diagnose)
            catalogue_s = time.perf_counter() - begin - elapsed
            memory = {"scheduler_mb": _peak(cluster.scheduler.pid), "scheduler_before_mb": before}
            memory["worker_mb"] = max(_peak(child.pid) for child in _workers(cluster))
        cpu, begin = time.process_time(), time.perf_counter()
        tables = gather(place, ran.parts, existing_parts(place))
        gather_s = time.perf_counter() - begin
        write_tables(place, tables.named(), lambda _text: None)
        begin = time.perf_counter()
        analysis = analyse(tables)
        write_tables(place, analysis_tables(analysis), lambda _text: None)
        analysis_s = time.perf_counter() - begin
        begin = time.perf_counter()
        write_report(place, tables, analysis, lambda _text: None)
        report_s = time.perf_counter() - begin
        parts = list((out / "parts").rglob("*.parquet"))
        return {
            "robots": robots,
            "what": ("identified and diagnosed" if diagnose else "identified")
            + (f"; {distinct} sets shared by all" if shared else ""),
            "errors": len(ran.failed),
            "elapsed_s": elapsed,
            "task_cpu_s": sum(one.cpu_s for one in ran.outcomes) / robots,
            "busy": sum(one.seconds for one in ran.outcomes) / (2.0 * elapsed),
            "catalogue_s": catalogue_s,
            "gather_s": gather_s,
            "analysis_s": analysis_s,
            "report_s": report_s,
            "after_cpu_s": time.process_time() - cpu,
            "part_bytes": statistics.mean(path.stat().st_size for path in parts),
            "index_bytes": (out / "report/index.html").stat().st_size,
            "client_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
            **memory,
        }


def _write_table(path: Path, robots: int, source: Path, distinct: int) -> None:
    folders = sorted(source.glob("rover-*/*"))[:distinct]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["path", "robot", "recorded"])
        for k in range(robots):
            writer.writerow([folders[k % distinct], f"rover-{k:05d}", "2025-01-06"])


def _one_set(folder: Path, source: Path) -> Path:
    table = folder / "warm.csv"
    _write_table(table, 4, source, 1)
    return table


def _rss(pid: int) -> float:
    return psutil.Process(pid).memory_info().rss / 2**20


def _peak(pid: int) -> float:
    """Largest resident memory so far, MiB."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    found = re.search(r"VmHWM:\s+(\d+) kB", status)
    assert found is not None
    return int(found[1]) / 1024.0


def _workers(cluster: Cluster) -> list[psutil.Process]:
    """The processes that run tasks."""
    children = psutil.Process(cluster.nurse.pid).children(recursive=True)
    return [child for child in children if "spawn_main" in " ".join(child.cmdline())]


def efficiency(kept: dict[str, Any]) -> None:
    """The share of the workers' time spent in tasks; throughput of two workers over one; bare tasks."""
    source = ROOT / "out/bench/fleet-robots"
    _record_all(Fleet(robots=100, weeks=(0.0,), seed=2), source)
    found: dict[str, Any] = {}
    for workers in (1, 2):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            table = folder / "sets.csv"
            _write_table(table, 24, source, 24)
            (folder / "cluster").mkdir()
            with cluster_of_processes(folder / "cluster", workers) as cluster:
                _run([str(_one_set(folder, source))], folder / "warm", cluster, diagnose=True)
                before = _cpu(cluster)
                ran, elapsed = _run([str(table)], folder / "out", cluster, diagnose=True)
                spent = _cpu(cluster) - before
                found[str(workers)] = {
                    "sets": len(ran.outcomes),
                    "elapsed_s": elapsed,
                    "busy": sum(one.seconds for one in ran.outcomes) / (workers * elapsed),
                    "cpu_in_tasks": sum(one.cpu_s for one in ran.outcomes) / spent,
                    "load": os.getloadavg()[0],
                }
    found["speed_up"] = found["1"]["elapsed_s"] / found["2"]["elapsed_s"]
    kept["efficiency"] = found


def bare(kept: dict[str, Any]) -> None:
    """Tasks that do nothing: how many a second, and the CPU that client and scheduler take for one."""
    with tempfile.TemporaryDirectory() as name, cluster_of_processes(Path(name), 2) as cluster:
        _bare(cluster, 50)
        before = time.process_time(), sum(psutil.Process(cluster.scheduler.pid).cpu_times()[:2])
        rate = _bare(cluster, BARE_TASKS)
        client = time.process_time() - before[0]
        scheduler = sum(psutil.Process(cluster.scheduler.pid).cpu_times()[:2]) - before[1]
    kept["bare"] = {
        "tasks_per_s": rate,
        "client_cpu_ms": 1e3 * client / BARE_TASKS,
        "scheduler_cpu_ms": 1e3 * scheduler / BARE_TASKS,
        "load": os.getloadavg()[0],
    }


def _cpu(cluster: Cluster) -> float:
    """Processor seconds of the whole cluster so far."""
    processes = [psutil.Process(cluster.scheduler.pid), psutil.Process(cluster.nurse.pid), *_workers(cluster)]
    return sum(sum(process.cpu_times()[:2]) for process in processes)


def _bare(cluster: Cluster, tasks: int) -> float:
    """Tasks a second that do nothing."""
    from truing.fleet.dask_engine import open_cluster

    with open_cluster(scheduler=cluster.address) as engine:
        begin = time.perf_counter()
        count = sum(1 for _ in engine.run(str, range(tasks), ahead=AHEAD))
        return count / (time.perf_counter() - begin)


def recovery(kept: dict[str, Any]) -> None:
    """One of two workers is killed while it runs a set: how long until two work again, and what is lost."""
    from distributed import Client

    source = ROOT / "out/bench/fleet-robots"
    _record_all(Fleet(robots=100, weeks=(0.0,), seed=2), source)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        table = folder / "sets.csv"
        _write_table(table, 16, source, 16)
        (folder / "cluster").mkdir()
        times: dict[str, float] = {}
        with cluster_of_processes(folder / "cluster", 2) as cluster, Client(cluster.address) as client:
            wait_for(lambda: len(client.scheduler_info(n_workers=-1)["workers"]) == 2)
            _run([str(_one_set(folder, source))], folder / "warm", cluster, diagnose=True)

            def kill() -> None:
                wait_for(lambda: len(list((folder / "out").rglob("*.parquet"))) >= 4)
                first = set(client.scheduler_info(n_workers=-1)["workers"])
                _workers(cluster)[0].kill()
                times["killed"] = time.perf_counter()
                wait_for(lambda: len(set(client.scheduler_info(n_workers=-1)["workers"]) - first) >= 1)
                times["back"] = time.perf_counter()

            killer = threading.Thread(target=kill)
            killer.start()
            ran, elapsed = _run([str(table)], folder / "out", cluster, diagnose=True)
            killer.join()
        kept["recovery"] = {
            "sets": 16,
            "rows": sum(not outcome.error for outcome in ran.outcomes),
            "again_s": times["back"] - times["killed"],
            "elapsed_s": elapsed,
            "task_s": statistics.median(one.seconds for one in ran.outcomes),
            "load": os.getloadavg()[0],
        }


PARTS: dict[str, Callable[[dict[str, Any]], None]] = {
    "year": year,
    "scale": scale,
    "efficiency": efficiency,
    "bare": bare,
    "recovery": recovery,
}


def _keep(kept: dict[str, Any]) -> None:
    KEPT.parent.mkdir(parents=True, exist_ok=True)
    KEPT.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


def measure(root: Path) -> list[Figure]:
    """All parts, the page, and the figures that have a bar."""
    del root
    kept: dict[str, Any] = {}
    for part in PARTS.values():
        part(kept)
        _keep(kept)
    write_page(kept)
    return figures(kept)


def figures(kept: dict[str, Any]) -> list[Figure]:
    """What is held to a bar, and what is told beside it."""
    made, found, back = kept["year"], kept["efficiency"], kept["recovery"]
    drifts = [
        one for one in made["drifting"] if one["robot"] == made["worn"] and one["parameter"] == "friction"
    ]
    return [
        Figure("fleet: wheels of the worn robot whose friction is found", len(drifts), "of 2", "more", 2),
        Figure("fleet: other robots found to drift", len(made["false"]), "of 49", "less", 0),
        Figure("fleet: busy share of 1 worker", found["1"]["busy"], "", "more", BAR_EFFICIENCY),
        Figure("fleet: busy share of 2 workers", found["2"]["busy"], "", "more", BAR_EFFICIENCY),
        Figure("fleet: rows after a killed worker", back["rows"], "of 16", "more", 16),
        Figure("fleet: killed worker works again after", back["again_s"], "s", "less"),
    ]


def write_page(kept: dict[str, Any]) -> None:
    """Put the tables between their marks in docs/FLEET.md."""
    from bench.fleet_page import sections

    text = PAGE.read_text(encoding="utf-8")
    for name, body in sections(kept, NIGHT_ROBOTS, NIGHT_H, _machine()).items():
        mark = re.compile(rf"(<!-- bench: {name} -->\n).*?(<!-- end -->)", re.S)
        assert mark.search(text), f"{PAGE}: no place for {name}"
        text = mark.sub(lambda found, body=body: f"{found[1]}\n{body.rstrip()}\n\n{found[2]}", text)  # type: ignore[misc]
    PAGE.write_text(text, encoding="utf-8")


def _machine() -> str:
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    model = re.search(r"model name\s*: (.+)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
    name = "unknown" if model is None else model[1].strip()
    return f"{date.today().isoformat()}, commit {commit.stdout.strip()}, {os.cpu_count()} cores of {name}"


def main(arguments: list[str]) -> None:
    """Measure the parts that are named, or write the page from what is kept."""
    kept: dict[str, Any] = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    for name in arguments or list(PARTS):
        if name == "page":
            write_page(kept)
            continue
        if name.startswith("scale:"):
            robots = int(name.partition(":")[2])
            _, diagnose, shared = next(one for one in SCALES if one[0] == robots)
            kept.setdefault("scale", {})[str(robots)] = _scale(robots, diagnose=diagnose, shared=shared)
        else:
            PARTS[name](kept)
        _keep(kept)
        print(name, json.dumps(kept.get(name.partition(":")[0]), indent=1)[:3000], flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
