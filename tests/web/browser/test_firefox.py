"""The pages in the system's Firefox: pictures, labels, axe, drafts, and pages without errors."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.web.browser import firefox
from tests.web.browser.firefox import Firefox
from tests.web.browser.test_looks import MORE, PATHLESS, SMALLEST, SYSTEMS, TOUCHING, WIDTHS

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(firefox.PROGRAM is None, reason="Firefox is not installed"),
]
FITTED = {"equations": "x'' = -1.02*x + 0.4*y; y'' = 0.5*x - y", "nearest": {"errors": "0.02"}}
FAMILY = {"equations": "x'' = -a*x + b*y; y'' = c*x - d*y", "family": True}
PAGES = (
    "/", "/?kind=nonholonomic", "/ask", "/simulate", "/nearest", "/atlas", "/batch", "/learn",
    "/docs", "/teach", "/exercise/new", "/class/new", "/exercise?equations=x''=-x", "/about",
)  # fmt: skip
READY = "() => !document.querySelector('div[data-later], [data-events]')"
DRAWN = "() => document.querySelector('.motion svg:not(.blank) path.past')?.getAttribute('d').length > 50"
TOO_WIDE = "() => document.documentElement.scrollWidth > innerWidth"


@pytest.fixture(scope="module")
def window() -> Iterator[Firefox]:
    with firefox.opened() as found:
        yield found


def place_of(service: str, document: dict[str, Any]) -> str:
    """The page of an answer."""
    with httpx.Client(base_url=service, timeout=90, headers={"Prefer": "wait=60"}) as client:
        found = client.post("/v1/solve", json=document)
    place = found.headers.get("location") or found.headers["content-location"]
    return f"{service}/results/{place.rpartition('/')[2]}"


def test_no_label_touches_another_and_each_picture_is_drawn(window: Firefox, service: str) -> None:
    faults = {}
    for name, document in (SYSTEMS | MORE).items():
        window.go(place_of(service, document))
        for width in WIDTHS:
            window.resize(width)
            window.until(DRAWN) if name not in PATHLESS else time.sleep(0.5)
            found = window.run(TOUCHING)
            if found or window.run(TOO_WIDE) or window.run(SMALLEST) < 11:
                faults[name, width] = found
    assert faults == {}


def test_axe_finds_nothing(window: Firefox, service: str) -> None:
    (folder,) = importlib.util.find_spec("axe_playwright_python").submodule_search_locations  # type: ignore[union-attr, misc]
    axe = (Path(folder) / "axe.min.js").read_text(encoding="utf-8")
    script = (
        f"async () => {{ {axe}; const found = await axe.run(document, {{resultTypes: ['violations']}});"
        " return found.violations.flatMap((one) => one.nodes.map((node) => `${one.id}: ${node.html.slice(0, 120)}`)) }"
    )
    faults = {}
    pages = [service + path for path in PAGES]
    pages += [place_of(service, FITTED) + "/nearest", place_of(service, FAMILY) + "/family"]
    for width in (320, 1280):
        for page in pages:
            window.go(page)
            window.resize(width)
            window.until(READY)
            found = window.run(script)
            if found or window.run(TOO_WIDE):
                faults[page, width] = found
    assert faults == {}


def test_a_draft_comes_back_with_its_own_answer(window: Firefox, service: str) -> None:
    """After a reload, Back, and Forward the box has what was typed, and the answer is the one to that."""
    window.resize(1280)
    window.go(f"{service}/")
    says = "(words) => document.querySelector('#live:not(.old) #glance')?.innerText.includes(words)"
    typed = "() => document.querySelector('#equations').value"
    for text, words in (
        ("x'' = -x - x'^2*y\ny'' = -y + x'*y'", "No regular Lagrangian"),
        ("x'' = 0", "there is a Lagrangian"),
    ):
        window.type("#equations", text)
        window.until(says, words)
        window.command("WebDriver:Refresh")
        window.until(says, words)
        assert window.run(typed) == text
        window.go(f"{service}/learn")
        window.command("WebDriver:Back")
        window.until(says, words)
        assert window.run(typed) == text
        window.command("WebDriver:Forward")
        window.command("WebDriver:Back")
        window.until(says, words)
        assert window.run(typed) == text


def test_both_motions_of_a_nearest_system_are_drawn(window: Firefox, service: str) -> None:
    damped = {"equations": "x'' = -1.02*x - 0.05*x'", "nearest": {"errors": "0.02"}}
    window.go(place_of(service, damped) + "/nearest")
    window.until(DRAWN)
    begin = window.run("() => document.querySelector('path.beside').getAttribute('d')")
    assert len(begin) > 50
    conserved, other = "dl.meters > div:first-child dd", "dl.meters > div:last-child dd"
    value = "(place) => Number(document.querySelector(place).textContent.replace('\\u2212', '-'))"
    window.until("() => Number(document.querySelector('[data-now]').textContent.slice(4)) > 1")
    first = window.run(value, conserved)
    window.until("() => Number(document.querySelector('[data-now]').textContent.slice(4)) > 3")
    assert abs(window.run(value, conserved) - first) < 2e-4
    assert abs(window.run(value, other) - first) > 1e-3  # of the fitted system it is not conserved
