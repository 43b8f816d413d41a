"""ISO-TP of the core and of can-isotp understand each other, also when something goes wrong."""

from __future__ import annotations

import ctypes
import random
import subprocess
from collections import deque
from collections.abc import Callable
from pathlib import Path

import isotp
import pytest

CAPACITY = 1031
TO_BOARD, TO_HOST = 0x601, 0x641


class Core:
    """The board's side: firmware/core/isotp.c itself, compiled for this machine."""

    def __init__(self, library: ctypes.CDLL, block_size: int = 8) -> None:
        self._c = library
        self._state = ctypes.create_string_buffer(512)  # more than struct isotp takes
        self._buffer = ctypes.create_string_buffer(CAPACITY)
        self._c.isotp_init(self._state, self._buffer, CAPACITY, block_size)
        self._kept: ctypes.Array[ctypes.c_char] | None = None

    def receive(self, data: bytes, now_ms: int = 0) -> bytes | None:
        length = ctypes.c_size_t()
        done = self._c.isotp_receive(self._state, data, len(data), now_ms, ctypes.byref(length))
        return self._buffer.raw[: length.value] if done else None

    def send(self, message: bytes) -> bool:
        self._kept = ctypes.create_string_buffer(message, len(message))
        return bool(self._c.isotp_send(self._state, self._kept, len(message)))

    def next_frame(self, now_ms: int = 0) -> bytes:
        out = ctypes.create_string_buffer(8)
        length = self._c.isotp_next_frame(self._state, out, now_ms)
        return out.raw[:length]

    def expire(self, now_ms: int) -> None:
        self._c.isotp_expire(self._state, now_ms)

    @property
    def idle(self) -> bool:
        return bool(self._c.isotp_is_idle(self._state))


