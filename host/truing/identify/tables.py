"""Identification results as tables: for the terminal (rich), and as rows for CSV and HTML.

Runs with one level take the form of the paper's Table III, runs with several that of Table IV.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from truing.identify.data_checks import summarise
from truing.identify.first_order import FirstOrderFit
from truing.identify.identification import Identification, RunIdentification, WheelSteps
from truing.identify.quantity import Quantity
from truing.identify.step_metrics import StepMetrics
from truing.identify.summary import identified_lines
from truing.recording.axis import Axis

NONE = "–"
# Columns that say nothing of a single axis.
OF_WHEELS = ("Wheel", "Mode", "Turns")
_MARK = re.compile(r"\[\d+\]")


@dataclass
class PlainTable:
    """A table of text: what the terminal, the CSV reader and the browser each get their way.

    Attributes
    ----------
    numeric : for each column, whether it is set flush right.
    group : how many leading columns name a group of rows; they are shown where they change.
    notes : remarks that cells refer to by number.
    remarks : what holds for the whole table.
    """

    title: str
    header: list[str]
    numeric: list[bool]
    group: int = 1
    rows: list[list[str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def note(self, text: str) -> str:
        """The mark of a remark, added to the notes when it is new."""
        if text not in self.notes:
            self.notes.append(text)
        return f"[{self.notes.index(text) + 1}]"

    def to_rich(self) -> Table:
        """For a terminal."""
        numbered = [f"[{number}] {note}" for number, note in enumerate(self.notes, start=1)]
        caption = "\n".join([*numbered, *self.remarks])
        table = Table(
            title=self.title,
            title_justify="left",
            title_style="bold",
            caption=_plain(caption),
            caption_justify="left",
            box=SIMPLE_HEAD,
            pad_edge=False,
        )
        for name, numeric in zip(self.header, self.numeric, strict=True):
            table.add_column(name, justify="right" if numeric else "left", overflow="fold")
        for row, first in self.grouped():
            if first and self.group > 1:
                table.add_section()
            table.add_row(*map(_plain, row))
        return table

    def of_axis(self, axis: Axis | None) -> PlainTable:
        """The table of a single axis: without a column of wheels, in its words and units."""
        if axis is None:
            return self
        kept = [k for k, name in enumerate(self.header) if name not in OF_WHEELS]
        gone = sum(name in OF_WHEELS for name in self.header[: self.group])

        def said(texts: list[str]) -> list[str]:
            return [axis.text(text) for text in texts]

        return PlainTable(
            axis.text(self.title),
            said([self.header[k] for k in kept]),
            [self.numeric[k] for k in kept],
            max(self.group - gone, 0),
            [said([row[k] for k in kept]) for row in self.rows],
            said(self.notes),
            said(self.remarks),
        )

    def to_csv(self) -> str:
        """The rows as they stand, without the marks of notes; notes and remarks follow as comment lines."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self.header)
        writer.writerows(
            [[_MARK.sub("", cell).strip().replace("\n", " ") for cell in row] for row in self.rows]
        )
        for line in [*self.notes, *self.remarks]:
            out.write(f"# {line}\n")
        return out.getvalue()

    def to_text(self) -> str:
        """For a file or a console without colours, 120 columns wide."""
        console = Console(file=io.StringIO(), width=120, highlight=False, no_color=True)
        with console.capture() as captured:
            console.print(self.to_rich())
        return "\n".join(line.rstrip() for line in captured.get().splitlines())

    def grouped(self) -> Iterator[tuple[list[str], bool]]:
        """Rows with repeated group names blanked, and whether a row begins a group (the first excepted)."""
        before: list[str] = []
        for row in self.rows:
            same = row[: self.group] == before[: self.group]
            yield [""] * self.group + row[self.group :] if same else row, bool(before) and not same
            before = row


def result_tables(result: Identification, *, shapes: bool = True) -> list[PlainTable]:
    """Every table of a result that has rows: steps of one level, of several, their shapes, the free-run fits.

    Parameters
    ----------
    shapes : also dead time, overshoot, undershoot and ripple of every step.
    """
    single = [run for run in result.runs if run.level_count == 1]
    several = [run for run in result.runs if run.level_count > 1]
    steps = [_table_iii(single), _table_iv(several)]
    tables = [*steps, *([shape_table(result)] if shapes else []), _table_fits(result.fits)]
    return [table.of_axis(result.axis) for table in tables if table.rows]


