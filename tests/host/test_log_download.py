"""Downloads: exact on any line, resumed where they were cut, and nothing asked for twice without need."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.fake_board import FakeBoard, FakeLine
from support.fake_log import board_with_log
from support.faulty_stream import FaultyStream
from truing.board.device import Device
from truing.board.run_saver import fetch_log, other_boots
from truing.errors import BoardRebooted, Interrupted, LinkClosed, LinkTimeout, LogError, Refused
from truing.link.client import Client
from truing.log.partial_file import LogIdentity, PartialFile, Spans, read_identity


def device_on(board: FakeBoard, **faults: float | int) -> Device:
    return Device(Client(FaultyStream(FakeLine(board), **faults)))  # type: ignore[arg-type]


def test_a_clean_line_carries_each_byte_once_and_stays_busy() -> None:
    board = board_with_log(4000)
    device = device_on(board)
    data, report = device.read_log(device.log())
    assert data == board.logs[0].data
    assert report.again_bytes == 0
    assert report.asked_bytes == len(data)
    share = report.bytes_per_s / 92_160
    print(f"{report.bytes_per_s / 1000:.1f} kB/s, {share:.1%} of the line")
    assert share > 0.93


@pytest.mark.parametrize("seed", range(5))
def test_one_spoiled_byte_in_a_hundred_changes_nothing_but_the_time(seed: int) -> None:
    board = board_with_log(800)
    device = device_on(board, share=0.01, seed=seed)
    data, report = device.read_log(device.log())
    assert data == board.logs[0].data
    assert report.again_bytes > 0
    print(
        f"{report.bytes} bytes, {report.requests} reads, {report.again_bytes} again, {report.seconds:.2f} s"
    )
    assert report.asked_bytes < 4 * report.bytes


@pytest.mark.parametrize("latency_s", [0.1, 0.5])
def test_a_line_that_is_slower_than_thought_is_waited_for(latency_s: float) -> None:
    """Answers that come after they were given up count, and say how long to wait for the next."""
    board = board_with_log(2000)
    device = Device(Client(FakeLine(board, latency_s)))
    data, report = device.read_log(device.log())
    assert data == board.logs[0].data
    print(f"{latency_s} s: {report.again_bytes} of {report.bytes} bytes again, {report.seconds:.1f} s")
    assert report.again_bytes < report.bytes / 2
    assert device.client.frames_dropped == 0


def test_a_download_that_was_cut_resumes_and_asks_only_for_what_is_missing(tmp_path: Path) -> None:
    board = board_with_log(2000)
    line = FakeLine(board)
    partial = tmp_path / "log.part"
    first = Device(Client(FaultyStream(line, cut_after_bytes=9000)))
    log = first.log()
    with pytest.raises(LinkClosed):
        first.read_log(log, partial=partial)
    kept = PartialFile(partial, read_identity(partial) or pytest.fail("no partial"))
    missing = kept.spans.missing
    kept.close()
    assert 7000 < kept.spans.known_bytes < len(board.logs[0].data)

    board.reads.clear()
    second = Device(Client(line))
    data, report = second.read_log(second.log(), partial=partial)
    assert data == board.logs[0].data
    assert report.resumed_bytes == kept.spans.known_bytes
    asked = {offset + i for offset, length in board.reads for i in range(length)}
    assert asked == {i for start, end in missing for i in range(start, end)}
    assert not partial.exists()


def test_a_download_whose_program_was_killed_resumes(tmp_path: Path) -> None:
    board = board_with_log(500)
    device = device_on(board)
    log = device.log()
    partial = tmp_path / "log.part"
    identity = LogIdentity(
        device.info.board_id, device.info.boot_id, log.log_id, 1000, log.offset, log.length
    )
    file = PartialFile(partial, identity)
    file.fill(log.offset, board.logs[0].data[:1000])
    file.fill(log.offset + 2000, board.logs[0].data[2000:2500])
    with partial.open("ab") as half_written:
        half_written.write(b"\x10\x00\x00")
    data, report = device.read_log(log, partial=partial)
    assert data == board.logs[0].data
    assert report.resumed_bytes == 1500


def test_what_is_left_of_another_start_of_the_board_is_not_used(tmp_path: Path) -> None:
    board = board_with_log(300)
    partial = tmp_path / "log.part"
    first = Device(Client(FaultyStream(FakeLine(board), cut_after_bytes=2000)))
    with pytest.raises(LinkClosed):
        first.read_log(first.log(), partial=partial)
    board.boot_id += 1
    again = device_on(board)
    data, report = again.read_log(again.log(), partial=partial)
    assert data == board.logs[0].data
    assert report.resumed_bytes == 0


def test_a_board_that_starts_anew_during_a_download_is_named() -> None:
    board = board_with_log(300)
    device = device_on(board)
    log = device.log()
    board.boot_id += 1
    board.logs.clear()
    with pytest.raises(BoardRebooted, match="started anew"):
        device.read_log(log)


def test_a_log_that_the_ring_has_overwritten_meanwhile_is_named() -> None:
    board = board_with_log(300)
    device = device_on(board)
    log = device.log()
    entry = board.logs[0].entry
    board.logs[0].entry = type(entry)(**{f: getattr(entry, f) for f in entry.__slots__} | {"first_cell": 999})
    with pytest.raises(Refused, match="log_gone"):
        device.read_log(log)


def test_bytes_that_do_not_have_the_boards_digest_are_refused(tmp_path: Path) -> None:
    board = board_with_log(300)
    device = device_on(board)
    log = device.log()
    partial = tmp_path / "log.part"
    identity = LogIdentity(
        device.info.board_id, device.info.boot_id, log.log_id, 1000, log.offset, log.length
    )
    file = PartialFile(partial, identity)
    file.fill(log.offset, bytes(700))
    file.close()
    with pytest.raises(LogError, match="digest"):
        device.read_log(log, partial=partial)
    assert not partial.exists()
    assert device.read_log(log, partial=partial)[0] == board.logs[0].data


def test_a_board_that_falls_silent_ends_the_download_with_what_to_do() -> None:
    board = board_with_log(300)
    device = device_on(board)
    log = device.log()
    board.silent = True
    with pytest.raises(LinkTimeout) as caught:
        device.read_log(log)
    assert caught.value.next_step


def test_an_interrupted_download_keeps_what_has_arrived_and_says_how_to_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class RealLine(FakeLine):
        virtual = False

    monkeypatch.setenv("TRUING_ROOT", str(tmp_path))
    board = board_with_log(1000)
    device = Device(Client(RealLine(board)))
    with device.client.interrupted_by(lambda: len(board.reads) > 5), pytest.raises(Interrupted) as caught:
        fetch_log(device)
    assert "truing log fetch 4` goes on" in caught.value.next_step
    fetched = fetch_log(device)
    assert fetched.data == board.logs[0].data
    assert fetched.report.resumed_bytes > 1000
    board.boot_id += 1
    assert other_boots(Device(Client(RealLine(board)))) == []


def test_what_is_left_of_a_download_from_an_earlier_start_is_found_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class RealLine(FakeLine):
        virtual = False

    monkeypatch.setenv("TRUING_ROOT", str(tmp_path))
    board = board_with_log(1000)
    device = Device(Client(RealLine(board)))
    with device.client.interrupted_by(lambda: len(board.reads) > 5), pytest.raises(Interrupted):
        fetch_log(device)
    board.boot_id += 1
    stale = other_boots(Device(Client(RealLine(board))))
    assert [path.suffix for path in stale] == [".part"]


def test_the_newest_log_is_found_on_a_line_too_bad_for_the_whole_list() -> None:
    board = board_with_log(40)
    entry = board.logs[0].entry
    for log_id in range(5, 60):
        values = {f: getattr(entry, f) for f in entry.__slots__} | {"log_id": log_id}
        board.logs.append(type(board.logs[0])(type(entry)(**values), b""))
    device = device_on(board, share=0.01, seed=7)
    assert device.log().log_id == 59
    assert device.log(58).log_id == 58
    clean = device_on(board)
    assert [log.log_id for log in clean.logs()] == list(range(4, 60))


def test_progress_ends_at_one_and_never_goes_back() -> None:
    device = device_on(board_with_log(500), share=0.005, seed=2)
    seen: list[float] = []
    device.read_log(device.log(), progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def test_spans_know_what_is_missing() -> None:
    spans = Spans(100, 50)
    assert spans.missing == [(100, 150)]
    spans.fill(110, bytes(10))
    spans.fill(140, bytes(100))
    spans.fill(0, bytes(101))
    assert spans.missing == [(101, 110), (120, 140)]
    spans.fill(100, bytes(50))
    assert spans.missing == []
