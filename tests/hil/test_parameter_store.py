"""Saved parameters on the flashed image: what a save costs, what damage does, what another image finds."""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import truing_protocol as tp
from hil_sim import ResetCause
from support.driving import BRAKE
from support.store_board import BOOT_US, SLOT_SIZE, StoreBoard, generation, put_values, values_of
from truing.board.device import Device, parameter_info
from truing.errors import Refused
from truing.link.client import Client
from truing.link.framing import Frame, encode
from truing.link.refusals import faults_in

WHEELBASE = parameter_info("wheelbase_m").index


@pytest.fixture
def board(image: Path, native_library: Path) -> Iterator[StoreBoard]:
    with StoreBoard(image) as fresh:
        yield fresh


def fault_names(client: Client) -> list[str]:
    return [fault.name for fault in faults_in(client.request(tp.StatusRequest()).faults_active)]


def save(client: Client) -> tp.ParamSaveReply:
    """Save, patiently: bytes that arrive meanwhile would be lost."""
    return client.request(tp.ParamSaveRequest(), first_wait_s=1.0)


def set_and_save(client: Client, wheelbase_m: float) -> tp.ParamSaveReply:
    client.request(tp.ParamSetRequest(WHEELBASE, wheelbase_m))
    return save(client)


def test_saved_parameters_are_there_after_a_power_cycle(board: StoreBoard) -> None:
    client = board.start()
    put_values(client, generation(3))
    wanted = values_of(client)
    assert save(client).written
    assert values_of(board.start()) == wanted


def test_the_third_save_and_the_tenth_are_kept_like_the_first(board: StoreBoard) -> None:
    for number in range(1, 11):
        assert set_and_save(board.start(), 0.2 + 0.01 * number).sequence == number
    value = board.start().request(tp.ParamGetRequest(WHEELBASE)).value
    assert value == pytest.approx(0.3, rel=1e-6)


@pytest.mark.parametrize("slow", [False, True], ids=["typical flash", "slowest flash"])
def test_a_save_brakes_keeps_device_time_and_trips_nothing(board: StoreBoard, slow: bool) -> None:
    board.robot.set_flash_slow(slow)
    client = board.start()
    client.stream.sleep(1.0)
    before, began_us = client.request(tp.StatusRequest()), board.robot.time_us
    reply = set_and_save(client, 0.29)
    took_us = board.robot.time_us - began_us
    after = client.request(tp.StatusRequest())
    passed_us = board.robot.time_us - began_us
    print(f"a save takes {took_us / 1000:.1f} ms, of which the loop stands still for {reply.stall_ms} ms")
    assert reply.stall_ms == pytest.approx(500 if slow else 250, abs=1)
    assert after.uptime_ms - before.uptime_ms == pytest.approx(passed_us / 1000, abs=1)
    assert after.state == tp.State.IDLE
    assert fault_names(client) == []
    assert client.counts.retries == 0
    assert after.frames_dropped == 0
    assert (board.robot.bridge(0), board.robot.bridge(1)) == BRAKE
    assert board.robot.stats().resets == 1 + 1, "the first start, and this test's own"
    client.stream.sleep(0.2)
    assert client.request(tp.StatusRequest()).faults_latched == 0
    assert board.robot.warnings() == []


def test_a_host_that_asks_again_and_again_meanwhile_is_answered_once_it_is_over(board: StoreBoard) -> None:
    client = board.start()
    client.request(tp.ParamSetRequest(WHEELBASE, 0.29))
    assert client.request(tp.ParamSaveRequest()).sequence == 1  # repeated after 50 ms, into deaf ears
    assert client.counts.retries > 0
    assert client.request(tp.ParamStoreRequest()).sequence == 1
    client.request(tp.StopRequest())


def test_saving_and_loading_are_refused_while_the_robot_moves(board: StoreBoard) -> None:
    client = board.start()
    client.stream.sleep(0.3)
    slots = board.slots
    Device(client).arm()
    client.request(tp.SetEffortRequest(0.3, 0.3))
    client.stream.sleep(0.2)
    for request in (tp.ParamSaveRequest(), tp.ParamLoadRequest(), tp.ParamDefaultsRequest()):
        with pytest.raises(Refused) as caught:
            client.request(request)
        assert caught.value.reason == "wrong_state"
    client.stream.sleep(0.2)
    assert board.robot.truth().speed_mps > 0.1
    assert board.slots == slots


