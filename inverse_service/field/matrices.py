"""Linear algebra over an exact field, with numbers, and modulo a prime: null vectors, solutions,
definite matrices.

`null_vectors` finds linear relations with constant coefficients among elements of a ring. Constants
are numbers and elements that depend on no variable of the ring: parameters and their functions and
roots. The coefficient of each product of the other generators gives one linear equation for the
coefficients, over the field of constants.

`definite_or_orthogonal`: a linear space of symmetric matrices has no definite element exactly if
some Y >= 0, not 0, has tr(Y w) = 0 for all w of the space. An interior point method for max {s :
sum c_k w_k - s >= 0, |c| <= 1} approaches a w with s > 0 or, if s = 0, the Y of largest rank (Y =
mu (sum c_k w_k - s)^-1 on the central path). It only proposes: w, or Y on the face of its own
kernel (facial reduction), is rounded to fractions inside its space and tested exactly.

Modulo a prime, a common factor of all entries does not matter, so matrices may be in Montgomery
form. Bases are in reduced form: the last column of each vector has the entry 1, and 0 in all other
vectors.
"""

import random
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement
from typing import cast

import numpy as np
from flint import fmpq, fmpq_mat, fmpq_mpoly, fmpz_mat, nmod_mat
from numpy.typing import NDArray

from inverse_service import bounds, deadline
from inverse_service.expressions import minors
from inverse_service.field import elimination, modular
from inverse_service.field.echelon import Words
from inverse_service.field.exact_field import ExactRing, Quotient, coefficients_of, sum_of

Row = list[Quotient]
Matrix = tuple[tuple[Fraction, ...], ...]
Floats = NDArray[np.float64]
MOST = 8  # rows
_ROUNDING = (1, 2, 6, 60, 1_000, 100_000, 10**8)
_STEPS, _FINEST, _SHRINK = 40, 1e-9, 0.2
_SOON, _INSIDE = 1e-3, 0.05
_SMALL = 1e-4  # relative to the largest eigenvalue; smaller ones of Y go to zero with mu
Numbers = NDArray[np.int64]
# The number of equations minus the number of unknowns; a random equation is satisfied by accident
# with probability 1/P, P the prime.
SPARE = 12


@dataclass(frozen=True, slots=True)
class ReducedRows:
    """Rows with a leading 1 in the columns `pivots`.

    `dropped` are the given rows that became zero in the reduced columns, each as (row, its
    remainder).
    """

    rows: tuple[tuple[Quotient, ...], ...]
    pivots: tuple[int, ...]
    dropped: tuple[tuple[int, tuple[Quotient, ...]], ...]


def weight(element: Quotient) -> int:
    """The length of an element when printed."""
    return len(element.numerator) + sum(
        len(element.field.denominators[index]) for index, _ in element.exponents
    )


def dot(zero: Quotient, left: Sequence[Quotient], right: Sequence[Quotient]) -> Quotient:
    """The sum of left_i right_i."""
    return sum_of(
        zero, [a * b for a, b in zip(left, right, strict=True) if not (a.is_zero or b.is_zero)]
    )


def reduced_rows(rows: Sequence[Sequence[Quotient]], columns: Sequence[int]) -> ReducedRows:
    """Gauss-Jordan elimination in the given columns, in their order; other columns are carried
    along.
    """
    table = [(place, list(row)) for place, row in enumerate(rows)]
    done: list[tuple[int, Row]] = []
    for column in columns:
        candidates = [item for item in table if not item[1][column].is_zero]
        if not candidates:
            continue
        source, row = min(candidates, key=lambda item: weight(item[1][column]))
        table.remove((source, row))
        inverse = row[column].inverse()
        row = [entry * inverse for entry in row]
        table = [(place, _cleared(other, row, column)) for place, other in table]
        done = [(pivot, _cleared(other, row, column)) for pivot, other in done]
        done.append((column, row))
    return ReducedRows(
        tuple(tuple(row) for _, row in done),
        tuple(pivot for pivot, _ in done),
        tuple((place, tuple(row)) for place, row in table),
    )


