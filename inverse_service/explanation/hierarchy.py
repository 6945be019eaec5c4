"""Find conditions on the multiplier g that suffice for a negative verdict, and eliminate them
exactly.

Each tensor T of type (1, 1) of the hierarchy requires g T to be symmetric, each curvature R that
g_ij R^j_kl + g_lj R^j_ik + g_kj R^j_li = 0:

    Phi, nabla Phi, nabla^2 Phi, …;   R, nabla R, …;   R[nabla Phi], R[nabla^2 Phi], …

with the tensors of `mechanics.conditions`. At a point each is a linear condition on the n(n+1)/2
entries of g. A set suffices if every symmetric g that satisfies it at a generic point is singular;
values are taken at random points modulo a prime, from Taylor series of f. The hierarchy to depth d
consists of the tensors that need at most d + 2 derivatives of f: Phi alone for d = 0; nabla Phi and
R with d = 1; and so on. Curvatures need n >= 3.

`exact_rows` forms chosen equations over an exact ring, with the entries g_11, g_12, … as symbols.

`eliminate` solves chosen conditions exactly for g_11, g_12, … one after another, as by hand. Every
pivot is checked modulo a prime: the minor of the used equations and solved unknowns must not vanish
at the random point, so that no unrecognized zero is used as a divisor.

`contradiction` treats a multiplier known up to a factor, g = e^u G, whose factor does not exist: a
multiplier exists only if all mixed derivatives of u agree (`conditions.factor_slopes` returns the
first ones), and u_t = 0 if L must not contain t.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, cast

from flint import nmod_mat

from inverse_service import bounds, errors
from inverse_service.decision import deciding
from inverse_service.expressions import notation, tree as ex
from inverse_service.field import dense_series as machine, exact_field, matrices, modular, tower
from inverse_service.mechanics import conditions as cd
from inverse_service.mechanics.conditions import S, Tensor11, Tensor12
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.statements.questions import Question, narrowest

# The largest set of tensors searched for (beyond it, all equations of a depth are pruned one by
# one), and the greatest depth. Of 376 systems of tests/corpus without L, 98 are decided at depth 1,
# 255 at depth 2, and 23 not to depth 3, by at most three tensors: `smallest_sufficient_set` of
# each.
LARGEST_SET, DEEPEST = 4, 3

Row = tuple[int, ...]

Unknown = tuple[int, int]
Linear = Mapping[Unknown, exact_field.Quotient]

Matrix = tuple[tuple[exact_field.Quotient, ...], ...]


class Kind(StrEnum):
    """What a tensor of the hierarchy is made of: nabla^k Phi, nabla^k R, or R[nabla^k Phi]."""

    ENDOMORPHISM = "Phi"
    CURVATURE = "R"
    CURVATURE_OF = "S"


@dataclass(frozen=True, slots=True)
class ConditionName:
    """A tensor of the hierarchy: Phi, nabla^2 Phi, R, R[nabla Phi], with the `power` of nabla."""

    kind: Kind
    power: int

    @property
    def name(self) -> str:
        nabla = ("", "nabla ")[self.power] if self.power < 2 else f"nabla^{self.power} "
        if self.kind is Kind.CURVATURE_OF:
            return f"R[{nabla}{Kind.ENDOMORPHISM}]"
        return f"{nabla}{self.kind}"

    @property
    def cyclic(self) -> bool:
        """Whether it is a curvature, whose condition is a cyclic sum."""
        return self.kind is not Kind.ENDOMORPHISM

    @property
    def order(self) -> int:
        """The number of derivatives of f that it needs."""
        return self.power + 2 + self.cyclic


@dataclass(frozen=True, slots=True)
class EquationName:
    """One linear equation: (T)_ik for "g T symmetric" (i < k), (R)_ikl for the cyclic one (i < k <
    l).
    """

    condition: ConditionName
    indices: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class ChosenEquations:
    """Equations of the hierarchy; the symmetric g that satisfy them at a generic point form a space
    of `dimension`.
    """

    equations: tuple[EquationName, ...]
    dimension: int

    @property
    def conditions(self) -> tuple[ConditionName, ...]:
        """The tensors of these equations, in order."""
        return tuple(dict.fromkeys(name.condition for name in self.equations))


def depth_of(equations: Iterable[EquationName]) -> int:
    """The depth to which the hierarchy is needed for these equations."""
    return max((name.condition.order for name in equations), default=2) - 2


def unknowns(n: int) -> list[tuple[int, int]]:
    """Index pairs of the entries g_ij, i <= j, in the order of the columns."""
    return [(i, j) for i in range(n) for j in range(i, n)]


def tensors_to_depth(
    motion: cd.Motion[S], depth: int
) -> dict[ConditionName, Tensor11[S] | Tensor12[S]]:
    """The tensors that need at most depth + 2 derivatives of f; curvatures only for n >= 3."""
    connection = cd.connection(motion)
    endomorphisms = [cd.jacobi_endomorphism(motion)]
    for _ in range(depth):
        endomorphisms.append(cd.nabla(motion, connection, endomorphisms[-1]))
    table: dict[ConditionName, Tensor11[S] | Tensor12[S]] = {}
    for k, tensor in enumerate(endomorphisms):
        table[ConditionName(Kind.ENDOMORPHISM, k)] = tensor
    if motion.size < 3:
        return table
    bend: Tensor12[S] | None = None
    for k in range(depth):
        of_phi = cd.curvature(motion, endomorphisms[k])
        bend = of_phi if bend is None else cd.nabla_of_curvature(motion, connection, bend)
        table[ConditionName(Kind.CURVATURE, k)] = bend
        if k:
            table[ConditionName(Kind.CURVATURE_OF, k)] = of_phi
    return table


def equation_terms(
    condition: ConditionName, tensor: Tensor11[S] | Tensor12[S], n: int
) -> dict[EquationName, list[tuple[tuple[int, int], int, S]]]:
    """Each equation as terms (unknown, sign, coefficient), the unknown given with i <= j.

    g_ij T^j_k - g_kj T^j_i for i < k, and the cyclic sum of g_aj R^j_bc over (a, b, c) = (i, k, m)
    for i < k < m, where T^j_k is `tensor[j][k]` and R^j_bc is `tensor[j][b][c]`.
    """
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
    """The equations of the hierarchy at one point, each a row over the `unknowns`, modulo
    `prime`.
    """

    size: int
    prime: int
    rows: Mapping[EquationName, Row]

    def kernel(self, names: Sequence[EquationName]) -> list[list[int]]:
        """A basis of the g that satisfy the named equations."""
        return matrices.null_rows(
            [self.rows[name] for name in names], len(unknowns(self.size)), self.prime
        )


@dataclass(frozen=True, slots=True)
class LocalTensors:
    """The tensors and equations of the hierarchy to a depth, as series about a point in registers
    of a program.
    """

    size: int
    program: machine.SeriesProgram
    tensors: Mapping[ConditionName, Tensor11[machine.Series] | Tensor12[machine.Series]]
    equations: Mapping[EquationName, Sequence[tuple[Unknown, int, int]]]

    @classmethod
    def of(cls, analysis: deciding.Analysis, depth: int) -> LocalTensors:
        """The tensors of a system; TooLarge if the series would take too much memory."""
        variables = deciding.moving_variables(
            analysis.system, narrowest(analysis.system.depends_on_time)
        )
        program, _, motion = cd.motion_of_series(variables, analysis.accelerations, depth + 2)
        tensors = tensors_to_depth(motion, depth)
        written = {
            name: [(pair, sign, series.register) for pair, sign, series in terms]
            for condition, tensor in tensors.items()
            for name, terms in equation_terms(condition, tensor, motion.size).items()
        }
        return cls(motion.size, program, tensors, written)

    def at(self, point: modular.Point) -> tuple[machine.Registers, PointwiseConditions]:
        """All series about the point, and the equations there; SingularPoint if a denominator
        vanishes.
        """
        instructions = self.program.listed
        constants = machine.constants_at(self.program, point)
        registers = machine.run(
            self.program, instructions, constants, point.prime, self.program.order
        )
        position = {pair: column for column, pair in enumerate(unknowns(self.size))}
        rows: dict[EquationName, Row] = {}
        for name, terms in self.equations.items():
            row = [0] * len(position)
            for pair, sign, register in terms:
                row[position[pair]] += sign * registers.value(register)
            rows[name] = tuple(entry % point.prime for entry in row)
        return registers, PointwiseConditions(self.size, point.prime, rows)


def local_tensors(analysis: deciding.Analysis, depth: int) -> LocalTensors:
    """`LocalTensors.of`, made once for all points and steps of an explanation."""
    key = f"tensors of the hierarchy to {depth}"
    if key not in analysis.proposals:
        analysis.proposals[key] = LocalTensors.of(analysis, depth)
    found: LocalTensors = analysis.proposals[key]
    return found


def equations_at(analysis: deciding.Analysis, seed: int, depth: int) -> PointwiseConditions:
    """The equations of the hierarchy to `depth` at the random point of this seed.

    Points where a denominator vanishes are skipped. Raises IrreducibleAtoms if no point is found,
    and TooLarge if the series would take too much memory.
    """
    key = f"equations of the hierarchy to {depth}, point {seed}"
    if key in analysis.proposals:
        known: PointwiseConditions = analysis.proposals[key]
        return known
    tensors = local_tensors(analysis, depth)
    for attempt in range(bounds.ATTEMPTS):
        point = tower.draw_point(analysis.tower, seed * bounds.ATTEMPTS + attempt)
        with suppress(modular.SingularPoint):
            found = analysis.proposals[key] = tensors.at(point)[1]
            return found
    raise errors.IrreducibleAtoms(
        "the formulas vanish or have no value at every random point tried"
    )


def all_singular(basis: Sequence[Sequence[int]], n: int, prime: int) -> bool:
    """Whether det vanishes on the span, tested at one random combination: wrong with a probability
    below n/prime.
    """
    source = random.Random(f"determinant {prime}")
    weights = [source.randrange(1, prime) for _ in basis]
    entry = {
        pair: sum(w * vector[column] for w, vector in zip(weights, basis, strict=True)) % prime
        for column, pair in enumerate(unknowns(n))
    }
    return not int(
        nmod_mat(n, n, [entry[_pair(i, j)] for i in range(n) for j in range(n)], prime).det()
    )


def smallest_sufficient_set(analysis: deciding.Analysis, seed: int = 1) -> ChosenEquations | None:
    """The cheapest conditions that allow only singular g, confirmed at a second point.

    The choice minimizes the depth, then the number of tensors, then the orders. None if the
    hierarchy to depth `DEEPEST` does not suffice, in which case differential consequences decide.
    Raises IrreducibleAtoms if no generic point is found.
    """
    with suppress(exact_field.TooLarge):
        for depth in range(DEEPEST + 1):
            chosen = _cheapest_sufficient(equations_at(analysis, seed, depth))
            if chosen is None:
                continue
            second = equations_at(analysis, seed + 1, depth)
            if all_singular(second.kernel(chosen.equations), second.size, second.prime):
                return chosen
    return None


def equations_of_one_direction(analysis: deciding.Analysis, seed: int) -> ChosenEquations | None:
    """Equations, cheap ones first, that determine g at a generic point up to a factor; None if
    there are none.
    """
    for depth in range(DEEPEST + 1):
        table = equations_at(analysis, seed, depth)
        kept, dimension = list[EquationName](), len(unknowns(table.size))
        for name in sorted(table.rows, key=lambda item: item.condition.order):
            smaller = len(table.kernel([*kept, name]))
            if smaller < dimension:
                kept, dimension = [*kept, name], smaller
        if dimension == 1:
            return ChosenEquations(tuple(kept), dimension)
    return None


def _cheapest_sufficient(table: PointwiseConditions) -> ChosenEquations | None:
    """The first sufficient group of tensors, without unnecessary equations; None if not even all
    equations suffice.
    """
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


def _pruned(table: PointwiseConditions, names: Sequence[EquationName]) -> ChosenEquations:
    """The equations without unnecessary equations, dropping high orders first."""
    kept = list(names)
    for name in sorted(names, key=lambda item: -item.condition.order):
        without = [other for other in kept if other != name]
        if _suffices(table, without):
            kept = without
    return ChosenEquations(tuple(kept), len(table.kernel(kept)))


Tensors = Mapping[ConditionName, Tensor11[exact_field.Quotient] | Tensor12[exact_field.Quotient]]


@dataclass(frozen=True, slots=True)
class ExactRows:
    """Equations with ring elements as coefficients, the symbols of the g_ij, the tensors, and the
    rows at a point.
    """

    exact: cd.MotionInRing
    symbols: Mapping[Unknown, ex.Symbol]
    tensors: Tensors
    equations: Mapping[EquationName, Linear]
    table: PointwiseConditions

    @property
    def ring(self) -> exact_field.ExactRing:
        return self.exact.ring


def exact_rows(
    analysis: deciding.Analysis,
    names: Sequence[EquationName],
    seed: int,
    budget: exact_field.Budget,
    further_orders: int = 0,
) -> ExactRows:
    """The named equations over an exact ring, which allows `further_orders` derivations of them.

    Raises TooLarge if the budget is exhausted, and ZeroDivisionError as the ring does.
    """
    depth, symbols = depth_of(names), entry_symbols(analysis.system)
    exact = cd.motion_in_ring(
        analysis.system, depth + 2 + further_orders, budget, tuple(symbols.values())
    )
    table = equations_at(analysis, seed, depth)
    tensors = tensors_to_depth(exact.motion, depth)
    found: dict[EquationName, Linear] = {}
    for condition in dict.fromkeys(name.condition for name in names):
        for name, terms in equation_terms(condition, tensors[condition], exact.motion.size).items():
            found[name] = collected(
                (unknown, coefficient.scaled(sign)) for unknown, sign, coefficient in terms
            )
    return ExactRows(exact, symbols, tensors, {name: found[name] for name in names}, table)


def entry_symbols(system: SecondOrderSystem) -> dict[Unknown, ex.Symbol]:
    """Names g_11, g_12, … for the entries, with another letter if the system uses such names."""
    used = {
        node.name
        for f in system.accelerations
        for node in ex.walk(f)
        if isinstance(node, ex.Symbol)
    }
    used |= set(system.coordinates) | set(system.parameters)
    pairs = unknowns(len(system.coordinates))
    for letter in (notation.MULTIPLIER.get(), "g", "h", "m", "multiplier"):
        names = {(i, j): f"{letter}_{i + 1}{j + 1}" for i, j in pairs}
        if used.isdisjoint(names.values()):
            return {pair: ex.Symbol(name) for pair, name in names.items()}
    raise exact_field.TooLarge("the system uses every name for the entries of the multiplier")


@dataclass(frozen=True, slots=True)
class Solved:
    """One equation used: its original form, its form after substitution of the solved unknowns, and
    its result.

    The coefficients of `reduced` are content times polynomials without a common factor, and the
    coefficient of `pivot` is content * divisor; `pivot` equals the combination `value` of other
    entries.
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
    """Repeatedly solve the simplest remaining equation until g is recognized as singular or none
    remains.
    """
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


