"""Values of letters and their logarithmic derivatives at random points of one prime field."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple, TypeGuard, TypeVar

import numpy as np
import numpy.typing as npt

from inverse_service import bounds
from inverse_service.deadline import check
from inverse_service.decision.deciding import Analysis, variables_of
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import PI, TIME, Apply, Expression, Symbol, Velocity, distinct_nodes
from inverse_service.field import modular
from inverse_service.field.elementary import to_kernels
from inverse_service.field.modular import Field, compiled, multiply, positive_power
from inverse_service.field.point import Point
from inverse_service.field.real_point import RealTable, find_real_point, is_defined
from inverse_service.field.reduction import reduce_atoms
from inverse_service.field.sample_points import Drawn, KnownTower, SamplePoints
from inverse_service.field.tower import Tower, atoms_in_order, draw_point
from inverse_service.search.terms import Monomial

Words = npt.NDArray[np.uint64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Sampler:
    """A tower for f together with the letters of an ansatz, and a real point of both."""

    analysis: Analysis
    tower: Tower
    real_point: RealTable | None
    known: dict[Drawn, SamplePoints] = field(default_factory=dict, compare=False)

    @property
    def variables(self) -> list[Symbol | Velocity]:
        names = self.analysis.system.coordinates
        return [TIME, *(Symbol(name) for name in names), *(Velocity(name) for name in names)]

    def points(self, seed: int) -> SamplePoints:
        """The points that follow from a seed; what is known of them is kept."""
        if (seed, ()) not in self.known:
            prime = draw_point(self.tower, seed).prime
            self.known[seed, ()] = SamplePoints(
                self.analysis.accelerations, self.variables, self.tower, seed, prime, self.analysis.constrained
            )
        return self.known[seed, ()]

    def at_one_place(self, seed: int) -> SamplePoints:
        """Points that share t and the coordinates."""
        return self._near_one(seed, tuple(v for v in self.variables if isinstance(v, Velocity)))

    def with_fixed_parameters(self, seed: int) -> SamplePoints:
        """Points that share the values of the parameters."""
        return self._near_one(seed, tuple(self.variables))

    def _near_one(self, seed: int, moving: tuple[Symbol | Velocity, ...]) -> SamplePoints:
        if (seed, moving) not in self.known:
            base, forces = draw_point(self.tower, seed), self.analysis.accelerations
            self.known[seed, moving] = SamplePoints(
                forces, self.variables, self.tower, seed, base.prime, base=base, moving=moving
            )
        return self.known[seed, moving]

    def prime(self, seed: int) -> int:
        """The prime of the points that follow from a seed."""
        return self.points(seed).prime


def sampler_of(analysis: Analysis, terms: Sequence[Monomial]) -> tuple[Sampler, list[Monomial]]:
    """A sampler for the terms, without those that have no value at a point where f and most others have one.

    Those with letters that cannot be reduced beside f, such as (w + sqrt(w^2 + 1))^(3/2), are left out, too.
    Raises IrreducibleAtoms where there is no such point, or no letter can be reduced.
    """
    try:
        return make_sampler(analysis, dict.fromkeys(item for term in terms for item in term)), list(terms)
    except IrreducibleAtoms:
        table, kept = _defined_together(analysis, terms)
        if not kept:
            raise
    try:
        return make_sampler(analysis, dict.fromkeys(item for term in kept for item in term), table), kept
    except IrreducibleAtoms:
        kept = _reduced_alone(analysis, kept, table)
        if not kept:
            raise
        return make_sampler(analysis, dict.fromkeys(item for term in kept for item in term), table), kept


def _reduced_alone(analysis: Analysis, terms: Sequence[Monomial], table: RealTable | None) -> list[Monomial]:
    """The terms of letters each of which can be reduced beside f."""
    plain, fine = [*analysis.accelerations, *analysis.constrained.values()], set[tuple[Expression, Fraction]]()
    for letter, e in dict.fromkeys(item for term in terms for item in term):
        kernels = [to_kernels(tree) for tree in (letter, letter ** Fraction(1, e.denominator))]
        with suppress(IrreducibleAtoms):
            if table is not None:
                reduce_atoms([*plain, *kernels], variables_of(analysis.system), table)
                fine.add((letter, e))
    return [term for term in terms if term <= fine]


def _defined_together(analysis: Analysis, terms: Sequence[Monomial]) -> tuple[RealTable | None, list[Monomial]]:
    """Of a few points of f the one at which the most terms have values, and these."""
    best: tuple[RealTable | None, list[Monomial]] = (None, [])
    items = dict.fromkeys(item for term in terms for item in term)
    kernels = {(p, e): to_kernels(p ** Fraction(1, e.denominator)) for p, e in items}
    wanted = [*analysis.accelerations, *analysis.constrained.values()]
    for seed in range(2, 2 + bounds.ATTEMPTS):
        table = find_real_point(wanted, variables_of(analysis.system), seed, analysis.system.positive)
        if table is not None:
            valued = {item for item, kernel in kernels.items() if is_defined([kernel], table)}
            best = max(best, (table, [term for term in terms if term <= valued]), key=lambda found: len(found[1]))
    return best


def make_sampler(
    analysis: Analysis, letters: Iterable[tuple[Expression, Fraction]], table: RealTable | None = None
) -> Sampler:
    """Raises IrreducibleAtoms where letters and f have no common real point or cannot be reduced.

    Ansätze whose letters bring no further atoms have their points in common.
    """
    extra = [to_kernels(tree) for letter, e in letters for tree in (letter, letter ** Fraction(1, e.denominator))]
    wanted = [*analysis.accelerations, *analysis.constrained.values(), *dict.fromkeys(extra)]
    variables = variables_of(analysis.system)
    table = table or find_real_point(wanted, variables, seed=2, positive=analysis.system.positive)
    if table is None:
        raise IrreducibleAtoms("the ansatz has no real point in common with f")
    atoms = _atoms(wanted)
    for known in analysis.towers:
        if atoms <= known.atoms and all(known.real_point.get(node) == x for node, x in table.items()):
            return Sampler(analysis, known.tower, table, known.points)
    shared = KnownTower(atoms, table, reduce_atoms(wanted, variables, table))
    analysis.towers.append(shared)
    return Sampler(analysis, shared.tower, table, shared.points)


def _atoms(trees: Sequence[Expression]) -> frozenset[Expression]:
    """Atoms, roots and pi in trees; a cosine counts as its sine, as one rule values both."""
    atoms = (Apply("sin", atom.argument) if _is_cosine(atom) else atom for atom in atoms_in_order(trees))
    return frozenset(atoms).union(node for node in distinct_nodes(trees) if node == PI)


def _is_cosine(atom: Expression) -> TypeGuard[Apply]:
    return isinstance(atom, Apply) and atom.function == "cos"


class Derivatives(NamedTuple):
    """Per sample and letter: Gamma(log p), d log p/dv_i, Gamma'(d log p/dv_i) and d log p/dq_i.

    Arrays of residues, (samples, letters) and (samples, letters, n); Gamma' acts on the derivative
    only, so that EL_i(m)/m = V_i G + H_i - Q_i with sums over the letters of m. `hessian` is
    d2 log p/dv_i dv_j, `third` Gamma of it (zero unless asked for), (samples, letters, n, n).
    """

    along: Words
    by_velocity: Words
    mixed: Words
    by_position: Words
    hessian: Words
    third: Words

    @property
    def size(self) -> int:
        """The number of coordinates."""
        return int(self.by_velocity.shape[2])


@dataclass(frozen=True, slots=True)
class LetterTable:
    """The values of the letters, with their derivatives; `numbers` are those of the samples among the points."""

    known: SamplePoints
    numbers: tuple[int, ...]
    values: list[list[int]]
    derivatives: Derivatives

    @property
    def prime(self) -> int:
        return self.known.prime

    @property
    def points(self) -> list[Point]:
        return [self.known.point(k) for k in self.numbers]


def letter_table(
    sampler: Sampler, letters: Sequence[Expression], count: int, seed: int, with_third: bool = False, first: int = 0
) -> LetterTable:
    """The table at `count` random points without the `first`; points at which a letter vanishes are left out."""
    return table_at(sampler.points(seed), letters, count, with_third, first)


def table_at(
    known: SamplePoints, letters: Sequence[Expression], count: int, with_third: bool = False, first: int = 0
) -> LetterTable:
    """The same for given points."""
    kernels, order = tuple(to_kernels(letter) for letter in letters), 3 if with_third else 2
    found = _first(lambda k: known.letters(k, kernels, order), count)
    numbers, rows = [k for k, _ in found], [row for _, row in found]
    n, shape = len(known.forces), (count - first, len(letters))
    table = np.array(rows[first:], np.uint64).reshape(*shape, 2 + 3 * n + 2 * n * n)
    ends = np.cumsum([1, 1, n, n, n, n * n])
    value, *parts = np.split(table, ends, axis=2)
    ranks = (0, 1, 1, 1, 2, 2)
    arrays = [np.ascontiguousarray(part).reshape(*shape, *(n,) * rank) for part, rank in zip(parts, ranks, strict=True)]
    return LetterTable(known, tuple(numbers[first:]), value[:, :, 0].tolist(), Derivatives(*arrays))


def values_at(known: SamplePoints, letters: Sequence[Expression], count: int) -> list[list[int]]:
    """The values of the letters alone, at the points that `table_at` takes."""
    kernels = tuple(to_kernels(letter) for letter in letters)
    return [row for _, row in _first(lambda k: known.values(k, kernels), count)]


_T = TypeVar("_T")


def _first(at: Callable[[int], _T | None], count: int) -> list[tuple[int, _T]]:
    """The first points at which there is something, with it."""
    found: list[tuple[int, _T]] = []
    for k in itertools.count():
        if len(found) == count:
            break
        check()
        if k >= bounds.ATTEMPTS * count:
            raise IrreducibleAtoms("the letters of the ansatz vanish at too many points")
        row = at(k)
        if row is not None:
            found.append((k, row))
    return found


def monomial_values(table: LetterTable, letters: Sequence[Expression], candidates: Sequence[Monomial]) -> Words:
    """The value of each candidate at each sample, (samples, candidates), in Montgomery form."""
    return products_of_values(table.values, letters, candidates, table.prime)


def products_of_values(
    rows: Sequence[Sequence[int]], letters: Sequence[Expression], candidates: Sequence[Monomial], prime: int
) -> Words:
    """The same from the values of the letters at each sample."""
    index = {letter: k for k, letter in enumerate(letters)}
    pairs: dict[tuple[Expression, Fraction], int] = {}
    starts, places = [0], []
    for candidate in candidates:
        places += [pairs.setdefault(item, len(pairs)) for item in candidate]
        starts.append(len(places))
    radix = (1 << 64) % prime
    # Whole numbers as such: a fraction's parts take as long as the power.
    items = [(index[letter], e if e.denominator > 1 else int(e)) for letter, e in pairs]
    powers = [[positive_power(sample[k], e, prime) * radix % prime for k, e in items] for sample in rows]
    field = modular.field_of(prime)
    result = np.full((len(powers), len(candidates)), field.one, np.uint64)
    given = np.array(powers, np.uint64).reshape(len(powers), -1)
    _products(given, np.array(starts, np.int64), np.array(places, np.int64), result, field)
    return result


@compiled
def _products(powers: Words, starts: Integers, places: Integers, result: Words, field: Field) -> None:
    """result[s, c] times the powers at places[starts[c]] … places[starts[c + 1] - 1] of sample s."""
    for s in range(result.shape[0]):
        for c in range(result.shape[1]):
            for k in range(starts[c], starts[c + 1]):
                result[s, c] = multiply(result[s, c], powers[s, places[k]], field)
