"""Every page, in every state, in both colors and both widths, has no axe violations, is not too
wide, and is not too heavy. These tests are long, so not in the default suite.
"""

from __future__ import annotations

import base64
import hashlib
import re
import time
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Request, expect

from inverse_service import catalogue

from .conftest import Look, Pages, Visit, visited

pytestmark = pytest.mark.slow
PAGES = (
    "/", "/?kind=nonholonomic", "/ask", "/simulate", "/nearest", "/atlas", "/batch", "/learn", "/docs", "/teach",
    "/exercise/new", "/class/new", "/class/marks", "/class?set=x''=-[2..9]x&student=Ada", "/exercise?equations=x''=-x",
    "/results/none",
)  # fmt: skip
HEAVIEST = 100_000


def violations(visit: Visit) -> list[str]:
    """The violations that axe finds, with their places."""
    # For rules that hold, one place each; otherwise thousands of places would be sent.
    found = Axe().run(visit.page, options={"resultTypes": ["violations"]}).response["violations"]
    return [f"{v['id']}: {node['html'][:120]}" for v in found for node in v["nodes"]]


def open_all(visit: Visit) -> None:
    visit.page.evaluate("document.querySelectorAll('details').forEach(node => (node.open = true))")


def is_too_wide(visit: Visit) -> bool:
    too_wide: bool = visit.page.evaluate("document.documentElement.scrollWidth > innerWidth")
    return too_wide


IN_SIGHT = """[...document.images].filter((image) => image.getBoundingClientRect().top < innerHeight)
  .map((image) => image.src)"""


def weight(visit: Visit, path: str) -> int:
    """The bytes sent for the first screen: the page, its linked files, and the visible pictures."""
    loaded: list[Request] = []

    def note(request: Request) -> None:
        loaded.append(request)

    visit.page.on("requestfinished", note)
    visit.go(path)
    visit.page.wait_for_load_state("load")
    visit.page.remove_listener("requestfinished", note)
    # Browsers fetch pictures below the screen ahead of time; how far depends on the connection.
    seen = visit.page.evaluate(IN_SIGHT)
    loaded = [
        request for request in loaded if request.resource_type != "image" or request.url in seen
    ]
    # A cached file has no size, and chromium reports slightly less than zero.
    return sum(max(0, request.sizes()["responseBodySize"]) for request in loaded)


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


NAMES = [f"x{k}" for k in range(8)]
PATIENCE = 90.0
LINEAR = {"coordinates": ["x", "y"], "parameters": ["a", "b", "c", "d"], "family": True,
          "equations": {"x": "-a*x + b*y", "y": "-c*y + d*x"}}  # fmt: skip
FITTED = {"equations": "x'' = -1.02*x + 0.4*y; y'' = 0.5*x - y", "nearest": {"errors": "0.02"}}
SCENE: dict[str, Any] = {
    "system": {"catalogue": "vertically-rolling-disk"}, "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"},
    "initial": {"positions": dict.fromkeys(("phi", "theta", "x", "y"), 0), "velocities": {"phi": 1, "theta": 1}},
    "step": 0.05, "steps": 100, "methods": ["variational", "nonholonomic", "exact"],
    "observe": ["trajectory", "energy", "constraints", "matching_circle", "error"],
}  # fmt: skip

AT_REST = {"positions": {"x": 1}, "velocities": {"x": 0}}
ENSEMBLE: dict[str, Any] = {
    "system": {"catalogue": "sho"}, "initial": AT_REST, "step": 0.05, "steps": 100, "methods": ["runge-kutta"],
    "ensemble": {"initial": [AT_REST, {"positions": {"x": 2}, "velocities": {"x": 0}}]},
}  # fmt: skip


def hard(function: str, seconds: float) -> dict[str, Any]:
    """A document that cannot be decided in this time."""
    equations = {
        c: "+".join(f"{a}*{b}'^2*{function}({a}*{b}*{c})" for a in NAMES for b in NAMES)
        for c in NAMES
    }
    return {"coordinates": NAMES, "equations": equations, "options": {"time_limit": seconds}}


