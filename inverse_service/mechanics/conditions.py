"""The tensors N, Phi, nabla Phi, R of the inverse problem, over any commutative ring with the
derivations of a system.

    Gamma = d/dt + v^i d/dq^i + f^i d/dv^i
    N     = -1/2 df/dv
    Phi   = Gamma(df/dv) - 2 df/dq - 1/2 (df/dv)(df/dv)
    nabla T^i_j  = Gamma(T^i_j)  + N^i_m T^m_j  - T^i_m N^m_j
    nabla T^i_kl = Gamma(T^i_kl) + N^i_m T^m_kl - T^i_ml N^m_k - T^i_km N^m_l
    R[T]^i_kl    = dT^i_k/dv^l - dT^i_l/dv^k                                     (R = R[Phi])

They are exact expressions for display, with what follows where they leave one matrix, or power
series about a point (`tensor_series`). Source: J. Douglas, Solution of the inverse problem of the
calculus of variations, 1941; W. Sarlet, The Helmholtz conditions revisited, 1982; the sign of N in
nabla is that of the definition of N here.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Generic, NamedTuple, Protocol, Self, TypeVar

import numpy as np
import numpy.typing as npt

from inverse_service import bounds, deadline
from inverse_service.expressions import tree as ex
from inverse_service.field import dense_series, exact_field, matrices, modular
from inverse_service.mechanics.second_order_system import SecondOrderSystem

Matrix = tuple[tuple[ex.Expression, ...], ...]
TIME_LIMIT = 2.0


class Scalar(Protocol):
    """An element of a commutative algebra over Q."""

    def __add__(self, other: Self, /) -> Self: ...

    def __sub__(self, other: Self, /) -> Self: ...

    def __mul__(self, other: Self, /) -> Self: ...

    def scaled(self, factor: int | Fraction) -> Self: ...

    @property
    def is_zero(self) -> bool: ...


S = TypeVar("S", bound=Scalar)
Tensor11 = tuple[tuple[S, ...], ...]
Tensor12 = tuple[tuple[tuple[S, ...], ...], ...]


@dataclass(frozen=True, slots=True)
class Motion(Generic[S]):
    """The accelerations f^i and the derivations by q^i, by v^i and along the motion (Gamma)."""

    accelerations: tuple[S, ...]
    by_coordinate: tuple[Callable[[S], S], ...]
    by_velocity: tuple[Callable[[S], S], ...]
    along: Callable[[S], S]
    zero: S

    @property
    def size(self) -> int:
        return len(self.accelerations)


def total(zero: S, terms: Sequence[S]) -> S:
    """The sum."""
    result = zero
    for term in terms:
        if not term.is_zero:
            result = result + term
    return result


def _times(motion: Motion[S], left: S, right: S) -> S:
    return motion.zero if left.is_zero or right.is_zero else left * right


def product(motion: Motion[S], left: Tensor11[S], right: Tensor11[S]) -> Tensor11[S]:
    """The matrix product, shape (n, n)."""
    span = range(motion.size)

    def entry(i: int, j: int) -> S:
        return total(motion.zero, [_times(motion, left[i][m], right[m][j]) for m in span])

    return tuple(tuple(entry(i, j) for j in span) for i in span)


def velocity_slopes(motion: Motion[S]) -> Tensor11[S]:
    """df^i/dv^j, shape (n, n)."""
    return tuple(tuple(by(f) for by in motion.by_velocity) for f in motion.accelerations)


def connection(motion: Motion[S]) -> Tensor11[S]:
    """N^i_j = -1/2 df^i/dv^j, shape (n, n)."""
    return tuple(
        tuple(entry.scaled(Fraction(-1, 2)) for entry in row) for row in velocity_slopes(motion)
    )


def jacobi_endomorphism(motion: Motion[S]) -> Tensor11[S]:
    """Phi^i_j, shape (n, n); the Jacobi endomorphism as in MBF, twice -df/dq - N N - Gamma(N)."""
    slopes, span = velocity_slopes(motion), range(motion.size)
    square = product(motion, slopes, slopes)

    def entry(i: int, j: int) -> S:
        rest = motion.by_coordinate[j](motion.accelerations[i]).scaled(2) + square[i][j].scaled(
            Fraction(1, 2)
        )
        return motion.along(slopes[i][j]) - rest

    return tuple(tuple(entry(i, j) for j in span) for i in span)


def nabla(motion: Motion[S], n: Tensor11[S], tensor: Tensor11[S]) -> Tensor11[S]:
    """nabla T = Gamma(T) + N T - T N, shape (n, n)."""
    span, plus, minus = range(motion.size), product(motion, n, tensor), product(motion, tensor, n)
    return tuple(
        tuple(motion.along(tensor[i][j]) + plus[i][j] - minus[i][j] for j in span) for i in span
    )


def nabla_of_curvature(motion: Motion[S], n: Tensor11[S], tensor: Tensor12[S]) -> Tensor12[S]:
    """nabla T^i_kl for T antisymmetric in k, l, shape (n, n, n).

    If g solves (H2), Gamma(g) = g N + (g N)^T, and g_ij T^j_kl + cyclic = 0, then Gamma of this is
    g_ij (nabla T)^j_kl + cyclic = 0: the terms of N with a lower index cancel in pairs.
    """
    span = range(motion.size)

    def entry(i: int, k: int, m: int) -> S:
        plus = total(
            motion.along(tensor[i][k][m]), [_times(motion, n[i][j], tensor[j][k][m]) for j in span]
        )
        minus = [_times(motion, tensor[i][j][m], n[j][k]) for j in span]
        minus += [_times(motion, tensor[i][k][j], n[j][m]) for j in span]
        return plus - total(motion.zero, minus)

    return antisymmetric(motion, entry)


def curvature(motion: Motion[S], tensor: Tensor11[S]) -> Tensor12[S]:
    """R[T]^i_kl = dT^i_k/dv^l - dT^i_l/dv^k, shape (n, n, n)."""
    by = motion.by_velocity
    return antisymmetric(motion, lambda i, k, m: by[m](tensor[i][k]) - by[k](tensor[i][m]))


def antisymmetric(motion: Motion[S], entry: Callable[[int, int, int], S]) -> Tensor12[S]:
    """The tensor T^i_kl = -T^i_lk with these entries for k < l."""
    span = range(motion.size)
    zero = motion.zero
    known = {(i, k, m): entry(i, k, m) for i in span for k in span for m in span if k < m}

    def read(i: int, k: int, m: int) -> S:
        if k == m:
            return zero
        return known[i, k, m] if k < m else zero - known[i, m, k]

    return tuple(tuple(tuple(read(i, k, m) for m in span) for k in span) for i in span)


@dataclass(frozen=True, slots=True)
class Tensors:
    """N, Phi, nabla_Phi, R (R[j][k][l] = R^j_kl); None where `reason` says why it was left out."""

    N: Matrix | None = None
    Phi: Matrix | None = None
    nabla_Phi: Matrix | None = None
    R: tuple[Matrix, ...] | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class MotionInRing:
    """The ring of a system's formulas, and its motion over that ring."""

    ring: exact_field.ExactRing
    motion: Motion[exact_field.Quotient]


