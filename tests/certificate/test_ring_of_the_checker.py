"""The ring of the checker: numbers, roots and their choices, huge powers, functions, and the use of
balls.
"""

from __future__ import annotations

from functools import reduce
from typing import Any

import pytest

from inverse_service.certificate import member_sets
from inverse_service.certificate.checker import check_certificate
from inverse_service.certificate.question import Question
from tests.certificate.documents import Document, check_result
from tests.certificate.test_known_attacks import certificate, of_lagrangian, result_of
from tests.certificate.test_second_attack import FLAT

ZERO = reduce(
    lambda cosine, _: f"(2*{cosine}^2-1)", range(9), "cos(pi/1024)"
)  # cos(pi/2): too fine for the ring


def verdicts(document: Document, seeds: int) -> set[str]:
    return {check_certificate(document, seed=seed).verdict for seed in range(seeds)}


def times(factor: str, **content: Any) -> Document:
    """The free particle's L for x'' = factor y', which is false if the factor is not 0."""
    return of_lagrangian(f"({factor})*y'", "0", FLAT, **content)


TRUE = [
    "cos(pi/5)-(1+sqrt(5))/4",
    "8*sin(pi/7)*sin(2*pi/7)*sin(3*pi/7)-sqrt(7)+0*sqrt(5)",
    "tan(3*pi/11)+4*sin(2*pi/11)-(11^(1/6))^3",
    "sin(pi/24)^2-(1-cos(pi/12))/2+0*log(5)",
    "sin(pi/2)-1",
    "sqrt(x^2)^2-x^2+0*y^(1/3)",
    "cos(5*atan(x)/2)^2+sin(5*atan(x)/2)^2-1",
    "sin(asin(x/4)/2)-3*sin(asin(x/4)/6)+4*sin(asin(x/4)/6)^3",
    "cos(acos(x/4)/3)-cos(pi/6-asin(x/4)/3)",
    "(tan(atan(x)/2)-(sqrt(1+x^2)-1)/x)*sqrt(sqrt(x)+1)*(x)^(1/5)",
]


@pytest.mark.slow
@pytest.mark.parametrize("zero", TRUE)
def test_parts_of_pi_and_roots_are_the_same_number_for_every_prime(zero: str) -> None:
    assert verdicts(times(f"({zero})*exp(x)", near={"x": "2", "y": "3"}), 4) == {"valid"}


@pytest.mark.parametrize(
    "number",
    [
        "cos(1)-(exp(1)+exp(-1))/2",
        "log(5)^2-5+0*cos(pi/5)*sqrt(5)",
        "cos(pi/5)+1",
        "cos(pi/25)-cos(pi/5)",
    ],
)
def test_numbers_that_have_the_same_prime_are_not_equal(number: str) -> None:
    assert verdicts(times(f"({number})*exp(x)"), 2) == {"invalid"}


def test_a_logarithm_is_not_a_number() -> None:
    assert verdicts(times("log(x)-1", near={"x": "2"}), 1) == {"invalid"}
    assert verdicts(times("log(x)-log(y)", near={"x": "2", "y": "3"}), 1) == {"invalid"}


FEW = {
    "square roots": ["(sqrt({0}^2)-{0})", {"x": "-2", "y": "-3", "x'": "-1"}],
    "fourth roots": ["(({0}^4)^(1/4)-{0})*(({0}^4)^(1/2)+{0}^2)", {"x": "-2"}],
    "cube roots": ["(({0}^3)^(2/3)+{0}*({0}^3)^(1/3)+{0}^2)", {"x": "2", "y": "3"}],
    "roots of roots": ["(sqrt(1+2*sqrt({0})+{0})+1+sqrt({0}))", {"x": "2", "y": "3"}],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FEW)
def test_what_is_zero_for_most_choices_of_the_roots_is_not_zero(name: str) -> None:
    factor, near = FEW[name]
    document = times("*".join(factor.format(name) for name in near), near=near)
    assert verdicts(document, 2) == {"invalid"}


def test_a_power_at_the_bound_is_a_product_and_one_beyond_it_is_not_a_number() -> None:
    assert verdicts(of_lagrangian("x^4096-x^2048*x^2048", "0", FLAT), 1) == {"valid"}
    assert verdicts(of_lagrangian("x^4097", "0", FLAT, near={"x": "1/2"}), 1) == {"invalid"}


def test_no_prime_makes_a_huge_power_a_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """The author knows the prime here; Fermat's little theorem does not apply to generators of the
    ring.
    """
    prime = next(
        one
        for one in range(2**60 + 1, 2**61, 24)
        if all(pow(a, one - 1, one) == 1 for a in (2, 3, 5, 7))
    )
    monkeypatch.setattr(Question, "prime", lambda question: prime)
    assert verdicts(of_lagrangian(f"x^{prime - 1}-1", "0", FLAT, near={"x": "1/2"}), 1) == {
        "invalid"
    }