def substituted(
    row: Linear, values: Mapping[Unknown, Linear]
) -> dict[Unknown, exact_field.Quotient]:
    """The combination with solved unknowns replaced, without zero coefficients."""
    parts = [
        (unknown, coefficient) for unknown, coefficient in row.items() if unknown not in values
    ]
    known = [
        (values[unknown], coefficient) for unknown, coefficient in row.items() if unknown in values
    ]
    return collected(
        [*parts, *((other, c * factor) for value, c in known for other, factor in value.items())]
    )


def collected(
    terms: Iterable[tuple[Unknown, exact_field.Quotient]],
) -> dict[Unknown, exact_field.Quotient]:
    """The terms of one equation by unknown, without zero coefficients."""
    parts: dict[Unknown, list[exact_field.Quotient]] = {}
    for unknown, coefficient in terms:
        parts.setdefault(unknown, []).append(coefficient)
    sums = {
        unknown: exact_field.sum_of(summands[0].field.constant(0), summands)
        for unknown, summands in parts.items()
    }
    return {unknown: total for unknown, total in sums.items() if not total.is_zero}


def _choose(
    reduced: Mapping[EquationName, Linear], solved: Sequence[Solved], table: PointwiseConditions
) -> tuple[EquationName, Unknown] | None:
    """The shortest equation, and its unknown with the simplest coefficient that is a true pivot."""
    for name in sorted(
        reduced, key=lambda name: (len(reduced[name]), sum(map(_weight, reduced[name].values())))
    ):
        row = reduced[name]
        for unknown in sorted(row, key=lambda u: (_weight(row[u]), u[0] == u[1], u)):
            if _pivot_minor(solved, name, unknown, table):
                return name, unknown
    return None


