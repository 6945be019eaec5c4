"""Atlas, batches, lessons, calls."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from playwright.sync_api import expect

from .conftest import Visit, whole


@pytest.mark.parametrize("scripts", [True, False])
def test_the_atlas_is_searched_by_words_and_by_equations(visit: Visit, plain: Visit, scripts: bool) -> None:
    at = visit if scripts else plain
    at.go("/atlas")
    expect(at.page.locator(".tiles li")).to_have_count(20)
    at.page.get_by_label("Words").fill("kepler polar")
    at.page.get_by_role("button", name="Search").click()
    expect(at.page.locator("tbody tr").first).to_contain_text("Kepler")
    at.go("/atlas")
    at.page.get_by_label("Equations").fill("b'' = -2*R'*b'/R; R'' = R*b'^2 - 7/R^2")
    at.page.get_by_role("button", name="Search").click()
    at.page.get_by_role("link", name="Kepler problem in polar coordinates").first.click()
    expect(at.page.locator("h1")).to_contain_text("a Lagrangian")
    expect(at.page.locator(".answer .formula").first).to_be_visible()
    at.page.get_by_role("link", name="Open in Solve").click()
    expect(at.page.get_by_label("Equations", exact=True)).to_have_value(re.compile("r''"))
    at.go("/atlas?equations=x''%3D@")
    expect(at.page.get_by_role("alert")).to_be_visible()


@pytest.mark.parametrize("scripts", [True, False])
def test_a_batch_is_uploaded_and_its_lines_lead_to_results(
    visit: Visit, plain: Visit, scripts: bool, tmp_path: Path
) -> None:
    at = visit if scripts else plain
    lines = [{"id": f"n{k}", "equations": f"x'' = -{k}*x"} for k in range(1, 4)] + [{"id": "bad", "equations": "x''="}]
    file = tmp_path / "systems.ndjson"
    file.write_text("\n".join(json.dumps(line) for line in lines))
    at.go("/batch")
    at.page.get_by_label("A file").set_input_files(file)
    at.page.get_by_role("button", name="Solve all").click()
    # Without a script the page asks again by itself every three seconds.
    expect(at.page.get_by_role("status")).to_contain_text("4 of 4 done, 1 failed")
    expect(at.page.locator("tbody tr")).to_have_count(4)
    expect(at.page.locator("tbody tr").nth(3)).to_contain_text("Line 4")
    at.page.get_by_role("link", name="n2", exact=True).click()
    expect(at.page.locator("h1 .yes, h2 .yes").first).to_be_visible()
    whole(at.page)


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


@pytest.mark.slow
def test_every_control_is_reached_by_keys_and_shows_that_it_is(visit: Visit) -> None:
    visit.go("/")
    controls = "a[href], button, summary, textarea, input:not([type=hidden]), select, [tabindex='0']"
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
    assert {f"{method.upper()} {path}" for path, methods in paths.items() for method in methods} <= {*listed}
    assert all(text.strip() for text in visit.page.locator("article .scroll td").all_inner_texts())
