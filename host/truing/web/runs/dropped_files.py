"""Upload of files dropped onto a page (runs, baselines, diagnoses), and download of reports.

A file is written to disk as it arrives and read in a process of its own, so that the frames and the stops of
the pages do not wait for it.
"""

from __future__ import annotations

import asyncio
import contextlib
import shutil
import tempfile
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, TypeAlias

from fastapi import FastAPI, Request, Response
from fastapi.responses import FileResponse, JSONResponse
from starlette.requests import ClientDisconnect

from truing.errors import UploadRefusedError
from truing.web.runs.library import safe_name

# A recording is read as a whole: numbers take about three times the file's size in memory meanwhile, a file
# with quotes, words or an error, which is read cell by cell, about fourteen times.
MAX_BYTES = 200_000_000
ADDRESS = "/dropped"
_INCOMING = ".incoming"
# Written in pieces of this size, each from a thread: a disk may block for long.
_PIECE_BYTES = 1 << 20
_SPARE_DISK_BYTES = 100_000_000
# Answered to a client that has left; nobody reads it.
_CLIENT_CLOSED = 499

Check: TypeAlias = Callable[[dict[str, str], Path], Awaitable[dict[str, Any]]]


def add_upload(app: FastAPI, dropped: Path, check: Check) -> None:
    """Serve the upload address of the drop zones.

    Parameters
    ----------
    dropped : folder for dropped recordings, also while they arrive.
    check : reads a file and puts it where it belongs, by the parameters of the request; returns what became
        of it, a question, or the error.
    """
    one_at_a_time = asyncio.Semaphore(1)
    # What a view that was killed has left there.
    shutil.rmtree(dropped / _INCOMING, ignore_errors=True)

    @app.post(ADDRESS)
    async def upload(request: Request, name: str = "") -> Response:
        announced = request.headers.get("content-length", "")
        try:
            _admit(name, int(announced) if announced.isdigit() else 0, dropped)
            async with one_at_a_time:
                with _incoming(dropped) as folder:
                    part = folder / (safe_name(name) or "run.csv")
                    await _receive(request, part, name)
                    return JSONResponse(await check(dict(request.query_params), part))
        except UploadRefusedError as refusal:
            return JSONResponse({"error": refusal.message}, status_code=413)
        except ClientDisconnect:
            return Response(status_code=_CLIENT_CLOSED)
        except OSError as error:
            return JSONResponse({"error": f"{name}: {error.strerror or error}"}, status_code=507)


def add_reports(app: FastAPI, diagnoses: Path) -> None:
    """Serve the report pages of diagnoses."""

    @app.get("/diagnoses/{name}.html")
    def report(name: str) -> Response:
        path = diagnoses / f"{safe_name(name)}.html"
        return FileResponse(path) if path.is_file() else Response(status_code=404)


def _admit(name: str, size: int, dropped: Path) -> None:
    """Refuse by size, before anything has been read."""
    if size > MAX_BYTES:
        raise UploadRefusedError(
            f"{name}: {size / 1e6:.0f} MB; a page takes files of up to {MAX_BYTES // 1_000_000} MB. "
            "`truing import FILE` reads larger ones."
        )
    dropped.mkdir(parents=True, exist_ok=True)
    free = shutil.disk_usage(dropped).free
    if size + _SPARE_DISK_BYTES > free:
        raise UploadRefusedError(
            f"{name}: {size / 1e6:.0f} MB do not fit on the disk ({free / 1e6:.0f} MB free)."
        )


@contextlib.contextmanager
def _incoming(dropped: Path) -> Any:
    """A folder for one arriving file, removed afterwards with what is still in it."""
    parent = dropped / _INCOMING
    parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(dir=parent))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


async def _receive(request: Request, part: Path, name: str) -> None:
    """Write a request's body to disk.

    Raises
    ------
    ClientDisconnect : the client left before the end.
    """
    size = 0
    piece = bytearray()
    with part.open("wb") as file:
        async for chunk in request.stream():
            size += len(chunk)
            if size > MAX_BYTES:
                raise UploadRefusedError(f"{name}: larger than {MAX_BYTES // 1_000_000} MB.")
            piece += chunk
            if len(piece) >= _PIECE_BYTES:
                await asyncio.to_thread(file.write, bytes(piece))
                piece.clear()
        await asyncio.to_thread(file.write, bytes(piece))
