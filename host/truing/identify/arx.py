"""ARX models by least squares, equations (27) to (38) of the paper, orders chosen by held-out error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truing.arrays import FloatArray
from truing.errors import IdentifyError
from truing.identify.even import EvenSignal, EvenStretch, even_signal
from truing.identify.held_out import folds, rms_by_run, simplest_good
from truing.identify.model_error import FreeRunError, OneStepError, free_run_error, one_step_error
from truing.identify.signals import WheelSignal, wheel_signal
from truing.model.linear import ArxModel
from truing.recording.run import Geometry, Run, Wheel

MAXIMUM_ALPHA = 4
MAXIMUM_BETA = 8


@dataclass(frozen=True, slots=True)
class ArxFit:
    """A fitted ARX model; its one-step and its free-run error are different things.

    Attributes
    ----------
    one_step, free_run : on the runs that were fitted.
    held_out_one_step, held_out_free_run : on left-out runs (with one run: on its end).
    considered : (alpha, beta) to held-out free-run RMS, m/s, for every order that was tried.
    """

    wheel: Wheel
    model: ArxModel
    one_step: OneStepError
    free_run: FreeRunError
    held_out_one_step: OneStepError
    held_out_free_run: FreeRunError
    considered: dict[tuple[int, int], float]

    def to_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "wheel": self.wheel,
            "model": "arx",
            "m": self.model.m.tolist(),
            "n": self.model.n.tolist(),
            "interval_s": self.model.interval_s,
            "gain_mps": self.model.gain_mps,
            "one_step": self.one_step.to_json(),
            "free_run": self.free_run.to_json(),
            "one_step_held_out": self.held_out_one_step.to_json(),
            "free_run_held_out": self.held_out_free_run.to_json(),
        }


def fit_arx(
    runs: Sequence[Run],
    side: Wheel,
    baseline: Geometry | None = None,
    *,
    alpha: int | None = None,
    beta: int | None = None,
) -> ArxFit:
    """Fit one wheel; orders that are not given are chosen by held-out free-run error."""
    return fit_arx_signal(wheel_signal(runs, side, baseline), side, alpha=alpha, beta=beta)


def fit_arx_signal(
    signal: WheelSignal, side: Wheel, *, alpha: int | None = None, beta: int | None = None
) -> ArxFit:
    """The same for a signal that is already put together."""
    alphas = range(1, MAXIMUM_ALPHA + 1) if alpha is None else (alpha,)
    betas = range(1, MAXIMUM_BETA + 1) if beta is None else (beta,)
    if min(alphas) < 1 or min(betas) < 1:
        raise IdentifyError("ARX orders start at 1")
    history = max(*alphas, *(order - 1 for order in betas), 1)
    even = even_signal(signal, 2 * history + 4)
    orders = [(a, b) for a in alphas for b in betas]
    held_out = _held_out(even, orders, history)
    scores = [(held_out[order][1].rms_mps, sum(order)) for order in orders]
    chosen = orders[simplest_good(scores)]

    runs = sorted({stretch.run for stretch in even.stretches})
    model = least_squares(_triangles(even.stretches, history), chosen, even.interval_s)
    one_step, free_run = _errors(model, even.stretches, history, runs)
    names = tuple(even.names[run] for run in runs)
    return ArxFit(
        side,
        model,
        one_step_error(names, one_step),
        free_run_error(names, free_run, even.scale_mps),
        *held_out[chosen],
        {order: error.rms_mps for order, (_, error) in held_out.items()},
    )


@dataclass(frozen=True, slots=True)
class _Triangle:
    """The regression of one run, reduced to a triangle: all that least squares needs of it.

    Attributes
    ----------
    factor : shape (columns, columns), columns v(t-1).., u(t), u(t-1).., and the target v(t) last.
    lags : how many columns hold past speeds.
    """

    factor: FloatArray
    lags: int


def _triangles(stretches: Sequence[EvenStretch], history: int) -> list[_Triangle]:
    """Equations (34) and (35) of every run for the largest orders, each reduced by QR.

    The first `history` rows of a stretch get no equation, whatever the order, so that orders are
    compared on the same rows. Every run counts the same.
    """
    lags = history
    by_run: dict[int, list[FloatArray]] = {}
    for stretch in stretches:
        n = len(stretch.speed)
        columns = [stretch.speed[history - i : n - i] for i in range(1, lags + 1)]
        columns += [stretch.effort[history - j : n - j] for j in range(history + 1)]
        columns.append(stretch.speed[history:])
        by_run.setdefault(stretch.run, []).append(np.column_stack(columns))
    triangles = []
    for blocks in by_run.values():
        block = np.concatenate(blocks)
        factor = np.asarray(np.linalg.qr(block / np.sqrt(len(block)), mode="r"))
        triangles.append(_Triangle(factor, lags))
    return triangles


def least_squares(triangles: Sequence[_Triangle], order: tuple[int, int], interval_s: float) -> ArxModel:
    """Equation (37) for these runs.

    The regression is solved by orthogonal decomposition, which gives the numbers of (37) without
    squaring the condition of the regressors.
    """
    alpha, beta = order
    lags = triangles[0].lags
    kept = [*range(alpha), *range(lags, lags + beta)]
    stacked = np.concatenate([triangle.factor for triangle in triangles])
    eta, *_ = np.linalg.lstsq(stacked[:, kept], stacked[:, -1], rcond=1e-10)
    return ArxModel(eta[:alpha].copy(), eta[alpha:].copy(), interval_s)


def _held_out(
    even: EvenSignal, orders: Sequence[tuple[int, int]], history: int
) -> dict[tuple[int, int], tuple[OneStepError, FreeRunError]]:
    """Both errors of every order on runs that its model never saw."""
    runs = sorted({stretch.run for stretch in even.stretches})
    one_step = {order: np.zeros(len(runs)) for order in orders}
    free_run = {order: np.zeros(len(runs)) for order in orders}
    for fold in folds(even):
        triangles = _triangles(fold.fitted, history)
        judged = sorted({stretch.run for stretch in fold.judged})
        places = [runs.index(run) for run in judged]
        for order in orders:
            model = least_squares(triangles, order, even.interval_s)
            one_step[order][places], free_run[order][places] = _errors(model, fold.judged, history, judged)
    names = tuple(even.names[run] for run in runs)
    return {
        order: (
            one_step_error(names, one_step[order], held_out=True),
            free_run_error(names, free_run[order], even.scale_mps, held_out=True),
        )
        for order in orders
    }


def _errors(
    model: ArxModel, stretches: Sequence[EvenStretch], history: int, runs: Sequence[int]
) -> tuple[FloatArray, FloatArray]:
    """One-step and free-run RMS of each run, on the same rows."""
    ahead, free = [], []
    for stretch in stretches:
        skip = history - model.history
        effort, speed = stretch.effort[skip:], stretch.speed[skip:]
        measured = speed[model.history :]
        ahead.append(model.predict(effort, speed) - measured)
        with np.errstate(over="ignore", invalid="ignore"):
            run = model.simulate(effort, speed[: model.history]) - measured
        # An unstable model runs away; its error is as large as the format holds, not an exception.
        free.append(np.nan_to_num(np.clip(run, -1e6, 1e6), nan=1e6))
    return rms_by_run(stretches, ahead, runs), rms_by_run(stretches, free, runs)
