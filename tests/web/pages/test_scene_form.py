"""What the advice of a run says can be set on the form of a simulation."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import mpmath
import pytest

from inverse_service import catalogue, errors, solve
from inverse_service.expressions import calculus, tree as ex
from inverse_service.integrators.method_table import METHODS
from inverse_service.service.scenes import views
from inverse_service.simulation import sentences
from inverse_service.web.pages import chains, forms, preview, simulate, simulations
from inverse_service.web.problems import Refusal

DISK = catalogue.document("vertically-rolling-disk")


def sent(**fields: str) -> forms.Form:
    return forms.Form(
        {
            "method": ("variational", "nonholonomic"),
            **{name: (text,) for name, text in fields.items()},
        }
    )


def test_free_constants_and_the_form_of_a_method_reach_the_scene_and_come_back() -> None:
    empty = simulate.form_for(DISK, "disk")
    form = simulate.with_sent(
        empty, sent(constants="C_x = 1/100, C_y = 2", form="raw", step="0.1", steps="5")
    )
    scene = simulate.scene_document(form, DISK)
    assert scene["constants"] == {"C_x": "1/100", "C_y": "2"}
    assert scene["methods"] == [
        {"method": "variational", "form": "raw"},
        {"method": "nonholonomic"},
    ]
    again = simulate.form_of_scene(empty, scene)
    assert (again.constants, again.form, again.methods) == (form.constants, "raw", form.methods)
    assert again.further == ()
    left = simulate.changed_scene(
        scene, simulate.scene_document(simulate.with_sent(empty, sent(steps="5")), DISK)
    )
    assert "constants" not in left  # what was emptied does not stay


def test_a_free_constant_without_a_value_is_told_next_to_its_field() -> None:
    form = simulate.with_sent(simulate.form_for(DISK, "disk"), sent(constants="C_x", steps="5"))
    with pytest.raises(errors.InputError) as refused:
        simulate.scene_document(form, DISK)
    assert simulate.field_of(refused.value.places[0].pointer) == "constants"
    assert "C_x = 1/100" in refused.value.detail


def scene_of(system: str = "chain:springs:2", **fields: str) -> dict[str, Any]:
    chain = chains.chain_of(system)
    assert chain is not None
    document = chains.document_of(*chain)
    empty = simulate.form_for(document, "chain")
    given = {"position.x1": "1", "velocity.x1": "0", "position.x2": "0", "velocity.x2": "0"}
    given |= {"parameter.m": "1", "parameter.k": "1", "step": "0.1", "steps": "5"}
    return simulate.scene_document(simulate.with_sent(empty, sent(**given | fields)), document)


def test_lists_in_the_boxes_are_an_ensemble_of_all_combinations_and_come_back() -> None:
    lists = {"parameter.k": "1, 4", "position.x1": "1,2", "velocity.x2": "0, 1, 2"}
    scene = scene_of(**lists)
    assert scene["parameters"] == {"m": "1", "k": "1"}
    assert scene["initial"]["positions"] == {"x1": "1", "x2": "0"}
    starts = scene["ensemble"]["initial"]
    assert scene["ensemble"]["parameters"] == {"k": ["1", "4"]}
    pairs = set(zip(starts["positions"]["x1"], starts["velocities"]["x2"], strict=True))
    assert len(pairs) == len(starts["positions"]["x1"]) == 6
    document = chains.document_of("springs", 2)
    again = simulate.form_of_scene(simulate.form_for(document, "chain"), scene)
    assert (again.parameters["k"], again.positions["x1"], again.velocities["x2"]) == (
        "1, 4",
        "1, 2",
        "0, 1, 2",
    )
    assert "ensemble" not in simulate.changed_scene(scene, scene_of())
    with pytest.raises(errors.InputError, match="runs; the form takes"):
        scene_of(**{name: ",".join("123456789") for name in lists})


def test_an_ensemble_that_the_form_has_no_lists_for_stays() -> None:
    diagonal = {"initial": {"positions": {"x1": [1, 2], "x2": [3, 4]}}}
    base = {**scene_of(), "ensemble": diagonal}
    assert simulate.changed_scene(base, scene_of())["ensemble"] == diagonal


def test_contacts_reach_the_scene_and_come_back() -> None:
    scene = scene_of(
        **{"contact.0.gap": "x1", "contact.0.restitution": "1/2", "contact.2.gap": "x2"}
    )
    assert scene["contacts"] == [{"gap": "x1", "restitution": "1/2"}, {"gap": "x2"}]
    scene["contacts"][0]["name"] = "wall"
    document = chains.document_of("springs", 2)
    again = simulate.form_of_scene(simulate.form_for(document, "chain"), scene)
    kept = simulate.scene_document(again, document)["contacts"]
    assert kept == [
        {"name": "wall", "gap": "x1", "restitution": "1/2"},
        {"name": "contact_2", "gap": "x2"},
    ]
    with pytest.raises(errors.InputError) as refused:
        scene_of(**{"contact.0.friction": "1"})
    assert simulate.field_of(refused.value.places[0].pointer) == "contact.0.gap"


@pytest.mark.parametrize("kind", chains.NAMES)
def test_a_chain_has_its_equations(kind: str) -> None:
    """The middle one of three bodies against Newton's law, by hand; of rods the last one at rest below two upright."""
    document = chains.document_of(kind, 3)
    scene = simulate.form_for(document, "chain")
    system = {"document": document}
    _, found = preview.accelerations_of(simulate.scene_document(scene, system))
    assert found is not None
    names = document["coordinates"]
    at = {ex.Symbol(name): mpmath.mpf(k * k) / 5 for k, name in enumerate(names, 1)}
    at |= {ex.Velocity(name): mpmath.mpf(0) for name in names}
    at |= {ex.Symbol(name): mpmath.mpf(k) for k, name in enumerate(document["parameters"], 2)}
    m, k = mpmath.mpf(2), mpmath.mpf(3)
    a, b, c = (at[ex.Symbol(name)] for name in names)
    if kind == "rods":
        # At the angle of all three, a straight chain: the torque on each rod is that of what hangs
        # on it.
        at |= {ex.Symbol(name): a for name in names}
        q = [calculus.evaluate(one, at) for one in found]
        ell, g = mpmath.mpf(3), mpmath.mpf(4)
        for i in range(3):
            pulled = sum((3 - max(i, j)) * ell * q[j] for j in range(3))
            assert abs(pulled + (3 - i) * g * mpmath.sin(a)) < 1e-9
        return
    stretch = {
        "springs": lambda d: k * d,
        "fpu": lambda d: k * d + 4 * d**3,
        "toda": lambda d: -mpmath.exp(-d),
    }[kind]
    assert abs(m * calculus.evaluate(found[1], at) - (stretch(c - b) - stretch(b - a))) < 1e-9


