"""The virtual board's peripherals do at the pins what the reference manual says."""

from __future__ import annotations

import math

import pytest

from hil_sim import EncoderFault, ResetCause

PCLK1_HZ = 42e6
COUNTS_PER_REV = 2400


def drive(b, left, right):
    """Slow decay: one input high, the other low for the effort's share."""
    for i, effort in enumerate((left, right)):
        low = round(8400 * (1 - abs(effort)))
        one, two = (8400, low) if effort >= 0 else (low, 8400)
        b.put("set", one, 2 * i)
        b.put("set", two, 2 * i + 1)


@pytest.fixture
def running(board):
    """A board at 168 MHz with everything on, wheels braked."""
    b = board("peripherals")
    b.run_us(5_000)
    drive(b, 0, 0)
    b.run_us(5_000)
    assert b.word("stray") == 0
    return b


def test_a_clean_image_leaves_no_warning(running):
    running.run_us(100_000)
    assert running.warnings() == []
    assert running.stats().cpu_hz == 168_000_000


@pytest.mark.parametrize("compare", [0, 1, 2100, 4200, 8399, 8400, 9000])
def test_pwm_duty_at_the_pin_is_compare_over_period(running, compare):
    running.put("set", compare, 2)
    running.run_us(3000)
    assert running.bridge(1)[0] == min(1.0, compare / 8400)


def test_pwm_polarity_turns_the_duty_over(running):
    running.put("set", 2100, 0)
    running.put("set", 1, 5)
    running.run_us(3000)
    assert running.bridge(0) == (1 - 0.25, 0.0)


def test_outputs_are_released_when_the_main_output_is_off_or_the_pin_is_not_the_timers(running):
    running.put("set", 0, 6)
    running.run_us(3000)
    assert running.bridge(0) == (-1, -1)
    running.put("set", 1, 6)
    running.put("set", 0, 7)
    running.run_us(3000)
    assert running.bridge(0) == (-1, -1)
    running.put("set", 1, 7)
    running.run_us(3000)
    assert running.bridge(0) == (1, 1)


def true_counts(b):
    return [a / (2 * math.pi) * COUNTS_PER_REV for a in b.truth().wheel_angle_rad]


def signed(count):
    return count - 0x10000 if count & 0x8000 else count


def test_encoders_count_both_directions_as_the_wheels_turn(running):
    drive(running, 0.5, -0.5)
    running.run_us(1_000_000)
    left, right = (signed(c) for c in running.words("get")[3:5])
    # The last tick is at most a millisecond old, and edges may be half a count off their place.
    speed = abs(running.truth().wheel_speed_radps[0]) / (2 * math.pi) * COUNTS_PER_REV
    assert left == pytest.approx(true_counts(running)[0], abs=speed * 1e-3 + 1.5)
    assert right == pytest.approx(true_counts(running)[1], abs=speed * 1e-3 + 1.5)
    assert left > 100
    assert right < -100


def test_an_encoder_counter_wraps_at_16_bits(board):
    b = board("peripherals")
    b.run_us(1)
    b.put("set", 0xFFF0, 8)
    b.put("set", 0x0010, 9)
    b.run_us(5_000)
    drive(b, 0.5, -0.5)
    b.run_us(500_000)
    left, right = b.words("get")[3:5]
    assert 0 < left < 0x8000
    assert 0x8000 < right < 0xFFFF


@pytest.mark.parametrize(
    ("fault", "span"),
    [
        (EncoderFault.UNPLUGGED, 0),
        (EncoderFault.FROZEN, 0),
        (EncoderFault.PHASE_A_DROPPED, 1),
        (EncoderFault.PHASE_B_DROPPED, 1),
    ],
)
def test_a_broken_encoder_stops_counting_without_a_jump(running, fault, span):
    drive(running, 0.5, 0.5)
    running.run_us(300_000)
    running.set_encoder_fault(0, fault)
    before = running.words("get")[3]
    seen = set()
    for _ in range(200):
        running.run_us(1000)
        seen.add(running.words("get")[3])
    assert max(seen) - min(seen) <= span
    assert abs(min(seen) - before) <= 5
    assert running.words("get")[4] > before  # the other wheel goes on


def test_a_reversed_encoder_counts_backwards(running):
    running.set_encoder_fault(0, EncoderFault.REVERSED)
    drive(running, 0.5, 0.5)
    running.run_us(300_000)
    left, right = (signed(c) for c in running.words("get")[3:5])
    assert left < -100 < 100 < right


def test_swapped_motors_turn_the_other_wheel(running):
    running.set_motors_swapped(True)
    drive(running, 0.5, 0.0)
    running.run_us(300_000)
    left, right = (signed(c) for c in running.words("get")[3:5])
    assert right > 100 > abs(left)


@pytest.mark.parametrize("volts", [0.0, 3.3, 12.0, 24.0, 36.3, 50.0])
def test_the_adc_reads_the_battery_through_the_divider(running, volts):
    running.set_bench_voltage(volts)
    running.run_us(3000)
    assert running.words("get")[5] == min(4095, int(volts / 11 / 3.3 * 4096 + 1e-9))


