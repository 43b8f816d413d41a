"""Upload of files dropped onto a page (runs, baselines, diagnoses), and download of reports."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.responses import FileResponse, JSONResponse
from starlette.concurrency import run_in_threadpool

from truing.errors import TruingError
from truing.recording.baseline import read_baseline
from truing.recording.writer import replace_file
from truing.web.models.error_model import read_verdict
from truing.web.runs.library import safe_name, save_dropped

# Three times the size of ten hours at 20 Hz.
_MAX_BYTES = 64_000_000
ADDRESS = "/dropped"


def add_upload(app: FastAPI, dropped: Path, diagnoses: Path) -> None:
    """Serve the upload address of the drop zones."""

    @app.post(ADDRESS)
    async def upload(request: Request, name: str = "") -> JSONResponse:
        data = b""
        async for chunk in request.stream():
            data += chunk
            if len(data) > _MAX_BYTES:
                return JSONResponse({"error": f"{name}: larger than {_MAX_BYTES // 1_000_000} MB"})
        return JSONResponse(await run_in_threadpool(store, name, data, dropped, diagnoses))


def add_reports(app: FastAPI, diagnoses: Path) -> None:
    """Serve the report pages of diagnoses."""

    @app.get("/diagnoses/{name}.html")
    def report(name: str) -> Response:
        path = diagnoses / f"{safe_name(name)}.html"
        return FileResponse(path) if path.is_file() else Response(status_code=404)


def store(name: str, data: bytes, dropped: Path, diagnoses: Path) -> dict[str, Any]:
    """Store a file according to its content; returns its path, or the error."""
    try:
        if name.endswith(".toml"):
            path = dropped / "baseline.toml"
            _replace_checked(path, data, read_baseline)
            return {"path": str(path), "kind": "baseline"}
        if name.endswith(".json") and _is_verdict(data):
            path = diagnoses / safe_name(name)
            _replace_checked(path, data, read_verdict)
            return {"path": str(path), "kind": "diagnosis"}
        path = save_dropped(dropped, name, data)
        return {"path": str(path), "kind": "run" if path.suffix == ".csv" else "metadata"}
    except TruingError as error:
        return {"error": f"{error.message}. {error.next_step}".rstrip(". ") + "."}
    except OSError as error:
        return {"error": f"{name}: {error}"}


def _replace_checked(path: Path, data: bytes, check: Callable[[Path], object]) -> None:
    """Write a file; if `check` then raises, restore the previous one."""
    before = path.read_bytes() if path.exists() else None
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, data)
    try:
        check(path)
    except TruingError:
        if before is None:
            path.unlink()
        else:
            replace_file(path, before)
        raise


def _is_verdict(data: bytes) -> bool:
    try:
        content = json.loads(data)
    except ValueError:
        return False
    return isinstance(content, dict) and "verdict" in content
