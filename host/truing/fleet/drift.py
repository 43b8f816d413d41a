"""Which parameter of which robot changes with time, in which form, and since when.

A constant is held against three forms: a line from the first set on, a hinge (constant, then a line: wear
that begins), and a step (a part that was changed). Each is one number more than the constant, given its date;
the F test of the best of all, times the number of tests (Bonferroni over forms and dates), is the series'
p value. Over robots and parameters the false discovery rate is held by Benjamini and Hochberg (1995), through
statsmodels. The form is chosen by the Bayesian information criterion; the date's 95 % interval holds the
dates whose fit is not worse by the F test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy

from truing.arrays import FloatArray
from truing.fleet.series import Series
from truing.fleet.variation import Variation

Form = Literal["line", "hinge", "step"]
MIN_SETS = 6
# Dates that are tested; with more sets they are spread over them.
MAX_DATES = 20
# Sets that must lie on either side of a step, and after the corner of a hinge.
BESIDE = 3
# Dates between two sets at which a hinge's corner is looked for.
BETWEEN_SETS = 4
DAYS_OF_A_YEAR = 365.25


@dataclass(frozen=True, slots=True)
class Change:
    """How a series changes with time.

    Attributes
    ----------
    p : of no change at all, after the correction for the forms and dates tested.
    rate : per year, of a line or hinge; ci95: its interval. The whole change, of a step.
    since_days : when it began, since 1970; since95: its interval. Of a line, the first set.
    level : before the change; now: at the last set.
    is_found : the p value stands over all robots and parameters at the false discovery rate asked for.
    """

    series: Series
    form: Form
    p: float
    rate: float
    ci95: tuple[float, float]
    since_days: float
    since95: tuple[float, float]
    level: float
    now: float
    is_found: bool = False

    @property
    def relative(self) -> float:
        """Change from the first level to the last, as a share of the first."""
        return (self.now - self.level) / abs(self.level) if self.level else float("nan")

    def curve(self, t_days: FloatArray) -> FloatArray:
        """The fitted form at these days, shape (n,)."""
        slope = self.rate if self.form == "step" else self.rate / DAYS_OF_A_YEAR
        return np.asarray(self.level + slope * regressor(self.form, t_days, self.since_days))


def regressor(form: Form, t_days: FloatArray, at: float) -> FloatArray:
    """What the change's size is multiplied by, shape (n,): days since `at`, or one from then on."""
    if form == "step":
        return np.asarray(t_days >= at, dtype=np.float64)
    return np.asarray(np.maximum(t_days - at, 0.0))


def change_of(series: Series, variation: Variation) -> Change | None:
    """The best form of change of a series, and its evidence; None where there are too few sets."""
    n = len(series)
    t = series.t_days
    if n < MIN_SETS or t[-1] - t[0] < 1.0:
        return None
    w = variation.weights(series)
    tests: list[tuple[Form, float]] = [("line", float(t[0]))]
    dates = _dates(t)
    tests += [("hinge", at) for at in dates if at > t[0]]
    tests += [("step", at) for at in dates if at >= t[BESIDE]]
    z = np.column_stack([regressor(form, t, at) for form, at in tests])
    explained, constant = _explained(z, series.value, w)
    p = _p_values(explained, constant, tests, n, variation)
    forms: tuple[Form, ...] = ("line", "hinge", "step")
    sizes = {form: _best(form, tests, explained) for form in forms}
    parameters = {"line": 2, "hinge": 3, "step": 3}
    bic: dict[Form, float] = {
        form: n * np.log(max(constant - explained[k], 1e-300) / n) + parameters[form] * np.log(n)
        for form, k in sizes.items()
        if k is not None
    }
    form = min(bic, key=lambda name: bic[name])
    return _described(series, w, form, variation, min(1.0, float(np.min(p)) * len(tests)))


