"""Writes PNG pictures in the house's style: figures that a function fills, and tables."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from truing.extras import require
from truing.identify.tables import PlainTable
from truing.recording.writer import replace_file
from truing.report.plot import DOTS_PER_INCH, STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Of a table's picture, inches: one line, one character, the gap between columns.
LINE_IN, CHARACTER_IN, GAP_IN, EDGE_IN = 0.19, 0.083, 0.22, 0.15
FONT_SIZE = 9.0


def save_picture(path: Path, size: tuple[float, float], draw: Callable[[Figure], None]) -> Path:
    """Let `draw` fill a figure of `size` inches, and write it at `path`."""
    require("plots")
    # matplotlib costs a quarter of a second to import; commands that draw nothing do not pay it.
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=size, dpi=DOTS_PER_INCH, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        draw(figure)
        out = io.BytesIO()
        canvas.print_png(out, metadata={"Software": "truing"})  # type: ignore[no-untyped-call]
    replace_file(path, out.getvalue())
    return path


def save_table(table: PlainTable, path: Path) -> Path:
    """Draw a table as a PNG: as it stands in the terminal, for slides and papers."""
    import textwrap

    rows = [(row, first) for row, first in table.grouped()]
    cells = [table.header, *(row for row, _ in rows)]
    widths = [
        max(len(line) for row in cells for line in row[column].split("\n")) * CHARACTER_IN + GAP_IN
        for column in range(len(table.header))
    ]
    notes = [f"[{number}] {note}" for number, note in enumerate(table.notes, start=1)]
    width = max(sum(widths) + 2 * EDGE_IN, 6.0)
    limit = max(int((width - 2 * EDGE_IN) / (0.85 * CHARACTER_IN)), 40)
    remarks = [line for text in [*notes, *table.remarks] for line in textwrap.wrap(text, limit)]
    heights = [max(cell.count("\n") + 1 for cell in row) * LINE_IN + 0.05 for row, _ in rows]
    height = 2 * EDGE_IN + 3.2 * LINE_IN + sum(heights) + (len(remarks) + 1) * LINE_IN

    def draw(figure: Figure) -> None:
        figure.set_layout_engine("none")

        def text(x: float, y: float, value: str, **kind: object) -> None:
            figure.text(x / width, 1.0 - y / height, value, va="top", fontsize=FONT_SIZE, **kind)  # type: ignore[arg-type]

        def rule(y: float, strength: float, colour: str) -> None:
            from matplotlib.lines import Line2D

            ends = [EDGE_IN / width, (EDGE_IN + sum(widths)) / width]
            height_share = 1.0 - y / height
            figure.add_artist(Line2D(ends, [height_share] * 2, linewidth=strength, color=colour))

        def line(row: list[str], y: float, **kind: object) -> None:
            x = EDGE_IN
            for cell, column, numeric in zip(row, widths, table.numeric, strict=True):
                if numeric:
                    text(x + column - GAP_IN, y, cell, ha="right", multialignment="right", **kind)
                else:
                    text(x, y, cell, **kind)
                x += column

        text(EDGE_IN, EDGE_IN, table.title, fontweight="bold")
        y = EDGE_IN + 1.6 * LINE_IN
        line(table.header, y, color="#5c6673", fontweight="bold")
        y += 1.2 * LINE_IN
        rule(y, 1.2, "#1c2430")
        y += 0.06
        for (row, first), size in zip(rows, heights, strict=True):
            rule(y - 0.03, 0.9 if first else 0.4, "#8a929c" if first else "#d5dae0")
            line(row, y)
            y += size
        for remark in remarks:
            y += LINE_IN
            text(EDGE_IN, y - 0.5 * LINE_IN, remark, color="#5c6673")

    return save_picture(path, (width, height), draw)
