"""Equations whose solved form would fill pages are answered as they are written, where they are Euler-Lagrange's."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import pytest
import sympy

from inverse_service.certificate.checker import check_certificate
from inverse_service.errors import LimitError
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.service.documents.checking import check_plain
from inverse_service.service.documents.documents import parse_document, solve_document
from inverse_service.service.documents.own_lagrangian import check_lagrangian
from inverse_service.service.documents.text_page import text_page
from inverse_service.sympy.result_objects import result_of


def pendulums_on_a_cart(n: int) -> dict[str, Any]:
    """n links l_k with masses m_k on a cart m_0, by hand from T - V (Goldstein, Classical Mechanics, 1.6)."""
    below = ["(" + "+".join(f"m{j}" for j in range(k, n + 1)) + ")" for k in range(n + 1)]
    links = range(1, n + 1)
    pulls = "".join(f"+{below[k]}*l{k}*(cos(a{k})*a{k}''-sin(a{k})*a{k}'^2)" for k in links)
    equations = [f"{below[0]}*x''{pulls}=0"]
    for i in links:
        coupled = "".join(
            f"+{below[max(i, j)]}*l{i}*l{j}*(cos(a{i}-a{j})*a{j}''+sin(a{i}-a{j})*a{j}'^2)" for j in links
        )
        equations.append(f"{below[i]}*l{i}*(cos(a{i})*x''+g*sin(a{i})){coupled}=0")
    return {
        "coordinates": ["x", *(f"a{k}" for k in links)],
        "equations": equations,
        "parameters": ["g", "m0", *(f"{letter}{k}" for letter in "ml" for k in links)],
    }


def solved(document: dict[str, Any]) -> dict[str, Any]:
    return solve_document(document, SolveOptions(time_limit=60))


@pytest.fixture(scope="module")
def four() -> dict[str, Any]:
    return solved(pendulums_on_a_cart(4))


@pytest.mark.parametrize("n", [3, *(pytest.param(n, marks=pytest.mark.slow) for n in (4, 5))])
def test_pendulums_on_a_cart_with_letters_have_their_own_lagrangian(n: int) -> None:
    found = solved(pendulums_on_a_cart(n))
    assert (found["verdict"], found["verdict_with_time"], found["checked"]) == ("variational", "variational", "valid")
    assert found["lagrangian"]["family"] == "the equations as given"
    assert f"l{n}^2*m{n}*a{n}'^2/2" in found["lagrangian"]["text"]
    assert f"g*l{n}*m{n}*cos(a{n})" in found["lagrangian"]["text"]
    assert check_plain(found)["verdict"] == "valid"


@pytest.mark.slow
def test_the_equations_are_shown_as_they_were_given(four: dict[str, Any]) -> None:
    assert four["system"]["equations"]["x"].startswith("(m0 + m1 + m2 + m3 + m4)*x'' + ")
    assert four["system"]["latex"]["x"].endswith(" = 0")
    assert "  (m0 + m1 + m2 + m3 + m4)*x'' + " in text_page(four, explain=True)
    parsed = parse_document(pendulums_on_a_cart(4))
    assert parsed["equations"]["x"]["text"] == four["system"]["equations"]["x"]


def replaced(key: str, old: str, new: str) -> Callable[[dict[str, Any]], None]:
    return lambda certificate: certificate.update({key: certificate[key].replace(old, new)})


FORGED: dict[str, Callable[[dict[str, Any]], None]] = {
    "another L": replaced("lagrangian", "g*", "2*g*"),
    "an L with an acceleration": lambda it: it.update(lagrangian=it["lagrangian"] + " + x*a1''"),
    "a singular L": lambda it: it.update(
        lagrangian="x'", system=it["system"] | {"equations": dict.fromkeys(it["system"]["coordinates"], "0*x''")}
    ),
    "another equation": lambda it: it["system"]["equations"].update(x=it["system"]["equations"]["x"] + " + a1"),
    "existence": lambda it: it.update(kind="existence"),
    "one of a kind": lambda it: it.update(among="positive_definite"),
    **{
        f"an equation with {wrapped}": lambda it, wrapped=wrapped: it["system"]["equations"].update(
            x=wrapped.replace("E", f"({it['system']['equations']['x']})")
        )
        for wrapped in ("sqrt(E^2)", "(E^2)^(1/2)", "E*E^0", "exp(log(E))", "1/(1/E)", "sqrt((E)*(E))", "(2*E)^1")
    },
    "a condition on accelerations": lambda it: it.update(conditions=["x'' > 0"]),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", FORGED)
def test_a_forged_certificate_about_unsolved_equations_is_refused(four: dict[str, Any], name: str) -> None:
    certificate = copy.deepcopy(four["certificate"])
    assert check_certificate(certificate).verdict == "valid"
    FORGED[name](certificate)
    assert check_certificate(certificate).verdict == "invalid"


def test_the_negative_of_an_equation_says_the_same(four: dict[str, Any]) -> None:
    certificate = copy.deepcopy(four["certificate"])
    own = certificate["system"]["equations"]
    own["x"] = f"-({own['x']})"
    assert check_certificate(certificate).verdict == "valid"


@pytest.mark.slow
def test_unsolved_equations_are_compared_with_the_document(four: dict[str, Any]) -> None:
    other = pendulums_on_a_cart(4)
    other["equations"][2] = other["equations"][2].replace("g*", "2*g*")
    assert check_plain({**four, "system": {**four["system"], "given": other}})["verdict"] == "invalid"


def test_equations_that_are_too_long_and_not_self_adjoint_are_refused_as_before() -> None:
    document = pendulums_on_a_cart(4)
    document["equations"][1] = document["equations"][1].replace("=0", "+g*a1'=0")
    with pytest.raises(LimitError, match="cannot be solved for"):
        solved(document)


@pytest.mark.slow
@pytest.mark.parametrize("change", ["", "-", "g*l1 + "])
def test_an_own_lagrangian_of_unsolved_equations_is_confirmed(four: dict[str, Any], change: str) -> None:
    found = check_lagrangian(pendulums_on_a_cart(4), f"{change}({four['lagrangian']['text']})")
    assert found["verdict"] == "valid"
    assert {part["text"] for part in found["residual"].values()} == {"0"}


@pytest.mark.slow
@pytest.mark.parametrize("change", ["3*", "x'^2 + "])
def test_other_lagrangians_of_unsolved_equations_are_left_open(four: dict[str, Any], change: str) -> None:
    found = check_lagrangian(pendulums_on_a_cart(4), f"{change}({four['lagrangian']['text']})")
    assert (found["verdict"], found["equations"]) == ("incomplete", None)
    assert "too long to be solved for" in found["reasons"][0]
    assert change != "x'^2 + " or found["residual"]["x"]["text"] == "2*x''"


def test_unsolved_equations_are_given_to_sympy_as_equations(four: dict[str, Any]) -> None:
    result = result_of(four)
    x, a1 = (sympy.Function(name)(sympy.Symbol("t")) for name in ("x", "a1"))
    assert [equation.rhs for equation in result.equations.values()] == [0] * 5
    equation = result.equations[x.diff("t", 2)]
    masses = sum(sympy.symbols("m0:5"))
    assert sympy.expand(equation.lhs.coeff(x.diff("t", 2)) - masses) == 0
    assert equation.lhs.has(a1.diff("t", 2))
    with pytest.raises(ValueError, match="too long to be solved for"):
        _ = result.accelerations
