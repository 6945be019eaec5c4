"""A Lagrangian alone gives its equations, momenta, energy, and conserved quantities."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from inverse_service import InputError, check, solve
from tests.doors.judge import same_formula

DOCUMENTS: list[tuple[dict[str, Any], dict[str, str], str | None, set[str]]] = [
    (
        {"lagrangian": "m/2*(r'^2 + r^2*phi'^2) + mu/r", "parameters": ["m", "mu"]},
        {"r": "-mu/(m*r^2) + r*phi'^2", "phi": "-2*phi'*r'/r"},
        "p_phi^2/(2*m*r^2) + p_r^2/(2*m) - mu/r",
        {"momentum of phi", "energy"},
    ),
    ({"lagrangian": "x'^2/2 - x*cos(t)"}, {"x": "-cos(t)"}, "p_x^2/2 + x*cos(t)", set()),
    (
        {"lagrangian": "x'^2/2 + y'^2/2 - V + diff(V, t)", "coordinates": ["x", "y"], "where": {"V": "x^4"}},
        {"x": "-4*x^3", "y": "0"},
        None,
        {"momentum of y"},
    ),
    (
        {"lagrangian": "v^2/2 - V", "coordinates": ["x"], "where": {"v": "x'", "V": "x^4"}},
        {"x": "-4*x^3"},
        None,
        {"energy"},
    ),
    ({"equations": "2L = x'^2 + x^2"}, {"x": "x"}, "p_x^2/2 - x^2/2", {"energy"}),
    ({"lagrangian": "1/x'"}, {"x": "0"}, "-2*sqrt(-p_x)", set()),
    ({"lagrangian": "x'^3/3"}, {"x": "0"}, "2*p_x^(3/2)/3", set()),
    ({"lagrangian": "-sqrt(1 - x'^2)"}, {"x": "0"}, "sqrt(p_x^2 + 1)", set()),
]  # fmt: skip


@pytest.mark.parametrize(("document", "equations", "hamiltonian", "conserved"), DOCUMENTS)
def test_a_lagrangian_has_its_equations(
    document: dict[str, Any],
    equations: dict[str, str],
    hamiltonian: str | None,
    conserved: set[str],
) -> None:
    found = solve(document)
    assert found["format"] == "inverse-service/forward/1"
    names = list(equations)
    for name, text in equations.items():
        assert same_formula(found["equations"][name]["text"], text, names)
    if hamiltonian is not None:
        assert same_formula(
            found["hamiltonian"]["text"].replace("sqrt(-", "sqrt("),
            hamiltonian.replace("sqrt(-", "sqrt("),
        )
    assert conserved <= {part["name"] for part in found["conserved"]}


@pytest.mark.parametrize(
    ("lagrangian", "domain"),
    [
        ("1/x'", ["x' > 0", "p_x < 0"]),
        ("abs(x')^3", ["x' > 0", "p_x > 0"]),
        ("-sqrt(1 - x'^2)", []),
    ],
)
def test_a_hamiltonian_says_on_which_branch_it_holds(lagrangian: str, domain: list[str]) -> None:
    assert solve({"lagrangian": lagrangian})["hamiltonian"]["domain"] == domain


@pytest.mark.parametrize(
    ("document", "word"),
    [
        ({"lagrangian": "x*y' - y*x'"}, "singular"),
        ({"lagrangian": "x'^2/2 + a", "coordinates": ["x"], "where": {"a": "x''"}}, "acceleration"),
        ({"coordinates": [f"y{k}" for k in range(257)], "lagrangian": "y0'^2"}, "256"),
        (
            {"coordinates": ["x"], "lagrangian": "x'^2/2 - piecewise((x, x > 0), (0, true))"},
            "piece",
        ),
    ],
)
def test_a_lagrangian_without_equations_is_rejected(document: dict[str, Any], word: str) -> None:
    with pytest.raises(InputError, match=word):
        solve(document)


def test_a_forward_answer_claims_no_verdict() -> None:
    found = solve({"lagrangian": "x'^2/2 - x^2/2"})
    assert check(found)["verdict"] == "incomplete"
    assert check({**found, "verdict": "variational"})["verdict"] == "invalid"


def test_an_acceleration_has_one_denominator() -> None:
    found = solve(
        "L = ((M + m)*x'^2 + 2*m*l*x'*a'*cos(a) + m*l^2*a'^2)/2 + m*g*l*cos(a)", parameters="guess"
    )
    assert all(part["text"].count("/") == 1 for part in found["equations"].values())


@pytest.mark.slow
def test_two_hundred_masses_get_their_equations() -> None:
    names = [f"x{k}" for k in range(1, 201)]
    kinetic = "+".join(f"m*{x}'^2/2" for x in names)
    springs = "+".join(f"k*({b}-{a})^2/2" for a, b in itertools.pairwise(names))
    result = solve(
        {"coordinates": names, "parameters": ["m", "k"], "lagrangian": f"{kinetic}-({springs})"}
    )
    assert same_formula(result["equations"]["x1"]["text"], "-k*x1/m + k*x2/m")
    assert same_formula(result["equations"]["x100"]["text"], "(-2*k*x100 + k*x101 + k*x99)/m")
    assert not result["hamiltonian"]["implicit"]
