"""The browser that tests of pages drive: Debian's Chromium without a window system."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Playwright

# The engine alone: the whole `chromium` also runs its window unseen, in processes of its own.
CHROMIUM = Path("/usr/bin/chromium-headless-shell")


def start_browser(playwright: Playwright) -> Browser:
    return playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
