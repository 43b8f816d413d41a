"""Discrete state-space models by a subspace method (PO-MOESP), order chosen by held-out error.

The method: Verhaegen, "Identification of the deterministic part of MIMO state space models given in
innovations form from input-output data", Automatica 30(1), 1994. The column space of the extended
observability matrix comes from the part of the future outputs that past inputs and outputs explain
once the future inputs are projected out; A and C follow from its shift structure. B and the initial
states are then the least-squares solution of the free-run simulation (in which they are linear). A and
B then move to the nearest minimum of the free-run error, and K of (39) minimises the one-step error with
the rest held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import IdentifyError
from truing.identify.even import EvenStretch, even_signal
from truing.identify.held_out import folds, rms_by_run, simplest_good
from truing.identify.model_error import FreeRunError, OneStepError, free_run_error, one_step_error
from truing.identify.signals import WheelSignal, wheel_signal
from truing.levenberg import minimise
from truing.model.linear import StateSpaceModel
from truing.recording.run import Geometry, Run, Wheel

MAXIMUM_ORDER = 4
BLOCK_ROWS = 10
# Rows of a left-out stretch from which its initial state is estimated; they are not judged.
START_ROWS = 8
# Steps of the search that follows the subspace estimate.
REFINEMENTS = 6
MAXIMUM_FOLDS = 4


@dataclass(frozen=True, slots=True)
class StateSpaceFit:
    """A fitted state-space model; see `ArxFit` for the errors.

    Attributes
    ----------
    considered : order to held-out free-run RMS, m/s.
    singular_values : of the projected data, shape (BLOCK_ROWS,): a drop shows the order that the data hold.
    """

    wheel: Wheel
    model: StateSpaceModel
    one_step: OneStepError
    free_run: FreeRunError
    held_out_one_step: OneStepError
    held_out_free_run: FreeRunError
    considered: dict[int, float]
    singular_values: FloatArray

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        model = self.model
        return {
            "wheel": self.wheel,
            "model": "state_space",
            "A": model.a.tolist(),
            "B": model.b.tolist(),
            "C": model.c.tolist(),
            "K": model.k.tolist(),
            "interval_s": model.interval_s,
            "gain_mps": model.gain_mps,
            "one_step": self.one_step.to_json(),
            "free_run": self.free_run.to_json(),
            "one_step_held_out": self.held_out_one_step.to_json(),
            "free_run_held_out": self.held_out_free_run.to_json(),
        }


def fit_state_space(
    runs: Sequence[Run], side: Wheel, baseline: Geometry | None = None, *, order: int | None = None
) -> StateSpaceFit:
    """Fit one wheel; an order that is not given is chosen by held-out free-run error."""
    return fit_state_space_signal(wheel_signal(runs, side, baseline), side, order=order)


def fit_state_space_signal(signal: WheelSignal, side: Wheel, *, order: int | None = None) -> StateSpaceFit:
    """The same for a signal that is already put together."""
    if order is not None and not 1 <= order < BLOCK_ROWS:
        raise IdentifyError(f"the order of a state-space model is 1 to {BLOCK_ROWS - 1}, not {order}")
    even = even_signal(signal, 3 * BLOCK_ROWS)
    orders = list(range(1, MAXIMUM_ORDER + 1)) if order is None else [order]
    runs = sorted({stretch.run for stretch in even.stretches})
    names = tuple(even.names[run] for run in runs)
    divisions = folds(even, MAXIMUM_FOLDS)
    models: dict[int, list[StateSpaceModel]] = {n: [] for n in orders}
    free = {n: np.zeros(len(runs)) for n in orders}
    ahead = np.zeros(len(runs))
    whole = {stretch: _factor(stretch) for stretch in even.stretches}
    for fold in divisions:
        # With one run a fold holds parts of its stretches, which need factors of their own.
        factors = [whole[s] if s in whole else _factor(s) for s in fold.fitted]
        basis, _ = _subspace(factors)
        judged = sorted({stretch.run for stretch in fold.judged})
        places = [runs.index(run) for run in judged]
        for n in orders:
            models[n].append(_realise(basis, n, fold.fitted, even.interval_s))
            free[n][places] = _errors(models[n][-1], fold.judged, judged)[1]
    scores = [(float(np.sqrt(np.mean(free[n] ** 2))), n) for n in orders]
    chosen = orders[simplest_good(scores)]
    for fold, model in zip(divisions, models[chosen], strict=True):
        judged = sorted({stretch.run for stretch in fold.judged})
        predictor = replace(model, k=_innovation_gain(model, fold.fitted))
        ahead[[runs.index(run) for run in judged]] = _errors(predictor, fold.judged, judged)[0]

    basis, singular_values = _subspace(list(whole.values()))
    model = _realise(basis, chosen, even.stretches, even.interval_s)
    model = replace(model, k=_innovation_gain(model, even.stretches))
    one_step, free_run = _errors(model, even.stretches, runs)
    return StateSpaceFit(
        side,
        model,
        one_step_error(names, one_step),
        free_run_error(names, free_run, even.scale_mps),
        one_step_error(names, ahead, held_out=True),
        free_run_error(names, free[chosen], even.scale_mps, held_out=True),
        {n: error for (error, n) in scores},
        singular_values,
    )


def _factor(stretch: EvenStretch) -> FloatArray:
    """A stretch's future inputs, past inputs, past outputs, future outputs as a triangle.

    Shape (4 BLOCK_ROWS, 4 BLOCK_ROWS): the LQ factor of its Hankel matrices, which is all that the
    method needs of it, so that leaving runs out costs nothing. A short stretch gives zeros.
    """
    rows = BLOCK_ROWS
    # u(t) is the effort of row t+1 (see ArxModel), so that y(t) depends on u(t-1) and before.
    u, y = stretch.effort[1:], stretch.speed[:-1]
    count = len(y) - 2 * rows + 1
    factor = np.zeros((4 * rows, 4 * rows))
    if count >= 1:
        hankel_u = np.lib.stride_tricks.sliding_window_view(u, count)[: 2 * rows]
        hankel_y = np.lib.stride_tricks.sliding_window_view(y, count)[: 2 * rows]
        data = np.concatenate((hankel_u[rows:], hankel_u[:rows], hankel_y[:rows], hankel_y[rows:]))
        triangle = np.asarray(np.linalg.qr(data.T / np.sqrt(count), mode="r")).T
        factor[:, : triangle.shape[1]] = triangle
    return factor


def _subspace(factors: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Scaled basis of the extended observability matrix (BLOCK_ROWS, BLOCK_ROWS), and singular values."""
    rows = BLOCK_ROWS
    stacked = np.concatenate(factors, axis=1)
    if not np.any(stacked):
        raise IdentifyError(f"a subspace fit needs stretches of {2 * rows + 1} rows or more that move")
    lower = np.asarray(np.linalg.qr(stacked.T, mode="r")).T
    part = lower[3 * rows :, rows : 3 * rows]
    left, singular, _ = np.linalg.svd(part, full_matrices=False)
    return left * np.sqrt(np.maximum(singular, 1e-300)), singular


