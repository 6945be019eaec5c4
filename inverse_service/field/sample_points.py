"""Random points over one prime, drawn in order, and the generators' logarithmic derivatives there.

The ansätze of a ladder use the same generators at the same points, and each ansatz adds a few.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from inverse_service import deadline, errors
from inverse_service.expressions import tree as ex
from inverse_service.field import modular, point as ps, tower as towers
from inverse_service.field.dense_series import Machine, SeriesProgram, constants_at, run
from inverse_service.field.exact_field import TooLarge
from inverse_service.field.modular import Field, compiled, minus, multiply, plus, power
from inverse_service.field.real_point import RealTable

Integers = npt.NDArray[np.int64]
Words = npt.NDArray[np.uint64]
Matrix = list[list[int]]
# A seed, and the variables that change while the others keep their values at one point.
Drawn = tuple[int, tuple[ex.Symbol | ex.Velocity, ...]]


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
    letters: tuple[ex.Expression, ...], variables: tuple[ps.Variable, ...], order: int
) -> list[_LetterProgram]:
    """One program per set of variables: only the variables of a generator are displaced, usually a single one."""
    groups: dict[tuple[int, ...], list[ex.Expression]] = {}
    for letter in letters:
        names = set(ps.variables_in(letter))
        groups.setdefault(tuple(k for k, v in enumerate(variables) if v in names) or (0,), []).append(letter)
    return [part for names, group in groups.items() for part in _parts(tuple(group), variables, names, order)]


def _parts(
    letters: tuple[ex.Expression, ...], variables: tuple[ps.Variable, ...], names: tuple[int, ...], order: int
) -> list[_LetterProgram]:
    """Their program, or several if it is too large; IrreducibleAtoms if one generator is too large."""
    try:
        return [_program(letters, variables, names, order)]
    except TooLarge as problem:
        if len(letters) == 1:
            raise errors.IrreducibleAtoms("a generator of the ansatz is too long for its series") from problem
    middle = len(letters) // 2
    halves = letters[:middle], letters[middle:]
    return [part for half in halves for part in _parts(half, variables, names, order)]


def _program(
    letters: tuple[ex.Expression, ...], variables: tuple[ps.Variable, ...], names: tuple[int, ...], order: int
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
def _differentiate(r: int, value: np.uint64, m: Machine, d: _Slopes) -> None:
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
        _differentiate(r, value, m, d)
        _fill(displaced, d, n, k, found, m.field)
        found[k, 0] = value
        for entry in range(found.shape[1]):
            found[k, entry] = multiply(found[k, entry], one, m.field)
    return True


def _letter_rows(program: _LetterProgram, point: ps.Point, drift: Words, order: int) -> Words | None:
    """A row of values for each generator at a point; None if one has no value or vanishes."""
    n, size, prime = len(drift) // 2, len(program.names), point.prime
    try:
        constants = constants_at(program.series, point)
        registers = run(program.series, program.instructions, constants, prime, order)
    except (ps.SingularPoint, ValueError):
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

    point: ps.Point
    drift: Words
    letters: dict[tuple[ex.Expression, int], Words | None] = dataclasses.field(default_factory=dict)
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
    constrained: Mapping[ex.Velocity, ex.Expression] = dataclasses.field(default_factory=dict)
    base: ps.Point | None = None
    moving: Sequence[ex.Symbol | ex.Velocity] = ()
    places: list[_AtPoint] = dataclasses.field(default_factory=list)

    def point(self, k: int) -> ps.Point:
        return self.place(k).point

    def place(self, k: int) -> _AtPoint:
        while len(self.places) <= k:
            deadline.check(deadline.STEP)
            point = self._drawn(len(self.places))
            self.places.append(_AtPoint(point, self._drift(point)))
        return self.places[k]

    def _drawn(self, k: int) -> ps.Point:
        if self.base is None:
            return towers.draw_point(self.tower, self.seed + 1 + k, self.prime)
        return towers.moved_point(self.tower, self.base, self.moving, k)

    def _drift(self, point: ps.Point) -> Words:
        known: dict[ex.Expression, int] = {}
        try:
            point.variables.update((v, ps.evaluate(w, point, known)) for v, w in self.constrained.items())
            f = [ps.evaluate(force, point, known) for force in self.forces]
        except (ps.SingularPoint, ValueError):
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
            found = [ps.evaluate(kernel, place.point, known) for kernel in kernels]
        except (ps.SingularPoint, ValueError):
            return None
        return found if len(place.drift) and all(found) else None


@dataclass(frozen=True, slots=True)
class KnownTower:
    """A tower of the atoms of f and of an ansatz on the branch of a real point, with the points drawn so far."""

    atoms: frozenset[ex.Expression]
    real_point: RealTable
    tower: towers.Tower
    points: dict[Drawn, SamplePoints] = dataclasses.field(default_factory=dict)