def test_a_conversion_takes_its_sampling_time_and_twelve_cycles(running):
    running.run_us(3000)
    wanted = (56 + 12) * 8  # ADC clock 21 MHz, CPU 168 MHz
    assert wanted <= running.words("get")[6] <= wanted + 60


def test_bytes_leave_at_921600_baud_one_after_the_other(running):
    bit_s = 46 / PCLK1_HZ  # the nearest divider: 913043 baud
    running.link_read()
    running.put("send_count", 1000)
    started = None
    arrived = 0
    for _ in range(16_000):
        running.run_us(1)
        n = len(running.link_read())
        if n and started is None:
            started = running.time_us
        arrived += n
        if arrived == 1000:
            break
    assert arrived == 1000
    assert running.time_us - started == pytest.approx(999 * 10 * bit_s * 1e6, abs=2)


def test_bytes_come_in_at_921600_baud_and_none_is_lost(running):
    data = bytes(range(256)) * 4
    running.link_write(data)
    took = len(data) * 10 / 921600 * 1e6
    running.run_us(int(took) - 20)
    assert running.link_pending() > 0
    running.run_us(60)
    assert running.link_pending() == 0
    assert running.read_memory(running.symbol("inbox")[0], len(data)) == data
    received, overruns, errors = running.words("get")[7:10]
    assert (received, overruns, errors) == (len(data), 0, 0)


def test_a_byte_at_the_wrong_speed_is_garbled_and_said_so(running):
    running.set_link_baud(921600 * 1.08)
    running.link_write(b"\x55" * 20)
    running.run_us(2000)
    assert running.read_memory(running.symbol("inbox")[0], 20) != b"\x55" * 20
    assert running.words("get")[9] > 0
    assert any("baud" in w.text for w in running.warnings())


def test_a_reset_tells_its_cause_and_keeps_sram(board):
    b = board("resets")
    b.run_us(1000)
    assert b.word("boots") == 1
    assert b.word("cause") & 0xFE000000 == 0x0E000000  # power-on
    b.put("command", 1)
    b.run_us(1000)
    assert b.word("boots") == 2
    assert b.word("cause") & 0xFE000000 == 0x14000000  # software
    b.reset(ResetCause.PIN)
    b.run_us(1000)
    assert b.word("cause") & 0xFE000000 == 0x04000000
    assert b.word("boots") == 3
    b.reset(ResetCause.BROWNOUT)
    b.run_us(1000)
    assert b.word("cause") & 0xFE000000 == 0x06000000


def test_a_starved_watchdog_resets_after_its_time(board):
    b = board("resets")
    b.run_us(1000)
    b.put("command", 2)
    b.run_us(500_000)
    assert b.word("boots") == 1, "fed, it stays quiet"
    b.put("command", 3)
    b.run_us(99_000)
    assert b.word("boots") == 1
    b.run_us(2_000)
    assert b.word("boots") == 2
    assert b.word("cause") & 0xFE000000 == 0x24000000


def test_power_on_finds_noise_in_sram_that_the_seed_decides(board):
    def noise(b):
        return b.read_memory(0x20010000, 256)

    one, again, other = board("resets"), board("resets"), board("resets", seed=2)
    assert noise(one) == noise(again) != noise(other)
    first = noise(one)
    one.power_cycle()
    assert noise(one) != first


def test_flash_erases_and_programs_with_the_times_of_the_datasheet(board):
    b = board("flash")
    b.run_us(1000)
    assert b.word("refused") == 0xFFFFFFFF
    assert b.read_memory(0x08004000, 4) == b"\xff" * 4, "a locked array keeps its content"
    assert b.word("status") & 1 << 7
    b.put("command", 1)
    b.run_us(400_000)
    assert b.word("state") == 1
    assert b.word("erase_cycles") == pytest.approx(0.25 * 16e6, rel=0.001)
    b.put("command", 2)
    b.run_us(1000)
    assert b.word("program_cycles") == pytest.approx(16e-6 * 16e6, abs=60)
    assert b.read_memory(0x08004000, 8) == bytes.fromhex("F00FFECA78563412")
    b.put("command", 3)
    b.run_us(1000)
    assert b.word("state") == 3
    assert b.read_memory(0x08004000, 4) == bytes.fromhex("F00F0000"), "programming only clears bits"


def test_a_dead_crystal_never_gets_ready(board):
    b = board("clock_loss", crystal=False)
    b.run_us(100_000)
    assert b.word("hse_started") == 0
    assert b.stats().cpu_hz == 16_000_000
    assert b.word("count") > 0


@pytest.mark.parametrize("security", [True, False])
def test_a_crystal_that_stops_is_caught_by_the_clock_security_or_stops_the_core(board, security):
    b = board("clock_loss")
    b.run_us(10)
    b.put("security", int(security))
    b.run_us(20_000)
    assert b.stats().cpu_hz == 8_000_000
    b.set_crystal_alive(False)
    before = b.word("count")
    b.run_us(10_000)
    if security:
        assert b.word("nmis") == 1
        assert b.stats().cpu_hz == 16_000_000
        assert b.word("count") > before + 100
    else:
        assert b.word("count") == before
