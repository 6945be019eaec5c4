"""Phi, nabla Phi and R against their definitions, worked out slowly by SymPy and by hand."""

from __future__ import annotations

import os
import random
from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest

# python-flint would otherwise change SymPy's ground types, which breaks some of its functions.
os.environ.setdefault("SYMPY_GROUND_TYPES", "python")
import sympy

from inverse_service.algebra.rational_functions import Budget, Quotient
from inverse_service.catalogue import document, names
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    PI,
    TIME,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    number,
)
from inverse_service.mechanics.conditions import (
    Motion,
    Tensors,
    conditions,
    connection,
    curvature,
    jacobi_endomorphism,
    motion_in_ring,
    nabla,
)
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem


def system(equations: dict[str, str], parameters: tuple[str, ...] = (), **functions: list[str]) -> SecondOrderSystem:
    return read_system(list(equations), equations, list(parameters), functions)


def catalogue_system(name: str) -> SecondOrderSystem:
    found = document(name)
    parameters = found.get("parameters", [])
    return read_system(found["coordinates"], found["equations"], list(parameters), found.get("functions", {}))


PLACES = sympy.symbols("w0 w1")
SHAPES = {
    "A": sympy.exp(PLACES[0]) + PLACES[0] ** 3,
    "B": sympy.exp(PLACES[0] * PLACES[1]) + PLACES[1] ** 3,
}


def to_sympy(tree: Expression, table: dict[Expression, Any]) -> Any:
    """The tree in SymPy, definite functions (SHAPES) standing for the arbitrary ones."""
    match tree:
        case Number(value):
            return sympy.Rational(value.numerator, value.denominator)
        case Sum(terms):
            return sympy.Add(*(to_sympy(term, table) for term in terms))
        case Product(factors):
            return sympy.Mul(*(to_sympy(factor, table) for factor in factors))
        case Power(base, exponent):
            return sympy.Pow(to_sympy(base, table), to_sympy(exponent, table))
        case Apply(function, argument):
            return getattr(sympy, function)(to_sympy(argument, table))
        case Arbitrary(name, arguments, orders):
            slope = SHAPES[name]
            for place, order in zip(PLACES, orders, strict=False):
                slope = sympy.diff(slope, place, order) if order else slope
            values = [to_sympy(argument, table) for argument in arguments]
            return slope.subs(list(zip(PLACES, values, strict=False)), simultaneous=True)
    return table[tree]


def symbol_table(given: SecondOrderSystem) -> dict[Expression, Any]:
    table: dict[Expression, Any] = {TIME: sympy.Symbol("t"), PI: sympy.pi}
    for name in given.coordinates:
        table[Symbol(name)], table[Velocity(name)] = sympy.Symbol(f"q_{name}"), sympy.Symbol(f"v_{name}")
    for name in given.parameters:
        table[Symbol(name)] = sympy.Symbol(f"c_{name}")
    return table


def plain_tensors(given: SecondOrderSystem, table: dict[Expression, Any]) -> tuple[Any, Any, list[Any]]:
    """Phi, nabla Phi and R by their definitions in SymPy, nothing simplified."""
    n = len(given.coordinates)
    q = [table[Symbol(name)] for name in given.coordinates]
    v = [table[Velocity(name)] for name in given.coordinates]
    f = [to_sympy(tree, table) for tree in given.accelerations]

    def gamma(u: Any) -> Any:
        return u.diff(table[TIME]) + sum(v[i] * u.diff(q[i]) + f[i] * u.diff(v[i]) for i in range(n))

    slopes = sympy.Matrix(n, n, lambda i, j: sympy.diff(f[i], v[j]))
    phi = slopes.applyfunc(gamma) - 2 * sympy.Matrix(n, n, lambda i, j: sympy.diff(f[i], q[j])) - slopes * slopes / 2
    nabla_phi = phi.applyfunc(gamma) - slopes * phi / 2 + phi * slopes / 2
    bend = [phi[j, k].diff(v[m]) - phi[j, m].diff(v[k]) for j in range(n) for k in range(n) for m in range(n)]
    return phi, nabla_phi, bend


