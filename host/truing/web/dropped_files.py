"""Files in and out: takes what is dropped onto a page (runs, baselines, diagnoses), gives reports."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.responses import FileResponse, JSONResponse
from starlette.concurrency import run_in_threadpool

from truing.baseline import read_baseline
from truing.errors import TruingError
from truing.recording_writer import replace_file
from truing.web.error_model import read_verdict
from truing.web.run_library import safe_name, save_dropped

# Ten hours at 20 Hz are a third of it.
_MOST_BYTES = 64_000_000
ADDRESS = "/dropped"


def add_dropping(app: FastAPI, dropped: Path, diagnoses: Path) -> None:
    """Serve the address that the drop zones post to."""

    @app.post(ADDRESS)
    async def take(request: Request, name: str = "") -> JSONResponse:
        data = b""
        async for chunk in request.stream():
            data += chunk
            if len(data) > _MOST_BYTES:
                return JSONResponse({"error": f"{name}: is larger than {_MOST_BYTES // 1_000_000} MB"})
        return JSONResponse(await run_in_threadpool(keep, name, data, dropped, diagnoses))


def add_reports(app: FastAPI, diagnoses: Path) -> None:
    """Serve the pages that diagnoses wrote."""

    @app.get("/diagnoses/{name}.html")
    def report(name: str) -> Response:
        path = diagnoses / f"{safe_name(name)}.html"
        return FileResponse(path) if path.is_file() else Response(status_code=404)


def keep(name: str, data: bytes, dropped: Path, diagnoses: Path) -> dict[str, Any]:
    """Keep a file by what it is; its place, or what is wrong with it."""
    try:
        if name.endswith(".toml"):
            path = dropped / "baseline.toml"
            _replace_if(path, data, read_baseline)
            return {"path": str(path), "kind": "baseline"}
        if name.endswith(".json") and _is_verdict(data):
            path = diagnoses / safe_name(name)
            _replace_if(path, data, read_verdict)
            return {"path": str(path), "kind": "diagnosis"}
        path = save_dropped(dropped, name, data)
        return {"path": str(path), "kind": "run" if path.suffix == ".csv" else "metadata"}
    except TruingError as error:
        return {"error": f"{error.message}. {error.next_step}".rstrip(". ") + "."}
    except OSError as error:
        return {"error": f"{name}: {error}"}


def _replace_if(path: Path, data: bytes, check: Callable[[Path], object]) -> None:
    """Write a file, unless `check` then raises: what was there before stays."""
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
