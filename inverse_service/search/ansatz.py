"""Find the combinations of terms whose Hessian is a multiplier, the linear equations of an ansatz,
and the best ones.

The Hessian g of a combination must satisfy (H2) Gamma(g) = g N + (g N)^T and (H3) g Phi symmetric;
(H1) is satisfied by construction. The equations are formed from values of the generators and their
logarithmic derivatives at random points of a prime field. Terms linear in the velocities do not
enter, so this small problem shows whether a family contains a regular Lagrangian before the search
for its potentials.

The ansätze of a ladder use the same generators at the same points (`SamplePoints`), and each ansatz
adds a few.

Of the space of such combinations, members are chosen that are regular, definite if possible, and
simple (`best_members`). If the simplest regular sums are indefinite, weights for which a sum of
several has a positive definite Hessian are computed at one real point, then made few and short.
"""

import itertools
import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache, reduce
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt
from flint import nmod_mat

from inverse_service import bounds, deadline, errors
from inverse_service.decision.deciding import Analysis, variables_of
from inverse_service.expressions import terms as tm, tree as ex
from inverse_service.field import exact_field, matrices, modular, real_branch, tower as towers
from inverse_service.field.dense_series import (
    CONSTANT,
    Series,
    SeriesProgram,
    constants_at,
    derivative_along,
    run,
    series_of,
)
from inverse_service.field.echelon import Words
from inverse_service.field.modular import Field, compiled, montgomery_power, multiply, plus
from inverse_service.field.real_branch import RealTable, find_real_point
from inverse_service.mechanics import conditions, euler_lagrange

Integers = npt.NDArray[np.int64]
Matrix = list[list[int]]
# A seed, and the variables that change while the others keep their values at one point.
Drawn = tuple[int, tuple[ex.Symbol | ex.Velocity, ...]]
_T = TypeVar("_T")
# An ansatz whose terms have no common points (a vanishing denominator, a missing root) finds
# nothing.
NO_POINTS = (errors.IrreducibleAtoms, modular.SingularPoint, ValueError)
Combination = dict[tm.Monomial, Fraction]
Residues = npt.NDArray[np.object_]
RealMatrix = npt.NDArray[np.float64]
# The smallest eigenvalue that counts as positive.
_POSITIVE = 1e-3
_DENOMINATORS = (1, 2, 3, 4, 6, 12)


# Generators at random points: programs, cached values, and tables of samples.


class Derivatives(NamedTuple):
    """For each sample and generator p: Gamma(log p), d log p/dv_i, Gamma'(d log p/dv_i), and d log
    p/dq_i.

    Residues in Montgomery form, (samples, letters) and (samples, letters, n); Gamma' acts on the
    derivative only, so that EL_i(m)/m = V_i G + H_i - Q_i with sums over the generators of m.
    `hessian` is d2 log p/dv_i dv_j, `third` Gamma of it (zero unless asked for), (samples, letters,
    n, n).
    """

    along: Words
    by_velocity: Words
    mixed: Words
    by_position: Words
    hessian: Words
    third: Words


def derivatives_in(rows: npt.NDArray[Any], n: int) -> Derivatives:
    """The parts of rows of 1 + 3 n + 2 n^2 numbers, the last dimension; those of a single row are
    views of it.
    """
    parts = np.split(rows, np.cumsum([1, n, n, n, n * n]), axis=-1)
    shapes = ((), (n,), (n,), (n,), (n, n), (n, n))
    pairs = zip(parts, shapes, strict=True)
    return Derivatives(
        *(np.ascontiguousarray(part.reshape((*rows.shape[:-1], *shape))) for part, shape in pairs)
    )


@dataclass(frozen=True, slots=True)
class _LetterProgram:
    """The rows of generators (see `_program`) in the same variables, at places `names` of (t, q,
    v).
    """

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
    """One program per set of variables: only the variables of a generator are displaced, usually a
    single one.
    """
    groups: dict[tuple[int, ...], list[ex.Expression]] = {}
    for letter in letters:
        names = set(modular.variables_in(letter))
        groups.setdefault(
            tuple(k for k, v in enumerate(variables) if v in names) or (0,), []
        ).append(letter)
    return [
        part
        for names, group in groups.items()
        for part in _parts(tuple(group), variables, names, order)
    ]


