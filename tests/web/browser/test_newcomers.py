"""What a person who has read nothing finds on the start page, counted in clicks; and the colors they choose."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, expect

from .conftest import Visit


def paper(page: Page) -> str:
    color: str = page.evaluate("getComputedStyle(document.body).backgroundColor")
    return color


@pytest.mark.parametrize("scripts", [True, False])
def test_one_click_leads_to_the_proof_that_the_disk_has_no_lagrangian(
    visit: Visit, plain: Visit, scripts: bool
) -> None:
    at = visit if scripts else plain
    at.go("/")
    at.page.get_by_role("button", name="Rolling disk: proof that no Lagrangian exists").click()
    expect(at.page.locator(".verdict.not_variational h1")).to_contain_text("do not come from any regular Lagrangian")
    expect(at.page.locator("main")).to_contain_text("first associated system")
    expect(at.page.locator(".proof > li").last).to_contain_text("There is no Lagrangian")
    expect(at.page.locator("#answer .badge.valid")).to_be_visible()


def test_one_click_leads_to_the_circle_of_the_second_system(visit: Visit) -> None:
    visit.go("/")
    visit.page.get_by_role("button", name="Rolling disk: see its circle").click()
    expect(visit.page.locator("[data-plot=path] .legend span").first).to_be_visible(timeout=40_000)
    expect(visit.page.get_by_role("button", name="Play")).to_be_visible()
    expect(visit.page.locator("main")).to_contain_text("second associated system")
    row = visit.page.locator("tbody tr", has_text="variational").first
    headings = visit.page.locator("thead th.number").all_inner_texts()
    places = [headings.index(f"radius, {which} circle") for which in ("first", "last")]
    first, last = (float(row.locator("td.number").nth(k).inner_text()) for k in places)
    assert first == pytest.approx(last, rel=1e-2)


def test_without_scripts_the_circle_is_a_picture(plain: Visit) -> None:
    plain.go("/")
    plain.page.get_by_role("button", name="Rolling disk: see its circle").click()
    picture = plain.page.locator("[data-plot=path] img")
    expect(picture).to_be_visible(timeout=40_000)
    assert plain.page.request.get(plain.address + str(picture.get_attribute("src"))).status == 200


@pytest.mark.slow
@pytest.mark.parametrize("scripts", [True, False])
def test_another_system_to_simulate_is_one_click_in_the_list(visit: Visit, plain: Visit, scripts: bool) -> None:
    at = visit if scripts else plain
    at.go("/simulate")
    at.page.get_by_text("Another system").click()
    at.page.get_by_role("link", name="Knife edge on a horizontal plane").click()
    expect(at.page.locator("#picture-title")).to_have_text("Knife edge on a horizontal plane")


@pytest.mark.slow
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
