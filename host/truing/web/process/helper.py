"""A helper process that answers JSON requests line by line; started on first use, ended with the view."""

from __future__ import annotations

import asyncio
import contextlib
import subprocess
import sys
import threading
from typing import Any

import orjson

from truing.errors import TruingError

# A process that has needed more than this is ended when nobody has asked it for so long: memory that Python
# has freed stays with the process.
_LARGE_MB = 400.0
_IDLE_S = 15.0


class HelperProcess:
    """One process running a module, one request at a time.

    Parameters
    ----------
    module : run with `python -m`; it ends when its standard input closes.
    """

    def __init__(self, module: str) -> None:
        self._module = module
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self._idle: threading.Timer | None = None

    async def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to a request, without blocking the event loop.

        Raises
        ------
        TruingError : the error that the process reports, or that it has ended.
        """
        return await asyncio.to_thread(self.answer, request)

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """The same, for a thread that may wait."""
        content = self._ask(request)
        if "error" in content:
            raise TruingError(content["error"], content.get("next", ""))
        return content

    @property
    def is_running(self) -> bool:
        """Whether the process has been started and has not ended."""
        process = self._process
        return process is not None and process.poll() is None

    def close(self) -> None:
        """End it."""
        if self._idle is not None:
            self._idle.cancel()
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(5.0)
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()

    def _ask(self, request: dict[str, Any]) -> dict[str, Any]:
        with self._lock:
            if self._idle is not None:
                self._idle.cancel()
            process = self._process
            if process is None or process.poll() is not None:
                process = self._process = subprocess.Popen(
                    [sys.executable, "-m", self._module],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    # Ctrl-C in the terminal must reach only the view, which ends this process itself.
                    start_new_session=True,
                )
            assert process.stdin is not None
            assert process.stdout is not None
            try:
                process.stdin.write(orjson.dumps(request) + b"\n")
                process.stdin.flush()
                line = process.stdout.readline()
            except (OSError, ValueError):
                line = b""
        if not line:
            return {"error": "the helper process has ended", "next": "try again"}
        answer: dict[str, Any] = orjson.loads(line)
        if answer.pop("peak_mb", 0.0) > _LARGE_MB:
            self._idle = threading.Timer(_IDLE_S, self._end_idle)
            self._idle.daemon = True
            self._idle.start()
        return answer

    def _end_idle(self) -> None:
        if self._lock.acquire(blocking=False):
            try:
                self.close()
            finally:
                self._lock.release()
