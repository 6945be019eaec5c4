"""Write the condition that a tree is positive as an inequality: x > 1, x^2 + y^2 < 1, y > x, u > 0, u != 0 for u^2."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache, reduce
from math import prod
from typing import Any

from flint import fmpq, fmpq_poly

from inverse_service.expressions import collecting, notation, tree as ex

_DEGREE, _HIGHEST = 40, 64
_FINE = 2**64  # parts of one in a square root


def inequality(tree: ex.Expression) -> notation.Formula:
    """The condition that the tree is positive, as a formula in all formats, collected where that is shorter."""
    if isinstance(tree, ex.Power) and isinstance(tree.exponent, ex.Number) and tree.exponent.value % 2 == 0:
        return notation.row(tree.base, " != 0")
    left, right, is_greater = _sides(min(tree, collecting.collect(tree), key=ex.node_count))
    return notation.row(left, " > " if is_greater else " < ", right)


def inequality_text(tree: ex.Expression) -> str:
    """The same in plain text."""
    return inequality(tree).text


def is_plainly_positive(tree: ex.Expression, known: Collection[ex.Expression] = ()) -> bool:
    """Whether it is > 0 wherever it is defined and all of `known` are > 0, seen from its form: 1 + x^2, exp(u)."""
    bounds = {ex.negate(each): Range(0).turned for each in known} | dict.fromkeys(known, Range(0))
    return _range(tree, bounds).is_positive


@lru_cache(maxsize=4096)
def is_positive_polynomial(tree: ex.Expression) -> bool:
    """Whether it is a polynomial in one name, with rational coefficients, that is > 0 on the whole line.

    Decided by its roots, isolated in boxes; real roots have the imaginary part 0.
    """
    names = {node for node in ex.walk(tree) if isinstance(node, ex.Symbol | ex.Velocity)}
    polynomial = _polynomial(tree) if len(names) == 1 else None
    if polynomial is None or polynomial.degree() % 2 or polynomial[polynomial.degree()] <= 0:
        return False
    roots: list[Any] = polynomial.numer().complex_roots()  # pairs (root, multiplicity), which its stub leaves out
    return not any(root[0].imag.contains(0) for root in roots)


def _polynomial(tree: ex.Expression) -> fmpq_poly | None:
    """The polynomial in the single name that occurs; None for other trees, or a degree over 40."""
    match tree:
        case ex.Number(value):
            return fmpq_poly([fmpq(value.numerator, value.denominator)])
        case ex.Symbol() | ex.Velocity():
            return fmpq_poly([0, 1])
        case ex.Sum(parts) | ex.Product(parts):
            found = [_polynomial(part) for part in parts]
            known = [part for part in found if part is not None]
            if len(known) < len(found):
                return None
            if isinstance(tree, ex.Sum):
                return sum(known, fmpq_poly([0]))
            return prod(known, start=fmpq_poly([1])) if sum(max(p.degree(), 0) for p in known) <= _DEGREE else None
        case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1 and exponent > 0:
            inner = _polynomial(base)
            fits = inner is not None and inner.degree() * exponent <= _DEGREE
            return inner ** int(exponent) if inner is not None and fits else None
    return None


def is_plainly_nonzero(tree: ex.Expression, known: Collection[ex.Expression]) -> bool:
    """Whether it is not 0 wherever it is defined and none of `known` is 0, seen from its form alone."""
    around = _range(tree, {})
    if tree in known or -tree in known or around.is_positive or around.turned.is_positive:
        return True
    match tree:
        case ex.Number(value):
            return value != 0
        case ex.Product(factors):
            return all(is_plainly_nonzero(factor, known) for factor in factors)
        case ex.Power(base, exponent):
            is_below = isinstance(exponent, ex.Number) and exponent.value < 0
            return is_below or is_plainly_nonzero(base, known)
    return False


def _sides(tree: ex.Expression) -> tuple[ex.Expression, ex.Expression, bool]:
    """(a, b, True) for a > b, (a, b, False) for a < b; one side is a single term, and a number is on the right."""
    terms = getattr(tree, "terms", (tree,))
    varying = [term for term in terms if not _is_number(term)]
    if len(varying) == 1:
        return _bound(varying[0], ex.add(*(term for term in terms if _is_number(term))))
    above = [term for term in terms if _coefficient(term) > 0]
    below = [-term for term in terms if _coefficient(term) < 0]
    if not above or all(map(_is_number, above)):
        return ex.add(*below), ex.add(*above), False
    return (ex.add(*above), ex.add(*below), True) if min(len(above), len(below)) < 2 else (tree, ex.ZERO, True)


def _bound(term: ex.Expression, rest: ex.Expression) -> tuple[ex.Expression, ex.Expression, bool]:
    """c u + rest > 0 solved for u."""
    coefficient = _coefficient(term)
    parts = rest.terms if isinstance(rest, ex.Sum) else (rest,)
    return (
        1 / coefficient * term,
        ex.add(*(-1 / coefficient * part for part in parts)),
        coefficient > 0,
    )


def _coefficient(term: ex.Expression) -> Fraction:
    parts = getattr(term, "factors", (term,))
    return parts[0].value if isinstance(parts[0], ex.Number) else Fraction(1)


def _is_number(term: ex.Expression) -> bool:
    """Whether no coordinate, velocity, parameter or function occurs."""
    return not any(isinstance(node, ex.Symbol | ex.Velocity | ex.Arbitrary) and node != ex.PI for node in ex.walk(term))


Bound = Fraction | float


@dataclass(frozen=True, slots=True)
class Range:
    """The interval from `low` to `high`; an end that is `open` does not belong to it."""

    low: Bound = -math.inf
    high: Bound = math.inf
    low_open: bool = True
    high_open: bool = True

    @property
    def is_positive(self) -> bool:
        return self.low > 0 or (self.low == 0 and self.low_open)

    @property
    def turned(self) -> Range:
        """The interval of the negatives."""
        return Range(-self.high, -self.low, self.high_open, self.low_open)


def needed(positive: Sequence[ex.Expression], nonzero: Sequence[ex.Expression]) -> tuple[list[int], list[int]]:
    """The places of the conditions that do not follow from those on single names, such as 0 < c < 2 and x > 0."""
    bounds: dict[ex.Expression, Range] = {}
    alone = {place: bound for place, tree in enumerate(positive) if (bound := _bounded(tree)) is not None}
    for name, own in alone.values():
        known = bounds.get(name, Range())
        bounds[name] = Range(max(known.low, own.low), min(known.high, own.high))
    kept = [k for k, tree in enumerate(positive) if k in alone or not _range(tree, bounds).is_positive]
    settled = {*positive, *map(ex.negate, positive)}
    ranges = [_range(tree, bounds) for tree in nonzero]
    rest = [
        k
        for k, (tree, found) in enumerate(zip(nonzero, ranges, strict=True))
        if not (tree in settled or found.is_positive or found.turned.is_positive)
    ]
    return kept, rest


def _bounded(tree: ex.Expression) -> tuple[ex.Expression, Range] | None:
    """The name and its range where a condition u > 0 bounds one name by a number."""
    left, right, is_greater = _sides(tree)
    if not isinstance(left, ex.Symbol | ex.Velocity) or not isinstance(right, ex.Number):
        return None
    return left, Range(right.value) if is_greater else Range(high=right.value)


def _range(tree: ex.Expression, bounds: Mapping[ex.Expression, Range]) -> Range:
    """An interval that contains all values of the tree."""
    if tree in bounds:
        return bounds[tree]
    match tree:
        case ex.Number(value):
            return Range(value, value, False, False)
        case ex.Sum() if is_positive_polynomial(tree):
            return Range(0)
        case ex.Sum() if is_positive_polynomial(ex.negate(tree)):
            return Range(0).turned
        case ex.Sum(terms):
            found = [_range(term, bounds) for term in terms]
            low, high = (sum(getattr(one, end) for one in found) for end in ("low", "high"))
            return Range(low, high, any(one.low_open for one in found), any(one.high_open for one in found))
        case ex.Product(factors):
            return reduce(_times, (_range(factor, bounds) for factor in factors))
        case ex.Power(base, ex.Number(exponent)):
            return _power_of(_range(base, bounds), exponent)
        case ex.Power(base, _) if _range(base, bounds).is_positive:
            return Range(0)
        case ex.Apply("sin" | "cos"):
            return Range(-1, 1, False, False)
        case ex.Apply("exp" | "cosh"):
            return Range(0)
    return Range()


def _times(one: Range, other: Range) -> Range:
    if one.low < 0 and one.high <= 0:
        return _times(one.turned, other).turned
    if other.low < 0 and other.high <= 0:
        return _times(one, other.turned).turned
    ends = [0 if 0 in (left, right) else left * right for left in _ends(one) for right in _ends(other)]
    low, high = min(ends), max(ends)
    if min(one.low, other.low) < 0:
        return Range(low, high, low == -math.inf, high == math.inf)
    low_open = one.low_open or other.low_open if low else one.is_positive and other.is_positive
    return Range(low, high, low_open, high != 0 and (one.high_open or other.high_open))


def _ends(one: Range) -> tuple[Bound, Bound]:
    return one.low, one.high


def _power_of(base: Range, exponent: Fraction) -> Range:
    is_even = exponent.denominator == 1 and exponent.numerator % 2 == 0
    if exponent.denominator % 2 == 0 and base.low < 0:
        base = Range(Fraction(0), base.high, False, base.high_open)  # of u >= 0
    elif exponent.denominator > 1 and exponent.numerator % 2 == 0 and base.low < 0:
        base = Range(Fraction(0), math.inf, False)
    if is_even and base.high <= 0:
        base = base.turned
    if exponent.numerator > _HIGHEST:
        base = Range(-math.inf if base.low < 0 else 0, low_open=base.low < 0 or base.is_positive)
    is_odd = exponent.denominator == 1 and exponent.numerator % 2 == 1 and exponent > 0
    if base.low < 0 and not is_odd:
        most = max(base.low**2, base.high**2) ** (exponent.numerator // 2) if is_even and exponent > 0 else math.inf
        return Range(0, most, exponent < 0, most == math.inf) if is_even else Range()
    if exponent < 0 or exponent.denominator > 1:
        most = _root_above(base.high, exponent.denominator) ** exponent.numerator if exponent > 0 else math.inf
        return Range(0, most, exponent < 0 or base.is_positive, most == math.inf)
    power = int(exponent)
    return Range(base.low**power, base.high**power, base.low_open, base.high_open)


def _root_above(value: Bound, degree: int) -> Bound:
    """A number whose power is at least the value; it is close to the root for square roots."""
    if not isinstance(value, Fraction | int):
        return value
    whole = Fraction(value)
    if degree != 2:
        return max(whole, Fraction(1))
    return Fraction(math.isqrt(whole.numerator * _FINE**2 // whole.denominator) + 1, _FINE)
