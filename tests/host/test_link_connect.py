"""From what the user calls a port to a stream, and the plain answer when that is not possible."""

from __future__ import annotations

import os
import socket
import threading
from types import SimpleNamespace

import pytest
import serial.tools.list_ports

from truing.board.connect import list_ports, open_stream
from truing.errors import LinkClosed, LinkTimeout, PortError
from truing.link.tcp_stream import TcpStream


def port(device: str, vid: int | None = None, description: str = "n/a") -> SimpleNamespace:
    return SimpleNamespace(device=device, vid=vid, description=description)


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> list[SimpleNamespace]:
    ports: list[SimpleNamespace] = []
    monkeypatch.setattr(serial.tools.list_ports, "comports", lambda: ports)
    return ports


def test_likely_ports_come_first(machine: list[SimpleNamespace]) -> None:
    machine += [port("/dev/ttyS0"), port("/dev/ttyUSB1", 0x10C4), port("/dev/ttyUSB0", 0x0403)]
    assert [candidate.device for candidate in list_ports()] == ["/dev/ttyUSB0", "/dev/ttyUSB1", "/dev/ttyS0"]


def test_auto_with_nothing_plugged_in_lists_what_there_is(machine: list[SimpleNamespace]) -> None:
    machine.append(port("/dev/ttyS0"))
    with pytest.raises(PortError, match="no USB serial adapter") as caught:
        open_stream("auto")
    assert "/dev/ttyS0" in caught.value.next_step


def test_auto_with_several_adapters_lists_them_and_chooses_none(machine: list[SimpleNamespace]) -> None:
    machine += [port("/dev/ttyUSB0", 0x0403), port("/dev/ttyACM0", 0x0483)]
    with pytest.raises(PortError, match=r"/dev/ttyACM0 \(STMicroelectronics\), /dev/ttyUSB0 \(FTDI\)"):
        open_stream("auto")


def test_auto_opens_the_only_adapter(machine: list[SimpleNamespace]) -> None:
    master, slave = os.openpty()
    machine += [port("/dev/ttyS9"), port(os.ttyname(slave), 0x1A86)]
    stream = open_stream("auto")
    assert stream.name == os.ttyname(slave)
    stream.write(b"there")
    assert os.read(master, 10) == b"there"
    os.write(master, b"and back")
    assert stream.read(1.0) == b"and back"
    assert stream.read(0.01) == b""
    os.close(master)
    os.close(slave)
    with pytest.raises(LinkClosed, match="the link to the board is gone"):
        stream.read(0.2)
    stream.close()
    stream.close()


@pytest.mark.parametrize("name", ["usb", "sim:7", "tcp:", "tcp:host", "tcp:host:99999", "tcp::7700", "can0"])
def test_what_is_no_port_is_refused(name: str) -> None:
    with pytest.raises(PortError):
        open_stream(name)


def test_a_tcp_stream_carries_bytes_both_ways_and_notices_the_end() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        stream = TcpStream("127.0.0.1", server.getsockname()[1])
        peer, _ = server.accept()
        with peer:
            stream.write(b"request")
            assert peer.recv(100) == b"request"
            peer.sendall(b"reply")
            assert stream.read(1.0) == b"reply"
            began = stream.now_s()
            assert stream.read(0.05) == b""
            assert stream.now_s() - began >= 0.05
        with pytest.raises(LinkClosed, match="hung up"):
            stream.read(1.0)
        stream.close()


def test_a_tcp_stream_whose_peer_takes_nothing_gives_up() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        stream = TcpStream("127.0.0.1", server.getsockname()[1])
        peer, _ = server.accept()
        with peer, pytest.raises(LinkTimeout, match="has taken no bytes"):
            stream.write(bytes(50_000_000))
        stream.close()


def test_a_board_that_is_in_use_is_told_from_one_that_is_gone() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def refuse() -> None:
            peer, _ = server.accept()
            with peer:
                peer.sendall(b"refused: in use by somebody\r\n")

        thread = threading.Thread(target=refuse)
        thread.start()
        stream = TcpStream("127.0.0.1", server.getsockname()[1])
        thread.join()
        assert stream.read(1.0).startswith(b"refused")
        with pytest.raises(PortError, match="in use by somebody"):
            stream.read(1.0)
        stream.close()


@pytest.mark.parametrize(
    ("port", "opened"),
    [
        ("/dev/ttyUSB7", ("/dev/ttyUSB7", 921_600)),
        ("/dev/ttyUSB7@460800", ("/dev/ttyUSB7", 460_800)),
        ("COM3@460800", ("COM3", 460_800)),
        ("/dev/serial/by-id/usb-a@b", ("/dev/serial/by-id/usb-a@b", 921_600)),
    ],
)
def test_a_port_may_name_its_baud_rate(
    monkeypatch: pytest.MonkeyPatch, port: str, opened: tuple[str, int]
) -> None:
    seen: list[tuple[str, int]] = []
    monkeypatch.setattr(
        "truing.link.serial_stream.SerialStream", lambda device, baud: seen.append((device, baud))
    )
    open_stream(port)
    assert seen == [opened]