def _realise(
    basis: FloatArray, order: int, stretches: Sequence[EvenStretch], interval_s: float
) -> StateSpaceModel:
    """A and C from the shift structure, B by simulation error; K is left at zero."""
    gamma = np.asarray(basis[:, :order], dtype=np.float64)
    c = np.ascontiguousarray(gamma[0])
    shift, *_ = np.linalg.lstsq(gamma[:-1], gamma[1:], rcond=1e-10)
    a: FloatArray = np.asarray(shift, dtype=np.float64)
    values, vectors = np.linalg.eig(a)
    if np.any(np.abs(values) >= 0.9999):
        # A wheel is stable; noise may push a pole out. Poles are brought back along their own direction.
        scale = np.where(np.abs(values) >= 0.9999, 0.9999 / np.maximum(np.abs(values), 1e-12), 1.0)
        a = np.real(vectors @ np.diag(values * scale) @ np.linalg.inv(vectors))
    a = np.ascontiguousarray(a, dtype=np.float64)
    model = StateSpaceModel(a, np.zeros(order), c, np.zeros(order), interval_s)
    model = replace(model, b=_input_matrix(model, stretches))
    return _refine(model, stretches)


def _input_matrix(model: StateSpaceModel, stretches: Sequence[EvenStretch]) -> FloatArray:
    """B (order,) that minimises the free-run error, each stretch with an initial state of its own."""
    order = model.order
    gram, moment = np.zeros((order, order)), np.zeros(order)
    for stretch in stretches:
        n = len(stretch.speed)
        driven = np.column_stack(
            [replace(model, b=unit).simulate(stretch.effort, np.zeros(order)) for unit in np.eye(order)]
        )
        quiet = np.zeros(n)
        own = np.column_stack([model.simulate(quiet, unit) for unit in np.eye(order)])
        # The initial state is projected out.
        q, _ = np.linalg.qr(own)
        driven = driven - q @ (q.T @ driven)
        target = stretch.speed - q @ (q.T @ stretch.speed)
        gram += driven.T @ driven / n
        moment += driven.T @ target / n
    ridge = 1e-10 * float(np.trace(gram)) / order
    return np.asarray(np.linalg.solve(gram + ridge * np.eye(order), moment), dtype=np.float64)


