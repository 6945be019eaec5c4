"""Named families of second-order systems that hold one and the same nonholonomic motion.

On the constraints v_s = B_sj u_j + b_s a free velocity has other names: u_j, and (v_s - rest)/B_sj for each
dependent s that it enters; where nothing else enters, v_s/(B_sj u_j) is 1. The accelerations a(q, u) are
taken apart into one term for each product of velocities, and each term may be written in many ways:

    products   each velocity factor of each term by each of its names
    forces     the same, and each velocity-free term times powers of the ratios that are 1
    ratios     each term, forces included, times powers of these ratios
    mixtures   each term by a weighted mean of its names, weights from a list
    multiples  the first system plus multiples 0, 1, -1, … of u_j times each constraint in each acceleration

A family is a choice of a combination of letters (formulas) in each slot, so its members share all work.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from inverse_service.algebra.exact_derivations import sum_of
from inverse_service.algebra.rational_functions import Quotient
from inverse_service.expressions.tree import Expression, add, multiply, number
from inverse_service.mechanics.nonholonomic.motion import ExactMotion
from inverse_service.mechanics.nonholonomic.writing import velocity_parts

Combination = tuple[tuple[int, Fraction], ...]
WEIGHTS = tuple(map(Fraction, ("1/2", "-1", "2", "1/3", "2/3", "-1/2", "3/2")))


@dataclass(frozen=True, slots=True)
class Choice:
    """What a slot may hold: letters with factors. Choices of low weight come first."""

    combination: Combination
    weight: int


@dataclass(frozen=True, slots=True)
class Slot:
    """One term of the acceleration of one coordinate, with its ways of being written."""

    place: int
    choices: tuple[Choice, ...]


@dataclass(frozen=True, slots=True)
class Family:
    """All members are sums over the slots; `fixed` is added to each, one combination a coordinate."""

    name: str
    description: str
    fixed: tuple[Combination, ...]
    slots: tuple[Slot, ...]

    @property
    def size(self) -> int:
        """The number of choices; members that come out equal are counted apart."""
        total = 1
        for slot in self.slots:
            total *= len(slot.choices)
        return total


# One combination of letters for each coordinate.
Member = tuple[Combination, ...]


@dataclass(slots=True)
class Letters:
    """The formulas of all families, each once."""

    write: Callable[[Quotient], Expression]
    trees: list[Expression] = field(default_factory=list)
    places: dict[object, int] = field(default_factory=dict)

    def letter(self, element: Quotient) -> Combination:
        """The combination that is this element alone."""
        if element.is_zero:
            return ()
        key = (str(element.numerator), element.exponents)
        if key not in self.places:
            self.places[key] = len(self.trees)
            self.trees.append(self.write(element))
        return ((self.places[key], Fraction(1)),)


def accelerations(member: Member, letters: Sequence[Expression]) -> tuple[Expression, ...]:
    """The member as formulas."""
    return tuple(add(*(multiply(number(c), letters[k]) for k, c in combination)) for combination in member)


def members(family: Family, limit: int) -> Iterator[Member]:
    """Distinct members, those of low total weight first, at most `limit`."""
    seen: set[Member] = set()
    heaviest = sum(max(choice.weight for choice in slot.choices) for slot in family.slots)
    for weight in range(heaviest + 1):
        for chosen in _of_weight(family.slots, weight):
            member = _joined(family, chosen)
            if member not in seen:
                seen.add(member)
                yield member
                if len(seen) >= limit:
                    return


def _of_weight(slots: Sequence[Slot], weight: int) -> Iterator[tuple[Choice, ...]]:
    if not slots:
        if weight == 0:
            yield ()
        return
    for choice in slots[0].choices:
        if choice.weight <= weight:
            for rest in _of_weight(slots[1:], weight - choice.weight):
                yield (choice, *rest)


def _joined(family: Family, chosen: Sequence[Choice]) -> Member:
    tables = [dict(combination) for combination in family.fixed]
    for slot, choice in zip(family.slots, chosen, strict=True):
        table = tables[slot.place]
        for letter, factor in choice.combination:
            table[letter] = table.get(letter, Fraction(0)) + factor
    return tuple(tuple(sorted((k, c) for k, c in table.items() if c)) for table in tables)


@dataclass(frozen=True, slots=True)
class _Term:
    """One part of an acceleration: the coordinate, the free velocities in it, and the part over these."""

    place: int
    factors: tuple[int, ...]
    coefficient: Quotient


@dataclass(frozen=True, slots=True)
class Source:
    """The motion taken apart: its terms, the names of free velocities, and the ratios that are 1."""

    motion: ExactMotion
    letters: Letters
    terms: tuple[_Term, ...]

    @classmethod
    def of(cls, motion: ExactMotion, deadline: float = float("inf")) -> Source:
        """The motion taken apart; its ring may work until the deadline (time.monotonic) from now on."""
        parts = motion.geometry
        parts.ring.field.budget.deadline = deadline
        terms = [
            _term(motion, place, part)
            for place, element in enumerate(motion.accelerations)
            for part in velocity_parts(parts.ring, element)
        ]
        return cls(motion, Letters(parts.tree), tuple(terms))

    def names(self, free: int) -> list[Quotient]:
        """What equals this free velocity on the constraints, itself first."""
        parts, frame = self.motion.geometry, self.motion.frame
        column = frame.free.index(free)
        found = [parts.velocity(free)]
        for place in frame.dependent:
            row = frame.basis[place]
            if not row[column].is_zero:
                others = [row[k] * parts.velocity(j) for k, j in enumerate(frame.free) if k != column]
                rest = sum_of(parts.zero, [*others, frame.drift[place]])
                found.append((parts.velocity(place) - rest) / row[column])
        return found

    def ratios(self) -> list[Quotient]:
        """v_s/(B_sj u_j) for each dependent velocity that one free velocity alone determines."""
        parts, frame = self.motion.geometry, self.motion.frame
        found = []
        for place in frame.dependent:
            columns = [k for k, entry in enumerate(frame.basis[place]) if not entry.is_zero]
            if len(columns) == 1 and frame.drift[place].is_zero:
                below = frame.basis[place][columns[0]] * parts.velocity(frame.free[columns[0]])
                found.append(parts.velocity(place) / below)
        return found

    def written(self, term: _Term) -> list[tuple[Quotient, int]]:
        """The term with each velocity factor by each name, and how many factors were renamed."""
        alternatives = [list(enumerate(self.names(factor))) for factor in term.factors]
        found: dict[tuple[tuple[int, int], ...], tuple[Quotient, int]] = {}
        for chosen in itertools.product(*alternatives):
            key = tuple(sorted((factor, k) for factor, (k, _) in zip(term.factors, chosen, strict=True)))
            product = term.coefficient
            for _, name in chosen:
                product = product * name
            found.setdefault(key, (product, sum(1 for k, _ in chosen if k)))
        return list(found.values())


def _term(motion: ExactMotion, place: int, part: Quotient) -> _Term:
    factors: list[int] = []
    coefficient = part
    for free in motion.frame.free:
        while not motion.geometry.by_velocity(free, coefficient).is_zero:
            coefficient = coefficient / motion.geometry.velocity(free)
            factors.append(free)
    return _Term(place, tuple(factors), coefficient)


def products(source: Source) -> Family:
    """Each velocity factor of each term by each of its names."""
    slots = [_product_slot(source, term) for term in source.terms]
    return _family(source, "products", "each velocity in each product replaced by use of the constraints", slots)


def forces(source: Source, depth: int) -> Family:
    """Products, and each velocity-free term times ratios to powers of at most `depth`."""
    slots = [_product_slot(source, term) if term.factors else _power_slot(source, term, depth) for term in source.terms]
    text = f"products, and each force times powers from -{depth} to {depth} of the ratios that are 1 on the constraints"
    return _family(source, "forces", text, slots)


def ratios(source: Source, depth: int) -> Family:
    """Each term times ratios to powers of at most `depth`."""
    slots = [_power_slot(source, term, depth) for term in source.terms]
    text = f"each term times powers from -{depth} to {depth} of the ratios that are 1 on the constraints"
    return _family(source, "ratios", text, slots)


def mixtures(source: Source) -> Family:
    """Each term by a mean of two of its names, with weights c and 1 - c."""
    slots = []
    for term in source.terms:
        ways = [source.letters.letter(element) for element, _ in source.written(term)]
        choices = [Choice(way, k) for k, way in enumerate(ways)]
        for first, second in itertools.combinations(ways, 2):
            for k, weight in enumerate(WEIGHTS):
                mean = _sum([_times(first, weight), _times(second, 1 - weight)])
                choices.append(Choice(mean, 1 + k))
        slots.append(Slot(term.place, tuple(choices)))
    return _family(source, "mixtures", "each term by a weighted mean of two of its ways of being written", slots)


def multiples(source: Source, depth: int) -> Family:
    """The first system, plus c u_j w in each acceleration for each constraint w, |c| <= depth."""
    parts, frame = source.motion.geometry, source.motion.frame
    fixed = tuple(source.letters.letter(element) for element in source.motion.accelerations)
    slots = []
    for place in range(parts.size):
        for row, offset in zip(parts.rows, parts.offsets, strict=True):
            constraint = sum_of(parts.zero, [*(entry * parts.velocity(k) for k, entry in enumerate(row)), offset])
            for free in frame.free:
                letter = source.letters.letter(constraint * parts.velocity(free))
                factors = [0, *(sign * k for k in range(1, depth + 1) for sign in (1, -1))]
                choices = tuple(Choice(_times(letter, Fraction(c)), abs(c)) for c in factors)
                slots.append(Slot(place, choices))
    text = f"the first system plus whole multiples, up to {depth}, of each constraint times each free velocity"
    return Family("multiples", text, fixed, tuple(slots))


def _family(source: Source, name: str, description: str, slots: Sequence[Slot]) -> Family:
    return Family(name, description, ((),) * source.motion.geometry.size, tuple(slots))


def _product_slot(source: Source, term: _Term) -> Slot:
    ways = source.written(term)
    return Slot(term.place, tuple(Choice(source.letters.letter(element), weight) for element, weight in ways))


def _power_slot(source: Source, term: _Term, depth: int) -> Slot:
    parts = source.motion.geometry
    plain = term.coefficient
    for factor in term.factors:
        plain = plain * parts.velocity(factor)
    choices = []
    ones = source.ratios()
    for powers in itertools.product(range(-depth, depth + 1), repeat=len(ones)):
        element = plain
        for one, exponent in zip(ones, powers, strict=True):
            element = element * one**exponent
        choices.append(Choice(source.letters.letter(element), sum(map(abs, powers))))
    return Slot(term.place, tuple(sorted(choices, key=lambda choice: choice.weight)))


def _times(combination: Combination, factor: Fraction) -> Combination:
    return tuple((letter, c * factor) for letter, c in combination) if factor else ()


def _sum(parts: Sequence[Combination]) -> Combination:
    table: dict[int, Fraction] = {}
    for part in parts:
        for letter, factor in part:
            table[letter] = table.get(letter, Fraction(0)) + factor
    return tuple(sorted((letter, factor) for letter, factor in table.items() if factor))
