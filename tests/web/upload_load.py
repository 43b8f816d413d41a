"""The live link of a view while a large recording is uploaded: frames, stops, memory.

.venv/bin/python tests/web/upload_load.py --megabytes 100
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import threading
import time
from dataclasses import asdict, dataclass
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlencode, urlsplit

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from web.live_client import LiveClient
from web.process_memory import helpers_mb, resident_mb
from web.view_process import ViewProcess

HEADER = "t_s,effort_left,effort_right,vel_left_mps,vel_right_mps,x_m,y_m,theta_rad\n"
ROW = "0.000,0.3456,0.3456,0.31234,0.31234,0.12345,0.23456,0.34567\n"
_STOP_EVERY_S = 0.5


@dataclass(frozen=True, slots=True)
class UploadLoad:
    """Result.

    Attributes
    ----------
    upload_s : until the answer, check included.
    stop_s, gap_s : the longest stop and the longest time between two frames.
    grown_mb : of the view and its helpers, after the upload.
    """

    upload_s: float
    stops: int
    stop_s: float
    gap_s: float
    grown_mb: float
    answer: dict[str, Any]


def recording(path: Path, megabytes: float) -> Path:
    """A run of that size."""
    with path.open("w", encoding="utf-8") as file:
        file.write(HEADER)
        row = 0
        while file.tell() < 1e6 * megabytes:
            file.write("".join(f"{0.005 * k:.3f}{ROW[5:]}" for k in range(row, row + 10_000)))
            row += 10_000
    return path


def post(address: str, path: Path, name: str, **more: str) -> dict[str, Any]:
    """Upload a file as a page's drop zone does; `more`: what the page says of it beside its name."""
    connection = HTTPConnection(urlsplit(address).netloc, timeout=600)
    with path.open("rb") as body:
        headers = {"Content-Length": str(path.stat().st_size)}
        connection.request("POST", f"/dropped?{urlencode({'name': name, **more})}", body, headers)
        answer: dict[str, Any] = json.loads(connection.getresponse().read())
    connection.close()
    return answer


def measure(folder: Path, file: Path, settle_s: float = 3.0) -> UploadLoad:
    """Upload a file to a view of its own, and press STOP twice a second meanwhile."""
    view = ViewProcess(folder)
    pid = view.process.pid
    try:
        page = LiveClient(view.address)
        page.wait_for("link", lambda link: link["state"] == "connected")
        time.sleep(settle_s)
        before = resident_mb(pid) + helpers_mb(pid)
        answers: list[dict[str, Any]] = []
        upload = threading.Thread(target=lambda: answers.append(post(view.address, file, file.name)))
        page.gaps_s.clear()
        began = time.monotonic()
        upload.start()
        stops = []
        while upload.is_alive():
            stops.append(page.stop_s(30.0))
            time.sleep(_STOP_EVERY_S)
        spent = time.monotonic() - began
        gaps = list(page.gaps_s)
        time.sleep(settle_s)
        after = resident_mb(pid) + helpers_mb(pid)
        page.close()
    finally:
        view.close()
    return UploadLoad(spent, len(stops), max(stops), max(gaps), after - before, answers[0])


def main() -> int:
    """Print the figures."""
    parser = argparse.ArgumentParser(description="Upload a large recording to a view and measure the link.")
    parser.add_argument("--megabytes", type=float, default=100.0)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file = recording(Path(folder) / "large.csv", arguments.megabytes)
        print(json.dumps(asdict(measure(Path(folder) / "out", file)), indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
