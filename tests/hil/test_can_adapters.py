"""python-can's adapters lead to the flashed image: slcan on a terminal, SocketCAN, the virtual bus."""

from __future__ import annotations

import json
import selectors
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

import truing_protocol as tp
from hil_sim.slcan import SlcanPort
from support.can_chain import CanChain
from support.datagram_can import DatagramCan
from support.lock_step_bus import LockStepBus
from support.served_board import ServedBoard
from truing.board.connect import open_can_bus, open_stream
from truing.board.device import Device, parameter_info
from truing.board.drive import drive
from truing.errors import LinkClosed, PortError
from truing.link.can_address import CanAddress, can_address
from truing.link.can_stream import CanStream, discover
from truing.link.client import Client
from truing.log.decode import decode_log
from truing.plan import Kind, Plan, Segment, load_plan
from truing.virtual.options import VirtualOptions

LONG_LOG = Plan("long", "long", load_plan("paper/XI").segments, log_rate_hz=200)
MANY = Plan(
    "many", "a sequence of several messages", tuple(Segment(Kind.EFFORT, 0.01, 0.3, 0.2) for _ in range(200))
)


@pytest.fixture
def selector() -> Iterator[selectors.BaseSelector]:
    with selectors.DefaultSelector() as made:
        yield made


def value(device: Device, name: str) -> float:
    return device.client.request(tp.ParamGetRequest(parameter_info(name).index)).value


def drive_and_compare(chain: CanChain, bus: LockStepBus, plan: Plan) -> None:
    """A sequence goes up, its log comes down: the bytes that lie in the board's RAM."""
    assert [node.node for node in discover(bus)] == [1]
    with Device(Client(CanStream(bus, 1))) as device:
        driven = drive(device, plan)
        log = device.log(driven.log_id)
        data, report = device.read_log(log)
        assert data == chain.in_ram(log.offset, log.length)
        assert report.again_bytes == 0
        assert device.client.counts.retries == 0
        assert len(decode_log(data).records) == log.record_count > 300
        print(
            f"{chain.bus.totals().frames} frames; log of {report.bytes} bytes at {report.bytes_per_s:.0f} B/s"
        )


@pytest.mark.parametrize("bit_rate", [500_000, 1_000_000])
def test_a_sequence_goes_up_and_its_log_comes_down_through_slcan_on_a_terminal(
    image: Path, native_library: Path, tmp_path: Path, selector: selectors.BaseSelector, bit_rate: int
) -> None:
    with CanChain(image, bit_rate=bit_rate) as chain:
        port = SlcanPort(chain.bus, tmp_path / "can", selector, lambda _: None)
        bus = LockStepBus("slcan", str(tmp_path / "can"), bit_rate, port, chain.bus)
        drive_and_compare(chain, bus, LONG_LOG)
        port.close()


def test_a_sequence_of_several_messages_goes_up_through_slcan(
    image: Path, native_library: Path, tmp_path: Path, selector: selectors.BaseSelector
) -> None:
    with CanChain(image) as chain:
        port = SlcanPort(chain.bus, tmp_path / "can", selector, lambda _: None)
        bus = LockStepBus("slcan", str(tmp_path / "can"), 1_000_000, port, chain.bus)
        with Device(Client(CanStream(bus, 1))) as device:
            assert device.upload(MANY).duration_s == pytest.approx(2.0)
            assert device.client.counts.retries == 0
        port.close()


@pytest.mark.parametrize("bit_rate", [500_000, 1_000_000])
def test_socketcan_carries_the_same_frames(
    image: Path, native_library: Path, monkeypatch: pytest.MonkeyPatch, bit_rate: int
) -> None:
    """All of python-can's driver runs but the opening of a CAN socket, which needs a kernel that has them."""
    with CanChain(image, bit_rate=bit_rate) as chain:
        kernel = DatagramCan(chain.bus, monkeypatch)
        bus = LockStepBus("socketcan", "can0", bit_rate, kernel, chain.bus)
        assert kernel.bound_to == ["can0"]
        kernel.tell_error()  # is no frame, and disturbs nothing
        drive_and_compare(chain, bus, LONG_LOG)
        kernel.close()


