"""What every subcommand shares: the group's options, and one way to print, count progress and log."""

from __future__ import annotations

import json
import logging
import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import click

from truing.errors import TruingError
from truing.progress import Progress

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console
    from rich.table import Table

    from truing.board.device import Device

LOGGER = logging.getLogger("truing")
# Where nobody watches a bar, progress is told this often, s.
PROGRESS_LINE_EVERY_S = 5.0


@dataclass
class App:
    """The options given before the subcommand, and where output goes.

    Results go to standard output (as text, or as one JSON value with --json); progress bars and
    notes go to standard error.
    """

    port: str = "sim"
    as_json: bool = False
    verbose: int = 0
    seed: int = 1
    robot: Path | None = None
    image: Path | None = None
    crystal_ppm: float = 0.0
    _consoles: dict[str, Console] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        level = {0: logging.WARNING, 1: logging.INFO}.get(self.verbose, logging.DEBUG)
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
        LOGGER.handlers[:] = [handler]
        LOGGER.setLevel(level)
        LOGGER.propagate = False

    @property
    def is_virtual(self) -> bool:
        """Whether the port is a virtual board inside this process."""
        return self.port == "sim"

    @property
    def asks(self) -> bool:
        """Whether a person sits at the terminal who can answer a question."""
        return not self.as_json and sys.stdin.isatty() and sys.stderr.isatty()

    def choose_virtual(self, seed: int | None, robot: Path | None, image: Path | None) -> None:
        """Take a virtual board's options; a board that is not made here has none."""
        given = {"--seed": seed, "--robot": robot, "--image": image}
        if not self.is_virtual:
            for option, value in given.items():
                if value is not None:
                    raise TruingError(
                        f"{option} is for a virtual board made by this command, and --port is {self.port}",
                        f"leave {option} away, or give it to `truing board`",
                    )
        self.seed = 1 if seed is None else seed
        self.robot, self.image = robot, image

    def open_device(self, *, lasting: bool = True) -> Device:
        """Open the board at the port that the user chose.

        Parameters
        ----------
        lasting : the command is about a board that was there before and stays; a virtual board
            made here is neither, and the user is told.
        """
        from truing.board.device import Device
        from truing.virtual.options import VirtualOptions

        if lasting and self.is_virtual:
            self.note(
                "note: --port is sim: this is a new virtual board that lives as long as this command "
                "(`truing board` starts one that stays)"
            )
        virtual = VirtualOptions(self.seed, self.image, self.robot, crystal_ppm=self.crystal_ppm)
        return Device.open(self.port, virtual)

    @property
    def out(self) -> Console:
        """Standard output."""
        return self._console("out")

    @property
    def err(self) -> Console:
        """Standard error."""
        return self._console("err")

    def say(self, text: str = "") -> None:
        """Print one line of the result; silent with --json."""
        if not self.as_json:
            click.echo(text)

    def note(self, text: str) -> None:
        """Print one line about what happens to standard error, above a progress bar if there is one."""
        if "err" in self._consoles:
            self.err.print(text, markup=False, soft_wrap=True)
        else:
            click.echo(text, err=True)

    def show(self, table: Table) -> None:
        """Print a table of the result; silent with --json."""
        if not self.as_json:
            self.out.print(table)

    def emit(self, value: Any) -> None:
        """Print the result as JSON when --json was given."""
        if self.as_json:
            click.echo(
                json.dumps(_without_nan(value), indent=2, sort_keys=False, default=_plain, allow_nan=False)
            )

    @contextmanager
    def progress(self, label: str, *, shown: bool = True) -> Iterator[Progress]:
        """Show how far it is on standard error; yields a function that takes the share done, 0 to 1.

        A terminal shows a bar. A pipe or a file gets a line every few seconds, with the time left.
        """
        if shown and not self.err.is_terminal:
            yield ProgressLines(label, self.note)
            return
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

        columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
        with Progress(*columns, console=self.err, disable=not shown) as bar:
            task = bar.add_task(label, total=1.0)

            def update(share: float) -> None:
                bar.update(task, completed=min(max(share, 0.0), 1.0))

            yield update

    def _console(self, which: str) -> Console:
        if which not in self._consoles:
            from rich.console import Console

            stderr = which == "err"
            stream = sys.stderr if stderr else sys.stdout
            # A table that a file or a pipe receives is not squeezed into the 80 columns of no terminal.
            width = None if stream.isatty() else 120
            self._consoles[which] = Console(stderr=stderr, width=width, highlight=False)
        return self._consoles[which]


class ProgressLines:
    """Progress as lines of text: the share done and the time left, at most one line in a few seconds."""

    def __init__(
        self, label: str, say: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._label, self._say, self._clock = label, say, clock
        self._begun = self._said = clock()

    def __call__(self, share: float) -> None:
        now = self._clock()
        if now - self._said < PROGRESS_LINE_EVERY_S or not 0.0 < share < 1.0:
            return
        self._said = now
        left_s = (now - self._begun) * (1.0 - share) / share
        self._say(f"{self._label}: {100.0 * share:.0f} %, about {_duration(left_s)} left")


def _duration(seconds: float) -> str:
    """`40 s`, `3 min`."""
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"


def _without_nan(value: Any) -> Any:
    """The same with null for what is no finite number, which JSON does not have."""
    if isinstance(value, dict):
        return {key: _without_nan(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _plain(value: Any) -> Any:
    """Turn what json does not know (numpy scalars and arrays, paths) into what it does."""
    if hasattr(value, "tolist"):
        return value.tolist()
    return str(value)


pass_app = click.make_pass_decorator(App, ensure=True)