def shape_table(result: Identification) -> PlainTable:
    """Dead time, overshoot, undershoot and ripple of every step, each with its 95 % interval."""
    table = PlainTable(
        "Steps, their shape",
        ["Test", "Wheel", "Step", "Gain", "τ, s", "Dead time, s", "Over, %", "Under, %", "Ripple, mm/s"],
        [False, False, *[True] * 7],
        group=2,
    )
    for run in result.runs:
        for side in _moving_sides(run):
            for step in side.steps:
                quantities = (
                    *(
                        (step.gain, 2 if step.kind == "effort" else 3),
                        (step.time_constant, 3),
                        (step.dead_time, 3),
                    ),
                    *((step.overshoot, 1), (step.undershoot, 1), (step.ripple, 1)),
                )
                cells = [_with_interval(table, quantity, digits) for quantity, digits in quantities]
                name = f"{_input(step, previous=True)} → {_input(step)}"
                table.rows.append([run.name, side.wheel, name, *cells])
    if table.rows:
        table.remarks += [
            "Below each number its 95 % interval, under noise whose memory is found in the steady windows.",
            "Dead time: where a first-order response through 28.3 % and 63.2 % of the way begins. Over, "
            "under: "
            "furthest excursion above and below the new speed, % of the step; 0 where noise could do it "
            "alone. "
            "Ripple: standard deviation of the steady speed about a line.",
        ]
    return table


def _with_interval(table: PlainTable, quantity: Quantity, digits: int) -> str:
    if quantity.value is None:
        return NONE + (table.note(quantity.reason) if quantity.reason else "")
    text = f"{quantity.value:.{digits}f}"
    if quantity.ci95 is not None:
        low, high = quantity.ci95
        text += f"\n{low:.{digits}f}…{high:.{digits}f}"
    return text


def result_text(result: Identification) -> str:
    """Three lines, the findings and the fits, as `truing identify` prints them; no tables of steps."""
    lines = [*identified_lines(result), *finding_lines(result)]
    return "\n".join([*lines, _table_fits(result.fits).of_axis(result.axis).to_text(), *unstepped(result)])


def finding_lines(result: Identification) -> list[str]:
    """What looks wrong with the data, a line for each topic."""
    said = [f"! {line}" for line in summarise(result.findings)]
    return said if result.axis is None else [result.axis.text(line) for line in said]


def unstepped(result: Identification) -> Iterator[str]:
    """A line for each run without steps, saying why."""
    for run in result.runs:
        if run.level_count == 0:
            reasons = {side.reason for side in run.wheels if side.reason}
            yield f"{run.name}: no steps to measure, {'; '.join(sorted(reasons))}"


def _table_iii(runs: Sequence[RunIdentification]) -> PlainTable:
    table = PlainTable(
        "Steps, one level each",
        ["Test", "Mode", "Wheel", "Input", "Gain", "τ from 0, s", "τ to 0, s"],
        [False, False, False, True, True, True, True],
        group=2,
    )
    for run in runs:
        for side in _moving_sides(run):
            level = next(step for step in side.steps if step.input != 0.0)
            end = next((step for step in side.steps if step.number > level.number), None)
            cells = [run.name, run.mode, side.wheel, _input(level), _number(table, level.gain)]
            cells.append(_number(table, level.time_constant, level.notes))
            ending = NONE if end is None else _number(table, end.time_constant, end.notes)
            table.rows.append([*cells, ending])
    _say_units(table, runs)
    return table


def _table_iv(runs: Sequence[RunIdentification]) -> PlainTable:
    table = PlainTable(
        "Steps, several levels",
        ["Test", "Mode", "Wheel", "Step", "Gain", "τ up, s", "τ down, s"],
        [False, False, False, True, True, True, True],
        group=3,
    )
    for run in runs:
        for side in _moving_sides(run):
            for step in side.steps:
                time_constant = _number(table, step.time_constant, step.notes)
                up = step.direction in ("up", "reversal")
                table.rows.append(
                    [
                        run.name,
                        run.mode,
                        side.wheel,
                        f"{_input(step, previous=True)} → {_input(step)}",
                        NONE if step.input == 0.0 else _number(table, step.gain),
                        time_constant if up else "",
                        "" if up else time_constant,
                    ]
                )
    _say_units(table, runs)
    return table


def _table_fits(fits: Sequence[FirstOrderFit]) -> PlainTable:
    table = PlainTable(
        "First-order model by free-run simulation",
        ["Wheel", "Fitted to", "Gain, mm/s per %", "95 %", "τ, s", "95 %", "Error, %"],
        [False, False, True, True, True, True, True],
    )
    for fit in fits:
        gain = fit.gain
        scaled = Quantity(
            None if gain.value is None else 10.0 * gain.value,
            "mm/s per %",
            None if gain.ci95 is None else (10.0 * gain.ci95[0], 10.0 * gain.ci95[1]),
            gain.reason,
        )
        marks = "".join(table.note(note) for note in fit.notes)
        error = NONE if fit.rms_percent is None else f"{fit.rms_percent:.2f}"
        time_constant = _number(table, fit.time_constant)
        row = [fit.wheel, f"{fit.label} {marks}".strip(), _number(table, scaled), _interval(scaled)]
        table.rows.append([*row, time_constant, _interval(fit.time_constant), error])
    if table.rows:
        scales = " and ".join(f"{scale:.3g} m/s" for scale in sorted({fit.scale_mps for fit in fits}))
        table.remarks.append(
            "Error: root mean square of simulated less measured speed, equal weight per run, in per cent of "
            f"the 98th percentile of |speed| over the set ({scales}). The simulation sees only the efforts."
        )
    return table