def test_the_number_of_bodies_of_a_link_is_kept_in_bounds() -> None:
    assert chains.chain_of("chain:springs:999999999") == ("springs", chains.LONGEST)
    assert chains.chain_of("chain:rods:x") == ("rods", 8)
    assert chains.chain_of("chain:../x:3") is None
    assert chains.chain_of("vertically-rolling-disk") is None


def test_what_advice_names_is_on_the_form() -> None:
    """Each method, and each key of a scene that a sentence of advice tells to set."""
    words = tomllib.loads((Path(sentences.__file__).parent / "sentences.toml").read_text("utf-8"))
    told = " ".join(words.values())
    offered = {name for name, *_ in simulate.METHODS}
    named = set(re.findall(r"`([a-z-]+)`", told)) & {one.replace("_", "-") for one in METHODS}
    named |= {"stormer-verlet"} if "Stormer-Verlet" in told else set()
    assert named <= offered
    assert "stiff" in named


def runs_of(**columns: list[float]) -> dict[str, Any]:
    """A result of three runs with these columns."""
    ends = {"x_end": [0.25, 1.0, 2.25], "completed": [1.0, 1.0, 0.0]}
    return {
        "system": {"coordinates": ["x"], "parameters": {"k": 1.0}},
        "initial": {"positions": {"x": 0.5}, "velocities": {"x": 1.0}},
        "methods": [
            {"method": "adaptive", "label": "adaptive", "members": 3, "members_columns": columns | ends}
        ],
    }  # fmt: skip


