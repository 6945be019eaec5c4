"""Whole equations, linear in the accelerations, solved for them: M(t, q, q') q'' = -b(t, q, q').

The matrix is inverted exactly, block by block of its triangular form, by fraction-free elimination
(Bareiss 1968) over polynomials in opaque atoms. Atoms may be related (sin^2 + cos^2 = 1), so a
determinant that is not the zero polynomial is also confirmed not to vanish at random real points
(`sample_points`), to 50 digits.

`OpaqueRing` holds trees as quotients of exact polynomials in opaque atoms (python-flint). An atom is a symbol, a
velocity, an elementary or arbitrary function, a root or a power that is not an integer; relations among atoms are
not known here. So an identity proven in these polynomials is true, but a polynomial that is not zero may still be the
zero function.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import flint
from mpmath import mp, mpf

from inverse_service import bounds, errors
from inverse_service.expressions import collecting, evaluation, graphs, inequalities, tree as ex
from inverse_service.field import exact_field
from inverse_service.mechanics import euler_lagrange, writing

_POINTS = 3
_MOST_POINTS, _FEWER_POINTS = 20, 8
_MANY_NAMES = 100
_MOST_POSITIVE = 6
_SEED = 18_340_115
_WIDTHS = ("1", "1", "3", "0.4", "6", "0.1")

Point = dict[ex.Expression, Any]
Polynomial = Any  # python-flint has no types
Rows = list[list[Polynomial]]

MOST_TERMS = 40_000
_FACTORED_TERMS = 100
_LARGE = 10**9


@dataclass(frozen=True, slots=True)
class LinearEquation:
    """Coefficient of each coordinate's acceleration (missing: 0) and what is left; `pointer` is its place."""

    coefficients: Mapping[str, ex.Expression]
    rest: ex.Expression
    pointer: str = ""


def linear_equation(residual: ex.Expression, pointer: str = "") -> LinearEquation:
    """The parts of residual = 0; InputError where an acceleration enters otherwise than linearly."""
    parts = euler_lagrange.linear_parts(residual, ex.Acceleration)
    if not isinstance(parts, tuple):
        name = parts.coordinate
        detail = f"the acceleration {name}'' does not enter linearly: write the equation solved for {name}''."
        raise errors.InputError(detail, pointer)
    return LinearEquation({leaf.coordinate: slope for leaf, slope in parts[0].items()}, parts[1], pointer)


@dataclass(frozen=True, slots=True)
class Solved:
    """f with q'' = f, and what the equations are divided by for it that f does not show: M q'' = -b where det M != 0.

    x x'' = -x gives f = -1 and x, which is not 0 where the two say the same.
    """

    accelerations: tuple[ex.Expression, ...]
    nonzero: tuple[ex.Expression, ...] = ()


def solve_accelerations(equations: Sequence[LinearEquation], coordinates: Sequence[str]) -> tuple[ex.Expression, ...]:
    """f with q'' = f, in the order of `coordinates`; errors as of `solve_lines`."""
    return solve_lines(equations, coordinates).accelerations


