"""A proof that p = dL/dv has no inverse in closed form: the group of an equation that it leads to is too large.

The families of this folder take a block to problems F(y) = p of one velocity whose solutions would follow from an
inverse of the whole. Where F = A/B is rational in y = v^(1/k), A - p B is irreducible over the complex numbers, being
linear in p. Its coefficients taken at random points modulo primes, the degrees of its factors are the cycles of an
element of its Galois group over Q(q, p) (Frobenius; Dedekind). An N-cycle, an (N - 1)-cycle and an element of which a
power is a cycle of two or three generate at least the alternating group A_N (Jordan 1873). For N > 4 neither this group
is solvable nor that over the complex numbers, which is normal in it and not trivial: no formula of radicals,
exponentials, logarithms and integrals gives y (Khovanskii, Topological Galois Theory, 2014).

Where dF/dy = R(y) is rational and F is not, F = r + sum_k c_k log(y - a_k), and y' = 1/R(y) for the derivative by p;
y is a root of v, an exponential or a logarithm, and log F = log p serves as well as F = p. Such a y is of these
formulas only where R = c z'/z for a rational z (Rosenlicht, Publ. Math. IHES 36, 1969; Singer, Pacific J. Math. 59,
1975): r is constant, and the residues c_k are rational multiples of one number. So r that is not constant is a proof,
and a quotient of the residues that is not the same at two points; both are seen modulo a prime.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce

from flint import nmod_mat, nmod_poly

from inverse_service.algebra.kernels import to_kernels
from inverse_service.algebra.point import Point, evaluate, variables_in
from inverse_service.algebra.real_point import find_real_point
from inverse_service.algebra.reduction import reduce_atoms
from inverse_service.algebra.series import SingularPoint
from inverse_service.algebra.tower import Tower, draw_point
from inverse_service.deadline import now
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.collecting import expand
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    ZERO,
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    children,
    substitute,
    walk,
)
from inverse_service.mechanics.euler_lagrange import momenta
from inverse_service.mechanics.legendre.blocks import Block, Branch, split
from inverse_service.mechanics.legendre.forms import quotient, simplified
from inverse_service.mechanics.legendre.homogeneous import rays
from inverse_service.mechanics.legendre.linear import linear_branches, routh_branches
from inverse_service.mechanics.legendre.quadratic import form_matrix
from inverse_service.mechanics.legendre.radial import radial_branches, ratio_branches
from inverse_service.mechanics.legendre.scalar import LARGEST_BLOCK, last_equations

_DRAWS, _FEW = 80, 4
_DEPTH = 4
_LARGEST_DEGREE, _LARGEST_BOUND = 40, 200


class _NotAlgebraic(Exception):
    """F is not rational in a root of the velocity and one square root of that."""


@dataclass(frozen=True, slots=True)
class Integral:
    """What p = dL/dv leads to where F, or log F, is the integral of a rational function that is no c z'/z."""

    unsolvable = True
    reason = (
        "p = dL/dv has no inverse in closed form: for one velocity it leads to r(y) + c_1 log(y - a_1) + ... = p, "
        "where the left side is neither rational nor a multiple of the logarithm of a rational function, and no "
        "formula in radicals, exponentials, logarithms and integrals solves it (Rosenlicht)."
    )


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


def equation_of(blocks: Sequence[Block], seconds: float) -> Equation | Integral | None:
    """The first of a degree above 3 that is met, proofs before others; None where there is none that is known.

    A quadratic block has an inverse, and it is too long.
    """
    deadline, named = now() + seconds, None
    others = [block for block in blocks if form_matrix(expand(block.function), block.names) is None]
    for problem in (problem for block in others for problem in _problems(block, _DEPTH)):
        if now() > deadline:
            break
        for reading in (_equation, _integral):
            with suppress(_NotAlgebraic, IrreducibleAtoms, SingularPoint, ValueError, ZeroDivisionError):
                found = reading(*problem)
                if found is not None and found.unsolvable:
                    return found
                named = named or found
    return named


# F and y of F(y) = p.
Problem = tuple[Expression, Velocity]


def _problems(block: Block, depth: int) -> Iterator[Problem]:
    """Each problem of one velocity to which the families take the block."""
    if len(block.names) == 1:
        rate = Velocity(block.names[0])
        yield differentiate(block.function, rate), rate
        return
    for ray in rays(block):
        yield ray.above / ray.below, Velocity(ray.other)
    if len(block.names) <= LARGEST_BLOCK:
        slopes = zip(block.names, momenta(block.function, block.names), strict=True)
        yield from last_equations([(block.momenta[name], simplified(slope)) for name, slope in slopes], block.names)
    smaller: list[Block] = []

    def noting(function: Expression, names: Sequence[str], momenta: Mapping[str, Symbol]) -> Iterator[Branch]:
        """Solves nothing: what comes of it goes nowhere."""
        smaller.extend(split(function, names, momenta).blocks)
        yield Branch((ZERO,) * len(names), ZERO)

    for family in (ratio_branches, radial_branches, routh_branches, linear_branches) if depth else ():
        for _ in family(block, noting):
            while smaller:
                yield from _problems(smaller.pop(), depth - 1)