def _cleared(row: Row, pivot_row: Row, column: int) -> Row:
    """row - row[column] * pivot_row."""
    head = row[column]
    if head.is_zero:
        return row
    return [a if b.is_zero else a - head * b for a, b in zip(row, pivot_row, strict=True)]


def solve_square(
    matrix: Sequence[Sequence[Quotient]], right: Sequence[Quotient]
) -> tuple[Quotient, ...] | None:
    """x with matrix x = right; None if the matrix is singular."""
    size = len(matrix)
    found = reduced_rows(
        [[*row, value] for row, value in zip(matrix, right, strict=True)], range(size)
    )
    if len(found.pivots) < size:
        return None
    return tuple(
        row[size]
        for _, row in sorted(zip(found.pivots, found.rows, strict=True), key=lambda item: item[0])
    )


def inverse(matrix: Sequence[Sequence[Quotient]], one: Quotient) -> list[list[Quotient]] | None:
    """The inverse; None if the matrix is singular."""
    size, zero = len(matrix), one - one
    units = [[one if i == j else zero for j in range(size)] for i in range(size)]
    found = reduced_rows(
        [[*row, *unit] for row, unit in zip(matrix, units, strict=True)], range(size)
    )
    return [list(row[size:]) for row in found.rows] if len(found.pivots) == size else None


def determinant(matrix: Sequence[Sequence[Quotient]], one: Quotient) -> Quotient:
    """The determinant, by minors."""
    return minors.by_minors(
        matrix,
        one,
        lambda entry: entry.is_zero,
        lambda terms: sum_of(one - one, [(a if sign > 0 else -a) * b for sign, a, b in terms]),
    )


def null_vectors(ring: ExactRing, columns: Sequence[Sequence[Quotient]]) -> list[list[Quotient]]:
    """A basis of the constants c with sum_k c_k columns[k] = 0, entry by entry."""
    return list(null_space(_equations(ring, columns), len(columns), ring.constant(1)).values())


def null_space(
    rows: Sequence[Sequence[Quotient]], size: int, one: Quotient
) -> dict[int, list[Quotient]]:
    """A basis of the vectors orthogonal to all rows, by free column, which is nonzero in its own
    vector only.
    """
    zero, found = one - one, _reduced_numbers(rows, size, one)
    steps = (
        _triangular(rows, range(size))
        if found is None
        else list(zip(found.pivots, found.rows, strict=True))
    )
    pivots, basis = {pivot for pivot, _ in steps}, dict[int, list[Quotient]]()
    for free in (k for k in range(size) if k not in pivots):
        vector = [one if k == free else zero for k in range(size)]
        for pivot, row in reversed(steps):
            others = row[pivot + 1 :], vector[pivot + 1 :]
            vector[pivot] = zero - (dot(zero, *others) if found is None else row[free])
        basis[free] = vector
    return basis


def _triangular(
    rows: Sequence[Sequence[Quotient]], columns: Sequence[int]
) -> list[tuple[int, Sequence[Quotient]]]:
    """Rows with the same solutions, each with its pivot column, where it is 1 and the later ones
    are 0: less work than reduced rows where most entries are 0.
    """
    table, done = [list(row) for row in rows], list[tuple[int, Sequence[Quotient]]]()
    for column in columns:
        candidates = [row for row in table if not row[column].is_zero]
        if not candidates:
            continue
        row = min(
            candidates, key=lambda one: (weight(one[column]), sum(not a.is_zero for a in one))
        )
        inverse = row[column].inverse()
        lead = [entry if entry.is_zero else entry * inverse for entry in row]
        table = [_cleared(other, lead, column) for other in table if other is not row]
        done.append((column, lead))
    return done


