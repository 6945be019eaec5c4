"""A function with a given differential, as a sum of logarithms and simple terms."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import flint

from inverse_service.algebra.exact_ring import ExactRing
from inverse_service.algebra.rational_functions import Exponents, Quotient, as_fraction
from inverse_service.expressions.tree import Apply, Arbitrary, Expression, add, multiply
from inverse_service.mechanics.nonholonomic.writing import readable
from inverse_service.mechanics.quotient_matrices import common_multiple, solution

Partial = Callable[[Quotient], Quotient]
MOST_CANDIDATES = 200
# Elimination with symbolic coefficients is for short lists.
_MOST_SYMBOLIC = 40


@dataclass(frozen=True, slots=True)
class Potential:
    """phi = sum of coefficient * log(element) + rest, the coefficients constant."""

    logarithms: tuple[tuple[Quotient, Quotient], ...]
    rest: Quotient

    def exponential(self, ring: ExactRing) -> Expression:
        """exp(phi) as a tree."""
        factors = [readable(ring, element) ** readable(ring, value) for value, element in self.logarithms]
        if not self.rest.is_zero:
            factors.append(Apply("exp", readable(ring, self.rest)))
        return multiply(*factors)

    def tree(self, ring: ExactRing) -> Expression:
        """phi as a tree."""
        logs = [readable(ring, value) * Apply("log", readable(ring, e)) for value, e in self.logarithms]
        return add(*logs, readable(ring, self.rest))

    def plus_logarithm(self, factors: Sequence[tuple[Fraction, Quotient]]) -> Potential:
        """phi + sum of coefficient * log(element), equal elements put together."""
        table = list(self.logarithms)
        for exponent, element in factors:
            value = element.field.constant(exponent)
            for place, (known, other) in enumerate(table):
                if other.numerator == element.numerator:
                    table[place] = (known + value, other)
                    break
            else:
                table.append((value, element))
        return Potential(tuple((value, element) for value, element in table if not value.is_zero), self.rest)

    def negated(self) -> Potential:
        """-phi."""
        return Potential(tuple((-value, element) for value, element in self.logarithms), -self.rest)


def potential(ring: ExactRing, variables: Sequence[int], form: Sequence[Quotient]) -> Potential | None:
    """phi with d phi / d variables[i] = form[i], found among logarithms of denominators and simple terms.

    `variables` are indices of variables of the ring. None where no phi of this kind exists.
    """
    if all(slope.is_zero for slope in form):
        return Potential((), ring.constant(0))
    partials: list[Partial] = [ring.partial(index) for index in variables]
    divisors = _divisors(ring, form)
    columns = [[partial(element) / element for partial in partials] for element in divisors]
    # Residues that hold letters are found among logarithms alone: with all terms the elimination would be long.
    simple: list[Quotient] = []
    found = _combination(ring, columns, form)
    if found is None:
        simple = _simple_terms(ring, variables, form)[:MOST_CANDIDATES]
        found = _combination(ring, [*columns, *([partial(term) for partial in partials] for term in simple)], form)
    if found is None:
        return None
    logs = tuple((value, element) for value, element in zip(found, divisors, strict=False) if not value.is_zero)
    rest = ring.constant(0)
    for value, term in zip(found[len(divisors) :], simple, strict=True):
        rest = rest + term * value
    return Potential(logs, rest)


def _divisors(ring: ExactRing, form: Sequence[Quotient]) -> list[Quotient]:
    places = sorted({index for slope in form for index, _ in slope.exponents})
    return [Quotient(ring.field, ring.field.denominators[place], ()) for place in places]


def _simple_terms(ring: ExactRing, variables: Sequence[int], form: Sequence[Quotient]) -> list[Quotient]:
    """For each term of each slope: itself, times the variable, and with one function changed for another."""
    functions = [index for index, tree in ring.trees.items() if isinstance(tree, Apply | Arbitrary)]
    found: dict[tuple[tuple[int, ...], Exponents], Quotient] = {}
    for variable, slope in zip(variables, form, strict=True):
        own = _index_of_variable(ring, variable)
        for exponents, _ in slope.numerator.terms():
            base = [int(e) for e in exponents]
            for key in itertools.product(map(tuple, _changes(ring, base, own, functions)), _lowered(slope.exponents)):
                if key not in found:
                    numerator = ring.field.reduce(ring.field.context.from_dict({key[0]: flint.fmpq(1)}))
                    found[key] = ring.field.quotient(numerator, key[1])
    return [term for term in found.values() if term.constant_value is None and _is_differentiable(ring, term)]


def _lowered(exponents: Exponents) -> list[Exponents]:
    """The exponents of a denominator, and those with one multiple factor less: 1/p^2 comes from 1/p."""
    less = [
        tuple((place, power - (place == chosen)) for place, power in exponents)
        for chosen, multiple in exponents
        if multiple > 1
    ]
    return [exponents, *less]


def _is_differentiable(ring: ExactRing, term: Quotient) -> bool:
    degrees = term.numerator.degrees()
    return not any(degrees[index] for index in ring.undefined)


def _index_of_variable(ring: ExactRing, variable: int) -> int:
    tree = ring.variables[variable]
    return next(index for index, known in ring.trees.items() if known == tree)


def _changes(ring: ExactRing, base: list[int], own: int, functions: Sequence[int]) -> list[list[int]]:
    changes = [list(base), [e + (k == own) for k, e in enumerate(base)]]
    for old in functions:
        if base[old]:
            others = [new for new in functions if new != old and _is_related(ring.trees[new], ring.trees[old])]
            changes += [[e - (k == old) + (k == new) for k, e in enumerate(base)] for new in others]
    return changes


def _is_related(primitive: Expression, slope: Expression) -> bool:
    """Whether the one may be, up to a factor, a derivative of the other: sin and cos of one angle, A and A'."""
    match primitive, slope:
        case Apply(_, inner), Apply(_, outer):
            return inner == outer
        case Arbitrary(name, arguments, low), Arbitrary(other, others, high):
            return name == other and arguments == others and sum(low) + 1 == sum(high)
        case _:
            return False


