"""Every fault of the schema is provoked on the flashed image, timed, and none of them comes by itself."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import truing_protocol as tp
from hil_sim import VirtualRobot
from hil_sim.plant import RobotParameters
from hil_sim.robot import EncoderFault, ResetCause
from support.driving import BRAKE
from support.image_variable import member_offset
from truing.board.device import Device
from truing.errors import Refused
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing.plan import Kind, Plan, Segment, built_in_names, load_plan

LEFT, RIGHT = 0, 1


def host(robot: VirtualRobot) -> Device:
    if robot.time_us < 300_000:
        robot.run_us(300_000 - robot.time_us)
    return Device(Client(VirtualStream(robot)))


@pytest.fixture
def robot(image: Path, native_library: Path) -> Iterator[VirtualRobot]:
    with VirtualRobot(image) as fresh:
        yield fresh


def start(device: Device, kind: tp.SegmentKind, a: float, b: float, ms: int = 20_000) -> None:
    segment = tp.Segment(kind, ms, a, b)
    crc = zlib.crc32(segment.pack())
    device.client.request(tp.SeqBeginRequest(1, 20))
    device.client.request(tp.SeqSegmentsRequest(0, (segment,)))
    device.client.request(tp.SeqCommitRequest(crc))
    device.arm()
    device.client.request(tp.SeqStartRequest(crc, 1))
    device.client.stream.sleep(0.002)


def until_braked(robot: VirtualRobot, limit_ms: int = 3000) -> float:
    """Milliseconds until both bridges brake."""
    began = robot.time_us
    while (robot.bridge(LEFT), robot.bridge(RIGHT)) != BRAKE:
        robot.run_us(100)
        assert robot.time_us - began < limit_ms * 1000, "the wheels were never stopped"
    return (robot.time_us - began) / 1000


def latched(device: Device) -> set[str]:
    return {fault.name for fault in device.status().latched}


def clear_and_drive(device: Device) -> None:
    """Nothing moves until the fault is cleared by its own command; then it drives."""
    with pytest.raises(Refused) as refused:
        device.set_effort(0.2, 0.2)
    assert refused.value.reason == "fault_latched"
    device.stop()
    assert device.status().state == tp.State.STOPPED
    device.clear_faults()
    assert device.status().state == tp.State.IDLE


@dataclass(frozen=True)
class Drive:
    """What the robot does when something breaks."""

    kind: tp.SegmentKind
    left: float
    right: float
    after_s: float = 1.0


CRUISE = Drive(tp.SegmentKind.VELOCITY, 0.35, 0.35)
CRAWL = Drive(tp.SegmentKind.VELOCITY, 0.10, 0.10)
FAST = Drive(tp.SegmentKind.VELOCITY, 0.60, 0.60)
PUSH = Drive(tp.SegmentKind.EFFORT, 0.40, 0.40)
FROM_REST = Drive(tp.SegmentKind.VELOCITY, 0.35, 0.35, after_s=0.0)
PUSH_FROM_REST = Drive(tp.SegmentKind.EFFORT, 0.40, 0.40, after_s=0.0)
GENTLE_PUSH = Drive(tp.SegmentKind.EFFORT, 0.20, 0.20, after_s=0.0)


def fault(wheel: int, kind: EncoderFault) -> Callable[[VirtualRobot], None]:
    return lambda robot: robot.set_encoder_fault(wheel, kind)


UNPLUGGED, REVERSED = EncoderFault.UNPLUGGED, EncoderFault.REVERSED
PHASE_A, PHASE_B = EncoderFault.PHASE_A_DROPPED, EncoderFault.PHASE_B_DROPPED
PROVOKED = [
    ("encoder_left_lost", "unplugged, 0.35 m/s", CRUISE, fault(LEFT, UNPLUGGED), 50),
    ("encoder_right_lost", "unplugged, 0.60 m/s", FAST, fault(RIGHT, UNPLUGGED), 50),
    ("encoder_right_lost", "disc loose, 40 % effort", PUSH, fault(RIGHT, EncoderFault.FROZEN), 50),
    ("encoder_left_lost", "phase A dropped, 0.35 m/s", CRUISE, fault(LEFT, PHASE_A), 50),
    ("encoder_right_lost", "phase B dropped, 0.35 m/s", CRUISE, fault(RIGHT, PHASE_B), 50),
    ("encoder_left_lost", "unplugged from the start", FROM_REST, fault(LEFT, UNPLUGGED), 300),
    ("encoder_left_lost", "unplugged from the start, effort", PUSH_FROM_REST, fault(LEFT, UNPLUGGED), 300),
    ("encoder_left_reversed", "reversed at 0.35 m/s", CRUISE, fault(LEFT, REVERSED), 50),
    ("encoder_right_reversed", "reversed at 0.60 m/s", FAST, fault(RIGHT, REVERSED), 50),
    ("encoder_right_reversed", "reversed at 0.10 m/s", CRAWL, fault(RIGHT, REVERSED), 50),
    ("encoder_left_reversed", "reversed from the start", FROM_REST, fault(LEFT, REVERSED), 50),
    ("encoder_right_reversed", "reversed, effort, from rest", PUSH_FROM_REST, fault(RIGHT, REVERSED), 50),
    ("encoder_left_reversed", "reversed, 20 % effort, from rest", GENTLE_PUSH, fault(LEFT, REVERSED), 50),
    ("wheel_left_stalled", "held at 0.35 m/s", CRUISE, lambda r: r.hold_wheel(LEFT, 3.0), 550),
    ("wheel_right_stalled", "held at 40 % effort", PUSH, lambda r: r.hold_wheel(RIGHT, 3.0), 550),
    ("battery_unread", "converter dead", CRUISE, lambda r: r.set_adc_dead(True), 110),
    ("battery_low", "sense wire off", CRUISE, lambda r: r.set_battery_sense_connected(False), 300),
    ("battery_low", "supply at 8.5 V", CRUISE, lambda r: r.set_bench_voltage(8.5), 300),
]


@pytest.mark.parametrize(
    ("name", "how", "drive", "happens", "limit_ms"), PROVOKED, ids=[f"{p[0]}: {p[1]}" for p in PROVOKED]
)
def test_a_fault_that_is_provoked_stops_the_wheels_in_time_and_is_named(
    robot: VirtualRobot,
    name: str,
    how: str,
    drive: Drive,
    happens: Callable[[VirtualRobot], None],
    limit_ms: int,
) -> None:
    device = host(robot)
    if drive.after_s == 0.0:
        happens(robot)
    start(device, drive.kind, drive.left, drive.right)
    robot.run_us(round(drive.after_s * 1e6))
    assert device.status().state == tp.State.SEQUENCE
    if drive.after_s:
        happens(robot)
    took_ms = until_braked(robot)
    print(f"{name:24} {how:34} {took_ms:6.1f} ms")
    robot.run_us(50_000)
    assert latched(device) == {name}
    assert took_ms <= limit_ms
    robot.set_encoder_fault(LEFT, EncoderFault.GOOD)
    robot.set_encoder_fault(RIGHT, EncoderFault.GOOD)
    robot.hold_wheel(LEFT, 0.0)
    robot.hold_wheel(RIGHT, 0.0)
    robot.set_battery_sense_connected(True)
    robot.set_adc_dead(False)
    robot.set_bench_voltage(None)
    robot.run_us(800_000)
    clear_and_drive(device)


@pytest.mark.parametrize("after_s", [0.0, 1.0], ids=["from rest", "rolling"])
@pytest.mark.parametrize("speed", [0.03, 0.05, 0.10, 0.15, 0.25, 0.35, 0.60, 1.00])
@pytest.mark.parametrize("other", [1.0, -1.0, 0.0], ids=["straight", "pivot", "one wheel"])
def test_a_reversed_encoder_in_velocity_mode_is_caught_within_50_ms_or_at_a_crawl_within_15_mm(
    robot: VirtualRobot, speed: float, after_s: float, other: float
) -> None:
    device = host(robot)
    if after_s == 0.0:
        robot.set_encoder_fault(LEFT, REVERSED)
    start(device, tp.SegmentKind.VELOCITY, speed, other * speed)
    robot.run_us(round(after_s * 1e6))
    robot.set_encoder_fault(LEFT, REVERSED)
    radius_m = RobotParameters.msrp().left.radius_m
    from_rad = robot.truth().wheel_angle_rad[LEFT]
    took_ms = until_braked(robot)
    robot.run_us(50_000)
    rolled_mm = 1000 * radius_m * abs(robot.truth().wheel_angle_rad[LEFT] - from_rad)
    print(f"reversed at {speed:.2f} m/s: {took_ms:5.1f} ms, {rolled_mm:4.1f} mm until it stands")
    assert latched(device) == {"encoder_left_reversed"}
    assert took_ms <= 50 or (speed < 0.10 and rolled_mm <= 15)


EFFORTS = (0.15, 0.17, 0.2, 0.3, 0.5, 1.0)
OTHERS = pytest.mark.parametrize("other", [1.0, -1.0, 0.0], ids=["straight", "pivot", "one wheel"])


def travel_mm(robot: VirtualRobot) -> float:
    return 1000 * RobotParameters.msrp().left.radius_m * robot.truth().wheel_angle_rad[LEFT]


@OTHERS
@pytest.mark.parametrize("kind", [UNPLUGGED, REVERSED, PHASE_A, EncoderFault.FROZEN])
def test_an_encoder_that_fails_while_it_rolls_is_caught_within_50_ms_at_every_effort(
    image: Path, native_library: Path, kind: EncoderFault, other: float
) -> None:
    for effort in EFFORTS:
        with VirtualRobot(image) as robot:
            device = host(robot)
            start(device, tp.SegmentKind.EFFORT, effort, other * effort)
            robot.run_us(1_000_000)
            robot.set_encoder_fault(LEFT, kind)
            took_ms = until_braked(robot)
            print(f"{kind.name} rolling at {100 * effort:.0f} %: {took_ms:.1f} ms")
            assert took_ms <= 50
            name = "encoder_left_reversed" if kind == REVERSED else "encoder_left_lost"
            assert latched(device) == {name}


@OTHERS
def test_a_reversed_encoder_is_caught_from_rest_within_50_ms_or_a_millimetre(
    image: Path, native_library: Path, other: float
) -> None:
    """It takes three counts to tell: below 20 % of effort the wheel has not made them in 50 ms."""
    for effort in EFFORTS:
        with VirtualRobot(image) as robot:
            device = host(robot)
            robot.set_encoder_fault(LEFT, REVERSED)
            start(device, tp.SegmentKind.EFFORT, effort, other * effort)
            took_ms = until_braked(robot)
            rolled_mm = abs(travel_mm(robot))
            print(f"reversed from rest at {100 * effort:.0f} %: {took_ms:.1f} ms, {rolled_mm:.1f} mm")
            assert latched(device) == {"encoder_left_reversed"}
            assert took_ms <= 50 or (effort < 0.2 and took_ms <= 75 and rolled_mm <= 1.0)


@OTHERS
@pytest.mark.parametrize("effort", [0.25, 0.4, 0.6, 1.0])
def test_an_encoder_that_died_at_rest_is_caught_at_the_next_start(
    robot: VirtualRobot, effort: float, other: float
) -> None:
    """Before the first start nothing tells a dead encoder from a driver that answers late: 250 ms."""
    device = host(robot)
    device.arm()
    device.set_effort(0.5, 0.5 * other)
    robot.run_us(200_000)
    device.stop()
    robot.run_us(1_500_000)
    robot.set_encoder_fault(LEFT, UNPLUGGED)
    start(device, tp.SegmentKind.EFFORT, effort, other * effort)
    took_ms = until_braked(robot)
    print(f"dead since it stands, {100 * effort:.0f} %: {took_ms:.1f} ms")
    assert latched(device) == {"encoder_left_lost"}
    assert took_ms <= (50 if effort >= 0.6 else 90)


def test_a_supply_that_makes_the_wheels_too_fast_stops_them(image: Path, native_library: Path) -> None:
    strong = RobotParameters.msrp().changed(battery__full_v=24.0, battery__empty_v=22.0)
    with VirtualRobot(image, robot=strong) as robot:
        device = host(robot)
        start(device, tp.SegmentKind.EFFORT, 1.0, 1.0)
        until_braked(robot)
        speed = robot.truth().speed_mps
        print(f"overspeed: stopped at {speed:.2f} m/s")
        assert latched(device) == {"overspeed"}
        assert speed < 2.3


TIM3, CAN1_TX = 29, 19


@pytest.mark.parametrize("begins_us", range(0, 1000, 100))
def test_a_tick_that_is_lost_to_a_storm_of_interrupts_stops_the_wheels(
    robot: VirtualRobot, begins_us: int
) -> None:
    device = host(robot)
    start(device, tp.SegmentKind.EFFORT, 0.3, 0.3)
    robot.run_us(500_000 + begins_us)
    robot.set_interrupt_stuck(TIM3, True)
    robot.run_us(300)
    robot.set_interrupt_stuck(TIM3, False)
    robot.run_us(5000)
    assert latched(device) == set()  # a tick that is late, but comes
    robot.set_interrupt_stuck(TIM3, True)
    robot.run_us(2000)
    robot.set_interrupt_stuck(TIM3, False)
    took_ms = until_braked(robot)
    robot.run_us(1000)
    assert took_ms <= 2.0
    assert latched(device) == {"loop_overrun"}
    clear_and_drive(device)


UNEVEN = [(own, other) for own in (0.12, 0.15, 0.2, 0.3) for other in (-1.0, -0.4, 0.0, 0.5, 1.0)]


@pytest.mark.parametrize("yaw_share", [0.43, 0.6, 1.0])
def test_a_wheel_that_the_other_one_turns_back_from_rest_trips_nothing(
    image: Path, native_library: Path, yaw_share: float
) -> None:
    """`yaw_share`: yaw inertia over mass times half the wheelbase squared; 0.5 for a full disc."""
    inertia = yaw_share * 5.0 * (0.283 / 2) ** 2
    kind = RobotParameters.msrp().changed(chassis__mass_kg=5.0, chassis__yaw_inertia_kgm2=inertia)
    for own, other in UNEVEN:
        with VirtualRobot(image, robot=kind) as robot:
            device = host(robot)
            start(device, tp.SegmentKind.EFFORT, own, other)
            robot.run_us(1_000_000)
            assert latched(device) == set(), (own, other)


@pytest.mark.parametrize("wheel", [LEFT, RIGHT], ids=["left", "right"])
def test_counts_that_no_wheel_can_make_stop_the_wheels(robot: VirtualRobot, wheel: int) -> None:
    device = host(robot)
    start(device, tp.SegmentKind.EFFORT, 0.3, 0.3)
    robot.run_us(500_000)
    robot.turn_by_hand(wheel, turns=0.5, duration_s=0.02)  # as of a wheel at 10 m/s
    took_ms = until_braked(robot)
    assert latched(device) == {("encoder_left_implausible", "encoder_right_implausible")[wheel]}
    assert took_ms == 0.0
    robot.run_us(500_000)
    clear_and_drive(device)


def test_a_supply_that_was_low_must_rise_by_the_hysteresis_before_it_is_cleared(robot: VirtualRobot) -> None:
    device = host(robot)
    start(device, tp.SegmentKind.EFFORT, 0.3, 0.3)
    robot.run_us(500_000)
    robot.set_bench_voltage(8.8)
    until_braked(robot)
    robot.set_bench_voltage(9.3)  # above battery_low_v, 9.0, and not yet by battery_hysteresis_v, 0.5
    robot.run_us(1_000_000)
    with pytest.raises(Refused):
        device.clear_faults()
    assert latched(device) == {"battery_low"}
    robot.set_bench_voltage(9.7)
    robot.run_us(500_000)
    clear_and_drive(device)


def test_every_fault_of_the_schema_is_provoked_on_the_virtual_board() -> None:
    """Whoever adds a fault adds a test that names it; QEMU's, where nothing moves, do not count."""
    files = [path for path in Path(__file__).parent.glob("test_*.py") if "qemu" not in path.name]
    text = "".join(path.read_text(encoding="utf-8") for path in files)
    missing = [fault.name for fault in tp.FAULTS if f'"{fault.name}"' not in text]
    assert missing == []


