"""Five visits from start to end, in both widths and colors and without scripts; long, so not in the default suite.

With PICTURES=FOLDER in the environment each ends in a picture there; docs/pages.md says what is to be seen.
"""

from __future__ import annotations

import itertools
import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from .conftest import Look, new_page, whole
from .test_every_page import Axe

pytestmark = pytest.mark.slow
FOLDER = os.environ.get("PICTURES", "")
PATIENCE = 90_000
LOOKS = [
    Look(scripts, narrow, scheme)
    for scripts, narrow, scheme in itertools.product((True, False), (False, True), ("light", "dark"))
]
SLEIGH = "/?lagrangian=m/2*(x'^2%2By'^2)%2BJ/2*phi'^2&constraints=x'*sin(phi)-y'*cos(phi)"


def student(page: Page, scripts: bool) -> None:
    """Types a damped oscillator, sees the answer beside the form, opens the whole of it, checks an own L, simulates."""
    page.get_by_label("Equations", exact=True).fill("x'' = -x - 0.1*x'")
    if scripts:
        expect(page.locator("#glance [data-settled]")).to_be_visible(timeout=PATIENCE)
    page.get_by_role("button", name="Find out").click()
    expect(page.locator(".verdict.variational").first).to_be_visible(timeout=PATIENCE)
    whole(page)
    page.get_by_label("Your L", exact=True).fill("exp(t/10)*(x'^2 - x^2)/2")
    page.get_by_role("button", name="Does it give these equations?").click()
    expect(page.locator("#own")).to_contain_text("Yes", timeout=PATIENCE)


def double_pendulum(page: Page, scripts: bool) -> None:
    """Takes the example, finds the textbook L, plays with it as a double pendulum, runs two methods."""
    page.get_by_role("link", name="Double pendulum").click()
    page.get_by_role("button", name="Find out").click()
    expect(page.locator(".verdict.variational").first).to_be_visible(timeout=PATIENCE)
    whole(page)
    page.get_by_role("link", name="Simulate this").click()
    if scripts:
        expect(page.get_by_label("Shown as")).to_have_value("double-pendulum", timeout=PATIENCE)
    page.get_by_role("button", name="Run").click()
    expect(page.get_by_role("heading", name="What was simulated")).to_be_visible(timeout=PATIENCE)


def researcher(page: Page, scripts: bool) -> None:
    """Follows a link with a sleigh, decides whether its motion has a Hamiltonian, takes LaTeX along."""
    page.goto(page.url.rstrip("/") + SLEIGH)
    page.get_by_role("button", name="Find out").click()
    expect(page.locator(".verdict").first).to_contain_text("This motion", timeout=PATIENCE)
    expect(page.locator("#export-latex")).to_contain_text("\\documentclass")


def teacher(page: Page, scripts: bool) -> None:
    """Opens an exercise as a student: a wrong L, then the right one."""
    page.goto(page.url.rstrip("/") + "/?equations=x''+%3D+-4*x&reveal=hint,answer")
    for text, said in (("x'^2 - x^2", "No"), ("x'^2/2 - 2*x^2", "Yes")):
        page.get_by_label("Your L", exact=True).fill(text)
        page.get_by_role("button", name="Does it give these equations?").click()
        expect(page.locator("#exercise [role=status]").first).to_contain_text(said, timeout=PATIENCE)


def tool_author(page: Page, scripts: bool) -> None:
    """Reads the calls, sends a batch of plain equations, opens one of its answers."""
    page.get_by_role("link", name="API").click()
    expect(page.locator("main")).to_contain_text("/v1/solve")
    page.get_by_role("link", name="Batch").click()
    page.get_by_label("Or lines typed here").fill("x'' = -x\nx'' = -y'; y'' = -y")
    page.get_by_role("button", name="Decide all of them").click()
    expect(page.locator("main")).to_contain_text("2 of 2", timeout=PATIENCE)
    page.get_by_role("link", name="x'' = -x").first.click()
    expect(page.locator(".verdict.variational").first).to_be_visible(timeout=PATIENCE)
    whole(page)


LOADED = "[...document.images].every(one => one.loading === 'lazy' || (one.complete && one.naturalWidth > 0))"


def settle(page: Page, scripts: bool) -> None:
    """Waits for the pictures of the page, also where no script says that they are there."""
    page.wait_for_load_state("networkidle", timeout=PATIENCE)
    if scripts and page.locator("[data-figures]").count():
        expect(page.locator("[data-figures]")).to_have_attribute("data-drawn", "yes", timeout=PATIENCE)
    for _ in range(PATIENCE // 200):
        if page.evaluate(LOADED):
            return
        page.wait_for_timeout(200)
    raise AssertionError("A picture of the page did not come.")


WAYS = (student, double_pendulum, researcher, teacher, tool_author)


@pytest.mark.parametrize("look", LOOKS, ids=str)
@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_a_visit_reaches_its_end(browser: Browser, patient: str, way: Callable[[Page, bool], None], look: Look) -> None:
    page = new_page(browser, look)
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(patient + "/")
    way(page, look.scripts)
    if look.scripts:
        found = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
        assert [rule["id"] for rule in found] == []
    settle(page, look.scripts)
    if FOLDER:
        name = f"{way.__name__}-{'390' if look.narrow else '1280'}-{look.scheme}{'' if look.scripts else '-plain'}.png"
        page.screenshot(path=Path(FOLDER) / name, full_page=True)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth") if look.scripts else True
    page.context.close()
    assert faults == []


FIREFOX, NODE = (shutil.which(name) or "" for name in ("firefox-esr", "node"))
PUPPETEER = os.environ.get("PUPPETEER", "")


@pytest.mark.skipif(
    not (FIREFOX and NODE and PUPPETEER), reason="needs firefox-esr, and PUPPETEER, where it is installed"
)
def test_two_visits_reach_their_ends_in_firefox(patient: str) -> None:
    script = Path(__file__).with_name("firefox.mjs")
    command = [NODE, str(script), FIREFOX, PUPPETEER, patient, *([FOLDER] if FOLDER else [])]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=400).stdout)
    assert found["version"].startswith("firefox/")
    assert found["own"].startswith("Yes")
    assert (found["shown"], found["completed"], found["faults"]) == ("double-pendulum", 2, [])
