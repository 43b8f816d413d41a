"""The studies of both papers as tables and as the sentences that go with them."""

from __future__ import annotations

from truing.identify.tables import PlainTable
from truing.studies.bakirci_gains import PARAMETERS, GainStudy, GainTable, RungFit
from truing.studies.bakirci_models import ModelStudy, printed_39_on_xvii
from truing.studies.mom_odometry import DESIRED, PRINTED_MODEL, REAL, MomStudy, Pose


def gain_tables(study: GainStudy) -> list[PlainTable]:
    """The ladder, and the parameters of each rung."""
    table = study.table
    fifteen = list(study.fifteen.values())
    ladder = PlainTable(
        "The 22 printed effort gains: what a linear model leaves out, rung by rung",
        [
            *("Steady-state model", "Mean", "Worst", "at", "Left out", "worst", "at"),
            *(f"{table.gain[row]:.3f}" for row in fifteen),
        ],
        [False, True, True, False, True, True, False, *(True for _ in fifteen)],
        group=0,
    )
    for fit in (*study.ladder, *study.alternatives):
        ladder.rows.append(
            [
                fit.rung.name,
                f"{100 * fit.mean:.1f}",
                f"{100 * fit.worst:.1f}",
                _short(table, fit.worst_row),
                f"{100 * fit.left_out_mean:.1f}",
                f"{100 * abs(float(fit.left_out[fit.left_out_row])):.1f}",
                _short(table, fit.left_out_row),
                *(f"{fit.predicted[row]:.3f}" for row in fifteen),
            ]
        )
    mean, worst = study.static_floor
    floor = [f"{100 * mean:.1f}", f"{100 * worst:.1f}", _floor_place(study), *(["–"] * (3 + len(fifteen)))]
    ladder.rows.append(["best without memory", *floor])
    ladder.remarks += [
        "Relative error of the gain, %. Left out: each test predicted by the model fitted to the other "
        "eight.",
        f"Last columns: the three printed readings at 15 % ({', '.join(study.fifteen)}), as each model has "
        "them.",
        "at: test and effort in %; p pivoting, ↑ ↓ reached from below or above.",
    ]
    values = PlainTable(
        "Their parameters",
        ["Steady-state model", "Parameter", "Value", "95 %", "Unit"],
        [False, False, True, True, False],
    )
    for fit in (*study.ladder, *study.alternatives):
        values.rows += _parameter_rows(values, fit)
    values.remarks.append("95 %: jackknife over the nine tests, cut at what is physically possible.")
    return [ladder, values]


def gain_sentences(study: GainStudy) -> list[str]:
    """What the ladder means, and what stays unexplained."""
    table, best = study.table, study.best
    first = study.ladder[0]
    lines = [
        f"Best on tests left out: {best.rung.name!r}, {100 * best.left_out_mean:.1f} % on average "
        f"(linear {100 * first.left_out_mean:.1f} %). Before and after on the fitted gains: "
        f"{100 * first.mean:.1f} % → {100 * best.mean:.1f} % on average, "
        f"{100 * first.worst:.1f} % → {100 * best.worst:.1f} % at worst.",
        "Left out, the worst is always test I: it is the only pivot at 15 %, and nothing else determines "
        "scrub there."
        if all(table.tests[fit.left_out_row] == "I" for fit in (*study.ladder, *study.alternatives))
        else "Left out, the worst test differs from model to model.",
        "Rungs with falling friction fit best and predict worst: only the readings at 15 % determine them.",
        f"The supply drop that is fitted is {study.drop_beyond_friction:.1f} times the largest that "
        "friction's own "
        "current could cause in any battery: read it as 'something that grows with effort', not as the "
        "battery.",
        f"The printed time constants would leave up to {100 * float(study.tau_remainder.max()):.0f} % of a "
        "step "
        "to go in the last 40 % of a 2 s level; the gains ask for "
        f"{100 * _value(study.ladder[4], 'remainder'):.1f} %. The paper does not say how long its levels "
        "last "
        "or where it reads.",
        "Unexplained, 3 % or more:",
    ]
    lines += [
        f"  {table.label(row)}: {table.gain[row]:.3f} printed, {best.predicted[row]:.3f} modelled "
        f"({100 * float(best.errors[row]):+.1f} %)"
        for row in study.unexplained(best)
    ]
    for repeat in study.repeats:
        if repeat.min_error >= 0.01:
            readings = ", ".join(f"{table.gain[row]:.3f} ({table.label(row)})" for row in repeat.rows)
            lines.append(
                f"  No model without memory gives two numbers for one level: {readings}; "
                f"{100 * repeat.min_error:.1f} % is its smallest possible error."
            )
    for row, straight in study.backward:
        lines.append(
            f"  {table.label(row)}: {table.gain[row]:.3f}, faster than straight ahead ({straight:.3f}); "
            "scrub can only slow a wheel down."
        )
    return lines


