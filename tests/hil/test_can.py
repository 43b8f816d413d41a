"""The flashed image on a CAN bus: the same commands as over serial, and a bus that goes wrong."""

from __future__ import annotations

import itertools
import random
import struct
import zlib
from pathlib import Path

import pytest

import truing_protocol as tp
from hil_sim import CanFrame
from support.can_chain import CanChain
from truing.board.device import Device
from truing.board.drive import drive
from truing.link.can_stream import CanStream, discover, stop_all
from truing.link.client import Client
from truing.link.framing import Frame, encode
from truing.link.refusals import faults_in
from truing.plan import Kind, Plan, Segment, load_plan
from truing.virtual.can import SimulatedBus

DEMO_PLAN = load_plan("paper/XI")
BRAKE = (1.0, 1.0)
SHORT = Plan(
    "short", "short", (Segment(Kind.EFFORT, 0.5, 0.4, 0.3), Segment(Kind.EFFORT, 0.3, 0.0, 0.0)), 200
)

MEDIUM = Plan(
    "medium", "medium", (Segment(Kind.VELOCITY, 4.0, 0.4, 0.3), Segment(Kind.EFFORT, 0.5, 0.0, 0.0)), 200
)


def can_state(device: Device) -> tp.CanStateReply:
    return device.client.request(tp.CanStateRequest())


@pytest.mark.parametrize("bit_rate", [1_000_000, 500_000])
def test_a_plan_goes_up_and_its_log_comes_down_byte_for_byte(
    image: Path, native_library: Path, bit_rate: int
) -> None:
    with CanChain(image, bit_rate=bit_rate) as chain:
        device = chain.host()
        driven = drive(device, Plan("long", "long", 8 * DEMO_PLAN.segments, log_rate_hz=200))
        log = device.log(driven.log_id)
        before, began = chain.bus.totals(), chain.bus.time_s
        data, report = device.read_log(log)
        took = chain.bus.time_s - began
        assert data == chain.in_ram(log.offset, log.length)
        assert report.again_bytes == 0
        after = chain.bus.totals()
        # 1031 bytes of frame for 1020 of log, 7 of them in a CAN frame of 8 bytes with its stuff bits.
        bits = (after.bits - before.bits) / (after.frames - before.frames)
        limit = bit_rate / bits * 7 * 1020 / 1031
        print(
            f"{bit_rate} bit/s: {len(data)} bytes in {took:.3f} s, {len(data) / took:.0f} B/s, "
            f"{bits:.1f} bits a frame, payload limit {limit:.0f} B/s, {len(data) / took / limit:.1%}"
        )
        assert len(data) / took >= 0.9 * limit
        state = can_state(device)
        assert (state.overruns, state.discarded, state.sequence_errors, state.timeouts) == (0, 0, 0, 0)
        assert chain.robots[0].warnings() == []


def test_serial_and_can_are_answered_at_once_each_where_it_asked(image: Path, native_library: Path) -> None:
    with CanChain(image) as chain:
        over_can, over_serial = chain.host(), chain.serial_host(chain.robots[0])
        for node in (7, 8, 9):
            over_serial.set_parameter("log_rate_hz", node)
            assert over_can.client.request(tp.ParamGetRequest(index_of("log_rate_hz"))).value == node
        assert over_can.client.counts.strays == over_serial.client.counts.strays == 0


def index_of(name: str) -> int:
    return next(p.index for p in tp.PARAMETERS if p.name == name)


def test_a_host_that_falls_silent_on_can_stops_the_robot(image: Path, native_library: Path) -> None:
    with CanChain(image) as chain:
        device = chain.host()
        device.client.stream.sleep(0.3)
        device.arm()
        device.client.request(tp.SetEffortRequest(0.3, 0.3))
        device.client.stream.sleep(0.4)
        assert device.client.request(tp.StatusRequest()).state == tp.State.LIVE
        device.client.stream.sleep(0.2)
        latched = faults_in(device.client.request(tp.StatusRequest()).faults_latched)
        assert [fault.name for fault in latched] == ["host_silent"]


