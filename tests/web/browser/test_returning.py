"""An answer never appears next to another question than its own: after a draft, a reload, Back, and
Forward.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import pytest
from playwright.sync_api import expect

from inverse_service.web.pages.solve import START

from .conftest import Motion, Visit
from .test_people import ask

# At each frame: the text of a box, and what the part that answers it says, unless that has faded.
WATCH = """(([box, answer]) => {
    const look = () => {
        const typed = document.querySelector(box);
        const said = [...document.querySelectorAll(answer)]
            .filter((one) => one.getClientRects().length && Number(getComputedStyle(one).opacity) > 0.5);
        const pair = typed && JSON.stringify([typed.value.trim(), said.map((one) => one.innerText).join(" ")]);
        if (pair && pair !== window.seen.at(-1)) window.seen.push(pair);
        requestAnimationFrame(look);
    };
    window.seen = [];
    document.addEventListener("DOMContentLoaded", look);
})"""

ANSWERED = "([text, words]) => seen.map(JSON.parse).some(([typed, said]) => typed === text && said.includes(words))"


@dataclass(frozen=True)
class Beside:
    """A box, the part of its page that answers it, and for each text the words that its answer
    alone has.
    """

    box: str
    answer: str
    said: dict[str, str]
    sends: str = ""  # the button; without one the page answers by itself


EQUATIONS = {
    START: "with the time in L",
    "x'' = -x - x'^2*y\ny'' = -y + x'*y'": "No regular Lagrangian",
    "x'' = 0": "there is a Lagrangian",
}
PAGES = {
    "/": Beside("#equations", "#live", EQUATIONS),
    "/?kind=nonholonomic": Beside(
        "#constraints", "#live", {f"z' - {one}*x*y'": str(one**2) for one in (5, 7)}
    ),
    "/?kind=lagrangian": Beside(
        "#lagrangian", "#live", {f"x'^2/2 - {one}*x^2/2": str(one) for one in (25, 49)}
    ),
    "own": Beside(
        "#own-lagrangian",
        "#own + [role=status]",
        {"x'^2/2 - x^2/2": "Yes", "x'^2/2": "Not yet"},
        "Does it",
    ),
    "/exercise?equations=x''+%3D+-x": Beside(
        "#formula", "#feedback", {"x'^2/2 - x^2/2": "Yes", "x'^2/2": "Not yet"}, "Check"
    ),
    "/nearest": Beside("#equations", "#understood", {"x'' = -1.5*x": "1.5", "x'' = -2.5*x": "2.5"}),
    "/class/new": Beside(
        "#set",
        "main section",
        {"# Alpha\nx'' = -x": "Alpha", "# Beta\nx'' = -x": "Beta"},
        "Make the link",
    ),
    "/exercise/new": Beside(
        "#equations",
        "main section",
        {"alpha'' = -alpha": "alpha", "beta'' = -beta": "beta"},
        "Make the link",
    ),
    "/ask": Beside("#equations", "#understood", {"x'' = -1.5*x": "1.5", "x'' = -2.5*x": "2.5"}),
    "/class/marks?set=x''+%3D+-x": Beside(
        "#codes", "main > [data-answers]", {"Alpha": "Alpha", "Beta": "Beta"}, "Count"
    ),
    "/atlas": Beside(
        "#q", "[aria-label=Systems]", {"kepler": "Kepler problem", "sleigh": "Chaplygin"}, "Search"
    ),
}


@pytest.mark.parametrize(
    ("path", "motion"),
    [
        ("/", "reduce"),
        *(pytest.param(path, "no-preference", marks=pytest.mark.slow) for path in PAGES),
    ],
)
def test_an_answer_is_never_next_to_another_question(
    fresh: Visit, path: str, motion: Motion
) -> None:
    page, beside = fresh.page, PAGES[path]
    page.emulate_media(reduced_motion=motion)
    page.add_init_script(f"{WATCH}({json.dumps([beside.box, beside.answer])})")
    box = page.locator(beside.box)
    answered: set[str] = set()

    def agree() -> None:
        """No frame showed the answer of another text."""
        for typed, answer in map(json.loads, page.evaluate("window.seen")):
            wrong = [
                text for text, words in beside.said.items() if text != typed and words in answer
            ]
            right = beside.said.get(typed)
            assert not (wrong and (right is None or right not in answer)), (typed, answer)
            answered.update([typed] if right and right in answer else [])

    def answer(text: str) -> None:
        """The text, typed or restored, and its answer."""
        expect(box).to_have_value(text)
        if beside.sends and box.evaluate("one => one.value !== one.defaultValue"):
            page.get_by_role("button", name=beside.sends).click()
            page.wait_for_load_state()
        page.wait_for_function(ANSWERED, arg=[text, beside.said[text]])
        agree()

    if path == "own":
        ask(fresh, {"equations": "x'' = -x"})
        page.get_by_role("heading", name="More").click()
    else:
        fresh.go(path)
    for text in beside.said:
        box.fill(text)
        answer(text)
    first, last = next(iter(beside.said)), list(beside.said)[-1]
    page.reload()
    answer(last)
    box.fill(first)
    fresh.go("/learn")  # before it is answered
    page.go_back()
    page.wait_for_load_state()
    agree()
    page.go_forward()
    page.go_back()
    page.wait_for_load_state()
    page.wait_for_timeout(300)
    agree()
    assert answered == set(beside.said)


FAMILY = {"equations": "x'' = -a*x' + b*y; y'' = c*x - d*y'", "family": True}


@pytest.mark.slow
def test_the_member_of_a_family_is_that_of_its_boxes(fresh: Visit) -> None:
    """After a change, a reload, Back and Forward."""
    page = fresh.page
    ask(fresh, FAMILY)
    page.goto(page.url + "/family?at.a=2&at.b=0.5&at.c=0.5&at.d=2")
    box, member = page.locator("[name='at.b']"), page.locator("[data-member] p").first
    agree = """() => {
        const said = document.querySelector("[data-member] p").innerText;
        const value = (name) => Number(document.querySelector(`[name='at.${name}']`).value);
        return ["a", "b", "c", "d"].every((name) => said.includes(`${name} = ${value(name)}`));
    }"""
    page.wait_for_function(agree)
    box.fill("0.25")
    page.wait_for_function(agree)
    expect(member).to_contain_text("b = 0.25")
    page.reload()
    page.wait_for_function(agree)
    fresh.go("/learn")
    page.go_back()
    page.wait_for_function(agree)
    page.go_forward()
    page.go_back()
    page.wait_for_function(agree)


@pytest.mark.slow
def test_the_form_of_a_scene_and_its_picture_come_back(fresh: Visit) -> None:
    """The start that is typed is that of the picture, after a reload, Back and Forward."""
    page = fresh.page
    fresh.go("/simulate?system=chain:springs:2")
    shown = "() => document.querySelector('[data-hand]')?.getAttribute('aria-valuetext')"
    page.wait_for_function(shown)
    page.get_by_label("x1", exact=True).fill("0.625")

    def agree() -> None:
        page.wait_for_function(f"{shown}?.includes('0.625')")
        assert page.get_by_label("x1", exact=True).input_value() == "0.625"

    agree()
    page.reload()
    agree()
    fresh.go("/learn")
    page.go_back()
    agree()
    page.go_forward()
    page.go_back()
    agree()


@pytest.mark.slow
@pytest.mark.parametrize("way", ["Link", "Change the scene"])
def test_a_simulation_is_shared_by_a_link_and_what_is_changed_there_comes_back(
    fresh: Visit, way: str
) -> None:
    """The first link holds the scene itself, so it outlives the result."""
    page = fresh.page

    def run(steps: str) -> str:
        page.get_by_role("button", name="Run").click()
        expect(page.locator(".lead")).to_contain_text(f"{steps} steps")
        return page.get_by_role("link", name=way).last.get_attribute("href") or ""

    fresh.go("/simulate?system=sho")
    page.get_by_label("Steps").fill("123")
    link = run("123")
    assert ("/results/" in link) is False
    fresh.go(link)
    expect(page.get_by_label("Steps")).to_have_value("123")
    page.get_by_label("Steps").fill("77")
    page.reload()
    expect(page.get_by_label("Steps")).to_have_value("77")
    run("77")


# At each frame: the name in the box, and the names for which exercises are shown.
NAMES = """(() => {
    const look = () => {
        const typed = document.querySelector("#student");
        const said = [...document.querySelectorAll("[data-answers=of-name] a")]
            .filter((one) => Number(getComputedStyle(one.closest("section")).opacity) > 0.5)
            .map((one) => new URL(one.href).searchParams.get("student"));
        if (typed) window.seen.push(...said.map((name) => [typed.value.trim(), name]));
        requestAnimationFrame(look);
    };
    window.seen = [];
    document.addEventListener("DOMContentLoaded", look);
})()"""


@pytest.mark.slow
def test_exercises_are_those_of_the_name_in_the_box(fresh: Visit) -> None:
    page = fresh.page
    page.add_init_script(NAMES)

    def agree(name: str) -> None:
        page.wait_for_function("(name) => seen.some(([, said]) => said === name)", arg=name)
        assert all(typed == said for typed, said in page.evaluate("seen"))

    fresh.go("/class?set=x'' = -[2..9]*x&student=Ada")
    agree("Ada")
    page.get_by_label("Your name").fill("Ben")
    page.wait_for_timeout(200)
    assert all(typed == said for typed, said in page.evaluate("seen"))
    page.get_by_role("button", name="Show my exercises").click()
    agree("Ben")
    page.reload()
    agree("Ben")
    page.go_back()
    page.wait_for_load_state()
    page.wait_for_timeout(300)
    assert all(typed == said for typed, said in page.evaluate("seen"))
    page.go_forward()
    agree("Ben")