def solve_lines(equations: Sequence[LinearEquation], coordinates: Sequence[str]) -> Solved:
    """f with q'' = f, in the order of `coordinates`, and where.

    InputError where the numbers differ or the matrix of the accelerations is singular; LimitError
    where its inverse would be too large to write down.
    """
    if len(equations) != len(coordinates):
        raise _wrong_number(len(equations), coordinates)
    ring = OpaqueRing([c for equation in equations for c in equation.coefficients.values()])
    atoms = (atom for equation in equations for atom in atoms_of(equation.rest))
    places = {atom: place for place, atom in enumerate(atoms)}
    rows = [_row(ring, equation, coordinates) for equation in equations]
    pattern = [[k for k, entry in enumerate(row) if not entry.numerator.is_zero()] for row in rows]
    row_of = _matched(pattern, equations, coordinates)
    solved: dict[str, ex.Expression] = {}
    divisors = dict[ex.Expression, None]()
    for block in graphs.components({column: pattern[row_of[column]] for column in range(len(pattern))}):
        chosen = [row_of[column] for column in block]
        rests = [_with_known(equations[row], solved) for row in chosen]
        matrix = [[rows[row][column] for column in block] for row in chosen]
        inverse = inverse_of(ring, matrix)
        if inverse is None or vanishes(ring.tree(OpaqueFraction(inverse.determinant, ring.constant(1)))):
            raise _singular([coordinates[column] for column in block])
        below = (inverse.determinant, *inverse.scales)
        divisors.update(dict.fromkeys(factor for each in below for factor in ring.factors_of(each)))
        for row, column in zip(inverse.adjugate, block, strict=True):
            entries = [ring.reduced(entry, inverse.determinant) for entry in row]
            solved[coordinates[column]] = _solution(ring, entries, rests, places)
    written = [tree for equation in equations for tree in (*equation.coefficients.values(), equation.rest)]
    found = tuple(writing.with_sums_as_in(solved[name], written) for name in coordinates)
    moving = {ex.TIME, *map(ex.Symbol, coordinates), *map(ex.Velocity, coordinates)}
    return Solved(found, unseen([one for one in divisors if not moving.isdisjoint(ex.walk(one))], found))


def unseen(divisors: Sequence[ex.Expression], accelerations: Sequence[ex.Expression]) -> tuple[ex.Expression, ...]:
    """Those that may be 0, by which no acceleration is divided, and of which none has a root."""
    if not divisors:
        return ()
    seen = list[ex.Expression]()
    for node in ex.distinct_nodes(accelerations):
        if not (isinstance(node, ex.Power) and isinstance(node.exponent, ex.Number)):
            continue
        if node.exponent.value.denominator > 1:
            seen.append(node.base ** Fraction(1, node.exponent.value.denominator))
        if node.exponent.value < 0 or node.exponent.value.denominator > 1:
            ring = OpaqueRing([node.base])
            with suppress(errors.LimitError, ZeroDivisionError):
                seen += ring.factors_of(ring.fraction(node.base).numerator)
    return tuple(one for one in divisors if not inequalities.is_nonzero(one, seen))


def _row(ring: OpaqueRing, equation: LinearEquation, coordinates: Sequence[str]) -> list[OpaqueFraction]:
    zero = ring.fraction(ex.ZERO)
    try:
        found = {name: ring.fraction(tree) for name, tree in equation.coefficients.items()}
        return [found.get(name, zero) for name in coordinates]
    except ZeroDivisionError:
        raise errors.InputError("an equation divides by zero: remove the division.", equation.pointer) from None


def _matched(
    pattern: list[list[int]], equations: Sequence[LinearEquation], coordinates: Sequence[str]
) -> dict[int, int]:
    for columns, equation in zip(pattern, equations, strict=True):
        if not columns:
            raise errors.InputError(
                "this equation contains no acceleration, the matrix of the accelerations is singular, as is every "
                "Lagrangian that has it: write an equation of second order, or give a constraint as a nonholonomic "
                "system.",
                equation.pointer,
            )
    found = graphs.matching(pattern)
    lost = [name for column, name in enumerate(coordinates) if column not in found]
    if lost:
        raise _singular(lost)
    return found


def _with_known(equation: LinearEquation, solved: Mapping[str, ex.Expression]) -> ex.Expression:
    """The terms without unknown accelerations, after substituting the accelerations of earlier blocks."""
    known = [(solved[name], c) for name, c in equation.coefficients.items() if name in solved]
    return ex.add(equation.rest, *(_scaled(coefficient, acceleration) for acceleration, coefficient in known))


def _scaled(coefficient: ex.Expression, expression: ex.Expression) -> ex.Expression:
    """The product; a number is multiplied into the terms of a sum."""
    if isinstance(coefficient, ex.Number) and isinstance(expression, ex.Sum):
        return ex.add(*(coefficient * term for term in expression.terms))
    return coefficient * expression


