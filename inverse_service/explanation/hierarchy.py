"""Find conditions on the multiplier g that suffice for a negative verdict, and eliminate them exactly.

Each tensor T of type (1, 1) of the hierarchy requires g T to be symmetric, each curvature R that
g_ij R^j_kl + g_lj R^j_ik + g_kj R^j_li = 0:

    Phi, nabla Phi, nabla^2 Phi, …;   R, nabla R, …;   R[nabla Phi], R[nabla^2 Phi], …

with the tensors of `mechanics.conditions`. At a point each is a linear condition on the n(n+1)/2 entries of g. A set
suffices if every symmetric g that satisfies it at a generic point is singular; values are taken at random points
modulo a prime, from Taylor series of f.

`eliminate` solves chosen conditions exactly for g_11, g_12, … one after another, as by hand. Every pivot is checked
modulo a prime: the minor of the used equations and solved unknowns must not vanish at the random point, so that no
unrecognized zero is used as a divisor.

`contradiction` treats a multiplier known up to a factor, g = e^u G, whose factor does not exist: a multiplier exists
only if all mixed derivatives of u agree (`conditions.factor_slopes` returns the first ones), and u_t = 0 if L must not
contain t.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, cast

from flint import nmod_mat

from inverse_service import bounds, errors
from inverse_service.decision import deciding, helmholtz
from inverse_service.expressions import notation, tree as ex
from inverse_service.field import dense_series as machine, exact_field, matrices, modular, tower
from inverse_service.mechanics import conditions as cd
from inverse_service.mechanics.conditions import S, Tensor11, Tensor12

# The largest set searched for; beyond it, all conditions of the depth are listed.
LARGEST_SET = 4
DEEPEST = 3
_TRIALS = 3

Row = tuple[int, ...]

Unknown = tuple[int, int]
Linear = Mapping[Unknown, exact_field.Quotient]

Matrix = tuple[tuple[exact_field.Quotient, ...], ...]


@dataclass(frozen=True, slots=True)
class ConditionName:
    """A tensor of the hierarchy; `order` is the number of derivatives of f that it needs."""

    name: str
    order: int
    cyclic: bool


@dataclass(frozen=True, slots=True)
class EquationName:
    """One linear equation: (T)_ik for "g T symmetric" (i < k), (R)_ikl for the cyclic one (i < k < l)."""

    condition: ConditionName
    indices: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class SufficientSet:
    """Conditions that allow only singular g, the equations needed among them, and the remaining space.

    `dimension` is that of the space of symmetric g that satisfy the equations at a generic point.
    """

    conditions: tuple[ConditionName, ...]
    equations: tuple[EquationName, ...]
    rank: int
    dimension: int


def unknowns(n: int) -> list[tuple[int, int]]:
    """Index pairs of the entries g_ij, i <= j, in the order of the columns."""
    return [(i, j) for i in range(n) for j in range(i, n)]


def _power_name(operator: str, exponent: int, operand: str) -> str:
    """ "Phi", "nabla Phi", "nabla^2 Phi"."""
    if exponent == 0:
        return operand
    return f"{operator} {operand}" if exponent == 1 else f"{operator}^{exponent} {operand}"


def tensors_to_depth(motion: cd.Motion[S], depth: int) -> dict[ConditionName, Tensor11[S] | Tensor12[S]]:
    """The tensors that need at most depth + 2 derivatives of f; curvatures only for n >= 3."""
    n = cd.connection(motion)
    endomorphisms = [cd.jacobi_endomorphism(motion)]
    for _ in range(depth):
        endomorphisms.append(cd.nabla(motion, n, endomorphisms[-1]))
    table: dict[ConditionName, Tensor11[S] | Tensor12[S]] = {}
    for k, tensor in enumerate(endomorphisms):
        table[ConditionName(_power_name("nabla", k, "Phi"), k + 2, False)] = tensor
    if motion.size < 3:
        return table
    bend: Tensor12[S] | None = None
    for k in range(depth):
        bend = cd.curvature(motion, endomorphisms[0]) if bend is None else cd.nabla_of_curvature(motion, n, bend)
        table[ConditionName(_power_name("nabla", k, "R"), k + 3, True)] = bend
        if k:
            name = f"R[{_power_name('nabla', k, 'Phi')}]"
            table[ConditionName(name, k + 3, True)] = cd.curvature(motion, endomorphisms[k])
    return table


def equation_terms(
    condition: ConditionName, tensor: Tensor11[S] | Tensor12[S], n: int
) -> dict[EquationName, list[tuple[tuple[int, int], int, S]]]:
    """Each equation as terms (unknown, sign, coefficient), the unknown given with i <= j."""
    found: dict[EquationName, list[tuple[tuple[int, int], int, S]]] = {}
    if condition.cyclic:
        bend = cast("Tensor12[S]", tensor)
        for i, k, m in itertools.combinations(range(n), 3):
            cycle = [(i, k, m), (m, i, k), (k, m, i)]
            terms = [(_pair(a, j), 1, bend[j][b][c]) for a, b, c in cycle for j in range(n)]
            found[EquationName(condition, (i, k, m))] = terms
        return found
    plain = cast("Tensor11[S]", tensor)
    for i, k in itertools.combinations(range(n), 2):
        left = [(_pair(i, j), 1, plain[j][k]) for j in range(n)]
        right = [(_pair(k, j), -1, plain[j][i]) for j in range(n)]
        found[EquationName(condition, (i, k))] = left + right
    return found


def _pair(i: int, j: int) -> tuple[int, int]:
    return (i, j) if i <= j else (j, i)


@dataclass(frozen=True, slots=True)
class PointwiseConditions:
    """The equations of the hierarchy at one point, each a row over the `unknowns`, modulo `prime`."""

    size: int
    prime: int
    rows: Mapping[EquationName, Row]

    def kernel(self, names: Sequence[EquationName]) -> list[list[int]]:
        """A basis of the g that satisfy the named equations."""
        return matrices.null_rows([self.rows[name] for name in names], len(unknowns(self.size)), self.prime)


@dataclass(frozen=True, slots=True)
class LocalTensors:
    """The tensors and equations of the hierarchy to a depth, as series about a point in registers of a program."""

    size: int
    program: machine.SeriesProgram
    tensors: Mapping[ConditionName, Tensor11[machine.Series] | Tensor12[machine.Series]]
    equations: Mapping[EquationName, Sequence[tuple[Unknown, int, int]]]

    @classmethod
    def of(cls, analysis: deciding.Analysis, depth: int) -> LocalTensors:
        """The tensors of a system; TooLarge if the series would take too much memory."""
        variables = deciding.moving_variables(analysis.system, analysis.system.depends_on_time)
        program, _, motion = helmholtz.motion_of_series(variables, analysis.accelerations, depth + 2)
        tensors = tensors_to_depth(motion, depth)
        written = {
            name: [(pair, sign, series.register) for pair, sign, series in terms]
            for condition, tensor in tensors.items()
            for name, terms in equation_terms(condition, tensor, motion.size).items()
        }
        return cls(motion.size, program, tensors, written)

    def at(self, point: modular.Point) -> tuple[machine.Registers, PointwiseConditions]:
        """All series about the point, and the equations there; SingularPoint if a denominator vanishes."""
        instructions = self.program.listed
        constants = machine.constants_at(self.program, point)
        registers = machine.run(self.program, instructions, constants, point.prime, self.program.order)
        position = {pair: column for column, pair in enumerate(unknowns(self.size))}
        rows: dict[EquationName, Row] = {}
        for name, terms in self.equations.items():
            row = [0] * len(position)
            for pair, sign, register in terms:
                row[position[pair]] += sign * registers.value(register)
            rows[name] = tuple(entry % point.prime for entry in row)
        return registers, PointwiseConditions(self.size, point.prime, rows)


def tensors_at(analysis: deciding.Analysis, seed: int, depth: int) -> PointwiseConditions:
    """The equations of the hierarchy to `depth` at the random point of this seed.

    Points where a denominator vanishes are skipped. Raises IrreducibleAtoms if no point is found, and TooLarge if the
    series would take too much memory.
    """
    tensors = LocalTensors.of(analysis, depth)
    for attempt in range(bounds.ATTEMPTS):
        point = tower.draw_point(analysis.tower, seed * bounds.ATTEMPTS + attempt)
        with suppress(modular.SingularPoint):
            return tensors.at(point)[1]
    raise errors.IrreducibleAtoms("the formulas vanish or have no value at every random point tried")


def all_singular(basis: Sequence[Sequence[int]], n: int, prime: int) -> bool:
    """Whether det vanishes identically on the span (tested at random combinations)."""
    source = random.Random(f"determinant {prime}")
    pairs = unknowns(n)
    for _ in range(_TRIALS if basis else 0):
        weights = [source.randrange(1, prime) for _ in basis]
        entry = {
            pair: sum(w * vector[column] for w, vector in zip(weights, basis, strict=True)) % prime
            for column, pair in enumerate(pairs)
        }
        matrix = nmod_mat(n, n, [entry[_pair(i, j)] for i in range(n) for j in range(n)], prime)
        if int(matrix.det()):
            return False
    return True


def smallest_sufficient_set(analysis: deciding.Analysis, seed: int = 1, depth: int = DEEPEST) -> SufficientSet | None:
    """The cheapest conditions that allow only singular g, confirmed at a second point.

    The choice minimizes the depth, then the number of tensors, then the orders. None if the hierarchy to `depth` does
    not suffice, in which case differential consequences decide. Raises IrreducibleAtoms if no generic point is found.
    """
    with suppress(exact_field.TooLarge):
        for level in range(depth + 1):
            chosen = _sufficient(tensors_at(analysis, seed, level))
            if chosen is None:
                continue
            second = tensors_at(analysis, seed + 1, level)
            if all_singular(second.kernel(chosen.equations), second.size, second.prime):
                return chosen
    return None


def unique_direction(analysis: deciding.Analysis, seed: int) -> SufficientSet | None:
    """Conditions, cheap ones first, that determine g at a generic point up to a factor; None if there are none."""
    for level in range(DEEPEST + 1):
        table = tensors_at(analysis, seed, level)
        kept: list[EquationName] = []
        for name in sorted(table.rows, key=lambda item: item.condition.order):
            if len(table.kernel([*kept, name])) < len(table.kernel(kept)):
                kept.append(name)
        if len(table.kernel(kept)) == 1:
            conditions = tuple(dict.fromkeys(name.condition for name in kept))
            return SufficientSet(conditions, tuple(kept), len(kept), 1)
    return None


def _sufficient(table: PointwiseConditions) -> SufficientSet | None:
    by_condition: dict[ConditionName, list[EquationName]] = {}
    for name, values in table.rows.items():
        if any(values):
            by_condition.setdefault(name.condition, []).append(name)
    everything = [name for names in by_condition.values() for name in names]
    if not _suffices(table, everything):
        return None
    for group in _groups(list(by_condition)):
        names = [name for condition in group for name in by_condition[condition]]
        if _suffices(table, names):
            return _pruned(table, names)
    return _pruned(table, everything)


def _groups(conditions: Sequence[ConditionName]) -> list[tuple[ConditionName, ...]]:
    """Sets of conditions, small ones first, then those of low order."""
    sizes = range(1, min(LARGEST_SET, len(conditions)) + 1)
    found = [group for size in sizes for group in itertools.combinations(conditions, size)]
    return sorted(found, key=lambda group: (len(group), sum(c.order for c in group)))


def _suffices(table: PointwiseConditions, names: Sequence[EquationName]) -> bool:
    return all_singular(table.kernel(names), table.size, table.prime)


def _pruned(table: PointwiseConditions, names: Sequence[EquationName]) -> SufficientSet:
    """The set without unnecessary equations, dropping high orders first."""
    kept = list(names)
    for name in sorted(names, key=lambda item: -item.condition.order):
        without = [other for other in kept if other != name]
        if _suffices(table, without):
            kept = without
    dimension = len(table.kernel(kept))
    conditions = tuple(dict.fromkeys(name.condition for name in kept))
    return SufficientSet(conditions, tuple(kept), len(unknowns(table.size)) - dimension, dimension)


@dataclass(frozen=True, slots=True)
class Solved:
    """One equation used: its original form, its form after substitution of the solved unknowns, and its result.

    The coefficients of `reduced` are content times polynomials without a common factor, and the coefficient of `pivot`
    is content * divisor; `pivot` equals the combination `value` of other entries.
    """

    name: EquationName
    original: Linear
    reduced: Linear
    content: exact_field.Quotient
    pivot: Unknown
    divisor: exact_field.Quotient
    value: Linear


@dataclass(frozen=True, slots=True)
class Elimination:
    """All steps, and the solved entries in terms of free ones."""

    solved: tuple[Solved, ...]
    values: Mapping[Unknown, Linear]

    def matrix(self, n: int, one: exact_field.Quotient) -> list[list[Linear]]:
        """g, shape (n, n), each entry a combination of free ones."""
        pairs = [[_pair(i, j) for j in range(n)] for i in range(n)]
        return [[self.values.get(pair, {pair: one}) for pair in row] for row in pairs]


def eliminate(equations: Mapping[EquationName, Linear], table: PointwiseConditions) -> Elimination:
    """Repeatedly solve the simplest remaining equation until g is recognized as singular or none remains."""
    left = dict(equations)
    solved: list[Solved] = []
    values: dict[Unknown, Linear] = {}
    while left and vanishing_block(values, table.size) is None:
        reduced = {name: substituted(row, values) for name, row in left.items()}
        choice = _choose(reduced, solved, table)
        if choice is None:
            break
        name, pivot = choice
        step = _solve(name, left.pop(name), reduced[name], pivot)
        solved.append(step)
        values = {unknown: substituted(row, {pivot: step.value}) for unknown, row in values.items()}
        values[pivot] = step.value
    return Elimination(tuple(solved), values)


def substituted(row: Linear, values: Mapping[Unknown, Linear]) -> dict[Unknown, exact_field.Quotient]:
    """The combination with solved unknowns replaced, without zero coefficients."""
    parts = [(unknown, coefficient) for unknown, coefficient in row.items() if unknown not in values]
    known = [(values[unknown], coefficient) for unknown, coefficient in row.items() if unknown in values]
    return collected([*parts, *((other, c * factor) for value, c in known for other, factor in value.items())])


def collected(terms: Iterable[tuple[Unknown, exact_field.Quotient]]) -> dict[Unknown, exact_field.Quotient]:
    """The terms of one equation by unknown, without zero coefficients."""
    parts: dict[Unknown, list[exact_field.Quotient]] = {}
    for unknown, coefficient in terms:
        parts.setdefault(unknown, []).append(coefficient)
    sums = {unknown: exact_field.sum_of(summands[0].field.constant(0), summands) for unknown, summands in parts.items()}
    return {unknown: total for unknown, total in sums.items() if not total.is_zero}


def _choose(
    reduced: Mapping[EquationName, Linear], solved: Sequence[Solved], table: PointwiseConditions
) -> tuple[EquationName, Unknown] | None:
    """The shortest equation, and its unknown with the simplest coefficient that is a true pivot."""
    order = sorted(reduced, key=lambda name: (len(reduced[name]), _length(reduced[name])))
    for name in order:
        row = reduced[name]
        for unknown in sorted(row, key=lambda u: (_weight(row[u]), u[0] == u[1], u)):
            if _minor([*solved], name, unknown, table):
                return name, unknown
    return None


def _length(row: Linear) -> int:
    return sum(map(_weight, row.values()))


def _weight(coefficient: exact_field.Quotient) -> int:
    """A measure of size; rational numbers weigh nothing."""
    if coefficient.constant_value is not None:
        return 0
    return len(coefficient.numerator) + sum(power for _, power in coefficient.exponents)


def _minor(solved: Sequence[Solved], name: EquationName, unknown: Unknown, table: PointwiseConditions) -> int:
    """The determinant of the equations used so far in the unknowns solved for, at the random point."""
    position = {pair: column for column, pair in enumerate(unknowns(table.size))}
    columns = [position[step.pivot] for step in solved] + [position[unknown]]
    rows = [table.rows[step.name] for step in solved] + [table.rows[name]]
    flat = [row[column] for row in rows for column in columns]
    return int(nmod_mat(len(rows), len(rows), flat, table.prime).det())


def _solve(name: EquationName, original: Linear, row: Linear, pivot: Unknown) -> Solved:
    content = exact_field.common_factor(list(row.values()))
    equation = {unknown: coefficient / content for unknown, coefficient in row.items()}
    divisor = equation[pivot]
    value = {other: -(c / divisor) for other, c in equation.items() if other != pivot}
    return Solved(name, original, row, content, pivot, divisor, value)


def vanishing_block(values: Mapping[Unknown, Linear], n: int) -> tuple[tuple[int, ...], tuple[int, ...]] | None:
    """Rows and columns, together more than n, whose common entries are all zero: then det g = 0."""
    zero = {unknown for unknown, row in values.items() if not row}
    for size in range(1, n + 1):
        for rows in itertools.combinations(range(n), size):
            columns = tuple(c for c in range(n) if all(_pair(r, c) in zero for r in rows))
            if size + len(columns) > n:
                return rows, columns
    return None


def remaining_determinant(
    elimination: Elimination, n: int, symbols: Mapping[Unknown, exact_field.Quotient], one: exact_field.Quotient
) -> exact_field.Quotient:
    """det g of the remaining multiplier (n <= 4)."""

    def entry(row: Linear) -> exact_field.Quotient:
        return exact_field.sum_of(one - one, [c * symbols[unknown] for unknown, c in row.items()])

    return matrices.determinant([list(map(entry, line)) for line in elimination.matrix(n, one)], one)


@dataclass(frozen=True, slots=True)
class Line:
    """A derivative of u, its derivation (with formulas of the theory between grave accents), and its value."""

    reason: str
    formula: notation.Formula
    value: exact_field.Quotient


@dataclass(frozen=True, slots=True)
class Contradiction:
    """The derivatives of u, and a nonzero expression in them that must be zero; `note` says why it must."""

    lines: tuple[Line, ...]
    formula: notation.Formula
    note: str
    difference: exact_field.Quotient


def direction_matrix(result: Elimination, n: int, one: exact_field.Quotient) -> Matrix:
    """G: the entries of g divided by the free entry."""
    return tuple(tuple(next(iter(row.values()), one - one) for row in line) for line in result.matrix(n, one))


def contradiction(
    analysis: deciding.Analysis, exact: cd.MotionInRing, direction: Matrix, with_time: bool, seed: int
) -> Contradiction:
    """The first integrability condition of u that fails; TooLarge if none is found."""
    slopes = cd.factor_slopes(exact, direction)
    point = tower.draw_point(analysis.tower, seed)
    names = analysis.system.coordinates
    for formula, note, difference, held in _conditions(exact, slopes, with_time, names):
        if not difference.is_zero and _is_nonzero(exact.ring, difference, point):
            return Contradiction(_lines(slopes, with_time, held, names), formula, note, difference)
    raise exact_field.TooLarge("no integrability condition of the factor fails")


def _conditions(
    exact: cd.MotionInRing, slopes: cd.FactorSlopes, with_time: bool, names: tuple[str, ...]
) -> Iterator[tuple[notation.Formula, str, exact_field.Quotient, frozenset[ex.Symbol | ex.Velocity]]]:
    """Expressions that vanish if u exists, with reason and variables of their slopes, simplest first."""
    motion = exact.motion
    if not with_time:
        yield _slope(ex.TIME), ", as L must not contain t,", slopes.by_time, frozenset({ex.TIME})
    first: list[tuple[ex.Symbol | ex.Velocity, Any, exact_field.Quotient]] = [
        (ex.Velocity(x), motion.by_velocity[k], slopes.by_velocity[k]) for k, x in enumerate(names)
    ]
    first += [(ex.Symbol(x), motion.by_coordinate[k], slopes.by_coordinate[k]) for k, x in enumerate(names)]
    if with_time:
        first.append((ex.TIME, exact.ring.partial(0), slopes.by_time))
    for left in range(len(first)):
        for right in range(left):
            x, by_x, u_x = first[left]
            y, by_y, u_y = first[right]
            yield notation.row(_mixed(y, x), " - ", _mixed(x, y)), "", by_x(u_y) - by_y(u_x), frozenset({x, y})


def _slope(variable: ex.Symbol | ex.Velocity) -> notation.Formula:
    return notation.partial_derivative(notation.theory("u"), variable)


def _mixed(inner: ex.Symbol | ex.Velocity, outer: ex.Symbol | ex.Velocity) -> notation.Formula:
    return notation.partial_derivative(notation.row("(", _slope(inner), ")"), outer)


def _lines(
    slopes: cd.FactorSlopes, with_time: bool, held: frozenset[ex.Symbol | ex.Velocity], names: tuple[str, ...]
) -> tuple[Line, ...]:
    """The known derivatives of u in the order of derivation, with those on which they depend."""
    of_velocities = all(isinstance(variable, ex.Velocity) for variable in held)
    lines = [
        Line("Since `dg_ij/dv^k` is symmetric in `j` and `k`", _slope(ex.Velocity(x)), slopes.by_velocity[k])
        for k, x in enumerate(names)
        if ex.Velocity(x) in held or not of_velocities
    ]
    if of_velocities:
        return tuple(lines)
    lines.append(Line("By `Gamma(g) = g N + (g N)^T`", notation.theory("Gamma(u)"), slopes.along))
    lines += [
        Line(f"`Gamma(u)` differentiated by `{x}'`", _slope(ex.Symbol(x)), slopes.by_coordinate[k])
        for k, x in enumerate(names)
        if ex.Symbol(x) in held or ex.TIME in held
    ]
    if with_time and ex.TIME in held:
        lines.append(Line("The remaining term of `Gamma(u)`", _slope(ex.TIME), slopes.by_time))
    return tuple(lines)


def _is_nonzero(ring: exact_field.ExactRing, element: exact_field.Quotient, point: modular.Point) -> bool:
    """Whether the value at the random point is nonzero; TooLarge if it cannot be evaluated."""
    numerator = tower.to_kernels(exact_field.polynomial_tree(ring, element.numerator))
    try:
        return modular.evaluate(numerator, point) % point.prime != 0
    except (KeyError, TypeError, ValueError, modular.SingularPoint) as error:
        raise exact_field.TooLarge("an expression could not be evaluated modulo a prime") from error