def test_a_silent_host_stops_the_wheels(robot: VirtualRobot) -> None:
    device = host(robot)
    device.set_effort(0.3, 0.3)
    robot.run_us(1500)
    took_ms = until_braked(robot)
    print(f"host_silent: {took_ms:.0f} ms")
    assert 490 <= took_ms <= 510
    assert latched(device) == {"host_silent"}
    clear_and_drive(device)


def test_a_host_that_falls_silent_in_a_sequence_stops_the_wheels(robot: VirtualRobot) -> None:
    device = host(robot)
    device.start(device.upload(Plan("long", "", (Segment(Kind.EFFORT, 20.0, 0.3, 0.3),))))
    for _ in range(20):
        robot.run_us(400_000)
        assert device.status().state == tp.State.SEQUENCE
    took_ms = until_braked(robot)
    print(f"host_silent in a sequence: {took_ms:.0f} ms")
    assert 490 <= took_ms <= 501
    assert latched(device) == {"host_silent"}
    clear_and_drive(device)


def test_a_brown_out_is_named_after_the_restart_and_forgotten_on_command(robot: VirtualRobot) -> None:
    device = host(robot)
    start(device, tp.SegmentKind.EFFORT, 0.3, 0.3)
    robot.run_us(500_000)
    robot.reset(ResetCause.BROWNOUT)
    robot.run_us(1_000_000)
    assert (robot.bridge(LEFT), robot.bridge(RIGHT)) == BRAKE
    device = host(robot)
    assert device.info.reset_cause == "brown_out"
    assert latched(device) == {"brown_out"}
    clear_and_drive(device)
    assert device.status().active == ()


