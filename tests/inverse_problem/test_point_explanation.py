"""Conditions in numbers at one point: the numbers are those of the formulas, the point is real, the argument closes."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest

from inverse_service import catalogue
from inverse_service.expressions.evaluation import evaluate
from inverse_service.expressions.tree import Apply, Expression
from inverse_service.inverse_problem.decision.analysis import Analysis, analyze
from inverse_service.inverse_problem.explanation.hierarchy import smallest_sufficient_set
from inverse_service.inverse_problem.explanation.negative import entry_symbols, explain_negative
from inverse_service.inverse_problem.explanation.numbers_at_a_point import has_points, is_real, numbers_at_a_point
from inverse_service.inverse_problem.explanation.point_explanation import steps_in_numbers
from inverse_service.mechanics.conditions import conditions
from inverse_service.mechanics.reading import read_system

LONG = ["poynting-robertson", "pendulum-on-viscous-cart", "generic-class-with-potential-first"]


def analysis_of(name: str) -> Analysis:
    document = catalogue.document(name)
    return analyze(
        read_system(
            document["coordinates"], document["equations"], document.get("parameters", ()), document.get("functions")
        )
    )


@pytest.mark.parametrize("name", LONG)
def test_long_conditions_are_settled_in_numbers(name: str) -> None:
    analysis = analysis_of(name)
    found = explain_negative(analysis, smallest_sufficient_set(analysis))
    assert found.complete
    assert "take one point" in found.steps[1].text
    assert "have the solution" in found.steps[-2].text


@pytest.mark.parametrize("name", ["inclined-knife-edge-first", "pendulum-on-viscous-cart"])
def test_the_numbers_are_those_of_the_formulas(name: str) -> None:
    analysis = analysis_of(name)
    chosen = smallest_sufficient_set(analysis)
    assert chosen is not None
    numbers = numbers_at_a_point(analysis, chosen)
    tensors = conditions(analysis.system)
    assert numbers is not None
    assert tensors.Phi is not None
    table: dict[Expression, mpmath.mpf] = {
        name: mpmath.mpf(value.numerator) / value.denominator for name, value in numbers.variables.items()
    }
    for atom, value in numbers.atoms.items():
        if isinstance(atom, Apply) and atom.function == "sin":
            other = numbers.atoms.get(Apply("cos", atom.argument))
            cosine = mpmath.mpf(other.numerator) / other.denominator if other is not None else None
            sine = mpmath.mpf(value.numerator) / value.denominator
            table[atom.argument] = mpmath.atan2(sine, cosine if cosine is not None else mpmath.sqrt(1 - sine**2))
    with mpmath.workdps(40):
        matrix = next(m for condition, m in numbers.tensors.items() if condition.name == "Phi")
        for row, exact_row in zip(matrix, tensors.Phi, strict=True):
            for entry, exact in zip(row, exact_row, strict=True):
                assert abs(evaluate(exact, table) - mpmath.mpf(entry.numerator) / entry.denominator) < 1e-12


def test_roots_are_rational_at_the_point() -> None:
    analysis = analysis_of("poynting-robertson")
    chosen = smallest_sufficient_set(analysis)
    assert chosen is not None
    numbers = numbers_at_a_point(analysis, chosen)
    assert numbers is not None
    x, y = (value for name, value in numbers.variables.items() if str(name) in ("Symbol(name='x')", "Symbol(name='y')"))
    (root,) = numbers.atoms.values()
    assert root**2 == (x**2 + y**2) ** 3
    assert isinstance(root, Fraction)


def test_numbers_need_no_real_point_where_functions_are_independent() -> None:
    """x stands both bare and in log(x): free values of the two are those of no real point, and prove as much."""
    system = read_system(["x", "y"], {"x": "y*log(x)+x'", "y": "-x'*y*x"})
    analysis = analyze(system)
    chosen = smallest_sufficient_set(analysis)
    assert chosen is not None
    numbers = numbers_at_a_point(analysis, chosen)
    assert numbers is not None
    assert not numbers.real
    steps = [step.text for step in steps_in_numbers(system, chosen, entry_symbols(system), numbers)]
    assert "No real point need have these values" in steps[1]
    assert steps[-1].startswith("So g = 0")


def test_velocities_are_chosen_so_that_roots_come_out() -> None:
    f = "(1 - {0}'^2)^(3/2)*({1}) - {0}'"
    forces = {"u": "v - 2*w", "v": "u", "w": "w^2 - 2*u"}
    system = read_system(list(forces), {name: f.format(name, force) for name, force in forces.items()})
    found = explain_negative(analyze(system), smallest_sufficient_set(analyze(system)))
    assert found.complete


@pytest.mark.parametrize("equations", [{"x": "x*y'", "y": "pi*x"}, {"x": "x*y'", "y": "sin(1)*x"}])
def test_numbers_such_as_pi_get_no_value(equations: dict[str, str]) -> None:
    assert not has_points(analyze(read_system(["x", "y"], equations)))


@pytest.mark.parametrize(
    ("f", "real"),
    [("sin(x) + cos(x - y)", True), ("sin(x) + exp(y)", True), ("sin(x) + exp(x)", False), ("sin(x) + x", False),
     ("sin(x)*cos(y)*sin(x^2)", False), ("log(x)", False), ("sin(x) + cos(2*x) + y", True),
     ("exp(x) - exp(x + 2)", False)],
)  # fmt: skip
def test_a_point_is_real_where_the_arguments_can_be_chosen(f: str, real: bool) -> None:
    assert is_real(analyze(read_system(["x", "y"], {"x": f, "y": "0"}))) is real


def closing(equations: dict[str, str]) -> str:
    system = read_system(list(equations), equations)
    analysis = analyze(system)
    chosen = smallest_sufficient_set(analysis)
    assert chosen is not None
    numbers = numbers_at_a_point(analysis, chosen)
    assert numbers is not None
    return steps_in_numbers(system, chosen, entry_symbols(system), numbers)[-1].text


def test_a_determinant_that_vanishes_at_a_point_is_not_said_to_vanish_because_of_a_minor() -> None:
    """diag(1, e) is singular at the one point with e = 0; only g = 0 follows from minors of one point."""
    ring = closing({"x": "sin(y-x)", "y": "sin(z-y)", "z": "sin(x-z)"})
    assert "whatever" in ring
    assert "at random points" in ring
    assert "minor" not in ring
    nothing = closing({"x": "y'-x'-x", "y": "-x'-y'-4*y"})
    assert nothing.startswith("So g = 0. ")
    assert "minor" in nothing
