"""The noise model of a fit: its residual without what is predictable out of sample."""

from __future__ import annotations

import numpy as np

from truing.diagnose.fit import Fit
from truing.diagnose.noise import Noise
from truing.diagnose.problem import Problem, noise_of_residual, robust_pose_sigma
from truing.diagnose.residual_tests import residual_structure, wheel_taus
from truing.diagnose.search import Search, effect_set


def noise_from_fit(problem: Problem, best: Fit) -> Noise:
    """Noise model of a fit's residual without its predictable structure."""
    residual = problem.data.speed_mps - best.residual.speeds
    taus = np.minimum(wheel_taus(problem, best.theta), wheel_taus(problem, problem.simulator.start()))
    preliminary = noise_of_residual(problem.data, residual, problem.counted, taus)
    found = residual_structure(problem.with_noise(preliminary), best)
    return noise_of_residual(problem.data, residual - found.predicted, problem.counted, taus)


def under_noise_of(search: Search, best: Fit) -> Search:
    """The search under the noise model of `best`, which is refined with the fits that lack one effect."""
    problem = search.problem
    fewer = [
        one
        for one in search.fits.values()
        if set(one.effects) < set(best.effects) and len(one.effects) in (0, len(best.effects) - 1)
    ]
    keep = list({effect_set(*one.effects): one for one in (search.fits[()], *fewer, best)}.values())
    sigma = robust_pose_sigma(problem, best.theta, best.effects)
    return search.refitted_under(problem.with_noise(noise_from_fit(problem, best), sigma), keep)
