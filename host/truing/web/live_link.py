"""The web socket of a page: keys and heartbeats in, frames out, each only when the page asks for it.

A page asks for the next frame when it has drawn the last. So a slow browser gets fewer frames, never a queue
of old ones, and neither this process nor the board's thread ever waits for it. The same socket is the dead
man's handle: when it closes, whoever drove through it has left the wheel, and the robot stops.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from typing import Any

import orjson
from fastapi import FastAPI, Response, WebSocket, WebSocketDisconnect

from truing.web.live_frame import FrameMaker
from truing.web.map_file import FREE, OCCUPIED, png_bytes
from truing.web.session import ViewSession
from truing.web.trajectory import KEYS

_LOG = logging.getLogger("truing.web.live")
_DRIVING_KEYS = frozenset(KEYS)
# Thirty pictures a second and a few to spare: each costs the browser far more than it costs this process, and
# twice as many would show the same samples. A page that asks faster is made to wait.
_SHORTEST_S = 1.0 / 36.0
_LONGEST_MESSAGE = 2_000
_LONGEST_NAME = 64


def add_live_link(app: FastAPI, session: ViewSession) -> None:
    """Serve the web socket and the pictures of the maps."""

    @app.websocket("/live")
    async def live(socket: WebSocket) -> None:
        name = socket.query_params.get("session", "")[:_LONGEST_NAME]
        await socket.accept()
        try:
            await _Link(socket, session, name).serve()
        except WebSocketDisconnect:
            pass
        finally:
            # The handle is let go: nothing may come between this and the brakes.
            session.lock.release(name)

    @app.get("/maps/{name}.png")
    def picture(name: str) -> Response:
        if name == "world":
            with session.sensing.world_lock:
                pixels = (~session.world.occupied * (FREE - OCCUPIED)).astype("uint8")
        elif name == "odometry":
            pixels = session.sensing.by_odometry.shades()
        elif name == "corrected":
            pixels = session.sensing.by_correction.shades()
        else:
            return Response(status_code=404)
        return Response(png_bytes(pixels), media_type="image/png", headers={"cache-control": "no-store"})


class _Link:
    """One page's socket."""

    def __init__(self, socket: WebSocket, session: ViewSession, name: str) -> None:
        self._socket = socket
        self._session = session
        self._name = name
        self._frames = FrameMaker(session, name)
        self._wanted = asyncio.Event()

    async def serve(self) -> None:
        """Until the page is gone."""
        sender = asyncio.create_task(self._send())
        try:
            while True:
                text = await self._socket.receive_text()
                if len(text) <= _LONGEST_MESSAGE:
                    with contextlib.suppress(ValueError):
                        self._obey(orjson.loads(text))
        finally:
            sender.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await sender

    def _obey(self, message: Any) -> None:
        session = self._session
        if not isinstance(message, dict):
            return
        kind = message.get("t")
        if kind == "next":
            self._wanted.set()
        elif kind == "keys":
            held = message.get("keys")
            keys = tuple(k for k in held if k in _DRIVING_KEYS) if isinstance(held, list) else ()
            session.drive_keys(self._name, keys)
        elif kind == "stop":
            session.stop()
        elif kind == "claim":
            session.claim(self._name)
        elif kind == "leave":
            session.lock.release(self._name)
        elif kind in ("faster", "slower"):
            session.change_speed(self._name, kind == "faster")
        elif kind == "clear":
            session.worker.clear_faults()

    async def _send(self) -> None:
        last = 0.0
        while True:
            await self._wanted.wait()
            self._wanted.clear()
            await asyncio.sleep(max(0.0, last + _SHORTEST_S - time.monotonic()))
            last = time.monotonic()
            await self._socket.send_bytes(
                orjson.dumps(self._frames.frame(), option=orjson.OPT_SERIALIZE_NUMPY)
            )
