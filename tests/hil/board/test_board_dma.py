"""The virtual board's DMA streams move a serial port's bytes as RM0090, section 10, says."""

from __future__ import annotations

import pytest

from support.board_registers import Registers

LISR, LIFCR = 0x40026000, 0x40026008
USART3_DR, USART3_CR1, USART3_CR3 = 0x40004804, 0x4000480C, 0x40004814
USART1_DR = 0x40011004
DMAR, DMAT, IDLEIE = 1 << 6, 1 << 7, 1 << 4
UE_TE_RE = 1 << 13 | 1 << 3 | 1 << 2
EN, TEIE, HTIE, TCIE, TO_PERIPHERAL, CIRC, MINC = (1 << bit for bit in (0, 2, 3, 4, 6, 8, 10))
CHANNEL_4 = 4 << 25
HTIF, TCIF, TEIF = 1 << 4, 1 << 5, 1 << 3
RX, TX = 1, 3
FLAGS_AT = {RX: 6, TX: 22}
CCM = 0x10000000
BYTE_US = 10 / 921600 * 1e6
RING = 16


class DmaRegisters(Registers):
    """Those of a board with its DMA's flags by stream."""

    def flags(self, stream):
        return self[LISR] >> FLAGS_AT[stream] & 0x3D

    def clear(self, stream):
        self[LIFCR] = 0x3D << FLAGS_AT[stream]


def cr(stream):
    return 0x40026010 + 0x18 * stream


def ndtr(stream):
    return cr(stream) + 4


@pytest.fixture
def r(board):
    """A board that is told to read and write registers, USART3 on, its DMA requests too."""
    b = board("dma")
    b.run_us(5_000)
    registers = DmaRegisters(b)
    registers[USART3_CR3] = DMAR | DMAT
    return registers


def prepare(r, stream, memory, count, peripheral=USART3_DR):
    r[cr(stream) + 0x08] = peripheral
    r[cr(stream) + 0x0C] = memory
    r[ndtr(stream)] = count


def listen(r, mode=CIRC, memory=None, count=RING):
    """Start stream 1 on the image's ring."""
    prepare(r, RX, r.board.symbol("ring")[0] if memory is None else memory, count)
    r[cr(RX)] = CHANNEL_4 | MINC | mode | EN


def send(r, data, mode=TCIE, channel=CHANNEL_4, peripheral=USART3_DR):
    address = r.board.symbol("outbox")[0]
    r.board.write_memory(address, data)
    prepare(r, TX, address, len(data), peripheral)
    r[cr(TX)] = channel | MINC | TO_PERIPHERAL | mode | EN


def hear(r, data):
    r.board.link_write(data)
    r.board.run_us(int((len(data) + 2) * BYTE_US))


def ring(r):
    return r.board.read_memory(r.board.symbol("ring")[0], RING)


def test_a_circle_is_filled_again_and_again_without_a_cpu(r):
    listen(r)
    data = bytes(range(1, 41))
    hear(r, data)
    assert ring(r) == data[32:40] + data[24:32]
    assert r[ndtr(RX)] == RING - 40 % RING
    assert r.flags(RX) == HTIF | TCIF
    assert r[cr(RX)] & EN
    assert r.board.warnings() == []