def _parts(
    letters: tuple[ex.Expression, ...],
    variables: tuple[modular.Variable, ...],
    names: tuple[int, ...],
    order: int,
) -> list[_LetterProgram]:
    """Their program, or several if it is too large; IrreducibleAtoms if one generator is too
    large.
    """
    try:
        return [_program(letters, variables, names, order)]
    except exact_field.TooLarge as problem:
        if len(letters) == 1:
            raise errors.IrreducibleAtoms(
                "a generator of the ansatz is too long for its series"
            ) from problem
    middle = len(letters) // 2
    halves = letters[:middle], letters[middle:]
    return [part for half in halves for part in _parts(half, variables, names, order)]


def _program(
    letters: tuple[ex.Expression, ...],
    variables: tuple[modular.Variable, ...],
    names: tuple[int, ...],
    order: int,
) -> _LetterProgram:
    """A row of registers for each generator p, p itself and its `Derivatives`.

    The constants after the first one are the rates of the variables in (1, v, f).
    """
    program, n = SeriesProgram([variables[k] for k in names], order), len(variables) // 2
    rates = [program.constant(lambda point, known: 0) for _ in names]
    drift = [(k, Series(program, ((1, program.write(CONSTANT, program.register(), c=c), None),)))
             for k, c in enumerate(rates)]  # fmt: skip
    registers = np.full((len(letters), 2 + 3 * n + 2 * n * n), program.register())  # that of 0
    for row, letter in zip(registers, letters, strict=True):
        value, inverse = (
            series_of(program, letter),
            series_of(program, ex.Power(letter, ex.MINUS_ONE)),
        )
        row[0], d = value.register, derivatives_in(row[1:], n)
        if order:
            row[1] = (derivative_along(drift, value) * inverse).register
        for k, place in enumerate(names if order else ()):
            slope, i = value.derivative(k) * inverse, place - n - 1
            if 0 < place <= n:
                d.by_position[place - 1] = slope.register
            elif place:
                d.by_velocity[i], d.mixed[i] = (
                    slope.register,
                    derivative_along(drift, slope).register,
                )
                for m, j in ((m, other - n - 1) for m, other in enumerate(names) if other >= place):
                    bend = slope.derivative(m)
                    d.hessian[i, j] = d.hessian[j, i] = bend.register
                    if order > 2:
                        d.third[i, j] = d.third[j, i] = derivative_along(drift, bend).register
    work = sum(map(ex.node_count, letters))
    return _LetterProgram(
        letters, program, program.listed, np.array(names, np.int64), registers, work
    )


def _letter_rows(program: _LetterProgram, point: modular.Point, drift: Words) -> Words | None:
    """A row of values for each generator at a point, in Montgomery form; None if one has no value
    or vanishes.
    """
    try:
        constants = constants_at(program.series, point)
        constants[1 : 1 + len(program.names)] = drift[program.names]
        found = run(
            program.series, program.instructions, constants, point.prime, program.series.order
        ).stored
    except (modular.SingularPoint, ValueError):
        return None
    return np.where(found.tops < 0, np.uint64(0), found.values[:: found.stride])[program.registers]


@dataclass(slots=True)
class _AtPoint:
    """The cached values at one point; `drift` is (1, v, f) in Montgomery form, empty if f has no
    value.
    """

    point: modular.Point
    drift: Words
    letters: dict[tuple[ex.Expression, int], Words | None] = field(default_factory=dict)
    tensors: tuple[Matrix, Matrix] | None = None


