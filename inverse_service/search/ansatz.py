"""Find the combinations of terms whose Hessian is a multiplier, the linear equations of an ansatz, and the best ones.

The Hessian g of a combination must satisfy (H2) Gamma(g) = g N + (g N)^T and (H3) g Phi symmetric; (H1) is satisfied by
construction. The equations are formed from values of the generators and their logarithmic derivatives at random points
of a prime field. Terms linear in the velocities do not enter, so this small problem shows whether a family contains a
regular Lagrangian before the search for its potentials.

The ansätze of a ladder use the same generators at the same points (`SamplePoints`), and each ansatz adds a few.

Of the space of such combinations, members are chosen that are regular, definite if possible, and simple
(`best_members`). If the simplest regular sums are indefinite, weights for which a sum of several has a positive
definite Hessian are computed at one real point, then made few and short.
"""

import itertools
import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple, TypeGuard, TypeVar

import numpy as np
import numpy.typing as npt
from flint import nmod_mat

from inverse_service import bounds, deadline, errors
from inverse_service.decision.deciding import Analysis, variables_of
from inverse_service.decision.helmholtz import Written, tensors_after, written
from inverse_service.expressions import tree as ex
from inverse_service.expressions.derivative import differentiate
from inverse_service.field import exact_field, matrices, modular, real_branch, tower as towers
from inverse_service.field.dense_series import Machine, SeriesProgram, constants_at, run
from inverse_service.field.echelon import Words
from inverse_service.field.modular import Field, compiled, minus, multiply, plus, power
from inverse_service.field.real_branch import RealTable, find_real_point
from inverse_service.mechanics import conditions, euler_lagrange
from inverse_service.search import terms as tm

Integers = npt.NDArray[np.int64]
Matrix = list[list[int]]
# A seed, and the variables that change while the others keep their values at one point.
Drawn = tuple[int, tuple[ex.Symbol | ex.Velocity, ...]]
_T = TypeVar("_T")
# An ansatz whose terms have no common points (a vanishing denominator, a missing root) finds nothing.
NO_POINTS = (errors.IrreducibleAtoms, modular.SingularPoint, ValueError)
Combination = dict[tm.Monomial, Fraction]
Residues = npt.NDArray[np.object_]
RealMatrix = npt.NDArray[np.float64]
# The smallest eigenvalue that counts as positive.
_POSITIVE = 1e-3
_DENOMINATORS = (1, 2, 3, 4, 6, 12)


@dataclass(frozen=True, slots=True)
class _LetterProgram:
    """The series of generators in the same variables, at places `names` of (t, q, v), and their final registers."""

    letters: tuple[ex.Expression, ...]
    series: SeriesProgram
    instructions: Integers
    names: Integers
    registers: Integers
    work: int


@lru_cache(maxsize=512)
def _programs(
    letters: tuple[ex.Expression, ...], variables: tuple[modular.Variable, ...], order: int
) -> list[_LetterProgram]:
    """One program per set of variables: only the variables of a generator are displaced, usually a single one."""
    groups: dict[tuple[int, ...], list[ex.Expression]] = {}
    for letter in letters:
        names = set(modular.variables_in(letter))
        groups.setdefault(tuple(k for k, v in enumerate(variables) if v in names) or (0,), []).append(letter)
    return [part for names, group in groups.items() for part in _parts(tuple(group), variables, names, order)]


def _parts(
    letters: tuple[ex.Expression, ...], variables: tuple[modular.Variable, ...], names: tuple[int, ...], order: int
) -> list[_LetterProgram]:
    """Their program, or several if it is too large; IrreducibleAtoms if one generator is too large."""
    try:
        return [_program(letters, variables, names, order)]
    except exact_field.TooLarge as problem:
        if len(letters) == 1:
            raise errors.IrreducibleAtoms("a generator of the ansatz is too long for its series") from problem
    middle = len(letters) // 2
    halves = letters[:middle], letters[middle:]
    return [part for half in halves for part in _parts(half, variables, names, order)]


def _program(
    letters: tuple[ex.Expression, ...], variables: tuple[modular.Variable, ...], names: tuple[int, ...], order: int
) -> _LetterProgram:
    series = SeriesProgram([variables[k] for k in names], order)
    registers = np.array([series.expand(letter) for letter in letters], np.int64)
    work = sum(map(ex.node_count, letters))
    return _LetterProgram(letters, series, series.listed, np.array(names, np.int64), registers, work)


class _Displaced(NamedTuple):
    """(1, v, f) in Montgomery form, and the places among (t, q, v) of the variables that are displaced."""

    drift: Words
    names: Integers


class _Slopes(NamedTuple):
    """p_a/p, p_ab/p and, to order 3, p_abc/p of a generator p."""

    first: Words
    second: Words
    third: Words


@compiled
def _slope(r: int, degree: int, place: int, factor: np.uint64, m: Machine) -> np.uint64:
    """A Taylor coefficient of a generator times a factor."""
    if degree > m.registers.tops[r]:
        return np.uint64(0)
    value = m.registers.values[r * m.registers.stride + m.tables.starts[degree] + place]
    return multiply(value, factor, m.field)


