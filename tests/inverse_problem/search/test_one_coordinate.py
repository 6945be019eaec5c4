"""One coordinate: Lagrangians from last multipliers hold to 40 digits, and only where there are any."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from fractions import Fraction

import mpmath
import pytest

from inverse_service.algebra.real_point import find_real_point
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.evaluation import evaluate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import ONE, TIME, Expression, Symbol, Velocity, negate, power, walk
from inverse_service.inverse_problem.decision.analysis import analyze, variables_of
from inverse_service.inverse_problem.search.completion import completed
from inverse_service.inverse_problem.search.material import Material, gather
from inverse_service.inverse_problem.search.one_coordinate.kinetic import (
    NotElementary,
    Place,
    double_integral,
)
from inverse_service.inverse_problem.search.one_coordinate.last_multiplier import applies, propose
from inverse_service.inverse_problem.search.terms import terms_of
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.inverse_problem.solving import solve
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual, hessian
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse
from tests.inverse_problem.search.forty_digits import defects

X, V = Symbol("x"), Velocity("x")
WITH = {
    "modified Emden": ("-3*x*x'-x^3", ""),
    "modified Emden, symbolic": ("-k*x*x'-k^2*x^3/9", "k"),
    "modified Emden, linear term": ("-3*x*x'-x^3-w^2*x", "w"),
    "modified Emden, any coefficients": ("-b*x*x'-m*x^3", "bm"),
    "exponents -5 and -5/4": ("-5*x*x'-2*x^3", ""),
    "damped oscillator": ("-2*c*x'-w^2*x", "cw"),
    "underdamped": ("-x'-x", ""),
    "overdamped": ("-3*x'-2*x", ""),
    "irrational rates": ("-3*x'-x", ""),
    "critically damped": ("-2*w*x'-w^2*x", "w"),
    "damped with a constant force": ("-g*x'-w^2*x+F", "gwF"),
    "quadratic damping": ("-a*x'^2-b*x", "ab"),
    "quadratic damping, function of x": ("-x'^2/x-x", ""),
    "quadratic and linear damping": ("-x'^2/x-2*x'-x", ""),
    "Lienard with Chiellini's condition": ("-x^2*x'-x^5/4", ""),
    "Chiellini, symbolic": ("-a*exp(x)*x'-b*exp(2*x)", "ab"),
    "Chiellini, circular": ("-cos(x)*x'-sin(x)*cos(x)", ""),
    "Chiellini, hyperbolic": ("-cosh(x)*x'-sinh(x)*cosh(x)", ""),
    "Chiellini, root": ("-x'*sqrt(x)-x^2/3", ""),
    "cubic friction": ("-x'^3", ""),
    "three constant solutions": ("x'*(1-x')*(2-x')", ""),
    "a power of a quadratic": ("-x*(1+x'^2)^2", ""),
    "modified Emden in x + x^3": ("-(3*(x+x^3)*(1+3*x^2)*x'+(x+x^3)^3+6*x*x'^2)/(1+3*x^2)", ""),
    "damped, other coordinate": ("(-2*c*(1+3*x^2)*x'-w^2*(x+x^3)-6*x*x'^2)/(1+3*x^2)", "cw"),
    "damped with exponential factor": ("(-(1+2*x)^2*x'^2-x-x^2-2*x'^2)/(1+2*x)", ""),
    "tangent": ("-x'^2*tan(x)-sin(x)", ""),
    "catenary": ("a*sqrt(1+x'^2)", "a"),
    "a root of a velocity and a force": ("x*(1+x'^2)^(3/2)", ""),
    "friction of any power": ("-k*x'^n", "kn"),
    "Emden and Fowler, any powers": ("k*x^b*x'^c", "kbc"),
    "no velocity, several functions": ("atan(x)-1/tan(x)+sin(x)^2", ""),
}
WITHOUT = {
    "van der Pol": ("-(x^2-1)*x'-x", ""),
    "van der Pol, symbolic": ("m*(1-x^2)*x'-x", "m"),
    "damped pendulum": ("-sin(x)-c*x'", "c"),
    "damped Duffing": ("-x'-x-x^3", ""),
    "Riccati rates": ("-x'^2-x*x'-1", ""),
}
HOSTILE = {
    "many terms": "+".join(f"{k}*x^{k}*x'" for k in range(1, 60)),
    "nested functions": "-sin(exp(x)*cos(x'))*x'-log(1+x^2*exp(sin(x)))*x'^2-x",
    "high powers": "-x^40*x'^7-(1+x^9)*x'^2-x^50*x'-x^60",
    "many functions": "-sin(x)*cos(2*x)*exp(x)*x'-tan(x)*exp(3*x)*sin(5*x)*x'^2-log(x)*sqrt(1+x)",
    "a large denominator": "-x'^2*x^3/(1+x+x^2+x^3+x^5+x^7)-x'*(x^4+1)/(x^6+x+3)-1/(x^11+x+7)",
}


def system_of(force: str, parameters: Sequence[str]) -> SecondOrderSystem:
    return read_system(["x"], {"x": force}, tuple(parameters))


def material_of(force: str, parameters: Sequence[str] = (), with_time: bool = False) -> Material:
    return gather(analyze(system_of(force, parameters)), with_time)


def assert_lagrangian(tree: Expression, system: SecondOrderSystem) -> None:
    """Residual zero and Hessian not zero, at three real points, with 40 digits."""
    residual = euler_lagrange_residual(tree, system.coordinates, system.accelerations)[0]
    second = hessian(tree, system.coordinates)[0][0]
    for seed in (101, 202, 303):
        table = find_real_point([tree, residual, second, *system.accelerations], variables_of(system), seed)
        assert table is not None
        with mpmath.workdps(40):
            size = abs(evaluate(second, table))
            assert size > mpmath.mpf(10) ** -12
            assert abs(evaluate(residual, table)) < mpmath.mpf(10) ** -25 * (1 + size)


@pytest.mark.parametrize(("force", "parameters"), WITH.values(), ids=WITH)
def test_proposals_satisfy_the_euler_lagrange_equation(force: str, parameters: str) -> None:
    found = propose(material_of(force, parameters), 1)
    assert found
    for tree in found:
        assert_lagrangian(tree, system_of(force, parameters))
        assert TIME not in walk(tree)


@pytest.mark.parametrize(("force", "parameters"), WITHOUT.values(), ids=WITHOUT)
def test_no_lagrangian_is_proposed_where_no_multiplier_is_found(force: str, parameters: str) -> None:
    assert propose(material_of(force, parameters), 1) == []


@pytest.mark.parametrize("force", HOSTILE.values(), ids=HOSTILE)
def test_large_systems_are_given_up_in_time(force: str) -> None:
    material = material_of(force)
    began = time.process_time()
    if applies(material):
        for tree in propose(material, 1):
            assert_lagrangian(tree, system_of(force, ()))
    assert time.process_time() - began < 5


@pytest.mark.parametrize(
    ("force", "parameters", "expected"),
    [
        ("-3*x*x'-x^3", "", "1/(x'+x^2)"),
        ("-k*x*x'-k^2*x^3/9", "k", "1/(3*x'+k*x^2)"),
        ("-3*x'-2*x", "", "1/(2*x+x')"),
        ("-2*w*x'-w^2*x", "w", "-log(x'+w*x)"),
        ("-a*x'^2-b*x", "ab", "exp(2*a*x)*(x'^2/2-b*x/(2*a)+b/(4*a^2))"),
    ],
)
def test_the_first_proposal_is_the_simplest(force: str, parameters: str, expected: str) -> None:
    tree = propose(material_of(force, parameters), 1)[0]
    wanted = parse(expected, Names(("x",), tuple(parameters), {}))
    table = find_real_point([tree, wanted], variables_of(system_of(force, parameters)), 5)
    assert table is not None
    with mpmath.workdps(40):
        assert abs(evaluate(tree, table) - evaluate(wanted, table)) < mpmath.mpf(10) ** -35, to_text(tree)


def test_quotients_of_multipliers_are_first_integrals() -> None:
    system = system_of("-5*x*x'-2*x^3", ())
    second = [hessian(tree, ["x"])[0][0] for tree in propose(material_of("-5*x*x'-2*x^3"), 1)]
    assert len(second) > 1
    table = find_real_point(second, variables_of(system), 3)
    assert table is not None
    with mpmath.workdps(40):
        rates = []
        for g in second:
            slope = evaluate(V, table) * evaluate(differentiate(g, X), table)
            slope += evaluate(system.accelerations[0], table) * evaluate(differentiate(g, V), table)
            rates.append(slope / evaluate(g, table))
        assert all(abs(rate - rates[0]) < mpmath.mpf(10) ** -30 for rate in rates)


def test_multipliers_with_time_are_used_where_allowed() -> None:
    force = "-a*x'^2-c*x'"
    system = system_of(force, "ac")
    found = propose(material_of(force, "ac", with_time=True), 1)
    assert found
    for tree in found:
        assert_lagrangian(tree, system)


@pytest.mark.parametrize("equations", [{"x": "-x", "y": "-y"}])
def test_two_coordinates_are_left_to_others(equations: Mapping[str, str]) -> None:
    assert not applies(gather(analyze(read_system(["x", "y"], dict(equations))), False))


QUADRATIC_EXPONENTS = tuple(Fraction(k, 2) for k in (-6, -5, -4, -3, -2, -1, 1, 2))
LINEAR_EXPONENTS = tuple(Fraction(k, 3) for k in (-9, -6, -4, -3, -1, 3))
POWERS = [
    *((base, e) for base in ("x'^2+x*x'+x^2", "x'^2+5*x*x'+x^2", "2-x'^2") for e in QUADRATIC_EXPONENTS),
    *(("3*x'+x^2", e) for e in LINEAR_EXPONENTS),
]


@pytest.mark.parametrize(("base", "exponent"), POWERS)
def test_double_integrals_have_the_second_derivative(base: str, exponent: Fraction) -> None:
    tree = parse(base, Names(("x",), (), {}))
    table = {X: mpmath.mpf("0.9"), V: mpmath.mpf("0.4")}
    integral = double_integral(ONE, [(tree, exponent)], Place(X, V, table))
    with mpmath.workdps(40):
        second = evaluate(differentiate(differentiate(integral, V), V), table)
        assert abs(second - evaluate(power(tree, exponent), table)) < mpmath.mpf(10) ** -30


def test_elliptic_integrals_are_refused() -> None:
    tree = parse("x'^2+x^4", Names(("x",), (), {}))
    with pytest.raises(NotElementary):
        double_integral(ONE, [(tree, Fraction(-3, 4))], Place(X, V, {X: mpmath.mpf(1), V: mpmath.mpf(1)}))


@pytest.mark.parametrize("integrand", ["x*exp(2*a*x)", "a/x+x^3", "sin(x)*cos(x)", "x^2*sin(a*x)", "2*x/(x^2+a)"])
def test_antiderivatives_have_the_derivative(integrand: str) -> None:
    tree = parse(integrand, Names(("x",), ("a",), {}))
    found = completed(["x"], [terms_of(negate(tree))])
    assert found is not None
    table = {X: mpmath.mpf("0.7"), Symbol("a"): mpmath.mpf("1.3")}
    with mpmath.workdps(40):
        assert abs(evaluate(differentiate(found, X), table) - evaluate(tree, table)) < mpmath.mpf(10) ** -35


def test_an_antiderivative_that_is_not_elementary_is_not_found() -> None:
    assert completed(["x"], [terms_of(parse("exp(x^2)", Names(("x",), (), {})))]) is None


@pytest.mark.parametrize(
    ("force", "parameters"), [("-3*x*x'-x^3", ()), ("-2*c*x'-w^2*x", ("c", "w")), ("-a*x'^2-b*x", ("a", "b"))]
)
def test_the_solver_answers_with_a_checked_lagrangian(force: str, parameters: Sequence[str]) -> None:
    answer = solve(system_of(force, parameters), SolveOptions(time_dependent=False)).autonomous
    assert answer is not None
    assert answer.lagrangian is not None
    assert answer.checked == "valid"
    for residual, determinant in defects(system_of(force, parameters), answer.lagrangian):
        assert residual < mpmath.mpf(10) ** -30
        assert determinant > mpmath.mpf(10) ** -12


def test_a_damped_pendulum_needs_the_time() -> None:
    solution = solve(system_of("-sin(x)-c*x'", ("c",)), SolveOptions())
    assert solution.autonomous is not None
    assert solution.autonomous.lagrangian is None
    assert solution.with_time is not None
    assert solution.with_time.lagrangian is not None
    assert_lagrangian(solution.with_time.lagrangian.expression, system_of("-sin(x)-c*x'", ("c",)))
