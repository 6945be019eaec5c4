"""The recommended method, and proof that it is suitable."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service import solve
from inverse_service.mechanics import euler_lagrange
from inverse_service.reading import names as nm, reader
from inverse_service.service.scenes.simulating import simulate
from inverse_service.service.scenes.work_precision import work_precision
from tests.values import slow

HENON = {"coordinates": ["x", "y"], "lagrangian": "(x'^2+y'^2)/2 - (x^2+y^2)/2 - x^2*y + y^3/3"}
PENDULA = {
    "coordinates": ["a", "b"],
    "lagrangian": "a'^2 + b'^2/2 + a'*b'*cos(a-b) + 2*cos(a) + cos(b)",
}
EDGE = {
    "coordinates": ["phi", "x", "y"],
    "lagrangian": "(x'^2+y'^2+phi'^2)/2",
    "constraints": ["sin(phi)*x' - cos(phi)*y'"],
}
MAGNETIC = {"coordinates": ["x", "y"], "lagrangian": "(x'^2+y'^2)/2 + x*y'"}
VAN_DER_POL = {"coordinates": ["x"], "equations": ["x'' = 1000*(1 - x^2)*x' - x"]}
DAMPED = {"coordinates": ["x"], "equations": ["x'' = -x - x'/10"]}


def scene(system: dict[str, Any], methods: list[Any], **more: Any) -> dict[str, Any]:
    rates = {
        name: 0.1 for name in system["coordinates"] if name != "y" or "constraints" not in system
    }
    initial = {"positions": dict.fromkeys(system["coordinates"], 0.2), "velocities": rates}
    return {
        "system": system,
        "initial": initial,
        "step": 0.1,
        "time": 20,
        "methods": methods,
    } | more


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "method"),
    [
        (HENON, "stormer-verlet"), (PENDULA, "variational"), (MAGNETIC, "variational"), (EDGE, "nonholonomic"),
        (DAMPED, "adaptive"), (VAN_DER_POL, "stiff"),
    ],
)  # fmt: skip
def test_the_method_fits_the_scene_and_runs(system: dict[str, Any], method: str) -> None:
    advice = simulate(scene(system, ["adaptive"]))["advice"]
    assert advice["method"] == method
    taken = {"method": method} | ({"order": advice["order"]} if advice["order"] else {})
    (found,) = simulate(scene(system, [taken]))["methods"]
    assert found["outcome"] == "completed"


@pytest.mark.slow
def test_stormer_and_verlet_have_their_orders_and_keep_the_energy() -> None:
    methods = [{"method": "stormer-verlet", "order": order} for order in (2, 4, 6, 8)]
    errors = []
    for step in (0.1, 0.05):
        found = simulate(scene(HENON, methods, step=step, observe=["error", "energy"]))["methods"]
        assert [method["label"] for method in found][1] == "stormer-verlet-order4"
        errors.append([method["max_error"] for method in found])
        assert found[3]["max_energy_error"] < 1e-12
    for order, coarse, fine in zip((2, 4, 6), *errors, strict=False):
        assert coarse / fine == pytest.approx(2**order, rel=0.25)
    assert errors[1][3] < 1e-13


@pytest.mark.parametrize(
    ("system", "forces"), [(PENDULA, {}), (MAGNETIC, {}), (HENON, {"x": "-x'/10"})]
)
def test_stormer_and_verlet_say_what_they_need(
    system: dict[str, Any], forces: dict[str, str]
) -> None:
    """A method for H would go on without the friction."""
    (found,) = simulate(scene(system, ["stormer-verlet"], forces=forces))["methods"]
    assert found["outcome"] == "unavailable"
    assert "T(p) + V(q)" in found["reason"]


@pytest.mark.slow
def test_peers_are_measured() -> None:
    methods = [{"method": "stormer-verlet", "order": 8}, {"method": "stormer-verlet", "order": 2}]
    found = work_precision(scene(HENON, methods, repeats=1), None, 40.0)
    labels = {method["label"] for method in found["methods"]}
    assert labels >= {"SciPy DOP853", "SciPy Radau", "SciPy LSODA", "stormer-verlet"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("document", "method", "words"),
    [
        ({"coordinates": ["x"], "equations": {"x": "-x"}}, "stormer-verlet", "L is separable"),
        ({"coordinates": ["x"], "equations": {"x": "-x'^2"}}, "variational", "L is not separable"),
        ({"coordinates": ["x"], "equations": "x''/(1 - x'^2)^(3/2) + x = 0"}, "variational", "L is separable, but not"),
        ({"coordinates": ["x"], "equations": {"x": "-x - x'/10"}}, "variational", "L contains t"),
        ({"coordinates": ["x"], "equations": {"x": "-x - 2*x'/t"}}, "variational", "but its masses depend on the time"),
        ({"coordinates": ["x", "y"], "equations": {"x": "y' + x*y", "y": "x^2*x'"}}, "adaptive", "nothing is known"),
        ({"coordinates": ["x", "y", "z"], "lagrangian": "(x'^2+y'^2+z'^2)/2", "constraints": ["z' + x*y'"],
          "associated": "second"}, "nonholonomic", "constraints to round-off"),
    ],
)  # fmt: skip
def test_a_result_of_solve_says_what_to_simulate_it_with(
    document: dict[str, Any], method: str, words: str
) -> None:
    advice = solve({**document, "first_integrals": False})["advice"]
    assert advice["method"] == method
    assert advice["order"] == (None if method == "adaptive" else 8)
    assert words in advice["reason"]


@pytest.mark.parametrize(
    ("force", "wall"),
    [
        slow("-x - x'/abs(x')/10", "x'"),
        slow("-sign(x)", "x"),
        ("-abs(x)", "x"),
    ],
)
def test_advice_says_where_the_lagrangian_of_a_branch_ends(force: str, wall: str) -> None:
    """Dry friction on one side has an L whose energy is constant until the first turn."""
    system = {"coordinates": ["x"], "equations": {"x": force}}
    found = simulate(scene(system, ["adaptive"], observe=["energy"]))
    assert f"It ends where {wall} changes its sign" in found["advice"]["reason"]


def test_advice_does_not_warn_of_constants_that_change() -> None:
    """x^(2 k) x'^2/2 - l x^(2 k + 2)/(2 (k + 1)): motions end at x = 0, and k + 1 is a constant."""
    equations = "x'' = -k*x'^2/x - l*x"
    document = {"equations": equations, "parameters": ["k", "l"], "first_integrals": False}
    reason = solve(document)["advice"]["reason"]
    assert "It ends where x" in reason


