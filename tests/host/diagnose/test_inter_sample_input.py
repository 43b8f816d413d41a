"""Inter-sample input reconstruction: the effort between two rows is held or smooth, by the speeds."""

from __future__ import annotations

import numpy as np
import pytest

from support.simulated_runs import GAIN, RATE, RICH, TAU, levels, recordings
from truing.diagnose import inter_sample_input
from truing.diagnose.data.set_data import SetData
from truing.diagnose.inter_sample_input import inter_sample_uncertainty, with_inter_sample_input

FAST_HZ = 2.0


def sine(t: np.ndarray) -> np.ndarray:
    """A quick sine of effort, shape (n, 2)."""
    return 0.5 * np.sin(2.0 * np.pi * FAST_HZ * t)[:, None] * np.ones((1, 2))


def driven(smooth: bool) -> SetData:
    """Two wheels driven by the sine, or by its row means; speeds and efforts as means over each row."""
    rows, parts = 200, 100
    dt = 1.0 / RATE / parts
    t = np.arange(rows * parts) * dt + 0.5 * dt
    inside = sine(t)
    effort = inside.reshape(rows, parts, 2).mean(axis=1)
    if not smooth:
        inside = np.repeat(effort, parts, axis=0)
    v = np.zeros((len(t), 2))
    for k in range(1, len(t)):
        v[k] = v[k - 1] + dt / TAU * (GAIN * inside[k] - v[k - 1])
    speed = v.reshape(rows, parts, 2).mean(axis=1)
    still = np.zeros((1, 2))
    return recordings((np.concatenate((still, effort)),), (np.concatenate((still, speed)),))


@pytest.mark.parametrize("smooth", [True, False])
def test_the_speeds_select_whether_a_quick_effort_was_held(smooth: bool) -> None:
    data = driven(smooth)
    chosen = with_inter_sample_input(data)
    assert (len(chosen.pieces[0].end_s) > len(data.pieces[0].end_s)) == smooth


def test_a_smooth_input_keeps_the_mean_of_every_row() -> None:
    data = driven(True)
    for wheel, pieces in enumerate(inter_sample_input.recut(data, inter_sample_input.smooth).pieces):
        width = np.diff(pieces.end_s, prepend=-1.0 / RATE)
        row = np.minimum(np.searchsorted(data.t_s, pieces.end_s - 1e-9), len(data) - 1)
        mean = np.bincount(row, pieces.effort * width) / np.bincount(row, width)
        np.testing.assert_allclose(mean, data.effort[:, wheel], atol=1e-9)


def test_steps_are_left_as_they_are() -> None:
    data = recordings(RICH)
    assert with_inter_sample_input(data) is data
    assert not inter_sample_uncertainty(data).any()


def test_the_uncertainty_is_where_the_reconstructions_differ() -> None:
    effort = np.concatenate((levels((0.5, 0.5), seconds=3.0), driven(True).effort[1:]))
    uncertainty = inter_sample_uncertainty(recordings((effort,)))
    assert uncertainty[:60].max() < 1e-9
    assert uncertainty[80:].max() > 1e-3
