"""What the script that plays with a scene is sent, and starts from which every system can be run."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from inverse_service import catalogue
from inverse_service.errors import InputError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents.documents import solve_document
from inverse_service.service.jobs.model import JobOptions
from inverse_service.service.jobs.tasks import KINDS
from inverse_service.web.pages import preview, starts
from inverse_service.web.pages.preview import angles_of, listed, preview_task
from inverse_service.web.pages.scenes import changed_scene, scene_document
from inverse_service.web.pages.simulate import _form_of_result, form_of_system

CONSTRAINED = catalogue.names("nonholonomic")
# One of each fault that the first start has: a pole, a boundary of the domain, a blow-up, a fold of L, a singular g.
HARD = (
    "kepler-polar",
    "relativistic-charged-2d",
    "henon-heiles",
    "modified-emden",
    "sphere-geodesics",
    "calogero-goldfish-2",
    # A step of the variational method has no root before the motion ends: singular, guard, and unresolved.
    "spring-mass-damper-chain",
    "semi-separated-1",
    "two-body-harmonic-relative-damping",
    "magnetic-drag-b-x",
)


def scene_of(name: str) -> dict[str, Any]:
    """The scene that the form of a system runs when nobody changes it."""
    if name in CONSTRAINED:
        form, base = form_of_system({"catalogue": name}), {"system": {"catalogue": name}}
    else:
        found = _form_of_result(solve_document(catalogue.document(name), SolveOptions(time_limit=20)), "job")
        assert found is not None
        form, base = found
    return changed_scene(base, scene_document(form, base["system"]))


def not_completed(name: str) -> list[Any]:
    result = KINDS["simulate"].work(scene_of(name), JobOptions(60.0, 2000), lambda _: None)
    # A method that a system has not got says so; one that begins must not fail.
    return [(m["label"], m["outcome"], m.get("stopped")) for m in result["methods"] if m["outcome"] != "completed"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["knife-edge", *HARD])
def test_the_start_that_the_form_offers_can_be_run(name: str) -> None:
    assert not_completed(name) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("coordinates", "lagrangian", "constraints"),
    [
        ("x y phi", "(x'^2 + y'^2 + phi'^2)/2", ["x'*sin(phi) - y'*cos(phi)"]),
        ("x y z w", "(x'^2 + y'^2 + z'^2 + w'^2)/2", ["w' - x*y'"]),
        ("a b x y", "(a'^2 + b'^2 + x'^2 + y'^2)/2", ["a' - x*x'", "b' - x*y'"]),
    ],
)
def test_a_form_leaves_those_velocities_empty_that_the_constraints_determine(
    coordinates: str, lagrangian: str, constraints: list[str]
) -> None:
    document = {"coordinates": coordinates.split(), "lagrangian": lagrangian, "constraints": constraints}
    first = replace(form_of_system({"document": document}), methods=("nonholonomic",), steps="5")
    form = starts.with_good_start(first, {"document": document}, {})
    result = KINDS["simulate"].work(
        scene_document(form, {"document": document}), JobOptions(60.0, 2000), lambda _: None
    )
    assert [method["outcome"] for method in result["methods"]] == ["completed"]
    assert len([value for value in form.velocities.values() if value]) == len(coordinates.split()) - len(constraints)


@pytest.mark.nightly
@pytest.mark.parametrize("name", catalogue.names())
def test_every_system_of_the_catalogue_runs_from_the_start_that_the_form_offers(name: str) -> None:
    assert [one for one in not_completed(name) if one[1] != "unavailable"] == []


@pytest.mark.slow
def test_a_solved_system_is_run_with_the_energy_of_the_lagrangian_that_was_found() -> None:
    solved = solve_document({"coordinates": ["x"], "equations": {"x": "-sin(x)"}}, SolveOptions(time_limit=600))
    found = _form_of_result(solved, "job")
    assert found is not None
    form, base = found
    scene = changed_scene(base, scene_document(form, base["system"]))
    result = KINDS["simulate"].work(scene, JobOptions(60.0, 2000), lambda _: None)
    x, v = (float(scene["initial"][kind]["x"]) for kind in ("positions", "velocities"))
    for method in result["methods"]:
        assert "energy_note" not in method
        assert method["energy_start"] == pytest.approx(v * v / 2 - math.cos(x), rel=1e-12)
        assert 0 < method["max_energy_error"] < 1e-2


@pytest.mark.slow
def test_a_slow_machine_does_not_shorten_what_the_form_offers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(starts, "LONGEST_TRIAL", 0.0)
    found = _form_of_result(solve_document(catalogue.document("double-pendulum"), SolveOptions(time_limit=60)), "job")
    assert found is not None
    assert found[0].steps == "600"


@pytest.mark.parametrize("name", CONSTRAINED)
def test_every_constrained_system_can_be_played_with(name: str) -> None:
    found = preview_task(scene_of(name))
    assert set(found) == {"coordinates", "labels", "values", "equations", "constraints", "angles"}
    assert len(found["equations"]) == len(found["coordinates"])
    assert found["constraints"]


def test_a_tree_is_sent_as_numbers_names_and_lists() -> None:
    tree = read_formula("-k*x'^2/2 + sin(x)", Names(("x",), ("k",)))
    assert listed(tree) == ["+", ["*", -0.5, "k", ["^", "x'", 2.0]], ["sin", "x"]]


@pytest.mark.parametrize(
    ("text", "angles"),
    [("cos(x - y)*y'", ["x", "y"]), ("sin(x) + x", []), ("x^2*sin(y)", ["y"]), ("1/(1 + cos(x)^2)", ["x"]), ("x", [])],
)
def test_a_coordinate_in_periodic_functions_only_is_an_angle(text: str, angles: list[str]) -> None:
    assert angles_of(("x", "y"), [read_formula(text, Names(("x", "y")))]) == angles


def test_long_formulas_and_refused_scenes_are_left_to_the_service(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = {"system": {"coordinates": ["x"], "equations": {"x": "-sin(x) - x^3"}},
             "initial": {"positions": {"x": 0}, "velocities": {"x": 1}}, "step": 0.1, "steps": 2,
             "methods": ["reference"]}  # fmt: skip
    assert "equations" in preview_task(scene)
    with pytest.raises(InputError):
        preview_task({**scene, "initial": {"positions": {"y": 0}}})
    monkeypatch.setattr(preview, "MOST_NODES", 5)
    assert "cannot be played with" in preview_task(scene)["reason"]
