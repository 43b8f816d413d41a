"""Crystals and oscillators that are not what the image is made for, and the first silicon."""

from __future__ import annotations

import contextlib
import re
import subprocess
from pathlib import Path

import pytest

import truing_protocol as tp
from hil_sim import Oscillators, VirtualCanBus, VirtualRobot
from hil_sim.can_bus import CanFrame
from support.driving import host
from truing.board.device import Device

CRYSTAL_HZ, INTERNAL_HZ = 168_000_000, 158_000_000
HSI_HZ = {"slowest": 14_720_000, "1 % slow": 15_840_000, "nominal": 16_000_000, "fastest": 16_720_000}
MHZ_LIMIT = 168.2  # 168 MHz with a crystal's tolerance
USART3_BRR, FLASH_ACR, RCC_CR, RCC_CFGR = 0x4000_4808, 0x4002_3C00, 0x4002_3800, 0x4002_3808
PREFETCH, CACHES = 1 << 8, 3 << 9


def started(robot: VirtualRobot, hz: int, hsi_hz: int = 16_000_000) -> float:
    """Start the board with such oscillators; return the fastest clock of its CPU on the way, MHz."""
    robot.set_power(False)
    robot.set_crystal_hz(hz)
    robot.set_hsi_hz(hsi_hz)
    robot.set_power(True)
    fastest = 0
    for _ in range(400):
        robot.run_us(50)
        fastest = max(fastest, robot.stats().cpu_hz)
    robot.run_us(280_000)
    return fastest / 1e6


def active(device: Device) -> set[str]:
    return {fault.name for fault in device.status().active}


@pytest.mark.parametrize("hsi", HSI_HZ)
@pytest.mark.parametrize("hz", [7_996_000, 8_000_000, 8_004_000])
def test_the_right_crystal_is_taken_whatever_the_internal_oscillator_does(
    robot: VirtualRobot, hz: int, hsi: str
) -> None:
    assert started(robot, hz, HSI_HZ[hsi]) <= MHZ_LIMIT
    device = host(robot)
    assert device.info.clock_source == "crystal_pll"
    assert active(device) == set()
    assert robot.warnings() == []


@pytest.mark.parametrize("hsi", HSI_HZ)
@pytest.mark.parametrize("hz", [4_000_000, 6_000_000, 12_000_000, 16_000_000, 25_000_000, 26_000_000])
def test_another_crystal_is_named_and_never_reaches_the_pll(robot: VirtualRobot, hz: int, hsi: str) -> None:
    fastest = started(robot, hz, HSI_HZ[hsi])
    print(f"{hz / 1e6:g} MHz, internal oscillator {hsi}: the CPU runs at {fastest:.2f} MHz")
    assert fastest <= MHZ_LIMIT
    assert robot.stats().cpu_hz == INTERNAL_HZ * HSI_HZ[hsi] // 16_000_000
    if abs(HSI_HZ[hsi] / 16e6 - 1) < 0.03:  # otherwise the line garbles
        device = host(robot)
        assert device.info.clock_source == "internal_pll"
        assert active(device) == {"clock_fallback", "crystal_wrong"}
        device.set_effort(0.2, 0.2)
        robot.run_us(300_000)
        assert robot.truth().speed_mps > 0.1
    assert robot.read_register(RCC_CR) & 1 << 16 == 0, "the crystal is switched off"
    assert robot.read_register(RCC_CFGR) >> 16 & 0x1F == 0, "HSE_RTC is off"
    assert robot.warnings() == []


@pytest.mark.parametrize(("hz", "taken"), [(7_372_800, False), (8_192_000, True), (9_216_000, False)])
def test_how_near_to_8_mhz_another_crystal_is_noticed(robot: VirtualRobot, hz: int, taken: bool) -> None:
    fastest = started(robot, hz)
    print(f"{hz / 1e6:g} MHz: the CPU runs at {fastest:.2f} MHz")
    device = host(robot)
    assert device.info.clock_source == ("crystal_pll" if taken else "internal_pll")
    assert ("crystal_wrong" in active(device)) != taken
    assert fastest < 1.03 * 168


@pytest.mark.parametrize("trouble", ["no crystal", "a crystal of 12 MHz"])
def test_without_its_crystal_the_board_is_silent_on_can_and_says_so(
    image: Path, native_library: Path, trouble: str
) -> None:
    with VirtualRobot(image, crystal=trouble != "no crystal") as board, VirtualRobot(image, seed=2) as other:
        if trouble != "no crystal":
            started(board, 12_000_000)
            other.run_us(board.time_us)
        with contextlib.closing(VirtualCanBus()) as bus:
            bus.attach(board)
            bus.attach(other)
            bus.run_us(300_000)
            for _ in range(10):
                bus.write(CanFrame(0x600, bytes((tp.HelloRequest.ID,))))
                bus.run_us(100_000)
            announced = [frame.id for frame in iter(bus.read, None)].count(0x681)
            totals = bus.totals()
            assert announced == 10, "once for each call, by the other board of node 1"
            assert (totals.damaged, totals.unacknowledged) == (0, 0)
            state = host(board).client.request(tp.CanStateRequest())
            assert state.bus_state == tp.CanBusState.NO_CRYSTAL
            assert (state.frames_sent, state.frames_received) == (0, 0)
            bus.detach(board)
            bus.detach(other)


