"""Byte stuffing: what it makes, that it comes back, and that damage is noticed; beside the `cobs` package."""

from __future__ import annotations

import random

import pytest
from cobs import cobs as peer
from hypothesis import given
from hypothesis import strategies as st

from truing.errors import StuffingError
from truing.link import cobs

# Bytes with zeros often enough, and runs without one long enough, to fill blocks.
DATA = st.lists(
    st.one_of(st.just(b"\0"), st.binary(max_size=5), st.integers(250, 260).map(lambda n: b"\x07" * n))
).map(b"".join)


@given(DATA)
def test_stuffed_bytes_are_those_of_the_package_and_come_back(data: bytes) -> None:
    stuffed = cobs.encode(data)
    assert stuffed == peer.encode(data)
    assert 0 not in stuffed
    assert len(stuffed) <= len(data) + len(data) // 254 + 1
    assert cobs.decode(stuffed) == data


@pytest.mark.parametrize("length", [0, 1, 253, 254, 255, 507, 508, 509, 762])
def test_full_blocks_end_as_the_package_ends_them(length: int) -> None:
    for tail in (b"", b"\0", b"\0\0", b"\0x"):
        data = bytes(range(1, 255)) * 3
        assert cobs.encode(data[:length] + tail) == peer.encode(data[:length] + tail)


@given(st.binary(max_size=600))
def test_any_bytes_are_decoded_or_refused_as_by_the_package(data: bytes) -> None:
    try:
        expected = peer.decode(data)
    except peer.DecodeError:
        with pytest.raises(StuffingError):
            cobs.decode(data)
    else:
        assert cobs.decode(data) == expected


def test_a_frame_cut_anywhere_is_no_longer_whole() -> None:
    data = random.Random(3).randbytes(700)
    stuffed = cobs.encode(data)
    for end in range(len(stuffed)):
        try:
            assert cobs.decode(stuffed[:end]) != data
        except StuffingError:
            continue
