"""Is there a regular L of one kind? The kinds are given by derivations Y that multiply L by a number.

Y = Y^x d/dx over (t, q, v), Y^q free of v and Y^v affine in v, with Y(L) = c L. For g_ij = d2L/dv_i dv_j that is

    K_ij   Y(g_ij) + g_ik dY_v^k/dv^j + g_jk dY_v^k/dv^i - c g_ij = 0,          i <= j

(it holds where Y(L) = c L up to terms affine in v), and where Y(L) = c L holds exactly, Y is a symmetry of the motion,
up to its speed:

    S_i    g_ij s^j = 0,   s = Y(f) - Gamma(Y_v) - c f/2.

natural (T + A v - V, T quadratic in v)   d/dv^k, c = 0, not exact: dg/dv = 0
finsler (L homogeneous of degree 2)       v^k d/dv^k, c = 2: v dg/dv = 0, and f is homogeneous of degree 2
riemannian (L = g v v/2)                  both
invariant under X(q)                      X^c = X^i d/dq^i + v^k dX^i/dq^k d/dv^i, c = 0

With any friction D(t, q, v), E_i = Gamma(dL/dv^i) - dL/dq^i = dD/dv^i, H does not hold, as E need not vanish. dE_i/dv^j
is symmetric iff 2 (d2L/dq^j dv^i - d2L/dq^i dv^j) = P_ij is minus the antisymmetric part of g_il df^l/dv^j, for g iff

    C_ijk  2 (d_(q^j) g_ik - d_(q^i) g_jk) + d_(v^k) (g_il df^l/dv^j - g_jl df^l/dv^i) = 0,    i < j
    D_ijk  the sum of d_(q^k) (g_il df^l/dv^j - g_jl df^l/dv^i) over the cyclic permutations = 0,    i < j < k

(C: dP/dv; then D: P at one v is closed, and is that of some A_i(q) v^i). t is a parameter of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Literal

from inverse_service.decision.kinds.helmholtz import pairs_of
from inverse_service.expressions.derivative import differentiate_in_time
from inverse_service.expressions.tree import Expression, Symbol, Velocity, number
from inverse_service.field import truncated_series as ps
from inverse_service.field.elementary import to_kernels
from inverse_service.field.point import Expansion, Variable
from inverse_service.field.truncated_series import Series
from inverse_service.linear_pde.emission import NO_DERIVATIVE, Equations, Term, term_table
from inverse_service.linear_pde.unknowns import Unknowns


@dataclass(frozen=True, slots=True)
class Derivation:
    """Y by its components, c, and whether Y(L) = c L is meant exactly."""

    parts: Mapping[Variable, Expression]
    weight: int
    exact: bool


Friction = Literal["any friction"]
Among = Sequence[Derivation | Friction]
ANY_FRICTION: Friction = "any friction"


@dataclass(frozen=True, slots=True)
class LagrangianKind:
    """Its name, its derivations (with friction the rows C and D before them), and what a certificate calls it."""

    name: str
    derivations: tuple[Derivation | Friction, ...]
    among: str | Mapping[str, Sequence[Mapping[str, str]]]


def _natural(names: Sequence[str]) -> tuple[Derivation, ...]:
    return tuple(Derivation({Velocity(name): number(1)}, 0, False) for name in names)


def _homogeneous(names: Sequence[str]) -> tuple[Derivation, ...]:
    return (Derivation({Velocity(name): Velocity(name) for name in names}, 2, True),)


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


def invariant(fields: Sequence[Mapping[str, tuple[str, Expression]]], names: Sequence[str]) -> LagrangianKind:
    """Under vector fields, each by its components along coordinates as (text, tree)."""
    found = []
    for field in fields:
        lifted: dict[Variable, Expression] = {Symbol(name): to_kernels(tree) for name, (_, tree) in field.items()}
        rates = {Velocity(name): differentiate_in_time(tree, names) for name, (_, tree) in field.items()}
        found.append(Derivation({**lifted, **{v: to_kernels(rate) for v, rate in rates.items()}}, 0, True))
    texts = [{name: text for name, (text, _) in field.items()} for field in fields]
    return LagrangianKind("invariant", tuple(found), {"invariant": texts})


def added_equations(
    among: Among, expansion: Expansion, forces: Sequence[Expression], unknowns: Unknowns
) -> tuple[Equations, ...]:
    """K and S of each, C and D, from series of two orders more than the prolongation takes."""
    n = len(forces)
    found = [*_curl(expansion, forces, unknowns)] if ANY_FRICTION in among else []
    for place, derivation in enumerate(each for each in among if not isinstance(each, str)):
        field = {expansion.variables.index(x): expansion.expand(part) for x, part in derivation.parts.items()}
        pairs = pairs_of("H2", n)
        table = term_table(unknowns, _lie(expansion, field, derivation.weight, n), len(pairs), expansion.order - 2)
        found.append(Equations(f"K{place}", pairs, 1, table))
        if derivation.exact:
            table = term_table(unknowns, _symmetry(expansion, field, derivation, forces), n, expansion.order - 2)
            found.append(Equations(f"S{place}", tuple((i, i) for i in range(n)), 0, table))
    return tuple(found)


def _curl(expansion: Expansion, forces: Sequence[Expression], unknowns: Unknowns) -> Iterator[Equations]:
    """C and D, for each k."""
    n, size = len(forces), len(expansion.variables)
    q, v, entry = size - 2 * n, size - n, {pair: place for place, pair in enumerate(pairs_of("H2", n))}
    series, two = [expansion.expand(f) for f in forces], expansion.ring.constant(2)
    slopes = [[ps.derivative(f, v + j) for j in range(n)] for f in series]

    def slope(equation: int, i: int, j: int, by: int) -> Iterator[Term]:
        """d_by (g_il df^l/dv^j - g_jl df^l/dv^i)."""
        for (a, b), row in product(((i, j), (j, i)), range(n)):
            place, factor = entry[min(a, row), max(a, row)], slopes[row][b]
            yield Term(equation, place, by, factor, a != i)
            yield Term(equation, place, NO_DERIVATIVE, ps.derivative(factor, by), a != i)

    for k in range(n):
        pairs, most = tuple(combinations(range(n), 2)), expansion.order - 2
        terms: list[Term] = []
        for e, (i, j) in enumerate(pairs):
            terms += [Term(e, entry[min(a, k), max(a, k)], q + b, two, a != i) for a, b in ((i, j), (j, i))]
            terms += slope(e, i, j, v + k)
        yield Equations(f"C{k}", pairs, 1, term_table(unknowns, _known(terms), len(pairs), most))
        pairs = tuple(combinations(range(k), 2))
        terms = [each for e, (i, j) in enumerate(pairs) for a, b, c in ((i, j, k), (j, k, i), (k, i, j))
                 for each in slope(e, a, b, q + c)]  # fmt: skip
        yield Equations(f"D{k}", pairs, 1, term_table(unknowns, _known(terms), len(pairs), most))


def _known(terms: Sequence[Term]) -> list[Term]:
    return [term for term in terms if any(term.series)]


def _lie(expansion: Expansion, field: Mapping[int, Series], weight: int, n: int) -> list[Term]:
    size, entry = len(expansion.variables), {pair: k for k, pair in enumerate(pairs_of("H2", n))}
    terms, plain = [], expansion.ring.constant(-weight)
    for equation, (i, j) in enumerate(pairs_of("H2", n)):
        terms += [Term(equation, equation, a, part) for a, part in field.items()]
        terms += [Term(equation, equation, NO_DERIVATIVE, plain)] * bool(weight)
        for a, part in field.items():
            k = a - (size - n)
            for b, c in ((i, j), (j, i)) if k >= 0 else ():
                slope = ps.derivative(part, size - n + c)
                terms.append(Term(equation, entry[min(b, k), max(b, k)], NO_DERIVATIVE, slope))
    return terms


def _symmetry(
    expansion: Expansion, field: Mapping[int, Series], derivation: Derivation, forces: Sequence[Expression]
) -> list[Term]:
    n, size = len(forces), len(expansion.variables)
    series = [expansion.expand(f) for f in forces]
    gamma = list(enumerate([*(expansion.expand(v) for v in expansion.variables[size - n :]), *series], size - 2 * n))
    zero, terms = ps.scale(series[0], 0), []
    entry = {pair: k for k, pair in enumerate(pairs_of("H2", n))}
    for k, f in enumerate(series):
        part = ps.along(field.items(), f)
        part = ps.subtract(part, ps.along(gamma, field.get(size - n + k, zero)))
        part = ps.subtract(part, ps.scale(f, derivation.weight // 2)[: len(part)])
        if any(part):
            terms += [Term(i, entry[min(i, k), max(i, k)], NO_DERIVATIVE, part) for i in range(n)]
    return terms
