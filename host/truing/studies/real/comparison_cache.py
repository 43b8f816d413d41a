"""The comparison of many sets, in several processes; what is finished is kept, so that a stopped one goes on.

Two things are kept for each set, each with a fingerprint of the code and data that it came from: what the
peers gave on its rows, and the whole comparison. A change of the diagnosis costs the peers no new fits.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, version
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import truing
from truing import workspace
from truing.progress import Progress
from truing.recording.writer import replace_file
from truing.studies.real.comparison import (
    SetComparison,
    compare_set,
    peer_scores,
    scores_from_json,
    scores_to_json,
)
from truing.studies.real.left_out import Score
from truing.studies.real.peers.catalogue import PEERS
from truing.studies.real.peers.peer import Peer
from truing.studies.real.row_set import RowSet

# Code of the package, and other packages, that scores and comparisons depend on.
PEER_CODE = ("studies/real/peers", "studies/real/left_out.py", "studies/real/row_set.py")
LIBRARIES = ("numpy", "scipy", *sorted({peer.library for peer in PEERS if peer.library}))
CODE = (
    *("diagnose", "identify", "model", "recording"),
    *("studies/real/comparison.py", "studies/real/drivetrains.py", *PEER_CODE),
)


def cache_folder() -> Path:
    """Where finished work is kept; it may be removed at any time."""
    return workspace.cache_folder() / "comparison"


def compare_sets(
    folders: Sequence[Path], say: Progress, jobs: int = 1, kept: Path | None = None, *, resume: bool = True
) -> list[SetComparison]:
    """One comparison for each set, in their order.

    Parameters
    ----------
    jobs : processes.
    kept : where finished work is kept; `cache_folder()` where None.
    resume : compare what is not finished; otherwise it is left out.
    """
    kept = cache_folder() if kept is None else kept
    done = {folder: found for folder in folders if (found := _known(kept, folder)) is not None}
    todo = [folder for folder in folders if folder not in done] if resume else []
    say(len(done) / max(len(folders), 1))
    for folder, comparison in _compared(todo, jobs, kept):
        done[folder] = comparison
        _write(kept / f"{folder.name}.json", _set_key(folder), comparison.to_json())
        say(len(done) / len(folders))
    return [done[folder] for folder in folders if folder in done]


def kept_scores(file: Path, peers: Sequence[Peer], rows: RowSet) -> dict[str, Score]:
    """Scores of the peers on these rows, from the file where they are in it, and otherwise written to it."""
    key = _rows_key(peers, rows)
    known = _read(file, key)
    if known is not None:
        return scores_from_json(known)
    scores = peer_scores(peers, rows)
    _write(file, key, scores_to_json(scores))
    return scores


def _one(folder: Path, kept: Path) -> SetComparison:
    def scores_of(peers: Sequence[Peer], rows: RowSet) -> dict[str, Score]:
        size = sum(len(run) for run in rows.wheels[0])
        return kept_scores(kept / f"{folder.name}.{len(peers)}_methods_{size}_rows.json", peers, rows)

    return compare_set(folder, scores_of=scores_of)


def _compared(folders: Sequence[Path], jobs: int, kept: Path) -> Iterator[tuple[Path, SetComparison]]:
    if jobs == 1 or len(folders) < 2:
        for folder in folders:
            yield folder, _one(folder, kept)
        return
    with ProcessPoolExecutor(min(jobs, len(folders)), mp_context=get_context("spawn")) as pool:
        running = {pool.submit(partial(_one, kept=kept), folder): folder for folder in folders}
        try:
            for finished in as_completed(running):
                yield running[finished], finished.result()
        finally:
            pool.shutdown(cancel_futures=True)


def _known(kept: Path, folder: Path) -> SetComparison | None:
    content = _read(kept / f"{folder.name}.json", _set_key(folder))
    return None if content is None else SetComparison.from_json(content)


def _read(file: Path, key: str) -> dict[str, Any] | None:
    """What a file holds; None where it is not there, or was made from other data or by other code."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return content["content"] if content.get("key") == key else None


def _write(file: Path, key: str, content: dict[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    replace_file(file, json.dumps({"key": key, "content": content}, indent=1, allow_nan=False).encode())


def _set_key(folder: Path) -> str:
    """Fingerprint of a set's files and of all code."""
    files = [folder / "baseline.toml", *sorted((folder / "runs").glob("*.csv"))]
    return hashlib.sha256((_code(CODE) + _fingerprint(files)).encode()).hexdigest()


def _rows_key(peers: Sequence[Peer], rows: RowSet) -> str:
    """Fingerprint of rows, of the peers' code and of the libraries."""
    digest = hashlib.sha256(f"{_code(PEER_CODE)} {[peer.name for peer in peers]} {rows.part_of_run}".encode())
    for runs in rows.wheels:
        for run in runs:
            for column in (run.t_s, run.effort, run.speed_mps, run.judged):
                digest.update(column.tobytes())
            digest.update(str(run.initial_mps).encode())
    return digest.hexdigest()


@cache
def _code(places: tuple[str, ...]) -> str:
    package = Path(truing.__file__).parent
    files = [
        path
        for place in (package / name for name in places)
        for path in ([place] if place.is_file() else sorted(place.rglob("*.py")))
    ]
    return _fingerprint(files) + " ".join(_version(library) for library in LIBRARIES)


def _version(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:
        return ""


def _fingerprint(files: Sequence[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        if file.is_file():
            digest.update(f"{file.name} {file.stat().st_size} ".encode() + file.read_bytes())
    return digest.hexdigest()