def _reduced_numbers(
    rows: Sequence[Sequence[Quotient]], size: int, one: Quotient
) -> ReducedRows | None:
    """The reduced rows computed as a matrix of rational numbers; None if some entry is not a
    rational number.
    """
    values = [[entry.constant_value for entry in row] for row in rows]
    known = [[value for value in row if value is not None] for row in values]
    if any(len(row) < size for row in known):
        return None
    found = echelon_of(known, size)
    return ReducedRows(
        tuple(tuple(map(one.scaled, line)) for _, line in found), tuple(k for k, _ in found), ()
    )


def solution(
    ring: ExactRing, columns: Sequence[Sequence[Quotient]], right: Sequence[Quotient]
) -> list[Quotient] | None:
    """Constants c with sum_k c_k columns[k] = right, free ones 0; None if there are none."""
    size = len(columns)
    found = reduced_rows(_equations(ring, [*columns, right]), range(size + 1))
    if size in found.pivots:
        return None
    values = dict(zip(found.pivots, found.rows, strict=True))
    return [values[k][size] if k in values else ring.constant(0) for k in range(size)]


def numerators(ring: ExactRing, elements: Iterable[Quotient]) -> list[fmpq_mpoly]:
    """The elements times the least common multiple of their denominators, as polynomials.

    Numerators are multiplied by the missing factors, because with r^2 = x^2 + y^2 trial division
    does not see that (r + x^2 + y^2)/(r + 1) is r.
    """
    elements, greatest = list(elements), Counter[int]()
    for element in elements:
        greatest |= Counter(dict(element.exponents))
    missing = [greatest - Counter(dict(element.exponents)) for element in elements]
    return [
        ring.field.product(element.numerator, ring.field.expand(tuple(sorted(lacks.items()))))
        for element, lacks in zip(elements, missing, strict=True)
    ]


def _equations(ring: ExactRing, columns: Sequence[Sequence[Quotient]]) -> list[list[Quotient]]:
    varying = sorted({index for table in ring.images for index in table})
    zero, rows = ring.constant(0), list[Row]()
    for entries in zip(*columns, strict=True):
        parts: defaultdict[tuple[int, ...], Row] = defaultdict(lambda: [zero] * len(columns))
        for k, numerator in enumerate(numerators(ring, entries)):
            for powers, part in coefficients_of(numerator, varying).items():
                parts[powers][k] = Quotient(ring.field, part, ())
        rows += parts.values()
    return rows


def definite_or_orthogonal(
    space: Sequence[Matrix], size: int
) -> tuple[Matrix | None, Matrix | None]:
    """(w, None) with w definite in the space, (None, Y) with Y orthogonal to it, (None, None) if
    rounding fails.
    """
    space = [w for w in space if any(map(any, w))]
    if not space:
        return None, _matrix([1 if i == j else 0 for i, j in _places(size)], size)
    try:
        with np.errstate(all="ignore"):
            for member, orthogonal in _central_path(np.array(space, float)):
                for w in _rounded(member, space, size) if np.linalg.eigvalsh(member)[0] > 0 else ():
                    if rank_if_semidefinite(w) == size:
                        return w, None
                for y in _on_faces(orthogonal, space, size):
                    if rank_if_semidefinite(y):
                        return None, y
    except np.linalg.LinAlgError:
        pass
    return None, None


def definite_weights(space: Sequence[Floats]) -> list[float] | None:
    """Weights of a definite sum, far from singular ones; None if none is found."""
    sizes = [float(np.abs(w).max()) for w in space]
    units = np.array([w / size for w, size in zip(space, sizes, strict=True)])
    with np.errstate(all="ignore"), suppress(np.linalg.LinAlgError):
        for member, _ in _central_path(units):
            if np.linalg.eigvalsh(member)[0] > 0:
                weights = np.linalg.lstsq(
                    units.reshape(len(units), -1).T, member.ravel(), rcond=None
                )[0]
                return [float(w) / size for w, size in zip(weights, sizes, strict=True)]
    return None


