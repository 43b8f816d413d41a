"""The web socket of a page: keys and heartbeats in, frames out, each only on request.

A page requests the next frame when it has drawn the last. So a slow browser gets fewer frames, never a queue
of old ones, and neither this process nor the board's thread ever waits for it. The same socket is the
dead-man switch: when it closes, its page loses control and the robot stops.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from typing import Any

import orjson
from fastapi import FastAPI, Response, WebSocket, WebSocketDisconnect

from truing.web.live.frame import FrameMaker
from truing.web.path.trajectory import KEYS
from truing.web.session import ViewSession
from truing.web.world.map_file import FREE, OCCUPIED, png_bytes

_LOG = logging.getLogger("truing.web.live")
_DRIVING_KEYS = frozenset(KEYS)
# Thirty frames per second with some margin: a frame costs the browser far more than this process, and a
# higher rate would show the same samples. A page that requests frames faster has to wait.
_MIN_FRAME_INTERVAL_S = 1.0 / 36.0
_MAX_MESSAGE = 2_000
_MAX_NAME = 64


def add_page_socket(app: FastAPI, session: ViewSession) -> None:
    """Serve the web socket and the map images."""

    @app.websocket("/live")
    async def live(socket: WebSocket) -> None:
        name = socket.query_params.get("session", "")[:_MAX_NAME]
        await socket.accept()
        try:
            await _PageSocket(socket, session, name).serve()
        except WebSocketDisconnect:
            pass
        finally:
            # Dead-man switch: nothing may delay this release, which stops the robot.
            session.lock.release(name)

    @app.get("/maps/{name}.png")
    def map_image(name: str) -> Response:
        if name == "world":
            with session.sensing.world_lock:
                pixels = (~session.world.occupied * (FREE - OCCUPIED)).astype("uint8")
        elif name == "odometry":
            pixels = session.sensing.odometry_map.shades()
        elif name == "corrected":
            pixels = session.sensing.corrected_map.shades()
        else:
            return Response(status_code=404)
        return Response(png_bytes(pixels), media_type="image/png", headers={"cache-control": "no-store"})


class _PageSocket:
    """One page's socket."""

    def __init__(self, socket: WebSocket, session: ViewSession, name: str) -> None:
        self._socket = socket
        self._session = session
        self._name = name
        self._frames = FrameMaker(session, name)
        self._requested = asyncio.Event()

    async def serve(self) -> None:
        """Run until the page disconnects."""
        sender = asyncio.create_task(self._send())
        try:
            while True:
                text = await self._socket.receive_text()
                if len(text) <= _MAX_MESSAGE:
                    with contextlib.suppress(ValueError):
                        self._handle(orjson.loads(text))
        finally:
            sender.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await sender

    def _handle(self, message: Any) -> None:
        session = self._session
        if not isinstance(message, dict):
            return
        kind = message.get("t")
        if kind == "next":
            self._requested.set()
        elif kind == "keys":
            held = message.get("keys")
            keys = tuple(k for k in held if k in _DRIVING_KEYS) if isinstance(held, list) else ()
            session.drive_keys(self._name, keys)
        elif kind == "stop":
            number, stop_id = session.stop(), message.get("id")
            if isinstance(stop_id, int):
                self._frames.stopping(stop_id, number)
        elif kind == "claim":
            session.claim(self._name)
        elif kind == "leave":
            session.lock.release(self._name)
        elif kind in ("faster", "slower"):
            session.change_speed(self._name, kind == "faster")

    async def _send(self) -> None:
        last = 0.0
        while True:
            await self._requested.wait()
            self._requested.clear()
            await asyncio.sleep(max(0.0, last + _MIN_FRAME_INTERVAL_S - time.monotonic()))
            last = time.monotonic()
            await self._socket.send_bytes(
                orjson.dumps(self._frames.frame(), option=orjson.OPT_SERIALIZE_NUMPY)
            )
