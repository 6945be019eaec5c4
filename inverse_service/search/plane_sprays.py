"""Lagrangians exp(k.q) psi(v), psi of degree 2, of systems of two coordinates with f(v) of degree 2.

With x' = r X, y' = r Y for functions X, Y of one variable, and s = Y/X, the system is
s' = x' A(s), x'' = x'^2 F(s). L = exp(k.q) x'^2 H(s) is its own energy, so that it is conserved:

    k_1 + k_2 s + 2 F + A H'/H = 0,

and then the Euler-Lagrange equations are one more, which is linear in k:

    (k_1 + k_2 s + 2 F)(A' + F) = 2 A (k_2 + F').

Where f holds one root w of a quadratic form that is the square of a rational number times x' for
y' = 0, X, Y and w/r are polynomials of degree 2 in tan of half an angle, and everything is rational
in it. H is a product of powers of polynomials P if H'/H is a sum of multiples of P'/P. Each P is
then a form in the velocities and w. Source: M. Matsumoto, "A slope of a mountain is a Finsler
surface", J. Math. Kyoto Univ. 29 (1989), has such metrics.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction

from inverse_service import errors
from inverse_service.expressions import calculus, terms as tm, tree as ex
from inverse_service.field import exact_field, matrices
from inverse_service.search import material as mt

_HALF = Fraction(1, 2)
# The highest degree of a form in the velocities that becomes a factor of L.
_HIGHEST = 4


@dataclass(frozen=True, slots=True)
class _Line:
    """The velocities x', y' and the root w where r = 1, as polynomials in a variable, and the
    square of w in the velocities.
    """

    variable: ex.Symbol
    x: ex.Expression
    y: ex.Expression
    root: ex.Expression | None = None
    square: ex.Expression | None = None

    def forms(self, degree: int) -> list[tuple[ex.Expression, ex.Expression]]:
        """The monomials of a degree in the velocities and w: on the line, and in the velocities by
        their places.
        """
        powers = [(Fraction(degree - k), Fraction(k)) for k in range(degree + 1)]
        found = [(self.x**i * self.y**j, _X**i * _Y**j) for i, j in powers]
        if self.root is not None and degree:
            rest = _Line(self.variable, self.x, self.y).forms(degree - 1)
            found += [(self.root * on, _W * of) for on, of in rest]
        return found


_X, _Y, _W = (ex.Symbol(f"_{name}") for name in ("x", "y", "w"))


def accepts(material: mt.Material) -> bool:
    """Whether f holds the velocities alone and has degree 2 in them."""
    still = [*material.motion.coordinates, ex.TIME]
    return all(not ex.holds(f, *still) for f in material.analysis.system.accelerations) and all(
        _degree(terms) == 2 for terms in material.motion.forces if terms
    )


def _degree(terms: tm.Terms) -> Fraction | None:
    """The degree of a homogeneous function of the velocities; None for others."""
    found = set[Fraction | None]()
    for key in terms:
        degree = Fraction(0)
        for p, e in key:
            inner = Fraction(1) if isinstance(p, ex.Velocity) else Fraction(0)
            if tm.has_velocity(p) and not isinstance(p, ex.Velocity):
                if not isinstance(p, ex.Sum):
                    return None
                of_sum = _degree(tm.terms_of(p))
                if of_sum is None:
                    return None
                inner = of_sum
            degree += inner * e
        found.add(degree)
    return found.pop() if len(found) == 1 else None


def propose(material: mt.Material, seed: int) -> Iterator[ex.Expression]:
    """The Lagrangian of this form, if the integral of H'/H is one of logarithms."""
    with suppress(
        exact_field.TooLarge, tm.TooManyTerms, ZeroDivisionError, errors.IrreducibleAtoms
    ):
        line = _line_of(material)
        found = None if line is None else _lagrangian(material, line)
        if found is not None:
            yield found


def _line_of(material: mt.Material) -> _Line | None:
    """The line on which f is rational; None for several roots, or another one."""
    trees = map(tm.tree_of, material.motion.forces)
    roots = dict.fromkeys(node.base for node, _ in _powers_of_velocities(trees))
    variable = ex.Symbol("_s")
    if not roots:
        return _Line(variable, ex.ONE, variable)
    if len(roots) > 1:
        return None
    (square,) = roots
    return _on_conic(square, material.motion.velocities, variable)


def _powers_of_velocities(trees: Iterable[ex.Expression]) -> Iterator[tuple[ex.Power, Fraction]]:
    """The powers of functions of the velocities that are no whole ones, with their exponents."""
    for tree in trees:
        for node in ex.walk(tree):
            if isinstance(node, ex.Power) and isinstance(node.exponent, ex.Number):
                e = node.exponent.value
                if e.denominator > 1 and tm.has_velocity(node.base):
                    yield node, e