def test_a_power_cycle_is_no_brown_out(robot: VirtualRobot) -> None:
    host(robot)
    robot.power_cycle()
    robot.run_us(400_000)
    device = host(robot)
    assert device.info.reset_cause == "power_on"
    assert device.status().active == ()


def test_a_program_fault_keeps_its_registers_through_the_reset_and_forbids_to_move(
    robot: VirtualRobot, image: Path
) -> None:
    device = host(robot)
    assert device.fault_record() is None
    start(device, tp.SegmentKind.EFFORT, 0.3, 0.3)
    robot.run_us(500_000)
    # A sequence that claims to be longer than memory sends its check where there is none.
    write_sequence(robot, image, "audited", struct.pack("<H", 60_000))
    write_sequence(robot, image, "segment_count", struct.pack("<H", 65_535))
    took_ms = until_braked(robot)
    print(f"program_fault: {took_ms:.1f} ms")
    robot.run_us(1_000_000)
    device = host(robot)
    assert device.info.reset_cause == "software"
    assert latched(device) == {"program_fault"}
    record = device.fault_record()
    assert record is not None
    assert record.exception == "BusFault"
    assert record.address is not None
    assert record.address > 0x20020000
    assert "data read or written at a dead address" in record.reasons
    at, size = robot.symbol("sequence_audit")
    assert any(at <= place < at + size + 400 for place in (record.pc, record.lr))
    print("\n".join(record.lines()))
    clear_and_drive(device)
    assert device.fault_record() == record
    robot.reset(ResetCause.PIN)
    robot.run_us(300_000)
    assert latched(host(robot)) == set()


