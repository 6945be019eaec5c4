"""Lagrangians of equations as written, each line up to a factor c_i(t, q).

E_i = M_ij q''_j + B_i are Euler-Lagrange equations up to factors if c_i M_ij is symmetric and c_i
E_i self-adjoint.

1. The lines are put in an order in which M can be made symmetric: M_ij/M_ji is c_j/c_i along the
   edges of the graph of
nonzero entries, and each closed walk is a test. One factor remains for each connected part.
2. This factor psi solves, by any one entry of G = c M with both indices in the part,
       D log psi = ((d_vj B_i + d_vi B_j)/2 - D G_ij)/G_ij,   D = d_t + v_k d_k,
   which must be affine in v; its coefficients are the gradient of log psi.
3. Two parts a, b differ by a constant: K_a d_vj B_i + K_b d_vi B_j = 0 or, if both derivatives
   vanish, K_a d_j B_i -
K_b d_i B_j = 0 at v = 0.
4. Then G is the velocity Hessian (Helmholtz 1887): a part of G that is homogeneous of degree d in v
   comes from G_ij v_i
v_j/((d + 1)(d + 2)), and the remaining terms of E_i from some A_i(t, q) v_i - V(t, q).

Given accelerations are lines with M = 1. Then G is diagonal, and d_k log c_i = -d^2 f_i/dv_i dv_k.

For sums of lines sum_k C_ik E_k with constants C, the conditions are linear in C. If they determine
C up to a factor, these sums become the lines.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import (
    chain,
    combinations,
    combinations_with_replacement,
    islice,
    permutations,
    product,
)
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inverse_service import bounds, deadline
from inverse_service.errors import InputError
from inverse_service.expressions import terms as tm, tree as ex
from inverse_service.field import exact_field, matrices
from inverse_service.field.real_branch import RealTable
from inverse_service.mechanics import euler_lagrange, linear_equations, writing
from inverse_service.mechanics.second_order_system import Branch, SecondOrderSystem, connected
from inverse_service.search import antiderivatives, material as mt

# The number of orders of lines to try: Bateman's pair is two damped oscillators in one order,
# autonomous in the other.
_ORDERS = 6
# The number of steps in the search for these orders.
_STEPS = 4_000
# L of the lines of which `in_own_order` found last that they have one, by coordinates and lines.
_WRITTEN: dict[tuple[tuple[str, ...], tuple[ex.Expression, ...]], ex.Expression] = {}
# The number of free numbers in C: with a third one, zeros no longer lead to the lines of textbooks.
_MOST_FREE = 2

Factor = tuple[Fraction, tm.Monomial]
Vector = Sequence[exact_field.Quotient]
Table = list[list[tm.Terms]]
Matrix = NDArray[np.object_]  # of quotients


@dataclass(frozen=True, slots=True)
class Lines:
    """E_i = sum_j matrix[i][j] q''_j + rest[i] for the coordinates of a system, in their order."""

    system: SecondOrderSystem
    matrix: list[list[tm.Terms]]
    rest: list[tm.Terms]
    order: Sequence[int] = ()  # of the lines as given

    @property
    def places(self) -> range:
        return range(len(self.rest))

    @property
    def coordinates(self) -> list[ex.Symbol]:
        return list(map(ex.Symbol, self.system.coordinates))

    @property
    def constants(self) -> set[ex.Symbol]:
        return {ex.PI, *map(ex.Symbol, self.system.parameters)}

    @property
    def velocities(self) -> list[ex.Velocity]:
        return list(map(ex.Velocity, self.system.coordinates))

    def times(self, factors: Sequence[tm.Terms]) -> Lines:
        """Each line times its factor."""
        if all(c == antiderivatives.ONE_TERM for c in factors):
            return self
        matrix = [
            [tm.multiply_terms(c, entry) for entry in row]
            for c, row in zip(factors, self.matrix, strict=True)
        ]
        return replace(
            self,
            matrix=matrix,
            rest=[tm.multiply_terms(*pair) for pair in zip(factors, self.rest, strict=True)],
        )

    def sums(self, factors: Sequence[tm.Terms]) -> Lines:
        """C times the lines, with C_ik in the order of (k, i)."""
        rows = [factors[i :: len(self.rest)] for i in self.places]
        matrix = [[_dot(row, column) for column in zip(*self.matrix, strict=True)] for row in rows]
        return replace(self, matrix=matrix, rest=[_dot(row, self.rest) for row in rows])

    @property
    def are_oscillators(self) -> bool:
        """Whether the lines are q'' + C q' + K q = b with constants C and K, few terms each."""
        moving: list[ex.Expression] = [*self.coordinates, *self.velocities, ex.TIME]
        try:
            (matrix, _), *others = self.conditions()
        except tm.TooManyTerms:
            return False
        entries = [entry for table, _ in others for row in table for entry in row]
        solved = matrix == [
            [antiderivatives.ONE_TERM if i == j else {} for j in self.places] for i in self.places
        ]
        return solved and not any(tm.depends_on(entry, *moving) for entry in entries)

    def conditions(self) -> list[tuple[Table, int]]:
        """(Y, sign) with Y_ij = sign Y_ji for self-adjoint lines.

        G_ij = G_ji; d_j H_i - d_i H_j = d_t (d_vj H_i - d_vi H_j)/2 at v = 0; d_vj H_i + d_vi H_j =
        D (G_ij + G_ji).
        """
        still, damping = [], []
        for row, rest in zip(self.matrix, self.rest, strict=True):
            slopes = [tm.derivative_of_terms(rest, v) for v in self.velocities]
            rates = [
                tm.derivative_of_terms(tm.coefficient(slope, tm.EMPTY), ex.TIME) for slope in slopes
            ]
            forces = [
                tm.derivative_of_terms(tm.coefficient(rest, tm.EMPTY), q) for q in self.coordinates
            ]
            pairs = zip(forces, rates, strict=True)
            still.append([tm.add_terms(force, rate, Fraction(-1, 2)) for force, rate in pairs])
            damping.append(
                [
                    tm.add_terms(b, mt.rate_at_constant_velocity(entry, self.coordinates), -1)
                    for b, entry in zip(slopes, row, strict=True)
                ]
            )
        return [(self.matrix, 1), (still, 1), (damping, -1)]


