"""One browser, one board and one view for all browser tests; a page for each."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from web.browser_rig import Problems, Rig, open_page

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory, image: Path, native_library: Path) -> Iterator[Rig]:
    made = Rig(tmp_path_factory.mktemp("view"))
    yield made
    made.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture
def problems() -> Problems:
    return Problems()


@pytest.fixture
def page(browser: Browser, rig: Rig, problems: Problems) -> Iterator[Page]:
    made = open_page(browser, rig, problems)
    yield made
    made.close()
    assert not problems
