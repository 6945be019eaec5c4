"""Pictures and pages as they look: no label on a label, nothing moves by itself, nothing jumps."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlencode

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, ViewportSize, expect

from inverse_service import catalogue

from .conftest import Motion, Visit, by_default_still, visited, whole
from .test_people import ask

# The texts of a picture that touch another one, or leave the picture; their boxes are without the
# halo, which Firefox counts in what it says of their place on the page.
TOUCHING = """() => {
    const placeOf = (text) => {
        const [box, { a, d, e, f }] = [text.getBBox(), text.getScreenCTM()];
        const [left, top] = [e + a * box.x, f + d * box.y];
        return { left, top, right: left + a * box.width, bottom: top + d * box.height };
    };
    const seen = [...document.querySelectorAll(".motion svg")].filter((svg) => svg.checkVisibility());
    const hits = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
    return seen.flatMap((svg) => {
        const frame = svg.getBoundingClientRect();
        const isOut = (a) => a.left < frame.left - 1 || a.right > frame.right + 1
            || a.top < frame.top - 2 || a.bottom > frame.bottom + 2;
        const texts = [...svg.querySelectorAll("text")].map((one) => [one.textContent, placeOf(one)]);
        return texts.flatMap(([words, a], k) => [
            ...(isOut(a) ? [words] : []),
            ...texts.slice(0, k).filter(([, b]) => hits(a, b)).map(([other]) => `${words} on ${other}`),
        ]);
    });
}"""
# The texts that lie on the path of the motion, by the part of their box in which letters are.
ON_A_CURVE = """() => [...document.querySelectorAll(".motion svg")].filter((svg) => svg.checkVisibility()).flatMap((svg) => {
    const curve = svg.querySelector("[data-all]");
    const scale = curve.getScreenCTM();
    const long = curve.getTotalLength();
    const on = Array.from({ length: Math.ceil(long / 2) }, (_, k) => curve.getPointAtLength(2 * k).matrixTransform(scale));
    return [...svg.querySelectorAll("text")].flatMap((text) => {
        const [box, foot] = [text.getBoundingClientRect(), Number(text.getAttribute("y")) + scale.f];
        const isOn = on.some(({ x, y }) => x > box.left && x < box.right && y > foot - 10 && y < foot + 2);
        return isOn ? [text.textContent] : [];
    });
})"""
SMALL = """() => [...document.querySelectorAll(".motion svg text")]
    .map((one) => parseFloat(getComputedStyle(one).fontSize)).filter((size) => size < 11)"""
# The formulas of conserved quantities that are wider than their room.
CUT = """() => [...document.querySelectorAll(".meters .formula")]
    .filter((one) => one.scrollWidth > one.clientWidth + 1).map((one) => one.textContent)"""
# A picture is drawn for its present size: it hears of a new one with the next frame, after the page
# has it.
REDRAWN = """() => [...document.querySelectorAll(".motion svg")].filter((svg) => svg.checkVisibility()).every((svg) =>
    svg.getAttribute("viewBox") === `0 0 ${svg.clientWidth} ${svg.clientHeight}`)"""
SHIFT = """() => new Promise((found) => {
    let sum = 0;
    const add = (list) => list.getEntries().forEach((one) => { if (!one.hadRecentInput) sum += one.value; });
    new PerformanceObserver(add).observe({ type: "layout-shift", buffered: true });
    setTimeout(() => found(sum), 300);
})"""
WIDTHS = (320, 768, 1280)
ALL_WIDTHS = (320, 390, 768, 1280, 1440)
SLOWED = 4  # times
GEODESIC = "theta'' = sin(theta)*cos(theta)*phi'^2; phi'' = -2*cos(theta)*theta'*phi'/sin(theta)"
SYSTEMS: dict[str, dict[str, Any]] = {
    "well": {"equations": "x'' = x - x^3"},
}
MORE: dict[str, dict[str, Any]] = {
    "none": {"equations": "x'' = -x - x'^2*y; y'' = -y + x'*y'"},
    "fall": {"equations": "y'' = -9.81"},
    "spring": {"equations": "x'' = -x - c*x'", "parameters": "guess"},
    "drag": {"equations": "x'' = -x'^2"},
    "cases": {"equations": "x'' = -abs(x)"},
    "pendulum": {"equations": "theta'' = -sin(theta)"},
    "forced": {"equations": "x'' = -x + cos(t)"},
    "self-excited": {"equations": "x'' = -x + (1-x^2)*x'"},
    "equal springs": {"equations": "x'' = -2*x + y; y'' = x - 2*y"},
    "coupled": {"equations": "x'' = -a*x + b*y; y'' = b*x - d*y", "parameters": "guess"},
    "well of two": {"equations": "x'' = -x - 2*x*y; y'' = -y - x^2 + y^2"},
    "charge": {"equations": "x'' = (1+x/2)*y'; y'' = -(1+x/2)*x'"},
    "polar": {"equations": "r'' = r*phi'^2 - 1/r^2; phi'' = -2*r'*phi'/r"},
    "chain": {"equations": "x1''=x2-2*x1; x2''=x1-2*x2+x3; x3''=x2-2*x3+x4; x4''=x3-2*x4"},
    "three angles": {
        "equations": "theta1''=theta2-theta1; theta2''=theta1-2*theta2+theta3; theta3''=theta2-theta3"
    },
    "space": {"equations": "x'' = y'; y'' = -x'; z'' = -1"},
    "blade": {"lagrangian": "(x'^2+y'^2+p'^2)/2", "constraints": ["x'*sin(p)-y'*cos(p)"]},
    "particle": {"lagrangian": "(x'^2+y'^2+z'^2)/2", "constraints": ["z' - y*x'"]},
    "no value at t = 0": {"equations": "x'' = -x - x'/t"},
    "tilting disk": catalogue.atlas()["tilting-disk"]["document"],
    "ball": {
        "lagrangian": "m/2*(x'^2+y'^2) + I/2*(theta'^2 + phi'^2 + 2*phi'*psi'*cos(theta) + psi'^2)",
        "constraints": [
            "x' - r*sin(phi)*theta' + r*cos(phi)*sin(theta)*psi'",
            "y' + r*cos(phi)*theta' + r*sin(phi)*sin(theta)*psi'",
        ],
        "coordinates": ["phi", "theta", "psi", "x", "y"],
        "parameters": ["m", "I", "r"],
    },
    "a condition out of sight": {"equations": "x'' = -y; y'' = x - x'"},
    "limit cycle": {"equations": "x'' = -x + (1 - x^2 - x'^2)*x'"},
    "gyroscopic": {"equations": "x'' = -x + 2*y'; y'' = -y - 2*x'"},
    "leaves one side": {"equations": "x'' = -max(x, 0)"},
    "orbit with drag": {
        "equations": "r'' = r*phi'^2 - 1/r^2 - r'/50; phi'' = -2*r'*phi'/r - phi'/50"
    },
    "Kepler in space": {
        "equations": "x'' = -x/(x^2+y^2+z^2)^(3/2); y'' = -y/(x^2+y^2+z^2)^(3/2); z'' = -z/(x^2+y^2+z^2)^(3/2)"
    },
    "open well": {"equations": "x'' = x - x^3 - y; y'' = -y - x"},
    "large": {"equations": "x'' = -1000000*x"},
    "small": {"equations": "x'' = -x/1000000"},
    "between two atoms": {"equations": "r'' = 12/r^13 - 6/r^7"},
    "hoop": {"equations": "theta'' = sin(theta)*(w^2*cos(theta) - g)", "parameters": "guess"},
    "parametric": {"equations": "x'' = -(1 + cos(2*t)/5)*x"},
    "a force with two values": {"equations": "x'' = -sign(x)"},
    "far from zero": {"equations": "x'' = -5*abs(x - 2)"},
    "three cases": {"equations": "x'' = -x - abs(x - 1) - abs(x + 2)"},
    "four cases": {"equations": "x'' = -abs(x) - abs(x - 1) - abs(x + 1)"},
    "dry friction": {"equations": "x'' = -x - sign(x')/5"},
    "two halves of a plane": {"equations": "x'' = -x - abs(y); y'' = -y"},
    "thrown": {"equations": "x'' = 0; y'' = -9.81"},
    "across two fields": {"equations": "x'' = y'; y'' = -x' + 1/2"},
    "great circle": {"equations": GEODESIC},
    "spherical pendulum": {
        "lagrangian": "(theta'^2 + sin(theta)^2*phi'^2)/2 + cos(theta)",
    },
    "top": {
        "lagrangian": "A/2*(theta'^2 + phi'^2*sin(theta)^2) + C/2*(psi' + phi'*cos(theta))^2 - m*cos(theta)",
        "parameters": ["A", "C", "m"],
    },
    "on a spring": {"lagrangian": "(r'^2 + r^2*theta'^2)/2 + 2*r*cos(theta) - 4*(r - 1)^2"},
    "spherical coordinates": {
        "lagrangian": "(r'^2 + r^2*theta'^2 + r^2*sin(theta)^2*phi'^2)/2 + 1/r"
    },
    "cylindrical coordinates": {"lagrangian": "(r'^2 + r^2*phi'^2 + z'^2)/2 - r^2/2 - z^2"},
    "two rods": {
        "lagrangian": "a'^2 + b'^2/2 + a'*b'*cos(a - b) + 2*cos(a) + cos(b)",
    },
    "three rods": {
        "lagrangian": "3*a'^2/2 + b'^2 + c'^2/2 + 2*a'*b'*cos(a-b) + a'*c'*cos(a-c) + b'*c'*cos(b-c)"
        " + 3*cos(a) + 2*cos(b) + cos(c)",
    },
    "two bodies": {
        "lagrangian": "m*(x1'^2+y1'^2)/2 + M*(x2'^2+y2'^2)/2 + k/sqrt((x1-x2)^2+(y1-y2)^2)",
        "parameters": ["m", "M", "k"],
    },
    "slide": {"lagrangian": "x'^2 + x'*theta'*cos(theta) + theta'^2/2 + cos(theta)"},
    "robot": catalogue.document("mobile-robot"),
    "twelve": {
        "equations": "; ".join(f"x{k}'' = x{k - 1} - 2*x{k} + x{k + 1}" for k in range(2, 12))
        + "; x1'' = x2 - 2*x1; x12'' = x11 - 2*x12"
    },
}
PATHLESS = {"chain", "three angles", "twelve"}


def look_at(visit: Visit, document: dict[str, Any]) -> None:
    page = visit.page
    ask(visit, document)
    expect(page.locator(".motion svg.blank")).to_have_count(0)
    page.evaluate(
        "() => document.querySelector('#why')?.setAttribute('open', '')"
    )  # its picture, too
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        page.wait_for_function(REDRAWN)
        assert page.locator(".motion svg text").count() >= 1, width
        assert page.evaluate(TOUCHING) == [], width
        assert page.evaluate(ON_A_CURVE) == [], width
        assert page.evaluate(CUT) == [], width
        assert page.evaluate(SMALL) == [], width


@pytest.mark.parametrize("name", SYSTEMS)
def test_no_label_touches_another(fresh: Visit, name: str) -> None:
    look_at(fresh, SYSTEMS[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", MORE)
def test_the_same_for_the_other_kinds(fresh: Visit, name: str) -> None:
    look_at(fresh, MORE[name])


@pytest.mark.slow
def test_a_geodesic_of_the_sphere_is_drawn_as_a_great_circle(fresh: Visit) -> None:
    """Seen from far away it is an ellipse about the center: a u^2 + b u w + c w^2 = 1."""
    ask(fresh, MORE["great circle"])
    read = "document.querySelector('[data-motion]').motion.scene.points"
    fresh.page.wait_for_function(f"() => {read}?.length > 100")
    u, w = np.array(fresh.page.evaluate(read)).T
    rows = np.column_stack([u * u, u * w, w * w])
    form, *_ = np.linalg.lstsq(rows, np.ones_like(u))
    assert np.abs(rows @ form - 1).max() < 1e-4
    assert np.hypot(u, w).max() <= 1 + 1e-9
    assert 4 * form[0] * form[2] - form[1] ** 2 > 0


@pytest.fixture
def calm(browser: Browser, service: str) -> Iterator[Visit]:
    """A page of a person who has asked for less motion."""
    size: ViewportSize = {"width": 1280, "height": 900}
    page = browser.new_context(viewport=size, reduced_motion="reduce").new_page()
    page.set_default_timeout(20_000)
    yield from visited(page, service)
    page.context.close()


def drawn(page: Page) -> list[str | None]:
    return [
        page.locator("[data-done]").get_attribute("stroke-dasharray"),
        page.locator("[data-now]").text_content(),
    ]


def test_a_picture_is_still_for_those_who_ask_for_less_motion_and_its_energy_stays(
    calm: Visit,
) -> None:
    page = calm.page
    ask(calm, SYSTEMS["well"])
    before = drawn(page)
    energy = page.locator("[data-meter]").first.inner_text()
    page.wait_for_timeout(300)
    assert drawn(page) == before
    page.get_by_role("button", name="Play").click()
    expect(page.locator("[data-now]")).to_have_text(re.compile("t = [1-9]"))
    assert page.locator("[data-meter]").first.inner_text() == energy


@by_default_still
def test_the_button_stays_where_it_is_and_nothing_shifts(fresh: Visit, motion: Motion) -> None:
    """The answer and how a text is read take room that is kept for them."""
    page = fresh.page
    page.emulate_media(reduced_motion=motion)
    fresh.go("/")
    expect(page.locator("#glance h2")).to_contain_text("Yes")
    box, button = (
        page.get_by_label("Equations", exact=True),
        page.get_by_role("button", name="Open the answer"),
    )
    begin = button.bounding_box()
    for text, words in (
        ("x'' = -x'^2", "Yes"),
        ("x'' = -abs(x)", "for every"),
        ("x1''=x2-2*x1; x2''=x1-2*x2+x3; x3''=x2-2*x3", "Yes"),
        ("x'' = -y\ny'' = 3*@ + x", ""),
    ):
        box.fill(text)
        if words:
            expect(page.locator("#live:not(.old) #glance h2").first).to_contain_text(words)
        else:
            expect(page.locator("#understood mark")).to_have_text("@")
        assert button.bounding_box() == begin, text
    assert page.evaluate(SHIFT) == 0


PAGES = (
    "/", "/?kind=nonholonomic", "/ask", "/simulate", "/simulate?system=chain:springs:12", "/nearest", "/atlas",
    "/atlas/kepler-polar", "/atlas/chaplygin-sleigh", "/batch", "/learn", "/docs", "/teach", "/exercise/new",
    "/class/new", "/class/marks", "/class?set=x''=-[2..9]x&student=Ada", "/exercise?equations=x''=-x", "/about",
)  # fmt: skip
ANSWERS = ("well", "none", "cases", "coupled", "polar", "blade", "top", "chain")
FITTED = {"equations": "x'' = -1.02*x + 0.4*y; y'' = 0.5*x - y", "nearest": {"errors": "0.02"}}
FAMILY = {"equations": "x'' = -a*x + b*y; y'' = c*x - d*y", "family": True}


@pytest.mark.slow
@pytest.mark.parametrize("width", ALL_WIDTHS)
def test_no_page_shifts_while_it_is_loaded(fresh: Visit, browser: Browser, width: int) -> None:
    """What comes after the page, such as answers, pictures, and prices, has room that is kept for
    it; each page is the first one of its browser, which has nothing in its cache, and whose
    processor is slow, so that the page is read in parts.
    """
    places = [*PAGES]
    documents = [((SYSTEMS | MORE)[name], "") for name in ANSWERS]
    for document, more in (*documents, (FITTED, "/nearest"), (FAMILY, "/family")):
        ask(fresh, document)
        places.append(fresh.page.url.removeprefix(fresh.address) + more)
    shifts = {}
    for place in places:
        page = browser.new_page(viewport={"width": width, "height": 900})
        slow = page.context.new_cdp_session(page)
        slow.send("Emulation.setCPUThrottlingRate", {"rate": SLOWED})
        page.goto(fresh.address + place)
        page.wait_for_timeout(2_500)
        shifts[place] = page.evaluate(SHIFT)
        page.close()
    assert {place: shift for place, shift in shifts.items() if shift} == {}


# Twenty questions whose answers come in parts; {n} makes each one new to the service.
GROWING = (
    "x'' = -{n}*a*x^3 - b*x'^3",
    "x'' = -{n}*a*x' - b*x'^3",
    "x'' = -{n}*x - c*x'",
    "x'' = -a*x + {n}*b*x^3 - c*x'",
    "theta'' = -{n}*g*sin(theta)/l - k*theta'",
    "x'' = x - {n}*x^3 - a*x'^2",
    "x'' = -{n}*y*x'^2\ny'' = x'*y'",
    "x'' = -{n}*a*x + b*y\ny'' = c*x - d*y",
    "x'' = -{n}*abs(x)",
    "x'' = -{n}*x - abs(x') - abs(x - 1)",
    "x'' = -{n}*k*x + cos(w*t)",
    "x'' = -{n}*x'^3 - x",
    "r'' = r*phi'^2 - {n}*k/r^2 - c*r'\nphi'' = -2*r'*phi'/r - c*phi'",
    "x1'' = x2 - {n}*x1\nx2'' = x1 - 2*x2 + x3\nx3'' = x2 - 2*x3",
    "x'' = {n}*F(x)*x'^2",
    "x'' = F(x, y)\ny'' = -{n}*y",
    "x'' = y'\ny'' = -x' + {n}*a*x",
    "x'' = -{n}*abs(x - 2)",
    "x'' = (1 - {n}*x^2)*x'*mu - x",
    "x'' = -{n}*a*x*x' - b*x^3",
)


# Whether the answer next to the form is there, or takes longer.
BESIDE = """() => document.querySelector("#glance [data-settled]:not([data-cut])")
    || document.querySelector("#glance > .hint")?.textContent.includes("takes a moment")"""


FADES = "() => getComputedStyle(document.querySelector('#glance')).maskImage"
# How far the lower edge of what is shown last lies below the part that does not fade.
HIDDEN = """() => {
    const place = document.querySelector("#glance"), shown = [...place.querySelectorAll("[data-settled] > :not(script)")];
    place.scrollTop = place.scrollHeight;
    const rem = parseFloat(getComputedStyle(document.documentElement).fontSize);
    return shown.at(-1).getBoundingClientRect().bottom - (place.getBoundingClientRect().bottom - 2 * rem);
}"""


@pytest.mark.parametrize("width", [1280, 320])
def test_what_does_not_fit_beside_the_form_fades_and_scrolls_into_view(
    fresh: Visit, width: int
) -> None:
    page = fresh.page
    page.set_viewport_size({"width": width, "height": 844})
    fresh.go("/?" + urlencode({"equations": "x'' = -abs(x)"}))
    page.wait_for_function(BESIDE)
    assert "gradient" in page.evaluate(FADES)
    assert page.evaluate(HIDDEN) <= 1


def test_what_fits_beside_the_form_does_not_fade(visit: Visit) -> None:
    visit.go("/?" + urlencode({"equations": "x'' = -x"}))
    visit.page.wait_for_function(BESIDE)
    assert visit.page.evaluate(FADES) == "none"


@pytest.mark.slow
@pytest.mark.parametrize("width", ALL_WIDTHS)
def test_an_answer_that_comes_in_parts_shifts_nothing(
    browser: Browser, service: str, width: int
) -> None:
    """From a link to the answer next to the form, and from the button to the whole answer: what
    comes late has room, or nothing below it.
    """
    shifts = {}
    for place, text in enumerate(GROWING):
        page = browser.new_page(viewport={"width": width, "height": 844})
        page.goto(
            f"{service}/?{urlencode({'equations': text.format(n=width + place), 'parameters': 'guess'})}"
        )
        page.wait_for_function(BESIDE, timeout=60_000)
        if shift := page.evaluate(SHIFT):
            shifts["beside", text] = shift
        # Sent by a script, as what follows a click within half a second is not counted.
        page.evaluate("document.querySelector('form[data-echo]').requestSubmit()")
        page.wait_for_url("**/results/**", timeout=60_000)
        whole(page)
        page.wait_for_timeout(300)
        shifts["page", text] = page.evaluate(SHIFT)
        page.close()
    assert {place: shift for place, shift in shifts.items() if shift} == {}