def lagrangians_of_lines(
    system: SecondOrderSystem,
    given: Sequence[ex.Expression],
    table: RealTable | None = None,
    integral_signs: bool = False,
    sums: bool = False,
) -> Iterator[ex.Expression]:
    """Lagrangians of the equations E = 0 as given and of q'' - f; the caller must verify each.

    `integral_signs` allows nonelementary integrals; `sums` also tries sums of lines with a
    symmetric matrix.
    """
    for equations in dict.fromkeys(
        (tuple(given), () if system.is_unsolved else solved_lines(system))
    ):
        if len(equations) != len(system.coordinates):
            continue
        if not integral_signs and (written := _WRITTEN.get((system.coordinates, equations))):
            yield written
        try:
            lines = lines_of(system, equations)
        except mt.FAILED:
            continue
        for scaled in _proposed_lines(lines, sums):
            deadline.check()
            integrator = antiderivatives.Integrator(system, table, integral_signs)
            try:
                found = lagrangian_of_lines(scaled, integrator)
            except mt.FAILED:
                continue
            if found is not None:
                yield found


def _proposed_lines(lines: Lines, sums: bool) -> Iterator[Lines]:
    """The lines times factors that make the matrix symmetric, in several orders, and constant sums
    of the lines.

    The given order comes first, because its L is that of the author; then, if asked for or if the
    given order has no such factors, sums; then the other orders. For two oscillators solved for
    their accelerations, which have two Lagrangians, sums come first and show the short one.
    """
    orders = [*islice(symmetric_lines(lines), _ORDERS)]
    own = [one for one in orders[:1] if list(one.order) == list(lines.places)]
    short = len(lines.rest) == 2 and lines.are_oscillators
    yield from () if short else own
    if sums or short or not own:
        with suppress(*mt.FAILED):
            found = _self_adjoint_sums(lines)
            if found is not None:
                yield found
    yield from orders if short else orders[len(own) :]


