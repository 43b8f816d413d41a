"""Half an hour of the paper's test plan stays in the board's RAM, and a full ring keeps the newest whole."""

from __future__ import annotations

from pathlib import Path

from hil_sim import UnmodelledEffects, VirtualRobot
from hil_sim.host_robot import HostRobot
from support.paper_drives import Held, drive_paper
from truing_protocol import LOG_RECORD_DTYPE

RAW_BYTES = LOG_RECORD_DTYPE.itemsize  # a record's integers, one after the other
DISTURBED = UnmodelledEffects().changed(disturbance__torque_nm=(0.01, 0.01), disturbance__correlation_s=0.2)


def say(name: str, held: Held) -> None:
    each, minutes = held.bytes_per_record, held.minutes_when_full
    print(
        f"{name}: {each['effort']:.2f} bytes a record in effort mode, {each['velocity']:.2f} in "
        f"velocity mode; {held.memory / 1024:.1f} KiB hold {minutes:.0f} min at {held.rate_hz} Hz"
    )


def test_the_papers_tests_at_20_hz_fit_for_half_an_hour_and_more(image: Path, native_library: Path) -> None:
    with VirtualRobot(image) as robot:
        held = drive_paper(robot, rounds=1)
    say("flashed image", held)
    assert held.memory > 128 * 1024
    assert held.minutes_when_full >= 30
    assert max(held.bytes_per_record.values()) < RAW_BYTES / 10


def test_they_fit_for_half_an_hour_also_where_the_wheels_are_disturbed(native_library: Path) -> None:
    """The host robot has less memory; the bytes per record are the same."""
    with HostRobot(seed=3, effects=DISTURBED) as robot:
        held = drive_paper(robot, rounds=1)
    say("disturbed host robot", held)
    assert held.minutes_when_full * 128 * 1024 / held.memory >= 30


def test_a_ring_that_came_round_holds_the_newest_logs_whole(native_library: Path) -> None:
    """At 100 Hz it comes round after a fifth of the driving that 20 Hz takes."""
    with HostRobot(seed=3, effects=DISTURBED) as robot:
        held = drive_paper(robot, rate_hz=100)
    say("host robot with a full ring", held)
    assert held.came_round
    assert held.minutes > 0.95 * held.minutes_when_full
