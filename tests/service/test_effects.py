"""An omitted part of a scene leaves no symbol in the equations, the kernel, or the answer."""

from __future__ import annotations

import json
from typing import Any

import pytest

from inverse_service.expressions.tree import Symbol, walk
from inverse_service.kernels.codegen.compiled import kernel_text
from inverse_service.service.scenes.scene_reading import read_scene, scene_schema
from inverse_service.service.scenes.simulating import simulate
from inverse_service.simulation.derivation import Derived, problem_of
from inverse_service.simulation.numeric_formulas import Formulas
from inverse_service.simulation.observing import observed_problem
from inverse_service.simulation.scene_data import Problem
from inverse_service.simulation.schemes import program_of
from tests.values import slow

EFFECTS: dict[str, Any] = {
    "system": {"coordinates": ["x", "y"], "lagrangian": "x'^2/2 + y'^2/2 - alpha*cos(x*y) + beta*(x*y' - y*x')",
               "constraints": ["y' - gamma*x'*x"], "parameters": ["alpha", "beta", "gamma"]},
    "parameters": {"alpha": 1, "beta": "1/2", "gamma": 2, "delta": 3, "epsilon": 4, "zeta": 5},
    "terms": {"spring": "-delta*x^2/2"}, "forces": {"x": "-epsilon*x'"}, "rayleigh": "zeta*y'^2/2",
    "initial": {"positions": {"x": 0, "y": 1}, "velocities": {"x": 1, "y": 0}}, "step": 0.01, "steps": 20,
}  # fmt: skip
NAMES = {"constraints": "gamma", "potential": "alpha", "magnetic": "beta", "spring": "delta", "forces": "epsilon",
         "rayleigh": "zeta"}  # fmt: skip


@pytest.mark.parametrize(
    "method",
    ["nonholonomic", *(slow(name) for name in ("runge-kutta", "reference", "stiff", "adaptive"))],
)
@pytest.mark.parametrize("left_out", NAMES)
def test_an_effect_that_is_left_out_leaves_no_symbol(left_out: str, method: str) -> None:
    """Each effect has its own parameter, which must not appear in the equations, the kernel, or the
    answer.
    """
    acting = [name for name in NAMES if name != left_out]
    scene, _ = read_scene(
        scene_schema(EFFECTS | {"effects": acting, "methods": [method], "observe": ["energy"]})
    )
    for name, parameter in NAMES.items():
        derived = Derived(scene, None)
        problem = problem_of(scene.methods[0], derived)
        assert isinstance(problem, Problem)
        problem, observation = observed_problem(scene, problem, scene.methods[0].choice)
        is_there = name != left_out
        trees = [
            problem.lagrangian,
            *(problem.accelerations or ()),
            *problem.constraints,
            *problem.forces,
        ]
        assert (
            any(Symbol(parameter) in set(walk(tree)) for tree in trees if tree is not None)
            == is_there
        ), name
        assert (parameter in problem.parameters) == is_there, name
        program = program_of(Formulas(problem), scene.methods[0].choice, observation)
        place = problem.parameters.index(parameter) if is_there else len(problem.parameters)
        assert (f"c{place}" in program.arguments) == is_there
    # The kernel is identical to that of a system without the effect.
    kernel = kernel_text(program)
    bare, _ = read_scene(
        scene_schema(without(left_out) | {"methods": [method], "observe": ["energy"]})
    )
    own = observed_problem(
        bare, problem_of(bare.methods[0], Derived(bare, None)), bare.methods[0].choice
    )
    assert kernel_text(program_of(Formulas(own[0]), bare.methods[0].choice, own[1])) == kernel
    result = simulate(
        EFFECTS | {"effects": acting, "methods": [method], "observe": ["trajectory", "constraints"]}
    )
    texts = [result["system"]["lagrangian"], *result["system"]["constraints"]]
    if left_out in ("potential", "magnetic", "constraints", "spring"):
        assert not any(NAMES[left_out] in text for text in texts)
    columns = result["methods"][0]["points"]["columns"]
    assert ("constraint_1" in columns) == (left_out != "constraints")
    assert [part["name"] for part in result["effects"]["left_out"]] == [left_out]
    assert {part["name"] for part in result["effects"]["acting"]} == set(acting)
    assert all(
        part["operations"] > 0
        for part in result["effects"]["acting"]
        if part["name"] != "constraints"
    )
    assert result["effects"]["left_out"][0]["operations"] > 0