def propose(material: mt.Material, seed: int) -> Sequence[ex.Expression]:
    """The first Lagrangian of q'' - f; without t if L(q, q') is requested."""
    system, point = material.analysis.system, material.analysis.real_point
    for integral_signs in (False, True):
        for tree in lagrangians_of_lines(
            system, (), point, integral_signs, sums=not integral_signs
        ):
            if material.motion.question.timed or not ex.holds(tree, ex.TIME):
                return [tree]
    return []


def lagrangian_as_given(
    system: SecondOrderSystem, given: Sequence[ex.Expression] = ()
) -> ex.Expression | None:
    """The first Lagrangian without integral signs, unverified; None if there is none."""
    return next(lagrangians_of_lines(system, given), None)


def in_own_order(system: SecondOrderSystem) -> SecondOrderSystem | None:
    """The system with its lines in an order in which they have a Lagrangian; None if there is
    none.
    """
    for written in _undone(system.given):
        with suppress(*mt.FAILED):
            for scaled in islice(symmetric_lines(lines_of(system, written)), _ORDERS):
                deadline.check()
                with suppress(*mt.FAILED):
                    found = lagrangian_of_lines(scaled, antiderivatives.Integrator(system))
                    if found is not None:
                        ordered = tuple(written[k] for k in scaled.order)
                        _WRITTEN.clear()
                        _WRITTEN[system.coordinates, ordered] = found
                        return replace(system, branch=Branch(ordered, unsolved=True))
    return None


def _undone(given: Sequence[ex.Expression]) -> Iterator[Sequence[ex.Expression]]:
    """The lines, and the lines if one was added to another or subtracted from it."""
    yield given
    for sign, (i, k) in product((-1, 1), permutations(range(len(given)), 2)):
        with suppress(tm.TooManyTerms):
            yield [*given[:i], tm.collected(given[i] + sign * given[k]), *given[i + 1 :]]


def lines_of(system: SecondOrderSystem, equations: Sequence[ex.Expression]) -> Lines:
    """The equations as lines; InputError if an acceleration enters nonlinearly, TooManyTerms if a
    sum is too long.
    """
    parts = [linear_equations.linear_equation(equation) for equation in equations]
    names = system.coordinates
    matrix = [
        [tm.terms_of(part.coefficients[q]) if q in part.coefficients else {} for q in names]
        for part in parts
    ]
    return Lines(system, matrix, [tm.terms_of(writing.much_shorter(part.rest)) for part in parts])


def solved_lines(system: SecondOrderSystem) -> tuple[ex.Expression, ...]:
    """q'' - f."""
    return tuple(
        ex.Acceleration(q) - f
        for q, f in zip(system.coordinates, system.accelerations, strict=True)
    )


def symmetric_lines(lines: Lines) -> Iterator[Lines]:
    """The lines times symmetrizing factors with denominators cleared, in each order that has such
    factors.
    """
    matrix = lines.matrix

    @cache
    def ratio(row: int, j: int, other: int, i: int) -> Factor | None:
        """c with c_other = c c_row from c_row matrix[row][j] = c_other matrix[other][i]."""
        return _factor(matrix[row][j], matrix[other][i])

    for order in _orders(matrix):
        pairs = combinations(enumerate(order), 2)
        ratios = {
            (i, j): ratio(row, j, other, i) for (i, row), (j, other) in pairs if matrix[row][j]
        }
        found = _along_edges(len(order), ratios)
        if found is not None:
            chosen = Lines(
                lines.system,
                [matrix[row] for row in order],
                [lines.rest[row] for row in order],
                order,
            )
            yield chosen.times([{m: a} for a, m in _cleared(*found, lines.constants)])


