"""A slow wheel with a coarse encoder turns evenly, and its edges cost the same at any speed."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from hil_sim import EncoderFault, EncoderNoise, VirtualRobot
from hil_sim.plant import RobotParameters
from support.crawl import crawl
from truing.board.device import Device
from truing.link.client import Client
from truing.link.virtual_stream import VirtualStream
from truing.plan import Kind, Plan, Segment

TIM3, TIM4 = 16 + 29, 16 + 30
SPEEDS_MPS = (0.02, 0.03, 0.05, 0.07, 0.10)

# The first tick comes at 14.638 ms: bursts across every tick's work, or in the middle between two.
AT_TICKS = EncoderNoise(period_us=1000, first_us=14_600, burst_us=60, pulse_ns=1000)
BETWEEN_TICKS = EncoderNoise(period_us=1000, first_us=15_100, burst_us=60, pulse_ns=2500)
SLOW_EDGES = EncoderNoise(rise_ns=20_000, bounce_ns=700)
NOISES = {"at ticks": AT_TICKS, "between ticks": BETWEEN_TICKS, "slow edges": SLOW_EDGES}


@pytest.mark.parametrize("speed_mps", SPEEDS_MPS)
def test_64_counts_a_turn_ripple_a_third_of_plain_counts_and_never_stall(
    image: Path, native_library: Path, speed_mps: float
) -> None:
    plain = crawl(image, speed_mps, from_edges=False)
    edges = crawl(image, speed_mps, from_edges=True)
    for name, result in (("counts", plain), ("edges", edges)):
        print(
            f"{speed_mps:.2f} m/s from {name}: ripple {1e3 * result.ripple_mps:.2f} mm/s rms, mean "
            f"{result.mean_mps:.4f}, from {result.slowest_mps:.4f} to {result.fastest_mps:.4f} m/s"
        )
    assert edges.ripple_mps <= plain.ripple_mps / 3
    assert edges.ripple_mps <= 0.1 * speed_mps
    assert edges.slowest_mps > 0.7 * speed_mps
    assert edges.fastest_mps < 1.5 * speed_mps


@pytest.mark.parametrize(
    ("speed_mps", "noise"), [(0.03, "at ticks"), (0.10, "between ticks"), (0.10, "slow edges")]
)
def test_glitches_and_slow_edges_leave_a_crawl_as_even_as_it_was(
    image: Path, native_library: Path, speed_mps: float, noise: str
) -> None:
    result = crawl(image, speed_mps, from_edges=True, noise=NOISES[noise])
    print(f"{speed_mps:.2f} m/s, {noise}: ripple {1e3 * result.ripple_mps:.2f} mm/s rms")
    assert result.ripple_mps <= 0.1 * speed_mps
    assert result.slowest_mps > 0.7 * speed_mps
    assert result.fastest_mps < 1.5 * speed_mps


@pytest.mark.parametrize("noise", ["none", *NOISES])
def test_the_measured_speed_is_as_exact_with_glitches_as_without(
    image: Path, native_library: Path, noise: str
) -> None:
    """At 0.15 m/s, on the paper's disc, whose edges are up to 0.15 count off their places."""
    with VirtualRobot(image) as robot:
        for wheel in (0, 1):
            robot.set_encoder_noise(wheel, NOISES.get(noise, EncoderNoise()))
        device = hold(robot, 0.15)
        robot.run_us(2_000_000)
        errors = []
        for _ in range(1500):
            robot.run_us(1000)
            errors.append(measured_mps(robot, image) / true_mps(robot) - 1.0)
        rms, mean = float(np.std(errors)), float(np.mean(errors))
        print(f"{noise}: {100 * rms:.1f} % rms, {100 * mean:+.2f} % mean")
        assert rms < 0.03
        assert abs(mean) < 0.01
        assert device.status().stray_edges == (0, 0)
        device.stop()


def test_pulses_that_outlast_the_filters_are_counted_and_shown(image: Path, native_library: Path) -> None:
    with VirtualRobot(image) as robot:
        device = Device(Client(VirtualStream(robot)))
        before = device.status()
        robot.set_encoder_noise(1, EncoderNoise(1000, round(robot.time_us) + 500, 60, 5000))
        robot.run_us(100_000)
        after = device.status()
        assert after.counts == before.counts
        assert after.stray_edges[0] == 0
        assert 95 <= after.stray_edges[1] <= 105  # one a tick, however many pulses come


