"""Six people and their tasks: one flow each from the first page to the goal, in one browser and one
service.
"""

from __future__ import annotations

import io
import json
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from tests.values import present

from .conftest import Look, Pages, Visit, visited, whole
from .test_every_page import is_too_wide, open_all, violations

DAMPED = "m x'' + d x' + k x = 0"
SLEIGH = {
    "lagrangian": "(x'^2+y'^2)/2 + phi'^2 + phi'*(-x'*sin(phi)+y'*cos(phi))",
    "constraints": ["x'*sin(phi)-y'*cos(phi)"],
    "parameters": "guess",
}
NO = {"equations": "x'' = -y*x'^2; y'' = x'*y'"}
NAMES = [f"x{k}" for k in range(8)]
HARD = json.dumps({"coordinates": NAMES, "equations": {
    c: "+".join(f"{a}*{b}'^2*sin({a}*{b}*{c})" for a in NAMES for b in NAMES) for c in NAMES
}})  # fmt: skip


def ask(visit: Visit, document: dict[str, Any]) -> None:
    """Open the page of an answer."""
    found = visit.page.request.post(
        f"{visit.address}/v1/solve", data=document, headers={"Prefer": "wait=20"}
    )
    place = found.headers.get("location") or found.headers["content-location"]
    visit.go("/results/" + place.rpartition("/")[2])
    whole(visit.page)


def equations(page: Page) -> Locator:
    return page.get_by_label("Equations", exact=True)


def open_answer(page: Page) -> None:
    page.get_by_role("button", name="Open the answer").click()
    expect(page.locator("#verdict")).to_be_visible()
    whole(page)


def bottom(place: Locator) -> float:
    box = present(place.bounding_box())
    return box["y"] + box["height"]


def answer_in_one_screen(visit: Visit, height: int, seen: str = "figure.motion") -> None:
    """L, H, and a moving picture, without a click and without scrolling."""
    page = visit.page
    expect(page.locator("h1")).to_contain_text("that contains the time")
    for letter in ("L", "H"):
        assert bottom(page.locator(".answer .formula:not(.small)", has_text=letter).first) < height
    assert bottom(page.locator(seen)) < height
    before = page.locator("[data-done]").get_attribute("stroke-dasharray")
    expect(page.locator("[data-done]")).not_to_have_attribute("stroke-dasharray", before or "")
    open_all(visit)
    assert violations(visit) == []
    assert not is_too_wide(visit)


def ask_after_a_wrong_line(page: Page) -> None:
    """A wrong sign is marked and the picture goes; then the damped oscillator is answered."""
    box = equations(page)
    box.fill("x'' = -y\ny'' = 3*@ + x")
    expect(page.locator("#understood mark")).to_have_text("@")
    expect(page.locator("#understood .where")).to_have_text("Equations, line 2, column 9")
    expect(page.locator(".typed mark")).to_have_text("@")  # in the box
    assert bottom(page.locator(".typed mark")) < bottom(box)
    expect(page.locator("#live")).to_be_hidden()
    box.fill(DAMPED)
    box.press("Control+Enter")
    expect(page.locator("#verdict")).to_be_visible()
    whole(page)
    assert re.fullmatch(r".*/results/[0-9a-f]{40}", page.url)


def turn_a_dial_and_the_hand(page: Page) -> None:
    """Each of both changes the path."""
    path, hand = page.locator("[data-all]"), page.locator("[data-hand]")
    first = path.get_attribute("d")
    page.locator("[data-dials] label", has_text="damping").locator("input").fill("0")
    second = path.get_attribute("d")
    hand.focus()
    page.keyboard.press("ArrowLeft")
    assert len({first, second, path.get_attribute("d")}) == 3


def test_one_who_asks(visit: Visit) -> None:
    """Types an equation, a wrong one, sees the answer, turns a dial, exports it, and checks an L."""
    page = visit.page
    page.emulate_media(
        reduced_motion="reduce"
    )  # a picture that moves costs time while a test waits
    visit.go("/")
    expect(page.locator("#glance h2")).to_contain_text("Yes")  # before any input
    ask_after_a_wrong_line(page)
    turn_a_dial_and_the_hand(page)
    for part, words in (("code/sympy", "from sympy"), ("certificate.json", "lagrangian")):
        link = page.locator(f"a[href$='{part}']").first.get_attribute("href")
        assert words in page.request.get(visit.address + present(link)).text()
    page.get_by_role("heading", name="More").click()
    page.get_by_label("Check your own L").fill("exp(d*t/m)*(m*x'^2 - k*x^2)/2")
    page.get_by_role("button", name="Does it give these equations?").click()
    expect(page.locator("#own + [role=status]")).to_contain_text("Yes")


