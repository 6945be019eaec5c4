"""The identities behind a verdict: det g = 0 from the algebraic conditions, or the Euler-Lagrange equations of L."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from flint import fmpq, fmpq_mpoly

from inverse_service.decision.analysis import Analysis
from inverse_service.explanation.elimination import Linear, Unknown, eliminate
from inverse_service.explanation.hierarchy import EquationName, PointwiseConditions, SufficientSet
from inverse_service.explanation.negative import exact_rows
from inverse_service.explanation.proofs.identities import (
    Divisor,
    Fact,
    Identity,
    Remainder,
    coefficient,
    content,
    divided,
    identity,
    primitive,
)
from inverse_service.explanation.wording import equation_name
from inverse_service.expressions.tree import Expression, Symbol
from inverse_service.field.exact_ring import ExactRing, polynomial_tree, sum_of
from inverse_service.field.rational_functions import Budget, Quotient, QuotientField, TooLarge, factored
from inverse_service.mechanics.conditions import MotionInRing, motion_in_ring
from inverse_service.mechanics.quotient_matrices import determinant, null_space
from inverse_service.mechanics.second_order_system import SecondOrderSystem

# A factor of more terms than this is replaced by a letter.
TERMS_OF_A_FACTOR = 4
Row = Mapping[Unknown, tuple[fmpq_mpoly, list[tuple[fmpq_mpoly, int]]]]


def lettered(
    ring: ExactRing, symbols: Mapping[Unknown, Symbol], equations: Mapping[EquationName, Linear], budget: Budget
) -> tuple[ExactRing, dict[EquationName, Linear]]:
    """The rows over a ring with a further generator for each long factor, which prints as that factor.

    Denominators and factors that all coefficients of a row share are left out.
    """
    rows = {name: _factored(ring, symbols, row) for name, row in equations.items()}
    factors = (factor for row in rows.values() for _, parts in row.values() for factor, _ in parts)
    long = list({str(factor): factor for factor in factors if len(factor) > TERMS_OF_A_FACTOR}.values())
    wider = _widened(ring, long, budget)
    letters = {str(factor): len(ring.field.context.names()) + k for k, factor in enumerate(long)}
    return wider, {
        name: {unknown: _in_letters(wider, letters, *parts) for unknown, parts in row.items()}
        for name, row in rows.items()
    }


def _factored(ring: ExactRing, symbols: Mapping[Unknown, Symbol], row: Linear) -> Row:
    """The coefficients, put over one denominator, as a number and irreducible factors that they do not all share."""
    places = {tree: index for index, tree in ring.trees.items()}
    whole = sum_of(ring.constant(0), [c * ring.atoms[symbols[unknown]] for unknown, c in row.items()]).numerator
    parts = {unknown: coefficient(whole, places[symbols[unknown]], 1) for unknown in row}
    shared = functools.reduce(lambda a, b: a.gcd(b), parts.values())
    split = {unknown: factored(part / shared) for unknown, part in parts.items()}
    return {unknown: (shared * 0 + fmpq(*n.as_integer_ratio()), found) for unknown, (n, found) in split.items()}


def _widened(ring: ExactRing, long: list[fmpq_mpoly], budget: Budget) -> ExactRing:
    """The same generators and relations, and one generator more for each long factor."""
    size = len(ring.field.context.names())
    field = QuotientField.with_generators(size + len(long), budget)
    wider = ExactRing(field, (), 0, slopes=False)
    for index, relation in ring.field.relations.items():
        field.relate(index, relation.degree, _moved(field, relation.right))
    wider.trees = ring.trees | {size + k: polynomial_tree(ring, factor) for k, factor in enumerate(long)}
    wider.atoms = {tree: wider.generator(index) for index, tree in wider.trees.items()}
    return wider


def _moved(field: QuotientField, polynomial: fmpq_mpoly) -> fmpq_mpoly:
    """The polynomial among more generators."""
    more = (0,) * (len(field.context.names()) - len(polynomial.context().names()))
    return field.context.from_dict({(*exponents, *more): value for exponents, value in polynomial.to_dict().items()})


def _in_letters(
    ring: ExactRing, letters: Mapping[str, int], number: fmpq_mpoly, factors: list[tuple[fmpq_mpoly, int]]
) -> Quotient:
    value = Quotient(ring.field, _moved(ring.field, number), ())
    for factor, exponent in factors:
        index = letters.get(str(factor))
        part = Quotient(ring.field, _moved(ring.field, factor), ()) if index is None else ring.generator(index)
        value = value * part**exponent
    return value


Combination = tuple[fmpq_mpoly, Sequence[tuple[fmpq_mpoly, Fact]]]
# Longer polynomials than this make proofs that take minutes; with letters they are short.
TERMS_WITHOUT_LETTERS = 2_000


@dataclass(frozen=True, slots=True)
class Theorem:
    """`steps` lead from relations and equations to the last one's `gives`, where no factor of theirs is zero.

    `equations` are rows of the algebraic conditions, without denominators and common factors, with what they are.
    Where there are `summands`, the statement is that this sum of products of quotients is zero; its numerator over the
    product of `denominators`, as polynomials and exponents, is what the last step gives.
    """

    name: str
    ring: ExactRing
    relations: tuple[Fact, ...]
    equations: tuple[tuple[Fact, str], ...]
    steps: tuple[Identity, ...]
    summands: tuple[tuple[int, tuple[Quotient, ...]], ...] = ()
    denominators: tuple[tuple[fmpq_mpoly, int], ...] = ()

    @property
    def nonzero(self) -> tuple[fmpq_mpoly, ...]:
        """What must not vanish: the irreducible factors of all factors and denominators."""
        divisors = [factor for step in self.steps for factor, _ in factored(step.factor)[1]]
        return tuple({str(one): one for one in [*divisors, *(below for below, _ in self.denominators)]}.values())


def determinant_vanishes(analysis: Analysis, chosen: SufficientSet, seed: int, budget: Budget) -> Theorem:
    """det g = 0 from the rows of the chosen conditions; TooLarge where the budget ends or it was not recognized.

    Where the formulas are long, their long factors become letters.
    """
    rows = exact_rows(analysis, chosen, seed, budget)
    try:
        short = Budget(TERMS_WITHOUT_LETTERS, budget.deadline)
        rows.exact.ring.field.budget = short
        return _Elimination(rows.exact.ring, rows.symbols, rows.equations, rows.table, short).theorem()
    except TooLarge:
        ring, equations = lettered(rows.exact.ring, rows.symbols, rows.equations, budget)
        return _Elimination(ring, rows.symbols, equations, rows.table, budget).theorem()


class _Elimination:
    """Rows as polynomials, and the identities between them in the order of their proof."""

    def __init__(
        self,
        ring: ExactRing,
        symbols: Mapping[Unknown, Symbol],
        equations: Mapping[EquationName, Linear],
        table: PointwiseConditions,
        budget: Budget,
    ) -> None:
        self.ring, self.symbols, self.size, self.budget = ring, symbols, table.size, budget
        self.result = eliminate(equations, table)
        places = {tree: index for index, tree in ring.trees.items()}
        self.places = {unknown: places[symbol] for unknown, symbol in symbols.items()}
        self.relations = _relations(ring)
        self.steps = list[Identity]()

    def theorem(self) -> Theorem:
        equations, values = list[tuple[Fact, str]](), list[Divisor]()
        for step in self.result.solved:
            row = sum_of(self.ring.constant(0), [c * self._entry(u) for u, c in step.original.items()])
            fact = Fact(f"eq{len(equations) + 1}", primitive(row.numerator))
            equations.append((fact, equation_name(step.name).text))
            values.append(self._reduced(Divisor(fact, self.places[step.pivot]), values))
        for k in reversed(range(len(values))):
            values[k] = self._reduced(values[k], values[k + 1 :])
        values.sort(key=lambda value: len(value.fact.polynomial))
        self._close(values)
        steps = tuple(self.steps)
        return Theorem("det_g_is_zero", self.ring, _used(self.relations, steps), tuple(equations), steps)

    def _entry(self, unknown: Unknown) -> Quotient:
        return self.ring.atoms[self.symbols[unknown]]

    def _interleaved(self, values: Sequence[Divisor]) -> list[Divisor]:
        """The values, each followed by the relations, so that nothing grows."""
        return [divisor for value in values for divisor in (value, *self.relations)] or [*self.relations]

    def _reduced(self, row: Divisor, values: Sequence[Divisor]) -> Divisor:
        """What is left of the row with the values put in, without the content that its coefficients share."""
        fact = row.fact
        found = divided(fact.polynomial, self._interleaved(values), self.budget)
        left = primitive(found.rest / content(found.rest, self.places.values()))
        if left == fact.polynomial:
            return row
        factor = found.rest / left
        given = Fact(f"val{len(self.steps) + 1}", left)
        self.steps.append(identity(given, factor, [(found.multiplier, fact), *((-c, f) for c, f in found.terms)]))
        return Divisor(given, row.index)

    def _close(self, values: Sequence[Divisor]) -> None:
        vector = self._null_vector()
        terms = None if vector is None else self._by_kernel(vector, values)
        goal = self._minor(range(self.size), range(self.size))
        if terms is None:
            found = self._emptied(goal, values)
            terms = found.multiplier, found.terms
        self.steps.append(identity(Fact("det_g", goal), *terms))

    def _null_vector(self) -> list[Quotient] | None:
        """k, free of entries of g, with g k = 0 for every g that is left: it makes det g = 0 a short identity."""
        span, one = range(self.size), self.ring.constant(1)
        entries = [[self.result.entry((min(i, j), max(i, j)), one) for j in span] for i in span]
        free = sorted({unknown for line in entries for row in line for unknown in row})
        rows = [[row.get(unknown, one - one) for row in line] for unknown in free for line in entries]
        return next(reversed(null_space(rows, self.size, one).values()), None)

    def _by_kernel(self, vector: Sequence[Quotient], values: Sequence[Divisor]) -> Combination:
        """g k = 0, and k_m det g = sum over j of the cofactor (j, m) times (g k)_j."""
        span, places = range(self.size), [self.places[0, j] for j in range(self.size)]
        row = sum_of(self.ring.constant(0), [k * self._entry((0, j)) for j, k in enumerate(vector)]).numerator
        k = [coefficient(row, place, 1) for place in places]
        m = min((j for j in span if not k[j].is_zero()), key=lambda j: len(k[j]))
        terms = []
        for j in span:
            entries = [self._entry((min(i, j), max(i, j))).numerator for i in span]
            image = sum((k[i] * entries[i] for i in span), row * 0)
            found = self._emptied(image, values)
            fact = Fact(f"ker{j + 1}", image)
            self.steps.append(identity(fact, found.multiplier, found.terms))
            cofactor = self._minor([i for i in span if i != j], [i for i in span if i != m])
            terms.append((-cofactor if (j + m) % 2 else cofactor, fact))
        return k[m], terms

    def _minor(self, rows: Sequence[int], columns: Sequence[int]) -> fmpq_mpoly:
        matrix = [[self._entry((min(i, j), max(i, j))) for j in columns] for i in rows]
        one = self.ring.constant(1)
        return determinant(matrix, one).numerator

    def _emptied(self, polynomial: fmpq_mpoly, values: Sequence[Divisor]) -> Remainder:
        """The polynomial as a combination of values and relations; TooLarge where something is left."""
        found = divided(polynomial, self._interleaved(values), self.budget)
        if not found.rest.is_zero():
            raise TooLarge("the determinant of what remains was not recognized as zero")
        return found


def euler_lagrange_hold(system: SecondOrderSystem, lagrangian: Expression, budget: Budget) -> tuple[Theorem, ...]:
    """One theorem for each coordinate; TooLarge where the budget ends or an identity was not recognized."""
    exact = motion_in_ring(system, 2, budget, trees=[lagrangian])
    value = exact.ring.value(lagrangian)
    return tuple(_vanishing(exact, system.coordinates[i], _summands(exact, value, i)) for i in range(exact.motion.size))


def _summands(exact: MotionInRing, value: Quotient, i: int) -> list[tuple[int, tuple[Quotient, ...]]]:
    """L_(v_i t) + L_(v_i q_j) v^j + L_(v_i v_j) f^j - L_(q_i), zeros left out."""
    ring, n = exact.ring, exact.motion.size
    slopes = [ring.partial(k) for k in range(2 * n + 1)]
    momentum, one = slopes[1 + n + i](value), ring.constant(1)
    rates = [one, *(ring.atoms[ring.variables[1 + n + j]] for j in range(n)), *exact.motion.accelerations]
    found = [(1, (slope(momentum), rate)) for slope, rate in zip(slopes, rates, strict=True)]
    found.append((-1, (slopes[1 + i](value), one)))
    return [(sign, factors) for sign, factors in found if not any(factor.is_zero for factor in factors)]


def _vanishing(exact: MotionInRing, name: str, summands: list[tuple[int, tuple[Quotient, ...]]]) -> Theorem:
    ring, relations = exact.ring, _relations(exact.ring)
    tables = [{k: e for factor in factors for k, e in factor.exponents} for _, factors in summands]
    for table, (_, factors) in zip(tables, summands, strict=True):
        table.update({k: sum(dict(factor.exponents).get(k, 0) for factor in factors) for k in table})
    common = {k: max(table.get(k, 0) for table in tables) for table in tables for k in table}
    whole = ring.field.context.constant(0)
    for table, (sign, factors) in zip(tables, summands, strict=True):
        term = ring.field.context.constant(sign)
        for factor in factors:
            term = term * factor.numerator
        for k, most in common.items():
            term = term * ring.field.denominators[k] ** (most - table.get(k, 0))
        ring.field.budget.charge(len(term))
        whole = whole + term
    found = divided(whole, relations, ring.field.budget)
    if not found.rest.is_zero():
        raise TooLarge("an Euler-Lagrange expression was not recognized as zero")
    step = identity(Fact("residual", whole), found.multiplier, found.terms)
    below = tuple((ring.field.denominators[k], most) for k, most in common.items())
    used = _used(relations, [step])
    return Theorem(f"euler_lagrange_{name}", ring, used, (), (step,), tuple(summands), below)


def _relations(ring: ExactRing) -> list[Divisor]:
    """What the generators fulfil by definition, sin^2 + cos^2 = 1 and w^k = u, the greatest generator first."""
    gen = ring.field.context.gen
    listed = [ring.field.relations[index] for index in sorted(ring.field.relations)]
    return [
        Divisor(Fact(f"rel{k}", primitive(gen(one.generator) ** one.degree - one.right)), one.generator)
        for k, one in enumerate(listed, 1)
    ]


def _used(relations: Sequence[Divisor], steps: Sequence[Identity]) -> tuple[Fact, ...]:
    names = {fact.name for step in steps for _, fact in step.terms}
    return tuple(relation.fact for relation in relations if relation.fact.name in names)