def write_sequence(robot: VirtualRobot, image: Path, member: str, data: bytes) -> None:
    write_robot(robot, image, data, "sequence", member)


def write_robot(robot: VirtualRobot, image: Path, data: bytes, *members: str) -> None:
    """Into a member of the controller's robot; of an array's first element."""
    address, _ = robot.symbol("controller")
    offset, _ = member_offset(image, "controller", "robot", *members)
    robot.write_memory(address + offset, data)


def test_a_sequence_that_changes_in_memory_is_stopped(robot: VirtualRobot, image: Path) -> None:
    device = host(robot)
    start(device, tp.SegmentKind.EFFORT, 0.3, 0.3)
    robot.run_us(500_000)
    write_sequence(robot, image, "segments", b"\x01")
    took_ms = until_braked(robot)
    print(f"sequence_damaged: {took_ms:.1f} ms")
    assert took_ms < 10
    assert latched(device) == {"sequence_damaged"}
    clear_and_drive(device)


NUMBERS = [
    ("drive", "command"),
    ("drive", "control", "integral"),
    ("tuning", "gains", "kp"),
    ("tuning", "effort_limit"),
    ("tuning", "metres_per_count"),
]


@pytest.mark.parametrize("number", NUMBERS, ids=[" ".join(number) for number in NUMBERS])
def test_a_number_in_control_that_becomes_nan_brakes_and_is_named(
    robot: VirtualRobot, image: Path, number: tuple[str, ...]
) -> None:
    device = host(robot)
    start(device, tp.SegmentKind.VELOCITY, 0.35, 0.35)
    robot.run_us(1_000_000)
    write_robot(robot, image, struct.pack("<f", float("nan")), *number)
    took_ms = until_braked(robot)
    print(f"control_not_finite: {' '.join(number):24} {took_ms:.1f} ms")
    assert took_ms <= 1.2
    robot.run_us(50_000)
    assert (robot.bridge(LEFT), robot.bridge(RIGHT)) == BRAKE
    assert latched(device) == {"control_not_finite"}
    robot.run_us(2_000_000)
    device.load_parameters()
    robot.run_us(2000)
    clear_and_drive(device)


