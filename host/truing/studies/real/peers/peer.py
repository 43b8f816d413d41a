"""What a peer is: a name, the library that it needs, and a fit that returns something to simulate."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from truing.arrays import FloatArray
from truing.errors import LibraryMissingError
from truing.studies.real.peers.wheel_runs import WheelRun

INSTALL = "`./run setup peers` installs it (or `pip install 'truing[peers]'`)"


class WheelModel(Protocol):
    """A fitted model of one wheel."""

    def simulate(self, run: WheelRun) -> FloatArray:
        """Free run from the run's first speed by its efforts alone: speeds, m/s, shape (n,)."""
        ...


Fit = Callable[[Sequence[WheelRun], WheelModel | None], WheelModel]


@dataclass(frozen=True, slots=True)
class Peer:
    """One method.

    Attributes
    ----------
    name : short, for the command line and the cache.
    title : for tables.
    fit : a model from some runs of one wheel; the second argument is where a search may start.
    starts_from : name of the peer whose model is that start.
    module, library : what is imported, and the name of the package that holds it; empty: nothing.
    """

    name: str
    title: str
    fit: Fit
    starts_from: str = ""
    module: str = ""
    library: str = ""

    @property
    def is_installed(self) -> bool:
        """Whether its library is there."""
        return not self.module or importlib.util.find_spec(self.module) is not None

    def require(self) -> None:
        """Refuse to go on without the library.

        Raises
        ------
        LibraryMissingError
        """
        if not self.is_installed:
            raise LibraryMissingError(
                f"{self.title} needs the Python package {self.library}, which is not installed", INSTALL
            )
