"""Edges at an encoder's pins: noise, slow edges, the timers' filters, captures and matches of the count."""

from __future__ import annotations

import pytest

from hil_sim import EncoderNoise

COUNTS_PER_REV = 2400
CYCLES_PER_US = 168
COUNT, EDGES, EDGE_AT, MATCHES, MATCH_AT, CAPTURED, CAPTURE_FLAG, FLAG_AFTERWARDS = range(8)


@pytest.fixture
def filtered(board):
    """Start the image with a filter, and let it settle."""

    def start(choice):
        running = board("encoder_lines")
        running.run_us(100)
        running.put("set", choice)
        running.run_us(5_000)
        return running

    return start


def step(running, counts=1):
    """Turn the disc by some counts, and let the edges arrive."""
    for _ in range(abs(counts)):
        running.turn_by_hand(0, (1 if counts > 0 else -1) / COUNTS_PER_REV)
        running.run_us(1_500)
    return running.words("get")


# RM0090 section 18.4.7: samples, and how their clock is divided; the timer runs at half the CPU's clock.
@pytest.mark.parametrize(("choice", "cycles"), [(0, 0), (3, 8 * 2), (9, 8 * 8 * 4 * 2), (15, 8 * 32 * 4 * 2)])
def test_an_edge_counts_once_it_has_held_for_the_filters_samples(filtered, choice, cycles):
    running = filtered(choice)
    seen = step(running)  # the first edge forward is phase A's
    assert seen[COUNT] == 101
    assert (seen[EDGES], seen[MATCHES]) == (1, 1)
    # Both interrupts of equal priority take 12 cycles to enter; without a filter they follow each other.
    assert seen[MATCH_AT] - seen[EDGE_AT] == pytest.approx(cycles, abs=60)


@pytest.mark.parametrize(("pulse_ns", "passes"), [(500, False), (3_000, False), (3_100, True), (8_000, True)])
def test_a_pulse_counts_to_and_fro_only_when_it_outlasts_the_filter(filtered, pulse_ns, passes):
    running = filtered(9)
    running.set_encoder_noise(0, EncoderNoise(1_000, 6_000, 60, pulse_ns))
    running.run_us(20_500)
    seen = running.words("get")
    assert seen[EDGES] > 50
    assert (seen[MATCHES] > 20) == passes
    assert seen[COUNT] == 100
    running.set_encoder_noise(0, EncoderNoise())
    assert step(running, -3)[COUNT] == 97


def test_a_slow_edge_wavers_at_the_pin_and_counts_once_when_it_is_through(filtered):
    running = filtered(9)
    running.set_encoder_noise(0, EncoderNoise(rise_ns=20_000, bounce_ns=700))
    seen = step(running)
    assert seen[EDGES] > 10
    assert (seen[MATCHES], seen[COUNT]) == (1, 101)
    assert seen[MATCH_AT] - seen[EDGE_AT] == pytest.approx(8 * 8 * 4 * 2, abs=60)
    assert step(running, -1)[MATCHES] == 2


def test_a_rising_edge_of_phase_a_captures_the_count_and_its_reading_clears_the_flag(filtered):
    running = filtered(9)
    seen = step(running)
    assert (seen[CAPTURE_FLAG], seen[CAPTURED], seen[FLAG_AFTERWARDS]) == (1, 101, 0)
    assert step(running, 3)[CAPTURED] == 101  # B rises, A falls, B falls
    assert step(running)[CAPTURED] == 105


def test_cutting_time_differently_changes_no_edge(board):
    hashes = []
    for slices_us in (20_000, 7):
        running = board("encoder_lines")
        running.run_us(100)
        running.put("set", 9)
        running.set_encoder_noise(0, EncoderNoise(1_000, 6_000, 60, 900, 5_000, 600))
        while running.time_us < 60_000:
            running.run_us(min(slices_us, 60_000 - running.time_us))
        hashes.append((running.words("get"), running.trace_hash()))
    assert hashes[0] == hashes[1]