def test_a_main_loop_that_stands_for_a_moment_stops_the_wheels_and_is_named(robot: VirtualRobot) -> None:
    device = host(robot)
    start(device, tp.SegmentKind.EFFORT, 0.3, 0.3)
    robot.run_us(500_000)
    robot.set_interrupt_stuck(CAN1_TX, True)  # of the tick's own level: ticks go on
    took_ms = until_braked(robot)
    robot.run_us(3000)
    robot.set_interrupt_stuck(CAN1_TX, False)
    print(f"main_loop_hung: {took_ms:.1f} ms")
    assert 39 <= took_ms <= 42
    robot.run_us(10_000)
    assert latched(device) == {"main_loop_hung"}
    assert device.info.boot_id == host(robot).info.boot_id
    clear_and_drive(device)


@pytest.mark.parametrize("hold_ms", [100, 250])
@pytest.mark.parametrize("drive", [CRUISE, PUSH], ids=["velocity", "effort"])
def test_a_wheel_that_is_held_for_a_moment_drives_on(robot: VirtualRobot, drive: Drive, hold_ms: int) -> None:
    device = host(robot)
    start(device, drive.kind, drive.left, drive.right)
    robot.run_us(1_000_000)
    robot.hold_wheel(LEFT, 3.0)
    robot.run_us(hold_ms * 1000)
    robot.hold_wheel(LEFT, 0.0)
    robot.run_us(1_000_000)
    assert device.status().state == tp.State.SEQUENCE
    assert latched(device) == set()