def rank_if_semidefinite(matrix: Sequence[Sequence[Fraction]]) -> int | None:
    """The rank by symmetric elimination; None if a pivot is negative, or zero in a nonzero row."""
    rows, rank = [list(row) for row in matrix], 0
    for k, row in enumerate(rows):
        if row[k] < 0 or (not row[k] and any(row[k:])):
            return None
        rank += row[k] > 0
        for other in rows[k + 1 :] if row[k] else ():
            factor = other[k] / row[k]
            other[:] = [a - factor * b for a, b in zip(other, row, strict=True)]
    return rank


def _central_path(space: Floats) -> Iterator[tuple[Floats, Floats]]:
    """(sum c_k w_k, Y) on the path of max s/mu + log det(sum c_k w_k - s) + log(1 - |c|^2), early
    and at its end.

    w_k are an orthonormal basis of the space.
    """
    flat = space.reshape(len(space), -1)
    _, lengths, units = np.linalg.svd(flat / np.abs(flat).max(axis=1)[:, None], full_matrices=False)
    basis = units[lengths > 1e-10 * lengths[0]].reshape(-1, *space.shape[1:])
    m, n, _ = basis.shape
    x, mu = np.append(np.zeros(m), -1.0), 1.0
    directions = np.concatenate([basis, -np.eye(n)[None]])
    inverse = np.eye(n)
    while mu > _FINEST:
        for _ in range(_STEPS):
            inverse = np.linalg.inv(np.tensordot(x, directions, 1))
            turned = inverse @ directions
            room = 1 - x[:m] @ x[:m]
            gradient = np.trace(turned, axis1=1, axis2=2)
            gradient[:m] -= 2 * x[:m] / room
            gradient[m] += 1 / mu
            hessian = np.einsum("aij,bji->ab", turned, turned)
            hessian[:m, :m] += 2 * np.eye(m) / room + 4 * np.outer(x[:m], x[:m]) / room**2
            step = np.linalg.lstsq(hessian, gradient, rcond=1e-15)[0]
            decrement = max(float(gradient @ step), 0.0)
            step *= 1.0 if decrement < 0.05 else 1 / (1 + decrement**0.5)
            if decrement < 1e-6 or not _is_inside(x + step, directions):
                break
            x = x + step
        if x[m] > _INSIDE or mu < _SOON <= mu / _SHRINK or mu * _SHRINK <= _FINEST:
            yield np.tensordot(x[:m], basis, 1), mu * inverse
        mu *= _SHRINK


def _is_inside(x: Floats, directions: Floats) -> bool:
    return bool(x[:-1] @ x[:-1] < 1 and np.linalg.eigvalsh(np.tensordot(x, directions, 1))[0] > 0)


def _on_faces(y: Floats, space: Sequence[Matrix], size: int) -> Iterator[Matrix]:
    """Y rounded within the matrices orthogonal to the space that have Y's kernel, then within all
    orthogonal ones.
    """
    values, vectors = np.linalg.eigh(y / np.trace(y))
    rows = [[w[i][j] * (1 if i == j else 2) for i, j in _places(size)] for w in space]
    null = vectors[:, values < _SMALL * values[-1]].T
    for denominator in (12, 1_000) if len(null) else ():
        face = [
            [_at(v, i, j, r, size) for i, j in _places(size)]
            for v in _echelon(null, denominator)
            for r in range(size)
        ]
        yield from _rounded(
            y, [_matrix(k, size) for k in kernel([*rows, *face], len(rows[0]))], size
        )
    yield from _rounded(y, [_matrix(k, size) for k in kernel(rows, len(rows[0]))], size)


def _at(v: Sequence[Fraction], i: int, j: int, row: int, size: int) -> Fraction:
    """The coefficient of Y_ij in (Y v)_row."""
    return (v[j] if row == i else Fraction(0)) + (v[i] if row == j and i != j else Fraction(0))


