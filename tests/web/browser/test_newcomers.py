"""What a person who has read nothing finds on the start page, counted in clicks; and the colors they choose."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, expect

from .conftest import Visit


def paper(page: Page) -> str:
    color: str = page.evaluate("getComputedStyle(document.body).backgroundColor")
    return color


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