@pytest.mark.slow
@pytest.mark.parametrize("power", ["x^5000", "x^5000*exp(x)", "1/x*0"])
def test_a_huge_power_of_zero_and_a_pole_have_no_value(power: str) -> None:
    document = of_lagrangian("0", "0", f"{FLAT}+y'*({power}-{power})*exp(y)", near={"x": "0"})
    assert verdicts(document, 1) == {"incomplete"}


def test_a_power_of_zero_has_a_value() -> None:
    assert verdicts(
        of_lagrangian("2*x*exp(x^2)", "0", f"{FLAT}+exp(x^2)", near={"x": "0", "y": "0"}), 1
    ) == {"valid"}


def test_a_hessian_that_is_zero_but_not_seen_to_be_is_not_proven_regular() -> None:
    assert verdicts(of_lagrangian("0", "0", f"{ZERO}*x'^2+y'^2"), 1) == {"incomplete"}


def test_a_function_at_arguments_that_are_equal_but_not_seen_to_be_has_one_value() -> None:
    named = {"parameters": ["a"], "functions": {"A": ["r"]}}
    assert verdicts(of_lagrangian("0", "0", f"(A(a)-A(a+{ZERO}))*x'^2+y'^2", **named), 1) == {
        "incomplete"
    }
    assert verdicts(of_lagrangian("0", "0", f"(A(a)+A(a+{ZERO}))*x'^2+y'^2", **named), 1) == {
        "incomplete"
    }


def test_a_function_has_one_value_at_arguments_that_meet_at_the_place() -> None:
    """The Hessian is singular where a = b and regular nearby."""
    energy = "x'^2/2+(A(a)-A(b))^2*y'^2/2"
    for b, verdict in (("1", "incomplete"), ("2", "valid")):
        near = {"a": "1", "b": b, **dict.fromkeys(("t", "x", "y", "x'", "y'"), "1")}
        named = {"parameters": ["a", "b"], "functions": {"A": ["r"]}, "among": "positive_definite"}
        assert verdicts(of_lagrangian("0", "0", energy, near=near, **named), 4) == {verdict}


def test_derivatives_of_a_function_are_the_same_wherever_they_stand() -> None:
    proof = of_lagrangian(
        "A'(x)*exp(x)+A(x)*exp(x)", "0", f"{FLAT}+A(x)*exp(x)", functions={"A": ["r"]}
    )
    assert check_result(result_of(proof) | {"domain": []}, seed=1).verdict == "valid"


def test_a_logarithm_has_no_value_where_its_argument_is_negative() -> None:
    proof = of_lagrangian("1/x", "0", f"{FLAT}+log(x)", near={"x": "2"})
    assert check_result(result_of(proof) | {"domain": []}, seed=1).verdict == "incomplete"
    stated = proof | {"conditions": ["x > 0"]}
    assert check_result(result_of(stated) | {"domain": ["x > 0"]}, seed=1).verdict == "valid"


def test_a_function_at_zero_is_not_the_same_at_one() -> None:
    document = times("A(x-x)-A(1)+0*exp(x)", functions={"A": ["r"]})
    assert verdicts(document, 1) == {"invalid"}


def test_high_coefficients_of_exponentials_are_computed() -> None:
    """At order six a row that gives no condition leaves a regular multiplier, and the checker
    reports that.
    """
    rows = [["H3", 0, 1, [4, 0, 0, 0]]]
    document = certificate({"x": "y*exp(x)", "y": "sin(x)"}, "nonexistence", order=4, rows=rows)
    assert check_certificate(document, seed=1).reasons == (
        "The rows leave a regular multiplier g(p).",
    )


SLOPES = [
    ("sin(x)", "cos(x)"),
    ("cos(2*x)", "-2*sin(2*x)"),
    ("tan(x)", "1 + tan(x)^2"),
    ("exp(x/3)", "exp(x/3)/3"),
    ("cosh(x)", "sinh(x)"),
    ("x*exp(-x)*sin(x)", "exp(-x)*(sin(x) - x*sin(x) + x*cos(x))"),
    ("x'*sin(x')", "0"),
    ("a*x^2/(1 + x)", "a*(2*x + x^2)/(1 + x)^2"),
]


@pytest.mark.parametrize(("formula", "slope"), SLOPES)
def test_the_ring_of_a_family_has_the_slopes_of_books(formula: str, slope: str) -> None:
    ring = member_sets.Ring(["x"], ["a"], [], {}, 0, float("inf"), with_atoms=True)
    found = ring.by(ring.read(formula), ring.variables.index("x"))
    assert not ring.minus(found, ring.read(slope)).above


def test_a_product_is_a_unit_only_if_all_of_its_factors_are() -> None:
    ring = member_sets.Ring(["x"], ["a", "b"], [], {}, 0, float("inf"))
    a, b = (ring.read(text).above for text in ("a", "b"))
    part = member_sets.Part(ring, (), (a,))
    assert part.is_unit(a)
    assert part.is_unit(3 * a**2)
    assert not part.is_unit(a * b)
    assert not part.is_unit(a - a)
    assert not member_sets.Part(ring, (), (b,)).is_unit(a * b)
    assert member_sets.Part(ring, (), (a, b)).is_unit(a * b)