def hold(robot: VirtualRobot, speed_mps: float) -> Device:
    device = Device(Client(VirtualStream(robot)))
    device.client.stream.sleep(0.3)
    segments = (Segment(Kind.VELOCITY, 20.0, speed_mps, speed_mps),)
    device.start(device.upload(Plan("hold", "hold", segments)), unattended=True)
    return device


def measured_mps(robot: VirtualRobot, image: Path) -> float:
    """Return the left wheel's speed as velocity mode takes it."""
    from support.image_variable import member_offset

    offset, size = member_offset(image, "controller", "robot", "speed")
    memory = robot.read_memory(robot.symbol("controller")[0] + offset, size)
    return float(struct.unpack_from("<f", memory)[0])


def true_mps(robot: VirtualRobot) -> float:
    """Return the left wheel's true speed."""
    return robot.truth().wheel_speed_radps[0] * RobotParameters.msrp().left.radius_m


def test_edges_interrupt_once_a_tick_and_wheel_at_top_speed(image: Path, native_library: Path) -> None:
    with VirtualRobot(image) as robot:
        device = hold(robot, 1.4)
        robot.run_us(3_000_000)
        before = [robot.cost(n) for n in (TIM3, TIM4)]
        counts = device.status().counts
        began = robot.time_us
        robot.run_us(1_000_000)
        after = [robot.cost(n) for n in (TIM3, TIM4)]
        span_s = (robot.time_us - began) * 1e-6
        rate = [(now - then) / span_s for now, then in zip(device.status().counts, counts, strict=True)]
        activations = sum(b.activations - a.activations for a, b in zip(before, after, strict=True))
        cycles = sum(b.cycles - a.cycles for a, b in zip(before, after, strict=True))
        load = cycles / robot.stats().cpu_hz / span_s
        worst_us = max(b.worst_cycles for b in after) / (robot.stats().cpu_hz / 1e6)
        print(
            f"{rate[0]:.0f} and {rate[1]:.0f} counts/s: {activations} interrupts a second, "
            f"{100 * load:.3f} % of the CPU, {worst_us:.2f} us worst"
        )
        assert min(rate) > 8000
        assert 1800 <= activations <= 2004  # the ends of the second lie anywhere in a tick
        assert load < 0.005
        assert worst_us < 1.0


def test_dated_edges_lie_within_a_microsecond_of_where_the_wheel_was(
    image: Path, native_library: Path
) -> None:
    """Speed from dated edges of an even disc repeats to 0.1 %, where a tick's resolution would give 6 %."""
    even = RobotParameters.msrp().changed(
        left__encoder__edge_error_count=0.0, right__encoder__edge_error_count=0.0
    )
    with VirtualRobot(image, robot=even) as robot:
        device = hold(robot, 0.3)
        robot.run_us(4_000_000)
        errors = []
        for _ in range(500):
            robot.run_us(1000)
            errors.append(abs(measured_mps(robot, image) / true_mps(robot) - 1.0))
        print(f"speed from edges differs from the truth by {100 * max(errors):.3f} % at most")
        assert max(errors) < 0.01
        device.stop()


@pytest.mark.parametrize("fault", [EncoderFault.PHASE_A_DROPPED, EncoderFault.UNPLUGGED])
def test_an_encoder_that_dithers_or_rests_has_no_speed(
    image: Path, native_library: Path, fault: EncoderFault
) -> None:
    with VirtualRobot(image) as robot:
        device = hold(robot, 0.3)
        robot.run_us(2_000_000)
        robot.set_encoder_fault(0, fault)
        robot.run_us(200_000)
        assert abs(measured_mps(robot, image)) < 0.01
        device.stop()


def test_how_time_is_cut_into_calls_changes_no_edge(image: Path, native_library: Path) -> None:
    hashes = []
    for slices in (1, 977):
        with VirtualRobot(image) as robot:
            hold(robot, 0.2)
            total = 3_000_000
            while robot.time_us < 4_000_000:
                robot.run_us(min(total // slices, 4_000_000 - robot.time_us))
            hashes.append((robot.trace_hash(), robot.cost(TIM4).activations))
    assert hashes[0] == hashes[1]
    assert hashes[0][1] > 500
