"""Measure the figures, or those named, and print each beside its peer: `./run bench [NAME...]`."""

from __future__ import annotations

import dataclasses
import importlib
import json
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from bench.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
BENCHES = (
    "image_size",
    "cli_overhead",
    "board_speed",
    "log_download",
    "log_memory",
    "identify_speed",
    "discrete_models",
    "emps",
    "low_speed",
    "diagnosis_rollout",
    "public_sets",
    "update_cuts",
)
# Measured only where they are named: each takes more than ten minutes.
LONG = ("fleet", "view_soak", "learned", "learned_real")


def _measure(names: tuple[str, ...], console: Console) -> list[Figure]:
    figures = []
    for name in names:
        module = importlib.import_module(f"bench.{name}")
        with console.status(f"{name}: {module.__doc__.splitlines()[0]}"):
            figures += module.measure(ROOT)
    return figures


def _table(figures: list[Figure]) -> Table:
    table = Table(title="Figures on this machine")
    for column in ("figure", "bar", "peer"):
        table.add_column(column)
    for column in ("here", "here / peer"):
        table.add_column(column, justify="right")
    for figure in figures:
        sign = "at least" if figure.better == "more" else "at most"
        bar = "" if figure.bar is None else f"{sign} {figure.bar:g} {figure.unit}"
        peer = figure.peer
        if figure.peer_value is not None:
            peer += f": {figure.peer_value:.4g} {figure.unit}"
        table.add_row(
            figure.name,
            bar if figure.is_met else f"[red]{bar}, NOT MET[/red]",
            peer,
            f"{figure.value:.4g} {figure.unit}",
            "" if figure.ratio is None else f"{figure.ratio:.3g}",
        )
    return table


def main(arguments: list[str]) -> int:
    """Measure, print, and keep the figures in out/bench/figures.json."""
    unknown = [name for name in arguments if name not in BENCHES + LONG]
    if unknown:
        print(f"no such bench: {', '.join(unknown)}; there are {', '.join(BENCHES + LONG)}", file=sys.stderr)
        return 2
    figures = _measure(tuple(arguments) or BENCHES, Console(stderr=True))
    Console(width=None if sys.stdout.isatty() else 140).print(_table(figures))
    kept = ROOT / "out" / "bench" / "figures.json"
    kept.parent.mkdir(parents=True, exist_ok=True)
    rows = [dataclasses.asdict(figure) | {"ratio": figure.ratio, "met": figure.is_met} for figure in figures]
    kept.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    return 0 if all(figure.is_met for figure in figures) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
