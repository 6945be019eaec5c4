"""A real point at which formulas are defined, and their atoms reduced to independent generators on
its branch.

The point selects the branch of the roots, logarithms, and inverse functions on which a verdict is
valid.

In `reduce_atoms`, trees become fractions of polynomials over Q, so that radicands can be factored.
Generators are the variables, e^(u/m) for free exponentials, tan(phi/2m) for free angles (sin and
cos are rational in it), the other free atoms, and roots of irreducible factors. Without roots the
generators are algebraically independent and the ring is factorial.

Branches of even roots determine which residues must be "positive" for a point to represent the real
domain. Every irreducible factor of a radicand gets its sign at the real point. A factor that itself
contains roots may be a hidden square (5 + 2 sqrt(6)), which its constant residue symbol reveals.
Then sqrt(A + B r), r^2 = c, is sqrt((A + e)/2) +- sqrt((A - e)/2) with e^2 = A^2 - B^2 c if e
exists (Landau, SIAM J. Comput. 21 (1992), section 2), and the sign of that sum is fixed too.

`sample_points` are random real points at which claims about formulas are tried (`vanishes_at`,
`is_singular`); `vanish` and `rank_at_point` test formulas at random points modulo primes.
`is_positive` and `is_nonzero` deduce conditions from others; the cells of the checker make all
deductions.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import mpmath
from flint import arb, ctx, fmpq_mpoly, fmpz_poly, nmod_mat

from inverse_service import bounds, errors
from inverse_service.expressions import (
    calculus,
    collecting,
    functions,
    jets,
    polynomials,
    tree as ex,
)
from inverse_service.field import cells, exact_field, modular, tower as towers

_DIGITS = 40
_TRIES_PER_SCALE = 60
_SCALES = ("1.7", "0.9", "0.4", "0.1", "5", "0.01", "30")
_LARGEST = 10_000
_STARTS, _NODES = 4, (0, 1, -1, 2, -2, 3)  # for walks along the axes
_FINEST = 720  # of parts of pi
_TINY = mpmath.mpf(10) ** -12
_HUGE = mpmath.mpf(10) ** 2000  # the checker's balls distinguish numbers up to 2^8192 = 10^2466

RealTable = dict[ex.Expression, mpmath.mpf]
# Points at which claims about formulas are tried, to `bounds.DIGITS` digits: most, of many names,
# with all names positive, and for a test of one formula; widths in the order in which they are
# drawn.
_MOST_POINTS, _FEWER_POINTS, _MOST_POSITIVE, _POINTS = 20, 8, 6, 3
_MANY_NAMES = 100
_SEED = 18_340_115
_WIDTHS = ("1", "1", "3", "0.4", "6", "0.1")
MOST_TERMS, _CAPACITY = 3_000, 48
# The largest multiple of an angle under a root; the degree of its sine in the tangent of the half
# angle is twice this.
_LARGEST_MULTIPLE = 24
_SAMPLES = 24
_DEEPEST = 6
# Roots in one another: all of k exist at one of 2^k points; the checker gives up before.
_MOST_NESTED = 12


def find_real_point(
    expressions: Sequence[ex.Expression],
    variables: Sequence[modular.Variable],
    seed: int,
    positive: Sequence[ex.Expression] = (),
    margins: Sequence[Fraction] = (Fraction(1, 4), Fraction(0)),
) -> RealTable | None:
    """A random real point at which all expressions have values and `positive` exceed the first
    margin with such a point, or None.
    """
    functions = (
        node
        for node in ex.distinct_nodes((*expressions, *positive))
        if isinstance(node, ex.Arbitrary) and not jets.is_special(node)
    )
    names = list(dict.fromkeys([*variables, *functions]))
    generator = random.Random(f"real {seed}")
    with mpmath.workdps(_DIGITS):
        for margin in margins if positive else margins[-1:]:
            inside = [tree - margin for tree in positive]
            for scale in map(mpmath.mpf, [*_SCALES, *_sizes(positive)]):
                for attempt in range(_TRIES_PER_SCALE):
                    table: RealTable = {
                        name: _draw(generator, scale, "both" if attempt % 2 else "positive")
                        for name in names
                    }
                    table[towers.RADIAN] = mpmath.mpf(1)
                    if are_positive(inside, table) and is_defined(expressions, table, _HUGE):
                        return table
        for _ in range(_STARTS if positive else 0):
            table = {towers.RADIAN: mpmath.mpf(1)}
            table.update({name: _draw(generator, mpmath.mpf(2), "both") for name in names})
            for name in [*variables, *reversed(variables)]:
                _move_along(name, positive, table)
            if are_positive(positive, table) and is_defined(expressions, table):
                return _off_axes(table, positive, expressions)
    return None


def first_real_point(
    expressions: Sequence[ex.Expression],
    variables: Sequence[modular.Variable],
    choices: Iterable[Sequence[ex.Expression]],
) -> RealTable | None:
    """A point as of `find_real_point` for the first of some choices of positive trees for which one
    is found.
    """
    points = (find_real_point(expressions, variables, 1, positive) for positive in choices)
    return next((point for point in points if point is not None), None)


def _off_axes(
    table: RealTable, positive: Sequence[ex.Expression], expressions: Sequence[ex.Expression]
) -> RealTable:
    """The point with a small number in place of each 0."""
    for name in [name for name, value in table.items() if not value]:
        for k in range(1, 4 * _DIGITS):
            moved = table | {name: mpmath.mpf(10) ** -k}
            if are_positive(positive, moved) and is_defined(expressions, moved):
                table = moved
                break
    return table


def _move_along(
    name: modular.Variable, positive: Sequence[ex.Expression], table: RealTable
) -> None:
    """Move the point along the axis of a name so that most trees are positive and the smallest is
    as large as possible.

    Only trees that are polynomials of degree at most 4 along the axis are used; this finds small
    sets between zeros.
    """
    places, trees = [mpmath.mpf(0)], [tree for tree in positive if name in ex.walk(tree)]
    for tree in trees:
        try:
            values = [
                calculus.evaluate(tree, table | {name: node}) for node in map(mpmath.mpf, _NODES)
            ]
            found = mpmath.lu_solve(mpmath.matrix([[mpmath.mpf(x) ** k for k in range(5)] for x in _NODES[:5]]),
                                    mpmath.matrix(values[:5]))  # fmt: skip
            least = mpmath.mpf(10) ** (8 - _DIGITS) * max(map(abs, values))
            shape = [a if abs(a) > least else mpmath.mpf(0) for a in found]
            while shape and not shape[-1]:
                shape.pop()
            if (
                abs(mpmath.polyval(shape[::-1] or [0], _NODES[5]) - values[5]) > least * 10**6
                or len(shape) < 2
            ):
                continue
            slope = [k * a for k, a in enumerate(shape)][1:]
            for coefficients in (shape, slope):
                places += _real_roots(coefficients, least)
        except (calculus.NoRealValue, ZeroDivisionError):
            continue
    places = sorted({*places})
    between = [(a + b) / 2 for a, b in pairwise(places)]
    choices = [
        *places,
        *between,
        places[0] - 1 - abs(places[0]),
        places[-1] + 1 + abs(places[-1]),
        table[name],
    ]
    table[name] = max(choices, key=lambda x: _fit(trees, table | {name: x}))


def _real_roots(coefficients: Sequence[mpmath.mpf], least: mpmath.mpf) -> list[mpmath.mpf]:
    """The real roots of a polynomial, lowest coefficient first, and those that are nearly real."""
    lowest = min(number.exp for number in coefficients)
    scaled = [mpmath.ldexp(number, -int(lowest)) for number in coefficients]
    whole = fmpz_poly([int(number) for number in scaled])
    with ctx.workdps(_DIGITS):
        found: list[Any] = whole.complex_roots()  # pairs (root, multiplicity)
    roots = [mpmath.mpc(_middle(root.real), _middle(root.imag)) for root, _ in found]
    return [root.real for root in roots if abs(root.imag) <= abs(root) * least + least]


def _middle(number: arb) -> mpmath.mpf:
    digits, exponent = number.mid().man_exp()
    return mpmath.ldexp(int(digits), int(exponent))


def _fit(trees: Sequence[ex.Expression], table: RealTable) -> tuple[int, mpmath.mpf]:
    try:
        values = [calculus.evaluate(tree, table) for tree in trees]
    except calculus.NoRealValue:
        return -1, mpmath.mpf(0)
    return sum(value > 0 for value in values), min(values, default=mpmath.mpf(0))


def _sizes(trees: Iterable[ex.Expression]) -> list[int]:
    """Sizes of points beyond the numbers in the trees: abs(x + 40) has a side beyond -40."""
    numbers = {
        abs(node.value) for tree in trees for node in ex.walk(tree) if isinstance(node, ex.Number)
    }
    return [3 * math.ceil(value) for value in sorted(numbers) if 10 < value < _LARGEST]


def table_at(near: Mapping[str, str]) -> RealTable:
    """The point given by texts of the values of x, x', t, a, ..."""
    values = {name: mpmath.mpf(text) for name, text in near.items()}
    named: RealTable = {
        ex.Velocity(n[:-1]) if n.endswith("'") else ex.Symbol(n): x for n, x in values.items()
    }
    return {towers.RADIAN: mpmath.mpf(1)} | named


