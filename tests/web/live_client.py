"""A page's live web socket without a browser: frames, stops, and how long both take."""

from __future__ import annotations

import contextlib
import json
import threading
import time
from typing import Any

from websockets.sync.client import connect


class LiveClient:
    """Asks for frames as a page does, thirty times a second, and measures the gaps between them.

    Attributes
    ----------
    state : what changes rarely, merged from all frames.
    gaps_s : time between consecutive frames.
    """

    def __init__(self, address: str, name: str = "measured") -> None:
        self.state: dict[str, Any] = {}
        self.gaps_s: list[float] = []
        self.samples = 0
        self._stop_id = 0
        self._delivered = threading.Event()
        where = address.replace("http://", "ws://").split("?")[0]
        self._open = contextlib.ExitStack()
        self._socket = self._open.enter_context(connect(f"{where}live?session={name}", max_size=None))
        self._closing = False
        self._reader = threading.Thread(target=self._read, daemon=True)
        self.send(t="next")
        self._reader.start()

    def claim(self) -> None:
        """Take control."""
        self.send(t="claim")

    def keys(self, *held: str) -> None:
        """Held driving keys, which are a heartbeat as well."""
        self.send(t="keys", keys=list(held))

    def stop_s(self, limit_s: float = 10.0) -> float:
        """Press STOP; the time until the page knows that the board has stopped, s."""
        self._stop_id += 1
        self._delivered.clear()
        began = time.monotonic()
        self.send(t="stop", id=self._stop_id)
        if not self._delivered.wait(limit_s):
            raise TimeoutError(f"no stop was acknowledged within {limit_s:g} s: {self.state}")
        return time.monotonic() - began

    def wait_for(self, name: str, condition: Any, limit_s: float = 60.0) -> None:
        """Wait until a part of the state fulfils a condition."""
        until = time.monotonic() + limit_s
        while not (name in self.state and condition(self.state[name])):
            if time.monotonic() > until:
                raise TimeoutError(f"{name} within {limit_s:g} s: {self.state}")
            time.sleep(0.02)

    def close(self) -> None:
        """Leave."""
        self._closing = True
        self._open.close()
        self._reader.join(5.0)

    def send(self, **message: Any) -> None:
        """Send a message of a page."""
        self._socket.send(json.dumps(message))

    def _read(self) -> None:
        last = None
        try:
            for text in self._socket:
                now = time.monotonic()
                if last is not None:
                    self.gaps_s.append(now - last)
                last = now
                frame = json.loads(text)
                self.samples += len(frame.pop("samples"))
                self.state.update(frame)
                if self.state.get("stop", {}).get("delivered", 0) >= self._stop_id:
                    self._delivered.set()
                self.send(t="next")
        except Exception:
            if not self._closing:
                raise
