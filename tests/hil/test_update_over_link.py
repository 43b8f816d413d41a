"""An update over the link, through the flashed image: it stays, or the image from before runs again."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import truing_protocol as tp
from hil_sim import VirtualRobot
from support.cli import truing_within
from support.update_board import (
    SLOTS,
    CutStream,
    UpdateBoard,
    answering_slot,
    cut_update,
    sleeper,
    sleepers,
)
from truing.board.connect import open_stream
from truing.board.device import Device
from truing.board.over_link import Updated, update_over_link
from truing.errors import FlashError, LinkError, Refused
from truing.flash.update_file import UpdateFile, chain, read_update
from truing.link.client import Client

CHUNK = 512
LAST_WRITE = 70  # of the update of a sleeper, its three trials and its rejection included
FRAMES = 9  # hello, state, begin, two chunks, finish, restart, and two greetings
QUIET: list[str] = []


def update(client: Client, file: UpdateFile) -> Updated:
    return update_over_link(client, file, QUIET.append)


@pytest.fixture(scope="module")
def file(image: Path) -> UpdateFile:
    return read_update(image.with_suffix(".update"))


@pytest.fixture(scope="module")
def one_board(image: Path, native_library: Path) -> Iterator[UpdateBoard]:
    with UpdateBoard(image) as board:
        yield board


@pytest.fixture
def board(one_board: UpdateBoard) -> UpdateBoard:
    one_board.restore()
    return one_board


def test_an_update_and_the_next_change_slots_and_keep_the_parameters(
    board: UpdateBoard, file: UpdateFile
) -> None:
    device = Device(board.client())
    device.set_parameter("can_node", 7)
    device.save_parameters()
    for slot in (1, 0):
        done = update(board.client(), file)
        assert (done.slot, done.bytes, done.resumed_at) == (slot, len(file.images[slot]), 0)
        held = board.robot.read_memory(SLOTS[slot], len(file.images[slot]))
        assert held[CHUNK:] == file.images[slot][CHUNK:]
        device = Device(board.client())
        assert device.get_parameter("can_node").value == 7
        states = [(s.state.name, s.sequence, s.runs) for s in device.image_slots()]
        older = ("CONFIRMED", 2 - slot, False)
        assert states[slot] == ("CONFIRMED", 3 - slot, True)
        assert states[1 - slot] == older
        board.power_up()
        assert answering_slot(board) == slot
    assert board.robot.warnings() == []


def test_an_update_over_can_stays(file: UpdateFile) -> None:
    client = Client(open_stream("can:sim"))
    assert update(client, file).slot == 1
    assert Device(client).image_slots()[1].runs
    client.close()


def test_a_cut_link_is_told_and_the_same_command_goes_on(board: UpdateBoard, file: UpdateFile) -> None:
    client = Client(CutStream(board.robot, writes=60))
    with pytest.raises(FlashError, match="the link was cut") as cut:
        update(client, file)
    assert "it goes on where this one ended" in cut.value.next_step
    done = update(board.client(), file)
    assert done.resumed_at > 20 * CHUNK
    assert done.slot == 1


def test_a_link_cut_at_any_frame_leaves_a_board_that_answers(board: UpdateBoard, tmp_path: Path) -> None:
    """Every frame of an update of two chunks, and of the greetings behind it."""
    small = sleepers(tmp_path / "small.update")
    for frame in range(FRAMES):
        for whole in (False, True):  # what is lost then is the reply
            board.restore()
            with pytest.raises((FlashError, LinkError)):
                update(Client(CutStream(board.robot, frame, whole=whole)), small)
            assert answering_slot(board) == 0, f"cut at frame {frame}"


def test_an_image_that_hangs_is_rolled_back_by_the_watchdog(board: UpdateBoard, tmp_path: Path) -> None:
    with pytest.raises(FlashError, match=r"truing-f405 9\.9 did not check in and was rolled back"):
        update(board.client(), sleepers(tmp_path / "hangs.update"))
    device = Device(board.client())
    assert [s.state.name for s in device.image_slots()] == ["CONFIRMED", "REJECTED"]
    assert device.info.reset_cause == "watchdog"


def test_an_image_that_starts_and_is_never_greeted_is_rolled_back(
    board: UpdateBoard, file: UpdateFile
) -> None:
    update(board.client(), file)
    # As before its first trial: nobody has greeted it, and nobody does now.
    held = board.robot.read_memory(SLOTS[1], 2 * CHUNK)
    marks = held[CHUNK - 32 : CHUNK - 24] + b"\xff" * 24
    board.robot.set_power(False)
    board.robot.write_flash(SLOTS[1], held[: CHUNK - 32] + marks + held[CHUNK:])
    board.power_up()
    board.robot.run_us(61_000_000)
    assert answering_slot(board) == 0
    assert Device(board.client()).image_slots()[1].state is tp.ImageState.REJECTED


def test_a_power_cut_in_an_update_leaves_a_board_that_starts_and_answers(
    board: UpdateBoard, tmp_path: Path
) -> None:
    """At each step that is no plain content, and at some that are; `./run bench update_cuts` has them all."""
    small = sleepers(tmp_path / "small.update")
    for write in (0, 1, 2, 17, 40, *range(LAST_WRITE - 3, LAST_WRITE + 1)):
        assert cut_update(board, small, write)
        assert answering_slot(board) == 0, f"cut at write {write}"


def test_a_power_cut_in_the_real_images_update_is_made_good_by_the_same_command(
    board: UpdateBoard, file: UpdateFile
) -> None:
    assert cut_update(board, file, 5000)
    assert answering_slot(board) == 0
    assert update(board.client(), file).slot == 1


def test_another_boards_update_is_refused_by_the_host_and_by_the_board(
    board: UpdateBoard, usb_image: Path
) -> None:
    other = read_update(usb_image.with_suffix(".update"))
    client = board.client()
    with pytest.raises(FlashError, match=r"is for truing-f405-usb, and this board runs truing-f405 0"):
        update(client, other)
    renamed = replace(other, header=replace(other.header, name="truing-f405 0.1.0"))
    with pytest.raises(Refused, match="update_other_board"):
        update(client, renamed)
    assert answering_slot(board) == 0


def test_a_damaged_chunk_is_not_written(board: UpdateBoard) -> None:
    image = sleeper(1, "truing-f405 9.9")
    head, chunks = chain(image, CHUNK)
    client = board.client()
    client.request(tp.UpdateBeginRequest(tuple(head), len(image)), first_wait_s=4.0, patience_s=9.0)
    bad = chunks[0].data[:-1] + b"\x00"
    with pytest.raises(Refused, match="update_bad_chunk"):
        client.request(tp.UpdateDataRequest(0, tuple(chunks[0].next), bad))
    assert board.robot.read_memory(SLOTS[1], CHUNK) == b"\xff" * CHUNK


def test_bridges_brake_and_no_watchdog_bites_while_a_slot_is_erased_by_the_slowest_flash(
    image: Path, native_library: Path
) -> None:
    with VirtualRobot(image) as robot:
        robot.set_flash_slow(True)
        robot.set_lsi_hz(47_000)
        robot.run_us(20_000)
        stream = CutStream(robot, writes=100)
        client = Client(stream)
        seen: set[tuple[float, float]] = set()
        stream.on_time = lambda _: seen.update((robot.bridge(0), robot.bridge(1)))
        head, _ = chain(sleeper(1, "truing-f405 9.9"), CHUNK)
        begun = client.request(tp.UpdateBeginRequest(tuple(head), 700), first_wait_s=4.0, patience_s=9.0)
        assert begun.stall_ms >= 1990
        assert seen == {(1.0, 1.0)}


def test_the_command_says_what_it_did_or_why_it_refused(usb_image: Path, native_library: Path) -> None:
    done = truing_within("flash", "--over-link", "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert (said["slot"], said["name"].split()[0], said["resumed_at"]) == (1, "truing-f405", 0)
    assert "the board starts the new image on trial" in done.stderr
    other = truing_within("flash", "--over-link", str(usb_image.with_suffix(".update")))
    assert other.returncode == 1
    assert "nothing was written" in other.stderr
    wrong = truing_within("flash", "--over-link", str(usb_image))
    assert wrong.returncode == 2
    assert "is no update for a board of truing" in wrong.stderr


def test_info_shows_both_slots(native_library: Path) -> None:
    assert "image slot 0  truing-f405 0.1.0, confirmed, number 1, runs" in truing_within("info").stdout
    slots = json.loads(truing_within("info", "--json").stdout)["image_slots"]
    assert [(slot["state"], slot["runs"]) for slot in slots] == [("confirmed", True), ("none", False)]
