"""The real recordings as tables, as sentences on what stays undecided, and both as a page of Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from truing.diagnose.present.text import alternatives, effect_title
from truing.diagnose.result import Diagnosis, NamedEffect
from truing.identify.tables import PlainTable
from truing.studies.real.comparison import SetComparison
from truing.studies.real.comparison_tables import comparison_tables, where_peers_are_better
from truing.studies.real.plain_fit import Drop
from truing.studies.real.study import (
    FRICTION,
    STEPS,
    CommandedStudy,
    DriftStudy,
    EmpsStudy,
    SetStudy,
    WheelStudy,
)

NONE = "–"
# A change of the error by less than this share is none.
SLIGHT = 0.01
DRY = frozenset({"coulomb_friction", "stribeck_friction", "driver_deadband"})
LATE = frozenset({"input_delay", "driver_lag", "speed_filter"})


@dataclass(frozen=True, slots=True)
class RealStudy:
    """Everything that was studied; None (or nothing) where the recordings are not there."""

    sets: tuple[SetStudy, ...] = ()
    emps: EmpsStudy | None = None
    mrclam: CommandedStudy | None = None
    drift: DriftStudy | None = None
    comparisons: tuple[SetComparison, ...] = ()


def tables(study: RealStudy) -> list[PlainTable]:
    """Every table that has rows."""
    made = [
        *comparison_tables(study.comparisons),
        _verdicts(study),
        _steps(study.sets),
        _emps(study.emps),
        _commanded(study.mrclam),
        _drift(study.drift),
    ]
    return [table for table in made if table.rows]


def _verdicts(study: RealStudy) -> PlainTable:
    table = PlainTable(
        "Verdicts, and what the named effects do to the error on runs that no fit saw",
        [
            "Set",
            "Verdict",
            "Named",
            "or as well",
            "Wheel",
            "Before, %",
            "After, %",
            "95 %",
            "Identification, %",
        ],
        [False, False, False, False, False, True, True, True, True],
        group=1,
    )
    for one in study.sets:
        for wheel in one.wheels:
            scale = 100.0 / wheel.scale
            named = wheel.named
            table.rows.append(
                [
                    one.name,
                    _verdict(one, wheel),
                    _named(one.deciding, wheel) if named else NONE,
                    _rivals(one.deciding) if named else NONE,
                    wheel.wheel,
                    f"{scale * wheel.base:.2f}",
                    f"{scale * named.drop.after:.2f}" if named else NONE,
                    _interval(named.drop.after_ci95, scale) if named else NONE,
                    NONE if wheel.reference is None else f"{scale * wheel.reference:.2f}",
                ]
            )
    table.remarks += [
        "Before: the refitted baseline (gain and time constant). Per cent of the 98th percentile of |speed|; "
        "every run simulated by the fit to the others.",
        "Identification: friction and delay fitted by `truing fit`, runs left out likewise; it fits each "
        "run's first speed, which the diagnosis takes as recorded.",
    ]
    return table


def _verdict(one: SetStudy, wheel: WheelStudy) -> str:
    whole = one.diagnosis.verdict.replace("_", " ")
    if one.alone is None:
        return whole
    return (
        f"{whole}: encoder"
        if wheel.wheel in _at_fault(one)
        else f"{one.alone.verdict.replace('_', ' ')} (alone)"
    )


def _named(diagnosis: Diagnosis, wheel: WheelStudy) -> str:
    parts = []
    for effect in diagnosis.effects:
        if wheel.named is None or effect.name not in wheel.named.effects or effect.explanation != 0:
            continue
        parts.append(f"{effect.name}{_value(effect, wheel.wheel)}")
    return " + ".join(parts)


def _rivals(diagnosis: Diagnosis) -> str:
    """The other explanations of an ambiguous verdict."""
    if diagnosis.verdict != "ambiguous":
        return NONE
    return "; ".join(" + ".join(names) for names in alternatives(diagnosis)[1:])


def _value(effect: NamedEffect, wheel: str) -> str:
    """Its numbers for one wheel, or for the body."""
    other = "left" if wheel == "right" else "right"
    shown = [
        f"{item.value:.3g}" + (f" {item.unit}" if item.unit not in ("1", "") else "")
        for name, item in effect.parameters.items()
        if other not in name
    ]
    return f" {', '.join(shown)}" if shown else ""


def _interval(ends: tuple[float, float], scale: float = 1.0, digits: int = 2) -> str:
    return f"{scale * ends[0]:.{digits}f} to {scale * ends[1]:.{digits}f}"


def _steps(sets: Sequence[SetStudy]) -> PlainTable:
    table = PlainTable(
        "Step by step, by plain least squares: error on unseen runs, and its drop",
        [
            "Set",
            "Wheel",
            "Baseline, %",
            "Added",
            "beside",
            "After, %",
            "Drop, 95 %",
            "Lowers it",
            "Recorder's lag, s",
        ],
        [False, False, True, False, False, True, True, False, True],
        group=3,
    )
    for one in sets:
        for wheel in one.wheels:
            scale = 100.0 / wheel.scale
            for step in wheel.steps:
                table.rows.append(
                    [
                        one.name,
                        wheel.wheel,
                        f"{scale * wheel.base:.2f}",
                        step.effect,
                        " + ".join(step.effects[:-1]) or "baseline",
                        f"{scale * step.drop.after:.2f}",
                        _interval(step.drop.ci95, scale),
                        _lowers(step.drop),
                        NONE if one.recorder_lag_s is None else f"{one.recorder_lag_s:.3f}",
                    ]
                )
    table.remarks += [
        "95 %: blocks of two seconds drawn within each run. Undecided: the interval holds zero; no: it "
        "falls by nothing.",
        "Recorder's lag: recorded speed behind differenced position, without any model of the robot.",
    ]
    return table


def _lowers(drop: Drop) -> str:
    if drop.lowers:
        return "yes"
    return (
        "raises it" if drop.ci95[1] < -SLIGHT * drop.before else "no" if drop.ci95[1] <= 0.0 else "undecided"
    )


def _emps(emps: EmpsStudy | None) -> PlainTable:
    table = PlainTable(
        "EMPS, one axis: first file alone, in quarters that no fit saw; then one open loop over each file",
        ["Model", "Unseen, mm/s", "Drop, 95 %", "First file, mm", "Second file, mm"],
        [False, True, True, True, True],
        group=0,
    )
    if emps is None:
        return table
    drops = {" + ".join(step.effects): step.drop for step in emps.wheel.steps}
    for name, (first, second) in emps.travel_mm.items():
        drop = drops.get(name)
        if name == "as diagnosed" and emps.wheel.named is not None:
            drop = emps.wheel.named.drop
        unseen = emps.wheel.base if name == "baseline" else None if drop is None else drop.after
        table.rows.append(
            [
                name,
                NONE if unseen is None else f"{1e3 * unseen:.2f}",
                NONE if drop is None else _interval(drop.ci95, 1e3),
                f"{first:.1f}",
                f"{second:.1f}",
            ]
        )
    table.remarks += [
        f"Verdict on the first file: {_sentence(emps.diagnosis, dead='right')}.",
        "Drop of a step: below the model before it; as diagnosed: below the baseline. "
        "The protocol of `./run bench emps` (asymmetric viscous "
        "and Coulomb friction, offset, drift; fitted to positions) reaches 4.61 mm on the second file, a "
        "linear state space 5.53 mm.",
    ]
    return table


def _commanded(study: CommandedStudy | None) -> PlainTable:
    table = PlainTable(
        "MRCLAM: commanded twist against the cameras",
        ["What", "Value", "95 %", "Pose error unseen, mm", "Drop, mm, 95 %", "Lowers it"],
        [False, True, True, True, True, False],
        group=0,
    )
    if study is None:
        return table
    for effect in study.diagnosis.effects:
        for name, item in effect.parameters.items():
            drop = study.delay.drop if effect.name == study.delay.effect else None
            table.rows.append(
                [
                    f"{effect.name} {name}, {item.unit}",
                    f"{item.value:.3f}",
                    _interval(item.ci95, digits=3),
                    *(_drop_cells(drop)),
                ]
            )
    for what, scale in (("forward scale", study.forward_scale), ("yaw scale", study.yaw_scale)):
        drop = study.turning.drop if what == "yaw scale" else None
        table.rows.append([what, f"{scale[0]:.3f}", _interval(scale[1:], digits=3), *_drop_cells(drop)])
    table.remarks += [
        f"Verdict: {_sentence(study.diagnosis)}. Scales: executed motion over commanded motion.",
        "Drop of the yaw scale: of a wheelbase of its own beside delay and a scale common to both; where "
        "that is undecided, yaw follows the forward scale.",
    ]
    return table


def _drop_cells(drop: Drop | None) -> tuple[str, str, str]:
    if drop is None:
        return NONE, NONE, NONE
    return f"{1e3 * drop.after:.2f}", _interval(drop.ci95, 1e3), _lowers(drop)


def _drift(study: DriftStudy | None) -> PlainTable:
    table = PlainTable(
        "MOM paper: the commanded line, and how far from the printed real end it ends",
        ["Model", "Drift, rad/m", "Scale", "End x, m", "y, m", "θ, °", "Error, m", "Error, °"],
        [False, *[True] * 7],
        group=0,
    )
    if study is None:
        return table
    for line in study.ends:
        table.rows.append(
            [
                line.name,
                f"{line.drift:+.3f}",
                f"{line.scale:+.3f}",
                f"{line.end.x_m:.3f}",
                f"{line.end.y_m:.3f}",
                f"{line.end.theta_deg:.1f}",
                f"{line.distance_m:.3f}",
                f"{line.heading_deg:+.1f}",
            ]
        )
    table.remarks.append(f"Verdict on runs made from the paper's constants: {_sentence(study.diagnosis)}.")
    return table


def _sentence(diagnosis: Diagnosis, dead: str = "neither") -> str:
    """Verdict and effects with intervals, without the numbers of a wheel that is not there."""
    verdict = diagnosis.verdict.replace("_", " ")
    if not diagnosis.effects:
        return verdict
    named = []
    for effect in diagnosis.effects:
        numbers = ", ".join(
            f"{name} {item.value:.3g} ({item.ci95[0]:.3g} to {item.ci95[1]:.3g})"
            for name, item in effect.parameters.items()
            if dead not in name and (effect.scope not in ("left", "right") or effect.scope in name)
        )
        named.append(f"{effect.name} {numbers}")
    return f"{verdict}, {'; '.join(named)}"


def undecided(study: RealStudy) -> list[str]:
    """What the recordings, or the tool, could not decide: one sentence each."""
    return [line for one in study.sets for line in _undecided_in(one)] + list(_undecided_elsewhere(study))


def _undecided_in(one: SetStudy) -> Iterator[str]:
    deciding = one.deciding
    if deciding.verdict == "ambiguous":
        ways = [" with ".join(effect_title(name) for name in names) for names in alternatives(deciding)]
        yield f"{one.name}: {'; or '.join(ways)}."
    if one.alone is not None:
        check = next(check for check in one.diagnosis.checks if check.topic == "encoder")
        yield f"{one.name}: the {check.wheel} wheel {check.text}."
    elif one.diagnosis.verdict == "unexplained":
        places = sorted({f"{span.run} {span.signal}" for span in one.diagnosis.mismatch})
        yield f"{one.name}: nothing in the catalogue explains what remains in {', '.join(places[:4])}."
    named = {effect.name for effect in deciding.effects}
    judged = [wheel for wheel in one.wheels if wheel.wheel not in _at_fault(one)]
    for k, (effects, others) in enumerate(zip(STEPS, (DRY, LATE, LATE), strict=False)):
        steps = [(wheel, wheel.steps[k]) for wheel in judged]
        what = f"{effect_title(effects[-1])} beside {_beside(effects)}"
        before = ", ".join(
            f"{_percent(w, s.drop.before):.2f} to {_percent(w, s.drop.after):.2f} %" for w, s in steps
        )
        sides = " and ".join(wheel.wheel for wheel in judged)
        if all(step.drop.lowers for _, step in steps):
            if not named & others:
                yield f"{one.name}: {what} lowers the unseen error ({sides}: {before}) and is not named."
        elif not (effects[-1] != FRICTION and named & LATE):
            some = "of both" if len(judged) > 1 else f"of the {sides}"
            yield (
                f"{one.name}: {what} does not lower the unseen error {some} significantly "
                f"({sides}: {before})."
            )


def _at_fault(one: SetStudy) -> set[str | None]:
    """Wheels whose encoder cannot be trusted."""
    return {check.wheel for check in one.diagnosis.checks if check.topic == "encoder"}


def _percent(wheel: WheelStudy, error: float) -> float:
    return 100.0 * error / wheel.scale


def _beside(effects: Sequence[str]) -> str:
    return " and ".join(effect_title(name) for name in effects[:-1]) or "the baseline"


def _undecided_elsewhere(study: RealStudy) -> Iterator[str]:
    if study.emps is not None and study.emps.diagnosis.verdict in ("ambiguous", "unexplained"):
        yield f"EMPS: {_sentence(study.emps.diagnosis)}."
    if study.mrclam is not None and not study.mrclam.turning.drop.lowers:
        yield "MRCLAM: whether yaw has a scale other than the forward speed's."


def markdown(study: RealStudy) -> str:
    """The page that is kept beside the code."""
    lines = [
        "# Real recordings",
        "",
        "Written by `truing real --markdown FILE`. Each set is diagnosed from a baseline without friction "
        "and delay whose gain and time constant `truing` identified from the same runs under that structure. "
        "What the recordings are: `host/truing/studies/real/README.md`.",
    ]
    for table in tables(study):
        lines += [
            "",
            f"## {table.title}",
            "",
            _row(table.header),
            _row("---:" if n else "---" for n in table.numeric),
        ]
        lines += [_row(row) for row, _ in table.grouped()]
        lines += ["", *(f"{remark}  " for remark in table.remarks)]
    better = where_peers_are_better(study.comparisons)
    if better:
        lines += ["", "## Where another method is better", "", *(f"- {line}" for line in better)]
    lines += ["", "## What could not be decided", "", *(f"- {line}" for line in undecided(study))]
    return "\n".join(lines).rstrip() + "\n"


def _row(cells: Iterator[str] | Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"
