"""The models of a set as tables: for the terminal, and as CSV, PNG and HTML."""

from __future__ import annotations

from truing.identify.model_ladder import SetModels, WheelModels
from truing.identify.tables import NONE, PlainTable


def model_tables(models: SetModels) -> list[PlainTable]:
    """Every model's errors first, then each wheel's chosen physics with its intervals."""
    tables = [_errors(models), *(_parameters(wheel) for wheel in models.wheels)]
    return [table.of_axis(models.axis) for table in tables]


def _errors(models: SetModels) -> PlainTable:
    table = PlainTable(
        f"{models.name}: error, % of the 98th percentile of |speed|",
        ["Wheel", "Model", "Free run", "Free run, left-out runs", "One step, left-out runs"],
        [False, False, True, True, True],
    )
    for wheel in models.wheels:
        for step in wheel.steps:
            mark = " *" if step is wheel.chosen else ""
            held_out = NONE if step.held_out is None else f"{step.held_out.percent:.2f}"
            free_run = f"{step.free_run.percent:.2f}"
            table.rows.append([wheel.wheel, step.structure.name + mark, free_run, held_out, NONE])
        for name, fit in (("ARX", wheel.arx), ("state space", wheel.state_space)):
            if fit is None:
                continue
            one_step = 100.0 * fit.held_out_one_step.rms_mps / fit.free_run.scale_mps
            errors = (fit.free_run.percent, fit.held_out_free_run.percent, one_step)
            table.rows.append([wheel.wheel, name, *(f"{error:.2f}" for error in errors)])
        table.remarks += [f"! {wheel.wheel}: {note}" for note in (*wheel.chosen.notes, *wheel.missing)]
    table.remarks += [f"! {side}: not fitted: {reason}" for side, reason in models.refused.items()]
    table.remarks += [f"! {note}" for note in models.notes]
    judged = [step.held_out is not None for wheel in models.wheels for step in wheel.steps]
    table.remarks.append(
        "* chosen: the simplest within 2 % of the lowest error on left-out runs."
        if any(judged)
        else "* chosen: the simplest of linear, friction and delay within 2 % of their lowest error."
    )
    if any(judged) and not all(judged):
        table.remarks.append(
            f"{NONE} under left-out runs: not simulated, the error on the fitted runs already rules it out."
        )
    return table


def _parameters(wheel: WheelModels) -> PlainTable:
    table = PlainTable(
        f"{wheel.wheel} wheel: {wheel.chosen.structure.name}",
        ["Parameter", "Value", "95 % interval", "Unit"],
        [False, True, True, False],
    )
    for name, quantity in wheel.chosen.parameters.items():
        if quantity.value is None:
            table.rows.append([name, "unknown", quantity.reason or "", quantity.unit])
            continue
        low, high = quantity.ci95 or (float("nan"), float("nan"))
        table.rows.append([name, f"{quantity.value:.4g}", f"{low:.4g} to {high:.4g}", quantity.unit])
    return table
