"""Numbers such as log(a) and cos(a) can vanish for single values of a: a verdict that divides by
them says that these values are not decided.
"""

from typing import Any

import pytest

from inverse_service import check, solve
from tests.values import slow

UNKNOWN = "single values of a"


def coupled_by(factor: str) -> dict[str, Any]:
    """Uncoupled, with a Lagrangian, where the factor is 0, and without one elsewhere."""
    return {
        "equations": {"x": f"({factor})*y*x'", "y": f"-y+({factor})*x^2"},
        "parameters": ["a"],
        "conditions": False,
        "first_integrals": False,
    }


@pytest.mark.parametrize(
    ("factor", "excepted"),
    [
        ("log(a)", "a = 1"),
        ("cos(a)", UNKNOWN),
        slow("sin(a)", UNKNOWN),  # pi, too, not 0 alone
        ("exp(a)-2", UNKNOWN),
        ("sqrt(a)-2", "a = 4"),  # at points where a has no root modulo the prime, too
        ("erf(a)-1/2", UNKNOWN),
        slow("besselj(0,a)", UNKNOWN),
        slow("lambertw(a)-1", UNKNOWN),
        slow("gammafunction(a)-2", UNKNOWN),
        slow("polygamma(0,a)", UNKNOWN),
        slow("log(a)-2", UNKNOWN),
        slow("2^a-4", UNKNOWN),
    ],
)
def test_a_no_excepts_the_zeros_of_a_function_of_a_parameter(factor: str, excepted: str) -> None:
    result = solve(coupled_by(factor))
    assert result["verdict"] == "not_variational"
    assert excepted in result["exceptions"]


@pytest.mark.parametrize("factor", ["exp(a)", slow("cosh(a)"), slow("2^a"), slow("exp(a)+3")])
def test_a_factor_without_zeros_is_no_exception(factor: str) -> None:
    result = solve(coupled_by(factor))
    assert (result["verdict"], result["exceptions"]) == ("not_variational", [])


def test_the_factor_of_uncoupled_equations_has_a_yes() -> None:
    for value in ("log(1)", "cos(0)-1"):
        document = coupled_by(value) | {"parameters": []}
        assert solve(document)["verdict"] == "variational"


@pytest.mark.parametrize(
    ("force", "excepted"), [("a^x'", "a = 1"), ("x'^log(a)", UNKNOWN), ("x'^cos(a)", UNKNOWN)]
)
def test_a_lagrangian_excepts_values_at_which_it_is_singular(force: str, excepted: str) -> None:
    """a^(-x') + x log(a)^2 is 1 for a = 1, although x'' = 1 has an L."""
    document = {"equations": {"x": force}, "parameters": ["a"], "conditions": False}
    assert excepted in solve({**document, "first_integrals": False})["exceptions"]


def test_a_sentence_names_values_that_are_not_known_next_to_those_that_are() -> None:
    """(x'^2 - x^2) a + (y'^2 - y^2) sin(a) is singular for a = pi, not for a = 0 alone."""
    lagrangian = "(x'^2-x^2)*a+(y'^2-y^2)*sin(a)"
    answer = check({"system": "x''=-x; y''=-y", "lagrangian": lagrangian})
    assert answer["verdict"] == "valid"
    left_out = ", except a = 0, special values of a that are not listed"
    assert left_out in answer["statement"]["text"]


@pytest.mark.parametrize(
    ("force", "value"),
    [
        ("exp(a*y) - exp(5*y)", "5"),
        ("(x'^a - x'^5)*y", "5"),
        slow("sin(a*y) - sin(2*y)", "2"),
        slow("exp((a - 2)*y) - 1", "2"),
        slow("atan(a*y) - atan(3*y)", "3"),
        slow("erf(a*y) - erf(2*y)", "2"),
        slow("sin(log(a*y)) - sin(log(2*y))", "2"),
        slow("(log(a) + y^a - log(7) - y^7)*x'", "7"),
    ],
)
def test_functions_that_agree_for_one_value_of_a_letter_are_excepted(
    force: str, value: str
) -> None:
    """x'' = 0, y'' = -y has a Lagrangian, whether or not a divisor of the proof for general a has a
    factor with a alone.
    """
    document = {"equations": {"x": force, "y": "-y"}, "first_integrals": False}
    result = dict(solve(document | {"parameters": ["a"]}))
    assert result["verdict"] == "not_variational"
    assert {UNKNOWN, f"a = {value}"} & {*result["exceptions"]}
    at = solve(document | {"parameters": {"a": value}})
    assert at["verdict"] == "variational"


@pytest.mark.slow
def test_two_letters_in_exponents_are_excepted_together() -> None:
    """x'' = 1, y'' = x has L = x' y' + x^2/2 + y, where both are 0."""
    document = {"x": "x'^a", "y": "y'^b*x"}
    result = solve({"equations": document, "parameters": ["a", "b"], "first_integrals": False})
    assert result["verdict"] == "not_variational"
    assert result["exceptions"] == ["single values of a, b"]


@pytest.mark.parametrize(
    ("equations", "excepted"),
    [
        slow("x'' = a*x'^n", ["n = 2", "n = 1"]),
        slow("x'' = y^a; y'' = x^n", ["n = -1", "a = -1"]),
        slow("x'' = -x'^a*exp(n*x)", ["n = 0", "a = 2", "a = 1"]),
    ],
)
def test_powers_as_factors_are_excepted_where_their_factors_vanish_alone(
    equations: str, excepted: list[str]
) -> None:
    document = {"equations": equations, "parameters": ["a", "n"], "first_integrals": False}
    assert solve(document)["exceptions"] == excepted


@pytest.mark.slow
def test_what_friction_is_instead_of_has_the_letters_that_it_divides_by_in_its_domain() -> None:
    document = {"equations": "x'' = exp(a*y); y'' = -y'", "parameters": ["a"]}
    result = solve(document)
    assert "a != 0" in result["instead"]["domain"]
    assert check(dict(result))["verdict"] == "valid"