def test_two_boards_on_one_bus_are_told_apart(image: Path, native_library: Path) -> None:
    with CanChain(image, boards=2) as chain:
        nodes = discover(SimulatedBus(chain.bus))
        assert [node.node for node in nodes] == [1, 2]
        assert len({node.board for node in nodes}) == 2
        assert {node.schema_hash for node in nodes} == {tp.SCHEMA_HASH}
        first, second = chain.host(1), chain.host(2)
        assert first.info.board_id[:-2] == second.info.board_id[:-2]
        assert (first.info.board_id[-2:], second.info.board_id[-2:]) == ("01", "02")
        drive(first, SHORT)
        counts = [device.client.request(tp.StatusRequest()).counts for device in (first, second)]
        assert min(counts[0]) > 100
        assert counts[1] == (0, 0)


def test_two_boards_with_one_number_are_both_found(image: Path, native_library: Path) -> None:
    with CanChain(image, boards=2) as chain:
        chain.serial_host(chain.robots[1]).set_parameter("can_node", 1)
        nodes = discover(SimulatedBus(chain.bus))
        assert [node.node for node in nodes] == [1, 1]
        assert len({node.board for node in nodes}) == 2


def plain(request_id: int, sequence: int, payload: bytes) -> bytes:
    """A frame before stuffing, as ISO-TP carries it."""
    covered = struct.pack("<BH", request_id, sequence) + payload
    return covered + struct.pack("<I", zlib.crc32(covered))


def stop_frame(kind: str) -> CanFrame:
    """What a host sends to stop node 1; of a stop with a payload the first frame of two."""
    if kind == "to all boards":
        return CanFrame(0x600, bytes((tp.StopRequest.ID,)))
    message = plain(tp.StopRequest.ID, 77, b"" if kind == "to one board" else b"\1\0\2")
    head = bytes((len(message),)) if len(message) < 8 else bytes((0x10, len(message)))
    return CanFrame(0x601, (head + message)[:8])


@pytest.mark.parametrize("kind", ["to all boards", "to one board", "with a payload"])
@pytest.mark.parametrize("crowd", [0, 100], ids=["quiet bus", "100 requests first"])
@pytest.mark.parametrize("hangs", [True, False], ids=["main loop hangs", "main loop free"])
def test_a_stop_on_can_brakes_within_2_ms(
    image: Path, native_library: Path, kind: str, crowd: int, hangs: bool
) -> None:
    """A hundred requests are more than the board keeps: the stop is seen all the same."""
    with CanChain(image) as chain:
        device = chain.host()
        chain.bus.run_us(300_000)
        device.set_effort(0.3, 0.3)
        chain.bus.run_us(100_000)
        robot = chain.robots[0]
        if hangs:
            robot.write_flash(robot.symbol("log_feed_drain")[0] & ~1, b"\xfe\xe7")  # b .
        chain.bus.run_us(1_500)
        for k in range(crowd):
            status = plain(tp.StatusRequest.ID, k, b"")
            chain.bus.write(CanFrame(0x601, bytes((len(status),)) + status))
        chain.bus.run_us(150 * crowd)
        assert robot.bridge(0) != BRAKE
        chain.bus.write(stop_frame(kind))
        print(f"{kind}, {crowd} requests first: {until_braked(chain):.2f} ms from its first bit")


@pytest.mark.parametrize("kind", ["to all boards", "to one board", "with a payload"])
def test_a_stop_on_can_brakes_within_2_ms_while_digests_are_asked_on_the_serial_line(
    image: Path, native_library: Path, kind: str
) -> None:
    with CanChain(image) as chain:
        device, serial = chain.host(), chain.serial_host(chain.robots[0])
        drive(device, Plan("long", "long", 4 * DEMO_PLAN.segments, log_rate_hz=200))
        log = device.logs()[-1]
        digest = tp.LogDigestRequest(log.offset, log.length)
        worst = 0.0
        for at in range(8):
            device.set_effort(0.3, 0.3)
            chain.bus.run_us(100_000 + 131 * at)
            for k in range(20):
                serial.client.stream.write(encode(Frame(digest.ID, k, digest.pack())))
            chain.bus.run_us(2_000)
            chain.bus.write(stop_frame(kind))
            worst = max(worst, until_braked(chain))
            chain.bus.run_us(400_000)
            device.stop()
        print(f"{kind}, {log.length} bytes a digest: {worst:.2f} ms from its first bit")


def until_braked(chain: CanChain) -> float:
    """Milliseconds until both bridges of the only board brake."""
    began, robot = chain.bus.time_s, chain.robots[0]
    while (robot.bridge(0), robot.bridge(1)) != (BRAKE, BRAKE):
        chain.bus.run_us(50)
        assert chain.bus.time_s - began < 2e-3, "the wheels are still driven"
    return (chain.bus.time_s - began) * 1e3