def _dates(t: FloatArray) -> list[float]:
    """Dates of sets at which a change may begin."""
    inner = np.unique(t[:-BESIDE])
    if len(inner) > MAX_DATES:
        inner = inner[np.unique(np.linspace(0, len(inner) - 1, MAX_DATES).round().astype(int))]
    return [float(at) for at in inner]


def _explained(z: FloatArray, y: FloatArray, w: FloatArray) -> tuple[FloatArray, float]:
    """Weighted sums of squares: what each column explains beside a constant, and the constant's residual."""
    total = float(w.sum())
    residual = y - float(w @ y) / total
    centred = z - (w @ z) / total
    power = w @ centred**2
    safe = np.where(power > 0.0, power, np.inf)
    return np.asarray((w * residual) @ centred) ** 2 / safe, float(w @ residual**2)


def _p_values(
    explained: FloatArray, constant: float, tests: Sequence[tuple[Form, float]], n: int, variation: Variation
) -> FloatArray:
    used = np.array([2.0 if form == "line" else 3.0 for form, _ in tests])
    free = _free(n, used, variation)
    # The residual's scale is never taken below what the sets' intervals and the sisters' variation say.
    scale = np.maximum((constant - explained) / (n - used), 1.0) * variation.inflation
    return np.asarray(scipy.stats.f.sf(explained / scale, 1.0, free))


def _free(n: int, used: FloatArray | float, variation: Variation) -> FloatArray:
    """Degrees of freedom: sets that are alike count for fewer."""
    return np.asarray(np.maximum(n / variation.inflation - used, 1.0), dtype=np.float64)


def _best(form: str, tests: Sequence[tuple[Form, float]], explained: FloatArray) -> int | None:
    own = [k for k, (name, _) in enumerate(tests) if name == form]
    return max(own, key=lambda k: explained[k]) if own else None


def _fine_dates(form: Form, t: FloatArray) -> FloatArray:
    """Dates at which a form is fitted: of a hinge between the sets too, where its corner may lie."""
    if form == "line":
        return t[:1]
    if form == "step":
        return np.unique(t[BESIDE : len(t) - BESIDE + 1])
    days = np.unique(t[: len(t) - BESIDE + 1])
    places = np.linspace(0.0, len(days) - 1.0, (len(days) - 1) * BETWEEN_SETS + 1)
    return np.asarray(np.interp(places, np.arange(len(days)), days))


def _described(series: Series, w: FloatArray, form: Form, variation: Variation, p: float) -> Change:
    """The fit of one form over all dates, with its intervals."""
    t, y, n = series.t_days, series.value, len(series)
    at = _fine_dates(form, t)
    z = np.column_stack([regressor(form, t, float(day)) for day in at])
    explained, constant = _explained(z, y, w)
    k = int(np.argmax(explained))
    used = 2.0 if form == "line" else 3.0
    free = float(_free(n, used, variation))
    scale = max((constant - float(explained[k])) / (n - used), 1.0) * variation.inflation
    within = explained >= explained[k] - scale * float(scipy.stats.f.ppf(0.95, 1.0, free))
    days = at[within]
    first = float(days.min())
    if form == "step":  # it happened between two sets
        first = float(t[t < first].max())
    column = z[:, k]
    mean = float(w @ column) / float(w.sum())
    power = float(w @ (column - mean) ** 2)
    size = float((w * (y - float(w @ y) / float(w.sum()))) @ (column - mean)) / power
    half = float(scipy.stats.t.ppf(0.975, free)) * np.sqrt(scale / power)
    unit = 1.0 if form == "step" else DAYS_OF_A_YEAR
    level = float(w @ y) / float(w.sum()) - size * mean
    return Change(
        series,
        form,
        p,
        rate=size * unit,
        ci95=((size - half) * unit, (size + half) * unit),
        since_days=float(at[k]),
        since95=(first, float(days.max())),
        level=level,
        now=level + size * float(column[-1]),
    )