@compiled
def _slopes_of_letter(r: int, value: np.uint64, m: Machine, d: _Slopes) -> None:
    """The derivatives of a generator over its value: Taylor coefficients times the factorials of their exponents."""
    size, starts, raised = m.tables.size, m.tables.raised_starts, m.tables.raised
    unit = power(value, m.field.prime - np.uint64(2), m.field)
    twice, six = multiply(unit, m.small[2], m.field), multiply(unit, m.small[6], m.field)
    for a in range(size):
        one = raised[starts[0] + a]
        d.first[a] = _slope(r, 1, one, unit, m)
        for b in range(size):
            two = raised[starts[1] + one * size + b]
            d.second[a, b] = _slope(r, 2, two, twice if a == b else unit, m)
            for c in range(d.third.shape[2]):
                three = raised[starts[2] + two * size + c]
                some = twice if a in (b, c) or b == c else unit
                d.third[a, b, c] = _slope(r, 3, three, six if a == b == c else some, m)


@compiled
def _second(a: int, b: int, d: _Slopes, field: Field) -> np.uint64:
    """d_a d_b log p = p_ab/p - u_a u_b, u = grad log p."""
    return minus(d.second[a, b], multiply(d.first[a], d.first[b], field), field)


@compiled
def _rate(a: int, b: int, displaced: _Displaced, d: _Slopes, field: Field) -> np.uint64:
    """Gamma'(s_ab), s_ab = d_a d_b log p: d_c s_ab = p_abc/p - s_ab u_c - u_a s_bc - u_b p_ac/p."""
    total = np.uint64(0)
    for c in range(d.third.shape[2]):
        value = minus(d.third[a, b, c], multiply(_second(a, b, d, field), d.first[c], field), field)
        value = minus(value, multiply(d.first[a], _second(b, c, d, field), field), field)
        value = minus(value, multiply(d.first[b], d.second[a, c], field), field)
        total = plus(total, multiply(displaced.drift[displaced.names[c]], value, field), field)
    return total


@compiled
def _fill(displaced: _Displaced, d: _Slopes, n: int, k: int, found: Words, field: Field) -> None:
    """Gamma(log p), d log p/dv_i, Gamma'(that), d log p/dq_i, d2 log p/dv_i dv_j, Gamma'(that) behind the value."""
    names = displaced.names
    for a in range(len(names)):
        i, drift = names[a] - n - 1, displaced.drift[names[a]]
        found[k, 1] = plus(found[k, 1], multiply(drift, d.first[a], field), field)
        if i < 0:
            if names[a] > 0:
                found[k, 1 + 2 * n + names[a]] = d.first[a]
            continue
        found[k, 2 + i] = d.first[a]
        for b in range(len(names)):
            j, value = names[b] - n - 1, _second(a, b, d, field)
            part = multiply(displaced.drift[names[b]], value, field)
            found[k, 2 + n + i] = plus(found[k, 2 + n + i], part, field)
            if j >= 0:
                found[k, 2 + 3 * n + i * n + j] = value
                found[k, 2 + 3 * n + n * n + i * n + j] = _rate(a, b, displaced, d, field)


@compiled
def _logarithmic(chosen: Integers, displaced: _Displaced, m: Machine, d: _Slopes, found: Words) -> bool:
    """The value of each generator and its logarithmic derivatives (`_fill`) as residues; False if one value is 0."""
    n, one = len(displaced.drift) // 2, np.uint64(1)
    for k in range(len(chosen)):
        r = chosen[k]
        value = m.registers.values[r * m.registers.stride]
        if m.registers.tops[r] < 0 or value == np.uint64(0):
            return False
        _slopes_of_letter(r, value, m, d)
        _fill(displaced, d, n, k, found, m.field)
        found[k, 0] = value
        for entry in range(found.shape[1]):
            found[k, entry] = multiply(found[k, entry], one, m.field)
    return True


def _letter_rows(program: _LetterProgram, point: modular.Point, drift: Words, order: int) -> Words | None:
    """A row of values for each generator at a point; None if one has no value or vanishes."""
    n, size, prime = len(drift) // 2, len(program.names), point.prime
    try:
        constants = constants_at(program.series, point)
        registers = run(program.series, program.instructions, constants, prime, order)
    except (modular.SingularPoint, ValueError):
        return None
    small = modular.small_numbers(prime, 7)
    machine = Machine(registers.stored, registers.tables, modular.field_of(prime), small, small)
    shapes = (size,), (size, size), (size, size, size if order > 2 else 0)
    slopes = _Slopes(*(np.empty(shape, np.uint64) for shape in shapes))
    found = np.zeros((len(program.letters), 2 + 3 * n + 2 * n * n), np.uint64)
    done = _logarithmic(program.registers, _Displaced(drift, program.names), machine, slopes, found)
    return found if done else None


@dataclass(slots=True)
class _AtPoint:
    """The cached values at one point; `drift` is (1, v, f) in Montgomery form, empty if f has no value."""

    point: modular.Point
    drift: Words
    letters: dict[tuple[ex.Expression, int], Words | None] = field(default_factory=dict)
    tensors: tuple[Matrix, Matrix] | None = None