def test_one_frame_stops_all_boards(image: Path, native_library: Path) -> None:
    with CanChain(image, boards=2) as chain:
        hosts = [chain.host(1), chain.host(2)]
        chain.bus.run_us(300_000)
        for host in hosts:
            host.arm()
            host.client.request(tp.SetEffortRequest(0.3, 0.3))
        chain.bus.run_us(100_000)
        assert all(robot.bridge(0) != (1.0, 1.0) for robot in chain.robots)
        stop_all(SimulatedBus(chain.bus))
        chain.bus.run_us(2_000)
        assert all(robot.bridge(0) == (1.0, 1.0) for robot in chain.robots)


@pytest.mark.parametrize("bit_rate", [500_000, 1_000_000])
def test_a_shorted_bus_is_left_named_and_joined_again(
    image: Path, native_library: Path, bit_rate: int
) -> None:
    with CanChain(image, bit_rate=bit_rate) as chain:
        device = chain.host()
        assert can_state(device).bus_state == tp.CanBusState.ACTIVE
        serial = chain.serial_host(chain.robots[0])
        chain.bus.set_shorted(True)
        chain.bus.run_us(1_000_000)
        state = can_state(serial)
        assert state.bus_state == tp.CanBusState.BUS_OFF
        assert 5 <= state.bus_offs <= 11
        active = faults_in(serial.client.request(tp.StatusRequest()).faults_active)
        assert [fault.name for fault in active] == ["can_bus_off"]
        chain.bus.set_shorted(False)
        began = chain.bus.time_s
        assert can_state(device).bus_state == tp.CanBusState.ACTIVE
        print(
            f"{bit_rate} bit/s: {state.bus_offs} bus-offs in 1 s; "
            f"answered {chain.bus.time_s - began:.3f} s after the repair"
        )
        assert chain.bus.time_s - began < 0.5
        chain.bus.run_us(1_100_000)
        assert device.client.request(tp.StatusRequest()).faults_active == 0


def test_after_bus_off_nothing_is_sent_for_a_pause_and_128_times_11_idle_bits(
    image: Path, native_library: Path
) -> None:
    with CanChain(image) as chain:
        serial = chain.serial_host(chain.robots[0])
        serial.set_parameter("can_status_hz", 100)
        chain.bus.set_shorted(True)
        before = can_state(serial).bus_offs
        while can_state(serial).bus_offs == before:
            chain.bus.run_us(100)
        left_s, attempts = chain.bus.time_s, chain.bus.totals().damaged
        chain.bus.set_shorted(False)
        while chain.bus.read() is not None:
            pass  # from before
        while chain.bus.read() is None:
            chain.bus.run_us(100)
        silent_s = chain.bus.time_s - left_s
        print(f"silent for {silent_s * 1e3:.1f} ms; {attempts} attempts until bus-off")
        assert attempts == 32  # each costs 8 of 256 errors
        assert 0.100 + 128 * 11 / 1e6 <= silent_s < 0.115
        state = can_state(serial)
        assert (state.bus_state, state.transmit_errors) == (tp.CanBusState.ACTIVE, 0)


def test_a_sequence_drives_on_while_the_bus_is_off_and_its_log_comes_down_afterwards(
    image: Path, native_library: Path
) -> None:
    with CanChain(image) as chain:
        device = chain.host()
        log_id = device.start(device.upload(MEDIUM), unattended=True)
        chain.bus.run_us(500_000)
        chain.bus.set_shorted(True)
        chain.bus.run_us(5_000_000)
        chain.bus.set_shorted(False)
        log = device.log(log_id)
        data, _ = device.read_log(log)
        assert data == chain.in_ram(log.offset, log.length)
        assert log.end.name == "FINISHED"
        assert log.end_s - log.start_s == pytest.approx(4.5, abs=0.01)
        assert can_state(device).bus_offs > 20


