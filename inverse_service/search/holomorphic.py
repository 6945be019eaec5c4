"""Systems that are complex: z'' = F(z, z') for z_k = x_k + i y_k, F analytic with real coefficients.

If L(x, x') is a Lagrangian of x'' = F(x, x'), the real part of L(z, z') is one of the system in (x, y): by
the Cauchy-Riemann equations its Euler-Lagrange expressions are the real parts, and minus the imaginary
parts, of those of L. It is regular where L is. Complex values are pairs of trees.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial, reduce

import mpmath

from inverse_service import bounds
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    HALF,
    ZERO,
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    substitute,
)
from inverse_service.field.point import Expansion
from inverse_service.field.real_point import RealTable
from inverse_service.field.tower import draw_point
from inverse_service.field.truncated_series import derivative, value_at_point
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search.material import Material
from inverse_service.search.protocol import Smaller


class NotAnalytic(ArithmeticError):
    """A function without formulas for its real and imaginary part here."""


@dataclass(frozen=True, slots=True)
class ComplexTree:
    """real + i imaginary."""

    real: Expression
    imaginary: Expression = ZERO

    def __add__(self, other: ComplexTree) -> ComplexTree:
        return ComplexTree(self.real + other.real, self.imaginary + other.imaginary)

    def __mul__(self, other: ComplexTree) -> ComplexTree:
        return ComplexTree(
            self.real * other.real - self.imaginary * other.imaginary,
            self.real * other.imaginary + self.imaginary * other.real,
        )

    def inverse(self) -> ComplexTree:
        if self.imaginary == ZERO:
            return ComplexTree(self.real**-1)
        below = squared_modulus(self)
        return ComplexTree(self.real / below, -self.imaginary / below)


def squared_modulus(value: ComplexTree) -> Expression:
    return _signed(value.real)[1] ** 2 + _signed(value.imaginary)[1] ** 2


def _signed(tree: Expression) -> tuple[int, Expression]:
    """(-1, u) of -u; (1, u) of anything else."""
    match tree:
        case Product((Number(value), *_)) if value < 0:
            return -1, -tree
    return 1, tree


def _function(name: str, argument: Expression) -> Expression:
    """One of sin, cos, sinh, cosh; of -u by its parity."""
    sign, inside = _signed(argument)
    return (sign if name in ("sin", "sinh") else 1) * Apply(name, inside)


def logarithm(value: ComplexTree) -> ComplexTree:
    """log|z| + i atan(Im z/Re z), a branch of log z where Re z > 0 and up to a constant elsewhere."""
    if value.imaginary == ZERO:
        return ComplexTree(Apply("log", value.real))
    modulus = HALF * Apply("log", squared_modulus(value))
    return ComplexTree(modulus, Apply("atan", value.imaginary / value.real))


def continued(tree: Expression, table: Mapping[Expression, ComplexTree]) -> ComplexTree:
    """The tree with complex values for some of its names; NotAnalytic for functions not known here."""
    if tree in table:
        return table[tree]
    match tree:
        case Number() | Symbol() | Velocity():
            return ComplexTree(tree)
        case Sum(terms):
            return reduce(ComplexTree.__add__, (continued(term, table) for term in terms))
        case Product(factors):
            return reduce(ComplexTree.__mul__, (continued(factor, table) for factor in factors))
        case Power(base, Number(exponent)):
            return _power(continued(base, table), exponent)
        case Apply(function, argument):
            return _applied(function, continued(argument, table))
    raise NotAnalytic


def _power(base: ComplexTree, exponent: Fraction) -> ComplexTree:
    """z^e, by products for small whole e, else |z|^e e^(i e arg z)."""
    if base.imaginary == ZERO:
        return ComplexTree(base.real**exponent)
    if exponent.denominator == 1 and abs(exponent) <= bounds.POWER:
        whole = reduce(ComplexTree.__mul__, [base] * abs(int(exponent)))
        return whole if exponent > 0 else whole.inverse()
    angle = exponent * logarithm(base).imaginary
    modulus = ComplexTree(squared_modulus(base) ** (exponent / 2))
    return modulus * ComplexTree(_function("cos", angle), _function("sin", angle))


def _applied(function: str, z: ComplexTree) -> ComplexTree:
    """exp, log, and the trigonometric and hyperbolic sine and cosine."""
    if z.imaginary == ZERO:
        return ComplexTree(Apply(function, z.real))
    if function == "log":
        return logarithm(z)
    if function == "exp":
        turned = ComplexTree(_function("cos", z.imaginary), _function("sin", z.imaginary))
        return ComplexTree(Apply("exp", z.real)) * turned
    if function in ("sin", "cos"):
        sine, cosine = (_function(name, z.real) for name in ("sin", "cos"))
        odd, even = (_function(name, z.imaginary) for name in ("sinh", "cosh"))
        if function == "sin":
            return ComplexTree(sine * even, cosine * odd)
        return ComplexTree(cosine * even, -(sine * odd))
    if function in ("sinh", "cosh"):
        odd, even = (_function(name, z.real) for name in ("sinh", "cosh"))
        sine, cosine = (_function(name, z.imaginary) for name in ("sin", "cos"))
        pair = (odd, even) if function == "sinh" else (even, odd)
        return ComplexTree(pair[0] * cosine, pair[1] * sine)
    raise NotAnalytic


_TINY = mpmath.mpf(10) ** -25

# (x, y, s) for each z = x + i s y.
Structure = tuple[tuple[str, str, int], ...]


def is_even(material: Material) -> bool:
    """Whether the coordinates can be grouped in pairs, few enough to try all."""
    return material.motion.size in range(2, bounds.COORDINATES + 1, 2)


def real_systems(material: Material, seed: int) -> Iterator[Smaller]:
    """x'' = F(x, x') for each way to pair the coordinates; Re L(z, z') and Im L(z, z') are Lagrangians of the given."""
    system, table = material.analysis.system, material.analysis.real_point
    jacobian, prime = _jacobian(material, seed)
    for structure in _structures(system.coordinates) if table is not None else ():
        if not _satisfies_cauchy_riemann(jacobian, prime, system.coordinates, structure):
            continue
        reduced = _real_system(system, structure)
        if reduced is not None and table is not None and _is_continuation(system, reduced, structure, table):
            yield Smaller((reduced,), material.motion.with_time, partial(_lifted, structure))


def _lifted(structure: Structure, found: Sequence[Sequence[Expression]]) -> list[Expression]:
    return [part for tree in found[0] for part in _parts(tree, structure)]


def _structures(names: Sequence[str]) -> Iterator[Structure]:
    """All groupings in pairs, orders and signs; conjugate ones once, the first sign being +."""
    for grouping in _groupings(tuple(names)):
        for turned in itertools.product((False, True), repeat=len(grouping)):
            for signs in itertools.product((1, -1), repeat=len(grouping) - 1):
                ordered = [pair[::-1] if turn else pair for pair, turn in zip(grouping, turned, strict=True)]
                yield tuple((x, y, s) for (x, y), s in zip(ordered, (1, *signs), strict=True))


def _groupings(names: tuple[str, ...]) -> Iterator[list[tuple[str, str]]]:
    if not names:
        yield []
    for k in range(1, len(names)):
        for rest in _groupings(names[1:k] + names[k + 1 :]):
            yield [(names[0], names[k]), *rest]


def _real_system(system: SecondOrderSystem, structure: Structure) -> SecondOrderSystem | None:
    """x'' = F(x, x'), what is left for y = y' = 0."""
    still: dict[Expression, Expression] = {}
    for _, y, _ in structure:
        still |= {Symbol(y): ZERO, Velocity(y): ZERO}
    forces = dict(zip(system.coordinates, system.accelerations, strict=True))
    names = tuple(x for x, _, _ in structure)
    try:
        return replace(
            system, coordinates=names, accelerations=tuple(collect(substitute(forces[x], still)) for x in names)
        )
    except ArithmeticError:
        return None


def _values(structure: Structure) -> dict[Expression, ComplexTree]:
    """x -> x + i s y, x' -> x' + i s y'."""
    table: dict[Expression, ComplexTree] = {}
    for x, y, s in structure:
        table[Symbol(x)] = ComplexTree(Symbol(x), s * Symbol(y))
        table[Velocity(x)] = ComplexTree(Velocity(x), s * Velocity(y))
    return table


def _jacobian(material: Material, seed: int) -> tuple[list[list[int]], int]:
    """(df_i/d(q, v) at a random point, the prime)."""
    analysis = material.analysis
    point = draw_point(analysis.tower, seed)
    expansion = Expansion(point, [*material.motion.coordinates, *material.motion.velocities], 1)
    series = [expansion.expand(f) for f in analysis.accelerations]
    slopes = [[value_at_point(derivative(f, k)) for k in range(2 * material.motion.size)] for f in series]
    return slopes, point.prime


def _satisfies_cauchy_riemann(
    jacobian: Sequence[Sequence[int]], prime: int, names: Sequence[str], structure: Structure
) -> bool:
    """d(f_x + i s f_y)/d(conjugate of X + i S Y) = 0 at the point for all pairs, of coordinates and of velocities."""
    n = len(names)
    for x, y, s in structure:
        first, second = jacobian[names.index(x)], jacobian[names.index(y)]
        for other, partner, t in structure:
            for shift in (0, n):
                a, b = names.index(other) + shift, names.index(partner) + shift
                if (first[a] - s * t * second[b]) % prime or (t * first[b] + s * second[a]) % prime:
                    return False
    return True


def _is_continuation(
    system: SecondOrderSystem, reduced: SecondOrderSystem, structure: Structure, table: RealTable
) -> bool:
    """Whether f_x + i s f_y = F(x + i s y, x' + i s y') at the real point."""
    forces = dict(zip(system.coordinates, system.accelerations, strict=True))
    values = _values(structure)
    try:
        with mpmath.workdps(bounds.DIGITS):
            for (x, y, s), f in zip(structure, reduced.accelerations, strict=True):
                z = continued(f, values)
                gaps = (
                    evaluate(z.real, table) - evaluate(forces[x], table),
                    evaluate(z.imaginary, table) - s * evaluate(forces[y], table),
                )
                if max(map(abs, gaps)) > _TINY:
                    return False
    except (NotAnalytic, NoRealValue):
        return False
    return True


def _parts(tree: Expression, structure: Structure) -> tuple[Expression, ...]:
    try:
        z = continued(tree, _values(structure))
    except NotAnalytic:
        return ()
    return tuple(min((part, collect(part)), key=lambda one: len(to_text(one))) for part in (z.real, z.imaginary))
