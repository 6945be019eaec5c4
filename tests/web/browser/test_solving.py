"""What a person does on the start page and on the page of a result, with scripts and without."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from .conftest import Look, Pages, Visit, new_page, whole

FIRST_DISK = "phi'' = 0\ntheta'' = 0\nx'' = -R*sin(phi)*phi'*theta'\ny'' = R*cos(phi)*phi'*theta'"
NAMES = [f"x{k}" for k in range(8)]
HARD = json.dumps({"coordinates": NAMES, "equations": {
    c: "+".join(f"{a}*{b}'^2*sin({a}*{b}*{c})" for a in NAMES for b in NAMES) for c in NAMES
}})  # fmt: skip


def echo(page: Page) -> str:
    return page.locator("#understood").inner_text()


def test_two_typed_equations_are_echoed_and_solved(visit: Visit) -> None:
    visit.go("/")
    visit.page.get_by_label("Equations", exact=True).fill("x'' = -k*x\ny'' = A(x)")
    expect(visit.page.locator("#understood")).to_contain_text("constants")
    expect(visit.page.locator("#understood")).to_contain_text("with any")
    assert visit.page.locator("#understood math").count() >= 4
    visit.page.get_by_role("button", name="Open the answer").click()
    expect(visit.page.locator("h1")).to_contain_text("Lagrangian")
    assert re.fullmatch(r".*/results/[0-9a-f]{40}", visit.page.url)


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
    expect(visit.page.locator("#understood")).to_contain_text("with any")
    visit.page.unroute(re.compile("fragment=1"), starting)
    assert len(asked) == 2


def test_without_scripts_the_form_is_echoed_by_a_button_and_solved(plain: Visit) -> None:
    plain.go("/")
    plain.page.get_by_label("Equations", exact=True).fill("x'' = -x'\ny'' = -y")
    plain.page.get_by_role("button", name="Show what is understood").click()
    expect(plain.page.locator("#understood .formula")).to_have_count(2)
    expect(plain.page.get_by_label("Equations", exact=True)).to_have_value("x'' = -x'\ny'' = -y")
    plain.page.get_by_role("button", name="Open the answer").click()
    expect(plain.page.locator("h1 .yes, h2 .yes").first).to_be_visible()
    whole(plain.page)


@pytest.mark.parametrize("scripts", [True, False])
def test_a_fault_is_marked_at_its_place(visit: Visit, plain: Visit, scripts: bool) -> None:
    at = visit if scripts else plain
    at.go("/")
    at.page.get_by_label("Equations", exact=True).fill("x'' = -y\ny'' = 3*@ + x")
    if not scripts:
        at.page.get_by_role("button", name="Open the answer").click()
    expect(at.page.locator("#understood mark")).to_have_text("@")
    expect(at.page.locator("#understood .where")).to_have_text("Equations, line 2, column 9")
    expect(at.page.locator("#understood .detail")).to_contain_text("not accepted")


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


@pytest.mark.parametrize("scripts", [True, False])
def test_long_work_shows_its_progress_and_can_be_cancelled(visit: Visit, plain: Visit, scripts: bool) -> None:
    at = visit if scripts else plain
    at.go("/")
    at.page.get_by_label("Equations", exact=True).fill(HARD.replace("sin", "sin" if scripts else "cos"))
    at.page.get_by_role("button", name="Open the answer").click()
    expect(at.page.get_by_role("progressbar")).to_be_visible()
    at.page.get_by_role("button", name="Cancel").click()
    expect(at.page.get_by_role("heading", level=1)).to_have_text("This was cancelled")


def test_the_page_of_open_work_becomes_its_result_by_itself(visit: Visit) -> None:
    visit.go("/")
    box = visit.page.get_by_label("Equations", exact=True)
    box.fill(json.dumps({**json.loads(HARD.replace("sin(", "sin(2*")), "options": {"time_limit": 5}}))
    visit.page.get_by_role("button", name="Open the answer").click()
    expect(visit.page.get_by_role("progressbar")).to_be_visible()
    expect(visit.page.locator("h1 .open")).to_be_visible(timeout=18_000)
    whole(visit.page)
    expect(visit.page.locator("main")).to_contain_text("limit")
    visit.page.get_by_role("button", name=re.compile(r"Ask again with \d+ s")).click()
    expect(visit.page.get_by_role("progressbar")).to_be_visible()
    visit.page.get_by_role("button", name="Cancel").click()
    expect(visit.page.get_by_role("heading", level=1)).to_have_text("This was cancelled")


def test_keys_alone_suffice(visit: Visit) -> None:
    visit.go("/")
    visit.page.keyboard.press("Tab")
    expect(visit.page.get_by_role("link", name="Skip to the content")).to_be_focused()
    visit.page.keyboard.press("Enter")
    expect(visit.page.locator("main")).to_be_focused()
    box = visit.page.get_by_label("Equations", exact=True)
    for _ in range(6):
        visit.page.keyboard.press("Tab")
        if box.evaluate("node => node === document.activeElement"):
            break
    visit.page.keyboard.press("Control+a")
    visit.page.keyboard.type("x'' = -4*x")
    visit.page.keyboard.press("Control+Enter")
    expect(visit.page.locator("h1 .yes, h2 .yes").first).to_be_visible()
    whole(visit.page)


def test_an_unknown_result_is_told_so(visit: Visit) -> None:
    visit.go("/results/" + "0" * 40)
    expect(visit.page.get_by_role("heading", level=1)).to_have_text("Nothing here")


def test_on_a_phone_a_refusal_is_seen_without_scrolling(pages: Pages, service: str) -> None:
    page = pages(Look(narrow=True))
    page.goto(service + "/")
    page.get_by_label("Equations", exact=True).fill("x'' = -x\ny'' = -sinn(x)")
    page.get_by_role("button", name="Open the answer").click()
    page.wait_for_load_state()
    expect(page.locator("#understood mark")).to_be_in_viewport()
    box = page.locator(".problem").bounding_box()
    assert box is not None
    assert box["y"] + box["height"] < 844


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
def test_a_link_carries_a_question_and_does_not_ask_it(visit: Visit, plain: Visit, scripts: bool) -> None:
    at = visit if scripts else plain
    at.go("/?equations=x''+%3D+-k*x&parameters=k")
    expect(at.page.get_by_label("Equations", exact=True)).to_have_value("x'' = -k*x")
    expect(at.page.locator("#understood .formula")).to_have_count(1)
    at.go("/?lagrangian=x'^2/2%2By'^2/2&constraints=x'-y'")
    expect(at.page.get_by_label("Constraints", exact=True)).to_have_value("x'-y'")


def test_the_link_to_the_question_of_a_result_fills_the_form_with_it(visit: Visit) -> None:
    visit.go("/?example=sho")
    visit.page.get_by_role("button", name="Open the answer").click()
    link = visit.page.get_by_role("link", name="Link", exact=True).get_attribute("href")
    assert link is not None
    title = visit.page.title()
    assert "Lagrangian" in title
    visit.go(link)
    expect(visit.page.get_by_label("Equations", exact=True)).to_have_value(re.compile("x''"))


@pytest.mark.parametrize("path", ["/nope", "/?example=nope", "/simulate?system=nope", "/results/nope"])
def test_a_mistyped_address_has_a_page(plain: Visit, path: str) -> None:
    answer = plain.page.goto(plain.address + path)
    assert answer is not None
    assert answer.status in (404, 422)
    expect(plain.page.get_by_role("heading", level=1)).to_be_visible()
    expect(plain.page.get_by_role("link", name="Ask a question")).to_be_visible()


def test_a_half_typed_equation_is_not_scolded(visit: Visit) -> None:
    visit.go("/")
    box = visit.page.get_by_label("Equations", exact=True)
    box.fill("")
    visit.page.evaluate(
        "window.said = 0; new MutationObserver(() => { if (document.querySelector('[data-problem]')) window.said++; })"
        ".observe(document.getElementById('understood'), {childList: true, subtree: true})"
    )
    box.press_sequentially("x'' = -sin(x) - 0.1*x'", delay=70)
    expect(visit.page.locator("#understood .formula")).to_have_count(1)
    assert visit.page.evaluate("window.said") == 0


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
    expect(page.locator(".print-only")).to_contain_text(re.compile(r"/results/[0-9a-f]{40}.*20\d\d-"))
    page.context.close()


def test_the_answer_appears_beside_the_form_and_nothing_is_stored(visit: Visit) -> None:
    visit.go("/")
    before = visit.page.request.get(visit.address + "/v1/jobs").json()
    box = visit.page.get_by_label("Equations", exact=True)
    box.fill("")
    box.press_sequentially("x'' = -7*x - 3*x'", delay=40)
    expect(visit.page.locator("#glance h2")).to_contain_text("from a Lagrangian")
    expect(visit.page.locator("#glance .formula").first).to_be_visible()
    assert visit.page.request.get(visit.address + "/v1/jobs").json() == before


@pytest.mark.slow
def test_a_screen_reader_hears_one_end_state_and_no_half_equation(visit: Visit) -> None:
    visit.go("/")
    visit.page.evaluate(
        "window.heard = []; new MutationObserver(() => { const t = document.getElementById('said').textContent;"
        "if (t) window.heard.push(t); }).observe(document.getElementById('said'), {childList: true})"
    )
    box = visit.page.get_by_label("Equations", exact=True)
    box.fill("")
    box.press_sequentially("x'' = -sin(x) - 0.1*x'", delay=70)
    expect(visit.page.locator("#glance [data-settled]")).to_be_visible()
    heard = visit.page.evaluate("window.heard")
    assert len(heard) == 1
    assert "Lagrangian" in heard[0]
    box.press_sequentially(" + @")
    expect(visit.page.locator("#said")).to_contain_text("not accepted")
    expect(visit.page.locator("#glance")).to_be_hidden()


@pytest.mark.slow
def test_formulas_are_set_in_the_font_that_is_sent_with_the_page(visit: Visit) -> None:
    visit.go("/")
    visit.page.wait_for_function("document.fonts.ready.then(() => document.fonts.check('16px Formulas'))")
    faces = visit.page.evaluate("[...document.fonts].map(face => [face.family, face.status])")
    assert ["Formulas", "loaded"] in [[family.strip('"'), status] for family, status in faces]


STREAM = """window.EventSource = class extends EventTarget {
    constructor() { super(); window.stream = this; }
    close() {}
}"""


@pytest.mark.slow
def test_a_page_that_waits_says_that_the_service_is_away_and_that_it_is_back(browser: Browser, service: str) -> None:
    page = new_page(browser, Look())
    page.add_init_script(STREAM)
    page.goto(service + "/")
    page.get_by_label("Equations", exact=True).fill(HARD.replace("sin(", "sin(3*"))
    page.get_by_role("button", name="Open the answer").click()
    told = page.locator("[data-progress]")
    page.wait_for_function("window.stream")
    before = told.inner_text()
    page.evaluate("stream.dispatchEvent(new Event('error'))")
    expect(told).to_contain_text("does not answer at the moment")
    page.evaluate("stream.dispatchEvent(new Event('open'))")
    expect(told).to_have_text(before)
    page.evaluate("data => stream.dispatchEvent(new MessageEvent('status', { data }))", '{"status": "running"}')
    expect(page.locator("h1")).to_have_text("Working on it")
    page.get_by_role("button", name="Cancel").click()
    page.context.close()