def _echelon(vectors: Floats, denominator: int) -> list[list[Fraction]]:
    """A basis of the span in reduced echelon form, rounded."""
    rows, found = vectors.copy(), 0
    for column in range(rows.shape[1]):
        pivot = found + int(np.argmax(np.abs(rows[found:, column]))) if found < len(rows) else -1
        if pivot < 0 or abs(rows[pivot, column]) < 1e-3:
            continue
        rows[[found, pivot]] = rows[[pivot, found]]
        rows[found] /= rows[found, column]
        others = [k for k in range(len(rows)) if k != found]
        rows[others] -= np.outer(rows[others, column], rows[found])
        found += 1
    return [
        [Fraction(float(x)).limit_denominator(denominator) for x in row] for row in rows[:found]
    ]


def _rounded(near: Floats, space: Sequence[Matrix], size: int) -> Iterator[Matrix]:
    """Members of the space near a matrix, small denominators first."""
    if not space:
        return
    columns = np.array([[float(x) for row in w for x in row] for w in space]).T
    weights = np.linalg.lstsq(columns, near.ravel(), rcond=None)[0]
    largest = float(np.abs(weights).max()) or 1.0
    for d in _ROUNDING:
        short = [Fraction(round(float(c) / largest * d), d) for c in weights]
        entries = [
            sum((c * w[i][j] for c, w in zip(short, space, strict=True)), Fraction(0))
            for i, j in _places(size)
        ]
        yield _matrix(entries, size)


def echelon_of(rows: Sequence[Sequence[Fraction]], width: int) -> list[tuple[int, list[Fraction]]]:
    """The reduced echelon form: (column of the pivot, row with 1 in it)."""
    zero = Fraction(0)
    table = fmpq_mat(len(rows), width)
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            if entry:
                table[i, j] = fmpq(*entry.as_integer_ratio())
    reduced, rank = table.rref()
    found = [
        [Fraction(int(x.p), int(x.q)) if x else zero for x in row]
        for row in reduced.tolist()[:rank]
    ]
    return [(next(j for j, x in enumerate(row) if x), row) for row in found]


def kernel(rows: Sequence[Sequence[Fraction]], width: int) -> list[list[Fraction]]:
    """A basis of {x : rows x = 0}."""
    table = dict(echelon_of(rows, width))
    found = []
    for free in (j for j in range(width) if j not in table):
        vector = [Fraction(int(j == free)) for j in range(width)]
        for pivot, row in table.items():
            vector[pivot] = -row[free]
        found.append(vector)
    return found


def _places(size: int) -> list[tuple[int, int]]:
    return list(combinations_with_replacement(range(size), 2))


def _matrix(entries: Sequence[Fraction | int], size: int) -> Matrix:
    table = dict(zip(_places(size), entries, strict=True))
    return tuple(
        tuple(Fraction(table[min(i, j), max(i, j)]) for j in range(size)) for i in range(size)
    )


@dataclass(frozen=True, slots=True)
class Kernel:
    """A basis modulo the prime, (nullity, width), and the own column of each vector, where the
    others are 0.
    """

    prime: int
    basis: Words
    columns: tuple[int, ...]

    @property
    def nullity(self) -> int:
        return len(self.columns)

    def rational_vectors(self) -> list[dict[int, Fraction]]:
        """The vectors with small rational entries, as tables of the nonzero entries."""
        vectors = [_rational(row, self.prime) for row in self.basis.tolist()]
        return [vector for vector in vectors if vector is not None]


def _rational(row: list[int], prime: int) -> dict[int, Fraction] | None:
    vector: dict[int, Fraction] = {}
    for k, x in enumerate(row):
        if x:
            value = modular.reconstruct(x, prime, bounds.NUMBER)
            if value is None:
                return None
            vector[k] = value
    return vector


def leading_columns(reduced: nmod_mat, rank: int) -> list[int]:
    """The pivot columns of a reduced echelon form: they are not combinations of earlier columns."""
    found: list[int] = []
    for i in range(rank):
        first = found[-1] + 1 if found else 0
        found.append(next(k for k in range(first, reduced.ncols()) if int(reduced[i, k])))
    return found