def _moving_sides(run: RunIdentification) -> Iterator[WheelSteps]:
    return (side for side in run.wheels if any(step.input != 0.0 for step in side.steps))


def _say_units(table: PlainTable, runs: Sequence[RunIdentification]) -> None:
    kinds = {step.kind for run in runs for side in run.wheels for step in side.steps}
    parts = []
    if "effort" in kinds:
        parts.append("mm/s per % of effort")
    if "velocity" in kinds:
        parts.append("measured over commanded speed in velocity mode")
    if parts:
        table.remarks.append(
            f"Gain: {', '.join(parts)}; mean speed over the last 40 % of a level. "
            "τ: time to 63.2 % of the way to that speed."
        )


def _input(step: StepMetrics, *, previous: bool = False) -> str:
    value = step.previous if previous else step.input
    if step.kind == "velocity":
        return f"{value:.2f}" if previous else f"{value:.2f} m/s"
    text = f"{100.0 * value:.1f}".removesuffix(".0")
    return text if previous else f"{text} %"


def _number(table: PlainTable, quantity: Quantity, notes: Sequence[str] = ()) -> str:
    marks = "".join(table.note(note) for note in notes)
    if quantity.value is None:
        return NONE + (table.note(quantity.reason) if quantity.reason else "")
    return f"{quantity.value:.3f}" + (f" {marks}" if marks else "")


def _interval(quantity: Quantity) -> str:
    return NONE if quantity.ci95 is None else f"{quantity.ci95[0]:.3f} … {quantity.ci95[1]:.3f}"


def _plain(text: str) -> str:
    """Text with rich's own markup switched off."""
    return text.replace("[", "\\[")


def steps_csv(result: Identification) -> str:
    """Every step of every run, one row each; empty cells are unknown, `reason` says why."""
    rows = []
    for run in result.runs:
        for side in run.wheels:
            for step in side.steps:
                reasons = [quantity.reason for quantity in (step.gain, step.time_constant) if quantity.reason]
                rows.append(
                    {
                        "run": run.name,
                        "mode": run.mode,
                        "wheel": side.wheel,
                        "step": step.number,
                        "kind": step.kind,
                        "previous": _short(step.previous),
                        "input": _short(step.input),
                        "direction": step.direction,
                        "start_s": _short(step.start_s),
                        "duration_s": _short(step.duration_s),
                        "steady_mps": _short(step.steady_mps),
                        "gain": _short(step.gain.value),
                        "gain_unit": step.gain.unit,
                        "time_constant_s": _short(step.time_constant.value),
                        "dead_time_s": _short(step.dead_time.value),
                        "overshoot_percent": _short(step.overshoot.value),
                        "undershoot_percent": _short(step.undershoot.value),
                        "ripple_mmps": _short(step.ripple.value),
                        **_interval_columns(step),
                        "reason": "; ".join(reasons),
                        "notes": "; ".join(step.notes),
                    }
                )
    return _to_csv(rows)


def _interval_columns(step: StepMetrics) -> dict[str, str]:
    """Ends of the 95 % intervals, after the values so that older readers find theirs in place."""
    named = {
        "gain": step.gain,
        "time_constant_s": step.time_constant,
        "dead_time_s": step.dead_time,
        "overshoot_percent": step.overshoot,
        "undershoot_percent": step.undershoot,
        "ripple_mmps": step.ripple,
    }
    columns: dict[str, str] = {}
    for name, quantity in named.items():
        low, high = quantity.ci95 or (None, None)
        columns |= {f"{name}_low": _short(low), f"{name}_high": _short(high)}
    return columns


def fits_csv(result: Identification) -> str:
    """Every free-run fit, one row each."""
    rows = []
    for fit in result.fits:
        gain_low, gain_high = fit.gain.ci95 or (None, None)
        time_low, time_high = fit.time_constant.ci95 or (None, None)
        reasons = [quantity.reason for quantity in (fit.gain, fit.time_constant) if quantity.reason]
        rows.append(
            {
                "wheel": fit.wheel,
                "fitted_to": fit.label,
                "runs": " ".join(fit.runs),
                "gain_mps": _short(fit.gain.value),
                "gain_low_mps": _short(gain_low),
                "gain_high_mps": _short(gain_high),
                "time_constant_s": _short(fit.time_constant.value),
                "time_constant_low_s": _short(time_low),
                "time_constant_high_s": _short(time_high),
                "free_run_rmse_mps": _short(fit.rms_mps),
                "free_run_rmse_percent": _short(fit.rms_percent),
                "reason": "; ".join(dict.fromkeys(reasons)),
                "notes": "; ".join(fit.notes),
            }
        )
    return _to_csv(rows)


def _to_csv(rows: Sequence[Mapping[str, object]]) -> str:
    out = io.StringIO()
    if rows:
        writer = csv.DictWriter(out, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return out.getvalue()


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"