def test_middle_and_end_of_a_circle_interrupt(r):
    listen(r, CIRC | HTIE | TCIE)
    hear(r, bytes(3 * RING + RING // 2))
    assert (r.board.word("half"), r.board.word("received")) == (4, 3)
    assert r[ndtr(RX)] == RING // 2


def test_an_idle_line_interrupts_once_a_byte_after_the_last(r):
    listen(r)
    r[USART3_CR1] = UE_TE_RE | IDLEIE
    before = r.board.word("line_idle")
    r.board.link_write(b"abc")
    r.board.run_us(int(3.9 * BYTE_US))
    assert r.board.word("line_idle") == before
    r.board.run_us(int(0.3 * BYTE_US))
    assert r.board.word("line_idle") == before + 1
    r.board.run_us(1000)
    assert r.board.word("line_idle") == before + 1
    assert ring(r)[:3] == b"abc", "reading DR for the idle flag takes no byte from the stream"
    hear(r, b"d")
    assert (r.board.word("line_idle"), ring(r)[:4]) == (before + 2, b"abcd")


def test_a_run_leaves_without_a_gap_and_interrupts_once(r):
    data = bytes(range(50))
    send(r, data)
    r.board.run_us(int(25 * BYTE_US))
    assert 20 <= len(r.board.link_read()) <= 26
    assert r.board.word("sent") == 0
    r.board.run_us(int(26 * BYTE_US))
    assert r.board.word("sent") == 1
    assert (r[cr(TX)] & EN, r[ndtr(TX)]) == (0, 0)


def test_the_bytes_are_the_memorys(r):
    data = bytes(range(7, 57))
    send(r, data)
    r.board.run_us(int(60 * BYTE_US))
    assert r.board.link_read() == data


def test_without_a_circle_reception_ends_and_the_next_byte_waits_in_the_port(r):
    listen(r, mode=0, count=4)
    hear(r, b"12345")
    assert ring(r)[:5] == b"1234\0"
    assert (r[cr(RX)] & EN, r[ndtr(RX)], r.flags(RX)) == (0, 0, HTIF | TCIF)
    assert r[USART3_DR] == ord("5")


def test_a_byte_that_waits_is_fetched_when_the_stream_starts(r):
    hear(r, b"x")
    listen(r)
    assert ring(r)[:1] == b"x"


def test_a_stream_with_a_flag_left_does_not_start(r):
    send(r, b"first", mode=0)
    r.board.run_us(1000)
    assert r.flags(TX) == HTIF | TCIF
    send(r, b"second", mode=0)
    assert r[cr(TX)] & EN == 0
    assert any("event flags set" in w.text for w in r.board.warnings())
    r.clear(TX)
    send(r, b"third", mode=0)
    r.board.run_us(1000)
    assert r.board.link_read() == b"firstthird"


def test_core_coupled_memory_is_out_of_reach(r):
    listen(r, memory=CCM)
    hear(r, b"x")
    assert (r.flags(RX), r[cr(RX)] & EN, r[ndtr(RX)]) == (TEIF, 0, RING)


def test_dma1_does_not_reach_the_second_bus(r):
    send(r, b"x", peripheral=USART1_DR)
    assert (r.flags(TX) & TEIF, r[cr(TX)] & EN) == (TEIF, 0)


def test_a_stream_that_is_switched_off_tells_what_is_left(r):
    listen(r)
    hear(r, b"12345")
    r[cr(RX)] = CHANNEL_4 | MINC | CIRC
    assert (r.flags(RX) & TCIF, r[ndtr(RX)]) == (TCIF, RING - 5)
    hear(r, b"6")
    assert ring(r)[:6] == b"12345\0"


def test_what_is_set_while_a_stream_is_on_has_no_effect(r):
    listen(r)
    r[ndtr(RX)] = 3
    assert r[ndtr(RX)] == RING
    r[cr(RX)] = CHANNEL_4 | CIRC | EN
    assert r[cr(RX)] & MINC
    assert any("configured while enabled" in w.text for w in r.board.warnings())


def test_another_channel_carries_no_request_of_this_port(r):
    send(r, b"x", channel=3 << 25)
    r.board.run_us(1000)
    assert r.board.link_read() == b""
    assert any("no request" in w.text for w in r.board.warnings())


def test_without_requests_of_the_port_nothing_moves(r):
    r[USART3_CR3] = 0
    send(r, b"x")
    r.board.run_us(1000)
    assert r[ndtr(TX)] == 1
    r[USART3_CR3] = DMAT
    r.board.run_us(100)
    assert r.board.link_read() == b"x"