def model_tables(study: ModelStudy) -> list[PlainTable]:
    """The printed models against Table IV, and free-run errors on unseen runs."""
    printed = PlainTable(
        "The printed state-space models against the paper's own Table IV",
        ["Equation", "Fitted to", "DC gain", "Table's mean gain", "Rise to 63 %, s", "Table's mean τ, s"],
        [False, False, True, True, True, True],
        group=0,
    )
    for model in study.printed:
        printed.rows.append(
            [
                model.equation,
                model.run,
                f"{model.gain:.2f}",
                f"{model.table_gain:.3f}",
                f"{model.rise_s:.3f}",
                f"{model.table_tau_s:.3f}",
            ]
        )
    table = PlainTable(
        "Models on runs they never saw: free-run error",
        ["Fitted to", "Model", "Judged on", "Input", "", "Left, %", "Right, %"],
        [False, False, False, False, False, True, True],
    )
    for exercise in study.exercises:
        left, right = exercise.percent
        row = [exercise.fitted_to, exercise.model, exercise.judged_on, exercise.input]
        table.rows.append([*row, "fitted" if exercise.seen else "unseen", f"{left:.2f}", f"{right:.2f}"])
    table.remarks.append(
        "Root mean square of simulated less measured speed, in per cent of the 98th percentile of |speed| "
        "of the "
        "judged run. The simulation sees the input and the first rows' speed."
    )
    return [printed, table]


def model_sentences(study: ModelStudy) -> list[str]:
    """The findings on the printed models and on what carries over."""
    eq39, eq40 = study.printed
    errors = [abs(error) for _, error in printed_39_on_xvii()]

    def mean(fitted_to: str, judged_on: str, said: str) -> float:
        found = [
            exercise.mean_percent
            for exercise in study.exercises
            if (exercise.fitted_to, exercise.judged_on, exercise.input) == (fitted_to, judged_on, said)
        ]
        return sum(found) / len(found)

    return [
        f"Effort: the models of XI carry over to XVII ({mean('XI', 'XI', 'effort'):.1f} % on XI, "
        f"{mean('XI', 'XVII', 'effort'):.1f} % on XVII), as the paper finds, and to XVI, a velocity test, "
        "when "
        f"fed with the efforts that the controller applied ({mean('XI', 'XVI', 'applied effort'):.1f} %).",
        f"Velocity: the models of XV carry over to XVI ({mean('XV', 'XV', 'velocity'):.1f} % on XV, "
        f"{mean('XV', 'XVI', 'velocity'):.1f} % on XVI). On XVII they fail "
        f"({mean('XV', 'XVII', 'per cent as mm/s'):.0f} %) only because its per cents are read as mm/s: "
        "with one "
        f"number that turns effort into speed they reach {mean('XV', 'XVII', 'effort × gain of XI'):.1f} %.",
        "(40) cannot be right: it repeats A and B of (39) to the last digit although its input has "
        "another unit, "
        f"and its gain comes to {eq40.gain:.2f} where Table IV reads {eq40.table_gain:.3f} for XV. "
        f"(39) gives {eq39.gain:.2f} and Table IV {eq39.table_gain:.3f}.",
        f"(39) as printed misses the six printed gains of XVII by {100 * sum(errors) / len(errors):.1f} % on "
        f"average and {100 * max(errors):.1f} % at worst (15 %); and it rises to 63 % in {eq39.rise_s:.2f} s "
        f"where Table IV's time constants for XI average {eq39.table_tau_s:.2f} s.",
    ]


