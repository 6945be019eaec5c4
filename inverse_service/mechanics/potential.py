"""A function with a given differential, as a sum of logarithms and simple terms."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import flint

from inverse_service import bounds
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions import evaluation, tree as ex
from inverse_service.field import matrices, real_point
from inverse_service.field.exact_field import ExactRing, Exponents, Quotient, as_fraction
from inverse_service.mechanics.writing import joined, readable, turned

Partial = Callable[[Quotient], Quotient]


@dataclass(frozen=True, slots=True)
class Potential:
    """phi = sum of coefficient * log(element) + rest, the coefficients constant."""

    logarithms: tuple[tuple[Quotient, Quotient], ...]
    rest: Quotient

    def exponential(self, ring: ExactRing) -> ex.Expression:
        """exp(phi) as a tree."""
        factors = [turned(readable(ring, element)) ** readable(ring, value) for value, element in self.logarithms]
        if not self.rest.is_zero:
            factors.append(ex.Apply("exp", readable(ring, self.rest)))
        return joined(ex.multiply(*factors))

    def tree(self, ring: ExactRing) -> ex.Expression:
        """phi as a tree."""
        logs = [readable(ring, value) * ex.Apply("log", readable(ring, e)) for value, e in self.logarithms]
        return ex.add(*logs, readable(ring, self.rest))

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

    def made_positive(self, ring: ExactRing, table: real_point.RealTable | None) -> Potential:
        """The same function up to a constant with positive arguments of the logarithms at a real point."""
        if table is None:
            return self
        pairs = ((c, readable(ring, element), element) for c, element in self.logarithms)
        kept = tuple((c, -element if _is_negative(tree, table) else element) for c, tree, element in pairs)
        return Potential(kept, self.rest)


def _is_negative(tree: ex.Expression, table: real_point.RealTable) -> bool:
    try:
        return real_point.real_sign(tree, table) < 0
    except (evaluation.NoRealValue, IrreducibleAtoms):
        return False


def potential(ring: ExactRing, variables: Sequence[int], form: Sequence[Quotient]) -> Potential | None:
    """phi with d phi / d variables[i] = form[i], found among logarithms of denominators and simple terms.

    `variables` are indices of variables of the ring. None where no phi of this kind exists.
    """
    if all(slope.is_zero for slope in form):
        return Potential((), ring.constant(0))
    partials: list[Partial] = [ring.partial(index) for index in variables]
    places = sorted({index for slope in form for index, _ in slope.exponents})
    divisors = [Quotient(ring.field, ring.field.denominators[place], ()) for place in places]
    columns = [[partial(element) / element for partial in partials] for element in divisors]
    # Residues that contain symbols are searched among logarithms only: with all terms the elimination would be long.
    simple: list[Quotient] = []
    found = _combination(ring, columns, form)
    if found is None:
        simple = _simple_terms(ring, variables, form)[: bounds.SMALL]
        found = _combination(ring, [*columns, *([partial(term) for partial in partials] for term in simple)], form)
    if found is None:
        return None
    logs = tuple((value, element) for value, element in zip(found, divisors, strict=False) if not value.is_zero)
    rest = ring.constant(0)
    for value, term in zip(found[len(divisors) :], simple, strict=True):
        rest = rest + term * value
    return Potential(logs, rest)


def _simple_terms(ring: ExactRing, variables: Sequence[int], form: Sequence[Quotient]) -> list[Quotient]:
    """For each term of each slope: itself, times the variable, and with one function changed for another."""
    functions = [index for index, tree in ring.trees.items() if isinstance(tree, ex.Apply | ex.Arbitrary)]
    found: dict[tuple[tuple[int, ...], Exponents], Quotient] = {}
    for variable, slope in zip(variables, form, strict=True):
        own = next(index for index, known in ring.trees.items() if known == ring.variables[variable])
        for exponents, _ in slope.numerator.terms():
            base = [int(e) for e in exponents]
            for key in itertools.product(map(tuple, _changes(ring, base, own, functions)), _lowered(slope.exponents)):
                if key not in found:
                    numerator = ring.field.reduce(ring.field.context.from_dict({key[0]: flint.fmpq(1)}))
                    found[key] = ring.field.quotient(numerator, key[1])
    varying = [term for term in found.values() if term.constant_value is None]
    return [term for term in varying if not any(term.numerator.degrees()[index] for index in ring.undefined)]


def _lowered(exponents: Exponents) -> list[Exponents]:
    """The exponents of a denominator, and those with one multiple factor less: 1/p^2 comes from 1/p."""
    less = [
        tuple((place, power - (place == chosen)) for place, power in exponents)
        for chosen, multiple in exponents
        if multiple > 1
    ]
    return [exponents, *less]


def _changes(ring: ExactRing, base: list[int], own: int, functions: Sequence[int]) -> list[list[int]]:
    changes = [list(base), [e + (k == own) for k, e in enumerate(base)]]
    for old in functions:
        if base[old]:
            others = [new for new in functions if new != old and _is_related(ring.trees[new], ring.trees[old])]
            changes += [[e - (k == old) + (k == new) for k, e in enumerate(base)] for new in others]
    return changes


def _is_related(primitive: ex.Expression, slope: ex.Expression) -> bool:
    """Whether the one may be, up to a factor, a derivative of the other: sin and cos of one angle, A and A'."""
    match primitive, slope:
        case [ex.Apply(_, inner), ex.Apply(_, outer)]:
            return inner == outer
        case [ex.Arbitrary(name, arguments, low), ex.Arbitrary(other, others, high)]:
            return name == other and arguments == others and sum(low) + 1 == sum(high)
        case _:
            return False


