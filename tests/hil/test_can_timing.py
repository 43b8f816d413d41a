"""The flashed image on a bus whose other node divides its bits otherwise, has another clock, or is far."""

from __future__ import annotations

from pathlib import Path

import pytest

import truing_protocol as tp
from hil_sim import CanFrame
from hil_sim.can_bus import CanTotals
from support.can_chain import CanChain

CALLS = 5
USUAL, WIDE_JUMP = (14, 2, 1), (12, 4, 4)  # quanta up to the sample point, after it, jump width


def called(chain: CanChain) -> tuple[int, CanTotals]:
    """Call the board a few times: how often it answered, and what the bus has seen."""
    chain.bus.run_us(100_000)
    for _ in range(CALLS):
        chain.bus.write(CanFrame(0x600, bytes((tp.HelloRequest.ID,))))
        chain.bus.run_us(100_000)
    answers = [frame.id for frame in iter(chain.bus.read, None)].count(tp.CanAnnounce.BASE + 1)
    return answers, chain.bus.totals()


@pytest.mark.parametrize(
    ("timing", "off"),
    [(USUAL, 0.006), (USUAL, -0.006), (WIDE_JUMP, 0.014), (WIDE_JUMP, -0.014)],
)
def test_a_clock_that_is_off_within_the_jump_width_is_followed(
    image: Path, native_library: Path, timing: tuple[int, int, int], off: float
) -> None:
    """Over the ten bits between two edges at most: a sixteenth over ten, and a fifth (4 of 21) over ten."""
    with CanChain(image) as chain:
        chain.bus.set_bit_rate(1e6 * (1 + off))
        chain.bus.set_bit_timing(*timing)
        answers, totals = called(chain)
        assert (answers, totals.damaged, totals.unacknowledged) == (CALLS, 0, 0)


def test_a_clock_that_is_off_by_more_destroys_frames(image: Path, native_library: Path) -> None:
    with CanChain(image) as chain:
        chain.bus.set_bit_rate(0.99e6)
        chain.bus.set_bit_timing(*USUAL)
        answers, totals = called(chain)
        assert answers < CALLS
        assert totals.damaged > 10
        state = chain.serial_host(chain.robots[0]).client.request(tp.CanStateRequest())
        assert state.bus_state != tp.CanBusState.ACTIVE
        chain.bus.set_bit_timing(*WIDE_JUMP)
        chain.bus.run_us(100_000)
        before = chain.bus.totals()
        _, after = called(chain)
        assert after.frames > before.frames + CALLS
        assert after.damaged == before.damaged, "the same clock with a wider jump"


@pytest.mark.parametrize(("before", "hears"), [(5, False), (6, True), (14, True)])
def test_a_sample_point_ahead_of_the_echo_sees_no_acknowledgment(
    image: Path, native_library: Path, before: int, hears: bool
) -> None:
    """Sixteenths of a microsecond against the 300 ns there and back, and the board's quantum of 48."""
    with CanChain(image) as chain:
        chain.bus.set_bit_timing(before, 16 - before, 1)
        answers, totals = called(chain)
        assert (answers == CALLS) == hears
        assert (totals.unacknowledged == 0) == hears
        assert totals.damaged == 0


@pytest.mark.parametrize(
    ("bit_rate", "metres", "hears"), [(1e6, 40, True), (1e6, 80, False), (500e3, 80, True)]
)
def test_how_long_a_cable_a_bit_rate_allows(
    image: Path, native_library: Path, bit_rate: float, metres: int, hears: bool
) -> None:
    with CanChain(image, bit_rate=round(bit_rate)) as chain:
        chain.bus.set_delay_ns(150 + 5 * metres)
        answers, totals = called(chain)
        assert (answers == CALLS) == hears
        assert (totals.unacknowledged == 0) == hears
