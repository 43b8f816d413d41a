"""The host's framing: what the shared vectors say, and any bytes without a crash."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from truing.link.framing import MAX_PAYLOAD, Frame, FrameDecoder, encode


def test_frames_have_the_bytes_of_the_shared_vectors(root: Path) -> None:
    vectors = json.loads((root / "protocol/vectors/vectors.json").read_text())
    assert len(vectors["messages"]) > 20
    for vector in vectors["messages"]:
        frame = Frame(vector["id"], vector["sequence"], bytes.fromhex(vector["payload"]))
        on_the_wire = bytes.fromhex(vector["frame"])
        assert encode(frame) == b"\0" + on_the_wire, vector["name"]
        assert FrameDecoder().feed(on_the_wire) == [frame], vector["name"]


@given(
    payloads=st.lists(st.binary(max_size=300), max_size=6),
    cuts=st.lists(st.integers(1, 400), max_size=12),
)
def test_frames_arrive_however_the_line_cuts_them_up(payloads: list[bytes], cuts: list[int]) -> None:
    frames = [Frame(0x81, i, payload) for i, payload in enumerate(payloads)]
    line = b"".join(encode(frame) for frame in frames)
    decoder, got = FrameDecoder(), []
    for cut in cuts:
        got += decoder.feed(line[:cut])
        line = line[cut:]
    got += decoder.feed(line)
    assert got == frames
    assert decoder.counts.dropped == 0


def test_the_frame_after_a_damaged_one_is_received() -> None:
    good = encode(Frame(0x82, 5, b"after"))
    for spoiled_at in range(len(good)):
        damaged = bytearray(encode(Frame(0x82, 4, b"first")))
        damaged[spoiled_at % len(damaged)] ^= 0x41
        received = FrameDecoder().feed(bytes(damaged) + good)
        assert received[-1] == Frame(0x82, 5, b"after")


@given(st.binary(max_size=200), st.integers(0, 199), st.integers(1, 255))
def test_no_single_damaged_byte_is_taken_for_a_frame(payload: bytes, at: int, flip: int) -> None:
    line = bytearray(encode(Frame(0x81, 9, payload)))
    line[at % len(line)] ^= flip
    for frame in FrameDecoder().feed(bytes(line) + b"\0"):
        # Turning the frame's own closing or leading zero into a byte can leave the frame whole.
        assert frame == Frame(0x81, 9, payload)


def test_ten_megabytes_of_noise_neither_raise_nor_fill_the_memory() -> None:
    noise = random.Random(2023)
    decoder = FrameDecoder()
    for _ in range(160):
        decoder.feed(noise.randbytes(65_536))
    assert decoder.counts.bytes == 10_485_760
    # A CRC-32 passes by chance once in 4 billion frames.
    assert decoder.counts.frames == 0
    assert decoder.counts.dropped > 30_000
    assert decoder.feed(encode(Frame(0x81, 1, b"still here")))[-1].payload == b"still here"


def test_a_line_without_zeros_is_not_held_in_memory() -> None:
    decoder = FrameDecoder()
    for _ in range(100):
        decoder.feed(b"\x55" * 100_000)
    assert len(decoder._held) <= 2 * MAX_PAYLOAD
    assert decoder.feed(b"\0" + encode(Frame(0x81, 1, b"x"))) == [Frame(0x81, 1, b"x")]
    assert decoder.counts.dropped == 1


def test_the_longest_payload_passes_and_a_longer_one_is_refused_at_the_sender() -> None:
    frame = Frame(0x31, 65_535, bytes(range(256)) * 4)
    assert FrameDecoder().feed(encode(frame)) == [frame]
    with pytest.raises(ValueError, match="longer than 1024"):
        encode(Frame(0x31, 1, bytes(MAX_PAYLOAD + 1)))
