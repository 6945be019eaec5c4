"""A scene is read exactly, completed where the constraints determine it, and projected only on request."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from inverse_service.errors import InputError
from inverse_service.expressions.printing import to_text
from inverse_service.service.scenes.scene_reading import read_scene
from inverse_service.service.scenes.scene_refusals import scene_schema
from inverse_service.service.scenes.simulating import run_document
from inverse_service.simulation.scene_data import Scene
from tests.service.test_scene_refusals import DISK, changed


def read(document: dict[str, Any]) -> Scene:
    return read_scene(scene_schema(document))[0]


def test_velocities_follow_from_the_constraints() -> None:
    scene = read(changed("/initial/positions/phi", "pi/3"))
    assert scene.velocities == pytest.approx([1, 1, 0.5, np.sqrt(3) / 2], abs=1e-15)


def test_given_velocities_on_the_constraints_are_kept() -> None:
    scene = read(changed("/initial/velocities", {"phi": 2, "x": 1, "theta": 1, "y": 0}))
    assert scene.velocities.tolist() == [2, 1, 1, 0]


def test_dependent_velocities_determine_the_free_ones_too() -> None:
    assert read(changed("/initial/velocities", {"phi": 2, "x": 3})).velocities.tolist() == pytest.approx([2, 3, 3, 0])


def test_a_projection_is_the_nearest_in_the_kinetic_energy() -> None:
    document = changed("/initial/velocities", {"phi": 1, "theta": 1, "x": 0, "y": 0.25})
    document["initial"]["project"] = True
    scene = read(document)
    mass = np.diag([0.25, 0.5, 1.0, 1.0])
    given = np.array([1, 1, 0, 0.25])
    assert scene.velocities[2:] == pytest.approx([scene.velocities[1], 0], abs=1e-15)
    along = np.array([0, 1, 1, 0.0])
    assert along @ mass @ (scene.velocities - given) == pytest.approx(0, abs=1e-15)


def test_momenta_are_those_of_the_lagrangian() -> None:
    document = changed("/initial", {"positions": DISK["initial"]["positions"],
                                    "momenta": {"phi": 0.25, "theta": 1, "x": 2, "y": 0}})  # fmt: skip
    assert read(document).velocities == pytest.approx([1, 2, 2, 0])


def test_momenta_of_a_lagrangian_that_is_not_quadratic_are_solved_for() -> None:
    relativistic = {"coordinates": ["x"], "lagrangian": "-sqrt(1 - x'^2)"}
    document = DISK | {"system": relativistic, "parameters": {}}
    document["initial"] = {"positions": {"x": 0}, "momenta": {"x": "3/4"}}
    assert read(document).velocities == pytest.approx([0.6])


def test_the_time_gives_the_steps() -> None:
    assert read({**changed("/steps", None), "time": 1}).grid.steps == 10
    assert read({**changed("/steps", None), "time": "1.05"}).grid.steps == 11


def test_long_runs_are_thinned_and_say_so() -> None:
    scene = read(changed("/steps", 10_000_000))
    assert scene.grid.record_every == 100
    assert "One step in 100" in scene.notes[0]
    assert read(changed("/record_every", 4)).grid.record_every == 4


def test_the_text_forms_of_yaml_are_numbers_too() -> None:
    scene = read(changed("/steps", "20") | {"step": "0.5", "record_every": "2"})
    assert (scene.grid.step, scene.grid.steps, scene.grid.record_every) == (0.5, 20, 2)


@pytest.mark.parametrize(("methods", "labels"), [
    ([{"method": "variational", "alpha": 0}, {"method": "nonholonomic", "alpha": 0.5}],
     ["variational-0", "nonholonomic-0.5"]),
    (["modified", "exact", "reference"], ["modified-0.5", "exact", "reference"]),
    ([{"method": "variational", "alpha": "1/3"}, {"method": "variational", "alpha": 1.0}],
     ["variational-1_3", "variational-1"]),
    ([{"method": "variational", "form": "raw", "order": 4}], ["variational-0.5-order4-raw"]),
    ([{"method": "runge_kutta"}, {"method": "runge-kutta", "order": 8}], ["runge-kutta", "runge-kutta-order8"]),
    (["exact", "exact", {"method": "exact", "label": "true"}], ["exact", "exact-2", "true"]),
])  # fmt: skip
def test_methods_have_labels_of_their_own(methods: list[Any], labels: list[str]) -> None:
    assert [requested.label for requested in read({**DISK, "methods": methods}).methods] == labels


def test_effects_left_out_leave_no_trace() -> None:
    system = {"catalogue": "mobile-robot-with-potential"}
    document = DISK | {"system": system, "parameters": {"m": 1, "I": 1, "J": 1, "R": 1}}
    document["initial"] = {"positions": {"theta": 0, "psi": 0, "x": 0, "y": 0}, "velocities": {"theta": 1, "psi": 1}}
    whole, bare = read(document), read(document | {"effects": ["constraints"]})
    assert whole.lagrangian is not None
    assert bare.lagrangian is not None
    assert "sin(psi)" in to_text(whole.lagrangian)
    assert "sin" not in to_text(bare.lagrangian)
    assert len(bare.constraints) == 2


def test_without_constraints_the_system_is_free() -> None:
    document = changed("/initial/velocities", {"phi": 1, "theta": 1, "x": 5, "y": 7}) | {"effects": ["potential"]}
    scene = read(document)
    assert scene.constraints == ()
    assert scene.velocities.tolist() == [1, 1, 5, 7]


def test_named_terms_act_only_where_they_are_named() -> None:
    document = {**DISK, "terms": {"spring": "-k*x^2/2", "wind": "b*y"}, "effects": ["constraints", "spring"]}
    document["parameters"] = {**DISK["parameters"], "k": 3, "b": 5}
    scene = read(document)
    assert scene.lagrangian is not None
    assert to_text(scene.lagrangian).count("k") == 1
    assert "b" not in to_text(scene.lagrangian)


def test_functions_enter_with_their_derivatives() -> None:
    system = {"coordinates": ["x"], "equations": {"x": "A'(x)*x' - A(x)"}, "functions": {"A": ["x"]}}
    document = {**DISK, "system": system, "functions": {"A": "x^3"}, "parameters": {}}
    document["initial"] = {"positions": {"x": 1}, "velocities": {"x": 0}}
    scene = read(document)
    assert scene.accelerations is not None
    assert to_text(scene.accelerations[0]) == "3*x^2*x' - x^3"


def test_values_of_the_document_are_overruled_by_the_scene() -> None:
    system = {"coordinates": ["x"], "lagrangian": "m*x'^2/2 - k*x^2/2", "parameters": {"m": 2, "k": "1/2"}}
    document = {**DISK, "system": system, "parameters": {"k": 9}}
    document["initial"] = {"positions": {"x": 1}, "velocities": {"x": 0}}
    assert dict(read(document).values) == {"m": 2.0, "k": 9.0}


def test_constraints_may_be_one_text_and_equations() -> None:
    system = {
        "coordinates": ["phi", "theta", "x", "y"],
        "lagrangian": "(x'^2 + y'^2)/2 + theta'^2/4 + phi'^2/8",
        "constraints": "x' = cos(phi)*theta'; y' = sin(phi)*theta'",
        "associated": "second",
    }
    scene = read({**DISK, "system": {"document": system}, "parameters": {}})
    assert len(scene.constraints) == 2
    assert scene.velocities.tolist() == [1, 1, 1, 0]


def test_names_in_greek_letters_are_taken_everywhere() -> None:
    initial = {"positions": {"Ω": 1, "θ": 0}, "velocities": {"\\Omega": 0, "theta": 1}}
    system = {"coordinates": ["Ω", "\\theta"], "lagrangian": "(Ω'^2 + θ'^2)/2 - κ*Ω^2/2", "parameters": ["κ"]}
    scene = {"system": system, "initial": initial, "parameters": {"κ": 4}, "forces": {"θ": "-Ω"}}
    found = run_document(
        scene | {"step": 0.1, "steps": 5, "methods": ["adaptive"], "circle": ["Ω", "θ"]}, None, 60
    )[0].scene  # fmt: skip
    assert found.coordinates == ("Omega", "theta")
    assert found.values == {"kappa": 4.0}
    assert found.positions.tolist() == [1, 0]
    assert found.velocities.tolist() == [0, 1]
    assert found.circle == (0, 1)


@pytest.mark.parametrize(
    "system", [{"coordinates": ["x"], "lagrangian": "x'^2/2 - k*x^2/2"}, {"equations": {"x": "-k*x"}}]
)
@pytest.mark.parametrize("further", [{}, {"forces": {"x": "-x'"}}])
def test_parameters_of_a_scene_declare_names_of_its_system(system: dict[str, Any], further: dict[str, Any]) -> None:
    start = {"positions": {"x": 1}, "velocities": {"x": 0}}
    scene = {"system": system, "parameters": {"k": 2}, "initial": start, "step": 0.1, "steps": 5} | further
    scene["methods"] = ["runge-kutta"]
    if "lagrangian" in system or not further:
        assert read(scene).values == {"k": 2.0}
    for name in ("x",) if further else ("x", "other"):
        with pytest.raises(InputError, match=f"no parameter '{name}': its parameters are k") as refused:
            read(scene | {"parameters": {"k": 2, name: 1}})
        assert refused.value.pointer == f"/parameters/{name}"
