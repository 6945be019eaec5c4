"""The form of a scene starts where its system can be run, and its page holds what the form does."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from html.parser import HTMLParser
from typing import Any

import pytest
from starlette.requests import Request

from inverse_service import catalogue, errors, simulate as run, solve
from inverse_service.web.pages import forms, preview, rendering, simulate
from inverse_service.web.problems import refusal_of

NOBODY = Request({"type": "http", "method": "GET", "path": "/simulate", "headers": []})
EDGE = {
    "coordinates": ["phi", "x", "y"],
    "lagrangian": "(x'^2+y'^2+phi'^2)/2",
    "constraints": ["x'*sin(phi)-y'*cos(phi)"],
}


def followed(
    f: Callable[[float, float], float], form: simulate.SceneForm, parts: int = 20
) -> list[float]:
    """The places of x'' = f(x, x') from the start of the form to its end, by the classical rule of
    Runge and Kutta.
    """
    x, v = float(form.positions["x"]), float(form.velocities["x"])
    h, places = float(form.step) / parts, [x]
    for _ in range(parts * int(form.steps)):
        a1 = f(x, v)
        v2, a2 = v + h * a1 / 2, f(x + h * v / 2, v + h * a1 / 2)
        v3, a3 = v + h * a2 / 2, f(x + h * v2 / 2, v + h * a2 / 2)
        v4, a4 = v + h * a3, f(x + h * v3, v + h * a3)
        x, v = x + h * (v + 2 * v2 + 2 * v3 + v4) / 6, v + h * (a1 + 2 * a2 + 2 * a3 + a4) / 6
        places.append(x)
    return places


def form_of(result: Any) -> tuple[simulate.SceneForm, dict[str, Any]]:
    found = simulate._form_of_result(result, "a" * 32)
    assert found is not None
    return found


def test_a_force_with_a_wall_starts_beside_it_and_ends_before_it() -> None:
    """x'' = -1/x falls into x = 0; L = x'^2/2 - log(x) holds on one side of it."""
    form, base = form_of(solve("x'' = -1/x"))
    places = followed(lambda x, _: -1 / x, form)
    assert all(math.copysign(1, x) == math.copysign(1, places[0]) for x in places)
    assert base["system"]["result"]["verdict_with_time"] == "variational"


def test_a_motion_that_blows_up_is_stopped_before() -> None:
    """x'' = 6 x^2 has poles like 1/(t - t0)^2, a function of Weierstrass."""
    form, _ = form_of(solve("x'' = 6*x^2"))
    assert 1 <= int(form.steps) < 600
    assert max(map(abs, followed(lambda x, _: 6 * x * x, form))) < 1e6


def test_a_motion_that_never_ends_has_all_steps() -> None:
    form, _ = form_of(solve("x'' = -x"))
    assert form.steps == simulate.SceneForm().steps
    x, v = (float(one["x"]) for one in (form.positions, form.velocities))
    assert max(map(abs, followed(lambda x, _: -x, form, 2))) <= math.hypot(x, v) + 1e-6


def test_what_is_given_of_the_velocities_is_what_the_constraints_leave_free() -> None:
    """Three coordinates and one constraint leave two; all methods begin there."""
    forward = {"system": {"given": EDGE, "coordinates": EDGE["coordinates"]}}
    form, base = form_of(forward)
    assert base == {"system": {"document": EDGE}}
    assert sum(map(bool, form.velocities.values())) == 2
    scene = simulate.scene_document(simulate.replace(form, steps="2"), base["system"])
    outcomes = {one["method"]: one["outcome"] for one in run(scene)["methods"]}
    assert set(outcomes) == {*form.methods}
    assert not {"unavailable", "off_domain"} & {*outcomes.values()}


def test_velocities_that_contradict_a_constraint_are_left_out() -> None:
    """x' = 0 leaves no choice of x'."""
    document = {"coordinates": ["x", "y"], "lagrangian": "(x'^2+y'^2)/2", "constraints": ["x'"]}
    form = simulate.form_for(document, "rail")
    kept = simulate._with_velocities_that_fit(
        simulate.replace(form, velocities={"x": "1", "y": ""}), {"document": document}
    )
    assert kept.velocities == {"x": "", "y": "1"}


def test_a_result_without_a_lagrangian_is_run_by_its_equations() -> None:
    system = {"coordinates": ["x", "y"], "equations": {"x": "-y", "y": "-x+x'*y'"}, "name": "no"}
    without = simulate.form_of_system({"result": {"system": system, "lagrangian": None}})
    assert without.methods == simulate.WITHOUT_LAGRANGIAN
    having = {"lagrangian": {"text": "x'*y' - y^2/2 - x^2/2"}}
    timed = simulate.form_of_system({"result": {"system": system, "with_time": having}})
    assert timed.methods == ("variational", "reference")
    assert timed.coordinates == without.coordinates == ("x", "y")
    assert simulate._form_of_result({"system": {}}, "") is None


def test_the_form_of_a_chain_displaces_its_first_body_from_rest() -> None:
    form, base = asyncio.run(simulate._empty_form(NOBODY, "chain:springs:3", ""))
    assert [*form.positions.values()] == ["1", "0", "0"]
    assert {*form.velocities.values()} == {"0"}
    assert len(base["system"]["document"]["coordinates"]) == 3
    rods, _ = asyncio.run(simulate._empty_form(NOBODY, "chain:rods:2", ""))
    assert "stormer-verlet" not in rods.methods  # the masses depend on the angles
    assert "stormer-verlet" in form.methods


def test_a_circle_is_looked_for_in_a_plane_alone() -> None:
    """It is that of a disk or blade at (x, y); in space no plane is known."""
    assert "matching_circle" in simulate.form_for(EDGE, "").observe
    space = {**EDGE, "coordinates": ["x", "y", "z"]}
    assert "matching_circle" not in simulate.form_for(space, "").observe
    assert "constraints" not in simulate.form_for({"coordinates": ["x"]}, "").observe


class Fields(HTMLParser):
    """The values that a browser would send of a page: of each field its name and text."""

    def __init__(self) -> None:
        super().__init__()
        self.sent: dict[str, tuple[str, ...]] = {}
        self._chosen: str | None = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        name = given.get("name") or ""
        if tag == "select":
            self._chosen = name
        if tag == "option" and "selected" in given and self._chosen:
            self.sent[self._chosen] = (given.get("value") or "",)
        ticked = given.get("type") not in ("checkbox", "radio") or "checked" in given
        if tag == "input" and name and ticked and given.get("type") != "submit":
            self.sent[name] = (*self.sent.get(name, ()), given.get("value") or "")


def sent_by(page: bytes) -> forms.Form:
    reader = Fields()
    reader.feed(page.decode())
    return forms.Form(reader.sent)


FILLED = {
    "parameters": {"m": "2", "g": "9.81"},
    "positions": {"x": "1/3", "y": "0.5"},
    "velocities": {"x": "1, 2", "y": "-1"},
    "step": "0.02", "steps": "77", "methods": ("variational", "adaptive"),
    "alphas": {"variational": "1/4"}, "form": "raw", "constants": "C_x = 1/100", "start_time": "3",
    "contacts": ({"gap": "y", "restitution": "1/2", "friction": "", "slides": ""},),
    "observe": ("trajectory", "energy", "momenta", {"Lz": "x*y' - y*x'"}), "effects": ("kinetic",),
}  # fmt: skip


def test_what_the_page_shows_is_sent_back_as_the_form_that_was_shown() -> None:
    document = {
        "coordinates": ["x", "y"],
        "parameters": ["m", "g"],
        "lagrangian": "m*(x'^2+y'^2)/2-m*g*y",
    }
    empty = simulate.form_for(document, "stone", given="{}")
    chosen = {**FILLED, "effects": empty.effects[:1]}
    form = simulate.replace(empty, **chosen)
    # A formula is one of the scene that the form was made of.
    of_scene = simulate.replace(empty, observe=form.observe[2:])
    again = simulate.with_sent(of_scene, sent_by(bytes(simulate.simulate_page(form).body)))
    for name in chosen:
        shown, sent = getattr(form, name), getattr(again, name)
        if name == "alphas":
            sent = {key: text for key, text in sent.items() if text}
        assert sent == shown, name
    scene = simulate.scene_document(again, {"document": document})
    assert scene["steps"] == 77
    assert scene["ensemble"]["initial"]["velocities"]["x"] == ["1", "2"]
    assert simulate.form_of_scene(empty, scene).start_time == "3"


@pytest.mark.parametrize(
    ("pointer", "field"),
    [
        ("/parameters/m", "parameter.m"), ("/functions/V", "function.V"), ("/steps", "steps"),
        ("/initial/positions/x", "position.x"), ("/initial/velocities/x", "velocity.x"),
        ("/contacts/1/friction", "contact.1.friction"), ("/constants/C_x", "constants"),
        ("/ensemble/parameters/m/2", "parameter.m"), ("/ensemble/initial/positions/x/0", "position.x"),
        ("/ensemble/initial/velocities/x/1", "velocity.x"), ("/methods", ""), ("/contacts/1", ""),
        ("/step", "step"), ("/start_time", "start_time"),
    ],
)  # fmt: skip
def test_an_error_is_shown_at_the_field_that_it_is_about(pointer: str, field: str) -> None:
    assert simulate.field_of(pointer) == field
    told = simulate._told([errors.Place("wrong", pointer)])
    assert told["faults"].keys() == ({field} if field else set())
    assert "wrong" in told["reason"]
    refused = refusal_of(NOBODY, errors.DocumentRefused((errors.Place("not so", pointer),)))
    form = simulate.replace(
        simulate.form_for({"coordinates": ["x"], "parameters": ["m"]}, ""),
        contacts=(dict.fromkeys(simulate.CONTACT, "1"),) * 2,
        functions={"V": ("V(x)", "x")},
    )
    page = simulate.simulate_page(form, forms.problem_of(refused, {}), refused.status)
    assert page.status_code == 422
    assert page.body.count(b"not so") == 1 + bool(field)  # at the head, and at the field


@pytest.mark.parametrize(
    ("scene", "steps"),
    [
        ({"time": "2", "step": "0.1"}, "20"),
        ({"time": "1", "step": "3/10"}, "3"),
        ({"steps": 7, "time": "2", "step": "1"}, "7"),
        ({"time": "0.01", "step": "1"}, "1"),
        ({"time": "2", "step": "0"}, "600"),
        ({"time": "2"}, "600"),
        ({"time": "long", "step": "1"}, "600"),
        ({}, "600"),
    ],
)
def test_a_length_of_time_is_a_number_of_steps(scene: dict[str, Any], steps: str) -> None:
    assert simulate._steps(scene, "600") == steps


def test_what_the_form_has_no_fields_for_stays_in_the_scene() -> None:
    """Momenta instead of velocities, a projection onto constraints, more contacts than rows."""
    base = {
        "system": {"document": EDGE}, "note": "mine", "time": 3, "methods": ["exact"],
        "initial": {"positions": {"x": 0}, "momenta": {"x": 1}, "project": True},
        "contacts": [{"gap": f"y + {k}"} for k in range(simulate.MOST_CONTACTS + 1)],
    }  # fmt: skip
    empty = simulate.form_of_scene(simulate.form_for(EDGE, ""), base)
    assert empty.contacts == ()
    assert not any(empty.velocities.values())
    changed = simulate.changed_scene(base, simulate.scene_document(empty, base["system"]))
    assert changed["contacts"] == base["contacts"]
    assert (changed["initial"]["momenta"], changed["initial"]["project"]) == ({"x": 1}, True)
    assert "velocities" not in changed["initial"]
    assert changed["note"] == "mine"
    assert "time" not in changed  # the form says how many steps


def test_a_form_that_cannot_be_run_says_what_to_do() -> None:
    form = simulate.form_for(EDGE, "")
    for changes, pointer in (
        ({"methods": ()}, "/methods"), ({"steps": "many"}, "/steps"), ({"steps": "9" * 13}, "/steps"),
        ({"constants": "C_x"}, "/constants"),
    ):  # fmt: skip
        with pytest.raises(errors.InputError) as refused:
            simulate.scene_document(simulate.replace(form, **changes), {"document": EDGE})
        assert refused.value.places[0].pointer == pointer


def test_the_catalogue_offers_its_constrained_systems() -> None:
    page = simulate.simulate_page(simulate.form_of_system({"catalogue": "vertically-rolling-disk"}))
    shown = bytes(page.body).decode()
    for name in catalogue.names("nonholonomic"):
        assert f'href="/simulate?system={name}"' in shown


def test_a_moving_picture_says_what_it_leaves_out_and_nothing_else() -> None:
    """A plain oscillator has no contacts, events, or forces of its own."""
    system = {"document": {"coordinates": ["x"], "equations": {"x": "-x"}}}
    scene = simulate.scene_document(simulate.form_for(system["document"], ""), system)
    plain = str(preview.preview_task(scene)["caption"])
    assert not any(text in plain for text in preview.NOT_SHOWN.values())
    wall = {"contacts": [{"gap": "x + 2"}]}
    assert preview.NOT_SHOWN["contacts"] in str(preview.preview_task(scene | wall)["caption"])


def test_a_table_is_csv_in_which_no_cell_is_a_formula() -> None:
    rows = [["=1+1", "a"], [-1, "x, y"], ["-x", 'say "x"']]
    assert rendering.csv_of(rows) == '\'=1+1,a\n-1,"x, y"\n\'-x,"say ""x"""\n'
