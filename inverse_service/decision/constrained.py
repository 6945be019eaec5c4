"""Does a regular L have the motion on a constraint manifold D among its solutions? Conditions on
its 1-jet along D.

D: s^a' = w^a(t, q, u), q = (r, s), r' = u, u^alpha' = F^alpha(t, q, u), k free velocities u, m
dependent s. With L = l + lambda_a (s^a' - w^a) + …, l and lambda_a functions of (t?, q, u), x =
(t?, q, u), X = (1, u, w, F), Gamma = X^x d_x, X_alpha = d/dr^alpha + w^a_alpha d/ds^a, w^a_alpha =
dw^a/du^alpha, the Euler-Lagrange equations of L hold along the motion iff

    free_alpha     Gamma(dl/du^alpha) - X_alpha(l) + lambda_b (X_alpha(w^b) - Gamma(w^b_alpha))    k
    equations dependent_a    Gamma(lambda_a) - dl/ds^a + lambda_b dw^b/ds^a
    m equations

vanish; L can be chosen regular iff [d2l/du du; dlambda/du] has rank k. (w linear in u gives the
curvature: Prince, Mestdag, Martin de Diego, arXiv:2606.05550; Barbero-Linan, Farre Puiggali, Martin
de Diego, arXiv:1404.1961.) m = 0 is the inverse problem itself.

Consequences of these equations decide the question at a third of the order (`write_brackets`,
`equations`):

The differential of theta = sum (dl/du^alpha) dr^alpha + lambda_a (ds^a - w^a_alpha dr^alpha) is
invariant under Gamma and vanishes on pairs of vertical vectors, hence on all (L_Gamma)^j
(d/du^alpha ^ d/du^beta): with V_i = (ad Gamma)^i applied to d/du^alpha and V'_i that of beta, sum_i
C(j, i) dtheta(V_i, V'_(j - i)) = 0, an equation of order 1 in (l, lambda). For j = 0 and 1 it is an
identity. Because it contains j derivatives of Gamma, it is assigned the order j/PACE, rounded up.
(Prince, Mestdag, Martin de Diego, arXiv:2606.05550.)
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from inverse_service.expressions.tree import Expression
from inverse_service.field import dense_series as machine, modular
from inverse_service.field.dense_series import Registers, SeriesProgram, products, run_again
from inverse_service.linear_pde.equations import (
    NO_DERIVATIVE,
    Equations,
    Function,
    LocalEquations,
    TermTable,
    Unknowns,
)
from inverse_service.linear_pde.involution import Matrix

Integers = npt.NDArray[np.int64]
PACE, FIRST = 4, 2
# The limit on products in the tables for series to as many degrees as there are brackets.
_MOST_BRACKET_PRODUCTS = 1_000_000


@dataclass(frozen=True, slots=True)
class Shape:
    """k free and m dependent coordinates; x = (t?, r, s, u), with `times` 0 or 1 for t."""

    free: int
    dependent: int
    times: int

    @property
    def size(self) -> int:
        return self.times + 2 * self.free + self.dependent

    def r(self, alpha: int) -> int:
        return self.times + alpha

    def s(self, a: int) -> int:
        return self.times + self.free + a

    def u(self, alpha: int) -> int:
        return self.times + self.free + self.dependent + alpha

    # Registers: X, w^a_alpha, the factors of lambda_b in free_alpha and in dependent_a, 1, and a
    # spare register.
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
    """The unknowns l, all of whose first derivatives occur, and lambda_a."""
    functions = (Function(1), *[Function(0)] * shape.dependent)
    entries = [
        *((0, (x,)) for x in range(shape.size)),
        *((1 + a, ()) for a in range(shape.dependent)),
    ]
    return Unknowns(shape.size, functions, tuple(entries))


@lru_cache(maxsize=64)
def rank_matrix(shape: Shape) -> Matrix:
    """[d2l/du du; dlambda/du], of rank k."""
    u = [shape.u(alpha) for alpha in range(shape.free)]
    upper = [tuple((0, (min(x, y), max(x, y))) for y in u) for x in u]
    lower = [tuple((1 + a, (y,)) for y in u) for a in range(shape.dependent)]
    return Matrix((*upper, *lower), shape.free)


@lru_cache(maxsize=64)
def regular_on_constraints(shape: Shape) -> Matrix:
    """d2l/du du alone."""
    return Matrix(rank_matrix(shape).entries[: shape.free], shape.free)


def series_program(
    shape: Shape, variables: Sequence[modular.Variable], field: Sequence[Expression], order: int
) -> SeriesProgram:
    """X without its t component, and the coefficients, for series to this order in the
    displacements of x.
    """
    series = SeriesProgram(variables, order)
    series.register(shape.one + 2)
    series.write(machine.CONSTANT, shape.one)
    if shape.times:
        series.write(machine.CONSTANT, 0)
    for register, tree in enumerate(field, start=shape.times):
        series.write(machine.ADD, register, series.expand(tree))
    _write_coefficients(shape, series, series.number(Fraction(-1)))
    return series


def _write_coefficients(shape: Shape, series: SeriesProgram, minus: int) -> None:
    """w^a_alpha, X_alpha(w^b) - Gamma(w^b_alpha), and dw^b/ds^a; `minus` is the number -1 of the
    program.
    """
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
            series.write(machine.ADD, out, last, lost=2)
            for a in m:
                series.write(
                    machine.PRODUCT, out, shape.slope(a, alpha), shape.gradient(a, b), lost=2
                )
            for x in range(shape.size):
                series.write(machine.DERIVATIVE, last, shape.slope(b, alpha), x)
                series.write(machine.PRODUCT, out, x, last, minus, lost=2)


def compiled_equations(
    shape: Shape, prime: int, order: int, registers: Registers
) -> LocalEquations:
    """Both kinds of equations, from the registers of `written`, for prolongation to this order."""
    unknowns = unknowns_of(shape)
    series = registers.coefficients(np.arange(shape.one + 1), order - 1)
    counts = (("free", shape.free), ("dependent", shape.dependent))
    tables = (
        (kind, count, TermTable(unknowns, count, series, _terms(kind, shape)))
        for kind, count in counts
    )
    blocks = (
        Equations(kind, tuple((k,) for k in range(count)), 1, table)
        for kind, count, table in tables
    )
    return LocalEquations(unknowns, prime, tuple(blocks))


@lru_cache(maxsize=64)
def _terms(kind: str, shape: Shape) -> Integers:
    """The summands in the form of a `TermTable`: equation, series, sign, entry, derivative."""
    rows: list[tuple[int, int, int, int, int]] = []
    plain, multiplier = NO_DERIVATIVE, shape.size
    if kind == "free":
        for alpha in range(shape.free):
            rows += [(alpha, x, 0, shape.u(alpha), x) for x in range(shape.size)]
            rows += [(alpha, shape.one, 1, shape.r(alpha), plain)]
            rows += [
                (alpha, shape.slope(a, alpha), 1, shape.s(a), plain) for a in range(shape.dependent)
            ]
            rows += [
                (alpha, shape.curvature(b, alpha), 0, multiplier + b, plain)
                for b in range(shape.dependent)
            ]
    else:
        for a in range(shape.dependent):
            rows += [(a, x, 0, multiplier + a, x) for x in range(shape.size)]
            rows += [(a, shape.one, 1, shape.s(a), plain)]
            rows += [
                (a, shape.gradient(a, b), 0, multiplier + b, plain) for b in range(shape.dependent)
            ]
    return np.array(rows, np.int64).reshape(-1, 5)


def order_of(j: int) -> int:
    """The order at which the equations of j are included."""
    return -(-j // PACE)


@lru_cache(maxsize=64)
def last_of(shape: Shape) -> int:
    """The last j, limited by the number of bivectors and by the possible series; 0 for none."""
    if shape.free < 2:
        return 0
    size = shape.size - shape.times
    fitting = [
        j
        for j in range(FIRST, math.comb(size, 2) + 1)
        if products(shape.size, j) <= _MOST_BRACKET_PRODUCTS
    ]
    return max(fitting, default=0)


def degree_for(shape: Shape, order: int) -> int:
    """The degree of the series required to prolong to this order."""
    coming = range(FIRST, min(last_of(shape), PACE * order) + 1)
    return max([order + 1, *(order - order_of(j) + j for j in coming)])


def write_brackets(shape: Shape, series: SeriesProgram) -> int:
    """Write V_j of each u^alpha for j = 0, 1, …, `last_of`; return the first register."""
    size, own, minus = (
        shape.size,
        range(shape.times, shape.size),
        series.number(Fraction(-1)),
    )
    count = size * shape.free * (last_of(shape) + 1)
    first = series.register(count + 1)
    spare = first + count
    for alpha in range(shape.free):
        series.write(machine.CONSTANT, first + size * alpha + shape.u(alpha))
    for before in range(first, spare - size * shape.free, size):
        j = 1 + (before - first) // (size * shape.free)
        for x in own:
            out = before + size * shape.free + x
            for y in range(size):
                series.write(machine.DERIVATIVE, spare, before + x, y)
                series.write(machine.PRODUCT, out, y, spare, lost=j)
            for y in own:
                series.write(machine.DERIVATIVE, spare, x, y)
                series.write(machine.PRODUCT, out, before + y, spare, minus, lost=j)
    return first


@dataclass(frozen=True, slots=True)
class _Program:
    """A program on the first `kept` of `count` registers: instructions, their numbers, and terms.

    Each (j, alpha) has a table of terms, as for a `TermTable`, with registers as series.
    """

    kept: int
    count: int
    numbers: tuple[int, ...]
    instructions: Integers
    terms: tuple[tuple[int, int, Integers], ...]


@dataclass(slots=True)
class _Writing:
    """A program under construction: `first` and `slopes` are registers as in `equations`, `free` is
    the next one.

    The registers before `kept` are those of `write_brackets`; components along the ds^a - w^a_alpha
    dr^alpha follow, then, from `bends` on, the derivatives of the w^a_alpha. A line is (operation,
    result, left, right, number, order).
    """

    shape: Shape
    first: int
    slopes: int
    last: int
    bends: int = 0
    free: int = 0
    numbers: list[int] = field(default_factory=lambda: [0, -1])
    lines: list[tuple[int, int, int, int, int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.free = self.kept + self.shape.free * (self.last + 1) * self.shape.dependent
        self.bends, self.free = (
            self.free,
            self.free + self.shape.size * self.shape.dependent * self.shape.free,
        )

    @property
    def kept(self) -> int:
        return self.first + self.shape.size * self.shape.free * (self.last + 1)

    def weight(self, value: int) -> int:
        self.numbers.append(value)
        return len(self.numbers) - 1

    def vector(self, j: int, alpha: int) -> int:
        return self.first + self.shape.size * (self.shape.free * j + alpha)

    def along(self, j: int, alpha: int, y: int) -> int:
        """The component along dr^y, or along ds^a - w^a_alpha dr^alpha."""
        k, m = self.shape.free, self.shape.dependent
        return (
            self.vector(j, alpha) + self.shape.r(y)
            if y < k
            else self.kept + (k * j + alpha) * m + y - k
        )


@lru_cache(maxsize=64)
def _program(shape: Shape, first: int, slopes: int, last: int) -> _Program:
    out = _Writing(shape, first, slopes, last)
    _write_components(out)
    listed = tuple(
        (j, alpha, np.array(list(_bracket_terms(out, j, alpha)), np.int64))
        for j in range(FIRST, last + 1)
        for alpha in range(shape.free - 1)
    )
    return _Program(
        out.kept, out.free, tuple(out.numbers), np.array(out.lines, np.int64).ravel(), listed
    )


def _write_components(out: _Writing) -> None:
    """Write the components of all V_j along ds^a - w^a_alpha dr^alpha, and the derivatives of the
    w^a_alpha.
    """
    k, one = out.shape.free, out.weight(1)
    for j, alpha, a in itertools.product(range(out.last + 1), range(k), range(out.shape.dependent)):
        place = out.along(j, alpha, k + a)
        out.lines.append((machine.ADD, place, out.vector(j, alpha) + out.shape.s(a), 0, one, 0))
        for r in range(k):
            factors = out.slopes + a * k + r, out.vector(j, alpha) + out.shape.r(r)
            out.lines.append((machine.PRODUCT, place, *factors, 1, 0))
    count = out.shape.dependent * k
    for x, each in itertools.product(range(out.shape.size), range(count)):
        out.lines.append(
            (machine.DERIVATIVE, out.bends + x * count + each, out.slopes + each, x, 0, 0)
        )


def _bracket_terms(out: _Writing, j: int, alpha: int) -> Iterator[tuple[int, int, int, int, int]]:
    """The terms of the equations for (j, alpha) and each beta after alpha; their coefficients are
    written first.
    """
    shape, k, m = out.shape, out.shape.free, out.shape.dependent
    for equation, beta in enumerate(range(alpha + 1, k)):
        lower = out.free
        out.free += m
        for x, y in itertools.product(range(shape.times, shape.size), range(k + m)):
            place, out.free = out.free, out.free + 1
            for i in range(j + 1):
                c, left, right = (
                    math.comb(j, i),
                    out.vector(i, alpha) + x,
                    out.vector(j - i, beta) + x,
                )
                out.lines.append(
                    (machine.PRODUCT, place, left, out.along(j - i, beta, y), out.weight(c), 1)
                )
                out.lines.append(
                    (machine.PRODUCT, place, right, out.along(i, alpha, y), out.weight(-c), 1)
                )
            yield equation, place, 0, shape.u(y) if y < k else shape.size + y - k, x
            for a in range(m if y < k else 0):
                bend = out.bends + (x * m + a) * k + y
                out.lines.append((machine.PRODUCT, lower + a, place, bend, 1, 1))
        yield from ((equation, lower + a, 0, shape.size + a, NO_DERIVATIVE) for a in range(m))


def equations(
    shape: Shape, unknowns: Unknowns, order: int, registers: Registers, first: int, slopes: int
) -> Iterator[Equations]:
    """The equations included up to this order, from the registers of `write_brackets` and of the
    w^a_alpha.
    """
    last = min(last_of(shape), PACE * order)
    if last < FIRST:
        return
    program = _program(shape, first, slopes, last)
    again = run_again(
        registers, program.kept, program.count, program.instructions, program.numbers, order
    )
    for j, alpha, terms in reversed(program.terms):  # this order gives the shortest proofs
        used, places = np.unique(terms[:, 1], return_inverse=True)
        own = terms.copy()
        own[:, 1] = places
        count = shape.free - 1 - alpha
        table = TermTable(unknowns, count, again.coefficients(used, order - order_of(j)), own)
        indices = tuple((beta,) for beta in range(alpha + 1, shape.free))
        yield Equations(f"B{j}_{alpha}", indices, order_of(j), table)
