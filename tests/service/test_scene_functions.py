"""Formulas that a scene gives to arbitrary functions reach every formula of the scene, also the free Lagrangian."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.errors import InputError
from inverse_service.service.scenes.simulating import simulate

# x'' = -k A(x): the system, and a Lagrangian of it, name the same function.
SCENE: dict[str, Any] = {
    "system": {
        "coordinates": ["x"],
        "equations": {"x": "-k*A'(x)"},
        "parameters": ["k"],
        "functions": {"A": ["x"], "B": ["x"]},
    },
    "parameters": {"k": 2},
    "functions": {"A": "x^2/2 + x^4/4"},
    "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
    "step": 0.01,
    "steps": 100,
    "methods": [{"method": "variational", "alpha": "1/2"}],
    "free_lagrangian": "x'^2/2 - k*A(x)",
    "observe": ["error"],
}


def test_functions_of_the_scene_are_put_into_a_given_free_lagrangian() -> None:
    method = simulate(SCENE)["methods"][0]
    written = simulate(SCENE | {"free_lagrangian": "x'^2/2 - k*(x^2/2 + x^4/4)"})["methods"][0]
    assert method["outcome"] == "completed"
    assert method["max_error"] == pytest.approx(written["max_error"], rel=1e-6)
    assert 0 < method["max_error"] < 1e-3
    assert method["free_lagrangian_source"] == "given in the scene"


def test_they_are_put_into_the_lagrangian_of_one_method() -> None:
    found = simulate(SCENE | {"free_lagrangian": None, "methods": [
        {"method": "variational", "alpha": "1/2", "free_lagrangian": "x'^2/2 - k*A(x)"}]})  # fmt: skip
    assert found["methods"][0]["outcome"] == "completed"


def test_a_free_lagrangian_with_another_function_is_no_lagrangian_of_the_motion() -> None:
    with pytest.raises(InputError, match="no solution of this Lagrangian"):
        simulate(SCENE | {"free_lagrangian": "x'^2/2 - k*B(x)", "functions": SCENE["functions"] | {"B": "x^3"}})


def test_a_function_without_a_formula_in_the_free_lagrangian_is_named() -> None:
    with pytest.raises(InputError, match=r"functions B are arbitrary.*'functions'"):
        simulate(SCENE | {"free_lagrangian": "x'^2/2 - k*B(x)"})


@pytest.mark.slow
def test_the_lagrangian_of_a_catalogue_system_takes_the_functions_of_the_scene() -> None:
    generic = SCENE | {
        "system": {"catalogue": "generic-class-one-second"},
        "parameters": {"I_2": 1, "I_a": 1},
        "functions": {"A": "2 + cos(r1)"},
        "initial": {"positions": {"r1": 0, "r2": 0, "s": 0}, "velocities": {"r1": 1, "r2": 1, "s": "-3"}},
        "free_lagrangian": None,
    }
    assert simulate(generic)["methods"][0]["outcome"] == "completed"


def test_a_function_that_no_equation_uses_does_not_stop_a_scene() -> None:
    system = SCENE["system"] | {"functions": SCENE["system"]["functions"] | {"C": ["r1"]}}
    assert simulate(SCENE | {"system": system})["methods"][0]["outcome"] == "completed"
