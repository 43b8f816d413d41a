"""Registers of a virtual board, read and written by the program that runs on it."""

from __future__ import annotations

from typing import Any


class Registers:
    """Registers of a board that runs images/dma.c, accessed by its CPU."""

    def __init__(self, board: Any) -> None:
        self.board = board

    def _order(self, address: int, order: int) -> None:
        self.board.put("address", address)
        self.board.put("order", order)
        while self.board.word("order"):
            self.board.run_us(1)

    def __getitem__(self, address: int) -> int:
        self._order(address, 1)
        return int(self.board.word("value"))

    def __setitem__(self, address: int, value: int) -> None:
        self.board.put("value", value)
        self._order(address, 2)
