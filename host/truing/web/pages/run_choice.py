"""Two lists: recording sets on disk, and the runs of the selected set."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nicegui import background_tasks, context, ui

from truing.web.pages.address import Address
from truing.web.pages.elements import Select, tag
from truing.web.runs.library import FoundSet, find_sets
from truing.web.session import ViewSession

NO_RUNS = (
    "no runs yet: run a plan under Experiments or a path under Trajectory,\nor drop recordings on Compare"
)
_NO_SETS = {"": "no runs on disk yet"}


@dataclass(frozen=True, slots=True)
class _Seen:
    """The run saved last, and when the folder of the selected set was changed."""

    saved: str
    path: Path | None
    changed_s: float


class RunChoice:
    """Selection of the run that a page shows.

    It is kept in the page's address. A run that is added to the set, or driven, appears by itself.

    Parameters
    ----------
    on_change : called when a run is selected, including the first time.
    on_list : called when the runs of the selected set have changed.
    """

    def __init__(
        self,
        session: ViewSession,
        address: Address,
        on_change: Callable[[], Any],
        on_list: Callable[[], Any] = lambda: None,
    ) -> None:
        self.session = session
        self._address = address
        self._on_list = on_list
        self._seen: _Seen | None = None
        self.sets: dict[str, FoundSet] = {}
        self.run: Path | None = None
        self._on_change = on_change
        self._client = context.client
        with tag("div", classes="picks"):
            self._set = Select("Set", _NO_SETS, "", lambda _: self._chose_set())
            self._run = Select("Run", {"": "–"}, "", lambda _: self._chose_run(by_user=True))
        ui.timer(1.0, self._look)

    @property
    def home(self) -> FoundSet | None:
        """The selected set."""
        return self.sets.get(self._set.value)

    @property
    def name(self) -> str:
        """The displayed name of the set."""
        home = self.home
        return "" if home is None else home.name

    def find(self, chosen: Path | None = None) -> None:
        """Search the disk for runs; select `chosen`, or the newest.

        In a thread: a folder may hold thousands of files, and driving must not be delayed.
        """
        background_tasks.create(self._find(chosen))

    async def _find(self, chosen: Path | None) -> None:
        found = await asyncio.to_thread(find_sets, self.session.run_folder.parent)
        if self._set.is_deleted:
            return
        with self._client:
            self._show(found, chosen)

    def _look(self) -> None:
        """Search again when a run has been saved, or the folder of the set has changed."""
        task, home = self.session.worker.snapshot.task, self.home
        changed_s = 0.0
        if home is not None:
            with contextlib.suppress(OSError):
                changed_s = (home.path / "runs").stat().st_mtime
        seen = _Seen("" if task is None else task.saved, None if home is None else home.path, changed_s)
        before, self._seen = self._seen, seen
        if before is None:
            return
        if seen.saved != before.saved or (seen.path == before.path and seen.changed_s != before.changed_s):
            self.find()

    def _show(self, found: list[FoundSet], chosen: Path | None) -> None:
        self.sets = {str(one.path): one for one in found}
        if not found:
            self._on_change()
            return
        if chosen is None:
            chosen = self.run or self._of_address(found)
        available = [path for one in found for path in one.runs]
        if chosen is None or chosen not in available:
            chosen = max(available, key=lambda path: path.stat().st_mtime)
        home = next(one for one in found if chosen in one.runs)
        self._set.fill({str(one.path): one.name for one in found}, str(home.path))
        self._fill_runs(home, chosen)
        if chosen != self.run:
            self._chose_run()
        else:
            self._on_list()

    def _of_address(self, found: list[FoundSet]) -> Path | None:
        home = next((one for one in found if one.name == self._address.text("set")), None)
        if home is None:
            return None
        name = self._address.text("run")
        return next((path for path in home.runs if path.stem == name), home.runs[-1])

    def _chose_set(self) -> None:
        home = self.sets[self._set.value]
        if self.run in home.runs:
            return  # it is the set that is shown; drawing it anew would take a button from under a click
        self._fill_runs(home, home.runs[0])
        self._chose_run(by_user=True)

    def show(self, name: str) -> bool:
        """Select a run of the set by its name; False if there is none."""
        home = self.home
        path = None if home is None else next((one for one in home.runs if one.stem == name), None)
        if home is None or path is None:
            return False
        if path != self.run:
            self._fill_runs(home, path)
            self._chose_run(by_user=True)
        return True

    def _fill_runs(self, home: FoundSet, chosen: Path) -> None:
        """List the runs by name, not by path.

        A run chosen from the list of the set before, while the new list is on its way to the page, is then
        the run of that name in the new set. As a path it would be unknown, and the choice lost.
        """
        self._run.fill({path.stem: path.stem for path in home.runs}, chosen.stem)

    def _chose_run(self, *, by_user: bool = False) -> None:
        home = self.home
        runs = () if home is None else home.runs
        self.run = next((path for path in runs if path.stem == self._run.value), None)
        if home is not None and self.run is not None:
            self._address.write(step=by_user, set=home.name, run=self.run.stem)
        self._on_change()