def _orders(matrix: Sequence[Sequence[tm.Terms]]) -> Iterator[list[int]]:
    """Orders of the rows in which the pattern of nonzero entries is symmetric, the given one
    first.
    """
    places, steps = range(len(matrix)), 0

    def extended(order: list[int]) -> Iterator[list[int]]:
        nonlocal steps
        if len(order) == len(matrix):
            yield order
            return
        for row in dict.fromkeys((len(order), *places)):
            steps += 1
            if row in order or steps > _STEPS:
                continue
            if all(
                bool(matrix[row][j]) == bool(matrix[other][len(order)])
                for j, other in enumerate(order)
            ):
                yield from extended([*order, row])

    yield from extended([])


def _along_edges(
    size: int, ratios: Mapping[tuple[int, int], Factor | None]
) -> tuple[list[Factor], list[int]] | None:
    """(K, the part of each place) with K_j = ratio_ij K_i, one K free in each connected part; None
    if there is no K.
    """
    edges: dict[int, dict[int, Factor]] = {i: {} for i in range(size)}
    for (i, j), ratio in ratios.items():
        if ratio is None:
            return None
        edges[i][j], edges[j][i] = ratio, (1 / ratio[0], tm.times(tm.EMPTY, ratio[1], -1))
    found, parts = dict[int, Factor](), dict[int, int]()
    for start in range(size):
        if start in found:
            continue
        found[start], parts[start], queue = (Fraction(1), tm.EMPTY), start, [start]
        for i in queue:
            for j, (value, key) in edges[i].items():
                wanted = found[i][0] * value, tm.times(found[i][1], key)
                if j not in found:
                    found[j], parts[j] = wanted, start
                    queue.append(j)
                elif found[j] != wanted:
                    return None
    return [found[i] for i in range(size)], [parts[i] for i in range(size)]


def _self_adjoint_sums(lines: Lines) -> Lines | None:
    """G q'' + H = C (M q'' + B) with constants C, as many of them 0 as possible; None if there is
    no C, or too many.

    Among several C, prefer one that adds a line to another or subtracts it, then one with a zero in
    C or in the forces C K.
    """
    conditions = lines.conditions()
    for some in (conditions[:1], conditions):  # the others are long
        ring, tables = tables_in_ring(lines, [table for table, _ in some])
        sums = constant_sums(
            ring, [(table, sign) for table, (_, sign) in zip(tables, some, strict=True)]
        )
        if len(sums.basis) <= 1:
            break
    one = sums.ring.constant(1)
    for sign, k, i in product((-1, 1), lines.places, lines.places):  # most often lines were added
        if k != i and len(sums.basis) > 1:
            added = Combination.adding(k, i, one.scaled(sign), len(lines.rest))
            if sums.contain(added.entries):
                return lines.sums(_terms(sums.ring, added.entries))
    if len(sums.basis) > _MOST_FREE:
        return None
    mass, *others = [np.array(table) for table in tables]
    stiffness = others[0] if others else None
    basis = [_candidates_for_zero(Combination(c), stiffness) for c in sums.basis]
    found = list[Combination]()
    for places in combinations(range(len(basis[0])), len(basis) - 1) if basis else ():
        weights = [
            *matrices.null_space([[c[k] for c in basis] for k in places], len(basis), one).values()
        ]
        if len(weights) == 1:
            vector = [
                matrices.dot(one - one, weights[0], entries)
                for entries in zip(*sums.basis, strict=True)
            ]
            if not matrices.determinant(Combination(vector).rows, one).is_zero:
                found.append(Combination(exact_field.primitive_vector(vector)))
    if len(found) > 1:  # computing the ranks of long lines is slow
        found = [min(found, key=lambda c: _rank(c, mass, stiffness))]
    return lines.sums(_terms(sums.ring, found[0].entries)) if found else None


@dataclass(frozen=True, slots=True)
class Combination:
    """The matrix C of constants by which lines are combined, with C_ik in the order of (k, i)."""

    entries: Vector

    @classmethod
    def adding(cls, k: int, i: int, factor: exact_field.Quotient, size: int) -> Combination:
        """1, and `factor` as C_ik: this many times line k added to line i."""
        one = factor.field.constant(1)
        places = product(range(size), range(size))
        return cls(
            [one if a == b else factor if (a, b) == (k, i) else one - one for a, b in places]
        )

    @property
    def size(self) -> int:
        return math.isqrt(len(self.entries))

    @property
    def rows(self) -> list[Vector]:
        return [self.entries[i :: self.size] for i in range(self.size)]

    @property
    def columns(self) -> list[Vector]:
        n = self.size
        return [self.entries[k * n : (k + 1) * n] for k in range(n)]

    def times(self, matrix: Matrix) -> Matrix:
        """C Y, (n, n)."""
        product: Matrix = np.array(self.rows) @ matrix
        return product


