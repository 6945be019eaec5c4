"""The answer sheet, home and exercises: what three visitors came for, in one screen."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import expect

from .conftest import Look, Pages, Scheme, Visit, visited, whole
from .test_every_page import is_too_wide, open_all, violations

DAMPED = "m x'' + d x' + k x = 0"
SLEIGH = {
    "lagrangian": "m/2*(x'^2+y'^2)+J/2*phi'^2+m*a*phi'*(-x'*sin(phi)+y'*cos(phi))",
    "constraints": ["x'*sin(phi)-y'*cos(phi)"],
    "parameters": "guess",
}
EXERCISE = "/exercise?equations=x''+%3D+-x+-+c*x'&title=A+Lagrangian+with+friction"


def ask(visit: Visit, document: dict[str, Any]) -> None:
    """Open the page of an answer."""
    found = visit.page.request.post(f"{visit.address}/v1/solve", data=document, headers={"Prefer": "wait=20"})
    place = found.headers.get("location") or found.headers["content-location"]
    visit.go("/results/" + place.rpartition("/")[2])


@pytest.fixture(
    params=[
        (False, "light"),
        (True, "dark"),
        *(pytest.param(p, marks=pytest.mark.slow) for p in ((False, "dark"), (True, "light"))),
    ],
    ids=str,
)
def look(request: pytest.FixtureRequest, pages: Pages, service: str) -> Iterator[tuple[Visit, bool]]:
    narrow, scheme = request.param
    found: Scheme = scheme
    for visit in visited(pages(Look(narrow=narrow, scheme=found)), service):
        yield visit, narrow


def test_a_student_sees_l_h_and_the_motion_in_one_screen(look: tuple[Visit, bool]) -> None:
    visit, narrow = look
    ask(visit, {"equations": DAMPED, "parameters": "guess"})
    page, height = visit.page, 844 if narrow else 900
    expect(page.locator("h1")).to_contain_text("that contains the time")
    for letter in ("L", "H"):
        place = page.locator(".answer .formula:not(.small)", has_text=letter).first.bounding_box()
        assert place is not None
        assert place["y"] + place["height"] < height
    picture = page.locator("figure.motion").bounding_box()
    assert picture is not None
    assert picture["y"] + picture["height"] < height
    before = page.locator("[data-done]").get_attribute("d")
    expect(page.locator("[data-done]")).not_to_have_attribute("d", before or "")
    assert narrow or page.evaluate("document.documentElement.scrollHeight") < 1_400
    open_all(visit)
    assert violations(visit) == []
    assert not is_too_wide(visit)


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


def test_sliders_and_the_start_change_the_motion(visit: Visit) -> None:
    ask(visit, {"equations": DAMPED, "parameters": "guess"})
    path, hand = visit.page.locator("[data-all]"), visit.page.locator("[data-hand]")
    first = path.get_attribute("d")
    visit.page.locator("[data-dials] label", has_text="damping").locator("input").fill("0")
    second = path.get_attribute("d")
    assert second != first
    hand.focus()
    visit.page.keyboard.press("ArrowLeft")
    assert path.get_attribute("d") != second
    spot = hand.locator(".ring").bounding_box()
    assert spot is not None
    visit.page.mouse.move(spot["x"] + 7, spot["y"] + 7)
    visit.page.mouse.down()
    visit.page.mouse.move(spot["x"] - 60, spot["y"] + 40)
    visit.page.mouse.up()
    moved = hand.locator(".ring").bounding_box()
    assert moved is not None
    assert moved["x"] != spot["x"]


def test_a_researcher_sees_one_table_and_no_contradiction(look: tuple[Visit, bool]) -> None:
    visit, _ = look
    ask(visit, SLEIGH)
    page = visit.page
    expect(page.locator("h1")).to_contain_text("cannot")
    assert "has no Hamiltonian" in page.title()
    main = page.locator("table.verdicts tr.main")
    expect(main).to_contain_text("No")
    for word in ("undetermined", "no certificate", "any_associated"):
        assert word not in page.locator("main").inner_text()
    main.get_by_role("button").click()
    expect(page.locator("table.verdicts tr.main + tr .proof li").first).to_be_visible()
    assert violations(visit) == []
    assert not is_too_wide(visit)


def test_without_scripts_every_proof_is_open(plain: Visit) -> None:
    ask(plain, SLEIGH)
    assert plain.page.locator("table.verdicts .why:visible").count() >= 5


def test_home_answers_before_one_types_and_within_a_moment_after(visit: Visit) -> None:
    visit.go("/")
    expect(visit.page.locator("#glance h2")).to_contain_text("Yes")
    box = visit.page.get_by_label("Equations", exact=True)
    box.fill("")
    box.press_sequentially(DAMPED, delay=20)
    began = time.monotonic()
    expect(visit.page.locator("#live.old")).to_have_count(1)
    expect(visit.page.locator("#live:not(.old) #glance h2")).to_contain_text("contains the time")
    print(f"answer after {time.monotonic() - began:.2f} s")
    expect(visit.page.locator("#live svg [data-body] *").first).to_be_attached()
    box.fill("x'' = -kx - @")
    expect(visit.page.locator("#understood [data-problem]")).to_be_visible()
    expect(visit.page.locator("#live")).to_be_hidden()


def test_an_answer_that_is_no_page_is_not_dropped_in_silence(visit: Visit) -> None:
    visit.go("/")
    visit.page.route(
        re.compile("fragment=1"), lambda r: r.fulfill(status=500, content_type="application/json", body="{}")
    )
    visit.page.get_by_label("Equations", exact=True).fill("x'' = -5*x")
    expect(visit.page.locator("#understood")).to_contain_text("error of the program")
    expect(visit.page.locator("#live")).to_be_hidden()
    visit.page.unroute(re.compile("fragment=1"))
    visit.seen.console.clear()


def test_on_a_phone_the_verdict_is_a_strip_and_a_link(pages: Pages, service: str) -> None:
    for visit in visited(pages(Look(narrow=True)), service):
        visit.go("/")
        strip = visit.page.locator("#live")
        expect(strip).to_contain_text("Yes")
        place = strip.bounding_box()
        assert place is not None
        assert place["y"] + place["height"] == pytest.approx(844, abs=2)
        strip.click()
        expect(visit.page.locator("#verdict")).to_be_visible()
        whole(visit.page)


def test_the_result_can_be_taken_along(visit: Visit) -> None:
    visit.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    ask(visit, {"equations": "x'' = -F(x)", "parameters": "guess"})
    visit.page.get_by_role("button", name="Copy L as LaTeX").click()
    assert visit.page.evaluate("navigator.clipboard.readText()").startswith("L = \\frac")
    visit.page.get_by_role("heading", name="Export").click()
    for name, words in (("SymPy", "from sympy"), ("LaTeX", "\\documentclass")):
        visit.page.locator("#export").get_by_role("link", name=name, exact=True).click()
        expect(visit.page.locator("#code")).to_contain_text(words)
    with visit.page.expect_download() as download:
        visit.page.get_by_role("link", name="Certificate").click()
    assert "lagrangian" in download.value.path().read_text()


@pytest.mark.parametrize("scripts", [True, False])
def test_ones_own_lagrangian_is_judged_on_the_page(visit: Visit, plain: Visit, scripts: bool) -> None:
    at = visit if scripts else plain
    ask(at, {"equations": "x'' = -x"})
    for text, said in (("x'^2/2 + x^2/2", "Not yet"), ("x'^2/2 - x^2/2", "Yes")):
        if not at.page.get_by_label("Check your own L").is_visible():
            at.page.get_by_role("heading", name="More").click()
        at.page.get_by_label("Check your own L").fill(text)
        at.page.get_by_role("button", name="Does it give these equations?").click()
        expect(at.page.locator("#own + [role=status]")).to_contain_text(said)


@pytest.mark.parametrize("scripts", [True, False])
def test_a_teacher_makes_an_exercise_and_a_student_solves_it(visit: Visit, plain: Visit, scripts: bool) -> None:
    at = visit if scripts else plain
    ask(at, {"equations": "x'' = -x - c*x'", "parameters": "guess"})
    at.page.get_by_role("link", name="Make an exercise").click()
    at.page.get_by_label("Title").fill("A Lagrangian with friction")
    at.page.get_by_role("button", name="Make the link").click()
    link = at.page.locator("#link").inner_text()
    at.go("/" + link.partition("/exercise")[1].lstrip("/") + link.partition("/exercise")[2])
    expect(at.page.locator("h1")).to_have_text("A Lagrangian with friction")
    assert "textarea" not in at.page.locator("main").inner_html()
    own = at.page.get_by_label("Your L", exact=True)
    for text, said in (
        ("x'^2/2 - x^2/2", "Not yet"),
        ("x'^2 + @", "not be understood"),
        ("exp(c*t)*(x'^2 - x^2)/2", "Yes"),
    ):
        own.fill(text)
        at.page.get_by_role("button", name="Check").click()
        expect(at.page.locator("#feedback")).to_contain_text(said)
    at.page.get_by_label("Your name, for a code").fill("Ada")
    at.page.get_by_role("button", name="Get a code").click()
    code = at.page.locator("#feedback code").inner_text()
    solved = at.page.url
    for student, verdict in (("Ada", "genuine"), ("Bob", "does not belong")):
        at.go("/teach")
        at.page.get_by_label("Link of the exercise").fill(solved)
        at.page.get_by_label("Name of the student").fill(student)
        at.page.get_by_label("Code", exact=True).fill(code)
        at.page.get_by_role("button", name="Verify").click()
        expect(at.page.locator("main [role=status]")).to_contain_text(verdict)


def test_there_is_none_is_an_answer_and_hints_come_one_after_the_other(visit: Visit) -> None:
    visit.go("/exercise?equations=x''+%3D+-y%0Ay''+%3D+x*x'")
    visit.page.get_by_text("Hint 2").click(force=True)
    assert not visit.page.locator("[data-hint]").nth(1).evaluate("node => node.open")
    visit.page.get_by_text("Hint 1").click()
    visit.page.get_by_text("Hint 2").click()
    assert visit.page.locator("[data-hint]").nth(1).evaluate("node => node.open")
    visit.page.get_by_label("There is none").check()
    visit.page.get_by_role("button", name="Check").click()
    expect(visit.page.locator("#feedback")).to_contain_text("Right")
    assert violations(visit) == []


def test_hints_say_neither_the_verdict_nor_the_answer(visit: Visit) -> None:
    visit.go(EXERCISE)
    text = visit.page.locator(".hints").inner_text()
    assert not re.search(r"Yes|exists|There is|none", text)