def mom_tables(study: MomStudy) -> list[PlainTable]:
    """Table 2 replayed."""
    table = PlainTable(
        "Table 2, the straight line from (0.5, 0.5, 45°): where each error model ends",
        [
            *("Error model", "Scale", "Drift, rad/m", "x, m", "y, m", "θ, °"),
            *("Off real, m", "°", "Off printed, m", "°"),
        ],
        [False, *[True] * 9],
        group=0,
    )
    for line in study.replays:
        end = line.end
        table.rows.append(
            [
                line.name,
                f"{line.model.scale:+.4f}",
                f"{line.model.straight:+.4f}",
                *_pose(end),
                f"{end.distance_m(REAL):.4f}",
                f"{end.turn_deg(REAL):+.2f}",
                f"{end.distance_m(PRINTED_MODEL):.4f}",
                f"{end.turn_deg(PRINTED_MODEL):+.2f}",
            ]
        )
    for name, pose in (
        ("printed: desired", DESIRED),
        ("printed: simulated", PRINTED_MODEL),
        ("printed: real", REAL),
    ):
        table.rows.append([name, "–", "–", *_pose(pose), "–", "–", "–", "–"])
    return [table]


def mom_sentences(study: MomStudy) -> list[str]:
    """What the replay shows, and what cannot be replayed."""
    paper, fitted, implied = study.paper, study.fitted, study.implied
    end = paper.end
    return [
        f"The paper's own constants end at ({end.x_m:.3f}, {end.y_m:.3f}, {end.theta_deg:.1f}°), not at the "
        f"({PRINTED_MODEL.x_m}, {PRINTED_MODEL.y_m}, {PRINTED_MODEL.theta_deg}°) that Table 2 prints for "
        "them: "
        f"{end.distance_m(PRINTED_MODEL):.2f} m and {end.turn_deg(PRINTED_MODEL):.1f}° apart.",
        f"That printed end asks for scale {implied.model.scale:+.3f} and drift "
        f"{implied.model.straight:+.3f} rad/m: "
        "a stronger drift than the paper's, and no scale at all.",
        f"The real end asks for scale {fitted.model.scale:+.3f} and drift {fitted.model.straight:+.3f} "
        "rad/m: "
        f"{1000 * fitted.end.distance_m(REAL):.0f} mm and {abs(fitted.end.turn_deg(REAL)):.1f}° off it, "
        "where the "
        f"paper's constants are {1000 * end.distance_m(REAL):.0f} mm and {abs(end.turn_deg(REAL)):.1f}° off.",
        "Two numbers for three coordinates of one end point: this is a fit, not a test of the model.",
        "Equation (4) prints v0 = (vr - vl)/2, which is zero on a straight line; the mean (vr + vl)/2 is "
        "used. "
        "The text gives the scale as 0.065, the equations as 0.0655.",
        "Tables 3 and 4 cannot be replayed: the paper prints their end points, not the commands that led "
        "there.",
    ]


def _pose(pose: Pose) -> list[str]:
    return [f"{pose.x_m:.4f}", f"{pose.y_m:.4f}", f"{(pose.theta_deg + 180) % 360 - 180:.2f}"]


def _parameter_rows(table: PlainTable, fit: RungFit) -> list[list[str]]:
    rows = []
    for name, value, (low, high) in zip(fit.rung.parameters, fit.theta.tolist(), fit.ci95, strict=True):
        item = PARAMETERS[name]
        bounded = name in fit.at_bound
        mark = table.note("stands at the end of what is possible: no interval") if bounded else ""
        interval = "–" if bounded else f"{low:.4g} … {high:.4g}"
        rows.append([fit.rung.name, f"{name.replace('_mps', '')} {item.symbol}", f"{value:.4g}{mark}"])
        rows[-1] += [interval, item.unit]
    return rows


def _short(table: GainTable, row: int) -> str:
    way = "p" if table.pivots[row] else "↓" if table.effort[row] < table.previous[row] else "↑"
    return f"{table.tests[row]} {100 * table.effort[row]:.0f}{way}"


def _floor_place(study: GainStudy) -> str:
    worst = max(study.repeats, key=lambda repeat: repeat.min_error)
    return f"{100 * worst.effort:.0f}"


def _value(fit: RungFit, name: str) -> float:
    return float(fit.theta[fit.rung.parameters.index(name)])