def kernel_modulo(matrix: Words | Numbers, prime: int) -> Kernel:
    """The kernel of a matrix, (equations, unknowns)."""
    _check_work(*matrix.shape)
    form = elimination.echelon(_residues(matrix, prime), prime)
    return Kernel(prime, elimination.kernel(form), tuple(form.free))


def _residues(matrix: Words | Numbers, prime: int) -> Words:
    signed = matrix.dtype.kind == "i"
    return (matrix % prime).astype(np.uint64) if signed else cast(Words, matrix)


def null_rows(rows: Sequence[Sequence[int]], width: int, prime: int) -> list[list[int]]:
    """A basis of the vectors orthogonal to the rows."""
    found = kernel_of(nmod_mat(len(rows), width, [entry for row in rows for entry in row], prime))
    return [list(map(int, row)) for row in found.tolist()]


def matrix_of_rows(rows: Collection[Mapping[int, int]], width: int, prime: int) -> nmod_mat:
    """The matrix of rows given by their nonzero entries."""
    found = nmod_mat(max(len(rows), 1), width, prime)
    for i, row in enumerate(rows):
        for column, value in row.items():
            found[i, column] = value
    return found


def _check_work(rows: int, columns: int) -> None:
    """Charge the cost of an elimination, in units of the search."""
    deadline.check(1 + rows * columns // 100 + rows * columns * min(rows, columns) // 10_000)


def _over_field(matrix: Words | Numbers, prime: int) -> nmod_mat:
    rows, columns = matrix.shape
    _check_work(rows, columns)
    # Half as long as without the matrix of integers.
    return nmod_mat(fmpz_mat(int(rows), int(columns), matrix.ravel().tolist()), prime)


def random_null_vector(matrix: Words, prime: int, generator: random.Random) -> list[int]:
    """A random element of the kernel of a matrix, (equations, unknowns)."""
    reduced, rank = _over_field(matrix, prime).rref()
    leading, width = leading_columns(reduced, rank), reduced.ncols()
    vector = [generator.randrange(prime) for _ in range(width)]
    for pivot in leading:
        vector[pivot] = 0
    needed = (reduced * nmod_mat(width, 1, vector, prime)).entries()
    for pivot, value in zip(leading, needed, strict=False):
        vector[pivot] = -int(value) % prime
    return vector


def pivots(matrix: Words | Numbers, prime: int) -> list[int]:
    """The columns that are not combinations of earlier ones."""
    _check_work(*matrix.shape)
    return elimination.echelon(_residues(matrix, prime), prime).pivots


def kernel_of(matrix: nmod_mat) -> nmod_mat:
    """A basis of the kernel of a flint matrix, (nullity, width)."""
    vectors, nullity = matrix.nullspace()  # in the first columns, in the order of their own places
    chosen = nmod_mat(nullity, matrix.ncols(), matrix.modulus())
    for k in range(nullity):
        chosen[k, k] = 1
    return chosen * vectors.transpose()


def restricted(known: Kernel, matrix: Words) -> Kernel:
    """The vectors of a kernel that also satisfy more equations."""
    _check_work(*matrix.shape)
    further = elimination.products(matrix, known.basis, known.prime)
    if not further.any():
        return known
    form = elimination.echelon(further, known.prime)
    basis = elimination.products(elimination.kernel(form), known.basis.T, known.prime)
    return Kernel(known.prime, basis, tuple(known.columns[k] for k in form.free))


def settled_kernel(
    unknowns: int, equations: Callable[[int, int], Words], width: int, prime: int
) -> Kernel:
    """The kernel of the equations at enough samples that more samples do not shrink it.

    `equations(begin, end)` returns `width` equations for each of these samples.
    """
    taken = (unknowns + SPARE) // width + 1
    found = kernel_modulo(equations(0, taken), prime)
    while found.nullity:
        before, end = found.nullity, taken + (found.nullity + SPARE) // width + 1
        found, taken = restricted(found, equations(taken, end)), end
        if found.nullity == before:
            break
    return found