def test_a_damaged_slot_falls_back_says_so_by_name_and_is_made_good_by_a_save(board: StoreBoard) -> None:
    client = board.start()
    set_and_save(client, 0.25)
    set_and_save(client, 0.29)
    newest = client.request(tp.ParamStoreRequest()).newest
    slots = bytearray(board.slots)
    slots[newest * SLOT_SIZE + 40] ^= 0x10  # one bit of one record
    client = board.start(bytes(slots))
    client.stream.sleep(0.3)
    assert client.request(tp.ParamGetRequest(WHEELBASE)).value == pytest.approx(0.25)
    assert fault_names(client) == ["parameter_store_damaged"]
    Device(client).arm()
    with pytest.raises(Refused, match="parameter_store_damaged") as caught:
        client.request(tp.SetEffortRequest(0.2, 0.2))
    assert caught.value.reason == "self_check_failed"
    assert "truing params save" in caught.value.next_step
    set_and_save(client, 0.29)
    client.request(tp.SetEffortRequest(0.2, 0.2))
    client.request(tp.StopRequest())
    client = board.start()
    client.stream.sleep(0.3)
    assert client.request(tp.ParamGetRequest(WHEELBASE)).value == pytest.approx(0.29)
    assert fault_names(client) == []


def test_two_slots_of_noise_give_the_defaults_and_the_fault(board: StoreBoard) -> None:
    state, noise = 1, bytearray()
    while len(noise) < 2 * SLOT_SIZE:
        state = state * 6364136223846793005 + 1442695040888963407 & 2**64 - 1
        noise += struct.pack("<I", state >> 32)
    client = board.start(bytes(noise))
    client.stream.sleep(0.3)
    assert values_of(client) == tuple(
        struct.unpack("<f", struct.pack("<f", info.default))[0] for info in tp.PARAMETERS
    )
    assert fault_names(client) == ["parameter_store_damaged"]


def test_a_reset_in_the_middle_of_a_save_leaves_a_whole_set(board: StoreBoard) -> None:
    client = board.start()
    set_and_save(client, 0.25)
    client.request(tp.ParamSetRequest(WHEELBASE, 0.29))
    client.stream.write(encode(Frame(tp.ParamSaveRequest.ID, 4711)))
    board.robot.run_us(100_000)
    board.robot.reset(ResetCause.PIN)
    board.robot.run_us(BOOT_US)
    client = Client(client.stream)
    assert client.request(tp.ParamGetRequest(WHEELBASE)).value == pytest.approx(0.25)
    assert fault_names(client) == []
    assert set_and_save(client, 0.29).sequence == 2


# ---- two images

NEW_PARAMETER = """[[parameter]]
name = "made_up_m"
unit = "m"
kind = "real"
range = [0.0, 9.0]
default = 4.5
doc = "only in this image"

"""


@pytest.fixture(scope="module")
def young_image(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The image of a schema with one more parameter, in front of all others."""
    tree = tmp_path_factory.mktemp("young")
    for folder in ("protocol", "firmware"):
        shutil.copytree(root / folder, tree / folder)
    for file in ("CMakeLists.txt", "CMakePresets.json"):
        shutil.copy(root / file, tree)
    schema = tree / "protocol" / "schema.toml"
    before, first, rest = schema.read_text().partition("[[parameter]]")
    schema.write_text(before + NEW_PARAMETER + first + rest)
    for command in (
        [sys.executable, "protocol/generate.py"],
        ["cmake", "--preset", "stm32f405"],
        ["ninja", "-j2", "-C", "build/stm32f405", "truing-f405"],
    ):
        subprocess.run(command, cwd=tree, check=True, capture_output=True, timeout=100)
    return tree / "build/stm32f405/firmware/truing-f405.elf"


def listed(client: Client, count: int) -> dict[str, float]:
    replies = [client.request(tp.ParamListRequest(index)) for index in range(count)]
    return {reply.name: reply.value for reply in replies}


def test_an_image_with_one_more_parameter_keeps_the_old_values_and_so_does_the_way_back(
    image: Path, young_image: Path, native_library: Path
) -> None:
    count = len(tp.PARAMETERS)
    with StoreBoard(image) as old, StoreBoard(young_image) as young:
        client = old.start()
        put_values(client, generation(5))
        saved = listed(client, count)
        assert save(client).written

        client = young.start(old.slots)
        assert listed(client, count + 1) == {"made_up_m": 4.5} | saved
        store = client.request(tp.ParamStoreRequest())
        assert (store.stored, store.unknown, store.unfit) == (count, 0, 0)
        assert fault_names(client) == []
        client.request(tp.ParamSetRequest(0, 7.0))
        assert save(client).written

        client = old.start(young.slots)
        assert listed(client, count) == saved
        assert client.request(tp.ParamStoreRequest()).unknown == 1
        client.request(tp.ParamSetRequest(WHEELBASE, 0.29))
        assert save(client).written

        back = listed(young.start(old.slots), count + 1)
        assert back.pop("made_up_m") == 7.0
        assert back.pop("wheelbase_m") == pytest.approx(0.29)
        assert back == {name: value for name, value in saved.items() if name != "wheelbase_m"}