def _refine(model: StateSpaceModel, stretches: Sequence[EvenStretch]) -> StateSpaceModel:
    """A and B moved to the nearest minimum of the free-run error, from the subspace estimate.

    A subspace estimate minimises nothing; what it leaves matters most where the wheel is not linear
    (friction), which it takes for slow poles.
    """
    order = model.order
    entries = order * order

    def at(theta: FloatArray) -> StateSpaceModel:
        return replace(model, a=theta[:entries].reshape(order, order).copy(), b=theta[entries:].copy())

    def residual(theta: FloatArray) -> FloatArray:
        trial = at(theta)
        parts = []
        with np.errstate(over="ignore", invalid="ignore"):
            for s in stretches:
                run = trial.simulate(s.effort, trial.start(s.effort, s.speed, START_ROWS))
                parts.append((run - s.speed)[START_ROWS:] / np.sqrt(len(s.speed)))
        return np.asarray(np.clip(np.nan_to_num(np.concatenate(parts), nan=1e6), -1e6, 1e6))

    def jacobian(theta: FloatArray, r: FloatArray) -> FloatArray:
        columns = []
        for unit in np.eye(len(theta)):
            step = 1e-7 * max(1.0, abs(float(theta @ unit)))
            columns.append((residual(theta + step * unit) - r) / step)
        return np.column_stack(columns)

    start = np.concatenate((model.a.ravel(), model.b))
    wide = np.full(len(start), 1e6)
    end = minimise(residual, jacobian, start, -wide, wide, iterations=REFINEMENTS, tolerance=1e-4)
    refined = at(end.theta)
    return refined if refined.stable else model


def _innovation_gain(model: StateSpaceModel, stretches: Sequence[EvenStretch]) -> FloatArray:
    """K (order,) that minimises the one-step error; zero is the free-run model."""
    starts = [model.start(s.effort, s.speed, START_ROWS) for s in stretches]

    def residual(k: FloatArray) -> FloatArray:
        trial = replace(model, k=k)
        parts = [
            (trial.predict(s.effort, s.speed, x) - s.speed)[START_ROWS:] / np.sqrt(len(s.speed))
            for s, x in zip(stretches, starts, strict=True)
        ]
        return np.asarray(np.clip(np.nan_to_num(np.concatenate(parts), nan=1e6), -1e6, 1e6))

    def jacobian(k: FloatArray, r: FloatArray) -> FloatArray:
        step = 1e-6 * max(1.0, float(np.max(np.abs(k))))
        return np.column_stack([(residual(k + step * unit) - r) / step for unit in np.eye(len(k))])

    zero = np.zeros(model.order)
    wide = np.full(model.order, 1e6)
    return minimise(residual, jacobian, zero, -wide, wide, iterations=15, tolerance=1e-4).theta


def _errors(
    model: StateSpaceModel, stretches: Sequence[EvenStretch], runs: Sequence[int]
) -> tuple[FloatArray, FloatArray]:
    """One-step and free-run RMS of each run; the rows that give the initial state are not judged."""
    ahead, free = [], []
    for stretch in stretches:
        start = model.start(stretch.effort, stretch.speed, START_ROWS)
        measured = stretch.speed[START_ROWS:]
        ahead.append(model.predict(stretch.effort, stretch.speed, start)[START_ROWS:] - measured)
        free.append(model.simulate(stretch.effort, start)[START_ROWS:] - measured)
    return rms_by_run(stretches, ahead, runs), rms_by_run(stretches, free, runs)