REVERSALS = [
    (tp.SegmentKind.EFFORT, 1.0, 1.0),
    (tp.SegmentKind.EFFORT, 1.0, -1.0),
    (tp.SegmentKind.EFFORT, 0.2, 0.6),
    (tp.SegmentKind.EFFORT, 0.3, 0.0),
    (tp.SegmentKind.VELOCITY, 0.6, 0.6),
    (tp.SegmentKind.VELOCITY, 0.6, -0.6),
    (tp.SegmentKind.VELOCITY, 0.05, 0.4),
    (tp.SegmentKind.VELOCITY, 0.3, 0.0),
]


@pytest.mark.parametrize("payload", [1.0, 4.0], ids=["5 kg", "20 kg"])
def test_reversals_at_any_moment_trip_nothing(image: Path, native_library: Path, payload: float) -> None:
    robot = RobotParameters.msrp()
    heavy = robot.changed(chassis__mass_kg=5.0 * payload, chassis__yaw_inertia_kgm2=0.06 * payload)
    segments = tuple(
        tp.Segment(kind, ms, sign * a, sign * b)
        for ms in (130, 420, 1100)
        for kind, a, b in REVERSALS
        for sign in (1, -1, 1)
    )
    crc = zlib.crc32(b"".join(segment.pack() for segment in segments))
    with VirtualRobot(image, robot=heavy) as virtual:
        device = host(virtual)
        device.client.request(tp.SeqBeginRequest(len(segments), 20))
        for first in range(0, len(segments), 60):
            device.client.request(tp.SeqSegmentsRequest(first, segments[first : first + 60]))
        device.client.request(tp.SeqCommitRequest(crc))
        device.arm()
        device.client.request(tp.SeqStartRequest(crc, 1))
        while device.status().state == tp.State.SEQUENCE:
            virtual.run_us(100_000)
        at = device.sequence_state()
        assert latched(device) == set(), segments[at.current_segment]
        assert at.sequence_state == tp.SequenceState.DONE


