"""Runs that were read from disk, kept while their files are unchanged and as far as memory allows."""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path

from truing.recording.reader import read_run
from truing.recording.run import Run

# A run of ten minutes at 200 Hz takes about 10 MB.
_MAX_BYTES = 128_000_000


class RunCache:
    """The runs that were used last."""

    def __init__(self, max_bytes: int = _MAX_BYTES) -> None:
        self._max_bytes = max_bytes
        self._runs: OrderedDict[tuple[Path, int, int], Run] = OrderedDict()

    def read(self, path: Path) -> Run:
        """A run from disk.

        Raises
        ------
        TruingError : it cannot be read, or is no run.
        OSError : there is no such file.
        """
        at = path.stat()
        key = (path, at.st_mtime_ns, at.st_size)
        run = self._runs.pop(key, None)
        if run is None:
            run = read_run(path)
        self._runs[key] = run
        while self.bytes > self._max_bytes and len(self._runs) > 1:
            self._runs.popitem(last=False)
        return run

    @property
    def bytes(self) -> int:
        """Memory of the numbers of all kept runs."""
        return sum(column.nbytes for run in self._runs.values() for column in run.columns.values())