def _with_forces(c: Combination, stiffness: Matrix | None) -> Vector:
    """The entries of C and of C K."""
    return [*c.entries, *(() if stiffness is None else c.times(stiffness).flat)]


def _candidates_for_zero(c: Combination, stiffness: Matrix | None) -> list[exact_field.Quotient]:
    """The entries of C and of C K, and differences of two entries in one column of C."""
    pairs = (pair for column in c.columns for pair in combinations(column, 2))
    return [*_with_forces(c, stiffness), *(a - b for a, b in pairs)]


class Rank(NamedTuple):
    """What makes C worse, the most important first."""

    has_mixed_minor: bool  # 1 - w^2
    is_indefinite_somewhere: bool  # for some positive symbols
    is_singular_somewhere: bool  # for values of constants by which the lines do not divide
    lacks_a_square: bool  # of a velocity
    is_indefinite: bool
    terms: int  # of C and C K, without a common factor
    own_terms: int


def _rank(c: Combination, mass: Matrix, stiffness: Matrix | None) -> Rank:
    """The rank of G = C M by its entries and its minors."""
    g, places = c.times(mass), range(c.size)
    minors = [g[i, i] * g[j, j] - g[i, j] * g[j, i] for i, j in combinations(places, 2)]
    negative = any(all(a < 0 for a in minor.numerator.coeffs()) for minor in minors)
    varying = any(minor.numerator.total_degree() > 0 for minor in minors)
    return Rank(
        any(len(set(map(sum, minor.numerator.monoms()))) > 1 for minor in minors),
        negative and varying,
        _is_singular_somewhere(g, stiffness),
        any(entry.is_zero for entry in np.diagonal(g)),
        negative,
        term_count(exact_field.primitive_vector(_with_forces(c, stiffness))),
        term_count(c.entries),
    )


def _is_singular_somewhere(g: Matrix, stiffness: Matrix | None) -> bool:
    """Whether det G is 0 for values of the constants for which the forces are defined."""
    entries = [] if stiffness is None else [*stiffness.flat]
    field = g[0, 0].field
    below = {place for entry in entries for place, _ in entry.exponents}
    divisors = [field.denominators[place] for place in below]
    _, factors = matrices.determinant(g.tolist(), field.constant(1)).numerator.factor()
    moving = [one for one, _ in factors if not one.is_constant()]
    return not all(any(not divisor % one for divisor in divisors) for one in moving)


def _terms(ring: exact_field.ExactRing, vector: Vector) -> list[tm.Terms]:
    return [tm.terms_of(exact_field.quotient_tree(ring, entry)) for entry in vector]


def _dot(left: Sequence[tm.Terms], right: Sequence[tm.Terms]) -> tm.Terms:
    return tm.sum_of(tm.multiply_terms(a, b) for a, b in zip(left, right, strict=True))


@dataclass(frozen=True, slots=True)
class Sums:
    """The constants C that satisfy the conditions, as vectors C_ik ordered by (k, i): a basis, and
    the conditions.
    """

    ring: exact_field.ExactRing
    columns: list[list[exact_field.Quotient]]
    basis: list[list[exact_field.Quotient]]

    def contain(self, vector: Vector) -> bool:
        zero = self.ring.constant(0)
        return all(
            matrices.dot(zero, vector, entries).is_zero
            for entries in zip(*self.columns, strict=True)
        )