def motion_in_ring(
    system: SecondOrderSystem,
    orders: int,
    budget: exact_field.Budget,
    further: Sequence[ex.Symbol] = (),
    trees: Sequence[ex.Expression] = (),
) -> MotionInRing:
    """The system over an exact ring that allows `orders` derivations of f.

    The ring also holds the constants `further` and the formulas `trees`. Raises TooLarge
    (with the reason) and ZeroDivisionError, as the ring does.
    """
    coordinates = [ex.Symbol(name) for name in system.coordinates]
    velocities = [ex.Velocity(name) for name in system.coordinates]
    n = len(coordinates)
    ring = exact_field.exact_ring(
        [*system.accelerations, *trees],
        [ex.TIME, *coordinates, *velocities],
        orders,
        budget,
        further,
    )
    accelerations = tuple(ring.value(f) for f in system.accelerations)
    along = ring.along([ring.constant(1), *(ring.atoms[v] for v in velocities), *accelerations])
    partials = tuple(ring.partial(index) for index in range(1, 2 * n + 1))
    motion = Motion(accelerations, partials[:n], partials[n:], along, ring.constant(0))
    return MotionInRing(ring, motion)


def conditions(system: SecondOrderSystem, time_limit: float = TIME_LIMIT) -> Tensors:
    """N, Phi, nabla Phi and R.

    A tensor of more than `bounds.TERMS` terms, and all after it, is left out.
    """
    found = Tensors()
    try:
        exact = motion_in_ring(
            system, 3, exact_field.Budget(bounds.TERMS, deadline.now() + time_limit)
        )
        n = connection(exact.motion)
        found = replace(found, N=matrix_trees(exact.ring, n))
        phi = jacobi_endomorphism(exact.motion)
        found = replace(found, Phi=matrix_trees(exact.ring, phi))
        found = replace(found, nabla_Phi=matrix_trees(exact.ring, nabla(exact.motion, n, phi)))
        bend = curvature(exact.motion, phi)
        return replace(found, R=tuple(matrix_trees(exact.ring, part) for part in bend))
    except exact_field.TooLarge as error:
        missing = next(
            name for name in ("N", "Phi", "nabla_Phi", "R") if getattr(found, name) is None
        )
        return replace(
            found, reason=f"{missing.replace('_', ' ')} and everything after it is omitted: {error}"
        )
    except ZeroDivisionError as error:
        return replace(found, reason=f"the equations cannot be differentiated: {error}")