@pytest.mark.slow
def test_a_student(visit: Visit) -> None:
    """Types an equation, sees the answer, plays with it, checks an L of their own, and exports
    it.
    """
    page = visit.page
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    visit.go("/")
    expect(page.locator("#glance h2")).to_contain_text("Yes")  # before any input
    stored = page.request.get(visit.address + "/v1/jobs").json()
    box = equations(page)
    box.fill("")
    page.evaluate(
        "window.scolded = 0; new MutationObserver(() => { if (document.querySelector('[data-problem]')) scolded++; })"
        ".observe(document.getElementById('understood'), {childList: true, subtree: true})"
    )
    box.press_sequentially(DAMPED, delay=20)
    began = time.monotonic()
    expect(page.locator("#live.old")).to_have_count(1)
    expect(page.locator("#live:not(.old) #glance h2")).to_contain_text("with the time")
    print(f"answer after {time.monotonic() - began:.2f} s")
    expect(page.locator("#live svg [data-body] *").first).to_be_attached()
    assert page.evaluate("scolded") == 0
    assert page.request.get(visit.address + "/v1/jobs").json() == stored
    ask_after_a_wrong_line(page)
    assert page.evaluate("document.documentElement.scrollHeight") < 1_400
    answer_in_one_screen(visit, 900)

    turn_a_dial_and_the_hand(page)
    page.get_by_role("button", name="Copy L as LaTeX").click()
    assert page.evaluate("navigator.clipboard.readText()").startswith("L = \\frac")
    page.locator("#export").get_by_role("link", name="SymPy", exact=True).click()
    expect(page.locator("#code")).to_contain_text("from sympy")
    with page.expect_download() as download:
        page.get_by_role("link", name="Certificate").click()
    assert "lagrangian" in download.value.path().read_text()
    for text, said in (("m*x'^2/2 - k*x^2/2", "Not yet"), ("exp(d*t/m)*(m*x'^2 - k*x^2)/2", "Yes")):
        if not page.get_by_label("Check your own L").is_visible():
            page.get_by_role("heading", name="More").click()
        page.get_by_label("Check your own L").fill(text)
        page.get_by_role("button", name="Does it give these equations?").click()
        expect(page.locator("#own + [role=status]")).to_contain_text(said)
    visit.go("/")
    expect(box).to_have_value(DAMPED)  # the input is kept


@pytest.mark.slow
def test_a_researcher(pages: Pages, service: str, tmp_path: Path) -> None:
    """Sees one table and one sentence for a sleigh, the proof of a no, a family, many systems,
    the atlas.
    """
    for visit in visited(pages(Look(scheme="dark")), service):
        page = visit.page
        visit.go("/?kind=nonholonomic")
        page.get_by_label("Lagrangian", exact=True).fill(SLEIGH["lagrangian"])
        page.get_by_label("Constraints", exact=True).fill(SLEIGH["constraints"][0])
        open_answer(page)
        expect(page.locator("h1")).to_contain_text("cannot")
        assert "has no Hamiltonian" in page.title()
        ask(visit, SLEIGH | {"associated": "any"})
        for other in ("Not asked", "Not defined"):
            main = page.locator("table.verdicts tr.main")
            expect(main).to_contain_text("No")
            expect(page.locator(".gist > div")).to_have_count(1)
            expect(page.locator("table.verdicts")).to_contain_text(other)
            for word in (
                "ndetermined",
                "no certificate",
                "any_associated",
                "not_variational",
                "to try next",
            ):
                assert word not in page.locator("main").inner_text()
            ask(visit, SLEIGH)
        assert "L,H\nFirst,No,,\n" in page.request.get(page.url + "/table.csv").text()
        main.get_by_role("button").click()
        expect(page.locator("table.verdicts tr.main + tr .proof li").first).to_be_visible()
        assert violations(visit) == []
        assert not is_too_wide(visit)

        ask(visit, NO)
        expect(page.locator(".gist > div")).to_have_count(2)

        visit.go("/")
        equations(page).fill("x'' = -a*x + b*y\ny'' = -c*y + d*x")
        page.get_by_role("button", name="Ask in detail").click()
        page.get_by_label("Family").check()
        open_answer(page)
        expect(page.locator("section.family table.members tbody tr").first).to_be_visible()

        file = tmp_path / "systems.ndjson"
        file.write_text(
            '{"id": "n", "equations": "x\'\' = -x"}\n{"id": "m", "equations": "x\'\' = -y; y\'\' = x*x\'"}\nx='
        )
        visit.go("/batch")
        page.get_by_label("A file").set_input_files(file)
        page.get_by_role("button", name="Solve all").click()
        expect(page.get_by_role("status")).to_contain_text("3 of 3 done, 1 failed")
        for row, word in enumerate(("has a Lagrangian", "no Lagrangian", "failed")):
            expect(page.locator("tbody tr").nth(row)).to_contain_text(word)
        table = page.request.get(page.url + "/results.csv").text().splitlines()
        assert table[0] == "line,name,verdict,lagrangian or reason,checked,where"
        assert [row.split(",")[2] for row in table[1:]] == [
            "variational",
            "not_variational",
            "failed",
        ]

        visit.go("/atlas")
        page.get_by_label("Equations").fill("b'' = -2*R'*b'/R; R'' = R*b'^2 - 7/R^2")
        page.get_by_role("button", name="Search").click()
        page.get_by_role("link", name="Kepler problem in polar coordinates").first.click()
        expect(page.locator(".answer .formula").first).to_be_visible()
        page.get_by_role("link", name="Open in Solve").click()
        expect(equations(page)).to_have_value(re.compile("r''"))


