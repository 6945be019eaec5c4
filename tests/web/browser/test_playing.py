"""A motion that is played with in the browser: sliders, dragging, charts, and what its script computes."""

from __future__ import annotations

import math
import re

import pytest
from playwright.sync_api import expect

from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.web.pages.preview import listed

from .conftest import Visit
from .test_every_page import is_too_wide, violations

RUN = """async ([tree, steps, h, method]) => {
    const { System, run } = await import(document.querySelector('script[src*="play.js"]').src);
    const system = new System({ coordinates: ['x'], values: { k: 4 }, equations: [tree], constraints: [] });
    const found = run(system, system.state([1], [0], { k: 4 }), h, steps, method);
    return [found.q[0].at(-1), found.v[0].at(-1)];
}"""
VALUE = """async ([tree, values]) => {
    const { compiled } = await import(document.querySelector('script[src*="play.js"]').src);
    return compiled(tree, new Map(Object.keys(values).map((name, k) => [name, k])))(Object.values(values));
}"""
FORMULAS = {
    "sin(x)/cos(x) + tan(x') - cot(x) + sec(x) - csc(x)": lambda x, v: (
        math.tan(x) + math.tan(v) - 1 / math.tan(x) + 1 / math.cos(x) - 1 / math.sin(x)
    ),
    "exp(-x^2/2)*log(x + 3) + sqrt(x)": lambda x, v: math.exp(-x * x / 2) * math.log(x + 3) + math.sqrt(x),
    "sinh(x) - cosh(x) + tanh(x') + x*x'^3 - pi": lambda x, v: (
        math.sinh(x) - math.cosh(x) + math.tanh(v) + x * v**3 - math.pi
    ),
}


def test_the_script_finds_the_values_of_the_formulas(visit: Visit) -> None:
    visit.go("/simulate")
    x, v = 0.7, -1.3
    for text, expected in FORMULAS.items():
        tree = listed(read_formula(text, Names(("x",))))
        found = visit.page.evaluate(VALUE, [tree, {"x": x, "x'": v}])
        assert found == pytest.approx(expected(x, v), rel=1e-14)


@pytest.mark.slow
def test_the_oscillator_of_the_script_has_the_orders_of_its_methods(visit: Visit) -> None:
    visit.go("/simulate")
    tree = listed(read_formula("-k*x", Names(("x",), ("k",))))
    for method, order in (("euler", 1), ("symplectic", 1), ("runge", 4)):
        errors = []
        for steps in (200, 400):
            q, _ = visit.page.evaluate(RUN, [tree, steps, 2.0 / steps, method])
            errors.append(abs(q - math.cos(4.0)))
        assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.25)


@pytest.mark.slow
def test_a_slider_and_a_drag_move_the_start_and_what_is_drawn(visit: Visit) -> None:
    visit.go("/simulate?system=inclined-knife-edge")
    page = visit.page
    chart = page.locator("canvas[data-chart]")
    expect(chart).to_be_visible()
    page.get_by_role("button", name="Pause").click()
    before = chart.evaluate("node => node.toDataURL()")
    page.get_by_label(re.compile("\u03c6\u2032, slider")).fill("2.1")
    expect(page.get_by_role("textbox", name="\u03c6\u2032", exact=True)).to_have_value("2.1")
    page.get_by_label("Chart").select_option("time")
    page.locator("#play-coordinate").select_option("x")
    after = chart.evaluate("node => node.toDataURL()")
    assert after != before
    page.get_by_label("Chart").select_option("phase")
    size = chart.evaluate("node => [node.clientWidth, node.clientHeight]")
    chart.click(position={"x": size[0] * 0.6, "y": size[1] * 0.3})
    moved = float(page.get_by_role("textbox", name="x", exact=True).input_value())
    assert moved != 0
    for kind in ("difference", "section"):
        page.get_by_label("Beside it").select_option("euler")
        page.get_by_label("Chart").select_option(kind)
    assert violations(visit) == []
    assert not is_too_wide(visit)


@pytest.mark.slow
def test_a_solved_pendulum_is_played_with_as_a_pendulum_and_run(visit: Visit) -> None:
    visit.go("/?equations=theta''+%3D+-sin(theta)")
    visit.page.get_by_role("button", name="Find out").click()
    visit.page.get_by_role("link", name="Simulate this").click()
    expect(visit.page.get_by_label("Shown as")).to_have_value("pendulum")
    visit.page.get_by_role("button", name="Run").click()
    expect(visit.page.get_by_role("heading", name="What was simulated")).to_be_visible(timeout=40_000)
    expect(visit.page.get_by_label("Shown as")).to_have_value("pendulum")
    expect(visit.page.locator("[data-track]")).to_have_count(2)
    visit.page.locator("[data-track]").nth(1).uncheck()
    expect(visit.page.locator("main")).to_contain_text("at the start")
