"""A diagnosis as one self-contained HTML page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from pathlib import Path

from truing.diagnose.present import charts as charts
from truing.diagnose.present.axis_page import figures_of, of_left, said
from truing.diagnose.present.cells import FALSE_DISCOVERY_RATE, Bins, Located, locate
from truing.diagnose.present.first_screen import NOTHING_TO_DO, first_screen
from truing.diagnose.present.text import (
    HEADINGS,
    amount,
    capital,
    effect_title,
    headline,
    learned_lines,
    next_lines,
    number_lines,
    of_axis,
    place_lines,
    refitted_text,
    rivals_text,
    sentence,
    signal_text,
    two_amounts,
    uncertainty_lines,
    value_text,
)
from truing.diagnose.result import Diagnosis, NamedEffect
from truing.identify.tables import PlainTable
from truing.recording.run import RecordingSet
from truing.recording.writer import replace_file
from truing.report.figures import Figure
from truing.report.html_page import html_page, html_table

MAX_SPANS = 12


def save_report(
    recordings: RecordingSet, diagnosis: Diagnosis, path: str | Path, *, board: bool | None = None
) -> Path:
    """Write the page at `path`; `board`: see `render_report`."""
    path = Path(path)
    replace_file(path, render_report(recordings, diagnosis, board=board).encode("utf-8"))
    return path


def render_report(recordings: RecordingSet, diagnosis: Diagnosis, *, board: bool | None = None) -> str:
    """The whole page.

    Parameters
    ----------
    board : the user has a board of ours, so that advice about it is of use; None: if it made the runs.
    """
    axis = recordings.axis
    if axis is not None:
        diagnosis = of_axis(diagnosis)
    page = _Page(recordings, diagnosis, board)
    sections = (
        page.compared(),
        page.differs(),
        page.missing(),
        page.learned(),
        page.confidence(),
        page.to_do(),
    )
    lead = "<br>".join(map(escape, first_screen(diagnosis, board=page.board)))
    seconds = f" in {diagnosis.seconds:.0f} s" if math.isfinite(diagnosis.seconds) else ""
    return html_page(
        title=headline(diagnosis) if axis is None else axis.text(headline(diagnosis)),
        kicker=f"truing · diagnosis of {escape(diagnosis.name)} · {escape(HEADINGS[diagnosis.verdict])}",
        lead=said(f"<span>{lead}</span>", axis),
        facts=said(page.facts(), axis),
        results=said("".join(sections), axis),
        runs=said(page.runs(), axis),
        written=seconds,
        footer="Every error is of free-run simulation: the model sees the efforts and never the measured "
        "speeds. Speeds are means over each interval.",
        figures=figures_of(page.figures, axis),
    )


class _Page:
    """Sections of one page, and the figures that they place."""

    def __init__(self, recordings: RecordingSet, diagnosis: Diagnosis, board: bool | None) -> None:
        self.recordings = recordings
        self.diagnosis = diagnosis
        self.named = bool(diagnosis.effects)
        self.board = recordings.is_from_board if board is None else board
        self.figures: dict[str, Figure] = {}
        self.axis = recordings.axis
        self.before = of_left(locate(diagnosis), self.axis)
        self.after = of_left(locate(diagnosis, after=True), self.axis) if self.named else Located((), ())

    def facts(self) -> str:
        fit = self.diagnosis.fit
        values = [(capital(refitted_text(self.diagnosis)), amount(fit.refit_rmse, fit.unit))]
        if self.diagnosis.has_given:
            values.insert(0, ("Error as given", amount(fit.baseline_rmse, fit.unit)))
        if self.named:
            values.append(("With the named effects", amount(fit.model_rmse, fit.unit)))
        values.append(("Noise floor", amount(fit.noise_floor, fit.unit)))
        items = [f'<div><dt>{name}</dt><dd class="big">{escape(text)}</dd></div>' for name, text in values]
        return f'<dl class="facts">{"".join(items)}</dl>'

    def compared(self) -> str:
        runs = PlainTable(
            "The recordings",
            ["Run", "Seconds", "Rows", "Rate, Hz", "Largest effort, %", "Turns"],
            [False, True, True, True, True, False],
        )
        for run in self.recordings:
            left, right = run.effort("left"), run.effort("right")
            largest = 100.0 * max(float(abs(left).max()), float(abs(right).max()))
            turns = "yes" if float(abs(left - right).max()) > 0.05 else "no"
            row = [f"{run.duration_s:.1f}", str(len(run)), f"{run.rate_hz:.4g}", f"{largest:.0f}", turns]
            runs.rows.append([run.name, *row])
        lines = [
            f"{len(self.recordings)} recorded runs against a simulation that knows gain and time constant of "
            f"each wheel{self._known()}. Its parameters were {self._fitted()} before effects were added."
        ]
        lines += [sentence(str(check)) for check in self.diagnosis.checks if check.severity == "note"]
        noise = PlainTable(
            "The noise, estimated from the recordings",
            ["Signal", "Quantisation", "Disturbance", "Total", "Correlation time, ms"],
            [False, True, True, True, True],
        )
        for entry in self.diagnosis.noise:
            sizes = [amount(x, entry.unit) for x in (entry.quantisation, entry.disturbance, entry.rms)]
            memory = f"{1e3 * entry.correlation_s:.0f}" if math.isfinite(entry.correlation_s) else "–"
            noise.rows.append([signal_text(entry.signal), *sizes, memory])
        sources = dict.fromkeys(entry.known_from for entry in self.diagnosis.noise)
        noise.remarks = [sentence(f"estimated from {source}") for source in sources if source]
        tables = html_table(runs.of_axis(self.axis)) + (html_table(noise) if noise.rows else "")
        return f"<h2>What was compared</h2>{_paragraphs(lines)}{tables}"

    def _known(self) -> str:
        baseline = self.recordings.baseline
        if baseline is None or not baseline.effects:
            return ""
        return ", and already contains " + ", ".join(effect_title(name) for name in baseline.effects)

    def _fitted(self) -> str:
        return "refitted" if self.diagnosis.has_given else "fitted to these runs"

    def differs(self) -> str:
        if not self.before.cells:
            return ""
        parts = ["<h2>Where it differs</h2>"]
        lines = place_lines(self.diagnosis)
        rate = f"{100.0 * FALSE_DISCOVERY_RATE:.0f} %"
        count = "None" if not self.before.found else str(self.before.found)
        verb = "stands" if self.before.found == 1 else "stand"
        lines.append(
            f"{count} of {self.before.tested} cells {verb} out from the noise at a false-discovery rate of "
            f"{rate} (Benjamini-Hochberg, over all cells of time and over all bins); they carry a dot."
            + (f" With the named effects, {self.after.found} do." if self.named else "")
        )
        parts.append(_paragraphs(lines))
        parts.append(self._place("heat", charts.heat_map(self.before.cells, self.after.cells), "single"))
        quantities = list(dict.fromkeys(bins.quantity for bins in self.before.bins))
        places = []
        for number, quantity in enumerate(quantities):
            after = _of(self.after.bins, quantity) if self.named else ()
            figure = charts.against(quantity, _of(self.before.bins, quantity), after)
            places.append(self._add(f"against-{number}", figure))
        parts.append(f'<div class="plots pair">{"".join(places)}</div>')
        legend = "Filled points stand out; without a model error, 95 % of the means lie in the band."
        if self.named:
            legend += " Dotted: the residual with the named effects."
        parts.append(f'<div class="notes"><p>{legend}</p></div>')
        parts.append(self._spans())
        pose = charts.pose_windows(self.diagnosis, named=self.named)
        if pose is not None:
            parts.append("<h3>The pose against the outside reference, over short windows</h3>")
            parts.append(self._place("pose", pose, "single"))
        return "".join(parts)

    def _spans(self) -> str:
        spans = sorted(self.diagnosis.mismatch, key=lambda span: -span.share)
        if not spans:
            return ""
        table = PlainTable(
            "The stretches that hold the mismatch",
            ["Run", "Signal", "From, s", "To, s", "Share, %", "Times the noise", "Regime"],
            [False, False, True, True, True, True, False],
        )
        for span in spans[:MAX_SPANS]:
            times = "–" if span.times_noise is None else f"{span.times_noise:.1f}"
            row = [span.run, signal_text(span.signal), f"{span.t_start_s:.2f}", f"{span.t_end_s:.2f}"]
            table.rows.append([*row, f"{100.0 * span.share:.1f}", times, span.regime])
        left = len(spans) - MAX_SPANS
        if left > 0:
            table.remarks.append(f"{left} shorter ones are in the JSON.")
        return html_table(table)

    def missing(self) -> str:
        numbers = number_lines(self.diagnosis)
        if not self.named:
            if self.diagnosis.verdict == "parameters_only":
                return f"<h2>Parameters that differ</h2>{_paragraphs(numbers)}"
            if self.diagnosis.verdict == "unexplained":
                text = "No effect of the catalogue, alone or in a pair, reduces the error to the noise."
                return f"<h2>What is missing</h2>{_paragraphs([text, *numbers])}"
            return ""
        ambiguous = self.diagnosis.verdict == "ambiguous"
        title = "What may be missing" if ambiguous else "What is missing"
        cards = "".join(_card(effect, self.diagnosis) for effect in self.diagnosis.effects)
        more = f"<h3>The parameters, refitted with it</h3>{_paragraphs(numbers)}" if numbers else ""
        figure = charts.splits(self.diagnosis)
        place = "" if figure is None else self._place("splits", figure, "single")
        return f'<h2>{title}</h2><div class="cards">{cards}</div>{place}{more}'

    def learned(self) -> str:
        lines = learned_lines(self.diagnosis)
        if not lines or self.diagnosis.learned is None:
            return ""
        places = [
            self._add(f"learned-{number}", charts.learned_term(one))
            for number, one in enumerate(self.diagnosis.learned.terms)
        ]
        kind = "pair" if len(places) > 1 else "single"
        shapes = f'<div class="plots {kind}">{"".join(places)}</div>' if places else ""
        return f"<h2>What is learned</h2>{_paragraphs(lines)}{shapes}"

    def confidence(self) -> str:
        parts = [f"<h2>Confidence and limitations</h2>{_paragraphs(uncertainty_lines(self.diagnosis))}"]
        figure = charts.ranking(self.diagnosis)
        if figure is not None:
            parts.append(self._place("ranking", figure, "single"))
        table = PlainTable(
            "All effects tested",
            ["Effects", "Predicted gain", "Gain of log-likelihood", "Parameters", "Note"],
            [False, True, True, True, False],
        )
        for entry in self.diagnosis.ranking:
            sizes = [f"{x:.1f}" if math.isfinite(x) else "–" for x in (entry.score, entry.improvement)]
            names = " + ".join(effect_title(name) for name in entry.names)
            table.rows.append([names, *sizes, str(entry.parameters or "–"), _plain(entry.note)])
        if table.rows:
            inside = f"<summary>All effects tested</summary>{html_table(table)}"
            parts.append(f"<details>{inside}</details>")
        if self.diagnosis.splits and not self.named:
            splits = charts.splits(self.diagnosis)
            assert splits is not None
            parts.append(self._place("splits", splits, "single"))
        return "".join(parts)

    def to_do(self) -> str:
        diagnosis = self.diagnosis
        lines = next_lines(diagnosis, board=self.board) or [capital(NOTHING_TO_DO)]
        parts = ["<h2>What to do</h2>"]
        items = "".join(f"<li>{_code(line)}</li>" for line in lines)
        parts.append(f'<ol class="steps">{items}</ol>')
        if diagnosis.next_experiment is not None:
            parts.append(self._place("plan", charts.plan_figure(diagnosis.next_experiment.plan), "single"))
        if self.board and diagnosis.compensation is not None and diagnosis.compensation.parameters:
            table = PlainTable("Values for the board", ["Parameter", "Value"], [False, True])
            table.rows = [[name, f"{value:.5g}"] for name, value in diagnosis.compensation.parameters.items()]
            table.remarks = [sentence(note) for note in diagnosis.compensation.notes]
            parts.append(html_table(table))
        return "".join(parts)

    def runs(self) -> str:
        traces = sorted(self.diagnosis.traces, key=lambda trace: trace.run)
        if not traces:
            return ""
        share: dict[str, float] = {}
        for span in self.diagnosis.mismatch:
            share[span.run] = share.get(span.run, 0.0) + span.share
        parts = ["<h2>Every run, measured and simulated</h2>"]
        for number, trace in enumerate(traces, start=1):
            place = self._add(
                f"run-{number}",
                charts.run_traces(trace, named=self.named, left_out=self._left_out_wheel(trace.run)),
            )
            held = share.get(trace.run, 0.0)
            text = f"{100.0 * held:.0f} % of the mismatch lies in this run." if held > 0.0 else ""
            lead = f'<p class="lead">{text}</p>' if text else ""
            parts.append(f'<section class="run">{lead}<div class="plots single">{place}</div></section>')
        return "".join(parts)

    def _left_out_wheel(self, name: str) -> charts.Recorded | None:
        """What the wheel with a faulty encoder recorded in a run."""
        wheel = next(
            (
                one.wheel
                for one in self.diagnosis.checks
                if one.topic == "encoder" and one.severity == "warning"
            ),
            None,
        )
        run = next((run for run in self.recordings if run.name == name), None)
        if wheel is None or run is None:
            return None
        return charts.Recorded(wheel, run.t_s, run.speed(wheel, self.recordings.robot).values)

    def _add(self, name: str, figure: Figure) -> str:
        self.figures[name] = figure
        height = figure["layout"].get("height", 430)
        return f'<div class="plot" id="{name}" style="min-height:{height}px"></div>'

    def _place(self, name: str, figure: Figure, kind: str) -> str:
        return f'<div class="plots {kind}">{self._add(name, figure)}</div>'


def _of(bins: Sequence[Bins], quantity: str) -> list[Bins]:
    return [entry for entry in bins if entry.quantity == quantity]


def _paragraphs(lines: Sequence[str]) -> str:
    return f'<div class="said">{"".join(f"<p>{escape(line)}</p>" for line in lines)}</div>' if lines else ""


def _plain(note: str) -> str:
    """The note of a ranking; its shares of the noise read as multiples."""
    return note.replace(" of the noise", " times the noise")


def _code(line: str) -> str:
    """A sentence whose `commands` stand out."""
    parts = escape(line).split("`")
    return "".join(f"<code>{part}</code>" if k % 2 else part for k, part in enumerate(parts))


def _card(effect: NamedEffect, diagnosis: Diagnosis) -> str:
    rows = "".join(
        f"<tr><td>{escape(name.replace('_', ' '))}</td><td>{escape(value_text(parameter))}</td>"
        f"<td>{charts.interval_svg(parameter, effect)}</td></tr>"
        for name, parameter in effect.parameters.items()
    )
    parts = [f"<h3>{escape(capital(effect_title(effect.name)))}</h3>"]
    if math.isfinite(effect.confidence):
        where = {"both": "both wheels", "body": "the whole robot"}.get(effect.scope, f"{effect.scope} wheel")
        parts.append(f'<p class="lead">{escape(where)} · {100.0 * effect.confidence:.0f} % sure</p>')
    equation, signature = _description_of(effect.name)
    if equation:
        parts.append(f"<p><code>{escape(equation)}</code></p>")
    parts.append(f"<table>{rows}</table>")
    if math.isfinite(effect.heldout_rmse_before) and math.isfinite(effect.heldout_rmse_after):
        before, after = two_amounts(effect.heldout_rmse_before, effect.heldout_rmse_after, effect.unit)
        fit = diagnosis.pose_fit if effect.domain == "pose" and diagnosis.pose_fit else diagnosis.fit
        floor = f", noise floor {amount(fit.noise_floor, fit.unit)}" if fit.unit == effect.unit else ""
        parts.append(f"<p>On runs left out: <b>{before} → {after}</b>{escape(floor)}.</p>")
    if effect.indistinguishable_from:
        parts.append(f"<p>{escape(sentence(rivals_text(effect, diagnosis)))}</p>")
    if signature:
        parts.append(f'<p class="lead">{escape(sentence(signature))}</p>')
    if effect.note:
        parts.append(f"<p>{escape(sentence(effect.note))}</p>")
    return f'<div class="card">{"".join(parts)}</div>'


def _description_of(name: str) -> tuple[str, str]:
    from truing.diagnose.catalogue import CATALOGUE

    effect = CATALOGUE.get(name)
    return ("", "") if effect is None else (effect.equation, effect.signature)