def matrix_trees(
    ring: exact_field.ExactRing, matrix: tuple[tuple[exact_field.Quotient, ...], ...]
) -> Matrix:
    """Each entry as a tree; TooLarge where nobody would read them."""
    if sum(len(entry.numerator) for row in matrix for entry in row) > bounds.TERMS:
        raise exact_field.TooLarge(f"it has more than {bounds.TERMS} terms")
    return tuple(tuple(exact_field.quotient_tree(ring, entry) for entry in row) for row in matrix)


@dataclass(frozen=True, slots=True)
class FactorSlopes:
    """The derivatives of u, where a multiplier is g = e^u G: by v^k, along the motion, by q^k, and
    by t.
    """

    by_velocity: tuple[exact_field.Quotient, ...]
    along: exact_field.Quotient
    by_coordinate: tuple[exact_field.Quotient, ...]
    by_time: exact_field.Quotient


def factor_slopes(
    exact: MotionInRing,
    direction: Tensor11[exact_field.Quotient],
    rate: exact_field.Quotient | None = None,
) -> FactorSlopes:
    """Those that (H1) and (H2) give for a regular G, shape (n, n), n > 1; ZeroDivisionError where
    it is singular.

    `rate` is Gamma(u) where it is known, else it is taken from one entry of G.

    u_(v^k) = mu_k = -sum_i (G^-1)^(ji) (dG_ij/dv^k - dG_ik/dv^j)   for any j other than k
    Gamma(u) = a                   a G = G N + (G N)^T - Gamma(G)
    u_(q^k) = nu_k = da/dv^k - Gamma(mu_k) - (df^m/dv^k) mu_m
    u_t     = tau  = a - v^k nu_k - f^k mu_k

    The third follows from [d/dv^k, Gamma] = d/dq^k + (df^m/dv^k) d/dv^m.
    """
    motion, span, zero = exact.motion, range(exact.motion.size), exact.motion.zero
    by, mu = motion.by_velocity, list[exact_field.Quotient]()
    for k in span:
        j = 0 if k else 1
        inverse = matrices.solve_square(direction, [exact.ring.constant(int(i == j)) for i in span])
        if inverse is None:
            raise ZeroDivisionError("the matrix is singular")
        mu.append(
            total(
                zero, [inverse[i] * (by[j](direction[i][k]) - by[k](direction[i][j])) for i in span]
            )
        )
    a = _rate_by_entry(exact, direction) if rate is None else rate
    slopes = [[by[k](f) for f in motion.accelerations] for k in span]
    nu = [by[k](a) - motion.along(mu[k]) - matrices.dot(zero, slopes[k], mu) for k in span]
    speeds = [exact.ring.atoms[v] for v in exact.ring.variables[1 + motion.size :]]
    tau = a - matrices.dot(zero, speeds, nu) - matrices.dot(zero, motion.accelerations, mu)
    return FactorSlopes(tuple(mu), a, tuple(nu), tau)


def _rate_by_entry(
    exact: MotionInRing, direction: Tensor11[exact_field.Quotient]
) -> exact_field.Quotient:
    """a of a G = G N + (G N)^T - Gamma(G), from the first entry of G that is not zero."""
    motion, half = exact.motion, connection(exact.motion)
    span = range(motion.size)
    i, j = next((i, j) for i in span for j in span if not direction[i][j].is_zero)
    turned = [direction[i][m] * half[m][j] + direction[j][m] * half[m][i] for m in span]
    rest = exact_field.sum_of(motion.zero, turned) - motion.along(direction[i][j])
    return rest / direction[i][j]


def rate_by_trace(
    exact: MotionInRing, direction: Tensor11[exact_field.Quotient]
) -> exact_field.Quotient:
    """a of a G = G N + (G N)^T - Gamma(G), as (2 tr N - Gamma(det G)/det G)/n: its only divisor is
    det G, so it holds for all members of a family for which G is regular. An entry of G may vanish
    for some of them.
    """
    motion, half = exact.motion, connection(exact.motion)
    whole = matrices.determinant(direction, exact.ring.constant(1))
    trace = exact_field.sum_of(motion.zero, (half[i][i] for i in range(motion.size)))
    rest = trace.scaled(2) - motion.along(whole) / whole
    return rest.scaled(Fraction(1, motion.size))


