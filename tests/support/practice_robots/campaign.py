"""Many practice trials against a diagnosis, and how often it is right: `--n 60 --call module:function`."""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import shlex
import subprocess
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from support.practice_robots.effects import CATALOGUE
from support.practice_robots.outside import OUTSIDE
from support.practice_robots.score import Judgement, judge, rates
from support.practice_robots.trial import NOT_TOGETHER, Answer, NotReachable, make_trial

ROOT = Path(__file__).resolve().parents[3]
CACHE = ROOT / "out" / "practice"
NOT_OF_THE_GENERATOR = {"__init__", "__main__", "campaign", "score"}


@dataclass(frozen=True)
class Task:
    """One trial to make and to diagnose."""

    seed: int
    effect: str
    strength: str
    second: str | None = None

    @property
    def label(self) -> str:
        return self.effect + (f"+{self.second}" if self.second else "")

    @property
    def reproduce(self) -> str:
        second = f" --second {self.second}" if self.second else ""
        return f"--effect {self.effect}{second} --strength {self.strength} --seed {self.seed}"


def generator_version() -> str:
    """A short hash of the generator's sources: trials of another version are other trials."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        if path.stem not in NOT_OF_THE_GENERATOR:
            digest.update(path.read_bytes())
    return digest.hexdigest()[:10]


def tasks(
    count: int,
    seed: int,
    *,
    weak_share: float = 1 / 3,
    effects: list[str] | None = None,
    kinds: tuple[str, ...] = ("single", "null", "outside", "pair"),
) -> list[Task]:
    """Singles evenly over the catalogue, 15 % nulls, 10 % outside the catalogue, 10 % pairs."""
    rng = np.random.default_rng(seed)
    shares = {"null": 0.15, "outside": 0.10, "pair": 0.10}
    counts = {kind: round(count * share) for kind, share in shares.items() if kind in kinds}
    if "single" in kinds:
        counts["single"] = count - sum(counts.values())
    elif counts:  # no singles wanted: the others share the trials as they do otherwise
        total = sum(shares[kind] for kind in counts)
        counts = {kind: round(count * shares[kind] / total) for kind in counts}

    def strength() -> str:
        return "weak" if rng.random() < weak_share else "full"

    out: list[Task] = []
    number = seed * 100_000
    singles = _cycle(effects or list(CATALOGUE), rng)
    for _ in range(counts.get("single", 0)):
        number += 1
        out.append(Task(number, next(singles), strength()))
    for index in range(counts.get("null", 0)):
        number += 1
        out.append(Task(number, ("null_exact", "null_numbers")[index % 2], "full"))
    outside = _cycle(list(OUTSIDE), rng)
    for _ in range(counts.get("outside", 0)):
        number += 1
        out.append(Task(number, next(outside), "full"))
    firsts = _cycle(list(CATALOGUE), rng)
    for _ in range(counts.get("pair", 0)):
        number += 1
        first = next(firsts)
        others = [name for name in CATALOGUE if name != first and {name, first} not in NOT_TOGETHER]
        out.append(Task(number, first, "full", str(rng.choice(others))))
    return [out[i] for i in rng.permutation(len(out))]


def _cycle(names: list[str], rng: np.random.Generator) -> Iterator[str]:
    while True:
        yield from (names[i] for i in rng.permutation(len(names)))


def fetch(task: Task) -> tuple[Path, Answer]:
    """The trial's folder and answer, made once per version of the generator."""
    folder = CACHE / generator_version() / f"{task.label}-{task.strength}-{task.seed}"
    kept = folder / "answer.json"
    if kept.exists():
        return folder, Answer.load(kept)
    return folder, make_trial(task.seed, task.effect, task.strength, folder=folder, second_effect=task.second)


def run_one(task: Task, call: str | None, command: str | None) -> Judgement:
    """Make, diagnose and judge one trial; a crash of the diagnosis is a judgement too."""
    try:
        folder, answer = fetch(task)
    except NotReachable as reason:
        return {"effect": task.label, "task": task.reproduce, "skipped": str(reason)}
    recordings = folder / "recordings"
    started = time.perf_counter()
    try:
        if call:
            result = _function(call)(recordings, recordings / "baseline.toml")
        else:
            result = _command(str(command), recordings, folder)
    except Exception:
        result = {"verdict": "crashed", "effects": [], "error": traceback.format_exc()}
    seconds = time.perf_counter() - started
    out = judge(answer, result)
    out |= {"task": task.reproduce, "folder": str(folder), "seconds": round(seconds, 2)}
    if "error" in result:
        out["error"] = result["error"]
    (folder / "result.json").write_text(json.dumps(result, default=str), encoding="utf-8")
    return out


def _function(call: str) -> Callable[[Path, Path], dict[str, Any]]:
    module, _, name = call.partition(":")
    found: Callable[[Path, Path], dict[str, Any]] = getattr(importlib.import_module(module), name)
    return found


def _command(template: str, recordings: Path, folder: Path) -> dict[str, Any]:
    out = folder / "verdict.json"
    out.unlink(missing_ok=True)
    command = template.format(set=recordings, baseline=recordings / "baseline.toml", json=out)
    done = subprocess.run(
        shlex.split(command), cwd=ROOT, capture_output=True, text=True, timeout=600, check=False
    )
    if done.returncode != 0:
        raise RuntimeError(f"exit {done.returncode}: {done.stderr.strip()[-500:]}")
    loaded: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    return loaded


