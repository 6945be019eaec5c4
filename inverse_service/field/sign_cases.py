"""Roots of squares are different formulas on the two sides of a zero: sqrt(u^2) is u where u > 0 and -u where u < 0.

|u| is written sqrt(u^2) and sign(u) is u/sqrt(u^2). A root of T^2 O is |T| sqrt(O); its sides are those of the part
of T with odd exponents. Roots whose product is a root of a square (sqrt(xy) and sqrt(x/y)) are taken apart in the same
way: the signs of their factors are cases. asin(sin u) and its kin are u and pi - u on neighboring intervals.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations

from flint import fmpz_mat

from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.inequalities import is_plainly_positive
from inverse_service.expressions.pieces import STEP
from inverse_service.expressions.tree import (
    HALF,
    ONE,
    PI,
    ZERO,
    Apply,
    Expression,
    Number,
    Power,
    factors_of,
    multiply,
    number,
    substitute,
)
from inverse_service.field.elementary import is_root
from inverse_service.field.generators import Generators, factors, to_quotient
from inverse_service.field.modular import prime_factors
from inverse_service.field.real_point import RealTable, real_sign, varies
from inverse_service.field.tower import Tower, atoms_in_order

Factors = dict[Expression, int]
# Numbers under roots are factored up to here.
_LARGEST_NUMBER = 10**40


@dataclass(frozen=True, slots=True)
class Case:
    """Formulas where every tree of `positive` is > 0; `roots` says what each rewritten root is there."""

    formulas: tuple[Expression, ...]
    positive: tuple[Expression, ...] = ()
    roots: tuple[tuple[Expression, Expression], ...] = ()

    def rewritten(self, node: Expression, value: Expression, positive: Iterable[Expression]) -> Case:
        """The formulas with `value` in the place of `node`, where these trees are positive too."""
        formulas = tuple(substitute(formula, {node: value}) for formula in self.formulas)
        return Case(formulas, tuple(dict.fromkeys((*self.positive, *positive))), (*self.roots, (node, value)))

    def assuming(self, tree: Expression) -> Case:
        """The same where this tree is positive too."""
        return replace(self, positive=(*self.positive, tree))


def sign_cases(formulas: Sequence[Expression]) -> Iterator[Case]:
    """The cases in order, that of positive signs first; some may have no point all the same."""
    yield from _split(Case(tuple(formulas)))


def _split(case: Case) -> Iterator[Case]:
    """One step at a time: an innermost root is rewritten in each of its ways."""
    ways = _ways(case)
    if ways is None:
        yield case
        return
    for way in ways:
        if not is_empty(way.positive):
            yield from _split(way)


def is_empty(positive: Sequence[Expression]) -> bool:
    """Whether these are seen not to be positive at once: one is negative, or two have a sum that is not positive."""
    if any(is_plainly_positive(collect(-tree)) for tree in positive):
        return True
    sums = (collect(one + other) for one, other in combinations(positive, 2))
    return any(isinstance(each, Number) and each.value <= 0 for each in sums)


def _ways(case: Case) -> list[Case] | None:
    """The cases that follow from the next root which can be rewritten, None where there is none."""
    atoms = atoms_in_order(case.formulas)
    for node in atoms:
        found = _inverse_ways(node) if isinstance(node, Apply) else _root_ways(node, case.positive)
        if found:
            return [case.rewritten(node, value, positive) for value, positive in found]
    return _dependent_ways(case, [node for node in atoms if is_root(node) and isinstance(node, Power)])


Way = tuple[Expression, tuple[Expression, ...]]


def _inverse_ways(node: Apply) -> list[Way]:
    """Heaviside(u) on both sides; asin(sin u), acos(cos u), atan(tan u) on the two intervals next to 0."""
    inner = node.argument
    if node.function == STEP:
        return [(ONE, (inner,)), (ZERO, (-inner,))]
    if not isinstance(inner, Apply) or (node.function, inner.function) not in _INVERSE_PAIRS:
        return []
    u, quarter = inner.argument, HALF * PI
    before, after = u + quarter, quarter - u
    beyond = (u - quarter, Fraction(3, 2) * PI - u)
    match node.function:
        case "asin":
            return [(u, (before, after)), (PI - u, beyond)]
        case "acos":
            return [(u, (u, PI - u)), (-u, (-u, u + PI))]
        case _:
            return [(u, (before, after)), (u - PI, beyond)]


_INVERSE_PAIRS = frozenset((("asin", "sin"), ("acos", "cos"), ("atan", "tan")))


def root_ways(node: Expression) -> list[tuple[tuple[Expression, ...], Expression]]:
    """(what is positive, what the root is there) for each way to write a root of a square without it."""
    return [(side, value) for value, side in _root_ways(node, ())]


def _root_ways(node: Expression, positive: Sequence[Expression]) -> list[Way]:
    """|T|^(2e) (c O)^e for (c T^2 O)^e, on both sides of the zeros of T; [] where T is 1."""
    if not isinstance(node, Power) or not isinstance(node.exponent, Number) or node.exponent.value.denominator == 1:
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
    return [(_power(sign * number_square, square, 2 * exponent) * left, (sign * side,)) for sign in (1, -1)]


def _power(content: Fraction, found: Factors, exponent: Fraction) -> Expression:
    """(content prod p^k)^exponent."""
    if exponent.denominator > 1:
        return (content * _product(found)) ** exponent
    return content**exponent.numerator * _product(found) ** exponent


def _odd_root(content: Fraction, found: Factors, exponent: Fraction) -> list[Way]:
    """Odd roots of perfect powers; bases of roots are positive."""
    degree = exponent.denominator
    if not found or any(k % degree for k in found.values()):
        return []
    root = _product({factor: k // degree for factor, k in found.items()})
    value = ((1 if content > 0 else -1) * root) ** int(exponent.numerator)
    return [(number(abs(content)) ** exponent * value, ())]


def root_factors(tree: Expression) -> tuple[Fraction, Factors]:
    """(rational content, {factor: multiplicity}) of a tree; what cannot be factored is one factor."""
    content, found = Fraction(1), Factors()
    for part in factors_of(tree):
        k = 1
        match part:
            case Power(base, Number(exponent)) if exponent.denominator == 1:
                part, k = base, int(exponent)
        inner, pieces = _factored(part)
        content *= inner**k
        for piece, times in pieces.items():
            found[piece] = found.get(piece, 0) + k * times
    return content, {factor: k for factor, k in found.items() if k}


def signed_factors(trees: Iterable[Expression], table: RealTable) -> list[Expression]:
    """The factors of trees, or their negatives: as they are positive at the point."""
    found = dict.fromkeys(factor for tree in trees for factor in root_factors(tree)[1] if varies(factor))
    signed = (factor if real_sign(factor, table) > 0 else -factor for factor in found)
    return [factor for factor in signed if not is_plainly_positive(factor)]


def _factored(tree: Expression) -> tuple[Fraction, Factors]:
    """The irreducible factors over Q, functions and roots taken as letters."""
    if isinstance(tree, Number):
        return (tree.value, {}) if tree.value else (Fraction(1), {tree: 1})
    ring = Generators(Tower(()), opaque=True)
    try:
        quotient = to_quotient(ring, tree)
        parts = [
            (*factors(polynomial), side) for polynomial, side in ((quotient.numerator, 1), (quotient.denominator, -1))
        ]
    except IrreducibleAtoms:
        return Fraction(1), {tree: 1}
    content, found = Fraction(1), Factors()
    for value, pieces, side in parts:
        if not value:
            return Fraction(1), {tree: 1}
        content *= value**side
        for piece, times in pieces:
            found[ring.tree_of(piece)] = side * times
    if len(found) == 1 and content == 1 and next(iter(found.values())) == 1:
        return content, {tree: 1}
    return content, found


def _square_parts(found: Factors) -> tuple[Factors, Factors]:
    """T and O of T^2 O; factors of odd multiplicity stand in O once, below the line where they did."""
    square = {factor: (abs(k) // 2) * (1 if k > 0 else -1) for factor, k in found.items()}
    rest = {factor: 1 if k > 0 else -1 for factor, k in found.items() if k % 2}
    return {factor: k for factor, k in square.items() if k}, rest


def _number_parts(content: Fraction) -> tuple[Fraction, Fraction]:
    """(t, c) with content = t^2 c, c free of squares."""
    square = Fraction(1)
    for value, side in ((abs(content.numerator), 1), (content.denominator, -1)):
        if 0 < value <= _LARGEST_NUMBER:
            for ell, k in prime_factors(value):
                square *= Fraction(ell) ** (side * (k // 2))
    return square, content / square**2


def _product(found: Factors) -> Expression:
    return multiply(*(factor**k for factor, k in found.items())) if found else ONE


def _dependent_ways(case: Case, roots: Sequence[Power]) -> list[Case] | None:
    """Roots that depend on each other as products, taken apart for each choice of the signs of their factors."""
    for node in _dependent(roots):
        content, found = root_factors(node.base)
        for factor in found:
            if factor not in case.positive and -factor not in case.positive:
                return [case.assuming(factor), case.assuming(-factor)]
        signs = {factor: 1 if factor in case.positive else -1 for factor in found}
        if (content < 0) != (math.prod(signs[factor] ** abs(k) for factor, k in found.items()) < 0):
            return []  # the base would be negative
        assert isinstance(node.exponent, Number)
        exponent = node.exponent.value
        parts = [(signs[factor] * factor) ** (k * exponent) for factor, k in found.items()]
        numbers = [number(ell) ** (k * exponent) for ell, k in _primes(content).items()]
        return [case.rewritten(node, multiply(*numbers, *parts), ())]
    return None


def _dependent(roots: Sequence[Power]) -> list[Power]:
    """The roots of several factors that are, up to rational factors, products of powers of the others."""
    degrees: dict[Expression, int] = {}
    for node in roots:
        assert isinstance(node.exponent, Number)
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


def _vector(base: Expression) -> Factors:
    """The exponents of prime numbers and factors in a base."""
    content, found = root_factors(base)
    return {number(ell): k for ell, k in _primes(content).items()} | found


def _primes(content: Fraction) -> dict[int, int]:
    sides = ((abs(content.numerator), 1), (content.denominator, -1))
    small = [(value, side) for value, side in sides if 1 < value <= _LARGEST_NUMBER]
    return {ell: side * k for value, side in small for ell, k in prime_factors(value)}


def _order(vectors: Mapping[Expression, Factors], degrees: Mapping[Expression, int]) -> int:
    """The order of the group that the vectors over their degrees generate modulo integers."""
    columns = list(dict.fromkeys(key for vector in vectors.values() for key in vector))
    if not columns:
        return 1
    common = math.lcm(*(degrees[base] for base in vectors))
    rows = [[common * (row == column) for column in range(len(columns))] for row in range(len(columns))]
    rows += [[vector.get(key, 0) * common // degrees[base] for key in columns] for base, vector in vectors.items()]
    echelon = fmpz_mat(rows).hnf()
    volume = math.prod(int(echelon[k, k]) for k in range(len(columns)))
    return int(common ** len(columns)) // volume