@pytest.fixture(scope="session")
def library(root: Path, tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    out = tmp_path_factory.mktemp("isotp") / "isotp.so"
    source = root / "firmware/core/isotp.c"
    subprocess.run(["gcc", "-std=c11", "-O1", "-fPIC", "-shared", source, "-o", out], check=True)
    loaded = ctypes.CDLL(str(out))
    pointer, size, u32 = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_uint32
    loaded.isotp_init.argtypes = [pointer, pointer, ctypes.c_uint16, ctypes.c_uint8]
    loaded.isotp_receive.argtypes = [pointer, ctypes.c_char_p, size, u32, pointer]
    loaded.isotp_receive.restype = ctypes.c_bool
    loaded.isotp_send.argtypes = [pointer, pointer, size]
    loaded.isotp_send.restype = ctypes.c_bool
    loaded.isotp_next_frame.argtypes = [pointer, pointer, u32]
    loaded.isotp_next_frame.restype = size
    loaded.isotp_expire.argtypes = [pointer, u32]
    loaded.isotp_is_idle.argtypes = [pointer]
    loaded.isotp_is_idle.restype = ctypes.c_bool
    return loaded


@pytest.fixture
def core(library: ctypes.CDLL) -> Core:
    return Core(library)


class Pair:
    """Core and can-isotp, joined frame by frame; `loses` says which frames do not arrive."""

    def __init__(
        self, core: Core, *, st_min: int = 0, block_size: int = 0, loses: Callable[[], bool] = lambda: False
    ) -> None:
        self.core = core
        self.loses = loses
        self.now_ms = 0
        self.to_host: deque[isotp.CanMessage] = deque()
        self.at_board: list[bytes] = []
        self.host = isotp.TransportLayerLogic(
            lambda _: self.to_host.popleft() if self.to_host else None,
            self._to_board,
            isotp.Address(isotp.AddressingMode.Normal_11bits, txid=TO_BOARD, rxid=TO_HOST),
            error_handler=lambda _: None,
            params={"stmin": st_min, "blocksize": block_size, "logger_name": "test"},
        )

    def _to_board(self, message: isotp.CanMessage) -> None:
        if not self.loses() and (whole := self.core.receive(bytes(message.data), self.now_ms)) is not None:
            self.at_board.append(whole)

    def turn(self) -> None:
        self.now_ms += 1
        self.core.expire(self.now_ms)
        while frame := self.core.next_frame(self.now_ms):
            if not self.loses():
                self.to_host.append(isotp.CanMessage(TO_HOST, len(frame), frame))
            self.host.process()
        self.host.process()

    def run(self, turns: int = 1200) -> None:
        for _ in range(turns):
            self.turn()


@pytest.mark.parametrize("length", [1, 6, 7, 8, 13, 14, 62, 63, 64, 118, 119, 1030, 1031])
@pytest.mark.parametrize(("st_min", "block_size"), [(0, 0), (0, 3), (2, 0), (0xF5, 8)])
def test_messages_of_every_length_cross_both_ways(
    core: Core, length: int, st_min: int, block_size: int
) -> None:
    up, down = random.Random(length).randbytes(length), random.Random(-length).randbytes(length)
    pair = Pair(core, st_min=st_min, block_size=block_size)
    pair.host.send(up)
    assert core.send(down)
    pair.run(600)
    assert pair.at_board == [up]
    assert pair.host.recv() == down
    assert core.idle


def test_a_separation_time_is_kept(core: Core) -> None:
    core.send(bytes(20))
    assert core.next_frame(0)[0] >> 4 == 1
    core.receive(b"\x30\x00\x05", 10)
    times = [now for now in range(10, 40) if core.next_frame(now)]
    assert times == [10, 16]  # 5 ms at least, in ticks of one


def test_a_message_longer_than_the_board_holds_is_refused(core: Core) -> None:
    assert core.receive(bytes([0x10 | CAPACITY + 1 >> 8, (CAPACITY + 1) & 0xFF]) + bytes(6)) is None
    assert core.next_frame()[0] == 0x32


def test_a_missing_frame_drops_its_message_and_the_next_one_arrives(core: Core) -> None:
    core.receive(b"\x10\x20" + bytes(6))
    assert core.next_frame() == b"\x30\x08\x00"
    core.receive(b"\x21" + bytes(7))
    assert core.receive(b"\x23" + bytes(7)) is None
    assert core.receive(b"\x24" + bytes(7)) is None
    assert core.receive(b"\x02ok") == b"ok"


def test_a_peer_that_falls_silent_is_given_up_after_a_tenth_of_a_second(core: Core) -> None:
    core.send(bytes(100))
    core.next_frame(0)
    core.expire(99)
    assert not core.idle
    core.expire(100)
    assert core.idle
    assert core.send(b"again")


def test_a_peer_may_ask_to_wait_but_not_for_ever(core: Core) -> None:
    core.send(bytes(100))
    core.next_frame(0)
    for now in range(100, 900, 100):
        core.receive(b"\x31\x00\x00", now)
        core.expire(now + 99)
        assert not core.idle
    core.receive(b"\x31\x00\x00", 900)
    assert core.idle


@pytest.mark.parametrize("seed", range(5))
def test_no_sequence_of_frames_breaks_the_channel(core: Core, seed: int) -> None:
    noise = random.Random(seed)
    for now in range(20_000):
        core.receive(noise.randbytes(noise.randrange(1, 9)), now)
        core.expire(now)
        core.next_frame(now)
        if noise.random() < 0.1 and core.idle:
            core.send(noise.randbytes(noise.randrange(1, 200)))
    core.expire(30_000)
    core.next_frame(30_000)
    assert core.receive(b"\x03yes", 30_001) == b"yes"


@pytest.mark.parametrize("seed", range(3))
def test_what_arrives_after_losses_is_whole(core: Core, seed: int) -> None:
    luck = random.Random(seed)
    pair = Pair(core, loses=lambda: luck.random() < 0.01)
    sent = [bytes([n]) * 300 for n in range(40)]
    for message in sent:
        pair.host.send(message)
        pair.run(300)
        pair.host.stop_sending()
    assert 5 < len(pair.at_board) < 40
    assert set(pair.at_board) <= set(sent)