@pytest.mark.parametrize("crystal", [True, False])
@pytest.mark.parametrize("pll", [True, False])
def test_the_line_is_within_2_per_cent_of_its_rate_from_every_clock(
    image: Path, native_library: Path, crystal: bool, pll: bool
) -> None:
    with VirtualRobot(image, crystal=crystal) as robot:
        robot.set_pll_dead(not pll)
        robot.power_cycle()
        robot.run_us(300_000)
        cpu_hz = robot.stats().cpu_hz
        assert cpu_hz == (16_000_000 if not pll else CRYSTAL_HZ if crystal else INTERNAL_HZ)
        bus_hz = cpu_hz // (4 if pll else 1)
        nominal = 921_600 if pll else 460_800
        error = bus_hz / robot.read_register(USART3_BRR) / nominal - 1
        print(f"CPU {cpu_hz / 1e6:g} MHz: {nominal} baud, {error:+.2%}")
        assert abs(error) <= 0.02
        robot.set_link_baud(nominal)
        device = host(robot)
        assert device.info.clock_source == (
            "internal" if not pll else "crystal_pll" if crystal else "internal_pll"
        )
        assert device.client.counts.retries == 0


@pytest.mark.parametrize("seed", range(1, 9))
def test_a_chip_with_any_oscillators_within_their_tolerances_starts_and_drives(
    image: Path, native_library: Path, seed: int
) -> None:
    """Its time is the crystal's, however far off the two that start-up and watchdog run from are."""
    oscillators = Oscillators.drawn(seed)
    print(oscillators)
    with VirtualRobot(image, oscillators=oscillators) as robot:
        device = host(robot)
        assert device.info.clock_source == "crystal_pll"
        assert active(device) == set()
        began_ms, began_us = device.client.request(tp.StatusRequest()).uptime_ms, robot.time_us
        for _ in range(20):
            device.set_effort(0.3, 0.3)
            robot.run_us(100_000)
        status = device.client.request(tp.StatusRequest())
        passed_ms = (robot.time_us - began_us) / 1000 * (1 + oscillators.crystal_ppm * 1e-6)
        assert status.uptime_ms - began_ms == pytest.approx(passed_ms, abs=1.5)
        assert status.faults_latched == 0
        assert robot.truth().speed_mps > 0.2
        assert robot.stats().resets == 1
        assert robot.warnings() == []


@pytest.mark.parametrize("seed", range(1, 5))
def test_without_a_crystal_the_line_holds_at_25_c(image: Path, native_library: Path, seed: int) -> None:
    oscillators = Oscillators.drawn(seed, at_25_c=True)
    with VirtualRobot(image, crystal=False, oscillators=oscillators) as robot:
        robot.run_us(100_000)  # it waits for the crystal first
        device = host(robot)
        assert device.info.clock_source == "internal_pll"
        assert active(device) == {"clock_fallback"}
        assert device.client.counts.retries == 0


@pytest.mark.parametrize(
    ("idcode", "prefetches"),
    [
        (0x1000_6413, False),  # revision A, as the manual has it
        (0x2000_6411, False),  # revision A, as it reads itself
        (0x1001_6413, True),  # Z
        (0x1003_6413, True),  # Y
        (0x1007_6413, True),  # 1
        (0x1000_6419, False),  # another chip
    ],
)
def test_the_first_silicon_does_not_prefetch(robot: VirtualRobot, idcode: int, prefetches: bool) -> None:
    robot.set_idcode(idcode)
    robot.power_cycle()
    robot.run_us(300_000)
    access = robot.read_register(FLASH_ACR)
    assert bool(access & PREFETCH) == prefetches
    assert access & CACHES == CACHES
    assert host(robot).info.clock_source == "crystal_pll"


HANDLERS = (
    "PVD_Handler",
    "SerialStream_Handler",
    "Serial_Handler",
    "CAN1_TX_Handler",
    "CAN1_RX0_Handler",
    "CAN1_SCE_Handler",
)


@pytest.mark.parametrize("handler", HANDLERS)
def test_a_handler_returns_only_when_its_flag_has_fallen(image: Path, handler: str) -> None:
    """No store lies between its last DSB and any of its returns; otherwise it would be entered twice."""
    text = subprocess.run(
        ["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", f"--disassemble={handler}", image],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    code = re.findall(r"^ +[0-9a-f]+:\t(\S+)(?:\t(.*))?$", text, re.MULTILINE)
    assert len(code) > 4
    returns = [
        at
        for at, (name, operands) in enumerate(code)
        if (name, operands) == ("bx", "lr") or (name.startswith(("pop", "ldmia")) and "pc" in operands)
    ]
    assert returns, f"{handler} returns by a jump: look at it"
    for at in returns:
        before = [name for name, _ in code[:at]]
        last = max((k for k, name in enumerate(before) if name == "dsb"), default=-1)
        assert last >= 0, f"no DSB before a return of {handler}"
        assert not [name for name in before[last:] if name.startswith(("str", "stm"))]