def one_matrix(
    system: SecondOrderSystem,
) -> tuple[Matrix, tuple[tuple[ex.Expression, ex.Expression], ...]] | None:
    """(G, (variable, du by it), …) where g T = (g T)^T for T = Phi, nabla Phi leaves one matrix, g
    = e^u G.

    The derivatives by q, v, and t that are 0 are left out. None where more matrices are left, or a
    formula is too large.
    """
    n = len(system.coordinates)
    places = list(itertools.combinations_with_replacement(range(n), 2))
    try:
        exact = motion_in_ring(
            system, 6, exact_field.Budget(10 * bounds.TERMS, deadline.now() + TIME_LIMIT)
        )
        ring, motion = exact.ring, exact.motion
        phi = jacobi_endomorphism(motion)
        tensors, columns = (
            (phi, nabla(motion, connection(motion), phi)),
            list[list[exact_field.Quotient]](),
        )
        for place in places:
            unit = tuple(
                tuple(ring.constant((min(i, j), max(i, j)) == place) for j in range(n))
                for i in range(n)
            )
            products = [product(motion, unit, tensor) for tensor in tensors]
            columns.append(
                [
                    p[i][j] - p[j][i]
                    for p in products
                    for i, j in itertools.combinations(range(n), 2)
                ]
            )
        found = list(
            matrices.null_space(
                list(zip(*columns, strict=True)), len(places), ring.constant(1)
            ).values()
        )
        if len(found) != 1:
            return None
        entries = dict(zip(places, found[0], strict=True))
        g = tuple(tuple(entries[min(i, j), max(i, j)] for j in range(n)) for i in range(n))
        of = factor_slopes(exact, g)
        slopes, coordinates = [*of.by_coordinate, *of.by_velocity, of.by_time], system.coordinates
        names: list[ex.Expression] = [
            *map(ex.Symbol, coordinates),
            *map(ex.Velocity, coordinates),
            ex.TIME,
        ]
        pairs = zip(names, slopes, strict=True)
        return matrix_trees(ring, g), tuple(
            (x, exact_field.quotient_tree(ring, u)) for x, u in pairs if not u.is_zero
        )
    except (exact_field.TooLarge, ZeroDivisionError):
        return None


class TensorSeries(NamedTuple):
    """The program of the series of X, N, and Phi about a point, and their registers in this
    order.
    """

    program: dense_series.SeriesProgram
    field: tuple[dense_series.Series, ...]
    tensors: tuple[Tensor11[dense_series.Series], ...]
    registers: npt.NDArray[np.int64]


def tensor_series(
    variables: Sequence[modular.Variable], forces: Sequence[ex.Expression], order: int
) -> TensorSeries:
    """The program for f to order D at most in (t?, q, v), Phi to order D - 2; TooLarge if it needs
    too much memory.
    """
    program, field, motion = motion_of_series(variables, forces, order)
    tensors = connection(motion), jacobi_endomorphism(motion)
    entries = [entry for tensor in tensors for row in tensor for entry in row]
    registers = np.array([series.register for series in (*field, *entries)], np.int64)
    return TensorSeries(program, field, tensors, registers)


class SeriesMotion(NamedTuple):
    """The program of X, X in series, and the motion with it."""

    program: dense_series.SeriesProgram
    field: tuple[dense_series.Series, ...]
    motion: Motion[dense_series.Series]


def motion_of_series(
    variables: Sequence[modular.Variable], forces: Sequence[ex.Expression], order: int
) -> SeriesMotion:
    """The program, X, and the motion about a point, for series to this order in the displacements
    (t?, q, v).
    """
    program, size, n = dense_series.SeriesProgram(variables, order), len(variables), len(forces)
    rates = [*[ex.ONE] * (size - 2 * n), *variables[size - n :], *forces]
    field = tuple(dense_series.series_of(program, rate) for rate in rates)

    def partial(place: int) -> Callable[[dense_series.Series], dense_series.Series]:
        return lambda series: series.derivative(place)

    def along(series: dense_series.Series) -> dense_series.Series:
        return dense_series.derivative_along(enumerate(field), series)

    partials = tuple(map(partial, range(size)))[size - 2 * n :]
    motion = Motion(
        field[size - n :], partials[:n], partials[n:], along, dense_series.Series(program)
    )
    return SeriesMotion(program, field, motion)


class TensorValues(NamedTuple):
    """N and Phi at a point, each (n, n)."""

    N: list[list[int]]
    Phi: list[list[int]]


def tensors_after(series: TensorSeries, found: dense_series.Registers) -> TensorValues:
    """N and Phi at the point of a run."""
    N, Phi = (
        [[found.value(entry.register) for entry in row] for row in tensor]
        for tensor in series.tensors
    )
    return TensorValues(N, Phi)