def _on_conic(
    square: ex.Expression, velocities: Sequence[ex.Velocity], variable: ex.Symbol
) -> _Line | None:
    """w = a x' + u y' in w^2 = a^2 x'^2 + b x' y' + c y'^2, so that (b - 2 a u) x' = (u^2 - c) y'."""
    u, v = velocities
    first, mixed, last = (
        calculus.differentiate(calculus.differentiate(square, left), right)
        for left, right in ((u, u), (u, v), (v, v))
    )
    first, last = (tm.tree_of(tm.terms_of(ex.number(_HALF) * one)) for one in (first, last))
    if any(tm.has_velocity(p) for one in (first, mixed, last) for p in ex.walk(one)):
        return None
    if not isinstance(first, ex.Number) or first.value <= 0:
        return None
    a, rest = tm.root_of_number(first.value, 2)
    if rest != 1:
        return None
    slope = ex.number(a)
    x, y = variable ** Fraction(2) - last, mixed - 2 * slope * variable
    return _Line(variable, x, y, slope * x + variable * y, square)


def _lagrangian(material: mt.Material, line: _Line) -> ex.Expression | None:
    u, v = material.motion.velocities
    forces = [tm.tree_of(f) for f in material.motion.forces]
    table: dict[ex.Expression, ex.Expression] = {u: line.x, v: line.y}
    if line.root is not None:
        table |= {node: line.root ** (2 * e) for node, e in _powers_of_velocities(forces)}
    on_line = [ex.substitute(f, table) / line.x ** Fraction(2) for f in forces]
    ring = exact_field.exact_ring(
        [*on_line, line.variable], [line.variable], 2, exact_field.Budget.long(), unused="kept"
    )
    first, second = map(ring.value, on_line)
    slope = ring.value(line.y) / ring.value(line.x)
    derive, speed = ring.partial(0), ring.partial(0)(slope)
    turn = second - slope * first
    if turn.is_zero:
        return None
    bend = derive(turn) / speed + first
    columns = [[bend], [slope * bend - turn.scaled(2)]]
    right = turn * derive(first).scaled(2) / speed - (first * bend).scaled(2)
    rates = matrices.solution(ring, columns, [right])
    if rates is None:
        return None
    along = rates[0] + slope * rates[1] + first.scaled(2)
    # The derivative of the logarithm of X^2 H by the variable.
    logarithm = derive(ring.value(line.x)).scaled(2) / ring.value(line.x) - along * speed / turn
    shape = _product(ring, line, logarithm)
    if shape is None:
        return None
    names = material.motion.coordinates
    growth = ex.add(
        *(exact_field.quotient_tree(ring, k) * q for k, q in zip(rates, names, strict=True))
    )
    back: dict[ex.Expression, ex.Expression] = {_X: u, _Y: v}
    if line.square is not None:
        back[_W] = ex.power(line.square, ex.number(_HALF))
    parts = (
        mt.positive_form(ex.substitute(base, back), material.analysis.real_point) ** e
        for base, e in shape
    )
    return ex.multiply(ex.Apply("exp", growth), *parts)


def _product(
    ring: exact_field.ExactRing, line: _Line, logarithm: exact_field.Quotient
) -> list[tuple[ex.Expression, ex.Expression]] | None:
    """The forms in the velocities and w with their exponents, of degree 2 together."""
    derive = ring.partial(0)
    bases = [] if logarithm.is_zero else exact_field.factor_trees(ring, logarithm.inverse())
    values = [value for base in bases if not derive(value := ring.value(base)).is_zero]
    powers = matrices.solution(ring, [[derive(p) / p] for p in values], [logarithm])
    unit = _form(ring, line, ring.constant(1), 1)
    if powers is None or unit is None:
        return None
    found = list[tuple[ex.Expression, ex.Expression]]()
    degree: ex.Expression = ex.ZERO
    for p, e in zip(values, powers, strict=True):
        if e.is_zero:
            continue
        power = exact_field.quotient_tree(ring, e)
        form, order = _form_of(ring, line, p)
        if form is None:
            form, order = _form_of(ring, line, p * p)
            power = power / 2
        if form is None:
            return None
        found.append((form, power))
        degree = degree + order * power
    rest = tm.tree_of(tm.terms_of(2 - degree))
    return [*found, (unit, rest)] if rest != ex.ZERO else found


def _form_of(
    ring: exact_field.ExactRing, line: _Line, value: exact_field.Quotient
) -> tuple[ex.Expression | None, int]:
    """The form of least degree that is the value on the line, and its degree."""
    for degree in range(1, _HIGHEST + 1):
        form = _form(ring, line, value, degree)
        if form is not None:
            return form, degree
    return None, 0


def _form(
    ring: exact_field.ExactRing, line: _Line, value: exact_field.Quotient, degree: int
) -> ex.Expression | None:
    monomials = line.forms(degree)
    found = matrices.solution(ring, [[ring.value(on)] for on, _ in monomials], [value])
    if found is None:
        return None
    parts = (
        exact_field.quotient_tree(ring, c) * of for c, (_, of) in zip(found, monomials, strict=True)
    )
    return ex.add(*parts)
