"""Systems of ten and twelve coordinates are answered with a Lagrangian that the checker accepts."""

from __future__ import annotations

import random
from itertools import combinations

import pytest

from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.checking import check_plain
from inverse_service.service.documents.documents import solve_document


def toda(n: int) -> dict[str, str]:
    """Exponential springs between neighbors (Toda 1967), free ends."""
    forces = {}
    for k in range(1, n + 1):
        left = f"exp(q{k - 1} - q{k})" if k > 1 else "0"
        right = f"exp(q{k} - q{k + 1})" if k < n else "0"
        forces[f"q{k}"] = f"{left} - {right}"
    return forces


def natural(n: int) -> dict[str, str]:
    """x_i'' = -dV/dx_i with V a sum of a_ij x_i^2 x_j^2 over all pairs."""
    generator = random.Random(5)
    weight = {pair: generator.randint(1, 5) for pair in combinations(range(n), 2)}
    return {
        f"x{i}": " - ".join(["0", *(f"2*{a}*x{i}*x{j + k - i}^2" for (j, k), a in weight.items() if i in (j, k))])
        for i in range(n)
    }


@pytest.mark.slow
def test_a_toda_chain_of_twelve_and_a_coupled_potential_of_ten_coordinates_are_variational() -> None:
    for equations in (toda(12), natural(10)):
        found = solve_document({"equations": equations}, SolveOptions(time_limit=60))
        assert (found["verdict"], found["verdict_with_time"], found["checked"]) == ("variational",) * 2 + ("valid",)
        assert check_plain(found)["verdict"] == "valid"
