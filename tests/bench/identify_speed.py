"""How long a wheel's fit takes and how well it simulates, beside scipy alone, sysidentpy and pysindy.

All of them get the same runs in memory, fit one model of each wheel to all of them, and are judged by
the same free-run error (equal weight per run, per cent of the 98th percentile of |speed|). The peers
are set up as their own tutorials do it; their candidate terms include products of speed and effort.
"""

from __future__ import annotations

import importlib.util
import os
import time
import warnings
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bench.figure import Figure
from support.synthetic_wheel import Truth, baseline, record, staircase
from truing.identify.grey_box import SharedFits, fit_structure
from truing.identify.model_ladder import fit_models
from truing.identify.signals import WheelSignal, wheel_signal
from truing.identify.structures import DELAY
from truing.recording.reader import read_recording_set
from truing.recording.run import WHEELS, RecordingSet

Array = NDArray[np.float64]
Fit = Callable[[WheelSignal], list[Array]]

FRC_SET = "real/frc_frc2881_2022__sysid_data20220227-150426"
SINDY_THRESHOLD = 0.02


def measure(root: Path) -> list[Figure]:
    """Twelve runs of 15 s at 20 Hz, and where it is at hand an FRC file at 5 ms."""
    truth = Truth(delay=0.043, disturbance=0.008)
    runs = tuple(record(truth, staircase(k), seed=k, name=f"{k:02d}", fine_s=1e-3) for k in range(12))
    figures = _compare("12 runs x 15 s at 20 Hz", RecordingSet("synthetic", runs, baseline()), 2.0)
    short = tuple(
        record(truth, staircase(k, 7.0), seed=k, name=f"{k:02d}", rate_hz=200.0, duration_s=7.0, fine_s=1e-3)
        for k in range(14)
    )
    began = time.perf_counter()
    fit_models(RecordingSet("more", short, baseline()), richer=True)
    seconds = time.perf_counter() - began
    figures.append(Figure("14 runs x 7 s at 200 Hz: fit --more", seconds, "s", "less", 30.0))
    named = os.environ.get("TRUING_RECORDINGS")
    folder = (Path(named) if named else root.parent / "shared" / "recordings") / FRC_SET
    if folder.is_dir():
        figures += _compare("FRC file at 5 ms", read_recording_set(folder), 5.0)
    return figures


def _compare(name: str, recordings: RecordingSet, bar_s: float) -> list[Figure]:
    signals = [wheel_signal(recordings.runs, wheel, recordings.baseline) for wheel in WHEELS]
    fit_models(recordings)  # compiled code comes from its cache once; a user's second command finds it
    began = time.perf_counter()
    models = fit_models(recordings)
    seconds = time.perf_counter() - began
    steps = [next(step for step in wheel.steps if step.structure.name == "delay") for wheel in models.wheels]
    error = float(np.mean([step.free_run.percent for step in steps]))
    figures = [Figure(f"{name}: every model, both wheels, runs left out", seconds, "s", "less", bar_s)]
    began = time.perf_counter()
    for signal in signals:
        fit_structure(SharedFits(signal), DELAY)
    seconds = time.perf_counter() - began
    peers: dict[str, Fit] = {"scipy alone": _scipy}
    if importlib.util.find_spec("sysidentpy"):
        peers["sysidentpy"] = _sysidentpy
    if importlib.util.find_spec("pysindy"):
        peers["pysindy"] = _pysindy
    for peer, fit in peers.items():
        began = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            predicted = [fit(signal) for signal in signals]
        span = time.perf_counter() - began
        peer_error = float(np.mean([_percent(s, p) for s, p in zip(signals, predicted, strict=True)]))
        figures.append(Figure(f"{name}: one model a wheel", seconds, "s", "less", None, peer, span))
        figures.append(Figure(f"{name}: free-run error", error, "%", "less", None, peer, peer_error))
    return figures


def _segments(signal: WheelSignal) -> list[tuple[Array, Array, Array]]:
    """Time (s), effort and speed (m/s) of every segment."""
    t, u, v = signal.excitation.t_s, signal.excitation.effort, signal.speed_mps
    return [(t[a:b], u[a:b], v[a:b]) for a, b in pairwise(signal.excitation.starts)]


