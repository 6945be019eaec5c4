"""Nonholonomic systems, special cases, scenes and their figures, with scripts and without."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from .conftest import Visit, whole
from .test_every_page import violations


@pytest.mark.parametrize("scripts", [True, False])
def test_a_nonholonomic_system_is_understood_and_its_second_system_solved(
    visit: Visit, plain: Visit, scripts: bool
) -> None:
    at = visit if scripts else plain
    at.go("/")
    at.page.get_by_role("link", name="Constraints", exact=True).click()
    at.page.get_by_label("Lagrangian", exact=True).fill("(x'^2 + y'^2 + z'^2)/2")
    at.page.get_by_label("Constraints", exact=True).fill("z' + x*y'")
    if not scripts:
        at.page.get_by_role("button", name="Show what is understood").click()
    expect(at.page.locator("#understood")).to_contain_text("Constraints")
    at.page.get_by_role("button", name="Open the answer").click()
    expect(at.page.locator("h1")).to_contain_text("this motion can be given")
    expect(at.page.locator("table.verdicts tr.main")).to_contain_text("Yes")


def lines_of(svg: str) -> list[tuple[str, list[tuple[float, float]]]]:
    """(color, corners) of the lines inside the frame."""
    paths = re.findall(r'<path d="([^"]*)" clip-path[^>]*fill: none;[^>]*stroke: (#\w+)', svg)
    return [(color, [(float(x), float(y)) for x, y in re.findall(r"([-\d.]+) ([-\d.]+)", path)])
            for path, color in paths if color not in ("#747d8d",)]  # fmt: skip


def test_special_cases_are_shown_as_a_tree(visit: Visit) -> None:
    visit.go("/")
    visit.page.get_by_label("Equations", exact=True).fill("x'' = -a*x + b*y\ny'' = -c*y + d*x")
    visit.page.get_by_role("button", name="Ask in detail").click()
    visit.page.get_by_label("Special cases").check()
    visit.page.get_by_role("button", name="Open the answer").click()
    whole(visit.page)
    visit.page.get_by_role("heading", name="More").click()
    expect(visit.page.locator("#more dd ul li").first).to_be_visible()
    expect(visit.page.locator("#more")).to_contain_text("examined")


# How many pixels of a canvas have this color, within the edges that are blended.
PIXELS = """(node, [red, green, blue]) => {
    const pen = new OffscreenCanvas(node.width, node.height).getContext("2d", { willReadFrequently: true });
    pen.fillStyle = "white"; // what is pale is no full color
    pen.fillRect(0, 0, node.width, node.height);
    pen.drawImage(node, 0, 0);
    const { data } = pen.getImageData(0, 0, node.width, node.height);
    let found = 0;
    for (let k = 0; k < data.length; k += 4)
        found += Math.abs(data[k] - red) + Math.abs(data[k + 1] - green) + Math.abs(data[k + 2] - blue) < 90;
    return found;
}"""
BLACK, BLUE, ORANGE = [28, 35, 48], [0, 114, 178], [213, 94, 0]


def test_methods_are_run_side_by_side_and_drawn(visit: Visit) -> None:
    visit.go("/simulate")
    visit.page.get_by_label("Steps").fill("200")
    visit.page.get_by_role("button", name="Run").click()
    expect(visit.page.locator("[data-drawn]")).to_be_visible(timeout=40_000)
    assert visit.page.locator("tbody tr").filter(has_text="completed").count() == 3
    for name in ("path", "coordinates", "energy", "constraints"):
        expect(visit.page.locator(f"[data-plot={name}] canvas").first).to_be_visible()
    # Curves that coincide are both seen.
    for ink in (BLUE, ORANGE):
        assert visit.page.locator("[data-plot=coordinates] canvas").evaluate(PIXELS, ink) > 100
    assert visit.page.locator("[data-plot=error]").count() == 0
    shown = visit.page.locator("[data-plot=coordinates]")
    shown.get_by_text("As a table").click()
    expect(shown.get_by_role("row")).to_have_count(22)
    expect(shown.get_by_role("row").last).to_contain_text("10.00")  # 200 steps of 0.05
    visit.page.get_by_text("What each option cost").click()
    costs = visit.page.locator("#cost")
    expect(costs.get_by_role("row", name="energy")).to_contain_text("s")
    assert costs.get_by_role("row", name="error").count() == 0
    assert violations(visit) == []


def test_the_points_of_a_long_run_are_no_black_ring(visit: Visit) -> None:
    visit.go("/simulate")
    visit.page.get_by_label("Steps").fill("5000")
    visit.page.get_by_role("button", name="Run").click()
    expect(visit.page.locator("[data-drawn]")).to_be_visible(timeout=40_000)
    path = visit.page.locator("[data-plot=path] canvas")
    black, orange = (path.evaluate(PIXELS, ink) for ink in (BLACK, ORANGE))
    assert orange > 500
    assert black < orange / 10


def test_without_scripts_a_scene_has_pictures_and_files(plain: Visit) -> None:
    plain.go("/simulate?system=knife-edge")
    plain.page.get_by_label("Steps").fill("100")
    plain.page.get_by_label("Matching circle").uncheck()
    plain.page.get_by_role("button", name="Run").click()
    picture = plain.page.locator("[data-plot=energy] img")
    # Without a script an unfinished page asks again every two seconds.
    expect(picture).to_be_visible(timeout=40_000)
    request = plain.page.context.request
    folder = plain.page.url
    svg = request.get(f"{folder}/figures/energy.svg")
    assert svg.status == 200
    assert b"<svg" in svg.body()
    assert request.get(f"{folder}/figures/energy.png").body().startswith(b"\x89PNG")
    csv = plain.page.get_by_role("link", name="as CSV").first.get_attribute("href")
    npz = plain.page.get_by_role("link", name="as NPZ").first.get_attribute("href")
    rows = request.get(plain.address + str(csv)).text().splitlines()
    assert rows[0].startswith("t,phi,x,y")
    assert len(rows) == 102
    with np.load(io.BytesIO(request.get(plain.address + str(npz)).body())) as data:
        assert data["phi"].shape == (101,)
    assert request.get(f"{folder}/figures/nothing.svg").status == 404
    assert request.get(f"{folder}/data/nothing.csv").status == 404


def test_a_lagrangian_that_was_found_is_simulated_and_the_scene_changed(visit: Visit) -> None:
    visit.go("/?example=sho")
    visit.page.get_by_role("button", name="Open the answer").click()
    visit.page.get_by_role("link", name="Simulate", exact=True).last.click()
    visit.page.get_by_label("Steps").fill("50")
    visit.page.get_by_role("button", name="Run").click()
    visit.page.get_by_role("link", name="Change the scene").click(timeout=40_000)
    expect(visit.page.get_by_label("Steps")).to_have_value("50")
    visit.page.get_by_label("Steps").fill("60")
    visit.page.get_by_role("button", name="Run").click()
    expect(visit.page.locator("tbody tr", has_text="completed").first).to_contain_text("60", timeout=40_000)


def test_a_constrained_result_is_simulated_with_the_lagrangian_that_was_found(visit: Visit) -> None:
    document = {
        "coordinates": ["x", "y", "z"], "lagrangian": "(x'^2 + y'^2 + z'^2)/2", "constraints": ["z' + x*y'"],
        "associated": "second",
    }  # fmt: skip
    solved = visit.page.request.post(f"{visit.address}/v1/solve", data=document, headers={"Prefer": "wait=20"})
    found = solved.json()["lagrangian"]["text"]
    visit.go("/simulate?job=" + solved.headers["location"].rpartition("/")[2])
    visit.page.get_by_label("Steps").fill("40")
    visit.page.get_by_role("button", name="Run").click()
    visit.page.get_by_text("The scene as a document").click(timeout=40_000)
    expect(visit.page.get_by_label("The scene as JSON")).to_contain_text(f'"free_lagrangian": "{found}"')
    expect(visit.page.locator("tbody tr", has_text="variational").first).to_contain_text("completed")


@pytest.mark.slow
def test_error_is_measured_against_time(browser: Browser, patient: str) -> None:
    """Five methods at many steps take 4 s alone, and beside other work more than the 10 s of the other service."""
    page = browser.new_page()
    page.goto(f"{patient}/simulate?system=knife-edge")
    page.get_by_label("Steps").fill("20")
    page.get_by_role("button", name="Measure error vs. time").click()
    expect(page.locator("[data-plot=work-precision] .legend span").first).to_be_visible(timeout=60_000)
    assert page.locator("table.prices tbody tr").count() == 4
    assert page.locator("table.prices .best").count() >= 1
    picture, table = (page.locator(place).bounding_box() for place in ("[data-plot]", "table.prices"))
    assert picture is not None
    assert table is not None
    assert picture["y"] < table["y"]
    csv = page.request.get(page.url + "/prices.csv").text().splitlines()
    assert csv[0].startswith("error,method")
    page.close()


@pytest.mark.slow
@pytest.mark.parametrize("scripts", [True, False])
def test_what_is_wrong_with_a_scene_is_told_beside_its_field(visit: Visit, plain: Visit, scripts: bool) -> None:
    at = visit if scripts else plain
    at.go("/simulate?system=sho")
    at.page.get_by_label("x", exact=True).fill("abc")
    at.page.get_by_role("button", name="Run").click()
    field = at.page.locator(".field", has=at.page.locator("[name='position.x']"))
    expect(field.locator(".fault")).to_contain_text("not a number")
    expect(at.page.locator("[name='position.x']")).to_have_attribute("aria-invalid", "true")
    expect(at.page.get_by_label("x", exact=True)).to_have_value("abc")
    assert "/results/" not in at.page.url


def test_the_address_is_the_scene_before_it_is_run(visit: Visit) -> None:
    visit.go("/simulate?system=sho")
    expect(visit.page.locator("[data-play-motion] [data-all]")).to_have_attribute("d", re.compile("M"))
    visit.page.get_by_label("x", exact=True).fill("0.75")
    expect(visit.page).to_have_url(re.compile("position.x=0.75"))
    visit.page.reload()
    expect(visit.page.get_by_label("x", exact=True)).to_have_value("0.75")


@pytest.mark.slow
def test_the_step_has_its_price_beside_it(visit: Visit) -> None:
    """Runge-Kutta has order 4: half of a step of 0.1 has a sixteenth of its error."""
    visit.go("/simulate?system=sho&method=runge-kutta&step=0.1&steps=100&position.x=1&velocity.x=0&parameter.k=1")
    price = visit.page.locator("[data-price]")
    expect(price).to_contain_text("runge-kutta", timeout=30_000)

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
