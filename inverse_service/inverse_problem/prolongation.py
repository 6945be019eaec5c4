"""The Helmholtz system about a point, prolonged order by order, as rows modulo a prime.

Unknown are the Taylor coefficients c_m of L with v-degree >= 2, so that g_ij = d2L/dv_i dv_j
fulfils (H1). With x = (t?, q, v) and X = (1, v, f) the components of Gamma, the rows are the
coefficients of the displacement monomial alpha in

    H2_ij  sum_a X^a d_a g_ij - sum_k (g_ik N^k_j + g_jk N^k_i)    i <= j, |alpha| <= r - 1
    H3_ij  sum_k (g_ik Phi^k_j - g_jk Phi^k_i)                     i <  j, |alpha| <= r

with N = -1/2 df/dv, Phi = Gamma(df/dv) - 2 df/dq - 1/2 (df/dv)(df/dv) (Helmholtz 1887; Douglas,
Trans. AMS 50 (1941), section 2; signs as in Mestdag, Bloch and Fernandez).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from inverse_service.algebra import series as ps
from inverse_service.algebra.echelon import Echelon, Words
from inverse_service.algebra.monomials import MonomialKeys, exponents_of_degree, keys_of
from inverse_service.algebra.montgomery import compiled
from inverse_service.algebra.series import Series, SeriesRing

Integers = npt.NDArray[np.int64]
Exponents = npt.NDArray[np.int8]
# (kind, i, j, alpha): which Helmholtz equation, which Taylor coefficient of it.
RowName = tuple[str, int, int, tuple[int, ...]]
_NO_DERIVATIVE = -1


@dataclass(frozen=True, slots=True)
class Term:
    """A summand series * g_ij, or series * d_a g_ij, of one equation."""

    i: int
    j: int
    derivative: int
    series: Series


@dataclass(frozen=True, slots=True)
class Equation:
    """One of the equations H2_ij, H3_ij as the sum of its terms."""

    kind: str
    i: int
    j: int
    terms: tuple[Term, ...]


def matrix_product(left: list[list[Series]], right: list[list[Series]]) -> list[list[Series]]:
    size = range(len(left))
    return [[_total([ps.multiply(left[i][k], right[k][j]) for k in size]) for j in size] for i in size]


def _total(parts: list[Series]) -> Series:
    total = parts[0]
    for part in parts[1:]:
        total = ps.add(total, part)
    return total


def truncate(series: Series, order: int) -> Series:
    return series[: order + 1]


@dataclass(frozen=True, slots=True)
class LocalSystem:
    """Series of X, N and Phi about the point; `offset` is the index of the first q in x."""

    ring: SeriesRing
    offset: int
    field: tuple[Series, ...]
    connection: tuple[tuple[Series, ...], ...]
    endomorphism: tuple[tuple[Series, ...], ...]

    @property
    def dimension(self) -> int:
        return len(self.connection)


def local_system(ring: SeriesRing, velocities: list[Series], forces: list[Series], with_time: bool) -> LocalSystem:
    """X, N, Phi from the series of v and f of order D; Phi comes out to order D - 2."""
    n = len(forces)
    offset = int(with_time)
    half = ring.invert_number(2)
    field_ = [*([ring.constant(1)] if with_time else []), *velocities, *forces]
    order = ring.order - 1
    by_velocity = [[ps.derivative(f, offset + n + j) for j in range(n)] for f in forces]
    by_position = [[ps.derivative(f, offset + j) for j in range(n)] for f in forces]
    square = matrix_product(by_velocity, by_velocity)
    lower = [truncate(x, order - 1) for x in field_]
    endomorphism = []
    for i in range(n):
        row = []
        for j in range(n):
            entry = _total([ps.multiply(x, ps.derivative(by_velocity[i][j], a)) for a, x in enumerate(lower)])
            entry = ps.subtract(entry, ps.scale(truncate(by_position[i][j], order - 1), 2))
            row.append(ps.subtract(entry, ps.scale(truncate(square[i][j], order - 1), half)))
        endomorphism.append(tuple(row))
    connection = tuple(tuple(ps.scale(entry, ring.prime - half) for entry in row) for row in by_velocity)
    return LocalSystem(ring, offset, tuple(field_), connection, tuple(endomorphism))


def equations(local: LocalSystem) -> list[Equation]:
    """H2 for i <= j, then H3 for i < j."""
    n, found = local.dimension, []
    for i in range(n):
        for j in range(i, n):
            terms = [Term(i, j, a, x) for a, x in enumerate(local.field) if any(x)]
            for k in range(n):
                terms += _zero_order(i, k, local.connection[k][j], negative=True)
                terms += _zero_order(j, k, local.connection[k][i], negative=True)
            found.append(Equation("H2", i, j, tuple(terms)))
    for i in range(n):
        for j in range(i + 1, n):
            terms = []
            for k in range(n):
                terms += _zero_order(i, k, local.endomorphism[k][j], negative=False)
                terms += _zero_order(j, k, local.endomorphism[k][i], negative=True)
            found.append(Equation("H3", i, j, tuple(terms)))
    return found


def _zero_order(i: int, k: int, series: Series, negative: bool) -> list[Term]:
    if not any(series):
        return []
    return [Term(min(i, k), max(i, k), _NO_DERIVATIVE, ps.scale(series, -1) if negative else series)]


@compiled
def _emit(
    fill: bool, keys: Integers, exponents: Exponents, term_key: np.int64, term_value: np.uint64,
    vi: int, vj: int, da: int, row_keys: Integers, row_order: Integers, bits: int, prime: np.uint64,
    counts: Integers, columns: Integers, values: Words, base: int,
) -> None:
    """Entries of series-term * (d_a) g_ij for all unknown monomials `keys`; counted or filled in."""
    for m in range(len(keys)):
        ei = np.int64(exponents[m, vi])
        ej = np.int64(exponents[m, vj])
        factor = ei * (ej - 1) if vi == vj else ei * ej
        if factor <= 0:
            continue
        key = keys[m] - (np.int64(1) << (bits * vi)) - (np.int64(1) << (bits * vj))
        if da >= 0:
            ea = np.int64(exponents[m, da])
            if da == vi:
                ea -= 1
            if da == vj:
                ea -= 1
            if ea <= 0:
                continue
            factor *= ea
            key -= np.int64(1) << (bits * da)
        place = np.searchsorted(row_keys, key + term_key)
        if place >= len(row_keys) or row_keys[place] != key + term_key:
            continue
        row = row_order[place]
        if fill:
            columns[counts[row]] = base + m
            total = np.uint64(0)
            for _ in range(factor):  # factor is at most a few dozen
                total += term_value
                if total >= prime:
                    total -= prime
            values[counts[row]] = total
        counts[row] += 1


@dataclass(slots=True)
class Prolongation:
    """The echelon form of all rows up to `order`, columns in ascending degree of g.

    `blocks[d]` holds the exponents of the unknowns of degree d + 2 in L (degree d in g).
    """

    local: LocalSystem
    echelon: Echelon
    order: int = -1
    equations: list[Equation] = field(default_factory=list)
    blocks: list[Exponents] = field(default_factory=list)
    row_blocks: list[tuple[int, Exponents]] = field(default_factory=list)

    @property
    def size(self) -> int:
        return self.local.ring.size

    @property
    def first_velocity(self) -> int:
        return self.local.offset + self.local.dimension

    def width(self, degree: int) -> int:
        """The number of unknowns of g of degree <= `degree`."""
        return sum(len(block) for block in self.blocks[: degree + 1])

    def dimension(self, degree: int) -> int:
        """D_degree(order): the dimension of the projection of the solutions to degrees <= degree."""
        width = self.width(degree)
        return width - self.echelon.rank_within(width)

    def row_name(self, number: int) -> RowName:
        """The name of an original row."""
        for equation, exponents in self.row_blocks:
            if number < len(exponents):
                found = self.equations[equation]
                return (found.kind, found.i, found.j, tuple(int(e) for e in exponents[number]))
            number -= len(exponents)
        raise IndexError("no such row")


def start(local: LocalSystem) -> Prolongation:
    """No rows yet; `advance` makes order 0, 1, …"""
    return Prolongation(local, Echelon(local.ring.prime), equations=equations(local))


def unknown_block(prolongation: Prolongation, degree: int) -> Exponents:
    """Exponents of the unknowns of degree `degree` in g: total degree + 2, v-degree >= 2."""
    table = exponents_of_degree(prolongation.size, degree + 2)
    kept: Exponents = table[table[:, prolongation.first_velocity :].sum(axis=1) >= 2]
    return kept


def advance(prolongation: Prolongation) -> None:
    """One order more: the rows of H2 of degree r - 1 and of H3 of degree r."""
    prolongation.order += 1
    order = prolongation.order
    prolongation.blocks.append(unknown_block(prolongation, order))
    prolongation.echelon.widen(prolongation.width(order))
    for kind, degree in (("H2", order - 1), ("H3", order)):
        for number, equation in enumerate(prolongation.equations):
            if equation.kind == kind and degree >= 0:
                _insert(prolongation, number, equation, degree)


def _insert(prolongation: Prolongation, number: int, equation: Equation, degree: int) -> None:
    """Insert the rows of one equation with |alpha| = degree."""
    monomials = MonomialKeys(prolongation.size)
    exponents = exponents_of_degree(prolongation.size, degree)
    keys = keys_of(monomials, exponents)
    order = np.argsort(keys)
    rows = (keys[order], order.astype(np.int64))
    bits, prime = monomials.bits, np.uint64(prolongation.local.ring.prime)
    counts = np.zeros(len(keys) + 1, np.int64)
    none = (np.empty(0, np.int64), np.empty(0, np.uint64))
    for part in _pieces(prolongation, equation, degree):
        _emit(False, *part[:7], *rows, bits, prime, counts, *none, part[7])
    starts = np.concatenate([[0], np.cumsum(counts[:-1])]).astype(np.int64)
    columns, values = np.empty(starts[-1], np.int64), np.empty(starts[-1], np.uint64)
    cursor = starts.copy()
    for part in _pieces(prolongation, equation, degree):
        _emit(True, *part[:7], *rows, bits, prime, cursor, columns, values, part[7])
    prolongation.echelon.insert(starts, columns, values)
    prolongation.row_blocks.append((number, exponents))


Piece = tuple[Integers, Exponents, np.int64, np.uint64, int, int, int, int]


def _pieces(prolongation: Prolongation, equation: Equation, degree: int) -> Iterator[Piece]:
    """(keys, exponents, term key, term value, v_i, v_j, a, first column) of all products in the rows."""
    monomials = MonomialKeys(prolongation.size)
    first = prolongation.first_velocity
    for term in equation.terms:
        shift = 0 if term.derivative == _NO_DERIVATIVE else 1
        for component_degree, component in enumerate(term.series[: degree + 1]):
            wanted = degree - component_degree + shift
            if wanted >= len(prolongation.blocks) or not component:
                continue
            block = prolongation.blocks[wanted]
            keys = keys_of(monomials, block)
            base = prolongation.width(wanted - 1) if wanted else 0
            for exponents, value in component.to_dict().items():
                key = np.int64(monomials.key(exponents))
                yield keys, block, key, np.uint64(int(value)), first + term.i, first + term.j, term.derivative, base


