"""The page of a family: choosing a member by sliders, by a click, by keys, and by its address."""

from __future__ import annotations

import time

import httpx
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from .conftest import Look, Pages, Visit, visited, whole
from .test_people import ask

pytestmark = pytest.mark.slow
# An L iff d = a, d = -a, or b = c = 0.
DAMPED = {
    "equations": {"x": "-a*x' + b*y", "y": "c*x - d*y'"}, "parameters": [*"abcd"], "family": True, "first_integrals": False,
}  # fmt: skip
ANSWERS = {word: f"This member has {word} Lagrangian." for word in ("a", "no")}


@pytest.fixture(scope="module")
def family(service: str) -> str:
    """The path of the page of the family."""
    begun = httpx.post(
        f"{service}/v1/solve", json=DAMPED, headers={"Prefer": "respond-async"}, timeout=60
    )
    path = f"/results/{begun.headers['Location'].rpartition('/')[2]}"
    while "data-leaf" not in httpx.get(service + path, timeout=60).text:
        time.sleep(0.3)
    return f"{path}/family"


def says(page: Page, word: str) -> None:
    expect(page.locator("[data-member] h2")).to_have_text(ANSWERS[word])


def place(page: Page, across: float, up: float) -> tuple[float, float]:
    """The pixels of two constants on the map."""
    box = page.locator("[data-map] svg").bounding_box()
    assert box is not None
    scale = box["width"] / 560
    return (
        box["x"] + (44 + 470 * (across + 3) / 6) * scale,
        box["y"] + (14 + 470 * (3 - up) / 6) * scale,
    )


def test_a_member_is_chosen_by_sliders_clicks_keys_and_address(visit: Visit, family: str) -> None:
    page = visit.page
    visit.go(family)
    says(page, "a")  # a = d = 1
    page.fill("[name='at.d']", "2")
    says(page, "no")
    assert "at.d=2" in page.url
    page.reload()
    says(page, "no")
    expect(page.locator("[name='at.d']")).to_have_value("2")
    page.locator("[data-map] svg").scroll_into_view_if_needed()
    page.mouse.click(*place(page, 1.5, -1.46))
    says(page, "a")
    expect(page.locator("[data-member]")).to_contain_text("It belongs to")
    page.mouse.move(*place(page, -2, 0.5))
    expect(page.locator("[data-pointed]")).to_contain_text("in general: none")
    page.mouse.move(*place(page, -2, -2))
    expect(page.locator("[data-pointed]")).to_contain_text("d = a: yes")
    page.locator("[data-map] svg").focus()
    page.keyboard.press("ArrowUp")
    says(page, "no")
    page.select_option("[name=across]", "b")
    page.select_option("[name=up]", "c")
    expect(page.locator("[data-map] circle.point")).to_have_count(1)
    chosen = page.url
    page.get_by_text("The general member").click()
    expect(page.locator("h1")).to_contain_text("Three sets of members do")
    page.go_back()
    says(page, "no")
    assert page.url == chosen


def test_a_row_and_a_button_lead_to_a_member(visit: Visit, family: str) -> None:
    page = visit.page
    visit.go(f"{family}?at.a=1&at.d=2")
    says(page, "no")
    page.locator("[data-to=yes]").click()
    says(page, "a")
    expect(page.locator("[name='at.a']")).to_have_value("1.5")
    expect(page.locator("[data-member]")).not_to_contain_text("nearest")
    page.locator("table [data-to='0']").click()
    says(page, "no")
    page.locator("table [data-to='3']").click()
    expect(page.locator("[name='at.b']")).to_have_value("0")
    assert "at.b=0" in page.url
    assert "to=" not in page.url