def largest_difference(given: SecondOrderSystem, found: Tensors, seed: int = 1) -> float:
    """The largest relative difference from the plain tensors at a point between 1/10 and 1/2."""
    table = symbol_table(given)
    phi, nabla_phi, bend = plain_tensors(given, table)
    assert found.Phi is not None
    assert found.nabla_Phi is not None
    assert found.R is not None
    trees = [entry for matrix in (found.Phi, found.nabla_Phi, *found.R) for row in matrix for entry in row]
    plain = [*phi, *nabla_phi, *bend]
    assert len(trees) == len(plain)
    source = random.Random(seed)
    point = {symbol: sympy.Rational(source.randint(101, 499), 997) for symbol in table.values() if symbol.is_Symbol}

    def value(expression: Any) -> complex:
        return complex(sympy.N(expression.subs(point), 40))

    worst = 0.0
    for tree, expected in zip(trees, plain, strict=True):
        left, right = value(to_sympy(tree, table)), value(sympy.sympify(expected))
        assert left == left
        assert right == right
        worst = max(worst, abs(left - right) / (1 + abs(right)))
    return worst


EXAMPLES = {
    "rational": system({"x": "x*y'/(1+x^2)", "y": "(x'^2+y)/(x-y')", "z": "z'*x'/(x+z)"}),
    "circular": system({"x": "sin(2x+y)*x' + cos(x)*cos(y)", "y": "tan(x)*y'^2 + sec(y)"}),
    "tangent only": system({"x": "tan(x+y)*x'", "y": "cot(x)*tan(y)*y'^2"}),
    "exponential": system({"x": "exp(x+y)*y' + cosh(x/2)", "y": "exp(2x)/(1+exp(y)) + tanh(x)*y'"}),
    "hyperbolic": system({"x": "sinh(x)*cosh(y)*tanh(x+y)*x'", "y": "coth(x)*y' + sech(y)"}),
    "roots": system({"x": "sqrt(x*y)*x' + x^(1/3)*y' + sqrt(x)", "y": "sqrt(x/y)*y'^2 + (1+sqrt(x))^(-3/2)"}),
    "logarithms": system({"x": "log(x*y)*y' + log(x)", "y": "x^a*x' + log(2*x^2) + y'^x"}, ("a",)),
    "inverse": system({"x": "asin(x)*y' + atan(y/x) + acos(x')", "y": "asinh(x)*y + acosh(y+3)*x' + atanh(x*y)"}),
    "time": system({"x": "t^2*x' + sin(t*y)", "y": "exp(-t)*y'*x"}),
    "nested": system({"x": "exp(sin(x))*y'^2", "y": "1/(2 + sin(x+y) + exp(sin(x)/2))"}),
    "arbitrary": system({"x": "A(y)*x'*y'", "y": "A'(y)*x + B(x,y)*y'^2"}, A=["y"], B=["x", "y"]),
    "number pi": system({"x": "sin(x + pi/2)*x' + cos(pi/3)*y", "y": "sqrt(2)*x'^2/(1 + sqrt(2)*y)"}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_the_tensors_are_those_of_the_definitions(name: str) -> None:
    found = conditions(EXAMPLES[name])
    assert found.reason == ""
    assert largest_difference(EXAMPLES[name], found) < 1e-12


def test_the_comparison_sees_a_wrong_entry() -> None:
    found = conditions(EXAMPLES["circular"])
    assert found.Phi is not None
    wrong = replace(found, Phi=((add(found.Phi[0][0], number(Fraction(1, 10**6))), found.Phi[0][1]), found.Phi[1]))
    assert largest_difference(EXAMPLES["circular"], wrong) > 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("name", ["double-pendulum", "hill-lunar", "knife-edge-first", "free-particle-a-exp-first"])
def test_systems_of_the_catalogue_have_the_tensors_of_the_definitions(name: str) -> None:
    given = catalogue_system(name)
    assert largest_difference(given, conditions(given), seed=5) < 1e-12


@pytest.mark.slow
def test_every_system_of_the_catalogue_has_its_tensors() -> None:
    left_out = {name: conditions(catalogue_system(name), time_limit=20).reason for name in names()}
    assert {name: reason for name, reason in left_out.items() if reason} == {}


def texts(matrix: Any) -> list[list[str]]:
    return [[to_text(entry) for entry in row] for row in matrix]


def test_phi_of_a_linear_force_is_twice_its_matrix() -> None:
    found = conditions(system({"x": "-a*x - b*y", "y": "-c*x - d*y"}, ("a", "b", "c", "d")))
    assert texts(found.Phi) == [["2*a", "2*b"], ["2*c", "2*d"]]
    assert texts(found.N) == [["0", "0"], ["0", "0"]]
    assert texts(found.nabla_Phi) == [["0", "0"], ["0", "0"]]


def test_phi_of_a_damped_oscillator_lacks_half_the_square_of_the_damping() -> None:
    found = conditions(system({"x": "-g*x' - k*x"}, ("g", "k")))
    assert texts(found.N) == [["g/2"]]
    assert found.Phi is not None
    assert to_text(found.Phi[0][0]) == "(4*k - g^2)/2"


@pytest.mark.parametrize("n", [1, 2, 5])
def test_free_motion_has_no_curvature(n: int) -> None:
    found = conditions(system({f"x{k}": "0" for k in range(n)}))
    assert texts(found.Phi) == [["0"] * n] * n
    assert found.R is not None
    assert [texts(part) for part in found.R] == [[["0"] * n] * n] * n


def test_atoms_written_differently_give_the_same_tensors() -> None:
    plain = conditions(system({"x": "2*sin(x)*cos(x)*y'", "y": "exp(x)*exp(y)*x'"}))
    doubled = conditions(system({"x": "sin(2x)*y'", "y": "exp(x+y)*x'"}))
    together = conditions(
        system({"x": "(sin(2x) - 2*sin(x)*cos(x))*y'", "y": "(exp(x+y) - exp(x)*exp(y))*x' + sin(x)^2 + cos(x)^2 - 1"})
    )
    assert texts(together.Phi) == [["0", "0"], ["0", "0"]]
    assert plain.Phi is not None
    assert doubled.Phi is not None
    assert len(to_text(doubled.Phi[0][0])) < 200


def test_the_tangent_is_kept_where_the_user_wrote_it() -> None:
    found = conditions(catalogue_system("knife-edge-first"))
    assert found.Phi is not None
    assert to_text(found.Phi[2][1]) == "phi'^2*tan(phi)/2"


def test_denominators_stay_factored() -> None:
    found = conditions(system({"x": "x'^2/((1+x^2)*(1+y^2))", "y": "0"}))
    assert found.Phi is not None
    assert to_text(found.Phi[0][1]).endswith("/((y^2 + 1)^2*(x^2 + 1))")


def printed_nabla(motion: Motion[Quotient], tensor: tuple[tuple[Quotient, ...], ...]) -> list[list[Quotient]]:
    """The paper's formula with the signs as printed: Gamma(Phi) - N Phi - Phi N."""
    n, span = connection(motion), range(motion.size)
    found = []
    for i in span:
        row = []
        for j in span:
            entry = motion.along(tensor[i][j])
            for m in span:
                entry = entry - n[i][m] * tensor[m][j] - tensor[i][m] * n[m][j]
            row.append(entry)
        found.append(row)
    return found


def test_the_printed_nabla_phi_refuses_hills_lunar_problem_and_the_right_one_does_not() -> None:
    # L = (x'^2 + y'^2)/2 + …: the multiplier is the identity, so the tensors must be symmetric.
    motion = motion_in_ring(catalogue_system("hill-lunar"), 3, Budget()).motion
    phi = jacobi_endomorphism(motion)
    right, printed = nabla(motion, connection(motion), phi), printed_nabla(motion, phi)
    assert (phi[0][1] - phi[1][0]).is_zero
    assert (right[0][1] - right[1][0]).is_zero
    assert not right[0][1].is_zero
    assert not (printed[0][1] - printed[1][0]).is_zero


def test_r_is_antisymmetric_in_its_lower_indices() -> None:
    motion = motion_in_ring(catalogue_system("lie-a3-8-sl2"), 3, Budget()).motion
    bend = curvature(motion, jacobi_endomorphism(motion))
    indices = [(i, k, m) for i in range(3) for k in range(3) for m in range(3)]
    assert all((bend[i][k][m] + bend[i][m][k]).is_zero for i, k, m in indices)
    assert not all(bend[i][k][m].is_zero for i, k, m in indices)


def test_what_is_too_large_is_left_out_with_the_reason() -> None:
    found = conditions(system({"x": "(x+y+x'+y'+1)^60*y'", "y": "x'"}), time_limit=1)
    assert found.R is None
    assert "left out" in found.reason
    assert "terms" in found.reason or "time" in found.reason


X = Symbol("x")
UNUSABLE = {
    "zero": Power(add(Power(Apply("sin", X), number(2)), Power(Apply("cos", X), number(2)), number(-1)), number(-1)),
    "power": Power(X, number(1000)),
    "left out": add(Apply("sin", Product((number(5000), X))), Apply("sin", X)),
}


@pytest.mark.parametrize("word", UNUSABLE)
def test_what_cannot_be_differentiated_gives_a_reason_and_no_exception(word: str) -> None:
    found = conditions(SecondOrderSystem(("x",), (UNUSABLE[word],)), time_limit=1)
    assert found.Phi is None
    assert word in found.reason
