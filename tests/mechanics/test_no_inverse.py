"""Where p = dL/dv is said to have no inverse in closed form, its group is not solvable; else it is not said.

Polynomials whose groups are known: x^5 - x - p and other trinomials have the symmetric group (Serre, Topics in Galois
Theory, 4.4), those of Dickson are solved by radicals for any degree (Dickson 1896), compositions by those of their
parts.
"""

from __future__ import annotations

import pytest

from inverse_service.expressions.printing import to_text
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.mechanics.legendre.short_forms import quotient
from inverse_service.service.documents.documents import solve_document
from inverse_service.service.documents.text_page import text_page
from tests.mechanics.test_legendre import assert_right, transform, tree

TO_VELOCITIES = "H is given in the velocities"


@pytest.mark.parametrize(
    ("text", "coordinates", "degree"),
    [
        ("x'^2/2 + x'^6", "x", 5),
        ("x'^2/2 + x'^8/8", "x", 7),
        ("x'^3/3 + x'^8*exp(x)", "x", 7),
        ("log(x') + x'^6*(1 + x^2)", "x", 6),
        ("x'^2/2 + sqrt(1 + x'^6)", "x", 10),
        ("(x'^2*y'^2 + x'^2 + y'^2)/2", "x y", 5),
        ("a*x'^2/2 - sin(y)*y'^2/2 + x'^3*y'", "x y", 5),
        ("3*x'^2 + sqrt(x'^4 + y'^4)", "x y", 6),
        ("x'^2/2 + y'^2*sqrt(x') + x*x'^(5/2)", "x y", 6),
        ("w'^2/2 + w'*((x'/w')^2 + (x'/w')^6)", "w x", 5),
        ("log(1 + x'^2 + y'^2) - (1 + x'^2 + y'^2)^3", "x y", 7),
    ],
)  # fmt: skip
def test_an_equation_with_a_large_group_is_a_proof(text: str, coordinates: str, degree: int) -> None:
    found = transform(text, coordinates, "a")
    assert found.implicit
    assert f"no inverse in closed form: it leads to an equation of degree {degree} " in found.note
    assert f"A_{degree}" in found.note
    assert TO_VELOCITIES in found.note
    assert_right(found, coordinates.split())


@pytest.mark.parametrize(
    ("text", "coordinates"),
    [
        ("x'*log(x') + x'^2", "x"),
        ("x'*atan(x') - log(1 + x'^2)/2 + x'^2", "x"),
        ("exp(x') + x'^2", "x"),
        ("exp(x')*x'", "x"),
        ("exp(x'^2)", "x"),
        ("sqrt(x')*log(x')", "x"),
        ("x'*log(x') + a*(x' + 1)*log(x' + 1)", "x"),
        ("x'*log(y') + x'^2", "x y"),
        ("x'*log(x') + x'*y'^2", "x y"),
        ("x'^2*log(y')", "x y"),
    ],
)
def test_a_rational_function_beside_logarithms_is_a_proof(text: str, coordinates: str) -> None:
    """Those that have an inverse have it by Lambert's W, which is none of these formulas (Rosenlicht 1969)."""
    found = transform(text, coordinates, "a")
    assert found.implicit
    assert "no inverse in closed form: for one velocity it leads to r(y) + c_1 log(y - a_1)" in found.note
    assert_right(found, coordinates.split())


DICKSON = {
    5: "x'^6/6 - 5*a*x'^4/4 + 5*a^2*x'^2/2",
    7: "x'^8/8 - 7*a*x'^6/6 + 14*a^2*x'^4/4 - 7*a^3*x'^2/2",
}


@pytest.mark.parametrize(
    "text",
    [
        *DICKSON.values(),
        "x'^10/10 + 3*x'^8/8 + x'^6/2 + x'^4/2 + x'^2/2",  # its slope is g(g(v)), g = v^3 + v
        "x'^10",
        "x'^12 + x'^(13/2)",
        "exp(6*x') + exp(x')",
        "x'*log(x') + 5*(x' + 1)*log(x' + 1)",  # its slope is that of log(v (v + 1)^5)
        "exp(x')^7*exp(x')",
        "x'^2*sin(x')",
    ],
)
def test_what_may_have_an_inverse_is_never_said_to_have_none(text: str) -> None:
    assert "no inverse in closed form" not in transform(text, "x", "a").note


def test_relations_among_the_coefficients_are_seen() -> None:
    """With s = sin and c = cos of one angle the Dickson polynomial of degree five: independent they would give S_5."""
    a = "(sin(x)^2 + cos(x)^2)"
    text = f"x'^6/6 - 5*exp(x)*{a}*x'^4/4 + 5*exp(2*x)*x'^2/2"
    assert "no inverse in closed form" not in transform(text, "x").note


@pytest.mark.parametrize(
    "text", ["x'*log(y') + y'*log(z') + z'*log(x')", "2*x'*exp(y)*log(y') - y'*log(z') + z'*log(x')"]
)
def test_velocities_inside_functions_and_outside_are_named_and_nothing_is_claimed(text: str) -> None:
    note = transform(text, "x y z").note
    assert "Of x', y', z' each stands in a function (log) and outside of it" in note
    assert "that there is no closed form is not proven" in note


@pytest.mark.parametrize(
    "text",
    ["x'^2/2 + x'^300", "x'^2 + x'^(1/4093)", "x'^2/2 + x'^4001", "log(1 + x'^4000)"],
)
def test_large_exponents_are_left(text: str) -> None:
    note = transform(text, "x").note
    assert "could not be solved" in note
    assert "outside of it" not in note


def test_a_common_power_is_taken_out_where_the_rest_is_too_large_to_factor() -> None:
    assert to_text(quotient(tree("x' + 4001*x'^4000", ["x"]))) == "x'*(4001*x'^3999 + 1)"


@pytest.mark.parametrize("text", ["-500*x^999/sqrt(1 + x^1000)", "-sqrt(x^1400 + 2*x^700 + 1)"])
def test_a_radicand_that_is_too_large_to_factor_is_undetermined(text: str) -> None:
    result = solve_document({"equations": {"x": text}}, SolveOptions())
    assert result["verdict"] == "undetermined"
    assert "too large to factor" in result["reason"]


def test_an_equation_of_degree_four_is_named() -> None:
    found = transform("x'^2/2 + x'^5/5 + x'^4/4", "x")
    assert found.implicit
    assert "an equation of degree 4, whose roots are not written out" in found.note
    assert_right(found, ["x"])


def test_the_result_and_its_text_say_why_h_is_in_the_velocities() -> None:
    result = solve_document({"equations": {"x": "-x/(1 + x'^4)"}}, SolveOptions())
    assert result["hamiltonian"]["implicit"]
    assert "equation of degree 5" in result["hamiltonian"]["reason"]
    assert result["hamiltonian"]["reason"] in text_page(result, False)
    closed = solve_document({"equations": {"x": "-x"}}, SolveOptions())
    assert closed["hamiltonian"]["reason"] == ""
