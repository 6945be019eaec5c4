"""Every bad scene is refused in one sentence that says what, where and what instead."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from inverse_service.errors import InputError
from inverse_service.service.scenes.scene_reading import read_scene
from inverse_service.service.scenes.scene_refusals import scene_schema

DISK: dict[str, Any] = {
    "system": {"catalogue": "vertically-rolling-disk"},
    "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"},
    "initial": {"positions": {"phi": 0, "theta": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "theta": 1}},
    "step": 0.1,
    "steps": 10,
    "methods": [{"method": "exact"}],
}


def changed(path: str, value: Any) -> dict[str, Any]:
    """The scene with one value changed, added, or (None) taken away."""
    scene = copy.deepcopy(DISK)
    *way, last = path.strip("/").split("/")
    part: Any = scene
    for step in way:
        part = part[int(step)] if isinstance(part, list) else part.setdefault(step, {})
    if value is None:
        del part[last]
    else:
        part[int(last) if isinstance(part, list) else last] = value
    return scene


OSCILLATOR = {"coordinates": ["x"], "equations": {"x": "-x"}}
CASES = [
    ("/system", 3, "/system", "catalogue"),
    ("/system", None, "/system", "missing"),
    ("/system", {}, "/system", "neither 'lagrangian' nor 'equations'"),
    ("/system", {"catalogue": "disc"}, "/system/catalogue", "no system of this name"),
    ("/system", {"catalogue": 3}, "/system/catalogue", "such as"),
    ("/system", {"document": {"coordinates": ["x"]}}, "/system/document", "neither"),
    ("/system", {"document": {"coordinates": ["x"], "lagrangian": "x'^2", "equations": "x''=0"}},
     "/system/document", "both"),
    ("/system", {"document": {"coordinates": ["x"], "lagrangian": "x'^2 +* 2"}}, "/system/document/lagrangian", ""),
    ("/system", {"document": {"lagrangian": "x'^2"}}, "/system/document/coordinates", "missing"),
    ("/system", {"document": {"coordinates": ["x"], "lagrangian": "x'^2", "color": 1}},
     "/system/document/color", "not known"),
    ("/system", {"document": {"coordinates": ["x"], "equations": {"x": "y"}}}, "/system/document/equations/x", "y"),
    ("/system", {"result": {"verdict": "variational"}}, "/system/result", "no part 'system'"),
    ("/system", {"coordinates": ["x"], "lagrangian": "x'^2/2 + t*x"}, "/parameters/M", "no parameter"),
    ("/parameters/Q", 1, "/parameters/Q", "no parameter 'Q'"),
    ("/parameters/M", None, "/parameters", "M have no value"),
    ("/parameters/M", "one", "/parameters/M", "is not a number"),
    ("/parameters/M", "1/0", "/parameters/M", ""),
    ("/parameters/M", "10^999", "/parameters/M", "number"),
    ("/effects", ["constraints", "friction"], "/effects/1", "use constraints, potential, magnetic, kinetic"),
    ("/terms", {"spring": "-k*x^2/2"}, "/terms/spring", "k"),
    ("/functions", {"A": "cos(phi)"}, "/functions/A", "not a function"),
    ("/initial/positions/x", None, "/initial/positions", "of x is missing"),
    ("/initial/positions/z", 0, "/initial/positions/z", "coordinates are phi, theta, x, y"),
    ("/initial/velocities", None, "/initial", "either 'velocities' or 'momenta'"),
    ("/initial/velocities", {"phi": 1}, "/initial/velocities", "velocities of theta, x are missing"),
    ("/initial/velocities/x", 0.5, "/initial/velocities", 'write "project": true'),
    ("/initial/project", "yes", "/initial/project", "true or false"),
    ("/initial/momenta", {"phi": 1}, "/initial", "either"),
    ("/step", 0, "/step", "positive"),
    ("/step", -0.1, "/step", "to run backwards"),
    ("/step", "h", "/step", "is not a number"),
    ("/steps", 0, "/steps", "1 to"),
    ("/steps", 2_000_000_000, "/steps", "1 to 100000000"),
    ("/steps", float("inf"), "/steps", "1 to 100000000"),
    ("/steps", None, "", "either 'steps' or 'time'"),
    ("/time", 5, "", "either 'steps' or 'time'"),
    ("/methods", [], "/methods", "list of 1"),
    ("/methods", ["euler"], "/methods/0/method", "one of variational"),
    ("/methods/0", {"method": "variational", "alpha": 2}, "/methods/0/alpha", "0 to 1"),
    ("/methods/0", {"method": "variational", "order": 5}, "/methods/0/order", "2, 4, 6, 8"),
    ("/methods/0", {"method": "runge-kutta", "order": 6}, "/methods/0/order", "4, 5, 8"),
    ("/methods/0", {"method": "variational", "tolerance": "1e-9"}, "/methods/0/tolerance", "takes steps"),
    ("/methods/0", {"method": "heyoka", "tolerance": 3}, "/methods/0/tolerance", "0.1"),
    ("/methods/0", {"method": "variational", "guard": "perhaps"}, "/methods/0/guard", ""),
    ("/methods/0", {"method": "variational", "omega": 2}, "/methods/0/omega", "not known"),
    ("/observe", ["temperature"], "/observe/0", "one of trajectory"),
    ("/circle", ["x", "z"], "/circle/1", "coordinates are"),
    ("/circle", ["x", "x"], "/circle", "same"),
    ("/color", 1, "/color", "not known"),
    ("/noise", {"x": 0.1}, "/noise", "Noise is not simulated"),
    ("/contact", "x", "/contact", "stop at an event"),
    ("/delay", 1, "/delay", "Delays are not simulated"),
    ("/forces", {"x": "-x(t - 1)"}, "/forces/x", "delays are not accepted"),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "pointer", "words"), CASES, ids=[f"{c[0]}={c[1]!s:.40}" for c in CASES])
def test_a_bad_value_is_refused_where_it_stands(path: str, value: Any, pointer: str, words: str) -> None:
    with pytest.raises(InputError) as refused:
        read_scene(scene_schema(changed(path, value)))
    assert refused.value.pointer == pointer
    assert words in refused.value.detail
    assert 10 < len(refused.value.detail) < 500


def test_constraints_with_time_are_refused() -> None:
    system = {"coordinates": ["x", "y"], "lagrangian": "x'^2/2 + y'^2", "constraints": ["y' - t*x'"]}
    scene = DISK | {"system": system, "parameters": {}}
    scene["initial"] = {"positions": {"x": 0, "y": 0}, "velocities": {"x": 0}}
    with pytest.raises(InputError, match="depend on the time t"):
        read_scene(scene_schema(scene))


def test_the_other_half_of_first_order_equations_has_no_position() -> None:
    scene = DISK | {"system": {"equations": ["x' = x - x*y", "y' = x*y - y"]}, "parameters": {}}
    scene["initial"] = {"positions": {"x": 1, "y": 2}}
    with pytest.raises(InputError, match="only x has a position") as refused:
        read_scene(scene_schema(scene))
    assert refused.value.pointer == "/initial/positions/y"


def test_arbitrary_functions_need_a_formula() -> None:
    scene = DISK | {"system": {"catalogue": "generic-class-one"}, "parameters": {"I_1": 1, "I_2": 1, "I_a": 1}}
    scene["initial"] = {"positions": {"r1": 0, "r2": 0, "s": 0}, "velocities": {"r1": 1, "r2": 1}}
    with pytest.raises(InputError, match="functions A are arbitrary") as refused:
        read_scene(scene_schema(scene))
    assert refused.value.pointer == "/functions"
    read_scene(scene_schema(scene | {"functions": {"A": "cos(r1)"}}))
    with pytest.raises(InputError, match="depends on r1 only"):
        read_scene(scene_schema(scene | {"functions": {"A": "cos(r2)"}}))


def test_effects_of_a_system_without_lagrangian_are_refused() -> None:
    scene = DISK | {"system": OSCILLATOR, "parameters": {}, "effects": ["potential"]}
    scene["initial"] = {"positions": {"x": 0}, "velocities": {"x": 0}}
    with pytest.raises(InputError, match="effects, terms and forces need a Lagrangian"):
        read_scene(scene_schema(scene))


@pytest.mark.parametrize("scene", [None, [], "disk", 3, {}, {"system": {"catalogue": "knife-edge"}}])
def test_what_is_no_scene_is_refused(scene: Any) -> None:
    with pytest.raises(InputError):
        scene_schema(scene)


@pytest.mark.parametrize(("first", "second"), [("energy", "x"), ("x", "v_x"), ("discrete_v_y", "y"), ("error", "work")])
def test_no_coordinate_has_the_name_of_another_column(first: str, second: str) -> None:
    """The column v_x was the velocity of x, and the positions of the coordinate v_x were lost."""
    system = {"coordinates": [first, second], "lagrangian": f"{first}'^2/2 + {second}'^2/2 - {first}^2"}
    with pytest.raises(InputError, match="another column"):
        read_scene(scene_schema(DISK | {"system": system, "parameters": {}}))
