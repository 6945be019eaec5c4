"""What a teacher and a researcher hand on: exercises, frames, comparisons, the search, one's own questions, batches."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Browser, expect

from tests.conftest import running_service

from .conftest import WIDE, Look, Visit, new_page, whole
from .test_every_page import is_too_wide, violations

EXERCISE = "/?equations=x''+%3D+-9*x&reveal=hint,answer"


@pytest.fixture
def light(visit: Visit) -> Iterator[Visit]:
    """The pages without the figures of the gallery, which are jobs of their own."""
    empty = '<svg xmlns="http://www.w3.org/2000/svg"/>'
    visit.page.route("**/gallery/**.svg", lambda route: route.fulfill(body=empty, content_type="image/svg+xml"))
    yield visit
    visit.page.unroute("**/gallery/**.svg")


@pytest.mark.slow
@pytest.mark.parametrize("scripts", [True, False])
def test_an_exercise_hides_its_answer_and_judges_the_students_lagrangian(
    visit: Visit, plain: Visit, scripts: bool
) -> None:
    at = visit if scripts else plain
    at.go(EXERCISE)
    expect(at.page.get_by_role("heading", name="Exercise")).to_be_visible()
    expect(at.page.locator("#glance [data-settled]")).to_have_count(0)
    own = at.page.get_by_label("Your L", exact=True)
    for text, said in (("x'^2/2 + x^2", "No: this L has other"), ("x'^2/2 - 9*x^2/2", "Yes: the Euler-Lagrange")):
        own.fill(text)
        at.page.get_by_role("button", name="Does it give these equations?").click()
        expect(at.page.locator("#exercise")).to_contain_text(said)
        expect(own).to_have_value(text)
    at.page.reload()  # the address has the question and the L: nothing is sent again
    expect(at.page.locator("#exercise")).to_contain_text("Yes: the Euler-Lagrange")
    assert at.page.evaluate("location.search").startswith("?equations=")
    if scripts:
        at.page.get_by_role("button", name="Show a hint").click()
        expect(at.page.locator("#revealed")).to_contain_text("come from a regular Lagrangian")
        expect(at.page.locator("#revealed .formula")).to_have_count(0)
        at.page.locator("#exercise").get_by_role("button", name="Show the answer").click()
        expect(at.page.locator("#revealed .formula").first).to_be_visible()
        assert violations(at) == []


def test_what_is_no_lagrangian_is_told_in_an_exercise(plain: Visit) -> None:
    plain.go(EXERCISE)
    plain.page.get_by_label("Your L", exact=True).fill("x'' + @")
    plain.page.get_by_role("button", name="Does it give these equations?").click()
    expect(plain.page.locator("#exercise")).to_contain_text("This L cannot be read")
    expect(plain.page.locator("#exercise .hint").last).to_contain_text("not accepted")


@pytest.mark.slow
def test_two_results_are_compared_side_by_side(light: Visit) -> None:
    paths = []
    for equation in ("x'' = -2*x", "x'' = -2*x - x'"):
        light.go("/")
        light.page.get_by_label("Equations", exact=True).fill(equation)
        light.page.get_by_role("button", name="Find out").click()
        light.page.wait_for_url("**/results/*")  # loaded: its script keeps the question
        expect(light.page.locator(".verdict").first).to_be_visible()
        whole(light.page)
        paths.append(light.page.url.removeprefix(light.address))
    light.page.get_by_role("link", name="Compare with another").click()
    light.page.get_by_label("Second result").fill(light.address + paths[0])
    light.page.get_by_role("button", name="Compare").click()
    for k in (0, 1):
        frame = light.page.frame_locator("iframe").nth(k)
        expect(frame.locator(".formula").first).to_be_visible()
    light.go("/gallery")
    expect(light.page.get_by_role("heading", name="Your questions")).to_be_visible()
    assert light.page.locator("[data-history-list] li").count() >= 2
    light.page.get_by_role("button", name="Forget them").click()
    expect(light.page.get_by_role("heading", name="Your questions")).to_be_hidden()
    light.go("/compare?a=nope")
    expect(light.page.locator("main")).to_contain_text("There is no result at this address.")


def test_other_sites_frame_an_answer_only_where_they_are_listed(visit: Visit) -> None:
    visit.go("/?equations=x''+%3D+-3*x")
    visit.page.get_by_role("button", name="Find out").click()
    expect(visit.page.locator(".verdict").first).to_be_visible()
    whole(visit.page)
    answer = httpx.get(visit.page.url + "/embed", timeout=30)
    assert "frame-ancestors 'self'" in answer.headers["content-security-policy"]
    assert "<nav" not in answer.text
    assert "frame-ancestors 'none'" in httpx.get(visit.page.url, timeout=30).headers["content-security-policy"]


class Quiet(SimpleHTTPRequestHandler):
    """Serves a folder and says nothing."""

    def log_message(self, *words: object) -> None:
        """Nothing."""


@pytest.fixture
def courses(tmp_path: Path) -> Iterator[list[str]]:
    """The origins of two other sites that serve the same folder."""
    sites = [ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path))) for _ in range(2)]
    for site in sites:
        threading.Thread(target=site.serve_forever, daemon=True).start()
    yield [f"http://127.0.0.1:{site.server_port}" for site in sites]
    for site in sites:
        site.shutdown()
        site.server_close()


@pytest.mark.slow
def test_a_browser_frames_an_answer_on_a_listed_origin_and_on_no_other(
    browser: Browser, courses: list[str], tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    listed, other = courses
    page = new_page(browser, Look())
    for address in running_service(tmp_path_factory.mktemp("framed"), 60, frame_origins=listed):
        page.goto(address + "/?equations=x''+%3D+-3*x")
        page.get_by_role("button", name="Find out").click()
        expect(page.locator(".verdict").first).to_be_visible(timeout=60_000)
        whole(page)
        result = page.url
        (tmp_path / "course.html").write_text(f'<iframe src="{result}/embed"></iframe>')
        (tmp_path / "whole.html").write_text(f'<iframe src="{result}"></iframe>')
        page.goto(f"{listed}/course.html")
        expect(page.frame_locator("iframe").locator(".formula").first).to_be_visible()
        for refused in (f"{other}/course.html", f"{listed}/whole.html"):
            with page.expect_console_message(lambda message: "frame-ancestors" in message.text):
                page.goto(refused)
    page.context.close()


def test_the_gallery_is_searched_by_name_equation_and_verdict(light: Visit) -> None:
    light.go("/gallery")
    box = light.page.get_by_label("Search the systems")
    box.fill("kepler")
    expect(light.page.locator("[data-found]")).to_have_text("3 systems")
    expect(light.page.locator("tr[data-text]:visible").first).to_contain_text("r''")
    expect(light.page.get_by_role("heading", name="Figures of the paper")).to_be_hidden()
    box.fill("")
    expect(light.page.get_by_role("heading", name="Figures of the paper")).to_be_visible()
    assert not is_too_wide(light)


def test_plain_equations_are_a_batch_and_its_table_is_csv(visit: Visit) -> None:
    visit.go("/batch")
    visit.page.get_by_label("Or lines typed here").fill("x'' = -x - c*x'\nx'' = -y'; y'' = -y\nx'' = @")
    visit.page.get_by_role("button", name="Decide all of them").click()
    expect(visit.page.locator("main")).to_contain_text("3 of 3")
    table = visit.page.request.get(visit.page.url + "/results.csv").text().splitlines()
    assert table[0] == "line,name,verdict,lagrangian or reason,checked,where"
    assert [row.split(",")[0] for row in table[1:]] == ["1", "2", "3"]
    assert "variational,exp(c*t)*(x'^2 - x^2)/2," in table[1]
    assert "not_variational" in table[2]
    assert "failed" in table[3]


@pytest.mark.slow
def test_a_reading_that_was_meant_is_put_into_the_field(visit: Visit) -> None:
    visit.go("/")
    typed = visit.page.get_by_label("Equations", exact=True)
    typed.fill("x'' = -k/m x\ny'' = -y")
    visit.page.get_by_role("button", name="x'' = -(k/m)*x", exact=True).click()
    expect(typed).to_have_value("x'' = -(k/m)*x\ny'' = -y")
    expect(visit.page.locator("#understood dl")).to_contain_text("Coordinates")
    assert visit.page.url == visit.address + "/"


@pytest.mark.slow
def test_a_copied_formula_says_so(visit: Visit) -> None:
    visit.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    visit.go("/?equations=x''+%3D+-F(x)")
    visit.page.get_by_role("button", name="Find out").click()
    hero = visit.page.locator(".hero")
    expect(hero).to_contain_text("with")
    hero.get_by_role("button", name="Copy L = ").click()
    expect(visit.page.get_by_role("status").last).to_have_text("Copied")
    assert visit.page.evaluate("navigator.clipboard.readText()") == "L = x'^2/2 - G(x)"


@pytest.mark.slow
def test_an_own_lagrangian_survives_a_reload_and_what_is_printed_fits_the_paper(visit: Visit) -> None:
    visit.go("/?equations=x''+%3D+-x-c*x'")
    visit.page.get_by_role("button", name="Find out").click()
    expect(visit.page.locator(".hero")).to_be_visible()
    visit.page.get_by_label("Your L", exact=True).fill("x'^2 - x^2")
    visit.page.reload()
    expect(visit.page.get_by_label("Your L", exact=True)).to_have_value("x'^2 - x^2")
    visit.page.emulate_media(media="print")
    # A short matrix keeps its size, also where the window is wider than the paper.
    visit.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    sizes = "[...document.querySelectorAll('main .scroll math')].map(one => parseFloat(one.style.fontSize || '1'))"
    assert min(visit.page.evaluate(sizes)) > 0.5
    visit.page.evaluate("dispatchEvent(new Event('afterprint'))")
    visit.page.set_viewport_size({"width": 690, "height": 900})
    visit.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert visit.page.locator("details:not([open])").count() == 0
    assert visit.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    visit.page.evaluate("dispatchEvent(new Event('afterprint'))")
    visit.page.emulate_media(media="screen")
    visit.page.set_viewport_size(WIDE)
