"""Compiled series have the coefficients of the sparse ones, which are tested against derivatives."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from inverse_service.algebra import modular, series_kernels
from inverse_service.algebra import truncated_series as ps
from inverse_service.algebra.elementary import to_kernels
from inverse_service.algebra.monomials import coefficients, exponents_of_degree, products, series_tables
from inverse_service.algebra.point import Expansion, Point, Variable
from inverse_service.algebra.real_point import find_real_point
from inverse_service.algebra.reduction import reduce_atoms
from inverse_service.algebra.series_program import Registers, SeriesProgram, TooLarge, constants_at, run
from inverse_service.algebra.tower import draw_point
from inverse_service.algebra.truncated_series import SingularPoint
from inverse_service.expressions.tree import ELEMENTARY, Arbitrary, Expression, Symbol, add, multiply, number, power
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

X, Y, K = Symbol("x"), Symbol("y"), Symbol("k")
NAMES = Names(("x", "y"), ("k",))
Terms = dict[tuple[int, ...], int]

FORMULAS = [f"{name}(x/7+2*y/9)" for name in sorted(ELEMENTARY - {"acosh"})]
FORMULAS += [
    *("0", "5/3", "x", "k", "k*y", "-x/2", "x+y-3", "2*x*y*3", "x^2", "x^7*y", "(x-y)^3/7", "1/x", "1/(x*y)^3"),
    *("(x+y)^(1/3)", "(1+x^2)^(-5/2)", "x^k", "2^x", "acosh(2+x^2)", "sin(x)*cos(x)-sin(x)^2", "exp(x)^3/exp(2*y)"),
    *("log(log(2+x^2))", "sqrt(1+exp(x)*sin(y)^2)", "atan(y/x)", "x*y/(x-y)", "(x-x)*y", "tan(x*y)/(1+k*sin(k))"),
    *("(1+x)^40", "(x*y-x^2*y^2)^5", "sqrt(x)*sqrt(y)", "exp(2)", "log(3)*x", "cos(k)"),
]  # fmt: skip


def point_of(tree: Expression, seed: int = 1) -> Point:
    names: tuple[Variable, ...] = (X, Y, K)
    return draw_point(reduce_atoms([tree], names, find_real_point([tree], names, 1)), seed)


def terms_of(found: Registers, register: int) -> Terms:
    """{exponents: coefficient} of a register, out of Montgomery's form."""
    starts, places, values, degrees = found.coefficients(np.array([register]), found.tables.order).struct
    inverse = pow(1 << 64, -1, found.prime)
    places, values, degrees = (each[: starts[1]] for each in (places, values, degrees))
    return {
        tuple(exponents_of_degree(found.tables.size, d)[k].tolist()): int(x) * inverse % found.prime
        for k, x, d in zip(places.tolist(), values.tolist(), degrees.tolist(), strict=True)
    }


def compiled_terms(tree: Expression, point: Point, variables: list[Variable], written: int, order: int) -> Terms:
    program = SeriesProgram(variables, written)
    register = program.expand(tree)
    instructions = np.array(program.instructions, np.int64).ravel()
    return terms_of(run(program, instructions, constants_at(program, point), point.prime, order), register)


def sparse_terms(tree: Expression, point: Point, variables: list[Variable], order: int) -> Terms:
    return dict(ps.terms(Expansion(point, variables, order).expand(tree)))


@pytest.mark.slow
@pytest.mark.parametrize("variables", [[X, Y], [Y], [X, Y, K], [Symbol("t"), X, Y]], ids=str)
@pytest.mark.parametrize("text", FORMULAS)
def test_coefficients_are_those_of_the_sparse_series(text: str, variables: list[Variable]) -> None:
    tree = to_kernels(parse(text, NAMES))
    point = point_of(tree)
    for written, order in ((5, 5), (5, 2), (1, 1)):
        expected = sparse_terms(tree, point, variables, order)
        assert compiled_terms(tree, point, variables, written, order) == expected


def test_no_register_is_written_beyond_the_order_asked_for() -> None:
    """To order 0 there is no room for a displacement: words beyond the registers were written once."""
    tree = to_kernels(parse("x*sin(y)+y", NAMES))
    point, program = point_of(tree), SeriesProgram([X, Y], 3)
    register = program.expand(tree)
    instructions, constants = np.array(program.instructions, np.int64).ravel(), constants_at(program, point)
    for order in range(4):
        found = run(program, instructions, constants, point.prime, order)
        assert max(found.tops) == order
        assert terms_of(found, register) == sparse_terms(tree, point, [X, Y], order)


