"""Access control: only pages that the view served itself, and from other machines only with the token.

A page of another site can send requests and open web sockets to 127.0.0.1: browsers allow it, so the server
has to refuse (OWASP, "Cross-Site WebSocket Hijacking"). Every request's Host must be an address that the view
serves, which also prevents DNS rebinding, and an Origin, if present, must be that same host.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import Any, TypeAlias
from urllib.parse import parse_qs, quote, urlencode, urlsplit

Scope: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send: TypeAlias = Callable[[MutableMapping[str, Any]], Awaitable[None]]
AsgiApp: TypeAlias = Callable[[Scope, Receive, Send], Awaitable[None]]

_COOKIE = "truing_view"
_LOOPBACK_NAMES = ("127.0.0.1", "localhost", "[::1]")


def content_policy(host: str) -> str:
    """A Content-Security-Policy that lets a page fetch from the view alone (Vue's templates need eval)."""
    rules = (
        "default-src 'self'",
        "script-src 'self' 'unsafe-inline' 'unsafe-eval'",
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data: blob:",
        "font-src 'self' data:",
        f"connect-src 'self' ws://{host} wss://{host} blob: data:",
        "worker-src 'self' blob:",
        "object-src 'none'",
        "base-uri 'self'",
        "form-action 'self'",
        "frame-ancestors 'none'",
    )
    return "; ".join(rules)


@dataclass(frozen=True, slots=True)
class Access:
    """Allowed hosts and the access token.

    Attributes
    ----------
    hosts : allowed values of the Host header, port included; empty: any (the token alone protects).
    token : secret that a client must present; None on the loopback address.
    cookie : name under which a browser keeps the token. Cookies of a host are shared by all its ports, so
        that two views on one machine need two names.
    """

    hosts: frozenset[str]
    token: str | None = None
    cookie: str = _COOKIE

    def host_allowed(self, host: str) -> bool:
        """Whether a Host header names this server."""
        return host.lower() in self.hosts if self.hosts else bool(host)

    def origin_allowed(self, origin: str | None, host: str) -> bool:
        """Whether a request comes from a page of this server, or from no page at all."""
        if origin is None:
            return True
        parts = urlsplit(origin)
        return parts.scheme in ("http", "https") and parts.netloc.lower() == host.lower()

    def token_valid(self, given: str | None) -> bool:
        """Whether `given` is the token, or none is required."""
        return self.token is None or (
            given is not None and hmac.compare_digest(given.encode(), self.token.encode())
        )


def access_for(host: str, port: int) -> Access:
    """The rules for a server that listens at `host`.

    On the loopback address every local client is allowed; on any other a random token is required.
    """
    if is_loopback(host):
        return Access(frozenset(f"{name}:{port}" for name in (*_LOOPBACK_NAMES, host.lower())))
    names = () if host in ("0.0.0.0", "::") else (host.lower(),)
    allowed = frozenset(f"{name}:{port}" for name in names)
    return Access(allowed, secrets.token_urlsafe(18), f"{_COOKIE}_{port}")


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach `host`."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


class AccessMiddleware:
    """ASGI middleware in front of pages, files and both kinds of web socket."""

    def __init__(self, app: AsgiApp, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        host = headers.get("host", "")
        refusal = self._refusal(headers, host)
        if refusal:
            await _refuse(scope, send, refusal)
            return
        if self._access.token is not None and not self._access.token_valid(
            _cookie(headers, self._access.cookie)
        ):
            query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
            if scope["type"] == "http" and self._access.token_valid(query.get("token", [None])[0]):
                await _admit(scope, send, query, self._access)
                return
            await _refuse(
                scope, send, "this view needs the address with the token that `truing view` printed"
            )
            return

        async def guarded(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [
                    *message.get("headers", []),
                    (b"content-security-policy", content_policy(host).encode()),
                    (b"x-content-type-options", b"nosniff"),
                    (b"referrer-policy", b"no-referrer"),
                    (b"cross-origin-resource-policy", b"same-origin"),
                ]
            await send(message)

        await self._app(scope, receive, guarded)

    def _refusal(self, headers: dict[str, str], host: str) -> str:
        if not self._access.host_allowed(host):
            return "this address is not served by the view"
        if not self._access.origin_allowed(headers.get("origin"), host):
            return "a page of another site may not use the view"
        if headers.get("sec-fetch-site") == "cross-site" and headers.get("sec-fetch-mode") != "navigate":
            return "a page of another site may not use the view"
        return ""


def _cookie(headers: dict[str, str], name: str) -> str | None:
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return None
    return None if morsel is None else morsel.value


async def _refuse(scope: Scope, send: Send, why: str) -> None:
    if scope["type"] == "websocket":
        # A close before the handshake is accepted is answered with status 403.
        await send({"type": "websocket.close", "code": 1008, "reason": why})
        return
    body = f"Refused: {why}.\n".encode()
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": 403, "headers": headers})
    await send({"type": "http.response.body", "body": body})


async def _admit(scope: Scope, send: Send, query: dict[str, list[str]], access: Access) -> None:
    """Store the token in an HttpOnly cookie and remove it from the address."""
    rest = urlencode([(k, v) for k, values in query.items() if k != "token" for v in values])
    target = _own_path(scope["path"]) + (f"?{rest}" if rest else "")
    cookie = f"{access.cookie}={access.token}; HttpOnly; SameSite=Strict; Path=/"
    headers = [(b"location", target.encode()), (b"set-cookie", cookie.encode()), (b"content-length", b"0")]
    await send({"type": "http.response.start", "status": 303, "headers": headers})
    await send({"type": "http.response.body", "body": b""})


def _own_path(path: str) -> str:
    """A path that no browser takes for another site's address.

    `//evil.example` is an address without its scheme, and browsers read a backslash as a slash.
    """
    return "/" + quote(path.replace("\\", "/").lstrip("/"))
