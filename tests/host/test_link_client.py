"""The client: every request is answered once, or the user learns why not."""

from __future__ import annotations

import pytest

import truing_protocol as tp
from support.fake_board import FakeBoard, FakeLine
from support.faulty_stream import FaultyStream
from truing.errors import LinkClosed, LinkTimeout, Refused
from truing.link.client import Client


def test_a_request_is_answered() -> None:
    client = Client(FakeLine(FakeBoard()))
    assert client.request(tp.ParamGetRequest(1)).value == pytest.approx(0.283)
    assert client.counts.retries == 0


def test_a_request_survives_a_line_that_spoils_one_byte_in_fifty() -> None:
    board = FakeBoard()
    stream = FaultyStream(FakeLine(board), share=0.02, seed=3)
    client = Client(stream)
    for value in range(1, 200):
        assert client.request(tp.ParamSetRequest(20, float(value))).value == value
    assert stream.spoiled > 50
    assert client.counts.retries > 20


def test_a_change_is_made_once_however_often_it_is_sent() -> None:
    board = FakeBoard()
    client = Client(FaultyStream(FakeLine(board), share=0.03, seed=5))
    for _ in range(50):
        client.request(tp.StopRequest())
    assert client.counts.retries > 10
    assert board.handled == ["stop"] * 50


def test_a_silent_board_is_named_with_what_to_check() -> None:
    board = FakeBoard(silent=True)
    client = Client(FakeLine(board))
    with pytest.raises(LinkTimeout, match="no answer to status within 2 s") as caught:
        client.request(tp.StatusRequest(), patience_s=2.0)
    assert "power" in caught.value.next_step
    assert client.stream.now_s() == pytest.approx(2.0, abs=0.1)
    assert 8 <= client.counts.requests <= 20


def test_a_cut_line_is_not_taken_for_a_slow_one() -> None:
    client = Client(FaultyStream(FakeLine(FakeBoard()), cut_after_bytes=70))
    client.request(tp.StatusRequest())
    with pytest.raises(LinkClosed, match="pulled"):
        client.request(tp.StatusRequest())
    assert client.stream.now_s() < 0.1


@pytest.mark.parametrize("reason", list(tp.RefusalReason))
def test_every_refusal_names_its_reason_and_a_next_step(reason: tp.RefusalReason) -> None:
    board = FakeBoard(refuse={"seq_start": (reason, 4)})
    with pytest.raises(Refused) as caught:
        Client(FakeLine(board)).request(tp.SeqStartRequest(0, 0))
    assert caught.value.reason == reason.name.lower()
    assert reason.name.lower() in str(caught.value)
    assert caught.value.next_step


def test_a_latched_fault_is_told_by_name_cause_and_next_step() -> None:
    low = next(f for f in tp.FAULTS if f.name == "battery_low")
    client = Client(FakeLine(FakeBoard(latched=low.mask)))
    with pytest.raises(Refused) as caught:
        client.request(tp.SetEffortRequest(0.1, 0.1))
    assert "battery_low" in str(caught.value)
    assert low.cause in str(caught.value)
    assert low.next_step in caught.value.next_step


def test_a_reply_to_an_earlier_request_is_not_taken_for_this_ones() -> None:
    board = FakeBoard()
    line = FakeLine(board, latency_s=0.08)  # beyond the first wait: every reply comes twice
    client = Client(line)
    values = [client.request(tp.ParamGetRequest(i)).index for i in range(10)]
    assert values == list(range(10))
    assert client.counts.retries >= 10
    assert client.counts.strays > 0


def test_two_programs_do_not_start_with_the_same_sequence_number() -> None:
    class RealLine(FakeLine):
        virtual = False

    firsts = set()
    for _ in range(20):
        line = RealLine(FakeBoard())
        client = Client(line)
        firsts.add(client._sequence)
    assert len(firsts) > 15