def test_members_stand_side_by_side_also_after_a_reload_and_without_scripts(
    visit: Visit, plain: Visit, family: str
) -> None:
    page = visit.page
    visit.go(family)
    says(page, "a")
    page.get_by_role("link", name="Put it beside others").click()
    expect(page.locator("#beside article")).to_have_count(1)
    page.fill("[name='at.d']", "2")
    says(page, "no")
    page.get_by_role("link", name="Put it beside others").click()
    for _ in range(2):
        expect(page.locator("#beside article h3")).to_have_text([ANSWERS["a"], ANSWERS["no"]])
        expect(page.locator("#beside [data-motion] svg.blank")).to_have_count(0)
        page.reload()
    assert page.get_by_role("link", name="Put it beside others").count() == 0  # it is
    kept = page.url.removeprefix(page.url.partition("/results/")[0])
    page.get_by_role("link", name="Choose a = 1, b = 1, c = 1, d = 1 on the map").click()
    says(page, "a")
    expect(page.locator("#beside article")).to_have_count(2)
    plain.go(kept)
    expect(plain.page.locator("#beside article")).to_have_count(2)
    plain.page.get_by_role("link", name="Take a = 1, b = 1, c = 1, d = 1 away").click()
    expect(plain.page.locator("#beside article h3")).to_have_text([ANSWERS["no"]])


def test_it_answers_without_scripts(plain: Visit, family: str) -> None:
    plain.go(f"{family}?across=b&up=c&at.a=1&at.d=2&at.b=0&at.c=0")
    says(plain.page, "a")
    plain.page.fill("[name='at.c']", "1")
    plain.page.get_by_role("button", name="Draw").click()
    says(plain.page, "no")
    plain.page.locator("table [data-to='1']").click()
    says(plain.page, "a")


@pytest.mark.parametrize("look", [Look(), Look(narrow=True), Look(scheme="dark")])
def test_it_is_accessible_and_not_too_wide(
    pages: Pages, service: str, family: str, look: Look
) -> None:
    for visit in visited(pages(look), service):
        visit.go(f"{family}?beside=1,1,1,1;1,1,1,2;1,0,0,2")
        says(visit.page, "a")
        expect(visit.page.locator("#beside article")).to_have_count(3)
        found = Axe().run(visit.page, options={"resultTypes": ["violations"]}).response
        assert [(one["id"], one["nodes"][0]["html"][:150]) for one in found["violations"]] == []
        assert not visit.page.evaluate("document.documentElement.scrollWidth > innerWidth")
        # No text of the map lies on another.
        boxes = visit.page.evaluate(
            "[...document.querySelectorAll('.map text')].map((one) => one.getBoundingClientRect().toJSON())"
        )
        for k, one in enumerate(boxes):
            for other in boxes[:k]:
                assert one["right"] < other["left"] or other["right"] < one["left"] or (
                    one["bottom"] <= other["top"] + 4 or other["bottom"] <= one["top"] + 4
                )  # fmt: skip


def test_all_members_are_decided_where_one_asks_for_them(visit: Visit) -> None:
    page = visit.page
    ask(visit, {"equations": "x'' = -a*x + b*y; y'' = c*x - d*y", "parameters": [*"abcd"]})
    page.get_by_role("link", name="Decide all members").first.click()
    expect(page.locator("#verdict")).to_contain_text("every member", timeout=60_000)
    expect(page.locator("table.members tbody tr").first).to_be_visible()
    assert "/results/" in page.url
    whole(page)
    cell = page.locator("table.members td.lh").first
    expect(cell.locator(".formula")).to_have_count(1)
    expect(cell.locator("a[data-here]")).to_have_count(2)
    cell.locator("a[data-here]").first.click()
    expect(cell.locator("b.yes")).to_have_count(1)
    expect(cell.locator(".formula")).to_have_count(2)
    expect(cell.get_by_role("link", name="Open it")).to_have_count(1)
    expect(cell.locator("a[data-here]")).to_have_count(1)


def test_the_page_of_a_family_waits_for_its_answer(visit: Visit) -> None:
    """With the member that its address names."""
    document = {**DAMPED, "equations": {"x": "-2*a*x' + b*y", "y": "c*x - 3*d*y'"}}
    begun = httpx.post(
        f"{visit.address}/v1/solve", json=document, headers={"Prefer": "respond-async"}, timeout=60
    )
    place = f"/results/{begun.headers['Location'].rpartition('/')[2]}/family?at.a=2"
    visit.go(place)
    expect(visit.page.locator("[data-member] h2")).to_be_visible(timeout=120_000)
    expect(visit.page.locator("[name='at.a']")).to_have_value("2")
    assert visit.page.url == visit.address + place