def _solution(
    ring: OpaqueRing,
    inverse_row: Sequence[OpaqueFraction],
    rests: Sequence[ex.Expression],
    places: Mapping[ex.Expression, int],
) -> ex.Expression:
    """-Σ inverse_j rest_j: unchanged, or over one denominator where that is not much longer."""
    parts = [(entry, rest) for entry, rest in zip(inverse_row, rests, strict=True) if not entry.numerator.is_zero()]
    plain = ex.add(*(_scaled(-1 * ring.tree(entry), rest) for entry, rest in parts))
    if all(isinstance(ring.tree(entry), ex.Number) and len(parts) == 1 for entry, _ in parts):
        return plain
    gathered = writing.numbers_outside(writing.one_square(_gathered(plain, places)))
    return gathered if 2 * ex.node_count(gathered) <= 3 * ex.node_count(plain) else plain


def _gathered(plain: ex.Expression, places: Mapping[ex.Expression, int]) -> ex.Expression:
    """The same over one denominator, in lowest terms; as it is where that would be too large."""
    if max(expanded_terms(plain)) > bounds.TERMS:
        return plain
    ring = OpaqueRing([plain], places)
    try:
        return ring.tree(ring.fraction(plain))
    except (errors.LimitError, ZeroDivisionError):
        return plain


def _wrong_number(count: int, coordinates: Sequence[str]) -> errors.InputError:
    wanted = ", ".join(f"{name}''" for name in coordinates)
    equations, number_of = ("1 equation is" if count == 1 else f"{count} equations are"), len(coordinates)
    return errors.InputError(
        f"{equations} given for {number_of} acceleration{'s' * (number_of != 1)} ({wanted}): "
        "write one equation for each coordinate."
        + " Constraints and their multipliers go with a Lagrangian: L = …, x' = …."
        * (count > number_of),
        "/equations",
    )


def _singular(names: Sequence[str]) -> errors.InputError:
    unknowns = ", ".join(f"{name}''" for name in names)
    return errors.InputError(
        f"the matrix of the accelerations is singular, the equations do not determine {unknowns}: "
        "write equations that are independent in the accelerations.",
        "/equations",
    )


