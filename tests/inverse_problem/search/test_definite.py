"""Where a positive definite kinetic energy exists it is preferred to a simpler indefinite one."""

from __future__ import annotations

import numpy as np
import pytest

from inverse_service.inverse_problem.search.choice import velocity_degree
from inverse_service.inverse_problem.search.members import best_members, definite_weights
from inverse_service.inverse_problem.search.terms import terms_of
from tests.inverse_problem.search.given import lagrangians, tree

SWAP = np.array([[0.0, 1.0], [1.0, 0.0]])
CHAIN = 2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1)


def total(weights: list, matrices: list) -> np.ndarray:
    return sum(float(w) * m for w, m in zip(weights, matrices, strict=True))


@pytest.mark.parametrize(
    "matrices",
    [
        [SWAP, np.ones((2, 2))],
        [np.diag([1.0, -1.0]), np.diag([3.0, -1.0])],
        [np.linalg.matrix_power(CHAIN, k) - np.linalg.matrix_power(CHAIN, k + 1) for k in range(5)] + [np.eye(6)],
        [np.diag([1e6, 1e-6]) @ m @ np.diag([1e6, 1e-6]) for m in (SWAP, np.eye(2) + SWAP / 2)],
    ],
)
def test_the_weighted_sum_is_positive_definite(matrices: list) -> None:
    found = definite_weights(matrices)
    assert found
    for weights in found:
        assert np.linalg.eigvalsh(total(weights, matrices))[0] > 0
    assert np.count_nonzero(found[-1]) <= np.count_nonzero(found[0])


@pytest.mark.parametrize("matrices", [[], [SWAP], [SWAP, np.diag([1.0, -1.0])], [np.diag([1.0, 0.0])]])
def test_nothing_is_claimed_where_every_sum_is_indefinite_or_singular(matrices: list) -> None:
    assert definite_weights(matrices) == []


@pytest.mark.parametrize(
    ("equations", "terms"),
    [
        (
            {"x": "a+c*sin(y-x)", "y": "b+c*sin(x-y)"},
            "x'*y' c*x'*y' x'^2 y'^2 c*x'^2 c*y'^2 a*x b*y a*y b*x c*a*x c*b*y c*a*y c*b*x c*cos(y-x) c^2*cos(y-x)",
        ),
        (
            {"x": "-a*x-b*y", "y": "-b*x-a*y"},
            "x'*y' x'^2 y'^2 a*x'^2 a*y'^2 a*x^2 a*y^2 a*b*x*y a^2*x^2 a^2*y^2 b*x*y b*x^2 b*y^2 a*x*y",
        ),
    ],
)
def test_kinetic_energies_are_positive_and_without_needless_parameters(equations: dict[str, str], terms: str) -> None:
    best = best_members(lagrangians(equations, terms.split()), 1)[0]
    assert best.definite
    kinetic = {key: value for key, value in best.terms.items() if velocity_degree(key) > 1}
    assert kinetic == terms_of(tree("x'^2/2 + y'^2/2"))


def test_no_terms_are_added_to_a_hessian_that_holds_velocities() -> None:
    """It could be made definite near one velocity only, at the price of a longer Lagrangian."""
    terms = ["x'*log(x')", "y'*log(y')", "x*y'", "y*x'", "x'^2", "x'*y'", "y'^2"]
    found = best_members(lagrangians({"x": "x'*y'", "y": "x'*y'"}, terms), 1)
    assert found
    assert {len(member.terms) for member in found} == {3}
