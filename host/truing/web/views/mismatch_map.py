"""The mismatch of every run over time, as a figure for the plot: a map for each wheel, before and after."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from truing.web.views.figures import Figure, panels

if TYPE_CHECKING:
    from truing.diagnose.present.cells import TimeCells

# RMS residual over noise that is drawn brightest.
_BRIGHTEST_TIMES = 8.0
# From the background's colour to a warm white with increasing mismatch.
_SCALE = ((0.0, "#141920"), (0.12, "#2b2a33"), (0.35, "#8a4b2a"), (0.65, "#f08a3c"), (1.0, "#fff1d6"))


def mismatch_map(before: Sequence[TimeCells], after: Sequence[TimeCells] = ()) -> Figure:
    """A panel for each map: runs down, time across; a dot marks what stands out from the noise.

    Parameters
    ----------
    before : of both wheels, with refitted parameters.
    after : with the named effects; empty for none.
    """
    figure = panels([], revision="mismatch")
    figure["panels"] = [
        _panel(cells, what)
        for what, maps in (("refitted", before), ("with effects", after))
        for cells in maps
    ]
    return figure


def _panel(cells: TimeCells, what: str) -> dict[str, Any]:
    times = np.where(np.isfinite(cells.times_noise), np.round(cells.times_noise, 2), np.nan)
    return {
        "unit": f"{cells.wheel}, {what}",
        "lines": [],
        "map": {
            "rows": list(cells.runs),
            "edges": np.round(cells.edges_s, 3).tolist(),
            "values": [[None if value != value else value for value in row] for row in times.tolist()],
            "marked": np.argwhere(cells.stands_out).tolist(),
            "high": _BRIGHTEST_TIMES,
            "scale": [list(stop) for stop in _SCALE],
            "name": "RMS residual, times the noise",
        },
    }
