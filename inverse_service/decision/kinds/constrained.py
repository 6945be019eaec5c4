"""Has any regular L the motion on a constraint manifold D among its solutions? Conditions on its 1-jet along D.

D: s^a' = w^a(t, q, u), q = (r, s), r' = u, u^alpha' = F^alpha(t, q, u), k free velocities u, m dependent s. With
L = l + lambda_a (s^a' - w^a) + …, l and lambda_a functions of (t?, q, u), x = (t?, q, u), X = (1, u, w, F),
Gamma = X^x d_x, X_alpha = d/dr^alpha + w^a_alpha d/ds^a, w^a_alpha = dw^a/du^alpha, the Euler-Lagrange equations
of L hold along the motion iff

    free_alpha     Gamma(dl/du^alpha) - X_alpha(l) + lambda_b (X_alpha(w^b) - Gamma(w^b_alpha))    k equations
    dependent_a    Gamma(lambda_a) - dl/ds^a + lambda_b dw^b/ds^a                                  m equations

vanish; L can be chosen regular iff [d2l/du du; dlambda/du] has rank k. (w linear in u gives the curvature: Prince,
Mestdag, Martin de Diego, arXiv:2606.05550; Barbero-Linan, Farre Puiggali, Martin de Diego, arXiv:1404.1961.)
m = 0 is the inverse problem itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from inverse_service.expressions.tree import Expression
from inverse_service.field import series_kernels as machine
from inverse_service.field.point import Variable
from inverse_service.field.series_program import Registers, SeriesProgram
from inverse_service.linear_pde.emission import NO_DERIVATIVE, Equations, LocalEquations, TermTable
from inverse_service.linear_pde.involution import Matrix
from inverse_service.linear_pde.unknowns import Function, Unknowns

Integers = npt.NDArray[np.int64]
# Of the tables of series: there are no sparse ones to fall back on, and positive answers take orders up to 12.
_MOST_PRODUCTS, _MOST_WORDS = 16_000_000, 40_000_000


@dataclass(frozen=True, slots=True)
class Shape:
    """k free and m dependent coordinates; x = (t?, r, s, u)."""

    free: int
    dependent: int
    with_time: bool

    @property
    def size(self) -> int:
        return self.with_time + 2 * self.free + self.dependent

    def r(self, alpha: int) -> int:
        return self.with_time + alpha

    def s(self, a: int) -> int:
        return self.with_time + self.free + a

    def u(self, alpha: int) -> int:
        return self.with_time + self.free + self.dependent + alpha

    # Registers: X, then w^a_alpha, the factors of lambda_b in free_alpha and in dependent_a, 1, and a spare one.
    def slope(self, a: int, alpha: int) -> int:
        return self.size + a * self.free + alpha

    def curvature(self, b: int, alpha: int) -> int:
        return self.size + (self.dependent + b) * self.free + alpha

    def gradient(self, a: int, b: int) -> int:
        return self.size + 2 * self.dependent * self.free + a * self.dependent + b

    @property
    def one(self) -> int:
        return self.gradient(self.dependent, 0)


@lru_cache(maxsize=64)
def unknowns_of(shape: Shape) -> Unknowns:
    """l, of which all first derivatives occur, then lambda_a."""
    functions = (Function(1), *[Function(0)] * shape.dependent)
    entries = [*((0, (x,)) for x in range(shape.size)), *((1 + a, ()) for a in range(shape.dependent))]
    return Unknowns(shape.size, functions, tuple(entries))


@lru_cache(maxsize=64)
def matrix_of(shape: Shape) -> Matrix:
    """[d2l/du du; dlambda/du], of rank k."""
    u = [shape.u(alpha) for alpha in range(shape.free)]
    upper = [tuple((0, (min(x, y), max(x, y))) for y in u) for x in u]
    lower = [tuple((1 + a, (y,)) for y in u) for a in range(shape.dependent)]
    return Matrix((*upper, *lower), shape.free)


@lru_cache(maxsize=64)
def regular_on_constraints(shape: Shape) -> Matrix:
    """d2l/du du alone."""
    return Matrix(matrix_of(shape).entries[: shape.free], shape.free)


def written(shape: Shape, variables: Sequence[Variable], field: Sequence[Expression], order: int) -> SeriesProgram:
    """X, less its component along t, and the coefficients for series to this order in the displacements of x."""
    series = SeriesProgram(variables, order, _MOST_PRODUCTS, _MOST_WORDS)
    series.register(shape.one + 2)
    series.write(machine.CONSTANT, shape.one)
    if shape.with_time:
        series.write(machine.CONSTANT, 0)
    for register, tree in enumerate(field, start=int(shape.with_time)):
        series.write(machine.ADD, register, series.expand(tree))
    _write_coefficients(shape, series, series.number(Fraction(-1)))
    return series


def _write_coefficients(shape: Shape, series: SeriesProgram, minus: int) -> None:
    last, m = shape.one + 1, range(shape.dependent)
    for b in m:
        for alpha in range(shape.free):
            series.write(machine.DERIVATIVE, shape.slope(b, alpha), shape.s(b), shape.u(alpha))
        for a in m:
            series.write(machine.DERIVATIVE, shape.gradient(a, b), shape.s(b), shape.s(a))
    for b in m:
        for alpha in range(shape.free):
            out = shape.curvature(b, alpha)
            series.write(machine.DERIVATIVE, last, shape.s(b), shape.r(alpha))
            series.instructions.append((machine.ADD, out, last, 0, 0, 2))
            for a in m:
                series.instructions.append((machine.PRODUCT, out, shape.slope(a, alpha), shape.gradient(a, b), 0, 2))
            for x in range(shape.size):
                series.write(machine.DERIVATIVE, last, shape.slope(b, alpha), x)
                series.instructions.append((machine.PRODUCT, out, x, last, minus, 2))


def compiled_equations(shape: Shape, prime: int, order: int, registers: Registers) -> LocalEquations:
    """Both kinds of equations, from the registers of `written`, for prolongation to this order."""
    unknowns = unknowns_of(shape)
    series = registers.coefficients(np.arange(shape.one + 1), order - 1)
    counts = (("free", shape.free), ("dependent", shape.dependent))
    tables = ((kind, count, TermTable(unknowns, count, series, _terms(kind, shape))) for kind, count in counts)
    blocks = (Equations(kind, tuple((k,) for k in range(count)), 1, table) for kind, count, table in tables)
    return LocalEquations(unknowns, prime, tuple(blocks))


@lru_cache(maxsize=64)
def _terms(kind: str, shape: Shape) -> Integers:
    """The summands as a `TermTable` has them: equation, series, sign, entry, derivative."""
    rows: list[tuple[int, int, int, int, int]] = []
    plain, multiplier = NO_DERIVATIVE, shape.size
    if kind == "free":
        for alpha in range(shape.free):
            rows += [(alpha, x, 0, shape.u(alpha), x) for x in range(shape.size)]
            rows += [(alpha, shape.one, 1, shape.r(alpha), plain)]
            rows += [(alpha, shape.slope(a, alpha), 1, shape.s(a), plain) for a in range(shape.dependent)]
            rows += [(alpha, shape.curvature(b, alpha), 0, multiplier + b, plain) for b in range(shape.dependent)]
    else:
        for a in range(shape.dependent):
            rows += [(a, x, 0, multiplier + a, x) for x in range(shape.size)]
            rows += [(a, shape.one, 1, shape.s(a), plain)]
            rows += [(a, shape.gradient(a, b), 0, multiplier + b, plain) for b in range(shape.dependent)]
    return np.array(rows, np.int64).reshape(-1, 5)