def _weight(coefficient: exact_field.Quotient) -> int:
    """A measure of size; rational numbers weigh nothing."""
    if coefficient.constant_value is not None:
        return 0
    return len(coefficient.numerator) + sum(power for _, power in coefficient.exponents)


def _pivot_minor(
    solved: Sequence[Solved], name: EquationName, unknown: Unknown, table: PointwiseConditions
) -> int:
    """The determinant of the equations used so far in the unknowns solved for, at the random
    point.
    """
    position = {pair: column for column, pair in enumerate(unknowns(table.size))}
    columns = [position[step.pivot] for step in solved] + [position[unknown]]
    rows = [table.rows[step.name] for step in solved] + [table.rows[name]]
    flat = [row[column] for row in rows for column in columns]
    return int(nmod_mat(len(rows), len(rows), flat, table.prime).det())


def _solve(name: EquationName, original: Linear, row: Linear, pivot: Unknown) -> Solved:
    """`row`, the reduced form of `original`, solved for the pivot."""
    content = exact_field.common_factor(list(row.values()))
    equation = {unknown: coefficient / content for unknown, coefficient in row.items()}
    divisor = equation[pivot]
    value = {other: -(c / divisor) for other, c in equation.items() if other != pivot}
    return Solved(name, original, row, content, pivot, divisor, value)