@dataclass(slots=True)
class SamplePoints:
    """The points of a tower generated from a seed, on the constraints if any; `variables` are t, q, v.

    With `base`, the points differ from it only in the `moving` variables.
    """

    forces: Sequence[ex.Expression]
    variables: Sequence[ex.Symbol | ex.Velocity]
    tower: towers.Tower
    seed: int
    prime: int
    constrained: Mapping[ex.Velocity, ex.Expression] = field(default_factory=dict)
    base: modular.Point | None = None
    moving: Sequence[ex.Symbol | ex.Velocity] = ()
    places: list[_AtPoint] = field(default_factory=list)

    def point(self, k: int) -> modular.Point:
        return self.place(k).point

    def place(self, k: int) -> _AtPoint:
        while len(self.places) <= k:
            deadline.check(deadline.STEP)
            point = self._drawn(len(self.places))
            self.places.append(_AtPoint(point, self._drift(point)))
        return self.places[k]

    def _drawn(self, k: int) -> modular.Point:
        if self.base is None:
            return towers.draw_point(self.tower, self.seed + 1 + k, self.prime)
        return towers.moved_point(self.tower, self.base, self.moving, k)

    def _drift(self, point: modular.Point) -> Words:
        known: dict[ex.Expression, int] = {}
        try:
            point.variables.update((v, modular.evaluate(w, point, known)) for v, w in self.constrained.items())
            f = [modular.evaluate(force, point, known) for force in self.forces]
        except (modular.SingularPoint, ValueError):
            return np.empty(0, np.uint64)
        drift = [1, *(point.variable(v) for v in self.variables[1 + len(f) :]), *f]
        return np.array([(value << 64) % self.prime for value in drift], np.uint64)

    def letters(self, k: int, kernels: Sequence[ex.Expression], order: int) -> list[Words] | None:
        """A row for each generator at a point (see `_logarithmic`), to order 3 with third derivatives; else None."""
        place = self.place(k)
        if not len(place.drift):
            return None
        known = place.letters
        missing = tuple(kernel for kernel in kernels if (kernel, 3) not in known and (kernel, order) not in known)
        self._evaluate(place, missing, order)
        rows = [known[kernel, 3 if (kernel, 3) in known else order] for kernel in kernels]
        return None if any(row is None for row in rows) else [row for row in rows if row is not None]

    def _evaluate(self, place: _AtPoint, letters: tuple[ex.Expression, ...], order: int) -> None:
        for program in _programs(letters, tuple(self.variables), order) if letters else ():
            deadline.check(program.work)
            rows = _letter_rows(program, place.point, place.drift, order)
            if rows is not None:
                place.letters.update(((letter, order), row) for letter, row in zip(program.letters, rows, strict=True))
            elif len(program.letters) == 1:
                place.letters[program.letters[0], order] = None
            else:
                for letter in program.letters:
                    self._evaluate(place, (letter,), order)

    def values(self, k: int, kernels: Sequence[ex.Expression]) -> list[int] | None:
        """The values of all generators at a point, without derivatives; None if one has no value or vanishes."""
        place, known = self.place(k), dict[ex.Expression, int]()
        deadline.check(1 + len(kernels))
        try:
            found = [modular.evaluate(kernel, place.point, known) for kernel in kernels]
        except (modular.SingularPoint, ValueError):
            return None
        return found if len(place.drift) and all(found) else None


@dataclass(frozen=True, slots=True)
class KnownTower:
    """A tower of the atoms of f and of an ansatz on the branch of a real point, with the points drawn so far."""

    atoms: frozenset[ex.Expression]
    real_point: RealTable
    tower: towers.Tower
    points: dict[Drawn, SamplePoints] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Sampler:
    """A tower for f together with the generators of an ansatz, and a real point of both."""

    analysis: Analysis
    tower: towers.Tower
    real_point: RealTable | None
    known: dict[Drawn, SamplePoints] = field(default_factory=dict, compare=False)

    @property
    def variables(self) -> list[ex.Symbol | ex.Velocity]:
        return self.analysis.system.variables

    def points(self, seed: int, moving: tuple[ex.Symbol | ex.Velocity, ...] = ()) -> SamplePoints:
        """The points generated from a seed; with `moving`, they differ from the first in these only; cached."""
        if (seed, moving) not in self.known:
            base, forces = towers.draw_point(self.tower, seed), self.analysis.accelerations
            near, constrained = base if moving else None, self.analysis.constrained
            self.known[seed, moving] = SamplePoints(
                forces, self.variables, self.tower, seed, base.prime, constrained, near, moving
            )
        return self.known[seed, moving]

    def prime(self, seed: int) -> int:
        """The prime of the points generated from a seed."""
        return self.points(seed).prime


def sampler_of(analysis: Analysis, terms: Iterable[tm.Monomial]) -> Sampler:
    """The sampler for these terms; IrreducibleAtoms if the terms and f have no common real point or cannot be reduced.

    Ansätze whose generators add no atoms share their points.
    """
    letters = dict.fromkeys(item for term in terms for item in term)
    extra = [
        towers.to_kernels(tree) for letter, e in letters for tree in (letter, letter ** Fraction(1, e.denominator))
    ]
    wanted = [*analysis.accelerations, *analysis.constrained.values(), *dict.fromkeys(extra)]
    variables = variables_of(analysis.system)
    radicands = [letter for letter, e in letters if e.denominator % 2 == 0]
    for positive in (analysis.system.positive, (*analysis.system.positive, *radicands)):
        table = find_real_point(wanted, variables, seed=2, positive=positive)
        if table is not None:
            break
    else:
        raise errors.IrreducibleAtoms("the ansatz has no real point in common with f")
    atoms = _atoms(wanted)
    for known in analysis.towers:
        if atoms <= known.atoms and all(known.real_point.get(node) == x for node, x in table.items()):
            return Sampler(analysis, known.tower, table, known.points)
    shared = KnownTower(atoms, table, real_branch.reduce_atoms(wanted, variables, table))
    analysis.towers.append(shared)
    return Sampler(analysis, shared.tower, table, shared.points)


def _atoms(trees: Sequence[ex.Expression]) -> frozenset[ex.Expression]:
    """The atoms, roots, and pi in trees; a cosine counts as its sine, because one rule evaluates both."""
    atoms = (ex.Apply("sin", atom.argument) if _is_cosine(atom) else atom for atom in towers.atoms_in_order(trees))
    return frozenset(atoms).union(node for node in ex.distinct_nodes(trees) if node == ex.PI)


