"""An update over the link, as far as it needs no board: its file, its chain, boards without slots."""

from __future__ import annotations

import hashlib
import zipfile
from pathlib import Path

import pytest

import truing_protocol as tp
from support.fake_board import FakeBoard, FakeLine
from support.update_board import sleeper, sleepers
from truing.board.over_link import update_over_link
from truing.errors import FileError, FlashError
from truing.flash.update_file import chain, read_update
from truing.link.client import Client

NAME = "truing-fake 1.0"


def test_a_board_of_another_schema_is_still_brought_up_to_date_and_one_without_slots_needs_a_probe(
    tmp_path: Path,
) -> None:
    board = FakeBoard(schema_hash=0x1234, refuse={"update_begin": (tp.RefusalReason.UPDATE_FAILED, 1)})
    file = sleepers(tmp_path / "new.update", NAME)
    with pytest.raises(Exception, match="update_failed"):
        update_over_link(Client(FakeLine(board)), file, lambda _: None)
    assert board.handled == ["hello", "update_state", "update_begin"]
    board.refuse = {"update_state": (tp.RefusalReason.UNKNOWN_REQUEST, tp.UpdateStateRequest.ID)}
    with pytest.raises(FlashError, match="older than updates over the link") as old:
        update_over_link(Client(FakeLine(board)), file, lambda _: None)
    assert "probe" in old.value.next_step


def test_the_chain_binds_every_byte_and_the_order_of_the_chunks() -> None:
    image = bytes(range(256)) * 5
    head, chunks = chain(image, 512)
    assert b"".join(chunk.data for chunk in chunks) == image
    expected = head
    for chunk in chunks:
        assert hashlib.sha256(chunk.data + chunk.next).digest() == expected
        expected = chunk.next
    assert expected == bytes(32)


@pytest.mark.parametrize(
    ("slots", "said"),
    [
        ({"slot0.bin": b"x" * 600}, "is no update for a board of truing"),
        ({"slot0.bin": b"x" * 600, "slot1.bin": sleeper(1, NAME)}, "the image for slot 0 is damaged"),
        ({"slot0.bin": sleeper(0, NAME), "slot1.bin": sleeper(0, NAME)}, "do not belong together"),
        (
            {"slot0.bin": sleeper(0, NAME), "slot1.bin": sleeper(1, "truing-fake 1.1")},
            "do not belong together",
        ),
    ],
    ids=["one image", "damaged", "one slot twice", "two versions"],
)
def test_a_file_that_is_no_whole_update_is_refused(
    tmp_path: Path, slots: dict[str, bytes], said: str
) -> None:
    path = tmp_path / "new.update"
    with zipfile.ZipFile(path, "w") as archive:
        for name, image in slots.items():
            archive.writestr(name, image)
    with pytest.raises(FileError, match=said):
        read_update(path)
