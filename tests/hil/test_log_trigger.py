"""An armed log keeps what is around a fault or a crossing, on the flashed image, and nothing else."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hil_sim.robot import EncoderFault
from support.chain import Chain
from support.served_board import ServedBoard
from truing.board.device import Device
from truing.board.drive import drive
from truing.board.log_trigger import SIGNALS, max_span_s
from truing.board.run_saver import FetchedLog, fetch_log, run_of, save_run
from truing.board.signal_stream import SIGNALS as STREAMED
from truing.errors import Refused, TruingError
from truing.link.can_stream import CanStream
from truing.link.client import Client
from truing.plan import Kind, Plan, Segment
from truing.recording.reader import read_run
from truing.virtual.can import SimulatedBus, free, make_bus_of_boards
from truing.virtual.options import VirtualOptions
from truing_protocol import LogEnd, LogTriggerState

LEFT = 0
SYSTICK = 15
RATE_HZ = 20
SHORT = Plan("short", "short", (Segment(Kind.EFFORT, 1.0, 0.3, 0.3),), RATE_HZ)


def live(device: Device, left: float, right: float, seconds: float) -> None:
    """Drive under the host's hand; the board may stop by itself."""
    until = device.client.stream.now_s() + seconds
    while device.client.stream.now_s() < until:
        device.set_effort(left, right)
        device.client.stream.sleep(0.1)


