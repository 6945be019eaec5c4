"""Stiff convex potentials run at any step, because the root is proved unique; all others are refused or said."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.problems import PENDULUM, problem, read
from inverse_service.kernels.codegen.symengine_trees import names_of, translate
from inverse_service.simulation.execution import MONOTONE, NO_GUARD, run
from inverse_service.simulation.scene_data import Grid, MethodChoice, Start
from inverse_service.simulation.schemes import Sign, sign_of

CONVEX = problem(
    "u",
    lagrangian="1/2*u'^2 - k*u^2/2 - u^4/4",
    free="1/2*u'^2 - k*u^2/2 - u^4/4",
    hamiltonian="p_u^2/2 + k*u^2/2 + u^4/4",
    parameters="k",
)
SPRINGS = problem(
    "u w",
    free="1/2*(u'^2 + w'^2) - k*u^4 - k*w^4 - (u - w)^4",
    hamiltonian="1/2*(p_u^2 + p_w^2) + k*u^4 + k*w^4 + (u - w)^4",
    parameters="k",
)
CHOICES = [
    MethodChoice("variational", 0.5),
    MethodChoice("variational", 1 / 3),
    MethodChoice("variational", 0.5, form="raw"),
    MethodChoice("variational", 0.5, order=4),
    MethodChoice("nonholonomic", 0.5),
]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 + u^2", Sign(1, True)),
        ("u^2", Sign(1, False)),
        ("-3 - k*u^4", Sign(-1, True)),
        ("1 + m*u^2", None),
        ("1 + u", None),
        ("1 + cos(u)", None),
        ("exp(u) + cosh(u)", Sign(1, True)),
        ("1/(1 + u^2)", Sign(1, True)),
        ("1/u^2", None),
        ("1 - 2*k", Sign(-1, True)),
        ("sqrt(1 + u^2)", Sign(1, True)),
        ("(1 + u^2)^3", Sign(1, True)),
        ("u^3", None),
    ],
)
def test_a_sign_is_claimed_only_where_the_formula_shows_it(text: str, expected: Sign | None) -> None:
    formula = translate(read(text, ("u",), ("k", "m")), names_of(("u",), ("k", "m")))
    assert sign_of(formula, {"c0": 2.0, "c1": -1.0}) == expected


@pytest.mark.slow
@pytest.mark.parametrize("choice", CHOICES, ids=str)
def test_convex_potentials_run_at_any_step(choice: MethodChoice) -> None:
    # At alpha other than 1/2 the scheme itself grows without bound at such a step: five steps are enough there.
    grid = Grid(0.1, 200 if choice.alpha == 0.5 else 5)
    found = run(CONVEX, choice, Start((50.0,), (0.0,)), grid, {"k": 1e6})
    assert found.outcome.completed
    assert found.outcome.note == MONOTONE


def test_the_root_taken_at_a_huge_step_is_the_midpoint_rules() -> None:
    found = run(CONVEX, MethodChoice("variational", 0.5), Start((50.0,), (0.0,)), Grid(0.1, 200), {"k": 1e6})
    assert found.momenta is not None
    q, p = found.positions[:, 0], found.momenta[:, 0]
    place, pull = (q[1:] + q[:-1]) / 2, (p[1:] - p[:-1]) / 0.1
    np.testing.assert_allclose(pull, -1e6 * place - place**3, rtol=1e-9, atol=1e-3)
    np.testing.assert_allclose((q[1:] - q[:-1]) / 0.1, (p[1:] + p[:-1]) / 2, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("choice", CHOICES, ids=str)
def test_the_same_potential_upside_down_is_refused(choice: MethodChoice) -> None:
    found = run(CONVEX, choice, Start((50.0,), (0.0,)), Grid(0.1, 200), {"k": -1e6})
    assert found.outcome.kind == "guard"
    assert "guard = false" in (found.outcome.remedy or "")


def test_what_is_not_one_equation_is_not_proved() -> None:
    found = run(SPRINGS, MethodChoice("variational", 0.5), Start((1.0, 2.0), (0.0, 0.0)), Grid(1.0, 10), {"k": 1e4})
    assert found.outcome.kind == "guard"


def test_without_the_guard_the_outcome_says_so() -> None:
    choice = MethodChoice("variational", 0.5, guard=False)
    stiff = run(PENDULUM, choice, Start((0.5,), (0.3,)), Grid(0.1, 400), {"k": 1e4})
    assert stiff.outcome.note == NO_GUARD
    assert stiff.outcome.kind in ("singular", "no_convergence")
    soft = run(PENDULUM, choice, Start((0.5,), (0.3,)), Grid(0.1, 400), {"k": 1.0})
    assert soft.outcome.completed
    assert soft.outcome.note == NO_GUARD
    plain = run(PENDULUM, MethodChoice("variational", 0.5), Start((0.5,), (0.3,)), Grid(0.1, 400), {"k": 1.0})
    assert plain.outcome.note == ""
    np.testing.assert_array_equal(plain.positions, soft.positions)