FUNCTIONS = [
    Arbitrary("A", (X,), (0,)),
    Arbitrary("A", (X,), (2,)),
    Arbitrary("A", (number(2),), (1,)),
    Arbitrary("B", (X, Y), (0, 1)),
    Arbitrary("B", (multiply(X, Y), add(X, number(3))), (1, 0)),
    Arbitrary("C", (X, Y, power(X, 2)), (0, 0, 0)),
    multiply(Arbitrary("A", (add(X, Y),), (0,)), Arbitrary("A", (add(X, Y),), (1,))),
]


@pytest.mark.parametrize("tree", FUNCTIONS, ids=str)
def test_arbitrary_functions_have_the_same_taylor_series(tree: Expression) -> None:
    point = point_of(X)
    for written, order in ((4, 4), (5, 3)):
        expected = sparse_terms(tree, point, [X, Y], order)
        assert compiled_terms(tree, point, [X, Y], written, order) == expected


@pytest.mark.parametrize("text", ["1/(x-y)", "log(x-y)", "(x-y)^(-2)", "1/(k-x)", "x/(x*y-25)", "1/(x-y)^2"])
def test_a_division_by_zero_is_a_singular_point(text: str) -> None:
    tree = to_kernels(parse(text, NAMES))
    point = point_of(tree)
    point.variables.update({X: 5, Y: 5, K: 5})
    program = SeriesProgram([X, Y], 3)
    program.expand(tree)
    with pytest.raises(SingularPoint):
        run(program, np.array(program.instructions).ravel(), constants_at(program, point), point.prime, 3)


@pytest.mark.parametrize(("a", "b", "order"), [("x*y+1", "(x+2*y)^3", 4), ("sin(x)", "exp(y*x)", 5), ("0", "x", 2)])
def test_instructions_do_what_they_say(a: str, b: str, order: int) -> None:
    """Derivatives, cut products, sums and a constant taken away, against the sparse series."""
    trees = [to_kernels(parse(text, NAMES)) for text in (a, b)]
    point, variables = point_of(add(*trees)), [X, Y]
    program = SeriesProgram(variables, order)
    left, right = map(program.expand, trees)
    slope = program.write(series_kernels.DERIVATIVE, program.register(), right, 1)
    moved = program.write(series_kernels.ADD, program.register(), right)
    program.write(series_kernels.WITHOUT_CONSTANT, moved)
    cut = program.register()
    program.instructions.append((series_kernels.PRODUCT, cut, left, right, 0, 1))
    untouched = program.register()
    found = run(program, np.array(program.instructions).ravel(), constants_at(program, point), point.prime, order)
    sparse = Expansion(point, variables, order)
    x, y = map(sparse.expand, trees)
    assert terms_of(found, slope) == ps.terms(ps.derivative(y, 1))
    assert terms_of(found, moved) == {k: v for k, v in ps.terms(y).items() if any(k)}
    assert terms_of(found, cut) == ps.terms(ps.multiply(x, y)[:order])
    assert terms_of(found, untouched) == {}


@pytest.mark.parametrize(("size", "order"), [(1, 0), (1, 3), (2, 1), (3, 4), (5, 2)])
def test_the_tables_multiply_and_raise_monomials(size: int, order: int) -> None:
    tables = series_tables(size, order)
    assert tables.starts[-1] == coefficients(size, order)
    assert len(tables.products) == products(size, order)
    for j, k in itertools.product(range(order + 1), repeat=2):
        if j + k > order:
            continue
        left, right, both = (exponents_of_degree(size, d) for d in (j, k, j + k))
        start = tables.product_starts[j * (order + 1) + k]
        for a, b in itertools.product(range(len(left)), range(len(right))):
            assert (both[tables.products[start + a * len(right) + b]] == left[a] + right[b]).all()
    for degree in range(order):
        low, high = exponents_of_degree(size, degree), exponents_of_degree(size, degree + 1)
        for i, a in itertools.product(range(len(low)), range(size)):
            at = tables.raised_starts[degree] + i * size + a
            assert (high[tables.raised[at]] - low[i]).tolist() == [int(b == a) for b in range(size)]
            assert tables.exponents[at] == low[i][a] + 1


def test_a_program_too_large_for_arrays_says_so() -> None:
    with pytest.raises(TooLarge):
        SeriesProgram([Symbol(f"x{k}") for k in range(16)], 9)
    program = SeriesProgram([X, Y], 5, most_words=100)
    with pytest.raises(TooLarge):
        program.register(5)


def test_constants_are_in_montgomery_form() -> None:
    program, point = SeriesProgram([X], 1), point_of(X)
    place = program.constant(lambda point, known: 7)
    one = modular.field_of(point.prime).one
    found = constants_at(program, point)
    assert found[0] == one
    assert int(found[place]) == 7 * (1 << 64) % point.prime
