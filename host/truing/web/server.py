"""The HTTP server of the view: pages, map images, live web socket, access control."""

from __future__ import annotations

import logging
import socket
import threading
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from nicegui import app, core, ui

from truing.errors import PortError
from truing.web.access.security import Access, AccessMiddleware, access_for
from truing.web.live.page_socket import add_page_socket
from truing.web.pages import live, scene
from truing.web.pages.address import Address
from truing.web.pages.analysis import AnalysisPage
from truing.web.pages.compare import ComparePage
from truing.web.pages.components import STATIC
from truing.web.pages.experiments import ExperimentsPage
from truing.web.pages.layout import frame
from truing.web.pages.models import ModelsPage
from truing.web.pages.parameters import ParametersPage
from truing.web.pages.trajectory import TrajectoryPage
from truing.web.pages.world import WorldPage
from truing.web.runs.dropped_files import add_reports, add_upload
from truing.web.session import ViewSession

DEFAULT_PORT = 7780


@dataclass(frozen=True, slots=True)
class ServerOptions:
    """Where to serve, and whether to open a browser; port 0 takes a free one."""

    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    browser: bool = True


def serve(session: ViewSession, options: ServerOptions, announce: Callable[[str, Access], None]) -> None:
    """Serve until Ctrl-C; the wheels are stopped before anything else is shut down.

    Parameters
    ----------
    announce : called with the address to open (token included) and the access rules.
    """
    port = _free_port(options)
    access = access_for(options.host, port)
    # NiceGUI's socket accepts every origin; with None, engineio accepts the request's own host only.
    core.sio.eio.cors_allowed_origins = None
    app.add_static_files("/view-static", STATIC, max_cache_age=0)
    add_page_socket(app, session)
    add_upload(app, session.dropped_folder, session.take_file)
    add_reports(app, session.diagnosis_folder)
    app.on_startup(session.start)
    app.on_shutdown(session.close)
    app.add_middleware(AccessMiddleware, access=access)
    shown = "127.0.0.1" if options.host in ("0.0.0.0", "::") else options.host
    query = f"?token={access.token}" if access.token else ""
    address = f"http://{shown}:{port}/{query}"
    app.on_startup(lambda: _when_listening(shown, port, lambda: announce(address, access)))
    logging.getLogger("uvicorn.error").setLevel(logging.ERROR)
    ui.run(
        lambda: frame(session, _routes(session)),
        host=options.host,
        port=port,
        title="truing",
        dark=True,
        reload=False,
        show=f"/{query}" if options.browser else False,
        tailwind=False,
        show_welcome_message=False,
        # Long, so that a busy machine does not reload pages; the robot depends on the live web socket.
        reconnect_timeout=30.0,
        message_history_length=200,
        uvicorn_logging_level="error",
        ws_max_size=1_000_000,
    )


class _Page(Protocol):
    """A page with state of its own."""

    def build(self) -> None:
        """Make its elements."""


_PAGES: dict[str, Callable[[ViewSession, Address], _Page]] = {
    "/world": WorldPage,
    "/trajectory": TrajectoryPage,
    "/compare": ComparePage,
    "/models": ModelsPage,
    "/analysis": AnalysisPage,
    "/experiments": ExperimentsPage,
    "/parameters": ParametersPage,
}


def _routes(session: ViewSession) -> dict[str, Callable[[Address], None]]:
    def built(page: Callable[[ViewSession, Address], _Page]) -> Callable[[Address], None]:
        return lambda address: page(session, address).build()

    own = {path: built(page) for path, page in _PAGES.items()}
    return own | {"/": partial(live.build, session), "/scene": scene.build}


def _when_listening(host: str, port: int, then: Callable[[], None]) -> None:
    """Call `then`, from a thread of its own, once the server accepts connections."""

    def probe() -> None:
        for _ in range(200):
            try:
                socket.create_connection((host, port), timeout=1.0).close()
            except OSError:
                time.sleep(0.05)
            else:
                then()
                return

    threading.Thread(target=probe, name="announce", daemon=True).start()


def _free_port(options: ServerOptions) -> int:
    """The port to serve at, checked to be free before anything starts."""
    family = socket.AF_INET6 if ":" in options.host else socket.AF_INET
    with closing(socket.socket(family, socket.SOCK_STREAM)) as candidate:
        candidate.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            candidate.bind((options.host, options.port))
        except (OSError, UnicodeError, OverflowError) as error:
            raise PortError(
                f"{options.host}:{options.port}: cannot serve there ({error})",
                "another `truing view` may be running; choose another with --port N (0: any free one)",
            ) from error
        port: int = candidate.getsockname()[1]
        return port