@pytest.mark.slow
@pytest.mark.parametrize("scripts", [True, False])
def test_a_teacher_and_a_class(visit: Visit, plain: Visit, scripts: bool) -> None:
    """Creates an exercise from an answer, solves it wrong and right, and verifies its code."""
    at = visit if scripts else plain
    page = at.page
    ask(at, {"equations": "x'' = -x - c*x'", "parameters": "guess"})
    page.get_by_role("link", name="Make an exercise").click()
    page.get_by_label("Title").fill("A Lagrangian with friction")
    page.get_by_role("button", name="Make the link").click()
    link = page.locator("#link").inner_text()
    at.go("/exercise" + link.partition("/exercise")[2])
    expect(page.locator("h1")).to_have_text("A Lagrangian with friction")
    assert "textarea" not in page.locator("main").inner_html()
    assert not re.search(r"Yes|exists|There is|none", page.locator(".hints").inner_text())
    own = page.get_by_label("Your L", exact=True)
    for text, said in (
        ("x'^2/2 - x^2/2", "Not yet"),
        ("x'^2 + @", "not be understood"),
        ("exp(c*t)*(x'^2 - x^2)/2", "Yes"),
    ):
        own.fill(text)
        page.get_by_role("button", name="Check").click()
        expect(page.locator("#feedback")).to_contain_text(said)
    page.get_by_label("Your name, for a code").fill("Ada")
    page.get_by_role("button", name="Get a code").click()
    code, solved = page.locator("#feedback code").inner_text(), page.url
    assert not scripts or violations(at) == []
    for student, verdict in (("Ada", "genuine"), ("Bob", "does not belong")):
        at.go("/teach")
        page.get_by_label("Link of the exercise").fill(solved)
        page.get_by_label("Name of the student").fill(student)
        page.get_by_label("Code", exact=True).fill(code)
        page.get_by_role("button", name="Verify").click()
        expect(page.locator("main [role=status]")).to_contain_text(verdict)
    at.go("/exercise?equations=x''+%3D+-y%0Ay''+%3D+x*x'")
    if scripts:
        page.get_by_text("Hint 2").click(force=True)
        assert not page.locator("[data-hint]").nth(1).evaluate("node => node.open")
    page.get_by_label("There is none").check()
    page.get_by_role("button", name="Check").click()
    expect(page.locator("#feedback")).to_contain_text("Right")


# The number of pixels of a canvas with this color, within blended edges.
PIXELS = """(node, [red, green, blue]) => {
    const pen = new OffscreenCanvas(node.width, node.height).getContext("2d", { willReadFrequently: true });
    pen.drawImage(node, 0, 0);
    const { data } = pen.getImageData(0, 0, node.width, node.height);
    let found = 0;
    for (let k = 0; k < data.length; k += 4)
        found += Math.abs(data[k] - red) + Math.abs(data[k + 1] - green) + Math.abs(data[k + 2] - blue) < 90;
    return found;
}"""
BLUE, ORANGE = [0, 114, 178], [213, 94, 0]


@pytest.mark.slow
def test_one_who_simulates(visit: Visit) -> None:
    """Opens a scene by its address, compares methods, reads values at the cursor, zooms, and
    changes the scene.
    """
    page = visit.page
    visit.go("/simulate")
    expect(page.locator("[data-play-motion] [data-all]")).to_have_attribute("d", re.compile("M"))
    page.get_by_label("Steps").fill("200")
    expect(page).to_have_url(re.compile("steps=200"))
    page.reload()
    expect(page.get_by_label("Steps")).to_have_value("200")
    page.get_by_role("button", name="Run").click()
    expect(page.locator("[data-drawn]")).to_be_visible(timeout=40_000)
    assert page.locator("tbody tr").filter(has_text="completed").count() == 3
    shown = page.locator("[data-plot=coordinates]")
    # Curves that coincide are both visible.
    for ink in (BLUE, ORANGE):
        assert shown.locator("canvas").evaluate(PIXELS, ink) > 100
    over = shown.locator(".u-over")
    over.scroll_into_view_if_needed()
    box = present(over.bounding_box())
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    expect(shown.locator("output")).to_contain_text(re.compile(r"t = (4\.9|5)"))  # of 10
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] - 8, box["y"] + box["height"] - 8, steps=4)
    page.mouse.up()
    page.mouse.move(box["x"] + 1, box["y"] + box["height"] / 2)
    expect(shown.locator("output")).to_contain_text(
        re.compile(r"t = (4\.9|5)")
    )  # the left end after the zoom
    shown.get_by_text("As a table").click()
    expect(shown.get_by_role("row")).to_have_count(22)
    expect(shown.get_by_role("row").last).to_contain_text("10.00")  # 200 steps of 0.05
    assert violations(visit) == []
    page.get_by_role("link", name="Change the scene").click()
    expect(page.get_by_label("Steps")).to_have_value("200")


