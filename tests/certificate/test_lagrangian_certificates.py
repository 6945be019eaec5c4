"""A Lagrangian is accepted if and only if its regular Euler-Lagrange equations are the system."""

from __future__ import annotations

import pytest

from inverse_service.certificate.checker import check_certificate
from tests.certificate.documents import changed, lagrangian

HENON_HEILES = "(x'^2+y'^2)/2 - (x^2+y^2)/2 - x^2*y + y^3/3"

RIGHT = [
    ("free", "x'^2/2", "autonomous"),
    ("free", "exp(x')", "autonomous"),
    ("free", "x'^2/2 + 3*x*x'", "autonomous"),
    ("free", "x'^2/2 + t^2*x' + 2*t*x", "time_dependent"),
    ("oscillator", "x'^2/2 - x^2/2", "autonomous"),
    ("oscillator", "x'^2/2 - x^2/2", "time_dependent"),
    ("oscillator", "(x'/x)*atan(x'/x) - log(x'^2+x^2)/2", "autonomous"),
    ("oscillator", "0.5*x'^2-0.5*x^2", "autonomous"),
    ("henon-heiles", HENON_HEILES, "autonomous"),
    ("damped-henon-heiles", f"exp(t)*({HENON_HEILES})", "time_dependent"),
    ("painleve-I", "x'^2/2 + 2*x^3 + t*x", "time_dependent"),
    ("spherical-pendulum", "u'^2/2 + sin(u)^2*w'^2/2 + G*cos(u)", "autonomous"),
    ("central-sine", "x'*y' - cos(x*y)*0 + x'^2/2 + y'^2/2 - x'*y' - cos(x*y)", "autonomous"),
]

WRONG = [
    ("free", "x'^2/2 + x^2", "autonomous"),
    ("free", "x'", "autonomous"),
    ("free", "x*x'", "autonomous"),
    ("free", "0", "autonomous"),
    ("free", "t*x'^2", "time_dependent"),
    ("oscillator", "x'^2/2 + x^2/2", "autonomous"),
    ("oscillator", "x'^2 - x^2/2", "autonomous"),
    ("oscillator", "x'^2/2", "autonomous"),
    ("oscillator", "x'^2/2 - x^2/2 + x^9/10^12", "autonomous"),
    ("oscillator", "x'^2/2 - x^2/2 + exp(x)/10^90", "autonomous"),
    ("oscillator", "(x'/x)*atan(x'/x) - log(x'^2+x^2)/3", "autonomous"),
    ("henon-heiles", HENON_HEILES.replace("- x^2*y", "+ x^2*y"), "autonomous"),
    ("henon-heiles", HENON_HEILES.replace(" + y^3/3", ""), "autonomous"),
    ("henon-heiles", HENON_HEILES.replace("y^3/3", "y^3/4"), "autonomous"),
    ("henon-heiles", "x*y' + y*x'", "autonomous"),
    ("henon-heiles", "x'^2/2 - x^2/2 - x^2*y", "autonomous"),
    ("damped-henon-heiles", f"exp(-t)*({HENON_HEILES})", "time_dependent"),
    ("damped-henon-heiles", HENON_HEILES, "autonomous"),
    ("painleve-I", "x'^2/2 + 2*x^3", "time_dependent"),
    ("spherical-pendulum", "u'^2/2 + sin(2*u)^2*w'^2/8 + G*cos(u)", "autonomous"),
    ("central-sine", "x'^2/2 + y'^2/2 + cos(x*y)", "autonomous"),
]


@pytest.mark.parametrize(("name", "text", "question"), RIGHT)
def test_right_lagrangians_are_valid(name: str, text: str, question: str) -> None:
    assert check_certificate(lagrangian(name, text, question), seed=1).verdict == "valid"


@pytest.mark.parametrize(("name", "text", "question"), WRONG)
def test_wrong_lagrangians_are_invalid(name: str, text: str, question: str) -> None:
    assert check_certificate(lagrangian(name, text, question), seed=1).verdict == "invalid"


def test_generic_functions_may_stand_in_the_lagrangian() -> None:
    document = lagrangian("free", "x'^2/2 + A'(x)*x'", question="autonomous")
    document["system"]["functions"] = {"A": ["x"]}
    assert check_certificate(document, seed=1).verdict == "valid"
    assert (
        check_certificate(changed(document, "lagrangian", "x'^2/2 + A'(x)"), seed=1).verdict
        == "invalid"
    )


