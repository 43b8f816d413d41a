"""Which terms are kept: forward, each by what it takes off the error on groups of runs left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.diagnose.learned.regression import (
    LINEAR,
    PENALTIES,
    Left,
    Sums,
    block,
    difference_penalty,
    sums_of,
)
from truing.diagnose.learned.variables import Candidate
from truing.model.correction import PERIODIC

# Terms at most.
MAX_TERMS = 4
# A term is kept if it takes this share off the squared error on runs left out, and its gain over the groups
# is so many standard errors from zero (or every group gains).
MIN_GAIN, MIN_ERRORS = 0.02, 1.6
# A candidate that stands earlier in the list, the simpler one, is taken if it brings this share of the best.
SIMPLER = 0.92
# Penalty on the linear parts, which are not clipped: beyond what was seen they go on growing.
LINEAR_PENALTY = 0.03
# Share of the mean that is added to each group's error: groups without an error do not decide either.
EVEN = 0.1
# Candidates that are tried under every penalty.
PROMISING = 6
# Multiples of a constant that are tried once its term is chosen.
COARSE = (0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4)
FINE = (0.97, 0.985, 1.0, 1.015, 1.03)


@dataclass(frozen=True, slots=True)
class Chosen:
    """Indices of candidates in the order in which they were kept, and the weight of their penalty."""

    terms: tuple[int, ...]
    penalty: float


def select(sums: Sums, groups: Sequence[int]) -> Chosen:
    """Keep terms as long as one brings something, judged by leaving out each of these groups in turn."""
    chosen = Chosen((), PENALTIES[1])
    weights = group_weights(sums, groups)
    # What the linear parts alone bring is no term's merit.
    before = min(
        (weights * _left_out(sums, (), PENALTIES[1], groups, linear=linear) for linear in (False, True)),
        key=lambda errors: float(errors.sum()),
    )
    for _ in range(MAX_TERMS):
        tried = []
        for k in _promising(sums, chosen.terms, groups, weights):
            options = [(weights * _left_out(sums, (*chosen.terms, k), p, groups), p) for p in PENALTIES]
            errors, penalty = min(options, key=lambda pair: float(pair[0].sum()))
            tried.append((float(errors.sum()), k, penalty, errors))
        if not tried:
            break
        lowest = min(each[0] for each in tried)
        total = float(before.sum())
        if not lowest < total:
            break
        good = [each for each in tried if total - each[0] >= SIMPLER * (total - lowest)]
        _, k, penalty, errors = min(good, key=lambda each: each[1])
        if not _is_gain(before - errors, total):
            break
        chosen, before = Chosen((*chosen.terms, k), penalty), errors
    return chosen


def group_weights(sums: Sums, groups: Sequence[int]) -> FloatArray:
    """Weights of the groups' squared errors, shape (groups,): about one over what the physics leaves in each.

    One run of large errors, the only one at full effort say, is predicted badly from the others whatever is
    missing. Unweighted it would decide alone, and against every term that all others show.
    """
    square = sums.square[list(groups)].sum(axis=1)
    return np.asarray(1.0 / np.maximum(square + EVEN * float(square.mean()), 1e-300))


def _promising(sums: Sums, terms: tuple[int, ...], groups: Sequence[int], weights: FloatArray) -> list[int]:
    """The candidates that do best under one penalty, in their order."""
    left = [k for k in range(len(sums.candidates)) if not _is_alike(sums, k, terms)]
    errors = {k: float(weights @ _left_out(sums, (*terms, k), PENALTIES[1], groups)) for k in left}
    return sorted(sorted(left, key=lambda k: errors[k])[:PROMISING])


def _is_gain(gain: FloatArray, total: float) -> bool:
    """Whether a gain by groups (g,) is one beyond chance."""
    if gain.sum() < MIN_GAIN * total:
        return False
    spread = float(gain.std(ddof=1)) * np.sqrt(len(gain)) if len(gain) > 1 else np.inf
    return bool(gain.sum() > MIN_ERRORS * spread or (gain > 0.0).all())


def _is_alike(sums: Sums, k: int, kept: tuple[int, ...]) -> bool:
    """Whether a candidate, or the same at another constant, is kept already."""
    one = sums.candidates[k]
    return any(
        sums.candidates[other].place == one.place and sums.candidates[other].variable == one.variable
        for other in kept
    )


def columns(sums: Sums, terms: Sequence[int]) -> IntArray:
    """Columns of a regression with these terms."""
    return np.concatenate([np.arange(LINEAR), *(sums.at[k] for k in terms)])


def penalty_matrix(sums: Sums, terms: Sequence[int], weight: float, gram: FloatArray) -> FloatArray:
    """The penalty of a regression on its columns; `gram` is that of the rows it is fitted to."""
    width = LINEAR + sum(len(sums.at[k]) for k in terms)
    out = np.zeros((width, width))
    at = LINEAR
    for k in terms:
        size = len(sums.at[k])
        part = slice(at, at + size)
        level = float(np.mean(np.diag(gram)[part]))
        out[part, part] = weight * level * difference_penalty(sums.candidates[k])
        at += size
    out[np.arange(LINEAR), np.arange(LINEAR)] = LINEAR_PENALTY * np.diag(gram)[:LINEAR] + 1e-12
    return out + 1e-12 * np.eye(width)


def solve(sums: Sums, terms: Sequence[int], weight: float, groups: Sequence[int], w: int) -> FloatArray:
    """Coefficients of one wheel from these groups, shape (width,)."""
    cols = columns(sums, terms)
    gram = block(sums.gram, groups, w, cols).sum(axis=0)
    moment = sums.moment[list(groups), w][:, cols].sum(axis=0)
    out: FloatArray = np.linalg.solve(gram + penalty_matrix(sums, terms, weight, gram), moment)
    return out


def _left_out(
    sums: Sums, terms: tuple[int, ...], weight: float, groups: Sequence[int], *, linear: bool = True
) -> FloatArray:
    """Squared errors on each group by the regression without it, shape (groups,)."""
    if not linear:
        return np.asarray(sums.square[list(groups)].sum(axis=1))
    cols = columns(sums, terms)
    out = np.zeros(len(groups))
    for w in range(2):
        grams = block(sums.gram, groups, w, cols)
        moments = sums.moment[list(groups), w][:, cols]
        whole, sum_ = grams.sum(axis=0), moments.sum(axis=0)
        if not whole.any():
            continue
        penalty = penalty_matrix(sums, terms, weight, whole)
        theta = np.linalg.solve(whole[None] - grams + penalty[None], (sum_[None] - moments)[..., None])[
            ..., 0
        ]
        square = sums.square[list(groups), w]
        out += square - 2.0 * np.einsum("gk,gk->g", theta, moments)
        out += np.einsum("gk,gkl,gl->g", theta, grams, theta)
    return out


def at_best_constants(left: Left, sums: Sums, chosen: Chosen, groups: Sequence[int]) -> tuple[Sums, Chosen]:
    """The chosen terms, each at that constant nearby that does best on these groups."""
    kept = [sums.candidates[k] for k in chosen.terms]
    for place, one in enumerate(kept):
        if one.constant <= 0.0 or one.variable == "heading":
            continue
        shares = FINE if one.variable in PERIODIC else COARSE
        tried = [_with_constant(one, share * one.constant) for share in shares]
        others = [other for k, other in enumerate(kept) if k != place]
        near = sums_of(left, [*others, *tried])
        fixed = tuple(range(len(others)))
        errors = [
            float(_left_out(near, (*fixed, len(others) + k), chosen.penalty, groups).sum())
            for k in range(len(tried))
        ]
        kept[place] = tried[int(np.argmin(errors))]
    if kept == [sums.candidates[k] for k in chosen.terms]:
        return sums, chosen
    return sums_of(left, kept), Chosen(tuple(range(len(kept))), chosen.penalty)


def _with_constant(one: Candidate, constant: float) -> Candidate:
    """The candidate at another constant; a period's grid goes with it."""
    grid = one.grid
    if one.variable in PERIODIC:
        grid = tuple(float(x) for x in np.array(grid) * constant / one.constant)
    return Candidate(one.place, one.variable, constant, grid)