@pytest.mark.slow
def test_one_with_a_phone(pages: Pages, service: str) -> None:
    """The verdict is a strip and a link at the bottom edge; errors are visible; the answer and its
    picture fit the screen. The sliders below it may not, where the answer comes in parts.
    """
    for visit in visited(pages(Look(narrow=True, scheme="dark")), service):
        page = visit.page
        visit.go("/")
        expect(page.locator("#live")).to_contain_text("Yes")
        assert bottom(page.locator("#live")) == pytest.approx(844, abs=2)
        equations(page).fill("x'' = -x\ny'' = -sinn(x)")
        page.get_by_role("button", name="Open the answer").click()
        page.wait_for_load_state()
        expect(page.locator("#understood mark")).to_be_in_viewport()
        assert bottom(page.locator(".problem")) < 844
        visit.go("/?equations=m+x''+%2B+d+x'+%2B+k+x+%3D+0")
        page.locator("#live h2").click()
        expect(page.locator("#verdict")).to_be_visible()
        whole(page)
        answer_in_one_screen(visit, 844, "figure.motion svg")


@pytest.mark.slow
def test_one_without_scripts(plain: Visit) -> None:
    """Sees a marked error, solves a motion on constraints with open proofs, runs a scene with
    pictures and files.
    """
    page = plain.page
    plain.go("/")
    equations(page).fill("x'' = -y\ny'' = 3*@ + x")
    page.get_by_role("button", name="Open the answer").click()
    expect(page.locator("#understood mark")).to_have_text("@")
    page.get_by_role("link", name="Constraints", exact=True).click()
    page.get_by_label("Lagrangian", exact=True).fill("(x'^2 + y'^2 + z'^2)/2")
    page.get_by_label("Constraints", exact=True).fill("z' + x*y'")
    page.get_by_role("button", name="Show what is understood").click()
    expect(page.locator("#understood")).to_contain_text("Constraints")
    open_answer(page)
    expect(page.locator("h1")).to_contain_text("this motion can be given")
    expect(page.locator("table.verdicts tr.main")).to_contain_text("Yes")
    assert page.locator("table.verdicts .why:visible").count() >= 4
    page.get_by_role("link", name="Simulate", exact=True).last.click()
    page.get_by_label("Steps").fill("100")
    page.get_by_role("button", name="Run").click()
    # Without scripts an unfinished page reloads every two seconds.
    expect(page.locator("[data-plot=energy] img")).to_be_visible(timeout=40_000)
    request, folder = page.context.request, page.url
    assert b"<svg" in request.get(f"{folder}/figures/energy.svg").body()
    assert request.get(f"{folder}/figures/energy.png").body().startswith(b"\x89PNG")
    csv = page.get_by_role("link", name="as CSV").first.get_attribute("href")
    npz = page.get_by_role("link", name="as NPZ").first.get_attribute("href")
    assert len(request.get(plain.address + str(csv)).text().splitlines()) == 102
    with np.load(io.BytesIO(request.get(plain.address + str(npz)).body())) as data:
        assert data["x"].shape == (101,)
    assert request.get(f"{folder}/figures/nothing.svg").status == 404


@pytest.mark.slow
def test_one_who_waits(visit: Visit) -> None:
    """The page of a pending job becomes its result; a new request with more time can be
    canceled.
    """
    page = visit.page
    visit.go("/")
    equations(page).fill(json.dumps({**json.loads(HARD), "options": {"time_limit": 3}}))
    page.get_by_role("button", name="Open the answer").click()
    expect(page.get_by_role("progressbar")).to_be_visible()
    expect(page.locator("h1 .open")).to_be_visible()
    whole(page)
    expect(page.locator("main")).to_contain_text("limit")
    page.get_by_role("button", name=re.compile(r"Ask again with \d+ s")).click()
    expect(page.get_by_role("progressbar")).to_be_visible()
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("This was cancelled")