def vanishing_block(
    values: Mapping[Unknown, Linear], n: int
) -> tuple[tuple[int, ...], tuple[int, ...]] | None:
    """Rows and columns, together more than n, whose common entries are all zero: then det g = 0."""
    zero = {unknown for unknown, row in values.items() if not row}
    for size in range(1, n + 1):
        for rows in itertools.combinations(range(n), size):
            columns = tuple(c for c in range(n) if all(_pair(r, c) in zero for r in rows))
            if size + len(columns) > n:
                return rows, columns
    return None


def remaining_determinant(
    elimination: Elimination,
    n: int,
    symbols: Mapping[Unknown, exact_field.Quotient],
    one: exact_field.Quotient,
) -> exact_field.Quotient:
    """det g of the remaining multiplier, its free entries as `symbols`."""

    def entry(row: Linear) -> exact_field.Quotient:
        return exact_field.sum_of(one - one, [c * symbols[unknown] for unknown, c in row.items()])

    return matrices.determinant(
        [list(map(entry, line)) for line in elimination.matrix(n, one)], one
    )


@dataclass(frozen=True, slots=True)
class Line:
    """A derivative of u, its derivation (with formulas of the theory between grave accents), and
    its value.
    """

    reason: str
    formula: notation.Formula
    value: exact_field.Quotient


