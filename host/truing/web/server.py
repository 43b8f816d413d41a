"""Serves the view: pages, pictures and the live link, to whom it may concern and nobody else."""

from __future__ import annotations

import logging
import socket
import threading
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass

from nicegui import app, core, ui

from truing.errors import PortError
from truing.web.dropped_files import add_dropping, add_reports
from truing.web.layout import STATIC, frame
from truing.web.live_link import add_live_link
from truing.web.pages import analysis, compare, live, models, scene, trajectory, world
from truing.web.security import Access, Gate, access_for
from truing.web.session import ViewSession

DEFAULT_PORT = 7780


@dataclass(frozen=True, slots=True)
class ServerOptions:
    """Where to serve, and whether to open a browser; port 0 takes a free one."""

    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    browser: bool = True


def serve(session: ViewSession, options: ServerOptions, announce: Callable[[str, Access], None]) -> None:
    """Serve until Ctrl-C; the wheels are stopped before anything else goes.

    Parameters
    ----------
    announce : told the address to open, token included, and who may come.
    """
    port = _free_port(options)
    access = access_for(options.host, port)
    # NiceGUI's socket takes every origin; engineio's own rule for None is the request's own host.
    core.sio.eio.cors_allowed_origins = None
    app.add_static_files("/view-static", STATIC, max_cache_age=0)
    add_live_link(app, session)
    add_dropping(app, session.dropped_folder, session.diagnosis_folder)
    add_reports(app, session.diagnosis_folder)
    app.on_startup(session.start)
    app.on_shutdown(session.close)
    app.add_middleware(Gate, access=access)
    shown = "127.0.0.1" if options.host in ("0.0.0.0", "::") else options.host
    query = f"?token={access.token}" if access.token else ""
    address = f"http://{shown}:{port}/{query}"
    app.on_startup(lambda: _when_listening(shown, port, lambda: announce(address, access)))
    logging.getLogger("uvicorn.error").setLevel(logging.ERROR)
    ui.run(
        lambda: frame(_routes(session)),
        host=options.host,
        port=port,
        title="truing",
        dark=True,
        reload=False,
        show=f"/{query}" if options.browser else False,
        tailwind=False,
        show_welcome_message=False,
        # Long, so that a busy machine reloads no page; the wheels hang on the live link, which is quick.
        reconnect_timeout=30.0,
        message_history_length=200,
        uvicorn_logging_level="error",
        ws_max_size=1_000_000,
    )


def _routes(session: ViewSession) -> dict[str, Callable[[], None]]:
    return {
        "/": lambda: live.build(session),
        "/world": lambda: world.build(session),
        "/trajectory": lambda: trajectory.build(session),
        "/compare": lambda: compare.build(session),
        "/models": lambda: models.build(session),
        "/analysis": lambda: analysis.build(session),
        "/scene": scene.build,
    }


def _when_listening(host: str, port: int, then: Callable[[], None]) -> None:
    """Call `then`, from a thread of its own, once somebody answers there."""

    def knock() -> None:
        for _ in range(200):
            try:
                socket.create_connection((host, port), timeout=1.0).close()
            except OSError:
                time.sleep(0.05)
            else:
                then()
                return

    threading.Thread(target=knock, name="announce", daemon=True).start()


def _free_port(options: ServerOptions) -> int:
    """The port to serve at, seen to be free before anything starts."""
    family = socket.AF_INET6 if ":" in options.host else socket.AF_INET
    with closing(socket.socket(family, socket.SOCK_STREAM)) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((options.host, options.port))
        except (OSError, UnicodeError, OverflowError) as error:
            raise PortError(
                f"{options.host}:{options.port}: cannot serve there ({error})",
                "another `truing view` may be running; choose another with --port N (0: any free one)",
            ) from error
        port: int = probe.getsockname()[1]
        return port