def test_an_interface_that_is_taken_down_ends_the_link(
    image: Path, native_library: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with CanChain(image) as chain:
        kernel = DatagramCan(chain.bus, monkeypatch)
        bus = LockStepBus("socketcan", "can0", 1_000_000, kernel, chain.bus)
        with Device(Client(CanStream(bus, 1))) as device:
            kernel.go_down(monkeypatch)
            with pytest.raises(
                LinkClosed, match=r"can:socketcan:can0: the CAN bus is gone \(Network is down"
            ):
                device.client.request(tp.StatusRequest())
        kernel.close()


def test_a_full_queue_of_socketcan_is_waited_for(
    image: Path, native_library: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An interface queues ten frames by default, and refuses the next one at once."""
    with CanChain(image) as chain:
        kernel = DatagramCan(chain.bus, monkeypatch)
        bus = LockStepBus("socketcan", "can0", 1_000_000, kernel, chain.bus)
        refused = kernel.refuse_every_third(monkeypatch)
        with Device(Client(CanStream(bus, 1))) as device:
            device.upload(MANY)
            assert len(refused) > 20
            assert device.client.counts.retries == 0
        kernel.close()


def test_an_interface_that_is_not_there_is_said_in_one_line(native_library: Path) -> None:
    with pytest.raises(PortError, match="can:socketcan:nosuchcan: cannot be opened"):
        open_stream("can:socketcan:nosuchcan/2")
    with pytest.raises(PortError, match="can:nosuchadapter:x: cannot be opened"):
        open_stream("can:nosuchadapter:x")


def test_boards_on_python_cans_virtual_bus_are_found_and_told_apart(
    image: Path, native_library: Path
) -> None:
    options = VirtualOptions(image=image)
    bus, _ = open_can_bus("virtual:three,3", options)
    found = discover(bus)
    assert [node.node for node in found] == [1, 2, 3]
    assert len({node.board for node in found}) == 3
    with (
        Device.open("can:virtual:three/1", options) as one,
        Device.open("can:virtual:three/3", options) as three,
    ):
        assert one.info.board_id != three.info.board_id
        driven = drive(three, LONG_LOG)
        log = three.log(driven.log_id)
        data, report = three.read_log(log)
        assert report.again_bytes == 0
        assert len(decode_log(data).records) == log.record_count
        assert min(three.client.request(tp.StatusRequest()).counts) > 1000
        assert one.client.request(tp.StatusRequest()).counts == (0, 0)
        print(f"node 3 of 3: log of {report.bytes} bytes at {report.bytes_per_s:.0f} B/s of virtual time")
    bus.close()


@pytest.mark.parametrize("bit_rate", [500_000, 1_000_000])
def test_other_programs_of_the_process_see_the_bus_through_python_can(
    image: Path, native_library: Path, root: Path, bit_rate: int
) -> None:
    stream = open_stream(f"can:virtual:seen@{bit_rate}", VirtualOptions(image=image))
    with can.Bus(interface="virtual", channel="seen") as listener:
        stream.sleep(1.0)
        heard = [listener.recv(0.0) for _ in range(20)]
        ids = [message.arbitration_id for message in heard if message is not None]
        assert ids.count(tp.CanStatus.BASE + 1) == ids.count(tp.CanMotion.BASE + 1) == 10
    stream.close()


def test_a_bus_that_others_have_made_is_joined_as_it_is(native_library: Path) -> None:
    with can.Bus(interface="virtual", channel="theirs") as theirs:
        client = Client(open_stream("can:virtual:theirs/5"))
        assert client.stream.virtual is False
        client.post(tp.StatusRequest())
        heard = theirs.recv(10.0)
        assert heard is not None
        assert heard.arbitration_id == tp.CAN_HOST_TO_BOARD + 5
        client.close()


def test_boards_go_when_their_last_host_leaves(image: Path, native_library: Path) -> None:
    options = VirtualOptions(image=image)
    with Device.open("can:virtual", options) as device:
        device.set_parameter("log_rate_hz", 77)
        with Device.open("can:virtual", options) as other:
            assert value(other, "log_rate_hz") == 77
    with Device.open("can:virtual", options) as device:
        assert value(device, "log_rate_hz") != 77


@pytest.mark.parametrize(
    ("port", "said"),
    [
        ("can:virtual:x,0", "not a number of virtual boards"),
        ("can:virtual:x,99", "not a number of virtual boards"),
        ("can:virtual:x,many", "not a number of virtual boards"),
        ("can:virtual:x,2/3", "the bus has 2 virtual boards"),
        ("can:virtual/64", "not an address on a CAN bus"),
        ("can:sim@5", "not an address on a CAN bus"),
        ("can:slcan:", "not an address on a CAN bus"),
    ],
)
def test_a_port_that_cannot_be_is_refused(image: Path, native_library: Path, port: str, said: str) -> None:
    with pytest.raises(PortError, match=said):
        open_stream(port, VirtualOptions(image=image))


@pytest.mark.parametrize(
    "port", ["can:sim", "can:sim@500000/9", "can:virtual@500000", "can:virtual:two,2@500000/2"]
)
def test_a_simulated_bus_has_the_board_and_the_bit_rate_that_are_asked_for(
    image: Path, native_library: Path, port: str
) -> None:
    with Device.open(port, VirtualOptions(image=image)) as device:
        state = device.client.request(tp.CanStateRequest())
        assert (state.bus_state, state.bus_offs) == (tp.CanBusState.ACTIVE, 0)
        assert value(device, "can_bitrate_kbps") == (500 if "@" in port else 1000)


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ("socketcan:can0", CanAddress("socketcan", "can0")),
        ("socketcan:can0/2", CanAddress("socketcan", "can0", node=2)),
        ("slcan:/dev/pts/5", CanAddress("slcan", "/dev/pts/5")),
        ("slcan:/dev/pts/5@500000/3", CanAddress("slcan", "/dev/pts/5", 500_000, 3)),
        ("slcan:out/can", CanAddress("slcan", "out/can")),
        ("slcan:out/can/3", CanAddress("slcan", "out/can", node=3)),
        ("sim", CanAddress("sim", "")),
        ("virtual:robots,3@500000/2", CanAddress("virtual", "robots,3", 500_000, 2)),
    ],
)
def test_an_address_says_adapter_channel_bit_rate_and_node(said: str, meant: CanAddress) -> None:
    assert can_address(said) == meant


def truing(*arguments: str) -> str:
    said = subprocess.run([sys.executable, "-m", "truing", *arguments], capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    return said.stdout


def test_the_command_line_drives_a_board_in_real_time_through_slcan(
    image: Path, native_library: Path, tmp_path: Path
) -> None:
    """The board with its terminal in one process, each command in another."""
    terminal = tmp_path / "can"
    with ServedBoard(tmp_path, can=terminal) as board:
        subprocess.run(
            board.truing("params", "set", "can_bitrate_kbps", "500"), check=True, capture_output=True
        )
        bus = f"slcan:{terminal}@500000"
        assert [node["node"] for node in json.loads(truing("--json", "ports", "--can", bus))] == [1]
        assert f"on can:slcan:{terminal}/1" in truing("--port", f"can:{bus}/1", "info")


def test_the_command_line_lists_the_boards_of_a_virtual_bus(image: Path, native_library: Path) -> None:
    nodes = json.loads(truing("--json", "ports", "--can", "virtual:robots,3@500000"))
    assert [node["node"] for node in nodes] == [1, 2, 3]
    assert "can:virtual:robots,3@500000/2" in truing("ports", "--can", "virtual:robots,3@500000")
