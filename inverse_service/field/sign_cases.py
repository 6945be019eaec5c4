"""The cases of formulas that differ on the two sides of a zero.

sqrt(u^2) is u where u > 0 and -u where u < 0; |u| is written sqrt(u^2), and sign(u) is u/sqrt(u^2).
A root of T^2 O is |T| sqrt(O); its sides are those of the part of T with odd exponents. Roots whose
product is a root of a square (sqrt(xy) and sqrt(x/y)) are split in the same way, with the signs of
their factors as cases. asin(sin u) and similar are u and pi - u on neighboring intervals.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations

from flint import fmpz_mat

from inverse_service.expressions import (
    collecting,
    functions,
    polynomials,
    tree as ex,
)
from inverse_service.field import exact_field, modular, tower as towers
from inverse_service.field.real_branch import MOST_TERMS, RealTable, is_positive, real_sign, varies

Factors = dict[ex.Expression, int]
# The largest number under a root that is factored.
_LARGEST_NUMBER = 10**40
Way = tuple[ex.Expression, tuple[ex.Expression, ...]]


@dataclass(frozen=True, slots=True)
class Case:
    """Formulas valid where every tree of `positive` is > 0; `roots` maps each rewritten root to its
    value there.
    """

    formulas: tuple[ex.Expression, ...]
    positive: tuple[ex.Expression, ...] = ()
    roots: tuple[tuple[ex.Expression, ex.Expression], ...] = ()

    def rewritten(
        self, node: ex.Expression, value: ex.Expression, positive: Iterable[ex.Expression]
    ) -> Case:
        """The case with `value` in place of `node`, where these trees are positive too."""
        formulas = tuple(ex.substitute(formula, {node: value}) for formula in self.formulas)
        return Case(
            formulas,
            tuple(dict.fromkeys((*self.positive, *positive))),
            (*self.roots, (node, value)),
        )

    def assuming(self, tree: ex.Expression) -> Case:
        """The case in which this tree is positive too."""
        return replace(self, positive=(*self.positive, tree))


def sign_cases(formulas: Sequence[ex.Expression]) -> Iterator[Case]:
    """The cases in order, positive signs first; some may still be empty."""
    yield from _split(Case(tuple(formulas)))


def _split(case: Case) -> Iterator[Case]:
    """Yield the final cases by rewriting one innermost root at a time in each of its ways."""
    ways = _ways(case)
    if ways is None:
        yield case
        return
    for way in ways:
        if not is_empty(way.positive):
            yield from _split(way)


def is_empty(positive: Sequence[ex.Expression]) -> bool:
    """Whether the trees obviously cannot all be positive: one is negative, or two have a sum that
    is not positive.
    """
    if any(is_positive(collecting.collect(-tree)) for tree in positive):
        return True
    sums = (collecting.collect(one + other) for one, other in combinations(positive, 2))
    return any(isinstance(each, ex.Number) and each.value <= 0 for each in sums)


def _ways(case: Case) -> list[Case] | None:
    """The cases from the next root that can be rewritten; None if there is none."""
    atoms = towers.atoms_in_order(case.formulas)
    for node in atoms:
        found = (
            _inverse_ways(node) if isinstance(node, ex.Apply) else _root_ways(node, case.positive)
        )
        if found:
            return [case.rewritten(node, value, positive) for value, positive in found]
    return _dependent_ways(
        case, [node for node in atoms if towers.is_root(node) and isinstance(node, ex.Power)]
    )


def _inverse_ways(node: ex.Apply) -> list[Way]:
    """Heaviside(u) on both sides; asin(sin u), acos(cos u), atan(tan u) on the two intervals next
    to 0.
    """
    inner = node.argument
    if node.function == functions.STEP:
        return [(ex.ONE, (inner,)), (ex.ZERO, (-inner,))]
    if not isinstance(inner, ex.Apply) or inner.function not in functions.CIRCULAR:
        return []
    if not functions.solves(node.function, inner.function):
        return []
    u, quarter = inner.argument, ex.HALF * ex.PI
    before, after = u + quarter, quarter - u
    beyond = (u - quarter, Fraction(3, 2) * ex.PI - u)
    match node.function:
        case "asin":
            return [(u, (before, after)), (ex.PI - u, beyond)]
        case "acos":
            return [(u, (u, ex.PI - u)), (-u, (-u, u + ex.PI))]
        case _:
            return [(u, (before, after)), (u - ex.PI, beyond)]


def root_ways(node: ex.Expression) -> list[tuple[tuple[ex.Expression, ...], ex.Expression]]:
    """(positive trees, the value of the root there) for each way to write a root of a square
    without a root.
    """
    return [(side, value) for value, side in _root_ways(node, ())]


def _root_ways(node: ex.Expression, positive: Sequence[ex.Expression]) -> list[Way]:
    """|T|^(2e) (c O)^e for (c T^2 O)^e, on both sides of the zeros of T; [] if T is 1."""
    if (
        not isinstance(node, ex.Power)
        or not isinstance(node.exponent, ex.Number)
        or node.exponent.value.denominator == 1
    ):
        return []
    exponent = node.exponent.value
    content, found = root_factors(node.base)
    if exponent.denominator % 2:
        return _odd_root(content, found, exponent)
    square, rest = _square_parts(found)
    number_square, number_rest = _number_parts(content)
    if not square and number_square == 1:
        return []
    left = (number_rest * _product(rest)) ** exponent
    odd = [factor for factor, k in square.items() if k % 2 and factor not in positive]
    if (2 * exponent).numerator % 2 == 0 or not odd:
        return [(_power(number_square, square, 2 * exponent) * left, ())]
    side = _product(dict.fromkeys(odd, 1))
    return [
        (_power(sign * number_square, square, 2 * exponent) * left, (sign * side,))
        for sign in (1, -1)
    ]


def _power(content: Fraction, found: Factors, exponent: Fraction) -> ex.Expression:
    """(content prod p^k)^exponent."""
    if exponent.denominator > 1:
        return (content * _product(found)) ** exponent
    return content**exponent.numerator * _product(found) ** exponent


def _odd_root(content: Fraction, found: Factors, exponent: Fraction) -> list[Way]:
    """Odd roots of perfect powers where these are positive, because bases of roots are positive."""
    degree = exponent.denominator
    if not found or any(k % degree for k in found.values()):
        return []
    root = {factor: k // degree for factor, k in found.items()}
    sign = 1 if content > 0 else -1
    odd = [factor for factor, k in root.items() if k % 2]
    value = collecting.collect(ex.number(abs(content)) ** exponent) * (
        sign * _product(root)
    ) ** int(exponent.numerator)
    return [(value, (sign * _product(dict.fromkeys(odd, 1)),) if odd else ())]


def root_factors(tree: ex.Expression) -> tuple[Fraction, Factors]:
    """(rational content, {factor: multiplicity}) of a tree; a tree that cannot be factored is one
    factor.
    """
    content, found = Fraction(1), Factors()
    for part in ex.factors_of(tree):
        k = 1
        match part:
            case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1:
                part, k = base, int(exponent)
        inner, pieces = _factored(part)
        content *= inner**k
        for piece, times in pieces.items():
            found[piece] = found.get(piece, 0) + k * times
    return content, {factor: k for factor, k in found.items() if k}


def signed_factors(trees: Iterable[ex.Expression], table: RealTable) -> list[ex.Expression]:
    """The factors of trees, each with the sign that makes it positive at the point."""
    found = dict.fromkeys(
        factor for tree in trees for factor in root_factors(tree)[1] if varies(factor)
    )
    signed = (factor if real_sign(factor, table) > 0 else -factor for factor in found)
    return [factor for factor in signed if not is_positive(factor)]


def _factored(tree: ex.Expression) -> tuple[Fraction, Factors]:
    """The irreducible factors over Q, with functions and roots as generators."""
    if isinstance(tree, ex.Number):
        return (tree.value, {}) if tree.value else (Fraction(1), {tree: 1})
    try:
        ring = exact_field.opaque_ring([tree], exact_field.Budget(MOST_TERMS))
        quotient = ring.value(tree)
        content, pieces = polynomials.factor_polynomial(quotient.numerator)
    except (exact_field.TooLarge, ZeroDivisionError):
        return Fraction(1), {tree: 1}
    if not content:
        return Fraction(1), {tree: 1}
    powers = [
        *pieces,
        *((ring.field.denominators[index], -times) for index, times in quotient.exponents),
    ]
    found = {exact_field.polynomial_tree(ring, piece): times for piece, times in powers}
    if len(found) == 1 and content == 1 and next(iter(found.values())) == 1:
        return content, {tree: 1}
    return content, found


def _square_parts(found: Factors) -> tuple[Factors, Factors]:
    """T and O of T^2 O; factors of odd multiplicity occur in O once, in the denominator if they did
    in the product.
    """
    square = {factor: (abs(k) // 2) * (1 if k > 0 else -1) for factor, k in found.items()}
    rest = {factor: 1 if k > 0 else -1 for factor, k in found.items() if k % 2}
    return {factor: k for factor, k in square.items() if k}, rest


def _number_parts(content: Fraction) -> tuple[Fraction, Fraction]:
    """(t, c) with content = t^2 c and c squarefree."""
    square = Fraction(1)
    for value, side in ((abs(content.numerator), 1), (content.denominator, -1)):
        if 0 < value <= _LARGEST_NUMBER:
            for ell, k in modular.prime_factors(value):
                square *= Fraction(ell) ** (side * (k // 2))
    return square, content / square**2


def _product(found: Factors) -> ex.Expression:
    return ex.multiply(*(factor**k for factor, k in found.items())) if found else ex.ONE


def _dependent_ways(case: Case, roots: Sequence[ex.Power]) -> list[Case] | None:
    """The cases that split multiplicatively dependent roots, one for each choice of the signs of
    their factors.
    """
    for node in _dependent(roots):
        content, found = root_factors(node.base)
        for factor in found:
            if factor not in case.positive and -factor not in case.positive:
                return [case.assuming(factor), case.assuming(-factor)]
        signs = {factor: 1 if factor in case.positive else -1 for factor in found}
        if (content < 0) != (math.prod(signs[factor] ** abs(k) for factor, k in found.items()) < 0):
            return []  # the base would be negative
        assert isinstance(node.exponent, ex.Number)
        exponent = node.exponent.value
        parts = [(signs[factor] * factor) ** (k * exponent) for factor, k in found.items()]
        numbers = [ex.number(ell) ** (k * exponent) for ell, k in _primes(content).items()]
        return [case.rewritten(node, ex.multiply(*numbers, *parts), ())]
    return None


def _dependent(roots: Sequence[ex.Power]) -> list[ex.Power]:
    """The roots with several factors that are, up to rational factors, products of powers of the
    others.
    """
    degrees: dict[ex.Expression, int] = {}
    for node in roots:
        assert isinstance(node.exponent, ex.Number)
        degrees[node.base] = math.lcm(degrees.get(node.base, 1), node.exponent.value.denominator)
    vectors = {base: _vector(base) for base in degrees}
    whole = _order(vectors, degrees)
    involved = [
        base
        for base, degree in degrees.items()
        if len(vectors[base]) > 1
        and whole != degree * _order({key: vectors[key] for key in vectors if key != base}, degrees)
    ]
    return [node for node in roots if node.base in involved]


def _vector(base: ex.Expression) -> Factors:
    """The exponents of the primes and factors in a base."""
    content, found = root_factors(base)
    return {ex.number(ell): k for ell, k in _primes(content).items()} | found


def _primes(content: Fraction) -> dict[int, int]:
    sides = ((abs(content.numerator), 1), (content.denominator, -1))
    small = [(value, side) for value, side in sides if 1 < value <= _LARGEST_NUMBER]
    return {ell: side * k for value, side in small for ell, k in modular.prime_factors(value)}


def _order(vectors: Mapping[ex.Expression, Factors], degrees: Mapping[ex.Expression, int]) -> int:
    """The order of the group generated modulo integers by the vectors divided by their degrees."""
    columns = list(dict.fromkeys(key for vector in vectors.values() for key in vector))
    if not columns:
        return 1
    common = math.lcm(*(degrees[base] for base in vectors))
    rows = [
        [common * (row == column) for column in range(len(columns))] for row in range(len(columns))
    ]
    rows += [
        [vector.get(key, 0) * common // degrees[base] for key in columns]
        for base, vector in vectors.items()
    ]
    echelon = fmpz_mat(rows).hnf()
    volume = math.prod(int(echelon[k, k]) for k in range(len(columns)))
    return int(common ** len(columns)) // volume
