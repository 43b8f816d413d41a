"""One browser, one board and one view for all browser tests; a page for each."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from _pytest.runner import runtestprotocol

from support.browser import start_browser
from web.browser_rig import Problems, Rig, open_page, page_state

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext, Page


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory, image: Path, native_library: Path) -> Iterator[Rig]:
    made = Rig(tmp_path_factory.mktemp("view"))
    yield made
    made.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        found = start_browser(playwright)
        yield found
        found.close()


@pytest.fixture
def problems() -> Problems:
    return Problems()


def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """A browser test that fails is run once more, with a warning that shows the first failure.

    On a busy machine an event is now and then lost between page and view; the cause is not known.
    """
    if "page" not in getattr(item, "fixturenames", ()):
        return None
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    reports = runtestprotocol(item, nextitem=nextitem, log=False)
    failed = next((report for report in reports if report.failed), None)
    if failed is not None:
        shown = "\n".join((failed.longreprtext, *(text for _, text in failed.sections)))
        item.warn(pytest.PytestWarning(f"{item.nodeid} failed, and is run once more:\n{shown}"))
        getattr(item, "_initrequest")()  # noqa: B009 - as pytest-rerunfailures does
        reports = runtestprotocol(item, nextitem=nextitem, log=False)
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[pytest.TestReport]:
    """What the page showed when its test failed: a limit on waiting alone does not say what went on."""
    report = yield
    page = getattr(item, "funcargs", {}).get("page")
    if call.when == "call" and report.failed and page is not None:
        report.sections.append(("page", page_state(page)))
    return report


@pytest.fixture(scope="module")
def context(browser: Browser) -> Iterator[BrowserContext]:
    """One cache for the pages of a module: the view's scripts are loaded and compiled once."""
    made = browser.new_context()
    yield made
    made.close()


@pytest.fixture
def page(context: BrowserContext, rig: Rig, problems: Problems) -> Iterator[Page]:
    made = open_page(context, rig, problems)
    yield made
    for each in context.pages:
        each.close()
    context.clear_cookies()
    assert not problems