def _is_cosine(atom: ex.Expression) -> TypeGuard[ex.Apply]:
    return isinstance(atom, ex.Apply) and atom.function == "cos"


class Derivatives(NamedTuple):
    """For each sample and generator p: Gamma(log p), d log p/dv_i, Gamma'(d log p/dv_i), and d log p/dq_i.

    Arrays of residues, (samples, letters) and (samples, letters, n); Gamma' acts on the derivative
    only, so that EL_i(m)/m = V_i G + H_i - Q_i with sums over the generators of m. `hessian` is
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
    """The values of the generators and their derivatives; `numbers` are the indices of the samples among the points."""

    known: SamplePoints
    numbers: tuple[int, ...]
    values: list[list[int]]
    derivatives: Derivatives

    @property
    def prime(self) -> int:
        return self.known.prime

    @property
    def points(self) -> list[modular.Point]:
        return [self.known.point(k) for k in self.numbers]


def table_at(
    known: SamplePoints, letters: Sequence[ex.Expression], count: int, with_third: bool = False, first: int = 0
) -> LetterTable:
    """The table at `count` points after the `first`, skipping points at which one of `letters` vanishes."""
    kernels, order = tuple(towers.to_kernels(letter) for letter in letters), 3 if with_third else 2
    found = _first(lambda k: known.letters(k, kernels, order), count)
    numbers, rows = [k for k, _ in found], [row for _, row in found]
    n, shape = len(known.forces), (count - first, len(letters))
    table = np.array(rows[first:], np.uint64).reshape(*shape, 2 + 3 * n + 2 * n * n)
    ends = np.cumsum([1, 1, n, n, n, n * n])
    value, *parts = np.split(table, ends, axis=2)
    ranks = (0, 1, 1, 1, 2, 2)
    arrays = [np.ascontiguousarray(part).reshape(*shape, *(n,) * rank) for part, rank in zip(parts, ranks, strict=True)]
    return LetterTable(known, tuple(numbers[first:]), value[:, :, 0].tolist(), Derivatives(*arrays))


def values_at(known: SamplePoints, letters: Sequence[ex.Expression], count: int) -> list[list[int]]:
    """The values of `letters` at the points that `table_at` uses."""
    kernels = tuple(towers.to_kernels(letter) for letter in letters)
    return [row for _, row in _first(lambda k: known.values(k, kernels), count)]


def _first(at: Callable[[int], _T | None], count: int) -> list[tuple[int, _T]]:
    """(k, at(k)) for the first k with a value."""
    found: list[tuple[int, _T]] = []
    for k in itertools.count():
        if len(found) == count:
            break
        deadline.check()
        if k >= bounds.ATTEMPTS * count:
            raise errors.IrreducibleAtoms("the generators of the ansatz vanish at too many points")
        row = at(k)
        if row is not None:
            found.append((k, row))
    return found


def monomial_values(
    rows: Sequence[Sequence[int]], letters: Sequence[ex.Expression], candidates: Sequence[tm.Monomial], prime: int
) -> Words:
    """The value of each candidate at each sample from those of `letters`, (samples, candidates), in Montgomery form."""
    index = {letter: k for k, letter in enumerate(letters)}
    pairs: dict[tuple[ex.Expression, Fraction], int] = {}
    starts, places = [0], []
    for candidate in candidates:
        places += [pairs.setdefault(item, len(pairs)) for item in candidate]
        starts.append(len(places))
    radix = (1 << 64) % prime
    # Integers are converted because accessing the parts of a Fraction takes as long as computing the power.
    items = [(index[letter], e if e.denominator > 1 else int(e)) for letter, e in pairs]
    powers = [[modular.positive_power(sample[k], e, prime) * radix % prime for k, e in items] for sample in rows]
    field = modular.field_of(prime)
    result = np.full((len(powers), len(candidates)), field.one, np.uint64)
    given = np.array(powers, np.uint64).reshape(len(powers), -1)
    _products(given, np.array(starts, np.int64), np.array(places, np.int64), result, field)
    return result


@compiled
def _products(powers: Words, starts: Integers, places: Integers, result: Words, field: Field) -> None:
    """Multiply result[s, c] by the powers at places[starts[c]] … places[starts[c + 1] - 1] of sample s."""
    for s in range(result.shape[0]):
        for c in range(result.shape[1]):
            for k in range(starts[c], starts[c + 1]):
                result[s, c] = multiply(result[s, c], powers[s, places[k]], field)


@dataclass(frozen=True, slots=True)
class LagrangianSpace:
    """Independent combinations of ansatz terms that are Lagrangians, possibly up to a potential and linear terms."""

    sampler: Sampler
    combinations: tuple[Combination, ...]


class Exponents(NamedTuple):
    """The letters of candidate c are letters[starts[c]] … letters[starts[c + 1] - 1], with exponents as residues."""

    starts: Integers
    letters: Integers
    exponents: Words


def to_montgomery(array: Words, prime: int) -> Words:
    """x R modulo the prime for each residue x."""
    result = np.ascontiguousarray(array).copy()
    _scale(result.reshape(-1), modular.field_of(prime))
    return result


@compiled
def _scale(numbers: Words, field: Field) -> None:
    """Multiply each number by R, in place."""
    for k in range(numbers.shape[0]):
        numbers[k] = multiply(numbers[k], field.square, field)


def exponents_of(letters: Sequence[ex.Expression], candidates: Sequence[tm.Monomial], prime: int) -> Exponents:
    """The generators of all candidates in one array, with exponents in Montgomery form."""
    index = {letter: k for k, letter in enumerate(letters)}
    starts, places, exponents = [0], [], []
    for candidate in candidates:
        for letter, e in candidate:
            places.append(index[letter])
            exponents.append(modular.number_value(e, prime))
        starts.append(len(places))
    numbers = to_montgomery(np.array(exponents, np.uint64), prime)
    return Exponents(np.array(starts, np.int64), np.array(places, np.int64), numbers)


def letters_of(candidates: Sequence[tm.Monomial]) -> list[ex.Expression]:
    return list(dict.fromkeys(letter for candidate in candidates for letter, _ in candidate))


def null_combinations(kernel: matrices.Kernel, candidates: Sequence[tm.Monomial]) -> list[Combination]:
    """The rational part of a kernel, the vectors sorted by their own columns."""
    return [{candidates[k]: a for k, a in vector.items()} for vector in sorted(kernel.rational_vectors(), key=max)]


def _kernel(sampler: Sampler, points: SamplePoints, terms: Sequence[tm.Monomial]) -> matrices.Kernel:
    """The coefficients of the terms that satisfy (H2) and (H3)."""
    letters, n = letters_of(terms), len(sampler.analysis.accelerations)

    def equations(begin: int, end: int) -> Words:
        table = table_at(points, letters, end, with_third=True, first=begin)
        return helmholtz_matrix(sampler, table, letters, terms)[0]

    # Many of the n^2 conditions can be trivial, so the first samples need not suffice.
    return matrices.settled_kernel(len(terms), equations, n * n, points.prime)


def solve_multiplier(sampler: Sampler, terms: Sequence[tm.Monomial], seed: int) -> LagrangianSpace:
    """The combinations of the terms that are Lagrangians up to a potential and linear terms."""
    return LagrangianSpace(sampler, tuple(null_combinations(_kernel(sampler, sampler.points(seed), terms), terms)))


def occurring_terms(sampler: Sampler, terms: Sequence[tm.Monomial], seed: int) -> list[tm.Monomial]:
    """The terms that occur in a multiplier at one value of the parameters, with any numbers as coefficients.

    Terms that are combinations of simpler ones there, as k - r is of 1 and r, are omitted.
    """
    points, letters = sampler.points(seed, tuple(sampler.variables)), letters_of(terms)
    values = values_at(points, letters, len(terms) + matrices.SPARE)
    terms = [terms[k] for k in matrices.pivots(monomial_values(values, letters, terms, points.prime), points.prime)]
    used = {k for row in _kernel(sampler, points, terms).basis.tolist() for k, x in enumerate(row) if int(x)}
    return [terms[k] for k in sorted(used)]


def with_functions_of_parameters(sampler: Sampler, terms: Sequence[tm.Monomial]) -> LagrangianSpace:
    """The same with polynomials of the parameters as coefficients; TooLarge where the conditions are long."""
    products = list(map(tm.monomial_tree, terms))
    exact = conditions.motion_in_ring(sampler.analysis.system, 2, exact_field.Budget.short(), trees=products)
    motion = exact.motion
    connection, endomorphism = (np.array(f(motion)) for f in (conditions.connection, conditions.jacobi_endomorphism))
    columns = []
    for product in map(exact.ring.value, products):
        hessian = np.array([[by_v(by_u(product)) for by_v in motion.by_velocity] for by_u in motion.by_velocity])
        bent = hessian @ connection
        rows = np.vectorize(motion.along, otypes=[object])(hessian) - bent - bent.T
        turned = hessian @ endomorphism
        columns.append([*rows.flat, *(turned - turned.T).flat])
    vectors = map(exact_field.primitive, matrices.null_vectors(exact.ring, columns))
    sums = (
        tm.sum_of(
            tm.multiply_terms({term: Fraction(1)}, tm.terms_of(exact_field.quotient_tree(exact.ring, entry)))
            for term, entry in zip(terms, vector, strict=True)
        )
        for vector in vectors
    )
    return LagrangianSpace(sampler, tuple(sums))


def helmholtz_matrix(
    sampler: Sampler, table: LetterTable, letters: Sequence[ex.Expression], terms: Sequence[tm.Monomial]
) -> tuple[Words, Words]:
    """The n^2 conditions H2 (i <= j) and H3 (i < j) of each term at each sample, and its Hessian; Montgomery form.

    Shapes (samples n^2, terms) and (samples, terms, n, n).
    """
    prime, n, field = table.prime, table.derivatives.size, modular.field_of(table.prime)
    tensors = tensors_of(sampler, table)
    connection, endomorphism = (to_montgomery(np.array(part, np.uint64), prime) for part in zip(*tensors, strict=True))
    hessians, rates = hessians_of(table, letters, terms)
    result = np.zeros((len(hessians) * n * n, len(terms)), np.uint64)
    _write_conditions(hessians, rates, connection, endomorphism, field, result)
    return result, hessians


def hessians_of(
    table: LetterTable, letters: Sequence[ex.Expression], terms: Sequence[tm.Monomial]
) -> tuple[Words, Words]:
    """The Hessian of each term at each sample, and its Gamma derivative; Montgomery form, (samples, terms, n, n)."""
    prime, n = table.prime, table.derivatives.size
    values = monomial_values(table.values, letters, terms, prime)
    derivatives = Derivatives(*(to_montgomery(array, prime) for array in table.derivatives))
    hessians, rates = (np.zeros((*values.shape, n, n), np.uint64) for _ in range(2))
    _fill_hessians(values, exponents_of(letters, terms, prime), derivatives, modular.field_of(prime), hessians, rates)
    return hessians, rates


def tensors_of(sampler: Sampler, table: LetterTable) -> list[tuple[Matrix, Matrix]]:
    """(N, Phi) at each sample of a table; results are cached per point."""
    places = [table.known.place(k) for k in table.numbers]
    for place in places:
        if place.tensors is None:
            place.tensors = connection_and_endomorphism(sampler, place.point)
    return [place.tensors for place in places if place.tensors is not None]


def connection_and_endomorphism(sampler: Sampler, point: modular.Point) -> tuple[Matrix, Matrix]:
    """(N, Phi) at a point, each (n, n)."""
    deadline.check(deadline.STEP + sum(map(ex.node_count, sampler.analysis.accelerations)))
    if len(sampler.analysis.accelerations) == 1:  # no condition contains Phi
        f, known = sampler.analysis.accelerations[0], dict[ex.Expression, int]()
        modular.evaluate(f, point, known)  # raises SingularPoint if f has no value
        slope = modular.evaluate(differentiate(f, sampler.variables[2]), point, known)
        return [[-slope * pow(2, -1, point.prime) % point.prime]], [[0]]
    given = _written(tuple(sampler.variables), tuple(sampler.analysis.accelerations))
    constants = constants_at(given.program, point)
    return tensors_after(given, run(given.program, given.program.listed, constants, point.prime, order=2))


@lru_cache(maxsize=32)
def _written(variables: tuple[ex.Symbol | ex.Velocity, ...], forces: tuple[ex.Expression, ...]) -> Written:
    try:
        return written(variables, forces, order=2)
    except exact_field.TooLarge as problem:
        raise errors.IrreducibleAtoms("the forces are too long for their series") from problem


@compiled
def _fill_hessians(
    values: Words, terms: Exponents, d: Derivatives, field: Field, hessians: Words, rates: Words
) -> None:
    """g_ij = m (V_i V_j + W_ij) and Gamma(g_ij) = m (G (V_i V_j + W_ij) + H_i V_j + V_i H_j + Gamma W_ij).

    V, W, G, H are sums over the generators of m. Everything is in Montgomery form; the results, (samples, terms, n, n),
    must be zero on entry.
    """
    n = d.by_velocity.shape[2]
    for s in range(values.shape[0]):
        for c in range(values.shape[1]):
            first, last = terms.starts[c], terms.starts[c + 1]
            along = _sum_of(terms, d.along, s, first, last, field)
            for i in range(n):
                for j in range(i, n):
                    v = h = w = x = part = rate = np.uint64(0)
                    for k in range(first, last):
                        e, p = terms.exponents[k], terms.letters[k]
                        v = plus(v, multiply(e, d.by_velocity[s, p, i], field), field)
                        h = plus(h, multiply(e, d.mixed[s, p, i], field), field)
                        w = plus(w, multiply(e, d.by_velocity[s, p, j], field), field)
                        x = plus(x, multiply(e, d.mixed[s, p, j], field), field)
                        part = plus(part, multiply(e, d.hessian[s, p, i, j], field), field)
                        rate = plus(rate, multiply(e, d.third[s, p, i, j], field), field)
                    part = plus(part, multiply(v, w, field), field)
                    rate = plus(rate, multiply(along, part, field), field)
                    rate = plus(rate, plus(multiply(h, w, field), multiply(v, x, field), field), field)
                    hessians[s, c, i, j] = hessians[s, c, j, i] = multiply(values[s, c], part, field)
                    rates[s, c, i, j] = rates[s, c, j, i] = multiply(values[s, c], rate, field)


@compiled
def _sum_of(terms: Exponents, numbers: Words, s: int, first: int, last: int, field: Field) -> np.uint64:
    """The sum over the generators of a term of a quantity times the exponent."""
    total = np.uint64(0)
    for k in range(first, last):
        total = plus(total, multiply(terms.exponents[k], numbers[s, terms.letters[k]], field), field)
    return total


@compiled
def _write_conditions(
    hessians: Words, rates: Words, connection: Words, endomorphism: Words, field: Field, result: Words
) -> None:
    """Set `result` to Gamma(g_ij) - g_ik N_kj - g_jk N_ki, i <= j, g_ik Phi_kj - g_jk Phi_ki, i < j, per sample."""
    samples, count, n, _ = hessians.shape
    for s in range(samples):
        for c in range(count):
            row = s * n * n
            for i in range(n):
                for j in range(i, n):
                    rate = rates[s, c, i, j]
                    for k in range(n):
                        rate = minus(rate, multiply(hessians[s, c, i, k], connection[s, k, j], field), field)
                        rate = minus(rate, multiply(hessians[s, c, j, k], connection[s, k, i], field), field)
                    result[row, c] = rate
                    row += 1
            for i in range(n):
                for j in range(i + 1, n):
                    skew = np.uint64(0)
                    for k in range(n):
                        skew = plus(skew, multiply(hessians[s, c, i, k], endomorphism[s, k, j], field), field)
                        skew = minus(skew, multiply(hessians[s, c, j, k], endomorphism[s, k, i], field), field)
                    result[row, c] = skew
                    row += 1


def _hessians_at(space: LagrangianSpace, points: SamplePoints, first: int = 0) -> tuple[int, list[Residues]]:
    """(prime, d2L/dv dv of each combination at one of the points), skipping the `first` points."""
    every = dict.fromkeys(key for c in space.combinations for key in c)
    candidates = [key for key in every if not tm.is_linear(key)]
    letters = letters_of(candidates)
    table = table_at(points, letters, first + 1, first=first)
    inverse, n = pow(1 << 64, -1, table.prime), table.derivatives.size
    values = hessians_of(table, letters, candidates)[0][0].astype(object) * inverse % table.prime
    single = dict(zip(candidates, values, strict=True))
    zero = np.zeros((n, n), object)

    def combined(combination: Combination) -> Residues:
        weighted = (
            modular.number_value(a, table.prime) * single[key] for key, a in combination.items() if key in single
        )
        return sum(weighted, start=zero) % table.prime

    return table.prime, list(map(combined, space.combinations))


def _regular_sets(
    space: LagrangianSpace, order: Sequence[int], forms: Sequence[Residues], prime: int, seed: int
) -> list[tuple[int, ...]]:
    """Sets of indices, simplest first, of combinations whose generic sum is regular; `order` sorts the combinations."""
    squares_first = sorted(order, key=lambda k: not _is_diagonal(forms[k]))
    generator = random.Random(seed)
    weights = {k: generator.randrange(1, prime) for k in order}

    def is_regular(chosen: Sequence[int]) -> bool:
        total = sum((weights[k] * forms[k] for k in chosen), start=0 * forms[0]) % prime
        return bool(nmod_mat(total.tolist(), prime).rank() == len(total))

    found: list[tuple[int, ...]] = [(k,) for k in order if is_regular([k])]
    for sequence in (squares_first, order):
        chosen = list(sequence) if is_regular(sequence) else []
        for k in reversed(chosen.copy()):  # try to omit the last ones first
            rest = [j for j in chosen if j != k]
            chosen = rest if is_regular(rest) else chosen
        found += [tuple(chosen)] if chosen else []
    return sorted(dict.fromkeys(found), key=lambda ks: sum(complexity(space.combinations[k])[0] for k in ks))


def _is_diagonal(matrix: Residues) -> bool:
    return not (matrix - np.diag(np.diagonal(matrix))).any()


def complexity(combination: Combination) -> tuple[Fraction | int, int]:
    """The total weight of its terms, and their number."""
    return sum((tm.rank(key)[0] + 1 for key in combination), Fraction(0)), len(combination)


def reduced(total: Combination, gauge: Sequence[Combination]) -> Combination:
    """The combination minus gauge elements, subtracted while that makes it simpler."""
    improved = True
    while improved:
        improved = False
        for element in gauge:
            for key, a in element.items():
                if key in total:
                    shorter = tm.add_terms(total, element, -total[key] / a)
                    if shorter and complexity(shorter) < complexity(total):
                        total, improved = shorter, True
    return total


def scaled(combination: Combination, sign: int = 0) -> Combination:
    """The multiple in which the simplest term not linear in the velocities has the coefficient 1/2 if quadratic, else
    1.

    A positive `sign` means a positive factor.
    """
    moving = [key for key in combination if not tm.is_linear(key)] or list(combination)
    leading = min(moving, key=tm.rank)
    target = Fraction(1, 2) if any(e == 2 and tm.has_velocity(letter) for letter, e in leading) else Fraction(1)
    factor = target / (abs(combination[leading]) if sign > 0 else combination[leading])
    return {key: a * factor for key, a in combination.items()}


def definite_weights(hessians: Sequence[RealMatrix]) -> list[list[Fraction]]:
    """Weights w with sum w_k H_k positive definite: one choice far from all singular sums, one with as few as possible.

    H_k are symmetric of shape (n, n), finite and not zero; at most `bounds.COLUMNS` of them.
    """
    near = matrices.definite_weights(hessians) if 0 < len(hessians) <= bounds.COLUMNS else None
    if near is None:
        return []
    found = [_short(near, hessians), _short(_few(near, hessians), hessians)]
    return [one for k, one in enumerate(found) if one is not None and one not in found[:k]]


def _is_definite(matrix: RealMatrix) -> bool:
    """Whether the matrix is clearly positive definite in units in which all squares have the coefficient 1."""
    sizes = np.sqrt(np.abs(np.diagonal(matrix)))
    return bool(sizes.all() and np.linalg.eigvalsh(matrix / np.outer(sizes, sizes))[0] > _POSITIVE)


def _few(weights: list[float], hessians: Sequence[RealMatrix]) -> list[float]:
    """The weights with unnecessary ones set to 0, the smallest first."""
    kept = list(weights)
    for k in sorted(range(len(kept)), key=lambda k: abs(weights[k])):
        without = [0.0 if j == k else w for j, w in enumerate(kept)]
        if _is_definite(np.tensordot(without, hessians, 1)):
            kept = without
    return kept


def _short(weights: Sequence[float], hessians: Sequence[RealMatrix]) -> list[Fraction] | None:
    """The weights rounded to multiples of 1/d for the least possible d; equal weights stay equal."""
    largest = max(map(abs, weights))
    for d in _DENOMINATORS:
        rounded = [Fraction(round(w / largest * d), d) for w in weights]
        if _is_definite(np.tensordot([float(w) for w in rounded], hessians, 1)):
            return rounded
    return None


@dataclass(frozen=True, slots=True)
class Member:
    """A Lagrangian, the combinations whose sum it is, and whether its Hessian is positive at the real point."""

    terms: Combination
    parts: tuple[Combination, ...]
    definite: bool


def best_members(
    space: LagrangianSpace, seed: int, completed: Callable[[Combination], Combination] = dict
) -> list[Member]:
    """The simplest regular members that can be `completed` by potentials: definite ones first, then short ones."""
    if not space.combinations:
        return []
    prime, forms = _hessians_at(space, space.sampler.points(seed))
    # The others are total derivatives, or vanish by relations among generators.
    moving = [k for k, form in enumerate(forms) if form.any()]
    gauge = [c for c, form in zip(space.combinations, forms, strict=True) if not form.any()]
    order = sorted(moving, key=lambda k: complexity(space.combinations[k]))
    sets = _regular_sets(space, order, forms, prime, seed)[: bounds.FEW]
    found = [_sum_of_chosen(space, gauge, chosen) for chosen in sets]
    if sets and not any(member.definite for member in found):
        found += _definite_sums(space, gauge, [space.combinations[k] for k in order[: bounds.COLUMNS]])
    found = [replace(member, terms=whole) for member in found if (whole := completed(member.terms))]
    parameters = frozenset(ex.Symbol(name) for name in space.sampler.analysis.system.parameters)
    table = space.sampler.real_point
    plain = [_divided(member, parameters, table) for member in found] if table and parameters else found
    return sorted(plain, key=lambda member: _order(member, parameters))


def _order(member: Member, parameters: frozenset[ex.Symbol]) -> tuple[bool, Fraction, tuple[Fraction | int, int]]:
    weights = (sum((abs(e) + (e < 0) for _, e in part), Fraction(0)) for part in _constants(member.terms, parameters))
    return not member.definite, sum(weights, Fraction(0)), complexity(member.terms)


def _divided(member: Member, parameters: frozenset[ex.Symbol], table: RealTable) -> Member:
    """The member divided by the parameters of one of its kinetic terms, if that leaves fewer parameters there.

    A constant times a multiplier is a multiplier; the sign keeps the Hessian positive at the real point.
    """
    found = [member]
    for part in dict.fromkeys(_constants(member.terms, parameters)):
        if part:
            sign = -1 if real_branch.real_sign(tm.monomial_tree(part), table) < 0 else 1
            terms = {tm.times(key, part, -1): sign * value for key, value in member.terms.items()}
            found.append(replace(member, terms=terms))
    return min(found, key=lambda one: _order(one, parameters))


def _constants(terms: Combination, parameters: frozenset[ex.Symbol]) -> list[tm.Monomial]:
    """The generators of each kinetic term that contain only parameters."""
    kinetic = [key for key in terms if not tm.is_linear(key)]
    return [frozenset(item for item in key if tm.is_constant(item[0], parameters)) for key in kinetic]


def _sum_of_chosen(space: LagrangianSpace, gauge: Sequence[Combination], chosen: Sequence[int]) -> Member:
    """The sum of the chosen combinations, each with the sign that makes its Hessian positive.

    If that sum is singular, the parts get different weights.
    """
    names, table = space.sampler.analysis.system.coordinates, space.sampler.real_point

    def inertia(combination: Combination) -> tuple[int, int] | None:
        return euler_lagrange.inertia(euler_lagrange.hessian_at(tm.tree_of(combination), names, table))

    parts = [scaled(reduced(space.combinations[k], gauge)) for k in chosen]
    signs = [-1 if found is not None and found[1] > found[0] else 1 for found in (inertia(p) for p in parts)]
    total, found = Combination(), None
    for spread in range(3):
        weights = (sign * (1 + spread * k) for k, sign in enumerate(signs))
        total = reduced(tm.weighted_sum(zip(parts, weights, strict=True)), gauge)
        found = inertia(total)
        if found is None or sum(found) == len(names):
            break
    given = tuple(space.combinations[k] for k in chosen)
    return Member(total, given, found is not None and found[0] == len(names))


def _definite_sums(
    space: LagrangianSpace, gauge: Sequence[Combination], simplest: Sequence[Combination]
) -> list[Member]:
    """Sums of the simplest combinations with a positive definite Hessian at the real point."""
    if not all(map(_is_quadratic, space.combinations)):
        return []  # a Hessian that contains velocities is definite at some places only
    with_hessian = [(c, matrix) for c in simplest if (matrix := _real_hessian(space, c)) is not None]
    found = []
    for weights in definite_weights([matrix for _, matrix in with_hessian]):
        used = [(weight, c) for weight, (c, _) in zip(weights, with_hessian, strict=True) if weight]
        total = tm.weighted_sum((c, weight) for weight, c in used)
        found.append(Member(scaled(reduced(total, gauge), sign=1), tuple(c for _, c in used), definite=True))
    return found


def _is_quadratic(combination: Combination) -> bool:
    """Whether its terms are v_i v_j, v_i or 1 times functions of position."""
    moving = [[(letter, e) for letter, e in key if tm.has_velocity(letter)] for key in combination]
    plain = all(isinstance(letter, ex.Velocity) for part in moving for letter, _ in part)
    return plain and all(
        sum(e for _, e in part) in (0, 1, 2) and min((e for _, e in part), default=1) > 0 for part in moving
    )


def _real_hessian(space: LagrangianSpace, combination: Combination) -> RealMatrix | None:
    """d2L/dv dv at the real point; None if it vanishes or has no value."""
    deadline.check()
    names = space.sampler.analysis.system.coordinates
    form = euler_lagrange.hessian_at(tm.tree_of(combination), names, space.sampler.real_point)
    matrix = np.array([] if form is None else form.tolist(), float)
    return matrix if matrix.any() and np.isfinite(matrix).all() else None