def test_the_page_of_several_runs_says_in_what_they_differ_and_draws_their_ends() -> None:
    result = runs_of(x_start=[0.5, 1.0, 1.5])
    assert dict(simulations.start_shown(result)) == {"k": "1", "x": "0.5, 1, 1.5", "x\u2032": "1"}
    (figure,) = views.figures_of(result)
    (view,) = figure["views"]
    (line,) = view["lines"]
    assert (view["x"], view["y"], view["dots"]) == ("x at the start", "x at the end", True)
    assert line["y"] == [x * x for x in line["x"]]
    by_speed = runs_of(v_x_start=[1.0, 2.0, 3.0])
    assert dict(simulations.start_shown(by_speed))["x\u2032"] == "1, 2, 3"
    assert views.figures_of(runs_of(x_start=[0.5, 1.0, 1.5], k=[1.0, 1.0, 4.0])) == []


def test_a_step_is_priced_by_the_first_method_that_can_run() -> None:
    """Størmer and Verlet's step needs constant masses."""
    scene = {
        "system": {"lagrangian": "(1 + x^2)*x'^2/2", "coordinates": ["x"]},
        "initial": {"positions": {"x": 0}, "velocities": {"x": 1}},
        "methods": ["stormer-verlet", "runge-kutta"], "step": "0.1", "steps": 50,
    }  # fmt: skip
    told = preview.price_task(scene)
    assert told["order"] == pytest.approx(4, abs=0.3)
    only = preview.price_task(scene | {"methods": ["stormer-verlet"]})
    assert set(only) == {"reason"}
    assert "constant masses" in only["reason"]


def test_contacts_are_offered_where_there_are_masses() -> None:
    """A single coordinate needs none, two of given equations have none."""
    two = {"coordinates": ["x", "y"]}
    assert simulate.form_for({"coordinates": ["y"]}, "").can_touch
    assert simulate.form_for({**two, "lagrangian": "x'^2 + y'^2"}, "").can_touch
    assert not simulate.form_for({**two, "equations": {"x": "0", "y": "-1"}}, "").can_touch


def test_a_scene_goes_into_a_link_and_comes_back_as_it_is() -> None:
    scene = scene_of(step="0.1", steps="5", **{"position.x1": "1/3"})
    for system in ({"document": DISK}, {"catalogue": "vertically-rolling-disk"}, scene["system"]):
        link = simulations.scene_address({**scene, "system": system})
        filled, base = simulate._form_of_link(parse_qs(urlsplit(link).query)["given"][0])
        assert base == {**scene, "system": system}
        assert filled.given
    assert filled.positions["x1"] == "1/3"
    assert (filled.step, filled.steps) == ("0.1", "5")


def test_a_result_in_a_scene_is_its_equations_in_the_link_and_a_long_one_has_none() -> None:
    result = solve({"equations": "x'' = -k*x", "parameters": ["k"]})
    scene = scene_of(step="0.1", steps="5") | {"system": {"result": result}}
    query = parse_qs(urlsplit(simulations.scene_address(scene)).query)
    document = json.loads(query["given"][0])["system"]["document"]
    assert document["equations"] == {"x": "-k*x"}
    assert document["coordinates"] == ["x"]
    long = {"coordinates": ["x"], "equations": {"x": "+".join(["x"] * forms.LONGEST_LINK)}}
    assert simulations.scene_address({**scene, "system": {"document": long}}) == ""


@pytest.mark.parametrize(
    "given", ["", "{", "[]", "1", "{}", '{"system": 3}', '{"system": {"document": {}}}', "[" * 5000,
              '{"system": {"catalogue": "sho"}, "methods": 7}', '{"system": {"catalogue": "sho"}, "methods": [{}]}'],
)  # fmt: skip
def test_a_link_without_a_scene_is_refused(given: str) -> None:
    with pytest.raises(Refusal, match="whole link"):
        simulate._form_of_link(given)