def tables_in_ring(
    lines: Lines, tables: Sequence[Table], others: Sequence[ex.Expression] = ()
) -> tuple[exact_field.ExactRing, list[list[list[exact_field.Quotient]]]]:
    """A ring that contains the tables and the others, and the tables in it."""
    trees = [[[tm.tree_of(entry) for entry in row] for row in table] for table in tables]
    every = [entry for table in trees for row in table for entry in row]
    ring = exact_field.exact_ring(
        [*every, *others], lines.system.variables, 1, exact_field.Budget.long()
    )
    return ring, [[list(map(ring.value, row)) for row in table] for table in trees]


def constant_sums(ring: exact_field.ExactRing, conditions: Sequence[tuple[Any, int]]) -> Sums:
    """Constants C with (C Y)_ij = sign (C Y)_ji for each (Y, sign)."""
    zero, columns, places = (
        ring.constant(0),
        list[list[exact_field.Quotient]](),
        range(len(conditions[0][0])),
    )
    for k, a in product(places, places):
        column = []
        for table, sign in conditions:
            for i, j in combinations_with_replacement(places, 2):
                column.append(
                    (table[k][j] if a == i else zero)
                    - (table[k][i].scaled(sign) if a == j else zero)
                )
        columns.append(column)
    return Sums(ring, columns, matrices.null_vectors(ring, columns))


def term_count(vector: Iterable[exact_field.Quotient]) -> int:
    """The number of terms in all entries."""
    return sum(len(entry.numerator) + len(entry.exponents) for entry in vector)


def _factor(left: tm.Terms, right: tm.Terms) -> Factor | None:
    """c(t, q) with c right = left, if it is one monomial."""
    found = tm.monomial_factor(left, right)
    if found is None:
        return None
    ((key, value),) = found.items()
    return None if any(tm.has_velocity(letter) for letter, _ in key) else (value, key)


def _cleared(
    factors: Sequence[Factor], parts: Sequence[int], constants: set[ex.Symbol]
) -> list[Factor]:
    """The factors without constant denominators and common constants within each part."""
    found = list(factors)
    for part in dict.fromkeys(parts):
        members = [k for k, label in enumerate(parts) if label == part]
        tables = [dict(found[k][1]) for k in members]
        letters = dict.fromkeys(
            p for table in tables for p in table if tm.is_constant(p, constants)
        )
        least = frozenset(
            (p, e) for p in letters if (e := min(table.get(p, Fraction(0)) for table in tables))
        )
        for k in members:
            found[k] = found[k][0], tm.times(found[k][1], least, -1)
    return found


def lagrangian_of_lines(
    lines: Lines, integrator: antiderivatives.Integrator
) -> ex.Expression | None:
    """L of lines with a symmetric matrix, each connected part multiplied by its function and its
    constant.
    """
    parts = connected(
        list(lines.places),
        [{i, j} for i in lines.places for j in lines.places if lines.matrix[i][j]],
    )
    for part in parts:
        for i, j in ((i, j) for i in part for j in lines.places if j not in part):
            given, back = (
                tm.derivative_of_terms(lines.rest[a], lines.velocities[b])
                for a, b in ((i, j), (j, i))
            )
            if antiderivatives.is_zero(given) != antiderivatives.is_zero(back):
                return None  # (H2) between parts: psi_i d_vj B_i + psi_j d_vi B_j = 0
    table = dict[int, tm.Terms]()
    for part in parts:
        function = _common_function(lines, part, integrator)
        if function is None:
            return None
        table |= dict.fromkeys(part, function)
    scaled = lines.times([table[i] for i in lines.places])
    constants = _constants(scaled, parts)
    if constants is None:
        return None
    scaled = scaled.times([constants[i] for i in lines.places])
    kinetic = _kinetic(scaled)
    squares = [tm.tree_of(scaled.matrix[i][i]) for i in lines.places]
    turned = all(
        tree != ex.ZERO and mt.positive_form(tree, integrator.table) != tree for tree in squares
    ) or (kinetic is not None and all(c < 0 for c in kinetic.values()))
    if kinetic is None:
        kinetic = integrator.with_hessian(
            [row[j] for i, row in enumerate(scaled.matrix) for j in lines.places[i:]]
        )
    if kinetic is None:
        return None
    own = antiderivatives.expressions_without_acceleration(lines.system.coordinates, kinetic)
    rest = integrator.linear_terms(
        [tm.add_terms(terms, part, -1) for terms, part in zip(scaled.rest, own, strict=True)]
    )
    if rest is None:
        return None
    sign = -1 if turned else 1
    total = tm.add_terms(kinetic, rest)
    return (
        ex.add(tm.tree_of(tm.scaled(kinetic, sign)), tm.tree_of(tm.scaled(rest, sign)))
        if total
        else None
    )