def _combination(
    ring: ExactRing, columns: Sequence[Sequence[Quotient]], target: Sequence[Quotient]
) -> list[Quotient] | None:
    """Constant c with sum c_k columns[k] = target, rational where that will do; None if there is none."""
    vector = next(rational_null_vectors(ring, [*columns, target]), None)
    if vector is not None and vector[-1]:
        return [ring.constant(-value) for value in vector[:-1]]
    return matrices.solution(ring, columns, target) if len(columns) <= bounds.COLUMNS else None


def rational_null_vectors(ring: ExactRing, columns: Sequence[Sequence[Quotient]]) -> Iterator[list[Fraction]]:
    """A basis of the rational c with sum_k c_k columns[k] = 0, entry by entry.

    Each has a 1 in a column that depends on those before it, the last such column first, and 0 in the others of them.
    """
    rows: dict[tuple[int, tuple[int, ...]], dict[int, Fraction]] = {}
    for place, entries in enumerate(zip(*columns, strict=True)):
        for k, numerator in enumerate(matrices.numerators(ring, entries)):
            for exponents, coefficient in numerator.terms():
                rows.setdefault((place, tuple(int(e) for e in exponents)), {})[k] = as_fraction(coefficient)
    table = [[row.get(k, Fraction(0)) for k in range(len(columns))] for row in rows.values()]
    yield from reversed(matrices.kernel(table, len(columns)))


def factors_of(ring: ExactRing, element: Quotient) -> list[tuple[Fraction, Quotient]]:
    """(exponent, polynomial) with element = constant * product of polynomial^exponent."""
    _, powers = ring.field.denominator_powers(element.numerator)
    table: dict[int, Fraction] = {index: Fraction(exponent) for index, exponent in powers}
    for index, exponent in element.exponents:
        table[index] = table.get(index, Fraction(0)) - exponent
    pairs = [(e, Quotient(ring.field, ring.field.denominators[index], ())) for index, e in table.items() if e]
    partials = [ring.partial(k) for k in range(len(ring.variables))]  # a parameter is constant in t, q and v
    return [(e, element) for e, element in pairs if not all(by(element).is_zero for by in partials)]
