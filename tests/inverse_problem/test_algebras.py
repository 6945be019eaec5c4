"""Parts of functions of complex and dual numbers, and systems over them."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest

from inverse_service.expressions import calculus, terms, tree as ex
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.reading import names as nm, reader
from inverse_service.search import algebras
from tests.values import present

FUNCTIONS = [
    "z^2*w - 3/(z + w)^2",
    "exp(z*w)*log(w)",
    "sqrt(z)*w^(3/2)/z",
    "sin(2*z)*cos(w) + w^-3",
    "log(z/w)^2*exp(-z)",
]
FORMULAS = {"sin": mpmath.sin, "cos": mpmath.cos, "exp": mpmath.exp, "log": mpmath.log}


def value(tree: ex.Expression, table: dict[ex.Expression, mpmath.mpc]) -> mpmath.mpc:
    """The value at complex numbers."""
    match tree:
        case ex.Sum(terms):
            return mpmath.fsum(value(term, table) for term in terms)
        case ex.Product(factors):
            return mpmath.fprod(value(factor, table) for factor in factors)
        case ex.Power(base, ex.Number(exponent)):
            return value(base, table) ** (mpmath.mpf(exponent.numerator) / exponent.denominator)
        case ex.Apply(function, argument):
            return FORMULAS[function](value(argument, table))
        case ex.Number(number):
            return mpmath.mpf(number.numerator) / number.denominator
    return table[tree]


@pytest.mark.parametrize("formula", FUNCTIONS)
@pytest.mark.parametrize("square", [-1, 0])
def test_the_parts_of_a_function_of_numbers(formula: str, square: int) -> None:
    tree = reader.read_formula(formula, nm.Names((), ("z", "w"), {}))
    z, w, *letters = (ex.Symbol(name) for name in ("z", "w", "a", "b", "c", "d"))
    a, b, c, d = letters
    parts = algebras.Unit(square).parts(tree, {z: (a, b), w: (c, d)})
    at = dict(zip(letters, map(mpmath.mpf, ("1.3", "0.4", "0.7", "-0.2")), strict=True))
    with mpmath.workdps(40):
        found = [calculus.evaluate(part, at) for part in parts]
        if square:
            whole = value(tree, {z: mpmath.mpc(at[a], at[b]), w: mpmath.mpc(at[c], at[d])})
            wanted = [whole.real, whole.imag]
        else:  # F + i dF
            wanted = [value(tree, {z: at[a], w: at[c]})]
            wanted.append(
                mpmath.diff(lambda h: value(tree, {z: at[a] + h * at[b], w: at[c] + h * at[d]}), 0)
            )
        for x, y in zip(found, wanted, strict=True):
            assert abs(x - y) < mpmath.mpf(10) ** -15


def test_a_complex_system_is_found_in_sums_of_its_coordinates() -> None:
    """z'' = (1 + 2 i) z'^2 for z = x + i y, J = (0, -1; 1, 0), and in other coordinates J = T^-1 J
    T.
    """
    system = read_system(
        ["x", "y"], {"x": "x'^2 - y'^2 - 4*x'*y'", "y": "2*(x'^2 - y'^2) + 2*x'*y'"}
    )
    turned = [[Fraction(3), Fraction(-5)], [Fraction(2), Fraction(1)]]  # 2 + J', J'^2 = -9
    plain = algebras.structure_of([[Fraction(4), Fraction(-1)], [Fraction(1), Fraction(4)]])
    assert plain is not None
    smaller, letter = algebras.system_over(plain, system)
    v = ex.Velocity("x")
    assert smaller.coordinates == ("x",)
    assert ex.substitute(smaller.accelerations[0], {v: ex.ONE}) == ex.number(1) + 2 * letter
    other = algebras.structure_of(turned)
    assert other is not None
    assert other.size == ex.number(3)


@pytest.mark.parametrize(("square", "value"), [(-1, 4), (0, 4), (0, 9)])
def test_the_root_of_a_square_number_is_a_number(square: int, value: int) -> None:
    """x'' = -x, y'' = -y - x' had atan(2 x'/(sqrt(4) x)) in its L."""
    root = ex.number(value) ** Fraction(1, 2)
    parts = algebras.Unit(square).parts(root, {})
    assert parts == (ex.number({4: 2, 9: 3}[value]), ex.ZERO)


def test_matrices_that_are_no_unit_make_no_numbers() -> None:
    zero, one = Fraction(0), Fraction(1)
    for matrix in ([[one, zero], [zero, one]], [[zero, one], [one, zero]], [[one]]):
        assert (
            algebras.structure_of(matrix) is None
        )  # 1 itself, a matrix with the square 1, an odd size


def test_the_root_of_a_negative_number_goes_round_in_no_circle() -> None:
    """Over dual numbers x'' = -x + 2 y' + 4 y, y'' = -y has 1/(y - y'/sqrt(-1)) among its
    candidates.
    """
    y, v = ex.Symbol("y"), ex.Velocity("y")
    root = ex.Power(ex.number(-1), ex.number(Fraction(-1, 2)))
    divisor = ex.add(y, ex.multiply(ex.number(-1), root, v))
    assert len(terms.terms_of(divisor**-1)) == 1


def test_the_size_of_a_sum_in_a_denominator_is_not_multiplied_out() -> None:
    """1/(z' + z^2) has |z' + z^2|^2 below, a sum of two squares instead of seven terms."""
    names = ("x", "y")
    system = read_system(names, {"x": "x'", "y": "y'"})
    structure = present(
        algebras.structure_of([[Fraction(0), Fraction(-1)], [Fraction(1), Fraction(0)]])
    )
    lagrangian = reader.read_formula("1/(x' + x^2)", nm.Names(names, (), {}))
    parts = algebras.parts_of(structure, system, ex.Symbol("i"), lagrangian)
    squares = {
        part
        for tree in parts
        for part in ex.walk(tree)
        if isinstance(part, ex.Power) and part.exponent == ex.number(-1)
    }
    assert len(squares) == 1
    (below,) = squares
    assert isinstance(below, ex.Power)
    assert isinstance(below.base, ex.Sum)
    assert len(below.base.terms) == 2