def _common_function(
    lines: Lines, part: Sequence[int], integrator: antiderivatives.Integrator
) -> tm.Terms | None:
    """psi(t, q) for the lines of one connected part; None if there is no such function."""
    pairs = [(i, j) for i in part for j in part if i <= j and lines.matrix[i][j]]
    i, j = min(
        pairs, key=lambda pair: (len(lines.matrix[pair[0]][pair[1]]), pair[0] != pair[1], pair)
    )
    entry = lines.matrix[i][j]
    rate = _rate(lines, i, j)
    if antiderivatives.is_zero(rate):
        return dict(antiderivatives.ONE_TERM)
    for k, m in ((k, m) for k in part for m in part if k <= m and (k, m) != (i, j)):
        crossed = tm.multiply_terms(_rate(lines, k, m), entry)
        if not antiderivatives.is_zero(
            tm.add_terms(crossed, tm.multiply_terms(rate, lines.matrix[k][m]), -1)
        ):
            return None  # (H2) requires the same slope of log psi for all entries, including zero entries
    (slope,) = mt.divided([rate], entry, lines.system.variables, exact_field.Budget.short())
    parts = tm.affine_parts(slope, lines.velocities)
    if parts is None:
        return None
    form = [integrator.in_normal_form(terms) for terms in (parts[0], *parts[1])]
    logarithm = integrator.function_of([ex.TIME, *lines.coordinates], form)
    return None if logarithm is None else integrator.exponential(logarithm)


def _rate(lines: Lines, i: int, j: int) -> tm.Terms:
    """(d_vj B_i + d_vi B_j)/2 - D G_ij."""
    slopes = (
        tm.derivative_of_terms(lines.rest[a], lines.velocities[b]) for a, b in ((i, j), (j, i))
    )
    drift = mt.rate_at_constant_velocity(lines.matrix[i][j], lines.coordinates)
    return tm.weighted_sum([(drift, -1), *((slope, Fraction(1, 2)) for slope in slopes)])


def _constants(lines: Lines, parts: Sequence[Sequence[int]]) -> dict[int, tm.Terms] | None:
    """K for each line, one per connected part, such that terms between different parts match; None
    if impossible.
    """
    own = {i: k for k, part in enumerate(parts) for i in part}
    ratios: dict[tuple[int, int], Factor | None] = {}
    for i, j in combinations(lines.places, 2):
        a, b = own[i], own[j]
        if a == b or (a, b) in ratios or (b, a) in ratios:
            continue
        left = tm.derivative_of_terms(lines.rest[i], lines.velocities[j])
        right = tm.scaled(tm.derivative_of_terms(lines.rest[j], lines.velocities[i]), -1)
        if not left and not right:
            left = tm.coefficient(
                tm.derivative_of_terms(lines.rest[i], lines.coordinates[j]), tm.EMPTY
            )
            right = tm.coefficient(
                tm.derivative_of_terms(lines.rest[j], lines.coordinates[i]), tm.EMPTY
            )
        if left or right:
            ratios[a, b] = _constant_ratio(lines, left, right)  # K_b = ratio K_a
    found = _along_edges(len(parts), ratios)
    if found is None:
        return None
    cleared = _cleared(*found, lines.constants)
    if sum(value < 0 for value, _ in cleared) > len(parts) / 2:
        cleared = [(-value, key) for value, key in cleared]
    return {i: {cleared[k][1]: cleared[k][0]} for k, part in enumerate(parts) for i in part}