def test_derivatives_of_one_function_belong_together() -> None:
    equations = {"x": "-diff(V(x, y), x)", "y": "-diff(V(x, y), y)"}
    document = lagrangian("henon-heiles", "(x'^2 + y'^2)/2 - V(x, y)")
    document["system"] |= {"equations": equations, "functions": {"V": ["x", "y"]}}
    assert check_certificate(document, seed=1).verdict == "valid"
    assert (
        check_certificate(
            changed(document, "lagrangian", "(x'^2+y'^2)/2 - V(y, x)"), seed=1
        ).verdict
        == "invalid"
    )
    assert (
        check_certificate(
            changed(document, "lagrangian", "(x'^2+y'^2)/2 + V(x, y)"), seed=1
        ).verdict
        == "invalid"
    )


def test_one_function_at_two_arguments_is_not_one_number() -> None:
    document = lagrangian("oscillator", "x'^2/2 + A(x)")
    document["system"] |= {"equations": {"x": "A'(2*x)"}, "functions": {"A": ["x"]}}
    assert check_certificate(document, seed=1).verdict == "invalid"
    assert (
        check_certificate(changed(document, "lagrangian", "x'^2/2 + A(2*x)/2"), seed=1).verdict
        == "valid"
    )


@pytest.mark.parametrize(
    "text",
    [
        "x'^2/2 - x^2/2 + z",
        "x''",
        "x'^2/2 - x^2/2 + A(x)",
        "x'^2/2 - x^2/2 + q(x)",
        "",
        "x'^2/2 - x^2/2)",
    ],
)
def test_a_lagrangian_uses_no_name_but_those_of_the_system(text: str) -> None:
    assert check_certificate(lagrangian("oscillator", text), seed=1).verdict == "invalid"


def test_time_in_the_lagrangian_needs_the_question_with_time() -> None:
    text = "x'^2/2 + t^2*x' + 2*t*x"
    assert check_certificate(lagrangian("free", text, "autonomous"), seed=1).verdict == "invalid"
    assert (
        check_certificate(lagrangian("painleve-I", "x'^2/2", "autonomous"), seed=1).verdict
        == "invalid"
    )


def test_a_narrow_domain_is_found_by_the_point_that_the_certificate_names() -> None:
    document = lagrangian("free", "sqrt(x' - 100) + log(101 - x')")
    assert check_certificate(document, seed=1).verdict == "incomplete"
    assert check_certificate({**document, "near": {"x'": "100.5"}}, seed=1).verdict == "valid"


@pytest.mark.slow
def test_a_lagrangian_that_is_nowhere_defined_is_incomplete() -> None:
    for text in (
        "x'^2/(x - x)",
        "x'^2*sqrt(-1 - x^2)",
        "log(-exp(x))*x'^2",
        "x'^2/(sin(x)^2+cos(x)^2-1)",
    ):
        assert check_certificate(lagrangian("free", text), seed=1).verdict == "incomplete"


def unsolved(equation: str, text: str = "x'^2/2 - x^2/2", **content: object) -> str:
    document = lagrangian("oscillator", text)
    document["system"] = {"coordinates": ["x"], "equations": {"x": equation}}
    found = check_certificate({**document, **content}, seed=1)
    return " ".join([found.verdict, *found.reasons])


@pytest.mark.parametrize("equation", ["x''+x", "-x''-x", "1*(x''+x)", "-(x''+x)"])
def test_equations_that_are_not_solved_are_those_of_the_lagrangian(equation: str) -> None:
    assert unsolved(equation).startswith("valid")


SIGNED = ["x/-x''", "x/+-(x'')", "2^-x''"]


@pytest.mark.parametrize(
    "equation",
    [
        "1/(x''+x)",
        "sqrt(x''+x)",
        "(x''+x)^2",
        "x''^2+x",
        "log(x'')+x",
        "x^(x'')",
        "2/x''*x",
        *SIGNED,
    ],
)
def test_accelerations_in_formulas_that_have_not_all_values_are_refused(equation: str) -> None:
    assert "Accelerations may occur in" in unsolved(equation)


def test_accelerations_stand_in_equations_and_in_nothing_else() -> None:
    assert "contains accelerations" in unsolved("x''+x", "x'^2/2 - x^2/2 + 0*x''")
    assert "does not hold" in unsolved("x''+x+x", "x'^2/2 - x^2/2")
    assert "The set" in unsolved("x''+x", conditions=["x'' > 0"], near={"x''": "1"})
    rows = [["H2", 0, 0, [0, 0]]]
    for kind in ({"kind": "nonexistence", "claim": "not_variational", "order": 1, "rows": rows},
                 {"kind": "lagrangian", "among": "natural"}):  # fmt: skip
        assert "proven variational by an" in unsolved("x''+x", **kind)
