"""Rare events on the pages; long, so not in the default suite."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Browser, Page, Route, expect

from tests.conftest import running_service
from tests.doors.rows import rows
from tests.values import present
from tests.web.pages.test_sheets import DISK, FORCED, PARTICLE, SLEIGH

from .conftest import Look, Visit, new_page, whole
from .screens import CART
from .test_every_page import is_too_wide
from .test_people import HARD, ORANGE, PIXELS, ask

pytestmark = pytest.mark.slow


def test_a_run_of_letters_read_as_a_product_can_be_one_name(visit: Visit) -> None:
    visit.go("/")
    visit.page.get_by_label("Equations", exact=True).fill("x'' = -kx")
    expect(visit.page.locator("#understood")).to_contain_text("kx read as k x")
    visit.page.get_by_role("button", name="kx is one name").click()
    expect(visit.page.locator("#understood")).not_to_contain_text("read as")
    expect(visit.page.locator("#understood math")).to_have_count(2)


def test_what_is_typed_while_the_service_starts_is_read_once_it_has_started(visit: Visit) -> None:
    visit.go("/")
    asked: list[Route] = []

    def starting(route: Route) -> None:
        asked.append(route)
        if len(asked) == 1:
            route.fulfill(status=503, content_type="application/problem+json", body="{}")
        else:
            route.continue_()

    visit.page.route(re.compile("fragment=1"), starting)
    visit.page.get_by_label("Equations", exact=True).fill("x'' = -k*x\ny'' = A(x)")
    expect(visit.page.locator("#understood")).to_contain_text("unknown function")
    visit.page.unroute(re.compile("fragment=1"), starting)
    assert len(asked) == 2


def test_markup_that_is_typed_stays_text(visit: Visit) -> None:
    visit.go("/")
    visit.page.get_by_label("Equations", exact=True).fill("x'' = <img src=x onerror=alert(1)>")
    expect(visit.page.locator("#understood [data-problem]")).to_be_visible()
    assert visit.page.locator("#understood img").count() == 0


def test_latex_and_documents_can_be_typed_or_uploaded(visit: Visit, tmp_path: Path) -> None:
    visit.go("/")
    box = visit.page.get_by_label("Equations", exact=True)
    box.fill(r"\ddot{x} = -\omega^2 x, \quad \ddot{\theta} = \dot{x}")
    expect(visit.page.locator("#understood .formula")).to_have_count(2)
    expect(visit.page.locator("#understood")).to_contain_text("θ")
    box.fill(json.dumps({"coordinates": ["u"], "equations": {"u": "-u"}}))
    expect(visit.page.locator("#understood .formula")).to_have_count(1)
    file = tmp_path / "system.yaml"
    file.write_text("coordinates: [w]\nequations:\n  w: -w^3\n")
    visit.page.get_by_role("button", name="Ask in detail").click()
    visit.page.get_by_label("Upload a document").set_input_files(file)
    expect(visit.page.locator("#understood")).to_contain_text("w")
    visit.page.get_by_role("button", name="Open the answer").click()
    expect(visit.page.locator("h1 .yes, h2 .yes").first).to_be_visible()
    whole(visit.page)
    expect(visit.page.locator("main")).to_contain_text("Hamiltonian")


def test_an_unknown_result_is_reported(visit: Visit) -> None:
    visit.go("/results/" + "0" * 40)
    expect(visit.page.get_by_role("heading", level=1)).to_have_text("Nothing here")


def test_what_was_typed_survives_back_reload_and_the_other_tab(visit: Visit) -> None:
    box = visit.page.get_by_label("Equations", exact=True)
    visit.go("/")
    box.fill("x'' = -x - x'/7")
    visit.page.get_by_role("link", name="Constraints", exact=True).click()
    expect(visit.page.get_by_label("Lagrangian", exact=True)).to_be_visible()
    visit.page.get_by_role("link", name="Equations", exact=True).click()
    expect(box).to_have_value("x'' = -x - x'/7")
    visit.page.reload()
    expect(box).to_have_value("x'' = -x - x'/7")
    visit.page.get_by_role("button", name="Open the answer").click()
    expect(visit.page.locator("h1 .yes, h2 .yes").first).to_be_visible()
    whole(visit.page)
    visit.page.go_back()
    expect(box).to_have_value("x'' = -x - x'/7")


@pytest.mark.parametrize("scripts", [True, False])
def test_a_link_carries_a_question_and_does_not_ask_it(
    visit: Visit, plain: Visit, scripts: bool
) -> None:
    at = visit if scripts else plain
    at.go("/?equations=x''+%3D+-k*x&parameters=k")
    expect(at.page.get_by_label("Equations", exact=True)).to_have_value("x'' = -k*x")
    expect(at.page.locator("#understood .formula")).to_have_count(1)
    at.go("/?lagrangian=x'^2/2%2By'^2/2&constraints=x'-y'")
    expect(at.page.get_by_label("Constraints", exact=True)).to_have_value("x'-y'")


def test_the_link_to_the_question_of_a_result_fills_the_form_with_it(visit: Visit) -> None:
    visit.go("/?example=sho")
    visit.page.get_by_role("button", name="Open the answer").click()
    link = present(visit.page.get_by_role("link", name="Link", exact=True).get_attribute("href"))
    title = visit.page.title()
    assert "Lagrangian" in title
    visit.go(link)
    expect(visit.page.get_by_label("Equations", exact=True)).to_have_value(re.compile("x''"))


@pytest.mark.parametrize(
    "path", ["/nope", "/?example=nope", "/simulate?system=nope", "/results/nope"]
)
def test_a_mistyped_address_has_a_page(plain: Visit, path: str) -> None:
    assert present(plain.page.goto(plain.address + path)).status in (404, 422)
    expect(plain.page.get_by_role("heading", level=1)).to_be_visible()
    expect(plain.page.get_by_role("link", name="Ask a question")).to_be_visible()


def test_a_printed_result_is_light_and_whole(browser: Browser, service: str) -> None:
    page = new_page(browser, Look(scheme="dark"))
    page.goto(f"{service}/?example=vertically-rolling-disk-first")
    page.get_by_role("button", name="Open the answer").click()
    expect(page.locator("#verdict")).to_be_visible()
    whole(page)
    page.emulate_media(media="print", color_scheme="dark")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    expect(page.locator("#why .proof li").first).to_be_visible()
    expect(page.locator(".print-only")).to_contain_text(
        re.compile(r"/results/[0-9a-f]{40}.*20\d\d-")
    )
    page.context.close()


def test_long_formulas_are_printed_and_folded_again(visit: Visit) -> None:
    ask(visit, {"lagrangian": CART, "parameters": "guess"})
    page, long = visit.page, visit.page.locator(".written > .formula")
    expect(long).to_have_count(1)
    expect(long.first).to_be_hidden()
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    expect(long.first).to_be_visible()
    page.emulate_media(media="screen")
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    expect(long.first).to_be_hidden()


def test_an_answer_that_a_busy_service_owes_comes_by_itself(visit: Visit) -> None:
    """Two busy responses with growing pauses, then the answer."""
    asked: list[Route] = []

    def answer(route: Route) -> None:
        asked.append(route)
        if len(asked) <= 2:
            route.fulfill(status=503, content_type="text/html", body="<p>Later.</p>")
        else:
            route.continue_()

    visit.page.route("**/answer", answer)
    visit.go("/")
    visit.page.get_by_label("Equations", exact=True).fill("x'' = -x - 0.7*x'")
    expect(visit.page.locator("#live:not(.old) #glance h2")).to_contain_text("Yes")
    assert len(asked) >= 3
    visit.page.unroute("**/answer")


def test_a_screen_reader_hears_one_end_state_and_no_half_equation(visit: Visit) -> None:
    visit.go("/")
    visit.page.evaluate(
        "window.heard = []; new MutationObserver(() => { const t = document.getElementById('said').textContent;"
        "if (t) window.heard.push(t); }).observe(document.getElementById('said'), {childList: true})"
    )
    box = visit.page.get_by_label("Equations", exact=True)
    box.fill("")
    box.press_sequentially("x'' = -sin(x) - 0.1*x'", delay=70)
    expect(visit.page.locator("#live:not(.old) #glance [data-settled]")).to_be_visible()
    heard = visit.page.evaluate("window.heard")
    assert len(heard) == 1
    assert heard[0].startswith("Yes")
    assert "L = " in heard[0]
    box.press_sequentially(" + @")
    expect(visit.page.locator("#said")).to_contain_text("not accepted")
    expect(visit.page.locator("#glance")).to_be_hidden()


def test_formulas_are_set_in_the_font_that_is_sent_with_the_page(visit: Visit) -> None:
    visit.go("/")
    visit.page.wait_for_function(
        "document.fonts.ready.then(() => document.fonts.check('16px Formulas'))"
    )
    faces = visit.page.evaluate("[...document.fonts].map(face => [face.family, face.status])")
    assert ["Formulas", "loaded"] in [[family.strip('"'), status] for family, status in faces]


STREAM = """window.EventSource = class extends EventTarget {
    constructor() { super(); window.stream = this; }
    close() {}
}"""


def test_a_page_that_waits_says_that_the_service_is_away_and_that_it_is_back(
    browser: Browser, service: str
) -> None:
    page = new_page(browser, Look())
    page.add_init_script(STREAM)
    page.goto(service + "/")
    page.get_by_label("Equations", exact=True).fill(HARD.replace("sin(", "sin(3*"))
    page.get_by_role("button", name="Open the answer").click()
    told = page.locator("[data-progress]")
    page.wait_for_function("() => window.stream")
    page.evaluate("stream.dispatchEvent(new Event('error'))")
    expect(told).to_contain_text("not responding")
    page.evaluate(
        "data => stream.dispatchEvent(new MessageEvent('status', { data }))",
        '{"status": "running"}',
    )
    expect(page.locator("h1")).to_have_text("Working on it")
    page.get_by_role("button", name="Cancel").click()
    page.context.close()


GROWS = (
    "2 a'' + b'' cos(a-b) + b'^2 sin(a-b) + 2 sin(a) + c a' = 0",
    "b'' + a'' cos(a-b) - a'^2 sin(a-b) + sin(b) + c b' = 0",
)


def test_parts_fill_in_without_a_new_page_and_a_verdict_stays(visit: Visit) -> None:
    found = visit.page.request.post(
        f"{visit.address}/v1/solve",
        data={"equations": list(GROWS), "parameters": "guess"},
        headers={"Prefer": "respond-async"},
    )
    visit.go(f"/results/{found.json()['id']}")
    visit.page.evaluate("window.stays = true")
    said: list[str] = []
    for _ in range(400):
        shown = visit.page.locator("h1 span[class]")
        said += [shown.get_attribute("class") or ""] if shown.count() else []
        if not visit.page.locator("[data-events]").count():
            break
        visit.page.wait_for_timeout(50)
    assert visit.page.evaluate("window.stays")
    definite = [one for one in said if one != "open"]
    assert definite
    assert set(definite) == {"no"}
    assert "open" not in said[said.index("no") :]
    expect(visit.page.locator("#export")).to_be_visible()


def test_an_answer_that_is_not_a_page_is_not_dropped_silently(visit: Visit) -> None:
    visit.go("/")
    visit.page.route(
        re.compile("fragment=1"),
        lambda r: r.fulfill(status=500, content_type="application/json", body="{}"),
    )
    visit.page.get_by_label("Equations", exact=True).fill("x'' = -5*x")
    expect(visit.page.locator("#understood")).to_contain_text("error of the program")
    expect(visit.page.locator("#live")).to_be_hidden()
    visit.page.unroute(re.compile("fragment=1"))
    visit.seen.console.clear()


def test_a_batch_that_is_no_document_is_refused_with_a_sentence(visit: Visit) -> None:
    visit.go("/batch")
    visit.page.get_by_label("Or type the lines").fill("")
    visit.page.get_by_role("button", name="Solve all").click()
    expect(visit.page.get_by_role("alert")).to_be_visible()


def test_a_lesson_can_be_changed_and_asked(visit: Visit) -> None:
    visit.go("/learn")
    assert visit.page.locator(".screen").count() == 6
    visit.page.locator("#equations-2").fill("x'' = -x' - x")
    expect(visit.page.locator("#understood-2 .formula")).to_have_count(1)
    visit.page.get_by_role("button", name="Friction: is there an L?").click()
    expect(visit.page.locator("h1 .yes, h2 .yes").first).to_be_visible()
    whole(visit.page)


def test_every_control_is_reached_by_keys_and_shows_that_it_is(visit: Visit) -> None:
    visit.go("/")
    controls = (
        "a[href], button, summary, textarea, input:not([type=hidden]), select, [tabindex='0']"
    )
    wanted = visit.page.evaluate(
        f"""() => [...document.querySelectorAll("{controls}")].filter(n => n.checkVisibility()).length"""
    )
    seen = set()
    for _ in range(wanted + 5):
        visit.page.keyboard.press("Tab")
        place, outline = visit.page.evaluate("""() => {
            const node = document.activeElement;
            return [[...document.querySelectorAll('*')].indexOf(node), getComputedStyle(node).outlineStyle];
        }""")
        if place in seen or visit.page.evaluate("document.activeElement === document.body"):
            break
        seen.add(place)
        assert outline != "none"
    # The skip link is hidden until it has the focus; a disabled control would be missing here.
    assert len(seen) >= wanted


def test_every_call_is_listed_with_what_it_does(visit: Visit) -> None:
    visit.go("/docs")
    paths = visit.page.request.get(f"{visit.address}/openapi.json").json()["paths"]
    listed = visit.page.locator("article tbody th code").all_inner_texts()
    assert {
        f"{method.upper()} {path}" for path, methods in paths.items() for method in methods
    } <= {*listed}
    assert all(text.strip() for text in visit.page.locator("article .scroll td").all_inner_texts())


BLACK = [28, 35, 48]


def test_the_points_of_a_long_run_are_no_black_ring(visit: Visit) -> None:
    visit.go("/simulate")
    visit.page.get_by_label("Steps").fill("5000")
    visit.page.get_by_role("button", name="Run").click()
    expect(visit.page.locator("[data-drawn]")).to_be_visible(timeout=40_000)
    path = visit.page.locator("[data-plot=path] canvas")
    black, orange = (path.evaluate(PIXELS, ink) for ink in (BLACK, ORANGE))
    assert orange > 500
    assert black < orange / 10


def test_a_constrained_result_is_simulated_with_the_lagrangian_that_was_found(visit: Visit) -> None:
    document = {
        "coordinates": ["x", "y", "z"], "lagrangian": "(x'^2 + y'^2 + z'^2)/2", "constraints": ["z' + x*y'"],
        "associated": "second",
    }  # fmt: skip
    solved = visit.page.request.post(
        f"{visit.address}/v1/solve", data=document, headers={"Prefer": "wait=20"}
    )
    found = solved.json()["lagrangian"]["text"]
    visit.go("/simulate?job=" + solved.headers["location"].rpartition("/")[2])
    visit.page.get_by_label("Steps").fill("40")
    visit.page.get_by_role("button", name="Run").click()
    visit.page.get_by_text("The scene as a document").click(timeout=40_000)
    expect(visit.page.get_by_label("The scene as JSON")).to_contain_text(
        f'"free_lagrangian": "{found}"'
    )
    expect(visit.page.locator("tbody tr", has_text="variational").first).to_contain_text(
        "completed"
    )
    visit.page.get_by_role("link", name="Change the scene").click()
    visit.page.get_by_label("Steps").fill("60")
    visit.page.get_by_role("button", name="Run").click()
    expect(visit.page.locator("tbody tr", has_text="completed").first).to_contain_text(
        "60", timeout=40_000
    )


@pytest.mark.parametrize("rest", ["b'^2/2 + 2*g*cos(a) - V(b)", "b'^2 - g*b, a + b = c"])
def test_a_lagrangian_typed_as_text_is_simulated(visit: Visit, rest: str) -> None:
    document = {"equations": f"L = a'^2 + a'*b'*cos(a - b) + {rest}", "parameters": "guess"}
    solved = visit.page.request.post(
        f"{visit.address}/v1/solve", data=document, headers={"Prefer": "wait=20"}
    )
    visit.go("/simulate?job=" + solved.headers["location"].rpartition("/")[2])
    visit.page.get_by_role("button", name="Run").click()
    expect(visit.page.locator("tbody tr", has_text="completed").first).to_be_visible(timeout=40_000)


CONSTRAINED = {
    row["id"]: row["document"]
    for row in rows("constrained")
    if "constraints" in row.get("document", {})
}
WORDS = """rows => rows.map(row =>
    [row.querySelector('th').firstChild.textContent.trim(), row.querySelector('b').textContent])"""
MOTIONS = {
    "sleigh": SLEIGH,
    "particle": PARTICLE,
    "forced": FORCED,
    "disk": DISK,
    **dict([*CONSTRAINED.items()][:10]),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_a_constrained_motion_has_one_table_and_one_sentence(visit: Visit, name: str) -> None:
    """Headline, title, and table agree: a yes for a system is a yes for the motion, which Any
    decides.
    """
    ask(visit, {"parameters": "guess", **MOTIONS[name], "options": {"time_limit": 20}})
    page, table = visit.page, visit.page.locator("table.verdicts")
    expect(table).to_have_count(1)
    words = dict(table.locator("tbody tr:not(.why)").evaluate_all(WORDS))
    said, title = page.locator("h1").inner_text(), page.title()
    if any(words.get(name, "").startswith("Yes") for name in ("First", "Second", "Third", "Any")):
        assert said.startswith(("Yes", "The answer"))
        assert "has a Hamiltonian" in title or "differs" in title
    elif words.get("Any") == "No":
        assert "cannot" in said
        assert "has no Hamiltonian" in title
    else:
        assert "undetermined" in said
        assert "undetermined" in title
    shown = page.locator("main").inner_text()
    assert not re.search(r"[a-z]_(?:[a-z]{2,}|associated)", shown), shown
    assert "undetermined" in said or "undetermined" not in shown
    assert not is_too_wide(visit)


def test_error_is_measured_against_time(browser: Browser, service: str) -> None:
    """Five methods at many steps take 4 s on an idle machine, under load more than the 10 s of the
    other service.
    """
    page = browser.new_page()
    page.goto(f"{service}/simulate?system=knife-edge")
    page.get_by_label("Steps").fill("20")
    page.get_by_role("button", name="Measure error vs. time").click()
    told = page.locator("[data-told]")
    expect(told).to_contain_text("error about", timeout=60_000)
    assert page.locator("table.prices .best").count() >= 4
    for name in ("Variational", "Adaptive", "Runge\u2013Kutta 8"):  # selected, or compared with
        expect(page.locator(".pick")).to_contain_text(name)
    picture, table = (
        page.locator(place).first.bounding_box() for place in (".prices-plot", "table.prices")
    )
    assert picture is not None
    assert table is not None
    assert picture["y"] < table["y"]
    page.locator(
        ".pick label", has_text="Variational"
    ).first.click()  # a method whose step determines its error
    slider, ring = (
        page.locator("[data-prices] [type=range]"),
        page.locator(".prices-plot .ring").first,
    )
    slider.press("Home")
    before, place = told.inner_text(), ring.get_attribute("cx")
    slider.press("End")
    assert told.inner_text() != before
    assert float(ring.get_attribute("cx") or 0) > float(place or 0)
    other = page.locator(".pick label").last
    name = other.inner_text().strip()
    other.click()
    expect(page.locator("tr.on th")).to_contain_text(name)
    expect(page.locator(".prices-plot .on text").first).to_have_text(name)
    csv = page.request.get(page.url + "/table.csv").text().splitlines()
    assert csv[0].startswith("error,method")
    page.close()


@pytest.mark.parametrize("scripts", [True, False])
def test_an_error_in_a_scene_is_shown_next_to_its_field(
    visit: Visit, plain: Visit, scripts: bool
) -> None:
    at = visit if scripts else plain
    at.go("/simulate?system=sho")
    at.page.get_by_label("x", exact=True).fill("abc")
    at.page.get_by_role("button", name="Run").click()
    field = at.page.locator(".field", has=at.page.locator("[name='position.x']"))
    expect(field.locator(".fault")).to_contain_text("not a number")
    expect(at.page.locator("[name='position.x']")).to_have_attribute("aria-invalid", "true")
    expect(at.page.get_by_label("x", exact=True)).to_have_value("abc")
    assert "/results/" not in at.page.url


def test_the_cost_is_shown_next_to_the_step(visit: Visit) -> None:
    """Runge-Kutta has order 4: halving the step of 0.1 divides the error by 16."""
    visit.go(
        "/simulate?system=sho&method=runge-kutta&step=0.1&steps=100&position.x=1&velocity.x=0&parameter.k=1"
    )
    price = visit.page.locator("[data-price]")
    expect(price).to_contain_text("Runge\u2013Kutta", timeout=30_000)

    def error() -> float:
        found = re.search(r"about (\S+),", price.inner_text())
        assert found
        return float(found[1].replace("\u2212", "-"))

    before = error()
    assert 1e-7 < before < 1e-3
    slider = visit.page.locator("[data-step]")
    slider.focus()
    slider.press("ArrowLeft")
    assert visit.page.locator("[name=step]").input_value() == "0.05"
    assert visit.page.locator("[name=steps]").input_value() == "200"
    assert before / 32 < error() < before / 8


def test_other_sites_frame_an_answer_only_where_they_are_listed(visit: Visit) -> None:
    visit.go("/?equations=x''+%3D+-3*x")
    visit.page.get_by_role("button", name="Open the answer").click()
    expect(visit.page.locator("#verdict").first).to_be_visible()
    whole(visit.page)
    answer = httpx.get(visit.page.url + "/embed", timeout=30)
    assert "frame-ancestors 'self'" in answer.headers["content-security-policy"]
    assert "<nav" not in answer.text
    assert (
        "frame-ancestors 'none'"
        in httpx.get(visit.page.url, timeout=30).headers["content-security-policy"]
    )


class Quiet(SimpleHTTPRequestHandler):
    """Serves a folder without logging."""

    def log_message(self, *words: object) -> None:
        """Log nothing."""


@pytest.fixture
def courses(tmp_path: Path) -> Iterator[list[str]]:
    """The origins of two external sites that serve the same folder."""
    sites = [
        ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path)))
        for _ in range(2)
    ]
    for site in sites:
        threading.Thread(target=site.serve_forever, daemon=True).start()
    yield [f"http://127.0.0.1:{site.server_port}" for site in sites]
    for site in sites:
        site.shutdown()
        site.server_close()


def test_a_browser_frames_an_answer_on_a_listed_origin_and_on_no_other(
    browser: Browser, courses: list[str], tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    listed, other = courses
    page = new_page(browser, Look())
    for address in running_service(tmp_path_factory.mktemp("framed"), frame_origins=listed):
        page.goto(address + "/?equations=x''+%3D+-3*x")
        page.get_by_role("button", name="Open the answer").click()
        expect(page.locator("#verdict").first).to_be_visible(timeout=60_000)
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


def test_a_reading_that_was_meant_is_put_into_the_field(visit: Visit) -> None:
    visit.go("/")
    typed = visit.page.get_by_label("Equations", exact=True)
    typed.fill("x'' = -k/m x\ny'' = -y")
    visit.page.get_by_role("button", name="k/m x is k/(m*x)", exact=True).click()
    expect(typed).to_have_value("x'' = -k/(m*x)\ny'' = -y")
    expect(visit.page.locator("#understood .reading")).to_contain_text("constants")
    assert visit.page.url == visit.address + "/"


def paper(page: Page) -> str:
    color: str = page.evaluate("getComputedStyle(document.body).backgroundColor")
    return color


@pytest.mark.parametrize("scripts", [True, False])
def test_another_system_to_simulate_is_one_click_in_the_list(
    visit: Visit, plain: Visit, scripts: bool
) -> None:
    at = visit if scripts else plain
    at.go("/simulate")
    at.page.get_by_text("Another system").click()
    at.page.get_by_role("link", name="Knife edge on a horizontal plane").click()
    expect(at.page.locator("#picture-title")).to_have_text("Knife edge on a horizontal plane")


@pytest.mark.parametrize("scripts", [True, False])
def test_the_colors_are_chosen_and_remembered(visit: Visit, plain: Visit, scripts: bool) -> None:
    at = visit if scripts else plain
    at.go("/learn")
    light = paper(at.page)
    with at.page.expect_response("**/theme"):
        at.page.get_by_role("button", name="Dark").click()
    expect(at.page.get_by_role("button", name="Dark")).to_have_attribute("aria-pressed", "true")
    assert at.page.url.endswith("/learn")
    dark = paper(at.page)
    assert dark != light
    at.go("/batch")
    assert paper(at.page) == dark
    with at.page.expect_response("**/theme"):
        at.page.get_by_role("button", name="System").click()
    expect(at.page.get_by_role("button", name="System")).to_have_attribute("aria-pressed", "true")
    assert paper(at.page) == light
    at.page.emulate_media(color_scheme="dark")
    assert paper(at.page) == dark
    at.page.emulate_media(color_scheme="light")


def test_the_verdict_comes_before_the_formulas_that_take_longer(fresh: Visit) -> None:
    """And the answer to a link is made once: the script waits for the one that the page began."""
    fresh.go("/?equations=u''+%3D+-u+%2B+13*(1+-+u^2)*u'")
    expect(fresh.page.locator("#glance [data-settled]")).to_contain_text("Yes")
    expect(fresh.page.locator("#glance [data-cut]")).to_have_count(0)
    asked = [url.partition("/answer")[2] for url in fresh.seen.addresses if "/answer" in url]
    assert [one.partition("=")[0] for one in asked] in (["?coming", "?rest"], ["?rest"])
    expect(fresh.page.locator("#glance")).to_contain_text("none was found in closed form")


@pytest.mark.slow
def test_a_search_of_the_atlas_takes_no_focus(visit: Visit) -> None:
    """The verdict of an answer does; the field of the same name does not."""
    visit.go("/atlas")
    visit.page.get_by_role("button", name="Search").click()
    expect(visit.page.get_by_label("Answer", exact=True)).not_to_be_focused()