def report(judgements: list[Judgement]) -> str:
    """Confusions, rates and every failure with its seed."""
    skipped = [j for j in judgements if "skipped" in j]
    judged = [j for j in judgements if "skipped" not in j]
    lines = ["hidden -> answered (right answers left out)"]
    table: dict[str, Counter[str]] = {}
    totals: Counter[str] = Counter()
    good: Counter[str] = Counter()
    for j in judged:
        row = j["effect"] if j["kind"] != "pair" else "(pair)"
        totals[row] += 1
        good[row] += bool(j["right"])
        if not j["right"]:
            table.setdefault(row, Counter())[_answered(j)] += 1
    for row in sorted(totals):
        wrong = ", ".join(f"{what} x{n}" for what, n in table.get(row, Counter()).most_common())
        lines.append(f"  {row:24s} {good[row]:3d} of {totals[row]:3d}   {wrong}")
    lines += ["", "rates"]
    for name, (hits, count) in rates(judged).items():
        share = f"{100 * hits / count:5.1f} %" if count else "    -  "
        lines.append(f"  {name:46s} {share}  {hits} of {count}")
    for what, label in (
        ("covered", "share of the energy covered"),
        ("pure", "share of the spans that is effect"),
    ):
        values = [j[what] for j in judged if j[what]]
        if values:
            lines.append(f"  median {label:39s} {np.median(values):.2f}")
    seconds = [j["seconds"] for j in judged]
    if seconds:
        lines.append(f"  seconds per verdict: median {np.median(seconds):.1f}, max {max(seconds):.1f}")
    misses: Counter[str] = Counter()
    for j in judged:
        misses.update(name for name, hit in j["inside"].items() if not hit)
    if misses:
        lines += [
            "",
            "parameters outside their interval: " + ", ".join(f"{k} x{v}" for k, v in misses.items()),
        ]
    failures = [j for j in judged if not j["right"] or j["confidently_wrong"]]
    lines += ["", f"failures ({len(failures)})"]
    for j in sorted(failures, key=lambda item: (item["kind"], item["effect"])):
        mark = "CONFIDENTLY WRONG " if j["confidently_wrong"] else ""
        lines.append(f"  {j['task']}\n      S {j['S']} {j['plan']}: {mark}{_answered(j)}")
        if "error" in j:
            lines.append("      " + j["error"].strip().splitlines()[-1])
    lines += [f"not made: {j['task']}: {j['skipped']}" for j in skipped]
    return "\n".join(lines)


def _answered(j: Judgement) -> str:
    names = "+" if j["verdict"] == "missing_physics" else "|"
    text = f"{j['verdict']}({names.join(j['listed'])})" if j["listed"] else str(j["verdict"])
    if j["kind"] == "outside" and j["verdict"] == "unexplained":
        text += f" (covered {j['covered']:.2f}, pure {j['pure']:.2f})"
    return text


def main() -> None:
    argv = sys.argv[1:]
    command = None
    if "--" in argv:
        at = argv.index("--")
        command = shlex.join(argv[at + 1 :]) if len(argv) > at + 2 else " ".join(argv[at + 1 :])
        argv = argv[:at]
    parser = argparse.ArgumentParser(
        prog="python -m support.practice_robots.campaign",
        description=__doc__,
        epilog="or `-- COMMAND` with {set}, {baseline} and {json} in it instead of --call",
    )
    parser.add_argument("--n", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument(
        "--call", help="module:function of (set folder, baseline path) -> a verdict (docs/DATA_FORMAT.md)"
    )
    parser.add_argument("--effects", help="singles of these only, comma separated")
    parser.add_argument("--kinds", default="single,null,outside,pair", help="which kinds of trial")
    parser.add_argument("--weak", type=float, default=1 / 3, help="share of weak singles")
    parser.add_argument("--generate-only", action="store_true", help="fill the cache, diagnose nothing")
    parser.add_argument("--json", type=Path, help="every judgement, one a line")
    args = parser.parse_args(argv)
    todo = tasks(
        args.n,
        args.seed,
        weak_share=args.weak,
        effects=args.effects.split(",") if args.effects else None,
        kinds=tuple(args.kinds.split(",")),
    )
    if args.generate_only:
        args.call, command = "support.practice_robots.campaign:no_diagnosis", None
    if not args.call and not command:
        parser.error("--call module:function or -- COMMAND is needed")
    judgements: list[Judgement] = []
    with ProcessPoolExecutor(args.jobs, mp_context=get_context("spawn")) as pool:
        futures = [pool.submit(run_one, task, args.call, command) for task in todo]
        for index, future in enumerate(futures):
            judgement = future.result()
            judgements.append(judgement)
            if args.json:
                with args.json.open("a", encoding="utf-8") as out:
                    out.write(json.dumps(judgement, default=str) + "\n")
            if not args.generate_only:
                state = "skipped" if "skipped" in judgement else "ok" if judgement["right"] else "WRONG"
                said = "" if "skipped" in judgement else _answered(judgement)
                took = judgement.get("seconds", 0.0)
                print(
                    f"[{index + 1}/{len(todo)}] {state:7s} {took:6.1f} s {judgement['task']}: {said}",
                    flush=True,
                )
    if args.generate_only:
        made = [j for j in judgements if "skipped" not in j]
        print(f"{len(made)} trials in {CACHE / generator_version()}")
    else:
        print(report(judgements))


def no_diagnosis(recordings: Path, baseline: Path) -> dict[str, Any]:
    """Stand-in that finds nothing."""
    return {"verdict": "consistent", "effects": []}


if __name__ == "__main__":
    main()
