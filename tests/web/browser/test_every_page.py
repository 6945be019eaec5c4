"""What holds on every page: no violation of axe, nothing too heavy, nothing too wide."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterator

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Request, expect

from .conftest import Look, Pages, Scheme, Visit, visited, whole

PAGES = (
    "/", "/?kind=nonholonomic", "/ask", "/simulate", "/atlas", "/batch", "/learn", "/docs", "/teach", "/exercise/new",
    "/exercise?equations=x''=-x", "/results/none",
)  # fmt: skip
# The default suite looks at each page once; test_every_state.py looks at all of them in all ways.
LOOKED_AT = {"light": PAGES[:3], "dark": ("/", *PAGES[3:])}
RESULTS = {"light": "vertically-rolling-disk-first", "dark": "vertically-rolling-disk-second"}
HEAVIEST = 100_000


@pytest.fixture(params=["light", "dark"])
def scheme(request: pytest.FixtureRequest) -> Scheme:
    found: Scheme = request.param
    return found


@pytest.fixture
def colored(pages: Pages, service: str, scheme: Scheme) -> Iterator[Visit]:
    yield from visited(pages(Look(narrow=scheme == "dark", scheme=scheme)), service)


def violations(visit: Visit) -> list[str]:
    """What axe finds, with the place."""
    # Of the rules that hold, one place each: thousands of them would be sent otherwise.
    found = Axe().run(visit.page, options={"resultTypes": ["violations"]}).response["violations"]
    return [f"{v['id']}: {node['html'][:120]}" for v in found for node in v["nodes"]]


def open_all(visit: Visit) -> None:
    visit.page.evaluate("document.querySelectorAll('details').forEach(node => (node.open = true))")


def is_too_wide(visit: Visit) -> bool:
    too_wide: bool = visit.page.evaluate("document.documentElement.scrollWidth > innerWidth")
    return too_wide


@pytest.mark.slow
def test_axe_finds_nothing_on_any_page(colored: Visit, scheme: Scheme) -> None:
    for path in LOOKED_AT[scheme]:
        colored.go(path)
        if path != "/atlas":  # its table has hundreds of equal rows
            open_all(colored)
        assert (path, violations(colored)) == (path, [])
        assert (path, is_too_wide(colored)) == (path, False)


@pytest.mark.slow
def test_axe_finds_nothing_on_a_result(colored: Visit, scheme: Scheme) -> None:
    colored.go(f"/?example={RESULTS[scheme]}")
    colored.page.get_by_role("button", name="Open the answer").click()
    expect(colored.page.locator("#verdict")).to_be_visible()
    whole(colored.page)
    open_all(colored)
    assert violations(colored) == []
    assert not is_too_wide(colored)


@pytest.mark.slow
def test_axe_finds_nothing_where_a_fault_is_shown(colored: Visit) -> None:
    colored.go("/")
    colored.page.get_by_label("Equations", exact=True).fill("x'' = (y")
    expect(colored.page.locator("#understood mark")).to_be_visible()
    assert violations(colored) == []


IN_SIGHT = """[...document.images].filter((image) => image.getBoundingClientRect().top < innerHeight)
  .map((image) => image.src)"""


def weight(visit: Visit, path: str) -> int:
    """Bytes of what the first screen needs, as they are sent: the page, what it links to, the pictures in sight."""
    loaded: list[Request] = []

    def note(request: Request) -> None:
        loaded.append(request)

    visit.page.on("requestfinished", note)
    visit.go(path)
    visit.page.wait_for_load_state("load")
    visit.page.remove_listener("requestfinished", note)
    # Browsers fetch pictures far below the screen ahead of time, how far depends on the connection.
    seen = visit.page.evaluate(IN_SIGHT)
    loaded = [request for request in loaded if request.resource_type != "image" or request.url in seen]
    # What comes out of the cache has no size, which chromium counts as a little less than nothing.
    return sum(max(0, request.sizes()["responseBodySize"]) for request in loaded)


@pytest.mark.slow
def test_a_page_weighs_less_than_100_kilobytes(fresh: Visit) -> None:
    weights = {path: weight(fresh, path) for path in PAGES}
    assert {path: found for path, found in weights.items() if found >= HEAVIEST} == {}


@pytest.mark.slow
def test_the_policy_forbids_scripts_and_styles_inside_the_page(visit: Visit) -> None:
    answer = visit.page.goto(visit.address + "/")
    assert answer is not None
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    text = answer.text()
    (style,) = re.findall("<style>(.*?)</style>", text, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    assert f"'sha256-{digest}'" in policy
    assert " style=" not in text
    assert " onclick" not in text
