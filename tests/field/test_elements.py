"""Elements of a field with relations are functions: each operation on them is that on values."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from flint import fmpq_mat, nmod_mat
from mpmath import mp, mpf

from inverse_service.expressions import calculus, tree as ex
from inverse_service.field import exact_field, matrices
from inverse_service.field.exact_field import Quotient
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

NAMES = Names(("x", "y"), ("a",))
LETTERS: list[ex.Symbol | ex.Velocity] = [
    ex.Symbol("x"),
    ex.Symbol("y"),
    ex.Velocity("x"),
    ex.Symbol("a"),
]
# sqrt(u) and u, sin and cos, exp and cosh, a root of a root, tan of half of an angle.
ATOMS = [
    "x", "y", "x'", "a", "sin(x)", "cos(x)", "sqrt(x^2 + y^2)", "exp(y)", "log(a)", "cosh(y)", "1 + sqrt(a)", "1/(x + 2*y)",
    "atan(x)", "(x + 1)^(1/3)", "tan(x/2)",
]  # fmt: skip
DIGITS, ROUND_OFF = 40, mpf(10) ** -25
Matrix = list[list[Quotient]]


class Drawn:
    """Formulas and their elements in the ring of all of them."""

    def __init__(self, seed: int, count: int, atoms: int = 4) -> None:
        source = random.Random(seed)
        chosen = [read_formula(text, NAMES) for text in source.sample(ATOMS, atoms)]
        whole = [1, 1, 2, -1, -2, 3]

        def product() -> ex.Expression:
            several = source.choices(chosen, k=source.randint(1, 2))
            return source.choice(whole) * ex.multiply(*several)

        self.trees = [
            source.choice(
                [
                    product() + product(),
                    product() + source.choice(whole),
                    product() / (source.choice(chosen) + 3),
                    (product() + 1) / (source.choice(chosen) ** 2 + 2),
                    product() + product() + source.choice(chosen) ** 2,
                ]
            )
            for _ in range(count)
        ]
        self.ring = exact_field.exact_ring(self.trees, LETTERS, 1, exact_field.Budget.long())
        self.elements = [self.ring.value(tree) for tree in self.trees]
        self.point: dict[ex.Expression, mpf] = {
            letter: mpf(source.uniform(0.2, 1.3)) for letter in LETTERS
        }
        self.values = [self.value_of(tree) for tree in self.trees]

    def value_of(self, tree: ex.Expression) -> mpf:
        return calculus.evaluate(tree, dict(self.point))

    def value(self, element: Quotient) -> mpf:
        return self.value_of(exact_field.quotient_tree(self.ring, element))

    def values_of(self, rows: Sequence[Sequence[Quotient]]) -> Any:
        return mp.matrix([[self.value(entry) for entry in row] for row in rows])


def agree(one: Any, other: Any) -> bool:
    return bool(mp.fabs(one - other) <= ROUND_OFF * (1 + mp.fabs(other)))


OPERATIONS: dict[str, tuple[Callable[..., Quotient], Callable[..., Any]]] = {
    "sum": (lambda a, b, c: a + b, lambda a, b, c: a + b),
    "difference": (lambda a, b, c: a - b, lambda a, b, c: a - b),
    "product": (lambda a, b, c: a * b, lambda a, b, c: a * b),
    "quotient": (lambda a, b, c: a / b, lambda a, b, c: a / b),
    "negative": (lambda a, b, c: -a, lambda a, b, c: -a),
    "power": (lambda a, b, c: a**3, lambda a, b, c: a**3),
    "sixth power": (lambda a, b, c: c**6, lambda a, b, c: c**6),
    "negative power": (lambda a, b, c: (a * b) ** -2, lambda a, b, c: (a * b) ** -2),
    "multiple": (lambda a, b, c: a.scaled(Fraction(-2, 3)), lambda a, b, c: -2 * a / 3),
    "inverse": (lambda a, b, c: a.inverse(), lambda a, b, c: 1 / a),
    "cancelled": (lambda a, b, c: (a * b + a * c) / a, lambda a, b, c: b + c),
    "rationalised": (
        lambda a, b, c: exact_field.rationalised(a / (b * c)),
        lambda a, b, c: a / (b * c),
    ),
    "sum of several": (
        lambda a, b, c: exact_field.sum_of(a - a, [a, b / c, a, -b / c, c, c / b]),
        lambda a, b, c: 2 * a + c + c / b,
    ),
    "dot": (lambda a, b, c: matrices.dot(a - a, [a, b, c], [c, b, a]), lambda a, b, c: 2 * a * c + b * b),
}  # fmt: skip


@pytest.mark.parametrize("name", OPERATIONS)
def test_an_operation_on_elements_is_that_on_values(name: str) -> None:
    of_elements, of_values = OPERATIONS[name]
    with mp.workdps(DIGITS):
        for seed in range(6):
            drawn = Drawn(seed, 3, atoms=3)
            found = drawn.value(of_elements(*drawn.elements))
            assert agree(found, of_values(*drawn.values)), (seed, name)


@pytest.mark.parametrize("seed", range(8))
def test_elements_are_their_formulas_with_derivatives_and_parts(seed: int) -> None:
    """An element has the value of its formula, of what its parts add up to, and the derivatives of
    the calculus; what is equal is zero.
    """
    with mp.workdps(DIGITS):
        drawn = Drawn(seed, 3)
        ring, (a, b, c) = drawn.ring, drawn.elements
        for element, expected in zip(drawn.elements, drawn.values, strict=True):
            assert agree(drawn.value(element), expected)
        assert ((a + b) * c - a * c - b * c).is_zero
        assert not (a * b + c - a * b).is_zero
        for k, letter in enumerate(LETTERS[:3]):
            for tree, element in zip(drawn.trees, drawn.elements, strict=True):
                slope = drawn.value(ring.partial(k)(element))
                assert agree(slope, drawn.value_of(calculus.differentiate(tree, letter)))
        along = ring.along([None, a, b, None])
        expected = (
            drawn.values[0] * drawn.value(ring.partial(1)(c))
            + drawn.values[1] * drawn.value(ring.partial(2)(c))
        )  # fmt: skip
        assert agree(drawn.value(along(c)), expected)


@pytest.mark.parametrize("seed", range(6))
def test_common_factors_leave_polynomials_in_the_same_ratios(seed: int) -> None:
    with mp.workdps(DIGITS):
        drawn = Drawn(seed, 3, atoms=2)
        shared = drawn.elements[2] / (drawn.elements[0] + drawn.elements[1])
        vector = [one * shared for one in drawn.elements]
        found = exact_field.primitive_vector(vector)
        scales = [
            drawn.value(one) / drawn.value(other) for one, other in zip(found, vector, strict=True)
        ]
        assert all(agree(scale, scales[0]) for scale in scales)
        if not drawn.ring.field.relations:  # else division is by trial
            assert all(not one.exponents for one in found)
            assert exact_field.common_divisor([one.numerator for one in found]).is_constant()
        whole = matrices.numerators(drawn.ring, vector)
        ratios = [
            drawn.value_of(exact_field.polynomial_tree(drawn.ring, one)) / drawn.value(other)
            for one, other in zip(whole, vector, strict=True)
        ]
        assert all(agree(ratio, ratios[0]) for ratio in ratios)


def _square(drawn: Drawn, size: int) -> Matrix:
    return [drawn.elements[i * size : (i + 1) * size] for i in range(size)]


@pytest.mark.parametrize("size", [1, 2, 3])
def test_systems_of_linear_equations_are_solved(size: int) -> None:
    """M x = b, M^-1 M = 1, and the determinant, in values; a singular matrix has none of them."""
    with mp.workdps(DIGITS):
        drawn = Drawn(size, size * size + size, atoms=2 if size == 3 else 3)
        rows, right = _square(drawn, size), drawn.elements[size * size :]
        one = drawn.ring.constant(1)
        table, b = drawn.values_of(rows), drawn.values_of([[entry] for entry in right])
        solved = matrices.solve_square(rows, right)
        assert solved is not None
        left = table * drawn.values_of([[entry] for entry in solved]) - b
        assert all(agree(entry, 0) for entry in left)
        inverse = matrices.inverse(rows, one)
        assert inverse is not None
        product = drawn.values_of(inverse) * table
        for i in range(size):
            assert all(agree(product[i, j], int(i == j)) for j in range(size))
        assert agree(drawn.value(matrices.determinant(rows, one)), mp.det(table))
        singular = [*rows[:-1], [a * b for a, b in zip(rows[0], [right[0]] * size, strict=True)]]
        if size > 1:
            assert matrices.solve_square(singular, right) is None
            assert matrices.inverse(singular, one) is None
            assert matrices.determinant(singular, one).is_zero


@pytest.mark.parametrize("seed", range(4))
def test_null_vectors_are_all_that_there_are(seed: int) -> None:
    """Of functions f, g, 2 f - 3 g, and f + h: one relation with constants; of rows, all."""
    with mp.workdps(DIGITS):
        drawn = Drawn(seed, 4)
        f, g, h, k = drawn.elements
        columns = [
            [f, g],
            [g, h],
            [f.scaled(2) - g.scaled(3), g.scaled(2) - h.scaled(3)],
            [f + k, h * k],
        ]
        (found,) = matrices.null_vectors(drawn.ring, columns)
        constants = [entry.constant_value for entry in found]
        assert constants[:3] == [2 * c for c in (Fraction(-1), Fraction(3, 2), Fraction(1, 2))]
        assert constants[3] == 0
        assert matrices.solution(drawn.ring, columns[:2], columns[2]) is not None
        assert matrices.solution(drawn.ring, columns[:2], columns[3]) is None
        rows = [[f, g, h, k], [g, h, k, f]]
        space = matrices.null_space(rows, 4, drawn.ring.constant(1))
        assert len(space) == 2
        for free, vector in space.items():
            assert [j for j in space if not vector[j].is_zero] == [free]
            for row in rows:
                assert matrices.dot(f - f, row, vector).is_zero


PRIME = 1_000_003


@pytest.mark.parametrize("seed", range(8))
def test_kernels_of_numbers_are_those_of_flint(seed: int) -> None:
    """The whole kernel, each vector with a column of its own, over fractions and modulo a prime;
    more equations leave what satisfies them, too.
    """
    source = random.Random(seed)
    count, width, rank = source.randint(1, 6), source.randint(1, 6), source.randint(0, 4)
    left = fmpq_mat(count, rank, [source.randint(-3, 3) for _ in range(count * rank)])
    right = fmpq_mat(rank, width, [source.randint(-3, 3) for _ in range(rank * width)])
    table = (left * right).tolist() if rank else [[0] * width for _ in range(count)]
    rows = [[Fraction(int(entry)) for entry in row] for row in table]
    expected = width - fmpq_mat(count, width, [int(x) for row in rows for x in row]).rank()
    found = matrices.kernel(rows, width)
    assert len(found) == expected
    assert all(sum(a * b for a, b in zip(row, v, strict=True)) == 0 for row in rows for v in found)
    if found:
        flat = fmpq_mat(len(found), width, [int(6**9 * x) for v in found for x in v])
        assert flat.rank() == len(found)
    numbers = [[int(entry) % PRIME for entry in row] for row in rows]
    words = np.array(numbers, np.uint64).reshape(count, width)
    for known in (
        matrices.kernel_modulo(words, PRIME),
        matrices.restricted(matrices.kernel_modulo(words[:1], PRIME), words),
    ):
        assert known.nullity == nmod_mat(numbers, PRIME).nullspace()[1]
        basis = [[int(x) for x in row] for row in known.basis.tolist()]
        for k, vector in enumerate(basis):
            assert [vector[column] for column in known.columns] == [
                int(k == j) for j in range(known.nullity)
            ]
            assert all(
                sum(a * b for a, b in zip(row, vector, strict=True)) % PRIME == 0 for row in numbers
            )
    relations = matrices.null_rows(numbers, width, PRIME)
    assert len(relations) == expected
    for vector in relations:
        assert all(
            sum(a * b for a, b in zip(row, vector, strict=True)) % PRIME == 0 for row in numbers
        )
