"""What a page shows, in its address: reload, back, and a link to somebody else lead to the same picture."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from urllib.parse import parse_qsl, urlsplit

from nicegui import context


class Address:
    """The address of one tab: the page, and what it shows as named texts.

    Texts are written by `static/address.js`, which also keeps zoom and pan there.
    """

    def __init__(self, address: str) -> None:
        self._client = context.client
        self.path = ""
        self._texts: dict[str, str] = {}
        self.opened(address)

    def opened(self, address: str) -> None:
        """The tab has gone to another address."""
        parts = urlsplit(address)
        self.path, self._texts = parts.path, dict(parse_qsl(parts.query))

    def shows(self, address: str) -> bool:
        """Whether a page is at this address already."""
        parts = urlsplit(address)
        return (parts.path, dict(parse_qsl(parts.query))) == (self.path, self._texts)

    def text(self, name: str, otherwise: str = "") -> str:
        """A text of the address."""
        return self._texts.get(name, otherwise)

    def one_of(self, name: str, options: object, otherwise: str) -> str:
        """A text that has to be one of some options."""
        text = self.text(name)
        return text if text in options else otherwise  # type: ignore[operator]

    def numbers(self, name: str, count: int) -> list[float] | None:
        """Numbers with commas between; None if they are not there."""
        try:
            found = [float(part) for part in self.text(name).split(",")]
        except ValueError:
            return None
        return found if len(found) == count and all(map(math.isfinite, found)) else None

    def flag(self, name: str, otherwise: bool = False) -> bool:
        """A text that says yes or no."""
        return {"1": True, "0": False}.get(self.text(name), otherwise)

    def write(self, texts: Mapping[str, str] | None = None, /, *, step: bool = False, **more: str) -> None:
        """Change texts; an empty one is left out.

        Parameters
        ----------
        step : Back undoes this change.
        """
        changed = {
            name: text
            for name, text in (dict(texts or {}) | more).items()
            if self._texts.get(name, "") != text
        }
        if not changed:
            return
        for name, text in changed.items():
            self._texts[name] = text
            if not text:
                del self._texts[name]
        content = json.dumps([self.path, changed, step])
        self._client.run_javascript(f"window.truingAddress?.writeAt(...{content})")
