"""The Galois group of F(y) = p for a rational F, from cycles modulo primes.

Where F = A/B is rational in y = v^(1/k), A - p B is irreducible over the complex numbers, being linear in p. Its
coefficients taken at random points modulo primes, the degrees of its factors are the cycles of an element of its Galois
group over Q(q, p) (Frobenius; Dedekind). An N-cycle, an (N - 1)-cycle and an element of which a power is a cycle of two
or three generate at least the alternating group A_N (Jordan 1873). For N > 4 neither this group is solvable nor that
over the complex numbers, which is normal in it and not trivial: no formula of radicals, exponentials, logarithms and
integrals gives y (Khovanskii, Topological Galois Theory, 2014).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce

from flint import nmod_poly

from inverse_service.algebra.elementary import to_kernels
from inverse_service.algebra.point import Point, evaluate, variables_in
from inverse_service.algebra.real_point import find_real_point
from inverse_service.algebra.reduction import reduce_atoms
from inverse_service.algebra.tower import Tower, draw_point
from inverse_service.expressions.tree import (
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Velocity,
    children,
    walk,
)

_DRAWS, FEW = 80, 4
_LARGEST_DEGREE, _LARGEST_BOUND = 40, 200


class NotAlgebraic(Exception):
    """F is not rational in a root of the velocity and one square root of that."""


@dataclass(frozen=True, slots=True)
class Equation:
    """What p = dL/dv leads to: its degree N, and whether N > 4 and its group is seen to contain A_N."""

    degree: int
    unsolvable: bool

    @property
    def reason(self) -> str:
        if self.unsolvable:
            return (
                f"p = dL/dv has no inverse in closed form: it leads to an equation of degree {self.degree} whose "
                f"Galois group contains the alternating group A_{self.degree}, and no formula in radicals, "
                "exponentials, logarithms and integrals solves it."
            )
        return f"p = dL/dv leads to an equation of degree {self.degree}, whose roots are not written out."


def generic(slope: Expression, rate: Velocity) -> tuple[Expression, int, Tower]:
    """The tree in kernels, of which root of the velocity it is rational, and a tower of all that does not hold it."""
    tree = to_kernels(slope)
    k = math.lcm(*(e.denominator for e in _exponents(tree, rate)))
    if k * _bound(tree, rate) > _LARGEST_BOUND:
        raise NotAlgebraic
    fixed = list(_fixed(tree, rate))
    names = tuple(dict.fromkeys(name for part in fixed for name in variables_in(part)))
    return tree, k, reduce_atoms(fixed, names, find_real_point(fixed, names, 1))


def equation_of_root(slope: Expression, rate: Velocity) -> Equation | None:
    """That for a root of the velocity, from F = slope; None where it is of degree 3 or less."""
    tree, k, tower = generic(slope, rate)
    patterns: set[tuple[int, ...]] = set()
    for seed in range(1, _DRAWS):
        pattern = _cycles(tree, rate, k, draw_point(tower, seed))
        patterns |= {pattern} if pattern else set()
        degree = max(map(sum, patterns), default=0)
        if seed > FEW and not 4 < degree <= _LARGEST_DEGREE:
            break
        if degree > 4 and _contain_alternating([one for one in patterns if sum(one) == degree], degree):
            return Equation(degree, True)
    return Equation(degree, False) if degree > 3 else None


def _exponents(tree: Expression, rate: Velocity) -> Iterator[Fraction]:
    """The exponents with which the velocity stands in a formula of one root of it and square roots."""
    match tree:
        case Power(base, Number(exponent)) if base == rate:
            yield exponent
        case Sum() | Product():
            for child in children(tree):
                yield from _exponents(child, rate)
        case Power(base, Number(exponent)) if exponent.denominator in (1, 2):
            yield from _exponents(base, rate)
        case _ if tree == rate or rate not in set(walk(tree)):
            yield Fraction(1)
        case _:
            raise NotAlgebraic


def _bound(tree: Expression, rate: Velocity) -> Fraction:
    """At least the degree of the numerator and denominator."""
    match tree:
        case Power(base, Number(exponent)):
            return abs(exponent) * _bound(base, rate)
        case Sum() | Product():
            return sum((_bound(child, rate) for child in children(tree)), Fraction(0))
        case _:
            return Fraction(int(tree == rate))


def _fixed(tree: Expression, rate: Velocity) -> Iterator[Expression]:
    """The largest parts without the velocity."""
    if rate not in set(walk(tree)):
        yield tree
    else:
        for child in children(tree):
            yield from _fixed(child, rate)


def _cycles(tree: Expression, rate: Velocity, k: int, point: Point) -> tuple[int, ...] | None:
    """The degrees of the factors of the equation at a point and at random p; None where one is multiple.

    It is A - p C + B w = 0 on the curve w^2 = S(y), that is (A - p C)^2 = B^2 S.
    """
    curve = Curve(rate, k, point)
    a, b, c = curve.element(tree)
    p = point.draw("the momentum")
    equation = a - c * p
    if b:
        content = (c * c).gcd(a * c).gcd(a * a - b * b * curve.radicand)
        equation = (equation * equation - b * b * curve.radicand) // content
    places = [i for i in range(len(equation)) if equation[i]]
    step = math.gcd(*(i - places[0] for i in places)) if places else 0
    if not step:
        return None
    plain = nmod_poly([int(equation[i]) for i in range(places[0], len(equation), step)], point.prime)
    factors = plain.factor()[1]
    return tuple(sorted(f.degree() for f, _ in factors)) if all(count == 1 for _, count in factors) else None


Element = tuple[nmod_poly, nmod_poly, nmod_poly]


class Curve:
    """Functions (A + B w)/C of y modulo a prime, v = y^k, where w^2 = S is that of the first square root met."""

    def __init__(self, rate: Velocity, k: int, point: Point) -> None:
        self.rate, self.k, self.point = rate, k, point
        self.one = nmod_poly([1], point.prime)
        self.base: Expression | None = None
        self.radicand = self.one

    def element(self, tree: Expression) -> Element:
        match tree:
            case Sum(terms):
                return reduce(self._sum, map(self.element, terms))
            case Product(factors):
                return reduce(self._product, map(self.element, factors))
            case Power(base, Number(exponent)) if base == self.rate:
                return self._power(self._monomial(1), int(exponent * self.k))
            case Power(base, Number(exponent)) if self.rate in set(walk(base)):
                whole = exponent.denominator == 1
                return self._power(self.element(base) if whole else self._root(base), exponent.numerator)
            case _ if tree == self.rate:
                return self._monomial(self.k)
            case _:
                return self.one * evaluate(tree, self.point), self.one * 0, self.one

    def _monomial(self, exponent: int) -> Element:
        return nmod_poly([0] * exponent + [1], self.point.prime), self.one * 0, self.one

    def _root(self, base: Expression) -> Element:
        """w/C for the root of A/C, with S = A C."""
        a, b, c = self.element(base)
        if b or self.base not in (None, base):
            raise NotAlgebraic
        self.base, self.radicand = base, a * c
        if len(self.radicand.factor()[1]) == 0 or any(count > 1 for _, count in self.radicand.factor()[1]):
            raise NotAlgebraic
        return self.one * 0, self.one, c

    def _sum(self, left: Element, right: Element) -> Element:
        (a, b, c), (d, e, f) = left, right
        return self._reduced(a * f + d * c, b * f + e * c, c * f)

    def _product(self, left: Element, right: Element) -> Element:
        (a, b, c), (d, e, f) = left, right
        return self._reduced(a * d + b * e * self.radicand, a * e + b * d, c * f)

    def _power(self, element: Element, exponent: int) -> Element:
        if exponent < 0:
            a, b, c = element
            element = self._reduced(a * c, -b * c, a * a - b * b * self.radicand)
        return reduce(self._product, [element] * abs(exponent))

    @staticmethod
    def _reduced(a: nmod_poly, b: nmod_poly, c: nmod_poly) -> Element:
        common = a.gcd(b).gcd(c)
        return a // common, b // common, c // common


def _contain_alternating(patterns: Sequence[tuple[int, ...]], degree: int) -> bool:
    """An N-cycle, an (N - 1)-cycle, and an element with a power that is a cycle of two or three."""
    return (degree,) in patterns and (1, degree - 1) in patterns and any(map(_has_short_power, patterns))


def _has_short_power(pattern: tuple[int, ...]) -> bool:
    return any(pattern.count(p) == 1 and sum(c % p == 0 for c in pattern) == 1 for p in (2, 3))