def sample_points(
    trees: Sequence[ex.Expression], positive: Sequence[ex.Expression] = (), most: int = _MOST_POINTS
) -> list[Point]:
    """Up to 20 points (8 of many names) at which every tree is real, up to six of them with all names positive.

    All trees of `positive` are so at each of them. `most` is a lower limit on their number.

    Equal calls of an arbitrary function get the same value however their arguments are written.
    """
    leaves, calls = _leaves((*trees, *positive))
    source, boxes = random.Random(_SEED), _boxes(positive)
    most = most if len(leaves) <= _MANY_NAMES else min(most, _FEWER_POINTS)
    found: list[Point] = []
    in_all = 0
    with mp.workdps(bounds.DIGITS):
        least = mpf("0.05")
        for attempt in range(bounds.TRIES):
            width = mpf(_WIDTHS[attempt // 2 % len(_WIDTHS)])
            in_quadrant = attempt % 2 == 0
            if in_quadrant and in_all == _MOST_POSITIVE:
                continue
            point = {
                leaf: _draw_inside(source, *boxes[leaf], _draw(source, width, least, True))
                if leaf in boxes
                else _draw(source, width, least, in_quadrant)
                for leaf in leaves
            }
            point.update({call: point[canonical] for call, canonical in calls.items()})
            inside = all(is_positive(condition, point) for condition in positive)
            if inside and all(value(tree, point) is not None for tree in trees):
                found.append(point)
                in_all += in_quadrant
            if len(found) == most:
                break
    return found


def _leaves(trees: Sequence[ex.Expression]) -> tuple[list[ex.Expression], dict[ex.Arbitrary, ex.Expression]]:
    """What is drawn, and for every call of an arbitrary function its canonical form, which is drawn too."""
    nodes = dict.fromkeys(ex.distinct_nodes(trees))
    if any(isinstance(node, ex.Arbitrary) for node in nodes):  # calls that only collecting brings to light
        nodes |= dict.fromkeys(ex.distinct_nodes(map(collecting.collect, trees)))
    calls = {node: collecting.collect(node) for node in nodes if isinstance(node, ex.Arbitrary)}
    drawn = [node for node in nodes if isinstance(node, ex.Symbol | ex.Velocity) and node != ex.PI]
    return [*drawn, *dict.fromkeys(calls.values())], calls


def _draw(source: random.Random, width: evaluation.Real, least: evaluation.Real, positive: bool) -> evaluation.Real:
    size = width * (mpf(source.randrange(1, 10**18)) / 10**18 + least)
    return size if positive or source.random() < 0.5 else -size


def _draw_inside(source: random.Random, low: Fraction | None, high: Fraction | None, size: Any) -> evaluation.Real:
    """Between the two, or at a distance of this size from the only one."""
    if low is None or high is None:
        return _real(low) + size if low is not None else _real(high or Fraction(0)) - size
    return _real(low + (high - low) * Fraction(source.randrange(1, 10**18), 10**18))


def _real(value: Fraction) -> evaluation.Real:
    return mpf(value.numerator) / value.denominator


def _boxes(positive: Sequence[ex.Expression]) -> dict[ex.Expression, tuple[Fraction | None, Fraction | None]]:
    """(a, b) of each name u of which u - a > 0 or b - u > 0 are among the conditions; None for what is not."""
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
    return {u: (low.get(u), high.get(u)) for u in leaves if u not in low or u not in high or low[u] < high[u]}


def value(tree: ex.Expression, point: Point) -> evaluation.Real | None:
    """The value in the working precision, None where there is none; the point keeps it, with those of its parts."""
    try:
        return evaluation.evaluate_once(tree, point)
    except evaluation.NoRealValue:
        return None


def is_positive(condition: ex.Expression, point: Point) -> bool:
    number = value(condition, point)
    return number is not None and bool(number > 0)


def vanishes_at(tree: ex.Expression, points: Sequence[Point]) -> bool:
    """Whether the tree is 0 to 40 digits at every point at which it is real (one at least)."""
    with mp.workdps(bounds.DIGITS):
        values = [number for number in (value(tree, point) for point in points) if number is not None]
        return bool(values) and all(abs(number) <= mpf(10) ** -bounds.AGREEING for number in values)


def is_singular(matrix: Sequence[Sequence[ex.Expression]], points: Sequence[Point]) -> bool:
    """Whether the determinant vanishes at every point at which the entries are real (one at least)."""
    verdicts = []
    with mp.workdps(bounds.DIGITS):
        for point in points:
            rows = [[value(entry, point) for entry in row] for row in matrix]
            if all(entry is not None for row in rows for entry in row):
                verdicts.append(_vanishes(rows))
            if verdicts and not verdicts[-1]:
                return False
    return bool(verdicts)


def _vanishes(rows: list[list[evaluation.Real]]) -> bool:
    """|det| against the product of the lengths of the rows (Hadamard)."""
    bound = mp.fprod(mp.norm(row) for row in rows)
    return bool(bound == 0 or abs(mp.det(mp.matrix(rows))) <= mpf(10) ** -bounds.AGREEING * bound)


def vanishes(tree: ex.Expression) -> bool:
    """True where the tree is 0 at several random points, relative to the size of its terms.

    InputError where it is 0 at all points found, and these are fewer.
    """
    points = sample_points([tree], most=_POINTS)
    with mp.workdps(bounds.DIGITS):
        vanished = all(is_small(tree, point) for point in points)
    if vanished and len(points) < _POINTS:
        raise errors.InputError(
            "no point was found at which the coefficients of the accelerations are real: check roots and logarithms.",
            "/equations",
        )
    return vanished


def is_small(tree: ex.Expression, table: Mapping[ex.Expression, evaluation.Real]) -> bool:
    """Whether a factor is 0 to the working precision; a sum is measured against the sizes of its terms."""
    match tree:
        case ex.Power(base, _):
            return is_small(base, table)
        case ex.Product(factors):
            return any(is_small(factor, table) for factor in factors)
        case ex.Sum(terms):
            known = dict(table)
            values = [evaluation.evaluate_once(term, known) for term in terms]
        case _:
            values = [evaluation.evaluate(tree, table)]
    size = mp.fsum(map(abs, values)) if len(values) > 1 else 1
    return bool(abs(mp.fsum(values)) <= mpf(10) ** (10 - bounds.DIGITS) * size)


@dataclass(frozen=True, slots=True)
class OpaqueFraction:
    """numerator / denominator without a common factor; the denominator is not the zero polynomial."""

    numerator: Polynomial
    denominator: Polynomial


class OpaqueRing:
    """Polynomials over the rationals in the atoms of some trees.

    Symbols come first, velocities last, each by its number in `places` and then as they appear in
    the trees: so printed products look like R sin(phi) phi'.
    """

    __slots__ = ("_context", "_index", "_roots", "atoms")

    def __init__(self, trees: Iterable[ex.Expression], places: Mapping[ex.Expression, int] | None = None) -> None:
        found: dict[ex.Expression, None] = {}
        for tree in trees:
            found.update(dict.fromkeys(atoms_of(tree)))
        known = places or {}
        self.atoms = tuple(sorted(found, key=lambda atom: (_rank(atom), known.get(atom, math.inf))))
        self._index = {atom: place for place, atom in enumerate(self.atoms)}
        self._roots = {base: (atom, degree) for atom in self.atoms for base, degree in _root_of(atom)}
        names = tuple(f"a{place}" for place in range(max(1, len(self.atoms))))
        self._context = flint.fmpq_mpoly_ctx.get(names, flint.Ordering.lex)

    def constant(self, value: int | Fraction) -> Polynomial:
        value = Fraction(value)
        return self._context.constant(flint.fmpq(value.numerator, value.denominator))

    def reduced(self, numerator: Polynomial, denominator: Polynomial) -> OpaqueFraction:
        """The quotient in lowest terms."""
        common = numerator.gcd(denominator)
        if not common.is_constant():
            numerator, denominator = divmod(numerator, common)[0], divmod(denominator, common)[0]
        return OpaqueFraction(numerator, denominator)

    def fraction(self, tree: ex.Expression) -> OpaqueFraction:
        """The tree as a quotient; ZeroDivisionError where it divides by the zero polynomial."""
        match tree:
            case ex.Number(value):
                return OpaqueFraction(self.constant(value), self.constant(1))
            case ex.Sum(terms):
                return self.sum([self.fraction(term) for term in terms])
            case ex.Product(factors):
                return self.product([self.fraction(factor) for factor in factors])
            case _:
                base, exponent = _whole_power(tree)
                if base in self._roots and exponent != 1:  # u^-2 beside sqrt(u) is sqrt(u)^-4
                    base, degree = self._roots[base]
                    exponent *= degree
                if base in self._index:
                    inner = OpaqueFraction(self._context.gen(self._index[base]), self.constant(1))
                else:
                    inner = self.fraction(base)
                return self._raised(inner, exponent)

    def sum(self, fractions: Sequence[OpaqueFraction]) -> OpaqueFraction:
        total = OpaqueFraction(self.constant(0), self.constant(1))
        for part in fractions:
            common = total.denominator.gcd(part.denominator)
            left, right = divmod(part.denominator, common)[0], divmod(total.denominator, common)[0]
            over = times(total.numerator, left) + times(part.numerator, right)
            total = self.reduced(over, times(total.denominator, left))
        return total

    def product(self, fractions: Sequence[OpaqueFraction]) -> OpaqueFraction:
        total = OpaqueFraction(self.constant(1), self.constant(1))
        for part in fractions:
            over = times(total.numerator, part.numerator)
            total = self.reduced(over, times(total.denominator, part.denominator))
        return total

    def _raised(self, base: OpaqueFraction, exponent: int) -> OpaqueFraction:
        over, under = (base.numerator, base.denominator) if exponent >= 0 else (base.denominator, base.numerator)
        if under.is_zero():
            raise ZeroDivisionError("a formula divides by zero")
        return OpaqueFraction(over ** abs(exponent), under ** abs(exponent))

    def tree(self, fraction: OpaqueFraction) -> ex.Expression:
        """The quotient as a tree, factored where that is cheap."""
        content, over = self._factors(fraction.numerator)
        under_content, under = self._factors(fraction.denominator)
        below = [factor**-exponent for factor, exponent in under]
        if len(under) > 1 or (under and (content / under_content).denominator != 1):
            inside = ex.multiply(*(factor**exponent for factor, exponent in under))
            below = [inside**-1]
        return ex.multiply(ex.number(content / under_content), *(f**k for f, k in over), *below)

    def factors_of(self, polynomial: Polynomial) -> list[ex.Expression]:
        """Its factors that are no numbers, each once."""
        return [factor for factor, _ in self._factors(polynomial)[1]]

    def _factors(self, polynomial: Polynomial) -> tuple[Fraction, list[tuple[ex.Expression, int]]]:
        if polynomial.is_zero():
            return Fraction(0), []
        total, factors = Fraction(1), [(polynomial, 1)]
        if len(polynomial) <= _FACTORED_TERMS:
            try:
                total, factors = exact_field.factor_polynomial(polynomial)
            except exact_field.TooLarge:
                factors = self._monomial_apart(polynomial)
        result = []
        for factor, exponent in factors:
            scale = self._scale(factor)
            total *= scale**exponent
            result.append((self._sum_tree(factor, scale), exponent))
        return total, sorted(result, key=lambda pair: self._index.get(pair[0], len(self.atoms)))

    def _monomial_apart(self, polynomial: Polynomial) -> list[tuple[Polynomial, int]]:
        """The powers of single atoms that divide a polynomial, and the remaining factor."""
        shared = polynomial.term_content()
        powers = zip(self._context.gens(), shared.degrees(), strict=True)
        rest = divmod(polynomial, shared / shared.leading_coefficient())[0]
        return [(rest, 1), *((atom, int(k)) for atom, k in powers if k)]

    def _scale(self, polynomial: Polynomial) -> Fraction:
        """The content, with the sign of the leading term."""
        scale = polynomial.term_content().leading_coefficient()
        sign = -1 if polynomial.leading_coefficient() < 0 else 1
        return sign * abs(exact_field.as_fraction(scale))

    def _sum_tree(self, polynomial: Polynomial, scale: Fraction) -> ex.Expression:
        terms = []
        for exponents, value in polynomial.to_dict().items():
            powers = [self.atoms[k] ** int(e) for k, e in enumerate(exponents) if e]
            terms.append(ex.multiply(ex.number(exact_field.as_fraction(value) / scale), *powers))
        return ex.add(*terms)


def _rank(atom: ex.Expression) -> int:
    return 0 if isinstance(atom, ex.Symbol) else 2 if isinstance(atom, ex.Velocity) else 1


def times(left: Polynomial, right: Polynomial, most: int = MOST_TERMS) -> Polynomial:
    """The product; LimitError where it could have too many terms."""
    if len(left) * len(right) > most:
        raise errors.LimitError(
            f"the accelerations cannot be solved for, a polynomial would have over {most:,} terms: "
            "write the equations solved, or with fewer symbols.",
            "/equations",
        )
    return left * right


@dataclass(frozen=True, slots=True)
class InverseRows:
    """The inverse adjugate / determinant of a matrix P whose rows had the denominators `scales`.

    The determinant is +-det of the matrix of polynomials D P, D = diag(scales); the quotients need not be reduced.
    """

    adjugate: Rows
    determinant: Polynomial
    scales: tuple[Polynomial, ...]


def inverse_of(
    ring: OpaqueRing, matrix: Sequence[Sequence[OpaqueFraction]], most: int = MOST_TERMS
) -> InverseRows | None:
    """None where the matrix is singular; LimitError as `times`.

    Fraction-free Gauss-Jordan elimination (Bareiss 1968) of (D P | D) to (d I | d P^-1).
    """
    size, zero = len(matrix), ring.constant(0)
    scales = tuple(_common_denominator(ring, row, most) for row in matrix)
    table = [
        [
            *(times(entry.numerator, divmod(scale, entry.denominator)[0], most) for entry in row),
            *(scale if i == j else zero for j in range(size)),
        ]
        for i, (row, scale) in enumerate(zip(matrix, scales, strict=True))
    ]
    previous = ring.constant(1)
    for column in range(size):
        rows = [row for row in range(column, size) if not table[row][column].is_zero()]
        if not rows:
            return None
        best = min(rows, key=lambda row: len(table[row][column]))
        table[column], table[best] = table[best], table[column]
        top, pivot = table[column], table[column][column]
        for place, row in enumerate(table):
            if place != column:
                pairs = zip(row, top, strict=True)
                table[place] = [
                    divmod(times(pivot, a, most) - times(row[column], b, most), previous)[0] for a, b in pairs
                ]
        previous = pivot
    return InverseRows([row[size:] for row in table], previous, scales)


def _common_denominator(ring: OpaqueRing, entries: Iterable[OpaqueFraction], most: int) -> Polynomial:
    """The least common multiple of the denominators."""
    common = ring.constant(1)
    for entry in entries:
        common = times(common, divmod(entry.denominator, common.gcd(entry.denominator))[0], most)
    return common


def expanded_terms(tree: ex.Expression) -> tuple[int, int]:
    """An upper bound for the numbers of terms of numerator and denominator, capped."""
    match tree:
        case ex.Sum(terms):
            over, under = 0, 1
            for part_over, part_under in map(expanded_terms, terms):
                over, under = over * part_under + part_over * under, under * part_under
        case ex.Product(factors):
            over, under = 1, 1
            for part_over, part_under in map(expanded_terms, factors):
                over, under = over * part_over, under * part_under
        case _:
            base, exponent = _whole_power(tree)
            if base == tree or not isinstance(base, ex.Sum | ex.Product):
                return 1, 1
            pair = expanded_terms(base)
            over, under = (min(_LARGE, size ** min(abs(exponent), 40)) for size in pair[:: 1 if exponent > 0 else -1])
    return min(over, _LARGE), min(under, _LARGE)


def _whole_power(tree: ex.Expression) -> tuple[ex.Expression, int]:
    """(base, k) with tree = base^k; u^(p/q) is the p-th power of the atom u^(1/q)."""
    match tree:
        case ex.Power(base, ex.Number(value)) if value.denominator == 1:
            return base, int(value)
        case ex.Power(base, ex.Number(value)):
            return ex.Power(base, ex.number(Fraction(1, value.denominator))), value.numerator
        case _:
            return tree, 1


def atoms_of(tree: ex.Expression) -> list[ex.Expression]:
    """The atoms in order of appearance; the arguments of atoms are not searched."""
    found: dict[ex.Expression, None] = {}
    stack = [tree]
    while stack:
        node = stack.pop()
        if isinstance(node, ex.Sum):
            stack.extend(reversed(node.terms))
        elif isinstance(node, ex.Product):
            stack.extend(reversed(node.factors))
        elif not isinstance(node, ex.Number):
            base, _ = _whole_power(node)
            if base == node or _root_of(base):
                found[base] = None
            else:
                stack.append(base)
    return list(found)


def _root_of(atom: ex.Expression) -> list[tuple[ex.Expression, int]]:
    """[(u, d)] for the root u^(1/d), else []."""
    match atom:
        case ex.Power(base, ex.Number(value)) if value.denominator != 1:
            return [(base, value.denominator)]
    return []
