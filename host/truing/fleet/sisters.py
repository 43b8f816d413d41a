"""Which robots differ from their sisters, and robots' numbers pooled where their own data are thin.

A robot's own mean y_i has the variance v_i. Pooling: random-effects meta-analysis of the sisters (mean mu,
variance between robots T^2 by Paule and Mandel 1982, `statsmodels.stats.meta_analysis.combine_effects`), then
the empirical-Bayes estimate b_i = (T^2 y_i + v_i mu) / (T^2 + v_i), with variance T^2 v_i / (T^2 + v_i)
(Efron and Morris 1975; Raudenbush and Bryk 2002, chapter 3). A mixed model of the single values
(`statsmodels.MixedLM`) would not take the interval that each set's own fit has, which is why it is not used.

Differing: the distance to the sisters' median over its own standard deviation and their robust spread
(median absolute deviation, so that one robot that wears does not hide another). Robots that differ are no
exchangeable sisters: they are left out of mu and T^2, and are not pooled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from truing.fleet.series import Series
from truing.fleet.variation import Variation

MIN_SISTERS = 6
# The median absolute deviation of a normal distribution times this is its standard deviation; as an estimate
# it is worth this share of the values (Rousseeuw and Croux 1993).
MAD_SCALE, MAD_EFFICIENCY = 1.4826, 0.37


@dataclass(frozen=True, slots=True)
class RobotNumber:
    """A robot's number, its sisters', and both together.

    Attributes
    ----------
    own, own_sd : weighted mean over its sets, and its standard deviation.
    centre : median of the sisters; NaN with too few.
    p : of being a sister like the others; NaN with too few.
    differs : it is none, at the false discovery rate asked for.
    pooled, pooled_sd : the empirical-Bayes estimate; of a robot that differs, its own.
    """

    robot: str
    group: str
    parameter: str
    wheel: str
    unit: str
    sets: int
    own: float
    own_sd: float
    centre: float
    p: float
    differs: bool
    pooled: float
    pooled_sd: float

    @property
    def relative(self) -> float:
        """Distance to the sisters' median, as a share of it."""
        return (self.own - self.centre) / abs(self.centre) if self.centre else float("nan")


def own_numbers(sisters: Sequence[Series], variation: Variation) -> list[RobotNumber]:
    """Each robot's own mean, and the p value of being a sister like the others."""
    own, var = [], []
    for one in sisters:
        w = variation.weights(one)
        own.append(float(w @ one.value) / float(w.sum()))
        var.append(variation.inflation / float(w.sum()))
    y, v = np.array(own), np.array(var)
    centre, p = np.nan, np.full(len(y), np.nan)
    if len(y) >= MIN_SISTERS:
        centre = float(np.median(y))
        spread2 = (MAD_SCALE * float(np.median(np.abs(y - centre)))) ** 2
        between2 = max(spread2 - float(np.median(v)), 0.0)
        free = max(3.0, MAD_EFFICIENCY * (len(y) - 1))
        p = 2.0 * scipy.stats.t.sf(np.abs(y - centre) / np.sqrt(v + between2), free)
    return [
        RobotNumber(
            one.robot, one.group, one.parameter, one.wheel, one.unit, len(one), own[k],
            float(np.sqrt(var[k])), centre, float(p[k]), False, own[k], float(np.sqrt(var[k])),
        )
        for k, one in enumerate(sisters)
    ]  # fmt: skip


def pooled(numbers: Sequence[RobotNumber]) -> list[RobotNumber]:
    """The sisters' numbers with their empirical-Bayes estimates; `differs` is known."""
    from dataclasses import replace

    from statsmodels.stats.meta_analysis import combine_effects

    alike = [one for one in numbers if not one.differs]
    if len(alike) < 3:
        return list(numbers)
    y, v = np.array([one.own for one in alike]), np.array([one.own_sd**2 for one in alike])
    # The iteration of Paule and Mandel wants numbers of the order of one.
    scale = float(np.median(np.abs(y))) or 1.0
    found = combine_effects(y / scale, v / scale**2, method_re="iterated")
    mu, between2 = float(found.mean_effect_re) * scale, max(float(found.tau2), 0.0) * scale**2
    out = []
    for one in numbers:
        if one.differs:
            out.append(one)
            continue
        share = between2 / (between2 + one.own_sd**2)
        # With no variance between robots the common mean's own is what is left.
        sd = np.sqrt(share * one.own_sd**2 + (1.0 - share) ** 2 * float(found.sd_eff_w_re * scale) ** 2)
        out.append(replace(one, pooled=share * one.own + (1.0 - share) * mu, pooled_sd=float(sd)))
    return out
