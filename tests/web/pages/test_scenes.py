"""A scene in the form and out of it again is the same scene; what the form does not show stays."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from inverse_service import catalogue, simulate, solve
from inverse_service.errors import InputError
from inverse_service.web.pages.forms import Form
from inverse_service.web.pages.scenes import changed_scene, form_of_scene, scene_document, scene_form, with_sent
from inverse_service.web.pages.simulate import _form_of_result, form_of_system

DISK: dict[str, Any] = {
    "name": "a disk", "system": {"catalogue": "vertically-rolling-disk"},
    "parameters": {"M": 1, "R": 2, "I": "1/2", "J": "1/4"}, "effects": ["constraints"],
    "initial": {"positions": {"phi": 0.1, "theta": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "theta": 1}},
    "step": 0.05, "steps": 200, "observe": ["trajectory", "error"], "record_every": 4,
    "methods": [
        {"method": "variational", "alpha": 0}, {"method": "variational", "alpha": "1/3"},
        {"method": "runge-kutta", "order": 8}, "exact",
    ],
}  # fmt: skip


def through_the_form(scene: dict[str, Any]) -> dict[str, Any]:
    form = form_of_scene(form_of_system(scene["system"], scene="job"), scene)
    return changed_scene(scene, scene_document(form, scene["system"]))


def as_texts(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: as_texts(part) for key, part in value.items()}
    return [as_texts(part) for part in value] if isinstance(value, list) else str(value)


def test_a_scene_comes_back_as_it_was() -> None:
    found = as_texts(through_the_form(DISK))
    methods = found.pop("methods")
    expected = as_texts(DISK)
    expected.pop("methods")
    assert found == expected
    assert sorted(map(str, methods)) == sorted(
        map(str, as_texts([*DISK["methods"][:3], {"method": "exact"}]))
    )  # fmt: skip


@pytest.mark.slow
def test_a_constrained_system_whose_names_were_found_in_the_text_can_be_simulated() -> None:
    lagrangian = "m*(x'^2 + y'^2 + z'^2)/2"
    result = solve({"parameters": "guess", "lagrangian": lagrangian, "constraints": ["z' = y*x'"]})
    made = _form_of_result(result, "job")
    assert made is not None
    form, base = made
    assert (form.coordinates, form.parameters) == (("x", "y", "z"), {"m": "1"})
    assert base["system"]["document"]["coordinates"] == ["x", "y", "z"]
    # Where y = 0 the Lagrangian of the particle is singular: the form begins elsewhere, and each method runs.
    found = simulate(changed_scene(base, scene_document(replace(form, steps="20"), base["system"])))
    assert {method["outcome"] for method in found["methods"]} == {"completed"}


@pytest.mark.slow
def test_a_lagrangian_alone_is_simulated_from_its_equations() -> None:
    made = _form_of_result(solve({"parameters": "guess", "lagrangian": "m*x'^2/2 - k*x^2/2"}), "job")
    assert made is not None
    form, base = made
    assert (form.coordinates, form.parameters) == (("x",), {"m": "1", "k": "1"})
    assert form.title == "motion of L = m*x'^2/2 - k*x^2/2"
    found = simulate(changed_scene(base, scene_document(form, base["system"])))
    assert [method["outcome"] for method in found["methods"]] == ["completed", "completed"]


def test_a_length_of_time_becomes_a_number_of_steps() -> None:
    scene = {key: value for key, value in DISK.items() if key != "steps"} | {"time": 25, "step": "0.2"}
    found = through_the_form(scene)
    assert found["steps"] == 125
    assert "time" not in found


def test_momenta_and_projection_of_a_scene_stay() -> None:
    initial = {"positions": DISK["initial"]["positions"], "momenta": {"phi": 1}, "project": True}
    found = through_the_form(DISK | {"initial": initial})
    assert found["initial"]["momenta"] == {"phi": 1}
    assert found["initial"]["project"] is True
    assert "velocities" not in found["initial"]


def test_a_title_ends_in_no_half_formula() -> None:
    longer = {"coordinates": ["a", "b"], "lagrangian": "a'^2 + b'^2/2 + a'*b'*cos(a - b) + 2*cos(a) + cos(b)"}
    assert form_of_system({"document": longer}).title == "motion of a, b"
    assert form_of_system({"document": {**longer, "name": "double pendulum"}}).title == "double pendulum"


def test_a_method_that_the_form_has_no_field_for_can_be_left_out() -> None:
    form = form_of_scene(form_of_system(DISK["system"], scene="job"), DISK)
    assert len(form.further) == 2
    sent = with_sent(form, Form({"further": ("1",), "steps": ("5",), "step": ("0.1",)}))
    assert scene_document(sent, DISK["system"])["methods"] == [{"method": "runge-kutta", "order": 8}]
    with pytest.raises(InputError, match="at least one method"):
        scene_document(with_sent(form, Form({"steps": ("5",), "step": ("0.1",)})), DISK["system"])


@pytest.mark.parametrize("name", catalogue.names("nonholonomic"))
def test_every_system_of_the_catalogue_has_a_filled_form(name: str) -> None:
    form = scene_form(catalogue.document(name), "title", system=name)
    scene = scene_document(form, {"catalogue": name})
    assert set(scene["initial"]["positions"]) == set(catalogue.document(name)["coordinates"])
    assert all(scene["parameters"].values())


def test_a_scene_of_a_result_or_of_a_document_has_its_form() -> None:
    shown = {"name": "", "coordinates": ["x"], "parameters": ["k"], "functions": {}}
    of_result = form_of_system({"result": {"system": shown, "lagrangian": {}}}, job="j")
    of_document = form_of_system({"document": {"coordinates": ["x"], "parameters": ["k"], "lagrangian": "x'^2/2"}})
    written_out = form_of_system({"coordinates": ["x"], "parameters": {"k": None}, "lagrangian": "x'^2/2"})
    for form in (of_result, of_document, written_out):
        assert form.coordinates == ("x",)
        assert form.parameters == {"k": "1"}


def test_effects_of_a_scene_are_ticked_and_those_of_its_terms_too() -> None:
    scene = DISK | {"terms": {"bumps": "-cos(x)"}, "effects": ["constraints", "bumps"]}
    form = form_of_scene(form_of_system(scene["system"], scene="job"), scene)
    assert [name for name, _ in form.parts] == ["constraints", "potential", "magnetic", "bumps"]
    assert form.effects == ("constraints", "bumps")
    assert through_the_form(scene)["effects"] == ["constraints", "bumps"]


def test_all_effects_ticked_is_a_scene_that_names_none() -> None:
    form = form_of_system(DISK["system"])
    assert "effects" not in scene_document(form, DISK["system"])
    without = with_sent(form, Form({"step": ("1",), "steps": ("2",), "method": ("exact",), "effect": ("potential",)}))
    assert scene_document(without, DISK["system"])["effects"] == ["potential"]


def test_a_system_given_by_equations_has_no_effects() -> None:
    assert form_of_system({"coordinates": ["x"], "equations": {"x": "-x"}}).parts == ()


def test_methods_of_constraints_are_offered_where_there_are_some_or_where_they_are_ticked() -> None:
    free = form_of_system({"coordinates": ["x"], "equations": {"x": "-x"}})
    disk = form_of_system({"catalogue": "vertically-rolling-disk"})
    for name in ("nonholonomic", "modified", "constraints"):
        assert not free.offers(name)
        assert disk.offers(name)
    assert free.offers("variational")
    assert free.offers("energy")
    assert replace(free, methods=("modified",)).offers("modified")


def test_a_result_without_a_lagrangian_is_simulated_by_its_equations() -> None:
    system = {"name": "", "coordinates": ["x"], "parameters": [], "functions": {}, "equations": {"x": "-x"}}
    bare = form_of_system({"result": {"system": system, "lagrangian": None, "with_time": None}})
    assert bare.methods == ("runge-kutta", "reference")
    found = {"system": system, "lagrangian": None, "with_time": {"lagrangian": {"text": "x'^2/2 - x^2/2"}}}
    assert "variational" in form_of_system({"result": found}).methods