def test_a_sequence_begins_once_the_wheels_of_the_one_before_have_come_to_rest(robot: VirtualRobot) -> None:
    device = host(robot)
    sequence = device.upload(Plan("sprint", "", (Segment(Kind.EFFORT, 1.5, 0.9, 0.9),)))
    device.start(sequence, unattended=True)
    while device.status().state == tp.State.SEQUENCE:
        robot.run_us(20_000)
    ended_s = robot.time_s
    assert min(device.status().speed_mps) > 0.5
    with pytest.raises(Refused, match="implausible"):
        device.client.request(tp.SeqStartRequest(sequence.crc32, 1))
    device.start(sequence, unattended=True)
    print(f"began {robot.time_s - ended_s:.2f} s after the end of the one before")
    assert 0.1 < robot.time_s - ended_s < 2.5
    assert latched(device) == set()
    assert device.status().state == tp.State.SEQUENCE


def test_no_plan_that_truing_brings_along_trips_a_fault(image: Path, native_library: Path) -> None:
    plans = [load_plan(name) for name in built_in_names()]
    assert len(plans) == 31
    for plan in plans:
        assert faults_of(image, plan) == set(), plan.name
    print(f"{len(plans)} plans, no fault")


def faults_of(image: Path, plan: Plan, robot: RobotParameters | None = None) -> set[str]:
    with VirtualRobot(image, robot=robot) as virtual:
        device = host(virtual)
        device.start(device.upload(plan), unattended=True)
        while device.status().state == tp.State.SEQUENCE:
            virtual.run_us(200_000)
        status = device.status()
        return {fault.name for fault in status.latched + status.active}
