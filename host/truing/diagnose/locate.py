"""Localisation of a mismatch in time, from the signature of an effect or a smoothed residual."""

from __future__ import annotations

import numpy as np

from truing.arrays import FloatArray, IntArray
from truing.diagnose.data.set_data import SetData
from truing.diagnose.result import MismatchSpan

# The stretches listed hold this share of the mismatch's energy.
COVERED = 0.9
# Stretches of one signal closer together than this are merged, s.
MERGED_S = 0.15
MAX_SPANS = 200
SPEED_SIGNALS = ("vel_left_mps", "vel_right_mps")


def wheel_spans(
    data: SetData, shape: FloatArray, noise_rms: FloatArray, min_times_noise: float, covered: float = COVERED
) -> list[MismatchSpan]:
    """Stretches that hold the energy of a mismatch of the wheels' speeds.

    Parameters
    ----------
    shape : shape (n, 2), m/s, the mismatch without its noise.
    noise_rms : shape (2,), m/s.
    min_times_noise : a wheel whose mismatch is below this many times its noise is left out.
    covered : share of the energy that the stretches hold.
    """
    energy = shape**2
    total = float(energy.sum())
    spans: list[MismatchSpan] = []
    for wheel in range(2):
        if np.sqrt(float(energy[:, wheel].mean())) < min_times_noise * noise_rms[wheel] or total <= 0.0:
            continue
        for a, b in _stretches(data, energy[:, wheel], covered):
            part = float(energy[a:b, wheel].sum())
            spans.append(
                MismatchSpan(
                    run=data.names[int(data.run_of_row[a])],
                    signal=SPEED_SIGNALS[wheel],
                    t_start_s=float(data.t_s[a] - data.dt_s[a])
                    if a not in data.starts
                    else float(data.t_s[a]),
                    t_end_s=float(data.t_s[b - 1]),
                    share=part / total,
                    regime=regime(data, a, b, wheel),
                    times_noise=float(np.sqrt(energy[a:b, wheel].mean()) / noise_rms[wheel]),
                )
            )
    spans.sort(key=lambda span: -span.share)
    return spans[:MAX_SPANS]


def _stretches(data: SetData, energy: FloatArray, covered: float) -> list[tuple[int, int]]:
    """The smallest set of rows that holds so much of the energy, as stretches within segments."""
    order = np.argsort(energy)[::-1]
    summed = np.cumsum(energy[order])
    count = int(np.searchsorted(summed, covered * summed[-1])) + 1
    chosen = np.zeros(len(energy), dtype=bool)
    chosen[order[:count]] = True
    segment = np.repeat(np.arange(len(data.starts) - 1), np.diff(data.starts))
    rows: IntArray = np.flatnonzero(chosen)
    gap = max(1, round(MERGED_S / float(np.median(data.interval_s))))
    cut = np.flatnonzero((np.diff(rows) > gap) | (np.diff(segment[rows]) > 0)) + 1
    return [(int(part[0]), int(part[-1]) + 1) for part in np.split(rows, cut)]


def regime(data: SetData, a: int, b: int, wheel: int) -> str:
    """Operating regime in rows a..b, in words."""
    v, u = data.speed_mps[a:b, wheel], data.effort[a:b, wheel]
    top = data.top_mps
    before = data.effort[max(a - max(2, round(0.3 / float(np.median(data.interval_s)))), 0) : b, wheel]
    words = []
    if np.median(np.abs(v)) < 0.08 * top:
        words.append("near standstill")
    elif np.median(np.abs(v)) > 0.6 * top:
        words.append("at high speed")
    else:
        words.append("at middle speed")
    if before.min() < -0.02 and before.max() > 0.02:
        words.append("after a reversal")
    elif np.ptp(before) > 0.1:
        words.append("after a step of effort")
    elif np.all(np.abs(u) < 1e-3):
        words.append("with no effort")
    elif np.ptp(u) < 0.02:
        words.append("under steady effort")
    turn = data.speed_mps[a:b, 1] - data.speed_mps[a:b, 0]
    if np.median(np.abs(turn)) > 0.2 * top:
        words.append("while turning")
    return " ".join(words)