@dataclass(slots=True)
class SamplePoints:
    """The points of a tower generated from a seed, on the constraints if any; `variables` are t, q,
    v.

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

    def place(self, k: int) -> _AtPoint:
        while len(self.places) <= k:
            deadline.check(deadline.STEP)
            number = len(self.places)
            if self.base is None:
                point = towers.draw_point(self.tower, self.seed + 1 + number, self.prime)
            else:
                point = towers.moved_point(self.tower, self.base, self.moving, number)
            self.places.append(_AtPoint(point, self._drift(point)))
        return self.places[k]

    def _drift(self, point: modular.Point) -> Words:
        known: dict[ex.Expression, int] = {}
        try:
            point.variables.update(
                (v, modular.evaluate(w, point, known)) for v, w in self.constrained.items()
            )
            f = [modular.evaluate(force, point, known) for force in self.forces]
        except (modular.SingularPoint, ValueError):
            return np.empty(0, np.uint64)
        drift = [1, *(point.variable(v) for v in self.variables[1 + len(f) :]), *f]
        return to_montgomery(drift, self.prime)

    def letters(self, k: int, kernels: Sequence[ex.Expression], order: int) -> list[Words] | None:
        """A row for each generator at a point (see `_program`); None if one has no value or
        vanishes.
        """
        place = self.place(k)
        if not len(place.drift):
            return None
        known = place.letters
        self._evaluate(
            place, tuple(kernel for kernel in kernels if (kernel, order) not in known), order
        )
        rows = [known[kernel, order] for kernel in kernels]
        return (
            None if any(row is None for row in rows) else [row for row in rows if row is not None]
        )

    def _evaluate(self, place: _AtPoint, letters: tuple[ex.Expression, ...], order: int) -> None:
        for program in _programs(letters, tuple(self.variables), order) if letters else ():
            deadline.check(program.work)
            rows = _letter_rows(program, place.point, place.drift)
            if rows is not None:
                place.letters.update(
                    ((letter, order), row)
                    for letter, row in zip(program.letters, rows, strict=True)
                )
            elif len(program.letters) == 1:
                place.letters[program.letters[0], order] = None
            else:
                for letter in program.letters:
                    self._evaluate(place, (letter,), order)


@dataclass(frozen=True, slots=True)
class KnownTower:
    """A tower of the atoms of f and of an ansatz on the branch of a real point, with the points
    drawn so far.
    """

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

    def points(self, seed: int, moving: tuple[ex.Symbol | ex.Velocity, ...] = ()) -> SamplePoints:
        """The points generated from a seed; with `moving`, they differ from the first in these
        only; cached.
        """
        if (seed, moving) not in self.known:
            base, forces = towers.draw_point(self.tower, seed), self.analysis.accelerations
            near, constrained = base if moving else None, self.analysis.constrained
            self.known[seed, moving] = SamplePoints(
                forces,
                self.analysis.system.variables,
                self.tower,
                seed,
                base.prime,
                constrained,
                near,
                moving,
            )
        return self.known[seed, moving]


def sampler_of(analysis: Analysis, terms: Iterable[tm.Monomial]) -> Sampler:
    """The sampler for these terms; IrreducibleAtoms if the terms and f have no common real point or
    cannot be reduced.

    Ansätze whose generators add no atoms share their points.
    """
    letters = dict.fromkeys(item for term in terms for item in term)
    extra = [
        towers.to_kernels(tree)
        for letter, e in letters
        for tree in (letter, letter ** Fraction(1, e.denominator))
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
        if atoms <= known.atoms and all(
            known.real_point.get(node) == x for node, x in table.items()
        ):
            return Sampler(analysis, known.tower, table, known.points)
    shared = KnownTower(atoms, table, real_branch.reduce_atoms(wanted, variables, table))
    analysis.towers.append(shared)
    return Sampler(analysis, shared.tower, table, shared.points)


def _atoms(trees: Sequence[ex.Expression]) -> frozenset[ex.Expression]:
    """The atoms, roots, and pi in trees; a cosine counts as its sine, because one rule evaluates
    both.
    """
    atoms = towers.atoms_in_order(trees)
    cosines = [p for p in atoms if isinstance(p, ex.Apply) and p.function == "cos"]
    sines: dict[ex.Expression, ex.Expression] = {p: ex.Apply("sin", p.argument) for p in cosines}
    return frozenset(sines.get(p, p) for p in atoms).union(
        p for p in ex.distinct_nodes(trees) if p == ex.PI
    )


@dataclass(frozen=True, slots=True)
class LetterTable:
    """The values of the generators, (samples, letters), and their `Derivatives` in rows, (samples,
    letters, 1 + 3 n + 2 n^2), in Montgomery form.

    `numbers` are the indices of the samples among the points.
    """

    known: SamplePoints
    numbers: tuple[int, ...]
    values: Words
    rows: Words

    @property
    def prime(self) -> int:
        return self.known.prime

    @property
    def size(self) -> int:
        """The number of coordinates."""
        return len(self.known.forces)

    @property
    def derivatives(self) -> Derivatives:
        return derivatives_in(self.rows, self.size)

    @property
    def points(self) -> list[modular.Point]:
        return [self.known.place(k).point for k in self.numbers]


def table_at(
    known: SamplePoints,
    letters: Sequence[ex.Expression],
    count: int,
    order: int = 2,
    first: int = 0,
) -> LetterTable:
    """The table at `count` points after the `first`, skipping points at which one of `letters`
    vanishes.

    To order 0 it has no derivatives, and to order 2 no `third`.
    """
    kernels = tuple(map(towers.to_kernels, letters))
    found = _first(lambda k: known.letters(k, kernels, order), count)
    numbers, rows = [k for k, _ in found], [row for _, row in found]
    n = len(known.forces)
    table = np.array(rows[first:], np.uint64).reshape(
        count - first, len(letters), 2 + 3 * n + 2 * n * n
    )
    values, rest = map(np.ascontiguousarray, (table[:, :, 0], table[:, :, 1:]))
    return LetterTable(known, tuple(numbers[first:]), values, rest)


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
    rows: Words,
    letters: Sequence[ex.Expression],
    candidates: Sequence[tm.Monomial],
    prime: int,
) -> Words:
    """The value of each candidate at each sample from those of `letters`, which are not 0,
    (samples, candidates), in Montgomery form.
    """
    index = {letter: k for k, letter in enumerate(letters)}
    pairs: dict[tuple[ex.Expression, Fraction], int] = {}
    places = [pairs.setdefault(item, len(pairs)) for candidate in candidates for item in candidate]
    field = modular.field_of(prime)
    result = np.full((len(rows), len(candidates)), field.one, np.uint64)
    _products(
        _powers(rows, [(index[letter], e) for letter, e in pairs], field),
        np.cumsum([0, *map(len, candidates)]),
        np.array(places, np.int64),
        result,
        field,
    )
    return result


def _powers(rows: Words, items: Sequence[tuple[int, Fraction]], field: Field) -> Words:
    """The powers of some columns, (samples, items), as `modular.positive_power` has them.

    ValueError for an even root of a nonsquare.
    """
    prime, result = int(field.prime), np.empty((len(rows), len(items)), np.uint64)
    columns = np.array([column for column, _ in items], np.int64)
    exponents = np.array([modular.root_exponent(e, prime) for _, e in items], np.uint64)
    _whole_powers(rows, columns, exponents, result, field)
    even = np.unique([column for column, e in items if e.denominator % 2 == 0]).astype(np.int64)
    symbols = np.empty((len(rows), len(even)), np.uint64)
    _whole_powers(rows, even, np.full(len(even), prime // 2, np.uint64), symbols, field)
    if (symbols != field.one).any():
        raise ValueError("even root of a negative residue")
    return result


@compiled
def _whole_powers(
    values: Words, columns: Integers, exponents: Words, result: Words, field: Field
) -> None:
    for s in range(values.shape[0]):
        for k in range(len(columns)):
            result[s, k] = montgomery_power(values[s, columns[k]], exponents[k], field)


@compiled
def _products(
    powers: Words, starts: Integers, places: Integers, result: Words, field: Field
) -> None:
    """Multiply result[s, c] by the powers at places[starts[c]] … places[starts[c + 1] - 1] of
    sample s.
    """
    for s in range(result.shape[0]):
        for c in range(result.shape[1]):
            for k in range(starts[c], starts[c + 1]):
                result[s, c] = multiply(result[s, c], powers[s, places[k]], field)


# The conditions (H2) and (H3) on the coefficients of terms, and their solutions.


@dataclass(frozen=True, slots=True)
class LagrangianSpace:
    """Independent combinations of ansatz terms that are Lagrangians, possibly up to a potential and
    linear terms.
    """

    sampler: Sampler
    combinations: tuple[Combination, ...]


class Exponents(NamedTuple):
    """The letters of candidate c are letters[starts[c]] … letters[starts[c + 1] - 1], with
    exponents as residues.
    """

    starts: Integers
    letters: Integers
    exponents: Words


def to_montgomery(numbers: npt.ArrayLike, prime: int) -> Words:
    """x R modulo the prime for each residue x."""
    return (np.asarray(numbers, object) * (1 << 64) % prime).astype(np.uint64)


def residues(numbers: Words, prime: int) -> Residues:
    """x for each x R modulo the prime."""
    found: Residues = numbers.astype(object) * pow(1 << 64, -1, prime) % prime
    return found


def exponents_of(
    letters: Sequence[ex.Expression], candidates: Sequence[tm.Monomial], prime: int
) -> Exponents:
    """The generators of all candidates in one array, with exponents in Montgomery form."""
    index = {letter: k for k, letter in enumerate(letters)}
    items = [item for candidate in candidates for item in candidate]
    starts, places = (
        np.cumsum([0, *map(len, candidates)]),
        np.array([index[letter] for letter, _ in items], np.int64),
    )
    return Exponents(
        starts, places, to_montgomery([modular.number_value(e, prime) for _, e in items], prime)
    )


def letters_of(candidates: Sequence[tm.Monomial]) -> list[ex.Expression]:
    return list(dict.fromkeys(letter for candidate in candidates for letter, _ in candidate))


def null_combinations(
    kernel: matrices.Kernel, candidates: Sequence[tm.Monomial]
) -> list[Combination]:
    """The rational part of a kernel, the vectors sorted by their own columns."""
    return [
        {candidates[k]: a for k, a in vector.items()}
        for vector in sorted(kernel.rational_vectors(), key=max)
    ]


def _kernel(
    sampler: Sampler, points: SamplePoints, terms: Sequence[tm.Monomial]
) -> matrices.Kernel:
    """The coefficients of the terms that satisfy (H2) and (H3)."""
    letters, n = letters_of(terms), len(sampler.analysis.accelerations)

    def equations(begin: int, end: int) -> Words:
        table = table_at(points, letters, end, order=3, first=begin)
        return helmholtz_matrix(sampler, table, letters, terms).rows

    # Many of the n^2 conditions can be trivial, so the first samples need not suffice.
    return matrices.settled_kernel(len(terms), equations, n * n, points.prime)


def solve_multiplier(sampler: Sampler, terms: Sequence[tm.Monomial], seed: int) -> LagrangianSpace:
    """The combinations of the terms, with rational coefficients, that are Lagrangians up to a
    potential and A v.
    """
    return LagrangianSpace(
        sampler, tuple(null_combinations(_kernel(sampler, sampler.points(seed), terms), terms))
    )


def occurring_terms(sampler: Sampler, terms: Sequence[tm.Monomial], seed: int) -> list[tm.Monomial]:
    """The terms that occur in a multiplier at one value of the parameters, with any numbers as
    coefficients.

    Terms that are combinations of simpler ones there, as k - r is of 1 and r, are omitted.
    """
    points, letters = (
        sampler.points(seed, tuple(sampler.analysis.system.variables)),
        letters_of(terms),
    )
    values = table_at(points, letters, len(terms) + matrices.SPARE, order=0).values
    terms = [
        terms[k]
        for k in matrices.pivots(
            monomial_values(values, letters, terms, points.prime), points.prime
        )
    ]
    used = {
        k
        for row in _kernel(sampler, points, terms).basis.tolist()
        for k, x in enumerate(row)
        if int(x)
    }
    return [terms[k] for k in sorted(used)]


def solve_multiplier_over_parameters(
    sampler: Sampler, terms: Sequence[tm.Monomial]
) -> LagrangianSpace:
    """As `solve_multiplier`, with polynomials of the parameters as coefficients, exactly; TooLarge
    if that is long.
    """
    products = list(map(tm.monomial_tree, terms))
    exact = conditions.motion_in_ring(
        sampler.analysis.system, 2, exact_field.Budget.short(), trees=products
    )
    motion = exact.motion
    connection, endomorphism = (
        np.array(f(motion)) for f in (conditions.connection, conditions.jacobi_endomorphism)
    )
    columns = []
    for product in map(exact.ring.value, products):
        hessian = np.array(
            [[by_v(by_u(product)) for by_v in motion.by_velocity] for by_u in motion.by_velocity]
        )
        bent = hessian @ connection
        rows = np.vectorize(motion.along, otypes=[object])(hessian) - bent - bent.T
        turned = hessian @ endomorphism
        columns.append([*rows.flat, *(turned - turned.T).flat])
    vectors = map(exact_field.primitive_vector, matrices.null_vectors(exact.ring, columns))
    sums = (
        tm.sum_of(
            tm.multiply_terms(
                {term: Fraction(1)}, tm.terms_of(exact_field.quotient_tree(exact.ring, entry))
            )
            for term, entry in zip(terms, vector, strict=True)
        )
        for vector in vectors
    )
    return LagrangianSpace(sampler, tuple(sums))


class HelmholtzRows(NamedTuple):
    """The conditions on terms at samples, (samples n^2, terms), and the Hessians of the terms,
    (samples, terms, n, n); Montgomery form.
    """

    rows: Words
    hessians: Words


class Hessians(NamedTuple):
    """Hessians of terms at samples and their Gamma derivatives, (samples, terms, n, n); Montgomery
    form.
    """

    values: Words
    rates: Words


def helmholtz_matrix(
    sampler: Sampler,
    table: LetterTable,
    letters: Sequence[ex.Expression],
    terms: Sequence[tm.Monomial],
) -> HelmholtzRows:
    """The n^2 conditions H2 (i <= j) and H3 (i < j) of each term at each sample, and its Hessian:
    Gamma(g) - g N - (g N)^T and g Phi - (g Phi)^T.
    """
    n, field = table.size, modular.field_of(table.prime)
    hessians, rates = hessians_of(table, letters, terms)
    connection, endomorphism = (
        to_montgomery(part, table.prime)[:, None]
        for part in zip(*tensors_of(sampler, table), strict=True)
    )
    bent, turned = (
        _matrix_product(hessians, tensor, field) for tensor in (connection, endomorphism)
    )
    moved = _difference(_difference(rates, bent, field), bent.swapaxes(2, 3), field)
    skew = _difference(turned, turned.swapaxes(2, 3), field)
    rows = [moved[:, :, *np.triu_indices(n)], skew[:, :, *np.triu_indices(n, 1)]]
    whole = np.concatenate(rows, axis=2).swapaxes(1, 2).reshape(-1, len(terms))
    return HelmholtzRows(whole, hessians)


def hessians_of(
    table: LetterTable, letters: Sequence[ex.Expression], terms: Sequence[tm.Monomial]
) -> Hessians:
    """The Hessian of each term m at each sample, and its Gamma derivative.

    g_ij = m (V_i V_j + W_ij) and Gamma(g_ij) = m (G (V_i V_j + W_ij) + H_i V_j + V_i H_j + Gamma
    W_ij), where V, W, G, H are the derivatives of log m, sums over the generators of m.
    """
    prime, field = table.prime, modular.field_of(table.prime)
    values = monomial_values(table.values, letters, terms, prime)[:, :, None, None]
    sums = np.zeros((len(values), len(terms), table.rows.shape[2]), np.uint64)
    _add_multiples(exponents_of(letters, terms, prime), table.rows, field, sums)
    d = derivatives_in(sums, table.size)
    crossed = product(d.mixed[..., :, None], d.by_velocity[..., None, :], field)
    form = _sum(
        product(d.by_velocity[..., :, None], d.by_velocity[..., None, :], field), d.hessian, field
    )
    rate = _sum(product(d.along[..., None, None], form, field), d.third, field)
    rate = _sum(rate, _sum(crossed, crossed.swapaxes(2, 3), field), field)
    return Hessians(product(values, form, field), product(values, rate, field))


@compiled
def _add_multiples(terms: Exponents, rows: Words, field: Field, sums: Words) -> None:
    """Add to sums[s, c] the rows of sample s of the generators of term c, each times its
    exponent.
    """
    for s in range(sums.shape[0]):
        for c in range(sums.shape[1]):
            for k in range(terms.starts[c], terms.starts[c + 1]):
                for place in range(sums.shape[2]):
                    part = multiply(terms.exponents[k], rows[s, terms.letters[k], place], field)
                    sums[s, c, place] = plus(sums[s, c, place], part, field)


def product(left: Words, right: Words, field: Field) -> Words:
    """The product of arrays in Montgomery form, entry by entry."""
    a, b = map(np.ascontiguousarray, np.broadcast_arrays(left, right))
    result = np.empty(a.shape, np.uint64)
    _multiply_all(a.reshape(-1), b.reshape(-1), field, result.reshape(-1))
    return result


@compiled
def _multiply_all(left: Words, right: Words, field: Field, result: Words) -> None:
    for k in range(len(result)):
        result[k] = multiply(left[k], right[k], field)


def _sum(left: Words, right: Words, field: Field) -> Words:
    total: Words = left + right
    below: Words = np.minimum(total, total - field.prime)  # less than 0 is a large word
    return below


def _difference(left: Words, right: Words, field: Field) -> Words:
    total: Words = left - right
    below: Words = np.minimum(total, total + field.prime)
    return below


def _matrix_product(left: Words, right: Words, field: Field) -> Words:
    """The product of matrices, the last two dimensions."""
    parts = (
        product(left[..., :, k, None], right[..., None, k, :], field) for k in range(left.shape[-1])
    )
    return reduce(lambda a, b: _sum(a, b, field), parts)


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
    given = _written(
        tuple(sampler.analysis.system.variables), tuple(sampler.analysis.accelerations)
    )
    constants = constants_at(given.program, point)
    return conditions.tensors_after(
        given, run(given.program, given.program.listed, constants, point.prime, order=2)
    )


@lru_cache(maxsize=32)
def _written(
    variables: tuple[ex.Symbol | ex.Velocity, ...], forces: tuple[ex.Expression, ...]
) -> conditions.TensorSeries:
    try:
        return conditions.tensor_series(variables, forces, order=2)
    except exact_field.TooLarge as problem:
        raise errors.IrreducibleAtoms("the forces are too long for their series") from problem


# The best members of a space of solutions.


def _hessians_at(space: LagrangianSpace, seed: int) -> tuple[int, list[Residues]]:
    """(prime, d2L/dv dv of each combination at the first point of a seed)."""
    every = dict.fromkeys(key for c in space.combinations for key in c)
    candidates = [key for key in every if not tm.is_affine(key)]
    letters, sampler = letters_of(candidates), space.sampler
    # Coefficients over the parameters may have others than f and the ansatz: 2^(2 b) of 2^b.
    if not all(sampler.tower.values_all(towers.to_kernels(letter)) for letter in letters):
        sampler = sampler_of(sampler.analysis, candidates)
    table = table_at(sampler.points(seed), letters, 1, order=3)
    values = residues(hessians_of(table, letters, candidates).values[0], table.prime)
    single = dict(zip(candidates, values, strict=True))
    zero = np.zeros((table.size, table.size), object)

    def combined(combination: Combination) -> Residues:
        weighted = (
            modular.number_value(a, table.prime) * single[key]
            for key, a in combination.items()
            if key in single
        )
        return sum(weighted, start=zero) % table.prime

    return table.prime, list(map(combined, space.combinations))


def _regular_sets(
    space: LagrangianSpace, order: Sequence[int], forms: Sequence[Residues], prime: int, seed: int
) -> list[tuple[int, ...]]:
    """Sets of indices, simplest first, of combinations whose generic sum is regular; `order` sorts
    the combinations.
    """
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
    return sorted(
        dict.fromkeys(found), key=lambda ks: sum(complexity(space.combinations[k])[0] for k in ks)
    )


def _is_diagonal(matrix: Residues) -> bool:
    return not (matrix - np.diag(np.diagonal(matrix))).any()


def complexity(combination: Combination) -> tuple[Fraction | int, int]:
    """The total weight of its terms, and their number."""
    return sum((tm.rank(key)[0] + 1 for key in combination), Fraction(0)), len(combination)


def without_gauge(total: Combination, gauge: Sequence[Combination]) -> Combination:
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


def with_simple_coefficients(combination: Combination, sign: int = 0) -> Combination:
    """The multiple in which the simplest term not linear in the velocities has the coefficient 1/2
    if quadratic, else 1.

    A positive `sign` means a positive factor.
    """
    moving = [key for key in combination if not tm.is_affine(key)] or list(combination)
    leading = min(moving, key=tm.rank)
    target = (
        Fraction(1, 2)
        if any(e == 2 and tm.has_velocity(letter) for letter, e in leading)
        else Fraction(1)
    )
    factor = target / (abs(combination[leading]) if sign > 0 else combination[leading])
    return {key: a * factor for key, a in combination.items()}


def short_definite_weights(hessians: Sequence[RealMatrix]) -> list[list[Fraction]]:
    """Weights w with sum w_k H_k positive definite: one choice far from all singular sums, one with
    as few as possible.

    H_k are symmetric of shape (n, n), finite and not zero; at most `bounds.COLUMNS` of them.
    """
    near = matrices.definite_weights(hessians) if 0 < len(hessians) <= bounds.COLUMNS else None
    if near is None:
        return []
    found = [_short(near, hessians), _short(_few(near, hessians), hessians)]
    return [one for k, one in enumerate(found) if one is not None and one not in found[:k]]


def _is_definite(matrix: RealMatrix) -> bool:
    """Whether the matrix is clearly positive definite in units in which all squares have the
    coefficient 1.
    """
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
    """The weights rounded to multiples of 1/d for the least possible d; equal weights stay
    equal.
    """
    largest = max(map(abs, weights))
    for d in _DENOMINATORS:
        rounded = [Fraction(round(w / largest * d), d) for w in weights]
        if _is_definite(np.tensordot([float(w) for w in rounded], hessians, 1)):
            return rounded
    return None


@dataclass(frozen=True, slots=True)
class Member:
    """A Lagrangian, the combinations whose sum it is, and whether its Hessian is positive at the
    real point.
    """

    terms: Combination
    parts: tuple[Combination, ...]
    definite: bool


def best_members(
    space: LagrangianSpace, seed: int, completed: Callable[[Combination], Combination] = dict
) -> list[Member]:
    """The simplest regular members that can be `completed` by potentials: definite ones first, then
    short ones.
    """
    if not space.combinations:
        return []
    prime, forms = _hessians_at(space, seed)
    # The others are total derivatives, or vanish by relations among generators.
    moving = [k for k, form in enumerate(forms) if form.any()]
    gauge = [c for c, form in zip(space.combinations, forms, strict=True) if not form.any()]
    order = sorted(moving, key=lambda k: complexity(space.combinations[k]))
    sets = _regular_sets(space, order, forms, prime, seed)[: bounds.FEW]
    found = [_sum_of_chosen(space, gauge, chosen) for chosen in sets]
    if sets and not any(member.definite for member in found):
        found += _definite_sums(
            space, gauge, [space.combinations[k] for k in order[: bounds.COLUMNS]]
        )
    found = [replace(member, terms=whole) for member in found if (whole := completed(member.terms))]
    parameters = frozenset(ex.Symbol(name) for name in space.sampler.analysis.system.parameters)
    table = space.sampler.real_point
    plain = (
        [_divided(member, parameters, table) for member in found] if table and parameters else found
    )
    return sorted(plain, key=lambda member: _order(member, parameters))


def _order(
    member: Member, parameters: frozenset[ex.Symbol]
) -> tuple[bool, Fraction, tuple[Fraction | int, int]]:
    weights = (
        sum((abs(e) + (e < 0) for _, e in part), Fraction(0))
        for part in _constants(member.terms, parameters)
    )
    return not member.definite, sum(weights, Fraction(0)), complexity(member.terms)


def _divided(member: Member, parameters: frozenset[ex.Symbol], table: RealTable) -> Member:
    """The member divided by the parameters of one of its kinetic terms, if that leaves fewer
    parameters there.

    A constant times a multiplier is a multiplier; the sign keeps the Hessian positive at the real
    point.
    """
    found = [member]
    for part in dict.fromkeys(_constants(member.terms, parameters)):
        if part:
            sign = -1 if real_branch.real_sign(tm.monomial_tree(part), table) < 0 else 1
            found.append(replace(member, terms=tm.multiply_by(member.terms, part, -1, sign)))
    return min(found, key=lambda one: _order(one, parameters))


def _constants(terms: Combination, parameters: frozenset[ex.Symbol]) -> list[tm.Monomial]:
    """The generators of each kinetic term that contain only parameters."""
    kinetic = [key for key in terms if not tm.is_affine(key)]
    return [
        frozenset(item for item in key if tm.is_constant(item[0], parameters)) for key in kinetic
    ]


def _sum_of_chosen(
    space: LagrangianSpace, gauge: Sequence[Combination], chosen: Sequence[int]
) -> Member:
    """The sum of the chosen combinations, each with the sign that makes its Hessian positive.

    If that sum is singular, the parts get different weights.
    """
    names, table = space.sampler.analysis.system.coordinates, space.sampler.real_point

    def inertia(combination: Combination) -> euler_lagrange.Inertia | None:
        return euler_lagrange.inertia(
            euler_lagrange.hessian_at(tm.tree_of(combination), names, table)
        )

    parts = [with_simple_coefficients(without_gauge(space.combinations[k], gauge)) for k in chosen]
    signs = [
        -1 if found is not None and found.negative > found.positive else 1
        for found in (inertia(p) for p in parts)
    ]
    total, found = Combination(), None
    for spread in range(3):
        weights = (sign * (1 + spread * k) for k, sign in enumerate(signs))
        total = without_gauge(tm.weighted_sum(zip(parts, weights, strict=True)), gauge)
        found = inertia(total)
        if found is None or sum(found) == len(names):
            break
    given = tuple(space.combinations[k] for k in chosen)
    return Member(total, given, found is not None and found[0] == len(names))


def _definite_sums(
    space: LagrangianSpace, gauge: Sequence[Combination], simplest: Sequence[Combination]
) -> list[Member]:
    """Sums of the simplest combinations with a positive definite Hessian at the real point."""
    if not all(
        tm.velocity_degree(key) in (0, 1, 2)
        for combination in space.combinations
        for key in combination
    ):
        return []  # a Hessian that contains velocities is definite at some places only
    with_hessian = [
        (c, matrix) for c in simplest if (matrix := _real_hessian(space, c)) is not None
    ]
    found = []
    for weights in short_definite_weights([matrix for _, matrix in with_hessian]):
        used = [(weight, c) for weight, (c, _) in zip(weights, with_hessian, strict=True) if weight]
        total = tm.weighted_sum((c, weight) for weight, c in used)
        terms = with_simple_coefficients(without_gauge(total, gauge), sign=1)
        found.append(Member(terms, tuple(c for _, c in used), definite=True))
    return found


def _real_hessian(space: LagrangianSpace, combination: Combination) -> RealMatrix | None:
    """d2L/dv dv at the real point; None if it vanishes or has no value."""
    deadline.check()
    names = space.sampler.analysis.system.coordinates
    form = euler_lagrange.hessian_at(tm.tree_of(combination), names, space.sampler.real_point)
    matrix = np.array([] if form is None else form.tolist(), float)
    return matrix if matrix.any() and np.isfinite(matrix).all() else None