def documents() -> dict[str, tuple[str, dict[str, Any]]]:
    """A call and a document for each state of a result's page."""
    particle = catalogue.document("nonholonomic-particle")
    return {
        "proof": ("solve", catalogue.document("vertically-rolling-disk-first")),
        "lagrangian": ("solve", catalogue.document("vertically-rolling-disk-second")),
        "functions": ("solve", catalogue.document("generic-class-one-second")),
        "family": ("solve", LINEAR),
        "nearest": ("solve", FITTED),
        "constrained": ("solve", {**particle, "associated": "second"}),
        "search": ("solve", {**particle, "associated": "search"}),
        "undetermined": ("solve", hard("sin", 1)),
        "failed": ("simulate", {**SCENE, "initial": {"positions": {"phi": 0}}}),
        "simulation": ("simulate", SCENE),
        "ensemble": ("simulate", ENSEMBLE),
        "precision": ("work-precision", {**SCENE, "steps": 20, "observe": []}),
    }


@pytest.fixture(scope="module")
def states(service: str) -> dict[str, str]:
    """The address of each state's page."""
    with httpx.Client(
        base_url=service, timeout=PATIENCE, headers={"Prefer": "respond-async"}
    ) as client:
        found = {
            name: post(client, f"/v1/{call}", document)
            for name, (call, document) in documents().items()
        }
        cancelled = post(client, "/v1/solve", hard("cos", 9))
        client.delete(f"/v1/jobs/{cancelled}")
        end = time.monotonic() + PATIENCE
        while any(client.get(f"/v1/jobs/{id}").status_code == 202 for id in found.values()):
            assert time.monotonic() < end
            time.sleep(0.2)
        lines = [{"id": "good", "equations": "x'' = -x"}, {"id": "bad", "equations": "x''="}]
        batch = client.post("/v1/batches", json=lines).json()["id"]
    pages = {name: f"/results/{id}" for name, id in (found | {"cancelled": cancelled}).items()}
    pages |= {
        "nearest": f"{pages['nearest']}/nearest",
        "family map": f"{pages['family']}/family",
        "batch": f"/batch/{batch}",
    }
    return pages | {path: path for path in PAGES}


def post(client: httpx.Client, path: str, document: dict[str, Any]) -> str:
    answer = client.post(path, json=document)
    assert answer.status_code in (200, 202), answer.text
    return answer.headers["location"].rpartition("/")[2]


@pytest.fixture(
    params=[(s, w) for s in ("light", "dark") for w in ("wide", "narrow")], ids="-".join
)
def look(request: pytest.FixtureRequest, pages: Pages, service: str) -> Iterator[Visit]:
    scheme, width = request.param
    yield from visited(pages(Look(narrow=width == "narrow", scheme=scheme)), service)


def test_axe_finds_nothing_and_nothing_is_too_wide(look: Visit, states: dict[str, str]) -> None:
    faults = {}
    for name, path in states.items():
        look.go(path)
        if name in ("simulation", "precision"):
            expect(look.page.locator("[data-drawn], [data-told]")).to_be_visible()
        if name != "/atlas":
            open_all(look)
        found = violations(look)
        if found or is_too_wide(look):
            faults[name] = found or ["too wide"]
    assert faults == {}


def test_each_run_of_an_ensemble_has_a_line(look: Visit, states: dict[str, str]) -> None:
    look.go(states["ensemble"])
    runs = look.page.get_by_role("region", name="The runs of").locator("tbody tr")
    expect(runs).to_have_count(2)
    expect(runs.last).to_contain_text("2")
    expect(look.page.get_by_role("columnheader", name="x\u2032 at the end")).to_be_visible()


def test_the_verdict_is_on_the_first_screen_below_long_equations(
    look: Visit, states: dict[str, str]
) -> None:
    look.go(states["undetermined"])
    expect(look.page.locator("h1")).to_be_in_viewport()
    expect(look.page.locator(".asked")).to_have_attribute("tabindex", "0")


def test_work_that_is_open_has_no_violation(look: Visit) -> None:
    with httpx.Client(
        base_url=look.address, timeout=PATIENCE, headers={"Prefer": "respond-async"}
    ) as client:
        id = post(client, "/v1/solve", hard("tan", 10))
        look.go(f"/results/{id}")
        expect(look.page.get_by_role("progressbar")).to_be_visible()
        assert violations(look) == []
        client.delete(f"/v1/jobs/{id}")
        expect(look.page.get_by_role("heading", level=1)).to_have_text("This was cancelled")


def test_no_state_weighs_100_kilobytes(fresh: Visit, states: dict[str, str]) -> None:
    weights = {name: weight(fresh, path) for name, path in states.items()}
    print(weights)
    assert {name: found for name, found in weights.items() if found >= HEAVIEST} == {}
