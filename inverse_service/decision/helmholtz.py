"""The conditions on g_ij = d2L/dv_i dv_j for a regular L(q, v) or L(t, q, v), also of one kind or
with friction.

g is symmetric and of rank n, (H1) holds because g is a Hessian. Coordinates are x = (t?, q, v), X =
(1, v, f) are the components of Gamma. The sections follow in this order.

A Lagrangian of q'' = f (Helmholtz 1887; Douglas, Trans. AMS 50 (1941), section 2; signs as in
Mestdag, Bloch and Fernandez), with N = -1/2 df/dv and Phi = Gamma(df/dv) - 2 df/dq - 1/2
(df/dv)(df/dv):

    H2_ij  sum_a X^a d_a g_ij - sum_k (g_ik N^k_j + g_jk N^k_i)    i <= j
    H3_ij  sum_k (g_ik Phi^k_j - g_jk Phi^k_i)                     i <  j

The instructions for N and Phi follow those for f. Their registers are the first ones: X, then
df/dv, N, Phi (n x n each), and one for derivatives in between.

A Lagrangian of one kind (`LagrangianKind`). Derivations Y = Y^x d/dx over (t, q, v), with Y^q free
of v and Y^v affine in v, define a kind by multiplying L by a number: Y(L) = c L. The condition on g
is K, which is equivalent to Y(L) = c L up to terms affine in v. If Y(L) = c L exactly, Y is a
symmetry of the motion up to its speed, which is condition S:

    K_ij   Y(g_ij) + g_ik dY_v^k/dv^j + g_jk dY_v^k/dv^i - c g_ij = 0,          i <= j
    S_i    g_ij s^j = 0,   s = Y(f) - Gamma(Y_v) - c f/2

    natural (T + A v - V, T quadratic in v)   d/dv^k, c = 0, not exact: dg/dv = 0 finsler (L
    homogeneous of degree 2)       v^k d/dv^k, c = 2: v dg/dv = 0, and f is homogeneous of degree 2
    riemannian (L = g v v/2)                  both invariant under X(q)                      X^c =
    X^i d/dq^i + v^k dX^i/dq^k d/dv^i, c = 0

A Lagrangian with any friction D(t, q, v): E_i = Gamma(dL/dv^i) - dL/dq^i = dD/dv^i need not vanish,
so H2 and H3 need not be satisfied. dE_i/dv^j is symmetric iff 2 (d2L/dq^j dv^i - d2L/dq^i dv^j) =
P_ij is minus the antisymmetric part of g_il df^l/dv^j. C is the condition on dP/dv; D states that P
at one v is closed, so that it comes from some A_i(q) v^i; t is a parameter:

    C_ijk  2 (d_(q^j) g_ik - d_(q^i) g_jk) + d_(v^k) (g_il df^l/dv^j - g_jl df^l/dv^i) = 0,    i < j
    D_ijk  the sum of d_(q^k) (g_il df^l/dv^j - g_jl df^l/dv^i) over the cyclic permutations = 0,
    i < j < k
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import combinations, combinations_with_replacement, product
from typing import Literal

import numpy as np
import numpy.typing as npt

from inverse_service.expressions import calculus, tree as ex
from inverse_service.field import dense_series as machine, modular, tower
from inverse_service.linear_pde import equations as pde, involution
from inverse_service.mechanics import conditions

Integers = npt.NDArray[np.int64]
Kind = Literal["H2", "H3"]
# The kinds of rows with the order of their derivatives of g.
KINDS: tuple[tuple[Kind, int], ...] = (("H2", 1), ("H3", 0))
Friction = Literal["any friction"]
ANY_FRICTION: Friction = "any friction"


@lru_cache(maxsize=64)
def unknowns_of(n: int, size: int) -> pde.Unknowns:
    """L of v-degree >= 2 and the entries g_ij, i <= j, over `size` displacements, the velocities
    last.
    """
    first = size - n
    pairs = combinations_with_replacement(range(first, size), 2)
    return pde.Unknowns(size, (pde.Function(2, first),), tuple((0, pair) for pair in pairs))


@lru_cache(maxsize=64)
def multiplier_matrix(n: int, size: int) -> involution.Matrix:
    """The matrix g, which must have rank n."""
    velocities = range(size - n, size)
    return involution.Matrix(
        tuple(tuple((0, (min(i, j), max(i, j))) for j in velocities) for i in velocities), n
    )


@lru_cache(maxsize=64)
def pairs_of(kind: Kind, n: int) -> tuple[tuple[int, int], ...]:
    """(i, j) of each equation."""
    return tuple(
        combinations_with_replacement(range(n), 2) if kind == "H2" else combinations(range(n), 2)
    )


def compiled_equations(
    registers: Integers, n: int, order: int, found: machine.Registers
) -> pde.LocalEquations:
    """H2, then H3, from the registers of X, N, and Phi after a run, for prolongation to this
    order.
    """
    size = len(registers) - 2 * n * n
    series, unknowns = found.coefficients(registers, order), unknowns_of(n, size)
    blocks = tuple(
        pde.Equations(
            kind, pairs, k, pde.TermTable(unknowns, len(pairs), series, _terms(kind, n, size))
        )
        for kind, k, pairs in ((kind, k, pairs_of(kind, n)) for kind, k in KINDS)
    )
    return pde.LocalEquations(unknowns, found.prime, blocks)


@lru_cache(maxsize=64)
def _terms(kind: Kind, n: int, size: int) -> Integers:
    """The summands of the equations of a kind as a `TermTable` has them, with series numbered as in
    `TensorSeries`.
    """
    entry, first = _entries(n), size + (0 if kind == "H2" else n * n)
    rows: list[tuple[int, int, bool, int, int]] = []
    for equation, (i, j) in enumerate(pairs_of(kind, n)):
        if kind == "H2":
            rows += [(equation, a, False, entry[i, j], a) for a in range(size)]
        for k in range(n):
            for a, b, negative in ((i, j, kind == "H2"), (j, i, True)):
                rows.append((equation, first + k * n + b, negative, entry[a, k], pde.NO_DERIVATIVE))
    return np.array(rows, np.int64).reshape(-1, 5)


@lru_cache(maxsize=64)
def _entries(n: int) -> Mapping[tuple[int, int], int]:
    """The place of g_ij, also as g_ji."""
    places = {pair: place for place, pair in enumerate(pairs_of("H2", n))}
    return places | {(j, i): place for (i, j), place in places.items()}


@dataclass(frozen=True, slots=True)
class Derivation:
    """The components of Y, the number c, and whether Y(L) = c L is exact."""

    parts: Mapping[modular.Variable, ex.Expression]
    weight: int
    exact: bool


Among = Sequence[Derivation | Friction]


@dataclass(frozen=True, slots=True)
class LagrangianKind:
    """Its name, its derivations (with friction, preceded by the rows C and D), and its name in
    certificates.
    """

    name: str
    derivations: tuple[Derivation | Friction, ...]
    among: str | Mapping[str, Sequence[Mapping[str, str]]]


def _natural(names: Sequence[str]) -> tuple[Derivation, ...]:
    return tuple(Derivation({ex.Velocity(name): ex.number(1)}, 0, False) for name in names)


def _homogeneous(names: Sequence[str]) -> tuple[Derivation, ...]:
    return (Derivation({ex.Velocity(name): ex.Velocity(name) for name in names}, 2, True),)


BUILDERS: Mapping[str, Callable[[Sequence[str]], tuple[Derivation | Friction, ...]]] = {
    "natural": _natural,
    "riemannian": lambda names: (*_natural(names), *_homogeneous(names)),
    "finsler": _homogeneous,
    "positive_definite": lambda names: (),
    "rayleigh": _natural,  # of T - V, a Lagrangian of the even part of f
}


def kind_named(name: str, names: Sequence[str]) -> LagrangianKind:
    """The kind of this name for these coordinates."""
    return LagrangianKind(name, BUILDERS[name](names), name)


def invariant(
    fields: Sequence[Mapping[str, tuple[str, ex.Expression]]], names: Sequence[str]
) -> LagrangianKind:
    """The kind of Lagrangians invariant under vector fields, whose components by coordinate are
    (text, tree).
    """
    found = []
    for field in fields:
        lifted: dict[modular.Variable, ex.Expression] = {
            ex.Symbol(name): tower.to_kernels(tree) for name, (_, tree) in field.items()
        }
        rates = {
            ex.Velocity(name): calculus.differentiate_in_time(tree, names)
            for name, (_, tree) in field.items()
        }
        found.append(
            Derivation(
                {**lifted, **{v: tower.to_kernels(rate) for v, rate in rates.items()}}, 0, True
            )
        )
    texts = [{name: text for name, (text, _) in field.items()} for field in fields]
    return LagrangianKind("invariant", tuple(found), {"invariant": texts})


@dataclass(frozen=True, slots=True)
class Added:
    """The equations of one kind in addition to the Helmholtz conditions, with registers as
    series.
    """

    kind: str
    pairs: tuple[tuple[int, int], ...]
    order: int
    terms: tuple[pde.Term, ...]


def added_equations(among: Among, given: conditions.TensorSeries) -> tuple[Added, ...]:
    """K and S of each derivation, or C and D; their series require two orders more than the
    prolongation.
    """
    program, n = given.program, len(given.tensors[0])
    found = [*_curl(given, n)] if ANY_FRICTION in among else []
    for place, derivation in enumerate(each for each in among if not isinstance(each, str)):
        field = {
            program.places[x]: machine.series_of(program, part)
            for x, part in derivation.parts.items()
        }
        found.append(
            Added(
                f"K{place}", pairs_of("H2", n), 1, tuple(_lie(program, field, derivation.weight, n))
            )
        )
        if derivation.exact:
            found.append(
                Added(
                    f"S{place}",
                    tuple((i, i) for i in range(n)),
                    0,
                    _symmetry(given, field, derivation),
                )
            )
    return tuple(found)


def _symmetry(
    given: conditions.TensorSeries, field: Mapping[int, machine.Series], derivation: Derivation
) -> tuple[pde.Term, ...]:
    """S: g_ij s^j = 0 for s = Y(f) - Gamma(Y_v) - c f/2, with `field` the components of Y by
    place.
    """
    gamma, n, shifts = list(enumerate(given.field)), len(given.tensors[0]), []
    for place, f in gamma[len(gamma) - n :]:
        turned = machine.derivative_along(gamma, field.get(place, machine.Series(given.program)))
        shifts.append(
            machine.derivative_along(field.items(), f)
            - turned
            - f.scaled(Fraction(derivation.weight, 2))
        )
    return tuple(
        pde.Term(i, at, pde.NO_DERIVATIVE, shifts[k].register) for (i, k), at in _entries(n).items()
    )


def _curl(given: conditions.TensorSeries, n: int) -> Iterator[Added]:
    """C and D, for each k."""
    size, entry = len(given.field), _entries(n)
    q, v, two = size - 2 * n, size - n, given.program.expand(ex.number(2))
    slopes = [[f.derivative(v + j) for j in range(n)] for f in given.field[v:]]

    def slope(equation: int, i: int, j: int, by: int) -> Iterator[pde.Term]:
        """d_by (g_il df^l/dv^j - g_jl df^l/dv^i)."""
        for (a, b), row in product(((i, j), (j, i)), range(n)):
            yield pde.Term(equation, entry[a, row], by, slopes[row][b].register, a != i)
            yield pde.Term(
                equation,
                entry[a, row],
                pde.NO_DERIVATIVE,
                slopes[row][b].derivative(by).register,
                a != i,
            )

    for k in range(n):
        pairs = tuple(combinations(range(n), 2))
        terms: list[pde.Term] = []
        for e, (i, j) in enumerate(pairs):
            terms += [pde.Term(e, entry[a, k], q + b, two, a != i) for a, b in ((i, j), (j, i))]
            terms += slope(e, i, j, v + k)
        yield Added(f"C{k}", pairs, 1, tuple(terms))
        pairs = tuple(combinations(range(k), 2))
        terms = [each for e, (i, j) in enumerate(pairs) for a, b, c in ((i, j, k), (j, k, i), (k, i, j))
                 for each in slope(e, a, b, q + c)]  # fmt: skip
        yield Added(f"D{k}", pairs, 1, tuple(terms))


def _lie(
    program: machine.SeriesProgram, field: Mapping[int, machine.Series], weight: int, n: int
) -> Iterator[pde.Term]:
    """K: Y(g_ij) + g_ik dY_v^k/dv^j + g_jk dY_v^k/dv^i - c g_ij, with `field` the components of Y
    by place.
    """
    size, entry = len(program.variables), _entries(n)
    for equation, (i, j) in enumerate(pairs_of("H2", n)):
        yield from (pde.Term(equation, equation, a, part.register) for a, part in field.items())
        if weight:
            yield pde.Term(
                equation, equation, pde.NO_DERIVATIVE, program.expand(ex.number(-weight))
            )
        for a, part in field.items():
            k = a - (size - n)
            for b, c in ((i, j), (j, i)) if k >= 0 else ():
                slope = part.derivative(size - n + c).register
                yield pde.Term(equation, entry[b, k], pde.NO_DERIVATIVE, slope)
