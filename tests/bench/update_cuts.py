"""Updates over the link whose power is cut in every flash write: does the board answer afterwards?"""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path

from bench.figure import Figure
from support.update_board import UpdateBoard, answering_slot, cut_update, sleepers
from truing.board.over_link import update_over_link
from truing.errors import LinkError
from truing.flash.update_file import UpdateFile, read_update

TEARS = 3  # each torn write stops somewhere else
# Of the built image's 14,000 writes, one in so many: the others are of the same kind, at other addresses.
STRIDE = 101


def _sweep(board: UpdateBoard, file: UpdateFile, stride: int, tears: int) -> tuple[int, int]:
    """Cuts, and those after which a board answered from one of its slots."""
    cuts = answered = write = 0
    while True:
        for _ in range(tears):
            if not cut_update(board, file, write):
                return cuts, answered
            cuts += 1
            with contextlib.suppress(LinkError):
                answered += answering_slot(board) in (0, 1)
        write += stride


def measure(root: Path) -> list[Figure]:
    """Every write of an image of two chunks, from either slot; then samples of the built image."""
    image = root / "build/stm32f405/firmware/truing-f405.elf"
    real = read_update(image.with_suffix(".update"))
    counted: dict[str, tuple[int, int]] = {}
    with tempfile.TemporaryDirectory() as folder, UpdateBoard(image) as board:
        small = sleepers(Path(folder) / "small.update")
        counted["every write of a small image, into slot 1"] = _sweep(board, small, 1, TEARS)
        counted[f"one write in {STRIDE} of the built image, into slot 1"] = _sweep(board, real, STRIDE, 1)
        board.restore()
        update_over_link(board.client(), real, lambda _: None)
        board.keep()
        counted["every write of a small image, over slot 0's"] = _sweep(board, small, 1, TEARS)
    return [
        Figure(f"{cuts} power cuts, {what}: answered", 100 * answered / cuts, "%", "more", 100)
        for what, (cuts, answered) in counted.items()
    ]