Signs = Literal["positive", "both"]


def _draw(generator: random.Random, scale: mpmath.mpf, signs: Signs) -> mpmath.mpf:
    magnitude = scale * generator.randrange(1_000, 10_000) / 10_000
    return magnitude if signs == "positive" or generator.random() < 0.5 else -magnitude


def is_defined(
    expressions: Sequence[ex.Expression], table: RealTable, most: mpmath.mpf = mpmath.inf
) -> bool:
    """Whether all expressions have finite values below `most` at the point."""
    known = dict(table)
    try:
        return all(
            abs(calculus.evaluate_once(expression, known)) < most for expression in expressions
        )
    except calculus.NoRealValue:
        return False


def are_positive(trees: Sequence[ex.Expression], table: RealTable) -> bool:
    """Whether all trees are positive at the point by more than rounding errors."""
    try:
        return all(real_sign(tree, table) > 0 for tree in trees)
    except (calculus.NoRealValue, errors.IrreducibleAtoms):
        return False


def real_sign(expression: ex.Expression, table: RealTable) -> int:
    """The sign of a nonzero value of any size: a sum is compared with its largest term."""
    match expression:
        case ex.Number(value) if value:
            return 1 if value > 0 else -1
        case ex.Product(factors):
            return math.prod(real_sign(factor, table) for factor in factors)
        case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1:
            sign = real_sign(base, table)
            return sign if exponent.numerator % 2 else sign * sign
    known, smallest = table.get(expression), _TINY
    if known is None or isinstance(expression, ex.Sum):
        with mpmath.workdps(_DIGITS):
            known = calculus.evaluate(expression, table) if known is None else known
            if isinstance(expression, ex.Sum):
                smallest *= max(abs(calculus.evaluate(term, table)) for term in expression.terms)
    if _may_be_tiny(expression):
        return 1
    if abs(known) < smallest:
        raise errors.IrreducibleAtoms(
            "the sign of an expression under a root could not be determined at a real point"
        )
    return 1 if known > 0 else -1


