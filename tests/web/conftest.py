"""One browser, one board and one view for all browser tests; a page for each."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from web.browser_bench import Bench, Problems, open_page


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, image: Path, native_library: Path) -> Iterator[Bench]:
    made = Bench(tmp_path_factory.mktemp("view"))
    yield made
    made.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture
def problems() -> Problems:
    return Problems()


@pytest.fixture
def page(browser: Browser, bench: Bench, problems: Problems) -> Iterator[Page]:
    made = open_page(browser, bench, problems)
    yield made
    made.close()
    assert not problems