def around(fetched: FetchedLog, device: Device) -> tuple[int, int, float]:
    """Records up to the trigger and after it, and seconds from the first one to the trigger."""
    fired_ms = round((device.log_trigger_state().fired_t_s or 0.0) * 1000)
    t_ms = fetched.decoded.records["t_ms"].astype(np.int64)
    assert not fetched.decoded.lost
    assert set(np.diff(t_ms)[:-1]) == {1000 // RATE_HZ}
    return int(np.sum(t_ms <= fired_ms)), int(np.sum(t_ms > fired_ms)), float(fired_ms - t_ms[0]) / 1000


def drive_until_the_encoder_breaks(chain: Chain, device: Device, seconds: float = 12.0) -> None:
    live(device, 0.3, 0.3, seconds)
    chain.robot.set_encoder_fault(LEFT, EncoderFault.UNPLUGGED)
    with pytest.raises(Refused, match="encoder_left_lost"):
        live(device, 0.3, 0.3, 2.0)


def test_a_fault_while_driving_is_kept_with_the_seconds_before_and_after_it(
    image: Path, native_library: Path, tmp_path: Path
) -> None:
    with Chain(image) as chain:
        device = chain.host()
        log_id = device.arm_log("fault", before_s=5.0, after_s=2.0)
        drive_until_the_encoder_breaks(chain, device)
        assert device.log_trigger_state().state is LogTriggerState.FIRED
        assert device.logs() == ()
        chain.stream.sleep(2.1)
        trigger = device.log_trigger_state()
        fetched = fetch_log(device)
        before, after, kept_s = around(fetched, device)
        run = run_of(device, fetched, "fault", parameters=device.parameters())
        path = save_run(run, tmp_path, "fault", "")
    print(f"{before} records before the fault ({kept_s:.2f} s), {after} after it, {len(fetched.data)} bytes")
    assert trigger.state is LogTriggerState.DONE
    assert [fault.name for fault in trigger.faults] == ["encoder_left_lost"]
    assert (fetched.log.log_id, fetched.log.end) == (log_id, LogEnd.TRIGGERED)
    assert before >= 5 * RATE_HZ
    assert after >= 2 * RATE_HZ
    assert kept_s < 5.0 + 1.0
    # The row of the fault is the first to show it, and the run's own time says where that is.
    kept = read_run(path)
    told = kept.metadata.extra["trigger"]
    assert told["faults"] == ["encoder_left_lost"]
    assert told["run_t_s"] == pytest.approx(kept_s)
    first = kept.columns["t_s"][np.flatnonzero(kept.columns["faults"])[0]]
    assert told["run_t_s"] <= first < told["run_t_s"] + 1 / RATE_HZ
    assert np.all(kept.columns["effort_left"][kept.columns["t_s"] < told["run_t_s"] - 0.1] > 0.2)


def test_a_signal_that_comes_over_its_level_is_kept_likewise(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        chain.stream.sleep(0.3)
        device.arm_log("threshold", signal="speed_left", above=0.5, before_s=1.0, after_s=1.0)
        live(device, 0.2, 0.2, 3.0)
        assert device.log_trigger_state().state is LogTriggerState.ARMED
        live(device, 0.6, 0.6, 3.0)
        trigger = device.log_trigger_state()
        device.stop()
        fetched = fetch_log(device)
        before, after, kept_s = around(fetched, device)
    fired_ms = round((trigger.fired_t_s or 0) * 1000)
    records = fetched.decoded.records
    print(f"{before} records before, {after} after; speed then {trigger.value} m/s")
    assert trigger.state is LogTriggerState.DONE
    assert trigger.value is not None
    assert 0.5 < trigger.value < 0.55
    assert before >= RATE_HZ
    assert after >= RATE_HZ
    assert kept_s < 1.0 + 1.0
    # The row's speed is a mean over the interval: it lags by half of one.
    crossed = records["t_ms"][np.flatnonzero(records["speed_left"] > 500)[0]]
    assert fired_ms <= crossed <= fired_ms + 100


def test_a_supply_that_falls_below_its_level_triggers_in_any_state(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        chain.stream.sleep(0.3)
        at_rest = device.status().battery_v or 0.0
        device.arm_log("threshold", signal="battery", below=at_rest - 0.1, before_s=0.5, after_s=0.5)
        chain.stream.sleep(1.0)
        assert device.log_trigger_state().state is LogTriggerState.ARMED
        live(device, 1.0, 1.0, 0.5)  # both motors start at once
        assert device.log_trigger_state().state is not LogTriggerState.ARMED


def test_it_waits_through_the_hosts_silence_and_a_stop(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        chain.stream.sleep(0.3)
        device.arm_log("threshold", signal="speed_left", above=0.5, before_s=1.0, after_s=0.5)
        live(device, 0.2, 0.2, 1.0)
        device.stop()
        chain.stream.sleep(5.0)
        other = chain.host()
        assert other.log_trigger_state().state is LogTriggerState.ARMED
        live(other, 0.2, 0.2, 1.0)
        chain.stream.sleep(3.0)  # the board stops itself: a fault, and not what it waits for
        assert [fault.name for fault in other.status().latched] == ["host_silent"]
        assert other.log_trigger_state().state is LogTriggerState.ARMED
        other.clear_faults()
        live(other, 0.6, 0.6, 2.5)
        assert other.log_trigger_state().state is LogTriggerState.DONE


def test_disarmed_it_leaves_no_log_and_drives_have_theirs_as_ever(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        first = drive(device, SHORT).log_id
        device.arm_log("fault")
        with pytest.raises(Refused, match="log_busy"):
            drive(device, SHORT)
        with pytest.raises(Refused, match="log_busy") as caught:
            device.arm_log("fault")
        assert "log disarm" in caught.value.next_step
        live(device, 0.3, 0.3, 3.0)
        device.stop()
        device.disarm_log()
        assert device.log_trigger_state().state is LogTriggerState.IDLE
        assert [log.log_id for log in device.logs()] == [first]
        drive(device, SHORT)
        ends = [log.end for log in device.logs()]
        assert ends == [LogEnd.FINISHED, LogEnd.FINISHED]
        assert not device.log().truncated


def test_a_start_of_the_board_disarms(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        device.arm_log("fault")
        chain.stream.sleep(0.5)
        chain.robot.reset()
        chain.stream.sleep(0.5)
        again = chain.host()
        assert again.log_trigger_state().state is LogTriggerState.IDLE
        assert not again.status().log_open


def test_an_armed_log_goes_round_in_its_own_place_for_minutes(image: Path, native_library: Path) -> None:
    """The older log stays, byte for byte, and so does the room that the armed one takes."""
    with Chain(image) as chain:
        device = chain.host()
        old = device.log(drive(device, SHORT).log_id)
        data, _ = device.read_log(old)
        device.arm_log("fault", before_s=4.0, after_s=1.0)
        drive_until_the_encoder_breaks(chain, device, 240.0)
        chain.stream.sleep(1.1)
        fetched = fetch_log(device)
        before, after, kept_s = around(fetched, device)
        assert [log.log_id for log in device.logs()] == [old.log_id, fetched.log.log_id]
        assert device.read_log(device.log(old.log_id))[0] == data
    seconds = fetched.log.end_s - fetched.log.start_s
    print(
        f"armed for {seconds:.0f} s; {before} records before and {after} after in {len(fetched.data)} bytes"
    )
    assert seconds > 240
    assert before >= 4 * RATE_HZ
    assert after >= RATE_HZ
    assert kept_s < 5.0
    assert fetched.log.offset == old.offset + old.length
    assert len(fetched.data) < 2500


def test_armed_beside_a_stream_no_record_is_lost_and_no_sample_and_no_tick_is_late(
    image: Path, native_library: Path
) -> None:
    """As much as the ring admits is moved along in it, at 200 Hz, while a stream is read."""
    with Chain(image) as chain:
        device = chain.host()
        device.set_parameter("log_rate_hz", 200)
        longest_s = int(max_span_s(device.info.log_bytes, 200))
        chain.stream.sleep(0.3)
        device.arm_log("threshold", signal="speed_left", above=0.7, before_s=longest_s - 1.0, after_s=1.0)
        with device.stream(list(STREAMED), 200) as stream:
            taken = []
            for left, seconds in ((0.35, longest_s + 5.0), (0.7, 3.0)):
                until = chain.stream.now_s() + seconds
                while chain.stream.now_s() < until:
                    device.set_effort(left, 0.3)
                    taken += stream.read(0.1)
            device.stop()
        trigger, faults = device.log_trigger_state(), device.status().latched
        fetched = fetch_log(device)
        worst = chain.robot.cost(SYSTICK).worst_instructions
    t_ms = fetched.decoded.records["t_ms"].astype(np.int64)
    kept_s = (trigger.fired_t_s or 0.0) - t_ms[0] / 1000
    print(
        f"{len(t_ms)} records, {kept_s:.2f} s before the trigger, {len(fetched.data)} bytes; "
        f"{len(taken)} samples streamed, {stream.lost} lost; worst tick {worst} instructions"
    )
    assert trigger.state is LogTriggerState.DONE
    assert faults == ()
    assert stream.lost == 0
    assert set(np.diff(t_ms)[:-1]) == {5}
    assert kept_s >= longest_s - 1.0
    assert t_ms[-1] / 1000 >= (trigger.fired_t_s or 0.0) + 1.0
    assert worst < 10_000  # the budget, firmware/BUDGETS.md


def test_it_is_armed_and_fetched_over_can_as_over_serial(image: Path, native_library: Path) -> None:
    bus = make_bus_of_boards(VirtualOptions(image=image), (1,), 1_000_000)
    try:
        device = Device(Client(CanStream(SimulatedBus(bus), 1)))
        device.client.stream.sleep(0.3)
        log_id = device.arm_log("threshold", signal="counts_right", above=100, before_s=0.5, after_s=0.5)
        live(device, 0.0, 0.0, 1.0)
        live(device, 0.0, 0.4, 1.5)
        device.stop()
        fetched = fetch_log(device)
        before, after, _ = around(fetched, device)
    finally:
        free(bus)
    assert fetched.log.log_id == log_id
    assert before >= RATE_HZ / 2
    assert after >= RATE_HZ / 2


@pytest.mark.parametrize(
    ("arm", "says"),
    [
        (lambda device: device.arm_log("sunset"), "a fault or a threshold"),
        (lambda device: device.arm_log("threshold", above=1.0), "no signal"),
        (lambda device: device.arm_log("threshold", signal="speed", above=1.0), "no such signal"),
        (lambda device: device.arm_log("threshold", signal="cmd_left", above=1.0), "no such signal"),
        (lambda device: device.arm_log("threshold", signal="speed_left"), "one level"),
        (lambda device: device.arm_log("threshold", signal="speed_left", above=1, below=0), "one level"),
        (lambda device: device.arm_log("threshold", signal="x", above=float("nan")), "finite"),
        (lambda device: device.arm_log("threshold", signal="x", above=1e9), "no value reaches"),
        (lambda device: device.arm_log("fault", signal="speed_left"), "belong to a threshold"),
        (lambda device: device.arm_log("fault", before_s=float("nan")), "no time"),
        (lambda device: device.arm_log("fault", after_s=-1.0), "no time"),
        (lambda device: device.arm_log("fault", before_s=3600.0), "keeps at most"),
    ],
)
def test_what_makes_no_trigger_is_told_and_arms_nothing(
    image: Path, native_library: Path, arm: Callable[[Device], int], says: str
) -> None:
    with Chain(image) as chain:
        device = chain.host()
        with pytest.raises(TruingError, match=says) as caught:
            arm(device)
        print(caught.value, "|", caught.value.next_step)
        assert device.log_trigger_state().state is LogTriggerState.IDLE


def test_every_signal_that_has_a_level_can_be_watched(image: Path, native_library: Path) -> None:
    with Chain(image) as chain:
        device = chain.host()
        for signal in SIGNALS:
            device.arm_log("threshold", signal=signal, above=0.57)
            trigger = device.log_trigger_state()
            assert trigger.signal == signal
            assert trigger.level is not None
            assert 0 <= 0.57 - trigger.level < 0.571
            device.disarm_log()
            chain.stream.sleep(0.01)


def test_the_commands_arm_tell_fetch_and_disarm(image: Path, native_library: Path, tmp_path: Path) -> None:
    def truing(*arguments: str) -> tuple[int, str, str]:
        done = subprocess.run(board.truing(*arguments), timeout=60, capture_output=True, text=True)
        return done.returncode, done.stdout, done.stderr

    with ServedBoard(tmp_path) as board:
        assert "idle" in truing("log", "state")[1]
        wish = ("--signal", "speed_left", "--above", "0.2", "--before", "1", "--after", "0.5")
        code, said, _ = truing("log", "arm", "--on", "threshold", *wish, "--json")
        assert (code, json.loads(said)["state"]) == (0, "armed")
        code, _, said = truing("log", "arm", "--on", "fault")
        assert code == 1
        assert "log_busy" in said
        assert "discarded" in truing("log", "disarm")[1]
        assert "nothing was armed" in truing("log", "disarm")[1]
        code, _, said = truing("log", "arm", "--on", "threshold", "--above", "0.2")
        assert code == 2
        assert "no signal is named" in said
        assert truing("log", "arm", "--on", "threshold", *wish)[1].startswith("armed: log")
        with Device.open(board.tcp) as device:
            armed_s = device.status().uptime_s
            while device.status().uptime_s < armed_s + 1.2:
                device.client.stream.sleep(0.1)
            for _ in range(100):  # of the board's seconds a busy computer has fewer
                live(device, 0.4, 0.4, 0.2)
                if device.log_trigger_state().state is LogTriggerState.DONE:
                    break
            device.stop()
        assert "speed_left above 0.2 m/s" in truing("log", "state")[1]
        code, said, problem = truing("log", "fetch", "--set", str(tmp_path / "runs"), "--json")
        assert code == 0, problem
        fetched = json.loads(said)
        assert fetched["log"]["end"] == "triggered"
        assert fetched["trigger"]["signal"] == "speed_left"
        assert 1.0 <= fetched["trigger"]["run_t_s"] < 2.0
        assert "triggered" in truing("log", "list")[1]