def _may_be_tiny(expression: ex.Expression) -> bool:
    """Whether it is positive even if its value is tiny."""
    return isinstance(expression, ex.Power) or (
        isinstance(expression, ex.Apply) and expression.function in ("exp", "cosh")
    )


def sample_points(
    trees: Sequence[ex.Expression], positive: Sequence[ex.Expression] = (), most: int = _MOST_POINTS
) -> list[RealTable]:
    """Up to 20 points (8 of many names) at which every tree is real, up to six of them with all
    names positive.

    All trees of `positive` are so at each of them. `most` is a lower limit on their number.

    Equal calls of an arbitrary function get the same value however their arguments are written.
    """
    leaves, calls = _leaves((*trees, *positive))
    source, boxes = random.Random(_SEED), _boxes(positive)
    most = most if len(leaves) <= _MANY_NAMES else min(most, _FEWER_POINTS)
    found: list[RealTable] = []
    in_all = 0
    with mpmath.workdps(bounds.DIGITS):
        least = mpmath.mpf("0.05")
        for attempt in range(bounds.TRIES):
            width = mpmath.mpf(_WIDTHS[attempt // 2 % len(_WIDTHS)])
            in_quadrant = attempt % 2 == 0
            if in_quadrant and in_all == _MOST_POSITIVE:
                continue
            point = {
                leaf: _draw_inside(
                    source, *boxes[leaf], _draw_wide(source, width, least, "positive")
                )
                if leaf in boxes
                else _draw_wide(source, width, least, "positive" if in_quadrant else "both")
                for leaf in leaves
            }
            point.update({call: point[canonical] for call, canonical in calls.items()})
            inside = all(is_positive_at(condition, point) for condition in positive)
            if inside and all(value_at(tree, point) is not None for tree in trees):
                found.append(point)
                in_all += in_quadrant
            if len(found) == most:
                break
    return found


def _leaves(
    trees: Sequence[ex.Expression],
) -> tuple[list[ex.Expression], dict[ex.Arbitrary, ex.Expression]]:
    """What is drawn, and for every call of an arbitrary function its canonical form, which is drawn
    too.
    """
    nodes = dict.fromkeys(ex.distinct_nodes(trees))
    if any(
        isinstance(node, ex.Arbitrary) for node in nodes
    ):  # calls that only collecting brings to light
        nodes |= dict.fromkeys(ex.distinct_nodes(map(collecting.collect, trees)))
    calls = {
        node: collecting.collect(node)
        for node in nodes
        if isinstance(node, ex.Arbitrary) and not jets.is_special(node)
    }
    drawn = [node for node in nodes if isinstance(node, ex.Symbol | ex.Velocity) and node != ex.PI]
    return [*drawn, *dict.fromkeys(calls.values())], calls


def _draw_wide(
    source: random.Random, width: mpmath.mpf, least: mpmath.mpf, signs: Signs
) -> mpmath.mpf:
    size = width * (mpmath.mpf(source.randrange(1, 10**18)) / 10**18 + least)
    return size if signs == "positive" or source.random() < 0.5 else -size


def _draw_inside(
    source: random.Random, low: Fraction | None, high: Fraction | None, size: mpmath.mpf
) -> mpmath.mpf:
    """Between the two, or at a distance of this size from the only one."""
    if low is None or high is None:
        return _real(low) + size if low is not None else _real(high or Fraction(0)) - size
    return _real(low + (high - low) * Fraction(source.randrange(1, 10**18), 10**18))


def _real(value: Fraction) -> mpmath.mpf:
    return mpmath.mpf(value.numerator) / value.denominator


def _boxes(
    positive: Sequence[ex.Expression],
) -> dict[ex.Expression, tuple[Fraction | None, Fraction | None]]:
    """(a, b) of each name u of which u - a > 0 or b - u > 0 are among the conditions; None for what
    is not.
    """
    low: dict[ex.Expression, Fraction] = {}
    high: dict[ex.Expression, Fraction] = {}
    for condition in positive:
        slope, level = (condition, Fraction(0))
        match condition:
            case ex.Sum((part, ex.Number(c))):
                slope, level = part, c
        match slope:
            case ex.Symbol() | ex.Velocity() as leaf:
                low[leaf] = max(-level, low.get(leaf, -level))
            case ex.Product((ex.Number(k), ex.Symbol() | ex.Velocity() as leaf)) if k == -1:
                high[leaf] = min(level, high.get(leaf, level))
    leaves = dict.fromkeys([*low, *high])
    return {
        u: (low.get(u), high.get(u))
        for u in leaves
        if u not in low or u not in high or low[u] < high[u]
    }


def value_at(tree: ex.Expression, point: RealTable) -> mpmath.mpf | None:
    """The value in the working precision, None where there is none; the point keeps it, with those
    of its parts.
    """
    try:
        return calculus.evaluate_once(tree, point)
    except calculus.NoRealValue:
        return None


def is_positive_at(condition: ex.Expression, point: RealTable) -> bool:
    number = value_at(condition, point)
    return number is not None and bool(number > 0)


def vanishes_at(tree: ex.Expression, points: Sequence[RealTable]) -> bool:
    """Whether the tree is 0 to 40 digits at every point at which it is real (one at least)."""
    with mpmath.workdps(bounds.DIGITS):
        values = [
            number for number in (value_at(tree, point) for point in points) if number is not None
        ]
        return bool(values) and all(
            abs(number) <= mpmath.mpf(10) ** -bounds.AGREEING for number in values
        )


def is_singular(matrix: Sequence[Sequence[ex.Expression]], points: Sequence[RealTable]) -> bool:
    """Whether the determinant vanishes at every point at which the entries are real (one at
    least).
    """
    verdicts = []
    with mpmath.workdps(bounds.DIGITS):
        for point in points:
            rows = [[value_at(entry, point) for entry in row] for row in matrix]
            if all(entry is not None for row in rows for entry in row):
                verdicts.append(_vanishes(rows))
            if verdicts and not verdicts[-1]:
                return False
    return bool(verdicts)


def _vanishes(rows: list[list[mpmath.mpf]]) -> bool:
    """|det| against the product of the lengths of the rows (Hadamard)."""
    bound = mpmath.fprod(mpmath.norm(row) for row in rows)
    return bool(
        bound == 0
        or abs(mpmath.det(mpmath.matrix(rows))) <= mpmath.mpf(10) ** -bounds.AGREEING * bound
    )


def vanishes(tree: ex.Expression) -> bool:
    """True where the tree is 0 at several random points, relative to the size of its terms.

    InputError where it is 0 at all points found, and these are fewer.
    """
    points = sample_points([tree], most=_POINTS)
    with mpmath.workdps(bounds.DIGITS):
        vanished = all(is_small(tree, point) for point in points)
    if vanished and len(points) < _POINTS:
        raise errors.InputError(
            "no point was found at which the coefficients of the accelerations are real: check roots and logarithms.",
            "/equations",
        )
    return vanished


def is_small(tree: ex.Expression, table: RealTable) -> bool:
    """Whether a factor is 0 to the working precision; a sum is measured against the sizes of its
    terms.
    """
    match tree:
        case ex.Power(base, _):
            return is_small(base, table)
        case ex.Product(factors):
            return any(is_small(factor, table) for factor in factors)
        case ex.Sum(terms):
            known = dict(table)
            values = [calculus.evaluate_once(term, known) for term in terms]
        case _:
            values = [calculus.evaluate(tree, table)]
    size = mpmath.fsum(map(abs, values)) if len(values) > 1 else 1
    return bool(abs(mpmath.fsum(values)) <= mpmath.mpf(10) ** (10 - bounds.DIGITS) * size)


def is_positive(tree: ex.Expression, known: Iterable[ex.Expression] = ()) -> bool:
    """Whether the tree provably is > 0 wherever it is defined and all of `known` are > 0: 1 + x^2,
    exp(u).
    """
    return _follows(tree, ">", (), tuple(known))


def is_nonzero(
    tree: ex.Expression,
    nonzero: Iterable[ex.Expression] = (),
    positive: Iterable[ex.Expression] = (),
) -> bool:
    """Whether the tree provably is defined and not 0 where none of `nonzero` is 0 and all of
    `positive` are > 0.

    sqrt(x) requires x > 0, because it vanishes at the boundary of its domain.
    """
    return _follows(tree, "!=", tuple(nonzero), tuple(positive))


_follows = lru_cache(maxsize=4096)(cells.follows)


def turns(
    table: RealTable | None,
    atom: ex.Expression,
    known: towers.Combination,
    constants: Sequence[ex.Expression],
) -> towers.Combination | None:
    """The undetermined part of an arctangent relation: atom - sum a_j u_j as a combination of pi
    and constant arctangents.

    None if it is not such a combination. IrreducibleAtoms if there is no real point. This is a
    guess from 30 digits: no consequence of it is shown before the checker, which proves such
    relations itself, agrees.
    """
    if table is None:
        raise errors.IrreducibleAtoms(
            "an arctangent depends on other angles and no real point of f was found"
        )
    with mpmath.workdps(_DIGITS):
        total = calculus.evaluate(atom, table)
        for u, a in known:
            total -= calculus.evaluate(u, table) * a.numerator / a.denominator
        if abs(total) < _TINY:
            return ()
        part = Fraction(int(mpmath.nint(total / mpmath.pi * 10**20)), 10**20).limit_denominator(
            _FINEST
        )
        if abs(total / mpmath.pi * part.denominator - part.numerator) < _TINY:
            return ((ex.PI, part),)
        values = [total, *(calculus.evaluate(u, table) for u in constants), +mpmath.pi]
        found = (
            mpmath.pslq(values, tol=mpmath.mpf(10) ** -30, maxcoeff=1000, maxsteps=10_000)
            if constants
            else None
        )
    if not found or not found[0]:
        return None
    return tuple(
        (u, Fraction(-a, found[0]))
        for u, a in zip((*constants, ex.PI), found[1:], strict=True)
        if a
    )


def requirements(formulas: Iterable[ex.Expression], table: RealTable) -> list[ex.Expression]:
    """The trees that must be positive for the multivalued functions in the formulas to remain on
    their branches.

    These are bases of roots and symbolic powers, arguments of logarithms, distances of the
    arguments of inverse functions from the ends of their domains, and denominators inside any of
    these.
    """
    formulas = tuple(formulas)
    found = dict.fromkeys(own_requirements(formulas))
    for node in ex.distinct_nodes(formulas):
        for tree in poles(_branch_arguments(node)):
            found[tree if real_sign(tree, table) > 0 else -tree] = None
    return [tree for tree in found if varies(tree)]


def own_requirements(formulas: Iterable[ex.Expression]) -> list[ex.Expression]:
    """The trees, such as radicands, that are positive wherever the formulas have a real value."""
    found = dict.fromkeys(
        tree for node in ex.distinct_nodes(formulas) for tree in _own_requirements(node)
    )
    return [tree for tree in found if varies(tree)]


def varies(tree: ex.Expression) -> bool:
    return any(
        isinstance(node, ex.Symbol | ex.Velocity | ex.Arbitrary) and node != ex.PI
        for node in ex.walk(tree)
    )


def _own_requirements(node: ex.Expression) -> list[ex.Expression]:
    match node:
        case ex.Power(base, ex.Number(exponent)) if exponent.denominator > 1:
            return [base]
        case ex.Power(base, exponent) if not isinstance(exponent, ex.Number):
            return [base]
        case ex.Apply(function) if function in functions.FUNCTION:
            return [*functions.FUNCTION[function].needs(*functions.arguments_of(node))]
        case _:
            return []


def _branch_arguments(node: ex.Expression) -> tuple[ex.Expression, ...]:
    match node:
        case ex.Apply(function, u) if function == "log" or function in functions.INVERSE:
            return (u,)
        case ex.Integral():
            return (*node.arguments, *(slope for slope in node.derivatives if slope is not None))
        case ex.Arbitrary(_, arguments, _):
            return arguments
        case ex.Power(base, exponent) if (
            not isinstance(exponent, ex.Number) or exponent.value.denominator > 1
        ):
            return (base, exponent)
        case _:
            return ()


def poles(formulas: Iterable[ex.Expression]) -> list[ex.Expression]:
    """The trees that must not vanish in the formulas."""
    found = dict.fromkeys(tree for node in ex.distinct_nodes(formulas) for tree in _own_poles(node))
    return [tree for tree in found if varies(tree)]


def _own_poles(node: ex.Expression) -> list[ex.Expression]:
    match node:
        case ex.Power(base, ex.Number(exponent)) if exponent < 0:
            return [base]
        case ex.Apply(function) if function in functions.FUNCTION:
            return [*functions.FUNCTION[function].poles(*functions.arguments_of(node))]
        case _:
            return []


@dataclass(slots=True)
class Generators(exact_field.ExactRing):
    """A ring that adjoins functions and roots on demand; a square root gets its relation.

    `roots` are those that were read since the tower has `signs` of so many factors: a root is read
    with its base and with the factors of that, which for nested ones would double at each level.
    """

    tower: towers.Tower = field(default_factory=lambda: towers.Tower(()))
    roots: dict[ex.Power, exact_field.Quotient] = field(default_factory=dict)
    signs: int = 0

    def letter(self, tree: ex.Expression, square: fmpq_mpoly | None = None) -> exact_field.Quotient:
        """The tree as a generator; IrreducibleAtoms if there are too many."""
        if tree not in self.atoms:
            if not self.free:
                raise errors.IrreducibleAtoms("too many different atoms occur under roots")
            self.atoms[tree] = self.generator(index := self.new_generator(tree))
            if square is not None:
                self.field.relate(index, 2, square)
        return self.atoms[tree]

    def value(self, tree: ex.Expression) -> exact_field.Quotient:
        """The tree (in kernels) over the generators; TooLarge if it becomes too large."""
        match tree:
            case ex.Symbol() | ex.Velocity() | ex.Arbitrary():
                return self.letter(tree)
            case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1:
                return self.value(base) ** int(exponent)
            case ex.Power(base, ex.Number(exponent)):
                if self.signs != (signs := len(self.tower.signs)):
                    self.signs, self.roots = signs, {}
                if tree not in self.roots:
                    self.roots[tree] = _root(self, base, exponent)
                return self.roots[tree]
            case ex.Apply():
                return _atom(self, tree)
        return exact_field.ExactRing.value(self, tree)

    def sign(self, factor: ex.Expression) -> int:
        """The sign of an irreducible factor at the real point, on the branches fixed so far."""
        if isinstance(factor, ex.Symbol | ex.Velocity):
            return self.tower.real_signs.get(factor, 1)
        return next((sign for known, sign in self.tower.signs if known == factor), 1)


def used_generators(polynomial: fmpq_mpoly) -> list[int]:
    return [k for k, degree in enumerate(polynomial.degrees()) if degree > 0]


def factors(polynomial: fmpq_mpoly) -> polynomials.Factors:
    """(rational content, [(irreducible factor, multiplicity)]); IrreducibleAtoms if it becomes too
    large.
    """
    try:
        return polynomials.factor_polynomial(polynomial)
    except exact_field.TooLarge as error:
        raise errors.IrreducibleAtoms(str(error)) from error


def to_quotient(ring: Generators, expression: ex.Expression) -> exact_field.Quotient:
    """The tree (in kernels) over the generators; IrreducibleAtoms if it has no value or becomes too
    large.
    """
    try:
        found = ring.value(expression)
    except (exact_field.TooLarge, ZeroDivisionError) as error:
        raise errors.IrreducibleAtoms(
            "an expression under a root is too large to be factored"
        ) from error
    if len(found.numerator) > MOST_TERMS:
        raise errors.IrreducibleAtoms("an expression under a root is too large to be factored")
    return found


def _root(ring: Generators, base: ex.Expression, exponent: Fraction) -> exact_field.Quotient:
    """prod p_i^(k_i exponent) over the irreducible factors of the base, with |p_i| under even
    roots.
    """
    quotient = ring.value(base)
    even = exponent.denominator % 2 == 0
    negative = not even and factors(quotient.numerator)[0] < 0
    result = ring.constant((-1 if negative else 1) ** exponent.numerator)
    for tree, multiplicity in positive_factors(ring, quotient):
        positive = -tree if even and ring.sign(tree) < 0 else tree
        result = result * _root_power(ring, positive, exponent * multiplicity)
    return result


def positive_factors(
    ring: Generators, quotient: exact_field.Quotient
) -> Iterator[tuple[ex.Expression, int]]:
    """Irreducible factors (primes of the content first) of numerator and denominator, as trees."""
    content, found = factors(quotient.numerator)
    for value, way in ((abs(content.numerator), 1), (content.denominator, -1)):
        yield from ((ex.number(ell), way * k) for ell, k in modular.prime_factors(value))
    yield from ((exact_field.polynomial_tree(ring, factor), k) for factor, k in found)
    yield from (
        (exact_field.polynomial_tree(ring, ring.field.denominators[index]), -k)
        for index, k in quotient.exponents
    )


def _root_power(ring: Generators, base: ex.Expression, exponent: Fraction) -> exact_field.Quotient:
    """base^exponent with a generator for the root of smallest denominator."""
    whole = math.floor(exponent)
    part, inner = exponent - whole, ring.value(base)
    if not part:
        return inner**whole
    square = inner.numerator if part.denominator == 2 else None
    return (
        inner**whole * ring.letter(base ** Fraction(1, part.denominator), square) ** part.numerator
    )


def _atom(ring: Generators, atom: ex.Apply) -> exact_field.Quotient:
    for rule in ring.tower.rules:
        if isinstance(rule, towers.AngleRule):
            if rule.angle == atom.argument and atom.function in ("sin", "cos"):
                return _sine_cosine(ring, rule)[atom.function == "sin"]
        elif rule.atom == atom:
            if isinstance(rule, towers.ExponentialRule) and not rule.free:
                return _dependent_exponential(ring, rule)
            if isinstance(rule, towers.LogarithmRule | towers.ArctangentRule) and not rule.free:
                return _linear(ring, rule)
    return ring.letter(atom)


def _dependent_exponential(ring: Generators, rule: towers.ExponentialRule) -> exact_field.Quotient:
    parts = [_root_power(ring, atom, a) for atom, a in rule.exponentials]
    parts += [_root(ring, argument, a) for argument, a in rule.arguments_of_logarithms]
    parts += [_root_power(ring, ex.number(ell), a) for ell, a in rule.prime_powers]
    if rule.constant:
        parts.append(ring.letter(ex.Apply("exp", ex.number(rule.constant))))
    return math.prod(parts, start=ring.constant(1))


def _linear(
    ring: Generators, rule: towers.LogarithmRule | towers.ArctangentRule
) -> exact_field.Quotient:
    parts = [ring.value(a * u) for u, a in rule.linear]
    if isinstance(rule, towers.ArctangentRule):
        parts.append(ring.value(rule.turns * ex.PI))
    else:
        for value, way in ((rule.constant.numerator, 1), (rule.constant.denominator, -1)):
            for ell, k in modular.prime_factors(value):
                logarithm = ring.letter(ex.Apply("log", ex.number(ell)))
                parts.append(logarithm.scaled(Fraction(way * k, rule.root)))
    return exact_field.sum_of(ring.constant(0), parts)


def _sine_cosine(
    ring: Generators, rule: towers.AngleRule
) -> tuple[exact_field.Quotient, exact_field.Quotient]:
    """(cos, sin) as fractions in tan(half angle)."""
    if rule.turns or rule.arctangents:
        raise errors.IrreducibleAtoms("an angle with pi or an arctangent occurs under a root")
    one = ring.constant(1)
    real, imaginary, denominator = one, one - one, one
    steps: Mapping[ex.Expression, Fraction] = (
        {rule.angle: Fraction(1)} if rule.free else dict(rule.angles)
    )
    if rule.radians:
        steps = {**steps, towers.RADIAN: rule.radians}
    for angle, factor in steps.items():
        scale = ring.tower.scale(angle)
        t = ring.letter(towers.half_angle(angle, scale))
        count = int(factor * scale)
        if abs(count) > _LARGEST_MULTIPLE:
            raise errors.IrreducibleAtoms(
                "an angle under a root is too large a multiple of another to be reduced"
            )
        c, s = one - t * t, t.scaled(2 if count > 0 else -2)
        for _ in range(abs(count)):
            real, imaginary = real * c - imaginary * s, real * s + imaginary * c
        denominator = denominator * (one + t * t) ** abs(count)
    return real / denominator, imaginary / denominator


def fix_branches(tower: towers.Tower, table: RealTable | None) -> None:
    """Add the signs of all factors of its radicands to the tower; IrreducibleAtoms if that
    fails.
    """
    radicands, tower.radicands = tower.radicands, []
    if not radicands:
        return
    if table is None:
        raise errors.IrreducibleAtoms(
            "f contains roots and no real point was found at which all of them are defined"
        )
    owner = exact_field.QuotientField.with_generators(_CAPACITY)
    ring = Generators(owner, (), _CAPACITY, slopes=False, plain_powers=True, tower=tower)
    for radicand in radicands:
        _fix(ring, radicand, table, _DEEPEST)
        tower.radicands.append(radicand)


def _fix(ring: Generators, radicand: ex.Expression, table: RealTable, depth: int) -> None:
    if depth == 0:
        raise errors.IrreducibleAtoms("roots are nested too deeply to be reduced")
    if real_sign(radicand, table) < 0:
        raise errors.IrreducibleAtoms("an even root of a negative quantity is not real")
    for factor, _ in positive_factors(ring, to_quotient(ring, radicand)):
        _fix_factor(ring, factor, table, depth)


def _fix_factor(ring: Generators, factor: ex.Expression, table: RealTable, depth: int) -> None:
    known = ring.tower.signs
    # Variables already have a sign, and a root is positive by construction.
    if (
        isinstance(factor, ex.Number | ex.Symbol | ex.Velocity)
        or towers.is_root(factor)
        or any(p == factor for p, _ in known)
    ):
        return
    sign = real_sign(factor, table)
    polynomial = to_quotient(ring, factor).numerator
    if any(
        towers.is_root(ring.trees[k]) for k in used_generators(polynomial)
    ) and _has_constant_symbol(ring.tower, factor):
        positive = factor if sign > 0 else -factor
        root = _denested(ring, positive, table, depth)
        known.append((root, real_sign(root, table)))
    known.append((factor, sign))


def _has_constant_symbol(tower: towers.Tower, factor: ex.Expression) -> bool:
    """Whether the residue symbol is the same at random points that agree with the tower."""
    found = set()
    for k in range(_SAMPLES):
        point = towers.draw_point(tower, 5000 + k)
        found.add(modular.is_positive(modular.evaluate(factor, point), point.prime))
        if len(found) > 1:
            return False
    return True


def _denested(
    ring: Generators, factor: ex.Expression, table: RealTable, depth: int
) -> ex.Expression:
    """A tree in roots of simpler quantities whose square is the factor."""
    polynomial = to_quotient(ring, factor).numerator
    for k in used_generators(polynomial):
        root = _split_root(ring, polynomial, k) if k in ring.field.relations else None
        if root is None:
            continue
        for radicand in root[:2]:
            if real_sign(radicand, table) < 0:
                break
            _fix(ring, radicand, table, depth - 1)
            ring.tower.radicands.append(radicand)
        else:
            first, second = ex.square_root(root[0]), ex.square_root(root[1])
            sign = real_sign(root[2], table)
            return first + second if sign > 0 else first - second
    raise errors.IrreducibleAtoms(
        "a nested root depends on other roots in a way that was not found; denest it by hand"
    )


class SplitRoot(NamedTuple):
    """(A + e)/2, (A - e)/2, and B."""

    upper: ex.Expression
    lower: ex.Expression
    slope: ex.Expression


def _split_root(ring: Generators, polynomial: fmpq_mpoly, k: int) -> SplitRoot | None:
    """((A + e)/2, (A - e)/2, B) for A + B r with e^2 = A^2 - B^2 r^2 a square up to a rational
    factor.
    """
    slope = polynomial.derivative(k)
    rest = polynomial - slope * ring.field.context.gen(k)
    e = _square_root(
        ring, ring.field.reduce(rest * rest - slope * slope * ring.field.relations[k].right)
    )
    if e is None:
        return None
    middle, half = exact_field.polynomial_tree(ring, rest), ex.number(Fraction(1, 2))
    return SplitRoot(
        half * (middle + e), half * (middle - e), exact_field.polynomial_tree(ring, slope)
    )


def _square_root(ring: Generators, polynomial: fmpq_mpoly) -> ex.Expression | None:
    """sqrt(content) prod p^(k/2) if all multiplicities are even and the content is positive, else
    None.
    """
    content, found = factors(polynomial)
    if content <= 0 or any(k % 2 for _, k in found):
        return None
    parts = [
        ex.multiply(*[exact_field.polynomial_tree(ring, factor)] * (k // 2)) for factor, k in found
    ]
    return ex.multiply(ex.square_root(ex.number(content)), *parts)


def reduce_atoms(
    expressions: Sequence[ex.Expression],
    variables: Sequence[modular.Variable],
    table: RealTable | None,
) -> towers.Tower:
    """The tower of expressions in kernels; raises IrreducibleAtoms if it cannot be determined.

    Relations may depend on branches: exp(sqrt((x - y)^2)) is exp(x - y) where x > y. If a function
    has a root in its argument, they are therefore searched for again once the branches are known.
    """
    nodes = tuple(ex.distinct_nodes(expressions))
    roots = (node for node in nodes if towers.is_even_root(node))
    if (nested := ex.nesting(roots, towers.is_even_root)) > _MOST_NESTED:
        raise errors.IrreducibleAtoms(
            f"{nested} roots are nested in one another, and relations among more than "
            f"{_MOST_NESTED} are not looked for"
        )
    signs = {} if table is None else {name: real_sign(name, table) for name in variables}
    if any(isinstance(node, ex.Arbitrary) for node in nodes):
        expressions = jets.with_laws(expressions)
    tower = towers.build_tower(expressions, variables, signs, partial(turns, table))
    fix_branches(tower, table)
    if tower.signs and _have_root_inside(expressions):
        tower = towers.build_tower(
            expressions, variables, signs, partial(turns, table), known=tower
        )
        fix_branches(tower, table)
    return tower


def _have_root_inside(expressions: Sequence[ex.Expression]) -> bool:
    """Whether a transcendental function has an even root in its argument."""
    arguments = (
        node.argument for node in ex.distinct_nodes(expressions) if isinstance(node, ex.Apply)
    )
    return any(towers.is_even_root(node) for node in ex.distinct_nodes(arguments))


def values_modulo_primes(
    expressions: Sequence[ex.Expression],
    variables: Sequence[modular.Variable],
    points: int = 2,
    seed: int = 1,
) -> list[tuple[modular.Point, list[int]]] | None:
    """The residues of all expressions at `points` random points, each over a separate prime.

    None if the relations among their functions cannot be determined or no point is found.
    """
    kernels = [towers.to_kernels(expression) for expression in expressions]
    try:
        table = find_real_point(kernels, variables, seed)
        tower = reduce_atoms(kernels, variables, table)
        found = []
        for attempt in range(bounds.ATTEMPTS):
            point = towers.draw_point(tower, seed * bounds.ATTEMPTS + attempt)
            known: dict[ex.Expression, int] = {}
            try:
                found.append(
                    (point, [modular.evaluate(kernel, point, known) for kernel in kernels])
                )
            except (modular.SingularPoint, ValueError, ZeroDivisionError, KeyError):
                continue
            if len(found) == points:
                return found
    except (errors.IrreducibleAtoms, KeyError):
        return None
    return None


def vanish(
    expressions: Sequence[ex.Expression], variables: Sequence[modular.Variable], seed: int = 1
) -> bool | None:
    """True if all vanish at two points, False if one does not, None if that cannot be decided.

    A nonzero rational function of degree d vanishes at a random point with probability about
    d/2^61.
    """
    if not expressions:
        return True
    found = values_modulo_primes(expressions, variables, 2, seed)
    return None if found is None else all(not any(values) for _, values in found)


def rank_at_point(
    matrix: Sequence[Sequence[ex.Expression]], variables: Sequence[modular.Variable], seed: int = 1
) -> int | None:
    """The rank of a matrix of expressions at a random point, which is its generic rank (almost
    surely).
    """
    flat = [entry for row in matrix for entry in row]
    if not flat:
        return 0
    found = values_modulo_primes(flat, variables, 1, seed)
    if found is None:
        return None
    ((point, values),) = found
    return int(nmod_mat(len(matrix), len(matrix[0]), values, point.prime).rank())
