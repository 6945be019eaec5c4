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
from tests.web.browser.test_looks import (
    MORE,
    PATHLESS,
    REDRAWN,
    SMALL,
    SYSTEMS,
    TOUCHING,
    WIDTHS,
)
from tests.web.browser.test_returning import PAGES as PAGES_WITH_ANSWERS

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
READY = """() => !document.querySelector('div[data-later], [data-events]')
    && !document.querySelector('#glance:not(:has([data-settled]:not([data-cut])))')"""
DRAWN = "() => document.querySelector('.motion svg:not(.blank) path.past')?.getAttribute('d').length > 50"
TOO_WIDE = "() => document.documentElement.scrollWidth > innerWidth"


@pytest.fixture(scope="module")
def window() -> Iterator[Firefox]:
    with firefox.opened() as found:
        yield found


def place_of(service: str, document: dict[str, Any]) -> str:
    """The page of an answer."""
    with httpx.Client(base_url=service, timeout=90, headers={"Prefer": "wait=60"}) as client:
        while (found := client.post("/v1/solve", json=document)).status_code == 503:
            time.sleep(float(found.headers["retry-after"]))  # busy with other questions
    place = found.headers.get("location") or found.headers["content-location"]
    return f"{service}/results/{place.rpartition('/')[2]}"


def test_no_label_touches_another_and_each_picture_is_drawn(window: Firefox, service: str) -> None:
    faults = {}
    for name, document in (SYSTEMS | MORE).items():
        window.go(place_of(service, document))
        for width in WIDTHS:
            window.resize(width)
            window.until(REDRAWN)
            window.until(DRAWN) if name not in PATHLESS else time.sleep(0.5)
            found = [*window.run(TOUCHING), window.run(TOO_WIDE), *window.run(SMALL)]
            if any(found):
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


# The text of a box, and what the part that answers it says, unless that has faded.
PAIR = """(box, answer) => {
    const said = [...document.querySelectorAll(answer)]
        .filter((one) => one.getClientRects().length && Number(getComputedStyle(one).opacity) > 0.5);
    return [document.querySelector(box)?.value.trim() ?? "", said.map((one) => one.innerText).join(" ")];
}"""
SAYS = f"""(box, answer, text, words) => {{
    const [typed, said] = ({PAIR})(box, answer);
    return typed === text && said.includes(words);
}}"""
CLICK = """(words) => [...document.querySelectorAll("main button")]
    .find((one) => one.innerText.includes(words) && one.getClientRects().length).click()"""


@pytest.mark.parametrize("path", PAGES_WITH_ANSWERS)
def test_a_draft_comes_back_with_its_own_answer(window: Firefox, service: str, path: str) -> None:
    """After a reload, Back, and Forward a box has what was typed, and no answer is shown but the one to that."""
    beside = PAGES_WITH_ANSWERS[path]
    place = (beside.box, beside.answer)
    window.resize(1280)
    own = path == "own"
    window.go(place_of(service, {"equations": "x'' = -x"}) if own else f"{service}{path}")
    if own:
        window.run("() => document.querySelectorAll('details').forEach((one) => (one.open = true))")

    def agree() -> None:
        window.until("(box) => document.querySelector(box) !== null", beside.box)  # after Back
        typed, said = window.until(PAIR, *place)  # while a page changes there is none
        wrong = [text for text, words in beside.said.items() if text != typed and words in said]
        right = beside.said.get(typed)
        assert not wrong or (right is not None and right in said), (typed, said)

    def answered(text: str) -> None:
        window.until("() => document.readyState === 'complete'")  # and the scripts have run
        window.until("(box, text) => document.querySelector(box)?.value === text", beside.box, text)
        agree()
        if beside.sends and window.run(
            "(box) => { const one = document.querySelector(box); return one.value !== one.defaultValue }",
            beside.box,
        ):
            window.run(CLICK, beside.sends)
        window.until(SAYS, *place, text, beside.said[text])
        window.until("() => document.readyState === 'complete'")
        agree()

    for text in beside.said:
        window.type(beside.box, text)
        answered(text)
    first, last = next(iter(beside.said)), list(beside.said)[-1]
    window.command("WebDriver:Refresh")
    answered(last)
    window.type(beside.box, first)
    agree()
    window.go(f"{service}/learn")  # perhaps before it is answered
    window.command("WebDriver:Back")
    agree()
    window.command("WebDriver:Forward")
    window.command("WebDriver:Back")
    agree()
    time.sleep(0.3)
    agree()


def test_a_form_and_its_picture_come_back(window: Firefox, service: str) -> None:
    """Of a scene, and of the member of a family."""
    aria = (
        "document.querySelector('[data-hand]')?.getAttribute('aria-valuetext')?.includes('0.625')"
    )
    scene = f"() => document.querySelector('[name=\"position.x1\"]').value === '0.625' && {aria}"
    member = """() => document.querySelector("[data-member] p")?.innerText.includes("b = 0.25")
        && Number(document.querySelector('[name="at.b"]').value) === 0.25"""
    family = place_of(service, FAMILY) + "/family?at.a=2&at.b=0.5&at.c=0.5&at.d=2"
    for page, box, text, shows in (
        (f"{service}/simulate?system=chain:springs:2", "[name='position.x1']", "0.625", scene),
        (family, "[name='at.b']", "0.25", member),
    ):
        window.go(page)
        window.until("() => document.querySelector('[data-hand]')")
        window.type(box, text)
        window.until(shows)
        window.command("WebDriver:Refresh")
        window.until(shows)
        window.go(f"{service}/learn")
        window.command("WebDriver:Back")
        window.until(shows)
        window.command("WebDriver:Forward")
        window.command("WebDriver:Back")
        window.until(shows)


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
