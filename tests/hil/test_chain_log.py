"""From the flashed image to the host's disk: the log arrives byte for byte, whatever the line does."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from support.chain import Chain
from support.faulty_stream import FaultyStream
from truing.board.device import Device
from truing.board.drive import drive
from truing.errors import BoardFault, BoardRebooted, LinkClosed
from truing.link.client import Client
from truing.log.decode import decode_log
from truing.log.partial_file import PartialFile, read_identity
from truing.plan import Kind, Plan, Segment, load_plan

DEMO_PLAN = load_plan("paper/XI")
# At 200 Hz a minute of held speeds fills a log that takes a while to download.
LONG_LOG = Plan(
    "long",
    "long",
    tuple(Segment(Kind.VELOCITY, 3.0, speed, speed / 2) for speed in (0.2, 0.4, 0.3, 0.5) * 5),
    log_rate_hz=200,
)


def test_the_demos_log_is_what_lies_in_the_boards_ram(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        driven = drive(device, DEMO_PLAN)
        log = device.log(driven.log_id)
        data, report = device.read_log(log)
        assert len(data) < 1.5 * log.record_count
        assert data == chain.in_ram(log.offset, log.length)
        assert report.again_bytes == 0
        decoded = decode_log(data, log.offset, log.log_id)
        assert not decoded.lost
        assert len(decoded.records) == log.record_count == 181


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_one_spoiled_byte_in_a_hundred_changes_neither_plan_nor_log(
    image: Path, native_library: Path, seed: int
) -> None:
    with Chain(image) as chain:
        device = chain.host_on_bad_line(0.01, seed)
        driven = drive(device, DEMO_PLAN)
        log = device.log(driven.log_id)
        data, report = device.read_log(log)
        assert data == chain.in_ram(log.offset, log.length)
        assert len(decode_log(data).records) == 181
        stream = device.client.stream
        assert isinstance(stream, FaultyStream)
        assert stream.spoiled > 50
        counts = device.client.counts
        print(
            f"seed {seed}: {stream.spoiled} bytes spoiled, {counts.requests} requests, "
            f"{counts.retries} repeated; log {report.bytes} bytes: {report.requests} reads, "
            f"{report.again_bytes} bytes asked again, {report.seconds:.2f} s"
        )


def test_a_long_log_on_a_bad_line_arrives_whole(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        log = device.log(drive(device, LONG_LOG).log_id)
        bad = chain.host_on_bad_line(0.01, 11)
        data, report = bad.read_log(log)
        assert data == chain.in_ram(log.offset, log.length)
        print(
            f"1 % loss: {report.bytes} bytes in {report.seconds:.2f} s, {report.bytes_per_s / 1000:.1f} kB/s"
        )
        assert len(decode_log(data).records) == log.record_count == 12_001


def test_a_download_that_is_cut_resumes_where_it_was(
    image: Path, native_library: Path, tmp_path: Path
) -> None:
    with Chain(image) as chain:
        first = chain.host()
        log = first.log(drive(first, LONG_LOG).log_id)
        partial = tmp_path / "log.part"
        cut = chain.host_on_bad_line(0.0, 1, cut_after_bytes=log.length // 2)
        with pytest.raises(LinkClosed):
            cut.read_log(log, partial=partial)
        identity = read_identity(partial)
        assert identity is not None
        kept = PartialFile(partial, identity)
        kept.close()
        assert log.length // 3 < kept.spans.known_bytes < log.length

        again = chain.host()
        asked: list[tuple[int, int]] = []
        post = again.client.post

        def watched(request: object) -> int:
            asked.append((request.offset, request.length))  # type: ignore[attr-defined]
            return post(request)  # type: ignore[arg-type]

        again.client.post = watched  # type: ignore[assignment, method-assign]
        data, report = again.read_log(log, partial=partial)
        assert data == chain.in_ram(log.offset, log.length)
        assert report.resumed_bytes == kept.spans.known_bytes
        bytes_asked = {at for offset, length in asked for at in range(offset, offset + length)}
        assert bytes_asked == {at for start, end in kept.spans.missing for at in range(start, end)}
        assert sum(length for _, length in asked) == log.length - kept.spans.known_bytes


def test_a_clean_line_is_used_to_more_than_nine_tenths(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        log = device.log(drive(device, LONG_LOG).log_id)
        _, report = device.read_log(log)
        share = report.bytes_per_s / 92_160
        print(
            f"{report.bytes} bytes at {report.bytes_per_s / 1000:.1f} kB/s: {share:.1%} of the line's bytes"
        )
        assert share > 0.9


def test_the_whole_chain_runs_at_least_ten_times_faster_than_real_time(
    image: Path, native_library: Path
) -> None:
    """Host, line and board together, from the first greeting to the last byte of the log."""
    factors: list[float] = []
    for _ in range(3):
        began = time.process_time()  # other programs on the machine do not count
        with Chain(image) as chain:
            device = chain.host()
            device.read_log(device.log(drive(device, DEMO_PLAN).log_id))
            virtual_s = chain.robot.time_s
            factors.append(virtual_s / (time.process_time() - began))
    print(f"{virtual_s:.2f} s of virtual time, best of 3: {max(factors):.0f} times real time")
    assert max(factors) >= 10


def test_a_board_that_loses_power_during_a_download_is_named(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        log = device.log(drive(device, DEMO_PLAN).log_id)
        chain.robot.power_cycle()
        with pytest.raises(BoardRebooted, match="power_on"):
            device.read_log(log)


def test_a_reset_in_the_middle_of_a_drive_is_named_and_leaves_the_wheels_braked(
    image: Path, native_library: Path
) -> None:
    with Chain(image) as chain:
        device = chain.host()

        def reset_after_three_seconds(share: float) -> None:
            if share > 0.33 and chain.robot.stats().resets < 2:
                chain.robot.reset()

        with pytest.raises(BoardFault, match="unexpected_reset"):
            drive(device, DEMO_PLAN, progress=reset_after_three_seconds, say=lambda _: None)
        chain.robot.run_us(1_000_000)
        assert abs(chain.robot.truth().wheel_speed_radps[0]) < 0.01


def test_logs_of_several_runs_are_each_fetched_whole(image: Path, native_library: Path) -> None:
    short = Plan("short", "short", (Segment(Kind.EFFORT, 0.6, 0.3, 0.3), Segment(Kind.EFFORT, 1.4, 0.0, 0.0)))
    with Chain(image) as chain:
        device = chain.host()
        ids = [drive(device, short).log_id for _ in range(4)]
        assert ids == [1, 2, 3, 4]
        logs = device.logs()
        assert [log.log_id for log in logs] == ids
        for log in logs:
            data, _ = device.read_log(log)
            assert data == chain.in_ram(log.offset, log.length)
            assert len(decode_log(data, log.offset, log.log_id).records) == 41
        device.erase_logs()
        assert device.logs() == ()


def test_two_hosts_one_after_the_other_do_not_inherit_each_others_replies(
    image: Path, native_library: Path
) -> None:
    """Both start with the same sequence number and send the same bytes; the second must count."""
    with Chain(image) as chain:
        for _ in range(2):
            device = Device(Client(chain.stream, first_sequence=100))
            device.set_effort(0.3, 0.3)
            chain.stream.sleep(0.3)
            assert device.status().effort == pytest.approx((0.3, 0.3))
            device.stop()
            assert device.status().effort == (0.0, 0.0)
