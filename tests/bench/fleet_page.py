"""The tables of docs/FLEET.md, from what `bench/fleet.py` measured."""

from __future__ import annotations

from typing import Any

# What a browser page may weigh, what a listing of an object store brings at once, what a request takes.
PAGE_LIMIT_MB, LISTED_AT_ONCE, REQUEST_S, READERS = 20.0, 1_000, 0.02, 16
SCALES = (10, 100, 1_000, 10_000)
NOT_MEASURED = "Not measured yet."


def sections(kept: dict[str, Any], night_robots: int, night_h: float, machine: str) -> dict[str, str]:
    """Each table by the name of its place; what was not measured says so."""
    return {
        "year": _year(kept["year"]) if "year" in kept else NOT_MEASURED,
        "scale": _scale(kept.get("scale", {}), machine),
        "engine": _engine(kept),
        "night": _night(kept, night_robots, night_h),
    }


def _table(*header: str) -> list[str]:
    return [f"| {' | '.join(header)} |", f"|{' --- |' * len(header)}"]


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _year(made: dict[str, Any]) -> str:
    rows = _table("robot", "number", "form", "change", "per year (95 %)", "since", "p")
    for one in made["drifting"]:
        share = 100.0 / one["before"]
        rate = one.get("rate_per_year", one.get("step")) * share
        low, high = (end * share for end in one["ci95"])
        number = f"{one['parameter']}, {one['wheel']}"
        change = f"{one['now'] * share - 100.0:+.0f} %"
        rows.append(
            _row(
                *(one["robot"], number, one["form"], change, f"{rate:+.0f} % ({low:+.0f} to {high:+.0f})"),
                *(one["since"], f"{one['p']:.0e}"),
            )
        )
    others = sorted({one["robot"] for one in made["differing"]} - {made["worn"]})
    return "\n".join(
        [
            f"{made['sets']} sets of {made['robots']} robots, {made['failed']} with an error; "
            f"{made['task_cpu_s']:.3f} CPU s a set.",
            f"In truth the friction of {made['worn']} grows by {made['truth_per_year']:.0f} % of its first "
            "value in a year; nothing else drifts.",
            f"Other robots said to drift: {', '.join(made['false']) or 'none'}. Other robots said to differ "
            f"from their sisters: {', '.join(others) or 'none'}.",
            f"{made['series']} series were tested in {made['analysis_cpu_s']:.1f} CPU s. What was found:",
            "",
            *rows,
        ]
    )


def _scale(scales: dict[str, Any], machine: str) -> str:
    if not scales:
        return NOT_MEASURED
    ordered = sorted(scales.values(), key=lambda entry: int(entry["robots"]))
    cost = _table("robots", "what was done", "CPU s a robot", "elapsed, s", "workers busy", "errors")
    after = _table("robots", "catalogue, s", "reading results, s", "analysis, s", "pages, s")
    memory = _table("robots", "scheduler, MB", "of it before", "largest worker, MB", "client, MB")
    for one in ordered:
        robots = f"{one['robots']:,}"
        busy = f"{100.0 * one['busy']:.1f} %"
        cost.append(
            _row(
                *(robots, one["what"], f"{one['task_cpu_s']:.3f}", f"{one['elapsed_s']:.0f}", busy),
                str(one["errors"]),
            )
        )
        steps = (one[f"{name}_s"] for name in ("catalogue", "gather", "analysis", "report"))
        after.append(_row(robots, *(f"{seconds:.1f}" for seconds in steps)))
        sizes = (one[f"{name}_mb"] for name in ("scheduler", "scheduler_before", "worker", "client"))
        memory.append(_row(robots, *(f"{size:.0f}" for size in sizes)))
    missing = [f"{robots:,}" for robots in SCALES if str(robots) not in scales]
    return "\n".join(
        [
            f"Two workers on {machine}."
            + (f" Not measured yet: {', '.join(missing)} robots." if missing else ""),
            "The machine had other work: CPU seconds count, elapsed ones are several times what they would "
            "be alone.",
            "",
            *cost,
            "",
            *after,
            "",
            *memory,
        ]
    )


def _engine(kept: dict[str, Any]) -> str:
    lines = _table("figure", "value")
    found, back = kept.get("efficiency"), kept.get("recovery")
    if found:
        for workers, name in (("1", "one worker's time"), ("2", "two workers' time")):
            one = found[workers]
            lines.append(
                _row(
                    f"share of {name} spent in tasks, {one['sets']} sets identified and diagnosed (bar 90 %)",
                    f"{100.0 * one['busy']:.1f} %",
                )
            )
            lines.append(
                _row(
                    "share of that cluster's CPU spent in tasks, from its first",
                    f"{100 * one['cpu_in_tasks']:.1f} %",
                )
            )
        loads = f"{found['1']['load']:.0f} and {found['2']['load']:.0f}"
        lines.append(
            _row(
                f"throughput of two workers over one, at a load of {loads} on two cores",
                f"{found['speed_up']:.2f}",
            )
        )
    bare = kept.get("bare")
    if bare:
        text = f"tasks a second that do nothing, at a load of {bare['load']:.0f}"
        lines.append(_row(text, f"{bare['tasks_per_s']:.0f}"))
        cpu = f"{bare['client_cpu_ms']:.1f} and {bare['scheduler_cpu_ms']:.1f} ms"
        lines.append(_row("CPU of client and of scheduler for each of them", cpu))
    if back:
        lines.append(
            _row(
                f"a killed worker is replaced after, at a load of {back['load']:.0f}",
                f"{back['again_s']:.1f} s",
            )
        )
        lines.append(_row(f"sets that have their result then, of {back['sets']}", str(back["rows"])))
    return "\n".join(lines) if len(lines) > 2 else NOT_MEASURED


