"""How well our ARX and state space simulate, beside statsmodels, SIPPY, nfoursid and SLICOT on the same runs.

Everybody fits the orders that ours chose, to the same evenly spaced rows, and is judged by the same code:
free-run error, equal weight per run, per cent of the 98th percentile of |speed|, on the runs that were
fitted and on runs left out. The peers but least squares take one record only: their runs are laid end
to end, as their users do. Peers that are not installed are left out.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import io
import os
import time
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.figure import Figure
from support.synthetic_wheel import Truth, baseline, record, staircase
from truing.identify.arx import fit_arx_signal
from truing.identify.even import EvenSignal, EvenStretch, even_signal
from truing.identify.held_out import MAXIMUM_FOLDS as ARX_FOLDS
from truing.identify.held_out import folds, rms_by_run
from truing.identify.signals import WheelSignal, wheel_signal
from truing.identify.state_space import BLOCK_ROWS, MAXIMUM_FOLDS, START_ROWS, fit_state_space_signal
from truing.model.linear import ArxModel, StateSpaceModel
from truing.recording.reader import read_recording_set
from truing.recording.run import WHEELS, RecordingSet

Array = NDArray[np.float64]
Stretches = Sequence[EvenStretch]
FitArx = Callable[..., ArxModel]
FitStates = Callable[..., StateSpaceModel]
Judge = Callable[[Any, EvenStretch], Array]

FRC_SET = "real/frc_frc2881_2022__sysid_data20220227-150426"
# Rows at the start of a stretch that judge no ARX model: as many as the longest of ours looks back.
HISTORY = 7
# Block rows of the peers: of 10 and 25 those with which more of them simulate left-out runs better. At
# 5 ms ten rows are shorter than the time constant, and no search follows their estimates (SLICOT: 136 %).
ROWS_AT_20_HZ = 10
ROWS_AT_5_MS = 25
# nfoursid decomposes a matrix with as many columns as there are rows of data in full: no 5 ms file.
NFOURSID_ROWS = 4000


def measure(root: Path) -> list[Figure]:
    """Twelve synthetic runs of 15 s at 20 Hz, and where it is at hand an FRC file at 5 ms."""
    truth = Truth(delay=0.043, disturbance=0.008)
    runs = tuple(record(truth, staircase(k), seed=k, name=f"{k:02d}", fine_s=1e-3) for k in range(12))
    figures = compare("12 runs at 20 Hz", RecordingSet("synthetic", runs, baseline()), ROWS_AT_20_HZ)
    named = os.environ.get("TRUING_RECORDINGS")
    folder = (Path(named) if named else root.parent / "shared" / "recordings") / FRC_SET
    if folder.is_dir():
        figures += compare("FRC file at 5 ms", read_recording_set(folder), ROWS_AT_5_MS)
    return figures


def compare(name: str, recordings: RecordingSet, block_rows: int) -> list[Figure]:
    """Both kinds of model of both wheels of one set, each beside its peers."""
    signals = [wheel_signal(recordings.runs, wheel, recordings.baseline) for wheel in WHEELS]
    return _compare_arx(name, signals) + _compare_states(name, signals, block_rows)


def _compare_arx(name: str, signals: Sequence[WheelSignal]) -> list[Figure]:
    peers: dict[str, FitArx] = {}
    if _is_here("statsmodels.api"):
        peers |= {"statsmodels WLS": _statsmodels, "statsmodels AutoReg": _autoreg}
    if _is_here("sippy_unipi.arxMIMO"):
        peers["SIPPY ARX"] = _sippy_arx
    chosen = [fit_arx_signal(s, side) for s, side in zip(signals, WHEELS, strict=True)]
    sizes = [(len(fit.model.m), len(fit.model.n)) for fit in chosen]
    began = time.perf_counter()
    for s, side, (alpha, beta) in zip(signals, WHEELS, sizes, strict=True):
        fit_arx_signal(s, side, alpha=alpha, beta=beta)
    seconds = time.perf_counter() - began
    evens = [even_signal(s, 2 * HISTORY + 4) for s in signals]
    fitted = _mean([fit.free_run.percent for fit in chosen])
    left_out = _mean([fit.held_out_free_run.percent for fit in chosen])
    figures = []
    for peer, fit_peer in peers.items():
        theirs = []
        for even, size in zip(evens, sizes, strict=True):
            fit_size = partial(fit_peer, order=size, interval_s=even.interval_s)
            theirs.append(_peer(even, fit_size, _judge_arx, ARX_FOLDS))
        figures += _figures(f"{name}, ARX", peer, (fitted, left_out, seconds), theirs)
    return figures


def _compare_states(name: str, signals: Sequence[WheelSignal], block_rows: int) -> list[Figure]:
    peers: dict[str, FitStates] = {}
    if _is_here("sippy_unipi.OLSims_methods"):
        for method in ("N4SID", "MOESP", "CVA"):
            peers[f"SIPPY {method}"] = partial(_sippy_states, method=method)
    if _is_here("nfoursid.nfoursid"):
        peers["nfoursid"] = _nfoursid
    if _is_here("ctrlsys"):
        peers["SLICOT (ctrlsys)"] = _slicot
    warm = [fit_state_space_signal(s, side) for s, side in zip(signals, WHEELS, strict=True)]
    began = time.perf_counter()
    ours = [
        fit_state_space_signal(s, side, order=fit.model.order)
        for s, side, fit in zip(signals, WHEELS, warm, strict=True)
    ]
    seconds = time.perf_counter() - began
    evens = [even_signal(s, 3 * BLOCK_ROWS) for s in signals]
    fitted = _mean([fit.free_run.percent for fit in ours])
    left_out = _mean([fit.held_out_free_run.percent for fit in ours])
    figures = []
    for peer, fit_peer in peers.items():
        if peer == "nfoursid" and sum(len(s.speed) for s in evens[0].stretches) > NFOURSID_ROWS:
            continue
        theirs = []
        for even, own in zip(evens, ours, strict=True):
            fit_order = partial(fit_peer, order=own.model.order, interval_s=even.interval_s, rows=block_rows)
            theirs.append(_peer(even, fit_order, _judge_states, MAXIMUM_FOLDS))
        figures += _figures(f"{name}, state space", peer, (fitted, left_out, seconds), theirs)
    return figures


def _is_here(module: str) -> bool:
    """Whether a peer is installed; its import is done with before the clock runs."""
    if importlib.util.find_spec(module.partition(".")[0]) is None:
        return False
    importlib.import_module(module)
    return True


def _peer(
    even: EvenSignal, fit: Callable[[Stretches], Any], judge: Judge, max_folds: int
) -> tuple[float, float, float]:
    """Error on the fitted runs and on left-out ones, per cent, and the time of all those fits, s."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        began = time.perf_counter()
        whole = fit(even.stretches)
        divided = [(fit(fold.fitted), fold.judged) for fold in folds(even, max_folds)]
        seconds = time.perf_counter() - began
    fitted = _percent(even, even.stretches, [(whole, even.stretches)], judge)
    return fitted, _percent(even, even.stretches, divided, judge), seconds


