"""Many concealed trials on all cores; each result is a line of a file, so that a campaign can go on later."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path

from truing.errors import TruingError
from truing.recording_writer import replace_file
from truing.trial.concealed import run_concealed
from truing.trial.score import Score, score, to_json, to_markdown

ON_BOARD_EVERY = 10
# Out of twenty: twelve single effects, three with nothing hidden, three pairs, two from outside.
_ROUND = (
    "random", "random", "none", "random", "pair", "random", "random", "outside", "random", "random",
    "none", "random", "pair", "random", "random", "outside", "random", "none", "pair", "random",
)  # fmt: skip


def task(seed: int, number: int) -> tuple[str, int]:
    """Effect and seed of a campaign's trial; single effects come in turn, so that they are drawn evenly."""
    from truing.trial.effects import CATALOGUE, OUTSIDE

    kind = _ROUND[number % len(_ROUND)]
    before = sum(_ROUND[k % len(_ROUND)] == kind for k in range(number))
    if kind == "random":
        kind = sorted(CATALOGUE)[before % len(CATALOGUE)]
    elif kind == "outside":
        kind = sorted(OUTSIDE)[before % len(OUTSIDE)]
    return kind, seed * 1_000_000 + number


def run_campaign(
    trials: int,
    seed: int,
    folder: Path,
    progress: Callable[[float], None],
    note: Callable[[str], None],
    workers: int | None = None,
) -> list[Score]:
    """Run the trials that `folder` does not hold yet, and write results.json and results.md there."""
    folder.mkdir(parents=True, exist_ok=True)
    store = folder / "trials.jsonl"
    done = _read(store)
    todo = [number for number in range(trials) if task(seed, number) not in done]
    finished = trials - len(todo)
    with ProcessPoolExecutor(max_workers=workers or os.cpu_count() or 1) as pool:
        futures = {pool.submit(_one, seed, number, folder): number for number in todo}
        for future in as_completed(futures):
            finished += 1
            progress(finished / trials)
            try:
                result = future.result()
            except TruingError as error:
                note(f"trial {futures[future]}: {error.message}")
                continue
            done[result.effect, result.seed] = result
            with store.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(result)) + "\n")
    wanted = {task(seed, number) for number in range(trials)}
    scores = [each for key, each in sorted(done.items(), key=lambda item: item[0][1]) if key in wanted]
    replace_file(folder / "results.json", (json.dumps(to_json(scores), indent=1) + "\n").encode())
    replace_file(folder / "results.md", to_markdown(scores).encode())
    return scores


def _one(seed: int, number: int, folder: Path) -> Score:
    effect, own = task(seed, number)
    on_board = number % ON_BOARD_EVERY == 0
    place = folder / "sets" / str(own)
    shutil.rmtree(place, ignore_errors=True)
    result = run_concealed(effect, own, place, core=not on_board)
    shutil.rmtree(place, ignore_errors=True)
    return score(
        effect, own, result.verdict, result.answer,
        seconds=result.seconds, sha256=result.sha256, on_board=on_board,
    )  # fmt: skip


def _read(store: Path) -> dict[tuple[str, int], Score]:
    done: dict[tuple[str, int], Score] = {}
    if not store.exists():
        return done
    for line in store.read_text(encoding="utf-8").splitlines():
        try:
            values = json.loads(line)
        except json.JSONDecodeError:
            continue  # the line that was being written when the campaign was stopped
        for name in ("hidden", "strengths", "said"):
            values[name] = tuple(values[name])
        done[values["effect"], values["seed"]] = Score(**values)
    return done