def _night(kept: dict[str, Any], robots: int, hours: float) -> str:
    scales = sorted(kept.get("scale", {}).values(), key=lambda entry: int(entry["robots"]))
    diagnosed = [one for one in scales if one["what"].startswith("identified and diagnosed")]
    if not diagnosed:
        return NOT_MEASURED
    full, large = diagnosed[-1], scales[-1]
    at = f"at {large['robots']:,}"
    share = robots / large["robots"]
    cores, few = (robots * one["task_cpu_s"] / (3600.0 * hours) / one["busy"] for one in (full, large))
    index_mb = large["index_bytes"] * share / 2**20
    grown_mb = large["scheduler_mb"] - large["scheduler_before_mb"]
    more_mb = (large["client_mb"] - scales[0]["client_mb"]) / max(large["robots"] - scales[0]["robots"], 1)
    client_gb = (scales[0]["client_mb"] + robots * more_mb) / 1024.0
    alone_s = share * sum(large[f"{name}_s"] for name in ("catalogue", "gather", "analysis", "report"))
    lines = _table("what", f"{robots:,} robots", "from")
    rows = [
        (
            f"cores for {hours:.0f} h, identified and diagnosed",
            f"{cores:.0f}",
            f"{full['task_cpu_s']:.2f} CPU s a set",
        ),
        (
            f"cores for {hours:.0f} h, identified alone",
            f"{few:.1f}",
            f"{large['task_cpu_s']:.3f} CPU s a set",
        ),
        (
            "memory of the workers",
            f"{cores * full['worker_mb'] / 1024:.0f} GB",
            f"{full['worker_mb']:.0f} MB each",
        ),
        (
            "memory of the scheduler",
            f"{(large['scheduler_before_mb'] + share * grown_mb) / 1024:.1f} GB at most",
            f"grew by {grown_mb:.0f} MB in {large['robots']:,} sets",
        ),
        ("catalogue", f"{share * large['catalogue_s']:.0f} s", f"{large['catalogue_s']:.1f} s {at}"),
        (
            "reading the results",
            f"{share * large['gather_s']:.0f} s",
            f"{large['gather_s']:.1f} s {at}, local disk",
        ),
        ("analysis", f"{share * large['analysis_s']:.0f} s", f"{large['analysis_s']:.1f} s {at}"),
        ("pages", f"{share * large['report_s']:.0f} s", f"{large['report_s']:.1f} s {at}"),
        (
            "results",
            f"{robots * large['part_bytes'] / 2**30:.1f} GB",
            f"{large['part_bytes'] / 1024:.1f} kB each",
        ),
        ("page for all robots", f"{index_mb:.0f} MB", f"{large['index_bytes'] / 2**20:.2f} MB {at}"),
        (
            "memory of the client",
            f"{client_gb:.1f} GB",
            f"{scales[0]['client_mb']:.0f} MB at {scales[0]['robots']:,}, {large['client_mb']:.0f} MB {at}",
        ),
    ]
    bare = kept.get("bare")
    if bare:
        each_ms = max(bare["client_cpu_ms"], bare["scheduler_cpu_ms"])
        text = f"{each_ms:.1f} CPU ms a task, the slower of both"
        rows.append(("client and scheduler", f"{robots * each_ms / 1e3:.0f} s", text))
    lines += [_row(*row) for row in rows]
    return "\n".join([*lines, "", *_what_breaks(robots, index_mb, client_gb, alone_s)])


def _what_breaks(robots: int, index_mb: float, client_gb: float, alone_s: float) -> list[str]:
    requests_s = robots * REQUEST_S / READERS
    return [
        "**What breaks first** is the client: one process lists, reads, analyses and draws all that is made,",
        f"{alone_s / 60.0:.0f} minutes and {client_gb:.0f} GB in proportion to what was measured on the "
        "busy machine; cores do not help it.",
        f"Then the page for all robots, {index_mb:.0f} MB of HTML (a browser is comfortable below "
        f"{PAGE_LIMIT_MB:.0f}): leave the pages away",
        "(`--no-report`) and query the tables. Then the small files in S3: a listing holds "
        f"{LISTED_AT_ONCE:,} names, so that it takes {robots // LISTED_AT_ONCE}",
        f"before and after the run, and each result is a request, {requests_s:.0f} s at {1e3 * REQUEST_S:.0f}"
        f" ms and {READERS} at a time (reckoned, not",
        "measured). The scheduler holds a bounded number of tasks and is far from its limit.",
    ]