def _constant_ratio(lines: Lines, left: tm.Terms, right: tm.Terms) -> Factor | None:
    """left/right if that is one monomial of constants, possibly by relations among their
    generators.
    """

    def is_plain(found: tm.Terms) -> bool:
        return all(
            tm.is_constant(p, lines.constants) or isinstance(p, ex.Number)
            for key in found
            for p, _ in key
        )

    found = tm.monomial_factor(left, right)
    if found is None or not is_plain(found):
        if antiderivatives.is_zero(left) or antiderivatives.is_zero(right):
            return None
        quotient = tm.tree_of(left) / tm.tree_of(right)
        (found,) = mt.over_one_denominator(
            [quotient], lines.system.variables, exact_field.Budget.short()
        )
    return (
        next(((value, key) for key, value in found.items()), None)
        if len(found) == 1 and is_plain(found)
        else None
    )


def _kinetic(lines: Lines) -> tm.Terms | None:
    """sum G_ij v_i v_j/((d + 1)(d + 2)); None for a degree -1 or -2, or functions of v other than
    powers.
    """
    total: tm.Terms = {}
    for row, v in zip(lines.matrix, lines.velocities, strict=True):
        for entry, w in zip(row, lines.velocities, strict=True):
            for key, value in entry.items():
                _, moving = tm.split_velocities(key)
                degree = sum((e for _, e in moving), Fraction(0))
                if not all(isinstance(letter, ex.Velocity) for letter, _ in moving) or degree in (
                    -1,
                    -2,
                ):
                    return None
                term = {tm.times(key, tm.monomial(v, w)): value / ((degree + 1) * (degree + 2))}
                total = tm.add_terms(total, term)
    return total


def with_written_masses(
    lagrangian: ex.Expression, system: SecondOrderSystem, given: Sequence[ex.Expression]
) -> ex.Expression | None:
    """The constant multiple of L whose Hessian has the constants of the equations as written.

    None if L is not quadratic in the velocities, its Hessian is not a multiple of dE_i/dq''_j, or
    nothing changes.
    """
    try:
        lines = (
            lines_of(system, given)
            if len(given) == len(system.coordinates) <= bounds.COORDINATES
            else None
        )
        written = (
            None if lines is None else next((one.matrix for one in symmetric_lines(lines)), None)
        )
        rows = euler_lagrange.hessian(lagrangian, system.coordinates)
        hessian = (
            None
            if any(map(tm.has_velocity, chain(*rows)))
            else [list(map(tm.terms_of, row)) for row in rows]
        )
    except (tm.TooManyTerms, InputError):
        return None
    if written is None or hessian is None or not _are_proportional(hessian, written):
        return None
    parameters: set[ex.Expression] = {ex.PI, *map(ex.Symbol, system.parameters)}
    (number, wanted), (value, known) = (
        _constant_factor(written[0][0], parameters),
        _constant_factor(hessian[0][0], parameters),
    )
    factor, ratio = tm.times(wanted, known, -1), abs(number / value)
    if not factor:
        return None
    # The factor is kept whole so that it cancels: (m + M)/(m + M).
    return tm.tree_of(tm.multiply_by(tm.terms_of(lagrangian), factor, factor=ratio))


def _are_proportional(
    left: Sequence[Sequence[tm.Terms]], right: Sequence[Sequence[tm.Terms]]
) -> bool:
    """Whether left = h right with any function h."""
    first, other = left[0][0], right[0][0]
    pairs = [pair for rows in zip(left, right, strict=True) for pair in zip(*rows, strict=True)]
    return bool(first and other) and all(
        tm.multiply_terms(a, other) == tm.multiply_terms(first, b) for a, b in pairs
    )


def _constant_factor(
    terms: tm.Terms, parameters: set[ex.Expression]
) -> tuple[Fraction, tm.Monomial]:
    """The factor of a sum that contains only numbers and parameters; a sum of parameters is one
    generator.
    """
    content, common, rest = tm.split_content(terms)
    outside: tm.Monomial = frozenset(item for item in common if item[0] in parameters)
    whole = (
        rest != ex.ONE and {letter for key in tm.terms_of(rest) for letter, _ in key} <= parameters
    )
    return content, tm.times(outside, tm.monomial(rest)) if whole else outside
