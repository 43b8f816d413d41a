"""A picture that takes time to compute, drawn again on request."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from nicegui import background_tasks


class Redraw:
    """Draws when it is called; calls while it draws are one more drawing afterwards."""

    def __init__(self, draw: Callable[[], Awaitable[None]]) -> None:
        self._draw = draw
        self._requested = False
        self._busy = False

    def __call__(self) -> None:
        """Ask for a drawing of the present state."""
        self._requested = True
        if not self._busy:
            self._busy = True
            background_tasks.create(self._run())

    async def _run(self) -> None:
        try:
            while self._requested:
                self._requested = False
                await self._draw()
                await asyncio.sleep(0)
        finally:
            self._busy = False