def test_a_board_alone_on_its_bus_is_passive_and_comes_back(image: Path, native_library: Path) -> None:
    with CanChain(image) as chain:
        serial = chain.serial_host(chain.robots[0])
        chain.bus.set_host_connected(False)
        chain.bus.run_us(500_000)
        state = can_state(serial)
        assert state.bus_state == tp.CanBusState.PASSIVE
        assert (state.transmit_errors, state.last_error, state.bus_offs) == (128, 3, 0)
        assert state.discarded > 0
        chain.bus.set_host_connected(True)
        assert can_state(chain.host()).bus_state in (
            tp.CanBusState.ACTIVE,
            tp.CanBusState.WARNING,
            tp.CanBusState.PASSIVE,
        )
        chain.bus.run_us(10_000_000)
        assert can_state(serial).bus_state == tp.CanBusState.ACTIVE


def test_nodes_of_another_bit_rate_destroy_frames(image: Path, native_library: Path) -> None:
    with CanChain(image) as chain:
        chain.bus.set_bit_rate(500_000)
        chain.bus.run_us(1_000_000)
        assert can_state(chain.serial_host(chain.robots[0])).bus_offs > 0


def test_damaged_frames_are_repeated_by_their_senders(image: Path, native_library: Path) -> None:
    with CanChain(image) as chain:
        device = chain.host()
        driven = drive(device, SHORT)
        log = device.log(driven.log_id)
        chain.bus.damage(12)
        data, report = device.read_log(log)
        assert data == chain.in_ram(log.offset, log.length)
        assert report.again_bytes == 0
        assert chain.bus.totals().damaged == 12


class LossyBus(SimulatedBus):
    """An adapter that loses some of the frames, in both directions."""

    def __init__(self, chain: CanChain, share: float, seed: int) -> None:
        super().__init__(chain.bus)
        self.share = share
        self.random = random.Random(seed)
        self.lost = 0

    def spoils(self) -> bool:
        lost = self.random.random() < self.share
        self.lost += lost
        return lost

    def send(self, can_id: int, data: bytes) -> None:
        if not self.spoils():
            super().send(can_id, data)

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        frame = super().receive(timeout_s)
        return None if frame is not None and self.spoils() else frame


@pytest.mark.parametrize("seed", range(1, 7))
def test_lost_frames_change_neither_plan_nor_log(image: Path, native_library: Path, seed: int) -> None:
    with CanChain(image) as chain:
        bus = LossyBus(chain, 0.01, seed)
        device = Device(Client(CanStream(bus, 1)))
        driven = drive(device, MEDIUM)
        log = device.log(driven.log_id)
        data, _ = device.read_log(log)
        assert data == chain.in_ram(log.offset, log.length)
        assert bus.lost > 5


def test_the_status_broadcast_reads_back_through_the_dbc(
    image: Path, native_library: Path, root: Path
) -> None:
    import cantools

    database = cantools.database.load_file(root / "protocol/truing.dbc")
    assert isinstance(database, cantools.database.can.Database)
    with CanChain(image) as chain:
        device = chain.host()
        chain.bus.run_us(300_000)
        device.arm()
        device.client.request(tp.SetEffortRequest(0.4, 0.2))
        chain.bus.run_us(400_000)
        status = device.client.request(tp.StatusRequest())
        while chain.bus.read() is not None:
            pass
        chain.bus.run_us(1_000_000)
        told: dict[str, list[dict[str, object]]] = {"status_1": [], "motion_1": []}
        while (frame := chain.bus.read()) is not None:
            message = database.get_message_by_frame_id(frame.id)
            told[message.name].append(dict(message.decode(frame.data, decode_choices=True)))
        assert len(told["status_1"]) == len(told["motion_1"]) == 10
        first, last = told["status_1"][0], told["status_1"][-1]
        assert (str(first["state"]), str(first["mode"])) == ("live", "effort")
        assert (str(last["state"]), last["host_silent"], last["battery_low"]) == ("stopped", 1, 0)
        assert first["battery"] == pytest.approx(status.battery_mv / 1000, abs=0.2)
        assert told["motion_1"][0]["effort_left"] == pytest.approx(0.4)
        assert told["motion_1"][0]["effort_right"] == pytest.approx(0.2)
        assert float(str(told["motion_1"][0]["speed_left"])) > 0.1


def test_a_call_is_answered_and_frames_take_their_time(image: Path, native_library: Path) -> None:
    with CanChain(image) as chain:
        chain.bus.write(CanFrame(0x600, b"\x01"))
        chain.bus.run_us(100_000)
        seen = []
        while (frame := chain.bus.read()) is not None:
            seen.append(frame)
        assert 0x681 in [frame.id for frame in seen]
        assert all(b.time_us - a.time_us >= 47 for a, b in itertools.pairwise(seen))