def without(effect: str) -> dict[str, Any]:
    """The scene with a system that lacks the effect."""
    scene: dict[str, Any] = json.loads(json.dumps(EFFECTS))
    system, parameter = scene["system"], NAMES[effect]
    del scene["parameters"][parameter]
    if parameter in system["parameters"]:
        system["parameters"].remove(parameter)
    if effect == "constraints":
        del system["constraints"]
    elif effect in ("potential", "magnetic"):
        term = {"potential": " - alpha*cos(x*y)", "magnetic": " + beta*(x*y' - y*x')"}[effect]
        system["lagrangian"] = system["lagrangian"].replace(term, "")
    else:
        scene.pop({"spring": "terms"}.get(effect, effect))
    return scene


@pytest.mark.parametrize(
    "observed",
    [
        slow("trajectory"),
        slow("energy"),
        slow("constraints"),
        slow("momenta"),
        "velocities",
    ],
)
def test_a_quantity_that_is_not_observed_leaves_no_symbol(observed: str) -> None:
    """It adds neither a column nor an instruction."""
    every = ["trajectory", "energy", "constraints", "momenta", "velocities"]
    kernels, columns = [], []
    for names in (every, [name for name in every if name != observed]):
        document = EFFECTS | {"methods": ["nonholonomic"], "observe": names}
        scene, _ = read_scene(scene_schema(document))
        problem = problem_of(scene.methods[0], Derived(scene, None))
        own = observed_problem(scene, problem, scene.methods[0].choice)
        kernels.append(kernel_text(program_of(Formulas(own[0]), scene.methods[0].choice, own[1])))
        columns.append(set(simulate(document)["methods"][0]["points"]["columns"]))
    gone = columns[0] - columns[1]
    assert gone >= {"energy": {"energy"}, "constraints": {"constraint_1"}, "momenta": {"p_x", "p_y"},
                    "trajectory": {"x", "y"}, "velocities": {"v_x", "v_y"}}[observed]  # fmt: skip
    # Positions and momenta are the state itself; velocities are computed at the recorded points.
    assert (len(kernels[1]) < len(kernels[0])) == (observed in ("energy", "constraints"))


IN_THE_ANSWER = {
    "matching_circle": "circle", "phase": "max_phase_error", "error": "max_error", "lyapunov": "lyapunov",
    "constraint_forces": "constraint_forces", "period": "period", "cost": "cost", "own": "own", "body": "body_x",
    "events": "events",
}  # fmt: skip
DISK: dict[str, Any] = {
    "system": {"catalogue": "vertically-rolling-disk"}, "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"},
    "initial": {"positions": {"phi": 0.3, "theta": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "theta": 1}},
    "step": 0.1, "steps": 9, "methods": ["adaptive"],
}  # fmt: skip


def observing(names: list[str]) -> dict[str, Any]:
    formulas: list[Any] = [{"own": "x*y'"}] if "own" in names else []
    kinds = [name for name in names if name not in ("own", "body", "events")]
    scene = DISK | {"observe": ["trajectory", *kinds, *formulas]}
    scene |= {"points": {"body": ["x", "y"]}} if "body" in names else {}
    return scene | ({"events": [{"when": "x - 1/2"}]} if "events" in names else {})


def keys_of(value: Any) -> set[str]:
    if isinstance(value, dict):
        return {key for key in value if value[key] is not None}.union(*map(keys_of, value.values()))
    return set().union(*map(keys_of, value)) if isinstance(value, list) else set()


@pytest.mark.slow
def test_an_omitted_quantity_outside_the_kernel_is_not_in_the_answer() -> None:
    """There is no number, column, measured time, or reference solution for it."""
    assert set(IN_THE_ANSWER.values()) <= keys_of(simulate(observing(list(IN_THE_ANSWER))))
    for part in (0, 1):  # each half is omitted while the other is present
        left_out = list(IN_THE_ANSWER)[part::2]
        found = keys_of(
            simulate(observing([name for name in IN_THE_ANSWER if name not in left_out]))
        )
        assert not found & {*left_out, *map(IN_THE_ANSWER.get, left_out)}
    assert simulate(observing([]))["truth"] is None


@pytest.mark.parametrize("method", ["adaptive", "nonholonomic", "variational", "stiff"])
def test_no_effect_has_a_negative_price(method: str) -> None:
    """Leaving out a potential that others cancel against, or repeat, saves what it alone needs: at
    least nothing.
    """
    system = {"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2 - (x - y)^2/2 + x^2/2"}
    scene = {
        "system": system, "terms": {"twin": "-x^2/2", "own": "-sin(x*y)"}, "step": 0.1, "steps": 2, "methods": [method],
        "initial": {"positions": {"x": 1, "y": 0}, "velocities": {"x": 0, "y": 0}},
    }  # fmt: skip
    found = simulate(scene)["effects"]
    prices = {one["name"]: one["operations"] for one in (*found["acting"], *found["left_out"])}
    assert all(price >= 0 for price in prices.values() if price is not None)
    if found["operations"] is not None:
        assert 0 < prices["own"] < found["operations"]
