"""An interactive motion in the browser: sliders, dragging, and the computations of its script."""

from __future__ import annotations

import math

import pytest

from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.web.pages.preview import listed

from .conftest import Visit

RUN = """async ([tree, steps, h]) => {
    const { System, run } = await import(
        performance.getEntriesByType("resource").find((one) => one.name.includes("system.js")).name);
    const system = new System({ coordinates: ['x'], values: { k: 4 }, equations: [tree], constraints: [] });
    const found = run(system, system.state([1], [0], { k: 4 }), h, steps);
    return [found.q[0].at(-1), found.v[0].at(-1)];
}"""
VALUE = """async ([tree, values]) => {
    const { compiled } = await import(
        performance.getEntriesByType("resource").find((one) => one.name.includes("system.js")).name);
    return compiled(tree, new Map(Object.keys(values).map((name, k) => [name, k])))(Object.values(values));
}"""
FORMULAS = {
    "sin(x)/cos(x) + tan(x') - cot(x) + sec(x) - csc(x)": lambda x, v: (
        math.tan(x) + math.tan(v) - 1 / math.tan(x) + 1 / math.cos(x) - 1 / math.sin(x)
    ),
    "exp(-x^2/2)*log(x + 3) + sqrt(x)": lambda x, v: (
        math.exp(-x * x / 2) * math.log(x + 3) + math.sqrt(x)
    ),
    "sinh(x) - cosh(x) + tanh(x') + x*x'^3 - pi": lambda x, v: (
        math.sinh(x) - math.cosh(x) + math.tanh(v) + x * v**3 - math.pi
    ),
}


@pytest.mark.slow
def test_the_script_finds_the_values_of_the_formulas(visit: Visit) -> None:
    visit.go("/simulate")
    x, v = 0.7, -1.3
    for text, expected in FORMULAS.items():
        tree = listed(read_formula(text, Names(("x",))))
        found = visit.page.evaluate(VALUE, [tree, {"x": x, "x'": v}])
        assert found == pytest.approx(expected(x, v), rel=1e-14)


@pytest.mark.slow
def test_the_oscillator_of_the_script_has_order_four(visit: Visit) -> None:
    visit.go("/simulate")
    tree = listed(read_formula("-k*x", Names(("x",), ("k",))))
    errors = []
    for steps in (200, 400):
        q, _ = visit.page.evaluate(RUN, [tree, steps, 2.0 / steps])
        errors.append(abs(q - math.cos(4.0)))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.25)