def _percent(
    even: EvenSignal, stretches: Stretches, divided: Sequence[tuple[Any, Stretches]], judge: Judge
) -> float:
    runs = sorted({stretch.run for stretch in stretches})
    squares = np.zeros(len(runs))
    for model, judged in divided:
        own = sorted({stretch.run for stretch in judged})
        with np.errstate(all="ignore"):
            residuals = [np.clip(np.nan_to_num(judge(model, s), nan=1e3), -1e3, 1e3) for s in judged]
        squares[[runs.index(run) for run in own]] = rms_by_run(judged, residuals, own) ** 2
    return float(100.0 * np.sqrt(np.mean(squares)) / even.scale_mps)


def _figures(
    name: str, peer: str, ours: tuple[float, float, float], theirs: Sequence[tuple[float, float, float]]
) -> list[Figure]:
    labels = (("free-run error", "%"), ("free-run error, runs left out", "%"), ("all these fits", "s"))
    values = [_mean([wheel[k] for wheel in theirs]) for k in (0, 1)] + [sum(wheel[2] for wheel in theirs)]
    return [
        Figure(f"{name}: {label}", own, unit, "less", None, peer, value)
        for (label, unit), own, value in zip(labels, ours, values, strict=True)
    ]


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values))


def _judge_arx(model: ArxModel, stretch: EvenStretch) -> Array:
    skip = HISTORY - model.history
    effort, speed = stretch.effort[skip:], stretch.speed[skip:]
    return model.simulate(effort, speed[: model.history]) - speed[model.history :]


def _judge_states(model: StateSpaceModel, stretch: EvenStretch) -> Array:
    start = model.start(stretch.effort, stretch.speed, START_ROWS)
    return (model.simulate(stretch.effort, start) - stretch.speed)[START_ROWS:]


def _end_to_end(stretches: Stretches) -> tuple[Array, Array]:
    """Effort and speed of all stretches as one record, the effort one row ahead (see `ArxModel`)."""
    effort = np.concatenate([s.effort for s in stretches])
    return np.append(effort[1:], effort[-1]), np.concatenate([s.speed for s in stretches])


