"""A receiver samples each bit three times: what it makes of another speed, and of a disturbed line."""

from __future__ import annotations

import pytest

BAUD = 42e6 / 46
SAMPLE_NS = 1e9 / BAUD / 16
DATA = bytes((i * 37 + 11) % 256 for i in range(200))


@pytest.fixture
def heard(board):
    """What the image hears of 200 bytes: how many, framing errors, noise flags, and the bytes."""

    def hear(off: float = 0.0, noise: tuple[int, int] = (0, 0), cr1: int = 0):
        b = board("peripherals")
        b.run_us(10_000)
        b.set_link_baud(BAUD * (1 + off))
        b.set_link_noise(*noise)
        b.link_write(DATA)
        b.run_us(5_000)
        received, _, framing, noises = b.words("get")[7:11]
        return received, framing, noises, b.read_memory(b.symbol("inbox")[0], len(DATA))

    return hear


@pytest.mark.parametrize("off", [-0.0375, -0.033, 0.033, 0.0375])
def test_three_samples_of_sixteen_bear_3_75_per_cent(heard, off):
    """RM0090 section 30.3.5, where the divider has no fraction; with one the chip bears 3.33."""
    received, framing, _, data = heard(off)
    assert (received, framing, data) == (len(DATA), 0, DATA)


@pytest.mark.parametrize("off", [-0.029, 0.029])
def test_within_3_per_cent_no_sample_meets_a_neighbouring_bit(heard, off):
    assert heard(off) == (len(DATA), 0, 0, DATA)
    assert heard(off, (1_000_003, 1))[:3] == (len(DATA), 0, 0), "sampled one by one"


@pytest.mark.parametrize("off", [-0.08, 0.045, 0.06])
def test_beyond_it_stop_bits_are_missed_and_samples_disagree(heard, off):
    received, framing, noises, data = heard(off)
    assert received == len(DATA)
    assert framing > 10
    assert noises > 10
    assert data != DATA


def test_a_pulse_that_meets_one_sample_of_three_is_outvoted_and_noted(heard):
    received, framing, noises, data = heard(noise=(7919, round(0.9 * SAMPLE_NS)))
    assert (received, framing, data) == (len(DATA), 0, DATA)
    assert noises > 10


def test_a_longer_pulse_changes_bits_loses_bytes_and_stop_bits(heard):
    received, framing, noises, _ = heard(noise=(7919, 500))
    assert len(DATA) // 2 < received < len(DATA), "start bits that were not recognised"
    assert framing > 5
    assert noises > 5