@dataclass(frozen=True, slots=True)
class Contradiction:
    """The derivatives of u, and a nonzero expression in them that must be zero; `note` says why it
    must.
    """

    lines: tuple[Line, ...]
    formula: notation.Formula
    note: str
    difference: exact_field.Quotient


def direction_matrix(result: Elimination, n: int, one: exact_field.Quotient) -> Matrix:
    """G: the entries of g divided by the free entry."""
    return tuple(
        tuple(next(iter(row.values()), one - one) for row in line) for line in result.matrix(n, one)
    )


def contradiction(
    analysis: deciding.Analysis,
    exact: cd.MotionInRing,
    direction: Matrix,
    question: Question,
    seed: int,
) -> Contradiction:
    """The first integrability condition of u that fails; TooLarge if none is found."""
    slopes = cd.factor_slopes(exact, direction)
    point = tower.draw_point(analysis.tower, seed)
    names = analysis.system.coordinates
    for formula, note, difference, variables in integrability_conditions(
        exact, slopes, question, names
    ):
        if not difference.is_zero and _is_nonzero(exact.ring, difference, point):
            return Contradiction(
                _lines(slopes, question, variables, names), formula, note, difference
            )
    raise exact_field.TooLarge("no integrability condition of the factor fails")


def integrability_conditions(
    exact: cd.MotionInRing, slopes: cd.FactorSlopes, question: Question, names: tuple[str, ...]
) -> Iterator[
    tuple[notation.Formula, str, exact_field.Quotient, frozenset[ex.Symbol | ex.Velocity]]
]:
    """(formula, reason, value, variables): values that vanish if u exists, and the variables by
    which u is differentiated in them.

    u_t first if L must not contain t, then (u_y)_x - (u_x)_y for each pair of variables, the
    velocities first.
    """
    motion = exact.motion
    if not question.timed:
        yield _slope(ex.TIME), ", as L must not contain t,", slopes.by_time, frozenset({ex.TIME})
    first: list[tuple[ex.Symbol | ex.Velocity, Any, exact_field.Quotient]] = [
        (ex.Velocity(x), motion.by_velocity[k], slopes.by_velocity[k]) for k, x in enumerate(names)
    ]
    first += [
        (ex.Symbol(x), motion.by_coordinate[k], slopes.by_coordinate[k])
        for k, x in enumerate(names)
    ]
    if question.timed:
        first.append((ex.TIME, exact.ring.partial(0), slopes.by_time))
    for left in range(len(first)):
        for right in range(left):
            x, by_x, u_x = first[left]
            y, by_y, u_y = first[right]
            yield (
                notation.row(_mixed(y, x), " - ", _mixed(x, y)),
                "",
                by_x(u_y) - by_y(u_x),
                frozenset({x, y}),
            )