def test_no_method_is_advised_for_a_degenerate_lagrangian() -> None:
    system = {"coordinates": ["x", "y"], "lagrangian": "x'^2/2 - x^2/2 - x*y"}
    initial = {"positions": {"x": 1, "y": 1}, "velocities": {"x": 0, "y": 0}}
    found = simulate(
        {
            "system": system,
            "initial": initial,
            "step": 0.1,
            "steps": 5,
            "methods": ["stormer-verlet"],
        }
    )
    assert found["methods"][0]["outcome"] == "unavailable"
    assert found["advice"] is None


CONTACT = {"coordinates": ["x", "y", "z"], "constraints": ["x' + y*z'"]}
QUADRATIC = "(x'^2+y'^2+z'^2)/2 - (x^2+y^2+z^2)/2"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "words"),
    [
        (CONTACT | {"lagrangian": QUADRATIC}, "and the energy drifts little"),
        (CONTACT | {"lagrangian": f"{QUADRATIC} + 3*z*y'/10"}, "but the energy may drift"),
        (
            CONTACT | {"lagrangian": f"{QUADRATIC} + x*cos(2*t)/2"},
            "contains t, so the energy is not constant",
        ),
        (
            CONTACT | {"lagrangian": QUADRATIC, "constraints": ["x' + y*z' - 1"]},
            "energy is not constant",
        ),
    ],
)
def test_the_energy_of_a_constrained_motion_is_promised_only_where_it_is_kept(
    system: dict[str, Any], words: str
) -> None:
    found = simulate(scene(system, ["nonholonomic"], initial={
        "positions": {"x": 0.5, "y": 0.3, "z": 0.2}, "velocities": {"y": 0.4, "z": 0.3}}))  # fmt: skip
    assert words in found["advice"]["reason"]


@pytest.mark.slow
def test_work_and_precision_give_the_same_advice() -> None:
    found = work_precision(scene(VAN_DER_POL, ["stiff"], repeats=1, time=2), None, 20.0)
    assert found["advice"]["method"] == "stiff"


def test_a_strong_damper_with_a_lagrangian_needs_the_stiff_method() -> None:
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"}
    assert simulate(scene(system, ["stiff"], rayleigh="5000*x'^2/2"))["advice"]["method"] == "stiff"
    assert simulate(scene(system, ["stiff"], rayleigh="x'^2/2"))["advice"]["method"] == "adaptive"


def test_the_advice_is_about_the_lagrangian_that_ends_at_the_fewest_places() -> None:
    """exp(t/10) (x'^2 - x^2)/2 is regular everywhere, the L without t (an arctangent of x'/x) ends
    where x is 0.
    """
    document = {**DAMPED, "first_integrals": False}
    advice = solve(document)["advice"]
    assert "contains t" in advice["reason"]
    assert "ends where" not in advice["reason"]
    alone = solve(document | {"time_dependent_lagrangian": False})["advice"]
    assert "It ends where x changes its sign" in alone["reason"]


@pytest.mark.parametrize(
    ("lagrangian", "constraint", "words"),
    [
        ("(x'^2 + y'^2)/2", "y' - x*x'", "and the energy drifts little"),
        ("(x'^2 + y'^2)/2", "y' - t*x'", "a constraint contains t"),  # it does no work
        ("(x'^2 + y'^2)/2", "y' - t", "with velocity-free terms do work"),
        ("(x'^2 + y'^2)/2 - t*x", "y' - x*x'", "L contains t, so the energy is not constant"),
    ],
)
def test_what_the_energy_of_a_constrained_motion_depends_on_is_said(
    lagrangian: str, constraint: str, words: str
) -> None:
    given = nm.Names(("x", "y"), (), {})
    trees = [reader.read_formula(text, given) for text in (lagrangian, constraint)]
    found = euler_lagrange.advice_for_constraints(trees[0], trees[1:], given.coordinates)
    assert words in found["reason"]