def _combination(
    ring: ExactRing, columns: Sequence[Sequence[Quotient]], target: Sequence[Quotient]
) -> list[Quotient] | None:
    """Constant c with sum c_k columns[k] = target, rational where that will do; None if there is none."""
    rational = _rational_combination(ring, columns, target)
    if rational is not None:
        return [ring.constant(value) for value in rational]
    return solution(ring, columns, target) if len(columns) <= _MOST_SYMBOLIC else None


def _rational_combination(
    ring: ExactRing, columns: Sequence[Sequence[Quotient]], target: Sequence[Quotient]
) -> list[Fraction] | None:
    common = common_multiple(ring, [entry for column in [*columns, target] for entry in column])
    whole = [[entry * common for entry in column] for column in [*columns, target]]
    if any(entry.exponents for column in whole for entry in column):
        return None
    rows: dict[tuple[int, tuple[int, ...]], dict[int, flint.fmpq]] = {}
    for k, column in enumerate(whole):
        for place, entry in enumerate(column):
            for exponents, coefficient in entry.numerator.terms():
                rows.setdefault((place, tuple(int(e) for e in exponents)), {})[k] = coefficient
    return _solved(list(rows.values()), len(columns))


def _solved(rows: Sequence[dict[int, flint.fmpq]], unknowns: int) -> list[Fraction] | None:
    """One solution of the rows, whose entry `unknowns` is the right side; free unknowns are 0."""
    table = flint.fmpq_mat(len(rows), unknowns + 1, [row.get(k, 0) for row in rows for k in range(unknowns + 1)])
    reduced, rank = table.rref()
    found = [Fraction(0)] * unknowns
    for place in range(rank):
        pivot = next(k for k in range(unknowns + 1) if reduced[place, k] != 0)
        if pivot == unknowns:
            return None
        found[pivot] = as_fraction(reduced[place, unknowns])
    return found


def constant_null_vectors(ring: ExactRing, rows: Sequence[Sequence[Quotient]]) -> list[list[Fraction]]:
    """A basis of the rational vectors c with sum_i c_i rows[a][i] = 0 identically, for each a."""
    if not rows or not rows[0]:
        return []
    size = len(rows[0])
    common = common_multiple(ring, [entry for row in rows for entry in row])
    equations: dict[tuple[int, tuple[int, ...]], dict[int, flint.fmpq]] = {}
    for place, row in enumerate(rows):
        for k, entry in enumerate(row):
            whole = entry * common
            if whole.exponents:
                return []
            for exponents, coefficient in whole.numerator.terms():
                equations.setdefault((place, tuple(int(e) for e in exponents)), {})[k] = coefficient
    return _null_space(list(equations.values()), size)


def _null_space(rows: Sequence[dict[int, flint.fmpq]], size: int) -> list[list[Fraction]]:
    if not rows:
        return [[Fraction(int(i == k)) for i in range(size)] for k in range(size)]
    table = flint.fmpq_mat(len(rows), size, [row.get(k, 0) for row in rows for k in range(size)])
    reduced, rank = table.rref()
    pivots = [next(k for k in range(size) if reduced[place, k] != 0) for place in range(rank)]
    found = []
    for free in range(size):
        if free in pivots:
            continue
        vector = [Fraction(int(k == free)) for k in range(size)]
        for place, pivot in enumerate(pivots):
            vector[pivot] = -as_fraction(reduced[place, free])
        found.append(vector)
    return found


def factors_of(ring: ExactRing, element: Quotient) -> list[tuple[Fraction, Quotient]]:
    """(exponent, polynomial) with element = constant * product of polynomial^exponent."""
    _, powers = ring.field.denominator_powers(element.numerator)
    table: dict[int, Fraction] = {index: Fraction(exponent) for index, exponent in powers}
    for index, exponent in element.exponents:
        table[index] = table.get(index, Fraction(0)) - exponent
    return [
        (exponent, Quotient(ring.field, ring.field.denominators[index], ()))
        for index, exponent in table.items()
        if exponent and not _is_parameter(ring, index)
    ]


def _is_parameter(ring: ExactRing, index: int) -> bool:
    """Whether a listed denominator is constant in t, q and v."""
    element = Quotient(ring.field, ring.field.denominators[index], ())
    return all(ring.partial(k)(element).is_zero for k in range(len(ring.variables)))
