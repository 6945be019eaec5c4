"""Pictures say what is true: each case is seen, and no motion is drawn through a place where it has
no value or past the time at which friction holds it.
"""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import expect

from .conftest import Visit
from .test_people import ask

pytestmark = pytest.mark.slow

# The parts of a picture that its cases have.
SHARES = """() => {
    const svg = document.querySelector(".motion svg");
    const all = svg.clientWidth * svg.clientHeight;
    const parts = [...svg.querySelectorAll(".shade")].map((part) => part.getBBox());
    return parts.map(({ width, height }) => (width * height) / all);
}"""
TRACK = "() => { const { t, q, v } = document.querySelector('[data-motion]').motion.main; return { t, q: q[0], v: v[0] }; }"


@pytest.mark.parametrize(
    ("equation", "count"),
    [
        ("x'' = -abs(x)", 2),
        ("x'' = -5*abs(x - 2)", 2),
        ("x'' = -abs(x - 10)", 2),
        ("x'' = -abs(x + 7)/3", 2),
        ("x'' = -x - abs(x - 1) - abs(x + 2)", 3),
        ("x'' = -abs(x) - abs(x - 1) - abs(x + 1)", 4),
    ],
)
def test_each_case_has_its_share_of_the_picture_and_its_words(
    fresh: Visit, equation: str, count: int
) -> None:
    ask(fresh, {"equations": equation})
    for width in (390, 1280):
        fresh.page.set_viewport_size({"width": width, "height": 900})
        fresh.page.wait_for_timeout(200)
        shares = fresh.page.evaluate(SHARES)
        assert len(shares) == count
        assert min(shares) > 0.3 / count
        expect(fresh.page.locator(".motion text.case")).to_have_count(count)


@pytest.mark.parametrize("equation", ["x'' = -1/x^2", "x'' = -1/x", "x'' = -4/x"])
def test_a_motion_ends_where_it_falls_into_a_pole(fresh: Visit, equation: str) -> None:
    ask(fresh, {"equations": equation})
    expect(fresh.page.locator("[data-said]")).to_contain_text("no value from t =")
    assert min(fresh.page.evaluate(TRACK)["q"]) > 0


@pytest.mark.parametrize("equation", ["x'' = -sin(x)/x", "x'' = -sign(x)", "x'' = -x"])
def test_a_motion_goes_on_where_its_force_is_bounded(fresh: Visit, equation: str) -> None:
    ask(fresh, {"equations": equation})
    expect(fresh.page.locator("[data-said]")).to_have_text("by Runge\u2013Kutta")


def test_a_motion_ends_where_dry_friction_holds_it(fresh: Visit) -> None:
    """|x| < 2 at rest: x'' = -x - 2 sign(x') keeps it there."""
    ask(fresh, {"equations": "x'' = -x - 2*sign(x')"})
    expect(fresh.page.locator("[data-said]")).to_have_text(re.compile("at rest from t = "))
    track = fresh.page.evaluate(TRACK)
    assert abs(track["v"][-1]) < 0.1
    assert all(v > 0 for v in track["v"][:-1])


# The greatest of the constraints, and between which values the energy, the first meter, is.
KEPT = """() => {
    const { main, system, meters, values } = document.querySelector("[data-motion]").motion;
    const states = main.t.map((_, k) => system.state(main.q.map((one) => one[k]), main.v.map((one) => one[k]), values));
    const energies = states.map(meters[0][1]);
    const defect = Math.max(...states.flatMap((state) => system.w.map((w) => Math.abs(w(state)))));
    return [defect, Math.min(...energies), Math.max(...energies), main.t.at(-1)];
}"""
BLADE = "x'*sin(a) - y'*cos(a)"


@pytest.mark.parametrize("potential", ["(x^2 + y^2)/2", "-x", "x^4 + y^2"])
def test_a_blade_keeps_its_energy_where_it_points_along_an_axis(
    fresh: Visit, potential: str
) -> None:
    """There x'' = -tan(a) x' a' + ..., which the answer has, divides by 0, and multipliers do not."""
    lagrangian = f"(x'^2 + y'^2 + a'^2)/2 - ({potential})"
    ask(fresh, {"lagrangian": lagrangian, "constraints": [BLADE]})
    defect, low, high, end = fresh.page.evaluate(KEPT)
    assert end > 5
    assert defect < 1e-6
    assert high - low < 1e-5 * max(1, abs(high))


# The total energy, the first meter, at the states of the path, how far from the start it leads, and
# what is said of its end.
ENERGY = """() => {
    const { main, system, meters, values } = document.querySelector("[data-motion]").motion;
    const states = main.t.map((_, k) => system.state(main.q.map((one) => one[k]), main.v.map((one) => one[k]), values));
    const energies = states.map(meters[0][1]);
    const far = Math.max(...main.t.map((_, k) => Math.hypot(...main.q.map((one) => one[k]))));
    return [Math.max(...energies) - Math.min(...energies), far, document.querySelector("[data-said]").textContent];
}"""
PAIR = "(x1'^2 + y1'^2 + x2'^2 + y2'^2)/2 + 1/sqrt((x1 - x2)^2 + (y1 - y2)^2)"


@pytest.mark.parametrize(
    ("document", "ends"),
    [
        ({"equations": "x'' = -x/(x^2+y^2)^2; y'' = -y/(x^2+y^2)^2"}, True),
        ({"equations": "x'' = -x/(x^2+y^2)^(5/2); y'' = -y/(x^2+y^2)^(5/2)"}, True),
        ({"equations": "r'' = r*phi'^2 - 1/r^4; phi'' = -2*r'*phi'/r"}, True),
        ({"equations": "x'' = -x/(x^2+y^2)^(3/2); y'' = -y/(x^2+y^2)^(3/2)"}, False),
        ({"lagrangian": PAIR}, False),
    ],
)
def test_a_motion_that_falls_into_a_center_is_not_thrown_out_of_it(
    fresh: Visit, document: dict[str, str], ends: bool
) -> None:
    """Bound motions stay bound: a step near a pole is made of more parts, or it is the last one."""
    ask(fresh, document)
    drift, far, said = fresh.page.evaluate(ENERGY)
    assert drift < 1e-3
    assert far < 3
    assert ("no value from t =" in said) is ends


def test_the_axis_of_another_time_has_its_letter(fresh: Visit) -> None:
    ask(fresh, {"equations": "theta'' + 2/xi theta' + theta = 0"})
    expect(fresh.page.locator(".motion svg text", has_text="ξ")).to_have_count(1)
    expect(fresh.page.locator(".motion svg text", has_text="xi")).to_have_count(0)