def _statsmodels(stretches: Stretches, order: tuple[int, int], interval_s: float) -> ArxModel:
    """The regression set up by hand, each run with the same weight; statsmodels solves it."""
    from statsmodels.regression.linear_model import WLS

    alpha, beta = order
    rows: dict[int, int] = {}
    for s in stretches:
        rows[s.run] = rows.get(s.run, 0) + len(s.speed) - HISTORY
    blocks, targets, weights = [], [], []
    for s in stretches:
        n = len(s.speed)
        columns = [s.speed[HISTORY - i : n - i] for i in range(1, alpha + 1)]
        columns += [s.effort[HISTORY - j : n - j] for j in range(beta)]
        blocks.append(np.column_stack(columns))
        targets.append(s.speed[HISTORY:])
        weights.append(np.full(n - HISTORY, 1.0 / rows[s.run]))
    fit = WLS(np.concatenate(targets), np.concatenate(blocks), weights=np.concatenate(weights)).fit()
    eta = np.asarray(fit.params, dtype=np.float64)
    return ArxModel(eta[:alpha], eta[alpha:], interval_s)


def _autoreg(stretches: Stretches, order: tuple[int, int], interval_s: float) -> ArxModel:
    """Its time-series class: one record, the lags of the effort as exogenous columns."""
    from statsmodels.tsa.ar_model import AutoReg

    alpha, beta = order
    effort = np.concatenate([s.effort for s in stretches])
    speed = np.concatenate([s.speed for s in stretches])
    lagged = np.column_stack([np.concatenate((np.zeros(j), effort[: len(effort) - j])) for j in range(beta)])
    fit = AutoReg(speed, lags=alpha, trend="n", exog=lagged, hold_back=HISTORY).fit()
    eta = np.asarray(fit.params, dtype=np.float64)
    return ArxModel(eta[:alpha], eta[alpha:], interval_s)


def _sippy_arx(stretches: Stretches, order: tuple[int, int], interval_s: float) -> ArxModel:
    from sippy_unipi import system_identification

    effort, speed = _end_to_end(stretches)
    fit = system_identification(speed, effort, "ARX", ARX_orders=[*order, 0], tsample=interval_s)
    denominator = np.ravel(fit.DENOMINATOR[0][0] if np.ndim(fit.DENOMINATOR) > 2 else fit.DENOMINATOR[0])
    numerator = np.ravel(fit.NUMERATOR[0][0] if np.ndim(fit.NUMERATOR) > 2 else fit.NUMERATOR[0])
    alpha, beta = order
    return ArxModel(-denominator[1 : alpha + 1], numerator[:beta].copy(), interval_s)


def _sippy_states(
    stretches: Stretches, order: int, interval_s: float, rows: int, method: str
) -> StateSpaceModel:
    from sippy_unipi import system_identification

    effort, speed = _end_to_end(stretches)
    fit = system_identification(
        speed,
        effort,
        method,
        SS_f=rows,
        SS_fixed_order=order,
        SS_A_stability=True,
        tsample=interval_s,
    )
    return _model(fit.A, fit.B, fit.C, interval_s)


def _nfoursid(stretches: Stretches, order: int, interval_s: float, rows: int) -> StateSpaceModel:
    """It always estimates D: the effort is given unshifted, and D becomes a state that holds it."""
    import pandas
    from nfoursid.nfoursid import NFourSID

    frame = pandas.DataFrame(
        {
            "effort": np.concatenate([s.effort for s in stretches]),
            "speed": np.concatenate([s.speed for s in stretches]),
        }
    )
    search = NFourSID(frame, ["speed"], ["effort"], num_block_rows=rows)
    search.subspace_identification()
    fit, _ = search.system_identification(rank=order)
    a = np.zeros((order + 1, order + 1))
    a[:order, :order], a[:order, order] = fit.a, fit.b[:, 0]
    b = np.append(np.zeros(order), 1.0)
    return _model(a, b, np.append(fit.c, fit.d), interval_s)


def _slicot(stretches: Stretches, order: int, interval_s: float, rows: int) -> StateSpaceModel:
    """IB01AD and IB01BD (MOESP) for A and C, IB01CD for B."""
    import ctrlsys

    effort, speed = _end_to_end(stretches)
    u, y = np.asfortranarray(effort[:, None]), np.asfortranarray(speed[:, None])
    _, r, *_ = ctrlsys.ib01ad("M", "Q", "N", "O", "N", "N", rows, 1, 1, u, y, 0.0, -1.0)
    a, c, *_ = ctrlsys.ib01bd("M", "C", "N", rows, order, 1, 1, len(y), r, 0.0)
    a, c = np.asfortranarray(a), np.asfortranarray(c)
    b, d = np.zeros((order, 1), order="F"), np.zeros((1, 1), order="F")
    _, b, *_ = ctrlsys.ib01cd("X", "C", "B", order, 1, 1, a, b, c, d, u, y, 0.0)
    return _model(a, b, c, interval_s)


def _model(a: Any, b: Any, c: Any, interval_s: float) -> StateSpaceModel:
    a = np.ascontiguousarray(a, dtype=np.float64)
    b, c = (np.array(np.ravel(v), dtype=np.float64) for v in (b, c))
    return StateSpaceModel(a, b, c, np.zeros(len(b)), interval_s)
