"""One browser and one service for all browser tests; no page may log errors."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import pytest

pytest.importorskip("playwright")
from playwright.sync_api import Browser, Error, Page, ViewportSize, expect, sync_playwright

CHROMIUM = next(
    (
        path
        for path in ("/usr/bin/chromium", shutil.which("chromium"))
        if path and Path(path).exists()
    ),
    None,
)
QUIET = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-extensions", "--in-process-gpu",
    "--disable-software-rasterizer",
)  # fmt: skip
WIDE: ViewportSize = {"width": 1280, "height": 900}
NARROW: ViewportSize = {"width": 390, "height": 844}
Scheme = Literal["light", "dark"]
Motion = Literal["reduce", "no-preference"]
Pages = Callable[["Look"], Page]
# A picture that moves takes half of a processor for as long as a page waits.
by_default_still = pytest.mark.parametrize(
    "motion", ["reduce", pytest.param("no-preference", marks=pytest.mark.slow)]
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark all browser tests; without chromium they are skipped."""
    folder = f"{Path(__file__).parent}/"
    for item in items:
        if str(item.path).startswith(folder):
            item.add_marker(pytest.mark.browser)
            if CHROMIUM is None:
                item.add_marker(pytest.mark.skip(reason="chromium is not installed"))


@dataclass
class Seen:
    """The activity of a page: console messages, script errors, requested addresses, statuses of 400
    and above.
    """

    console: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    addresses: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)


@dataclass
class Visit:
    """A page of the service with its recorded activity."""

    page: Page
    address: str
    seen: Seen

    def go(self, path: str) -> None:
        self.page.goto(self.address + path)


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """Closed after the last of these tests: while it is open its event loop runs, and `asyncio.run`
    in other tests fails.
    """
    expect.set_options(timeout=20_000)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(QUIET))
        yield browser
        browser.close()


@dataclass(frozen=True)
class Look:
    """The settings for viewing a page."""

    scripts: bool = True
    narrow: bool = False
    scheme: Scheme = "light"


@pytest.fixture(scope="package")
def pages(browser: Browser) -> Iterator[Pages]:
    """Pages opened on first use and then reused: a new one costs half a second of processor
    time.
    """
    opened: dict[Look, Page] = {}

    def page_of(look: Look) -> Page:
        if look not in opened:
            opened[look] = new_page(browser, look)
        return opened[look]

    yield page_of
    for page in opened.values():
        page.context.close()


def new_page(browser: Browser, look: Look) -> Page:
    size = NARROW if look.narrow else WIDE
    context = browser.new_context(
        java_script_enabled=look.scripts, viewport=size, color_scheme=look.scheme
    )
    page = context.new_page()
    page.set_default_timeout(20_000)
    return page


@pytest.fixture
def visit(pages: Pages, service: str) -> Iterator[Visit]:
    """A page with scripts."""
    yield from visited(pages(Look()), service)


@pytest.fixture
def plain(pages: Pages, service: str) -> Iterator[Visit]:
    """A page without scripts."""
    yield from visited(pages(Look(scripts=False)), service)


@pytest.fixture
def fresh(browser: Browser, service: str) -> Iterator[Visit]:
    """A page with nothing in its cache."""
    page = new_page(browser, Look())
    yield from visited(page, service)
    page.context.close()


def leave(page: Page) -> None:
    """Go to an empty page; if the page is just moving to its result, leave it after that."""
    for _ in range(3):
        try:
            page.goto("about:blank")
            return
        except Error as error:
            if "interrupted" not in str(error):
                raise
    raise AssertionError("The page goes on and on by itself.")


def whole(page: Page) -> None:
    """Wait until the page of a pending job, which shows the confirmed parts, becomes the result."""
    expect(page.locator("[data-events]")).to_have_count(0, timeout=120_000)


def cleared(page: Page) -> None:
    """Clear drafts after the page of a pending job has become its result, which takes up to three
    pages.
    """
    for _ in range(4):
        try:
            page.evaluate("sessionStorage.clear()")
            return
        except Error as error:
            if "destroyed" not in str(error):
                raise
            page.wait_for_load_state()
    raise AssertionError("The page goes on and on by itself.")


def visited(page: Page, address: str) -> Iterator[Visit]:
    """A page without earlier state; asserts at the end that its console is silent and no request
    left the host.
    """
    seen = Seen()
    listeners: dict[Any, Any] = {
        "console": lambda message: seen.console.append(f"{message.type}: {message.text}"),
        "pageerror": lambda error: seen.faults.append(str(error)),
        "request": lambda request: seen.addresses.append(request.url),
        "response": lambda r: (
            seen.refused.append(f"{r.status} {r.url}") if r.status >= 400 else None
        ),
    }
    for event, listener in listeners.items():
        page.on(event, listener)
    yield Visit(page, address, seen)
    # Drafts of forms are kept for the lifetime of a window; the next visitor has a new one.
    if page.url.startswith(address):
        cleared(page)
    # Scripts still running on the page end here, before the assertions.
    leave(page)
    for event, listener in listeners.items():
        page.remove_listener(event, listener)
    page.context.clear_cookies()
    # Chromium logs a rejected form and "busy" on the console; any other message is an error of
    # ours.
    noted = [
        text
        for text in seen.console
        if not re.search(r"the server responded with a status of (4|503)", text)
    ]
    assert noted == []
    assert seen.faults == []
    outside = [
        url
        for url in seen.addresses
        if not url.startswith((address, "blob:" + address, "data:", "about:"))
    ]
    assert outside == []