def _percent(signal: WheelSignal, predicted: Sequence[Array]) -> float:
    residual = np.concatenate(predicted) - signal.speed_mps
    residual = np.clip(np.nan_to_num(residual, nan=1e3), -1e3, 1e3)
    by_run = signal.rms_by_run(residual)
    return float(100.0 * np.sqrt(np.mean(by_run**2)) / signal.scale_mps)


def _scipy(signal: WheelSignal) -> list[Array]:
    """Gain, time constant, friction and delay by `least_squares` over a loop in Python."""
    segments = _segments(signal)

    def simulate(theta: Array, t: Array, u: Array, v: Array) -> Array:
        gain, tau, friction, delay = theta
        late = np.interp(t - delay, t, u)
        out = np.empty_like(v)
        out[0] = x = v[0]
        decay = np.exp(-np.diff(t) / tau)
        for k in range(1, len(t)):
            # A soft threshold: friction takes what it can of the free step.
            free = decay[k - 1] * x + (1.0 - decay[k - 1]) * gain * late[k]
            hold = (1.0 - decay[k - 1]) * gain * friction
            x = free - hold if free > hold else free + hold if free < -hold else 0.0
            out[k] = x
        return out

    weights = signal.weights()

    def residual(theta: Array) -> Array:
        return weights * (np.concatenate([simulate(theta, *s) for s in segments]) - signal.speed_mps)

    gain = np.percentile(np.abs(signal.speed_mps), 98) / np.percentile(np.abs(signal.excitation.effort), 98)
    starts = [np.array([gain, tau, 0.03, 0.05]) for tau in (0.05, 0.3)]
    bounds = ([0.0, 1e-3, 0.0, 0.0], [100.0, 5.0, 0.5, 0.5])
    scale = [gain, 0.1, 0.05, 0.05]
    ends = [least_squares(residual, start, bounds=bounds, x_scale=scale) for start in starts]
    best = min(ends, key=lambda end: end.cost)
    return [simulate(best.x, *s) for s in segments]


def _sysidentpy(signal: WheelSignal) -> list[Array]:
    """NARX of degree 2 by FROLS, terms chosen by Akaike's criterion."""
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    segments = _segments(signal)
    model = FROLS(
        order_selection=True,
        n_info_values=15,
        ylag=2,
        xlag=4,
        info_criteria="aic",
        estimator=LeastSquares(),
        basis_function=Polynomial(degree=2),
    )
    # FROLS takes one record: the runs are laid end to end, as its users do.
    model.fit(
        X=np.concatenate([u for _, u, _ in segments])[:, None],
        y=np.concatenate([v for _, _, v in segments])[:, None],
    )
    predicted = []
    for _, u, v in segments:
        head = model.max_lag
        run = model.predict(X=u[:, None], y=v[:head, None])
        predicted.append(np.ravel(run))
    return predicted


def _pysindy(signal: WheelSignal) -> list[Array]:
    """Sparse regression of acceleration on powers of speed and effort, simulated from the first speed."""
    import pysindy

    segments = _segments(signal)
    model = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=SINDY_THRESHOLD),
        feature_library=pysindy.PolynomialLibrary(degree=2),
    )
    model.fit(
        [v[:, None] for _, _, v in segments],
        t=[t for t, _, _ in segments],
        u=[u[:, None] for _, u, _ in segments],
    )
    # Its own integrator takes minutes here (a library call per derivative); the equation that it found
    # is integrated directly instead, efforts held over their intervals.
    one, x, w, xx, xw, ww = (float(c) for c in np.ravel(model.coefficients()))

    def slope(speed: float, effort: float) -> float:
        linear = one + x * speed + w * effort
        return linear + xx * speed * speed + xw * speed * effort + ww * effort * effort

    predicted = []
    for t, u, v in segments:
        run = np.empty_like(v)
        run[0] = now = float(v[0])
        for k in range(1, len(t)):
            h = float(t[k] - t[k - 1]) / 4.0
            for _ in range(4):
                middle = now + 0.5 * h * slope(now, u[k])
                now = float(np.clip(now + h * slope(middle, u[k]), -1e3, 1e3))
            run[k] = now
        predicted.append(run)
    return predicted