def _integral(slope: Expression, rate: Velocity) -> Integral | None:
    """Whether F = slope, or log F, is r(y) + sum_k c_k log(y - a_k) and is seen to be no rational z and no c log z."""
    derivative = simplified(differentiate(slope, rate))
    for each in (derivative, simplified(derivative / slope)):
        with suppress(_NotAlgebraic):
            if _is_mixed(_in_one_letter(to_kernels(each), rate), rate):
                return Integral()
    return None


def _is_mixed(slope: Expression, rate: Velocity) -> bool:
    tree, k, tower = _generic(slope, rate)
    known: list[tuple[int, ...]] = []
    for seed in range(1, _FEW):
        point = draw_point(tower, seed, known[0][0] if known else None)
        a, b, c = _Curve(rate, k, point).element(tree)
        ratios = None if b else _ratios_of_residues(a * nmod_poly([0] * (k - 1) + [1], point.prime), c)
        if ratios is None:
            return False
        known.append((point.prime, *ratios))
    return not known[0][1:] or len(set(known)) > 1


def _in_one_letter(slope: Expression, rate: Velocity) -> Expression:
    """A multiple of dF/dy for the slope dF/dv, y written v: y = e^(av + b) or log(av + b) where f holds no other."""
    match [node for node in dict.fromkeys(walk(slope)) if isinstance(node, Apply) and rate in set(walk(node))]:
        case []:
            return slope
        case [Apply("exp" | "log" as function, argument) as y] if rate not in set(walk(differentiate(argument, rate))):
            factor = _LETTER**-1 if function == "exp" else argument
            moved = quotient(substitute(slope, {y: _LETTER}) * factor)
            if rate not in set(walk(moved)):
                return substitute(moved, {_LETTER: rate})
    raise _NotAlgebraic


# A space is in no name that a user can declare.
_LETTER = Symbol("a function of v")


def _ratios_of_residues(above: nmod_poly, below: nmod_poly) -> tuple[int, ...] | None:
    """Quotients of sums s_k of k-th powers of the residues, () where the rational part of the integral is not constant.

    None where the residues are 0, or s_2 is. After Ostrogradsky A/B = (C/G)' + E/D, with G = gcd(B, B') and D = B/G.
    """
    prime, common = above.modulus(), above.gcd(below)
    above, below = above // common, below // common
    whole, rest = divmod(above, below)
    repeated = below.gcd(below.derivative())
    simple = below // repeated
    turned = repeated.derivative() * simple // repeated
    units = [nmod_poly([0] * i + [1], prime) for i in range(max(repeated.degree(), simple.degree()))]
    columns = [u.derivative() * simple - u * turned for u in units[: max(repeated.degree(), 0)]]
    columns += [u * repeated for u in units[: simple.degree()]]
    size = below.degree()
    if not size:
        return None
    matrix = nmod_mat(size, size, [int(column[i]) for i in range(size) for column in columns], prime)
    solved = matrix.solve(nmod_mat(size, 1, [int(rest[i]) for i in range(size)], prime))
    parts = [int(solved[i, 0]) for i in range(size)]
    remainder = nmod_poly(parts[repeated.degree() :], prime)
    if not remainder:
        return None
    if whole or any(parts[: repeated.degree()]):
        return ()
    residue = remainder * simple.derivative().xgcd(simple)[1] % simple
    _, *(one, two, three, four) = (_trace(residue**k % simple, simple) for k in range(5))
    return (
        None
        if not two
        else tuple(int(x * pow(y, -1, prime) % prime) for x, y in ((one**2, two), (three**2, two**3), (four, two**2)))
    )


def _trace(element: nmod_poly, modulus: nmod_poly) -> int:
    """The sum of its values at the roots of the modulus."""
    y = nmod_poly([0, 1], modulus.modulus())
    total = 0
    for i in range(modulus.degree()):
        total += int((element * y**i % modulus)[i])
    return total % modulus.modulus()


def _generic(slope: Expression, rate: Velocity) -> tuple[Expression, int, Tower]:
    """The tree in kernels, of which root of the velocity it is rational, and a tower of all that does not hold it."""
    tree = to_kernels(slope)
    k = math.lcm(*(e.denominator for e in _exponents(tree, rate)))
    if k * _bound(tree, rate) > _LARGEST_BOUND:
        raise _NotAlgebraic
    fixed = list(_fixed(tree, rate))
    names = tuple(dict.fromkeys(name for part in fixed for name in variables_in(part)))
    return tree, k, reduce_atoms(fixed, names, find_real_point(fixed, names, 1))


def _equation(slope: Expression, rate: Velocity) -> Equation | None:
    """That for a root of the velocity, from F = slope; None where it is of degree 3 or less."""
    tree, k, tower = _generic(slope, rate)
    patterns: set[tuple[int, ...]] = set()
    for seed in range(1, _DRAWS):
        pattern = _cycles(tree, rate, k, draw_point(tower, seed))
        patterns |= {pattern} if pattern else set()
        degree = max(map(sum, patterns), default=0)
        if seed > _FEW and not 4 < degree <= _LARGEST_DEGREE:
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
            raise _NotAlgebraic


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
    curve = _Curve(rate, k, point)
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


class _Curve:
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
            raise _NotAlgebraic
        self.base, self.radicand = base, a * c
        if len(self.radicand.factor()[1]) == 0 or any(count > 1 for _, count in self.radicand.factor()[1]):
            raise _NotAlgebraic
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
