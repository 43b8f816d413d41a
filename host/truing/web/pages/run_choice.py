"""Two lists: recording sets on disk, and the runs of the selected set."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

from nicegui import background_tasks, context

from truing.web.pages.elements import Select, tag
from truing.web.runs.library import FoundSet, find_sets
from truing.web.session import ViewSession

NO_RUNS = "no runs yet: upload and run a path under Trajectory,<br>or drop recordings on Compare"
_NO_SETS = {"": "no runs on disk yet"}


class RunChoice:
    """Selection of the run that a page shows.

    Parameters
    ----------
    on_change : called when a run is selected, including the first time.
    """

    def __init__(self, session: ViewSession, on_change: Callable[[], Any]) -> None:
        self.session = session
        self.sets: dict[str, FoundSet] = {}
        self.run: Path | None = None
        self._on_change = on_change
        self._client = context.client
        with tag("div", classes="picks"):
            self._set = Select("Set", _NO_SETS, "", lambda _: self._chose_set())
            self._run = Select("Run", {"": "–"}, "", lambda _: self._chose_run())

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
        with self._client:
            self._show(found, chosen)

    def _show(self, found: list[FoundSet], chosen: Path | None) -> None:
        self.sets = {str(one.path): one for one in found}
        if not found:
            self._on_change()
            return
        available = [path for one in found for path in one.runs]
        if chosen is None or chosen not in available:
            kept = self.run in available
            chosen = self.run if kept and self.run else max(available, key=lambda path: path.stat().st_mtime)
        home = next(one for one in found if chosen in one.runs)
        self._set.fill({str(one.path): one.name for one in found}, str(home.path))
        self._fill_runs(home, chosen)
        self._chose_run()

    def _chose_set(self) -> None:
        home = self.sets[self._set.value]
        if self.run in home.runs:
            return  # it is the set that is shown; drawing it anew would take a button from under a click
        self._fill_runs(home, home.runs[0])
        self._chose_run()

    def show(self, name: str) -> bool:
        """Select a run of the set by its name; False if there is none."""
        home = self.home
        path = None if home is None else next((one for one in home.runs if one.stem == name), None)
        if home is None or path is None:
            return False
        if path != self.run:
            self._fill_runs(home, path)
            self._chose_run()
        return True

    def _fill_runs(self, home: FoundSet, chosen: Path) -> None:
        """List the runs by name, not by path.

        A run chosen from the list of the set before, while the new list is on its way to the page, is then
        the run of that name in the new set. As a path it would be unknown, and the choice lost.
        """
        self._run.fill({path.stem: path.stem for path in home.runs}, chosen.stem)

    def _chose_run(self) -> None:
        home = self.home
        runs = () if home is None else home.runs
        self.run = next((path for path in runs if path.stem == self._run.value), None)
        self._on_change()