def _slope(variable: ex.Symbol | ex.Velocity) -> notation.Formula:
    return notation.partial_derivative(notation.theory("u"), variable)


def _mixed(inner: ex.Symbol | ex.Velocity, outer: ex.Symbol | ex.Velocity) -> notation.Formula:
    return notation.partial_derivative(notation.row("(", _slope(inner), ")"), outer)


def _lines(
    slopes: cd.FactorSlopes,
    question: Question,
    variables: frozenset[ex.Symbol | ex.Velocity],
    names: tuple[str, ...],
) -> tuple[Line, ...]:
    """The derivatives of u by these variables, in the order of derivation, with those on which they
    depend.

    du/dv follows from (H1), Gamma(u) from (H2), du/dq from both, and du/dt from all of them: see
    `factor_slopes`.
    """
    of_velocities = all(isinstance(variable, ex.Velocity) for variable in variables)
    lines = [
        Line(
            "Since `dg_ij/dv^k` is symmetric in `j` and `k`",
            _slope(ex.Velocity(x)),
            slopes.by_velocity[k],
        )
        for k, x in enumerate(names)
        if ex.Velocity(x) in variables or not of_velocities
    ]
    if of_velocities:
        return tuple(lines)
    lines.append(Line("By `Gamma(g) = g N + (g N)^T`", notation.theory("Gamma(u)"), slopes.along))
    lines += [
        Line(
            f"Differentiating `Gamma(u)` with respect to `{x}'`",
            _slope(ex.Symbol(x)),
            slopes.by_coordinate[k],
        )
        for k, x in enumerate(names)
        if ex.Symbol(x) in variables or ex.TIME in variables
    ]
    if question.timed and ex.TIME in variables:
        lines.append(Line("The remaining term of `Gamma(u)`", _slope(ex.TIME), slopes.by_time))
    return tuple(lines)


def _is_nonzero(
    ring: exact_field.ExactRing, element: exact_field.Quotient, point: modular.Point
) -> bool:
    """Whether the value at the random point is nonzero; TooLarge if it cannot be evaluated."""
    numerator = tower.to_kernels(exact_field.polynomial_tree(ring, element.numerator))
    try:
        return modular.evaluate(numerator, point) % point.prime != 0
    except (KeyError, TypeError, ValueError, modular.SingularPoint) as error:
        raise exact_field.TooLarge("an expression could not be evaluated modulo a prime") from error
