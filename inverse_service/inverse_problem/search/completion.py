"""Terms A_i(t, q) v_i - V(t, q) with given Euler-Lagrange expressions, by exact linear algebra.

What has to come out is affine in the velocities: a term T of E_i is answered by B with dB/dq_i = T, a term T v_j by
B v_i with dB/dq_j = T. What the derivatives of these leave over is answered again.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import combinations
from typing import Any

from flint import fmpq, fmpq_mat

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.exact_ring import quotient_tree
from inverse_service.algebra.rational_functions import Budget, TooLarge
from inverse_service.deadline import check, end
from inverse_service.expressions.tree import (
    HALF,
    TIME,
    ZERO,
    Apply,
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    power,
    square_root,
    substitute,
    subtract,
    walk,
)
from inverse_service.inverse_problem.search.material import antiderivatives
from inverse_service.inverse_problem.search.motion import split_velocities
from inverse_service.inverse_problem.search.terms import (
    Monomial,
    Terms,
    add_terms,
    derivative_of_terms,
    monomial,
    monomial_tree,
    multiply_terms,
    rank,
    terms_of,
    times,
    tree_of,
)
from inverse_service.mechanics.quotient_matrices import reduced_rows


def solution(columns: Sequence[Mapping[Any, Fraction]], right: Mapping[Any, Fraction]) -> list[Fraction] | None:
    """x with sum_k x_k columns[k] = right, later columns where earlier ones do not suffice; None if there is none."""
    sides = [*columns, right]
    rows = list(dict.fromkeys(key for side in sides for key in side))
    entries = (side.get(key, Fraction(0)) for key in rows for side in sides)
    table = fmpq_mat(len(rows), len(sides), [fmpq(a.numerator, a.denominator) for a in entries])
    reduced, order = table.rref()
    found = [Fraction(0)] * len(columns)
    for i in range(order):
        pivot = next(k for k in range(len(sides)) if reduced[i, k])
        if pivot == len(columns):
            return None
        found[pivot] = Fraction(int(reduced[i, len(columns)].p), int(reduced[i, len(columns)].q))
    return found


# Terms that are tried in addition to four for each term wanted, and how often what is left over is answered.
_MOST_TERMS, _DEPTH = 60, 3
# With coefficients that hold parameters: so many terms, in so much work (see `deadline`).
_MOST_SYMBOLIC, _TERMS, _WORK = 40, 500, 50_000


def expressions_without_acceleration(names: Sequence[str], terms: Terms) -> list[Terms]:
    """v_j L_(v_i q_j) + L_(v_i t) - L_(q_i) for each i."""
    found = []
    for name in names:
        check()
        momentum = derivative_of_terms(terms, Velocity(name))
        total = add_terms(derivative_of_terms(momentum, TIME), derivative_of_terms(terms, Symbol(name)), -1)
        for other in names:
            slope = derivative_of_terms(momentum, Symbol(other))
            total = add_terms(total, multiply_terms(slope, {monomial(Velocity(other)): Fraction(1)}))
        found.append(total)
    return found


def completed(names: Sequence[str], wanted: Sequence[Terms]) -> Expression | None:
    """A_i v_i - V with the Euler-Lagrange expressions `wanted`, one for each coordinate; None where none is found.

    The coefficients of its terms are rational where that is enough, else they hold parameters.
    """
    magnetic, wanted = _of_round_fields(names, wanted)
    found = _completed(names, wanted)
    return None if found is None else add(magnetic, found)


def _of_round_fields(names: Sequence[str], wanted: Sequence[Terms]) -> tuple[Expression, list[Terms]]:
    """A(s) (x y' - y x') for the terms B v_j of E_i, -B v_i of E_j where B depends on s = x^2 + y^2 alone; the rest.

    It is regular on both axes: B = -2 (s A)', and s A is the integral of -x B by x at y = 0.
    """
    total, rest = [], [dict(terms) for terms in wanted]
    fields = [_by_velocity(terms) for terms in wanted]
    for (i, field), (j, opposite) in combinations(enumerate(fields), 2):
        x, y, v, w = Symbol(names[i]), Symbol(names[j]), Velocity(names[i]), Velocity(names[j])
        if w not in field or add_terms(field[w], opposite.get(v, {})) or not _is_round(field[w], x, y):
            continue
        radial = _moving(terms_of(substitute(tree_of(field[w]), {y: ZERO})), x)
        flux = _completed([x.name], [radial])
        if flux is not None:
            square = add(power(x, 2), power(y, 2))
            table = {power(x, 2): square, Apply("log", x): multiply(HALF, Apply("log", square)), x: square_root(square)}
            turn = subtract(multiply(x, w), multiply(y, v))
            total.append(multiply(substitute(flux, table), power(square, -1), turn))
            rest[i] = add_terms(rest[i], _moving(field[w], w), -1)
            rest[j] = add_terms(rest[j], _moving(field[w], v))
    return add(*total), rest


def _is_round(field: Terms, x: Symbol, y: Symbol) -> bool:
    """Whether it depends on x^2 + y^2, and on x and y in no other way: x B_y = y B_x."""
    slopes = [derivative_of_terms(field, variable) for variable in (x, y)]
    turned = [_moving(slope, factor) for slope, factor in zip(slopes, (y, x), strict=True)]
    return bool(slopes[0]) and turned[0] == turned[1]


def _by_velocity(terms: Terms) -> dict[Expression, Terms]:
    """The coefficients of single velocities."""
    found: dict[Expression, Terms] = {}
    for key, value in terms.items():
        position, moving = split_velocities(key)
        for letter, e in moving:
            if moving == monomial(letter):
                found.setdefault(letter, {})[position] = value * e
    return found


def _moving(field: Terms, letter: Symbol | Velocity) -> Terms:
    return multiply_terms(field, {monomial(letter): Fraction(1)})


def _completed(names: Sequence[str], wanted: Sequence[Terms]) -> Expression | None:
    columns: dict[Monomial, list[Terms]] = {}
    fresh = [(i, key) for i, terms in enumerate(wanted) for key in terms]
    if any(not _is_affine(key) for _, key in fresh):
        return None
    right, most = _numbered(wanted), _MOST_TERMS + 4 * len(fresh)
    for _ in range(_DEPTH):
        raised = dict.fromkeys(m for i, key in fresh for m in _answers(names, i, key) if m not in columns)
        fresh = []
        for m in sorted(raised, key=rank)[: most - len(columns)]:
            columns[m] = expressions_without_acceleration(names, {m: Fraction(1)})
            fresh += [(i, key) for i, terms in enumerate(columns[m]) for key in terms if _is_affine(key)]
        rational = solution([_numbered(expressions) for expressions in columns.values()], right)
        if rational is not None:
            return tree_of({m: a for m, a in zip(columns, rational, strict=True) if a})
        found = _with_parameters(names, columns, wanted)
        if found is not None:
            return found
    return None


def _with_parameters(
    names: Sequence[str], columns: Mapping[Monomial, Sequence[Terms]], wanted: Sequence[Terms]
) -> Expression | None:
    """The same with coefficients from the field of the constants."""
    varying = dict.fromkeys(_varying(names, m) for m in columns)
    if not varying or len(varying) > _MOST_SYMBOLIC:
        return None
    plain = {m: expressions_without_acceleration(names, {m: Fraction(1)}) for m in varying if m}
    sides = [_by_varying(names, expressions) for expressions in (*plain.values(), wanted)]
    keys = list(dict.fromkeys(key for side in sides for key in side))
    trees = [[tree_of(side.get(key, {})) for side in sides] for key in keys]
    try:
        budget = Budget(_TERMS, end(), _WORK)
        ring = exact_ring([tree for row in trees for tree in row], [], 0, budget, slopes=False)
        found = reduced_rows([[ring.value(tree) for tree in row] for row in trees], range(len(sides)))
    except (TooLarge, ZeroDivisionError):
        return None
    if len(plain) in found.pivots:
        return None
    parts = [
        multiply(quotient_tree(ring, row[-1]), monomial_tree(m))
        for pivot, row in zip(found.pivots, found.rows, strict=True)
        for m in (list(plain)[pivot],)
    ]
    return add(*parts)


def _varying(names: Sequence[str], key: Monomial) -> Monomial:
    """The letters that hold coordinates, velocities or t."""
    return frozenset(item for item in key if _varies(names, item[0]))


def _varies(names: Sequence[str], letter: Expression) -> bool:
    return any(
        isinstance(node, Velocity) or (isinstance(node, Symbol) and (node == TIME or node.name in names))
        for node in walk(letter)
    )


def _by_varying(names: Sequence[str], expressions: Iterable[Terms]) -> dict[tuple[int, Monomial], Terms]:
    """For each equation and each product of varying letters its constant coefficient."""
    table: dict[tuple[int, Monomial], Terms] = {}
    for i, terms in enumerate(expressions):
        for key, value in terms.items():
            varying = _varying(names, key)
            table.setdefault((i, varying), {})[key - varying] = value
    return table


def _numbered(expressions: Iterable[Terms]) -> dict[Hashable, Fraction]:
    return {(i, key): value for i, terms in enumerate(expressions) for key, value in terms.items()}


def _is_affine(key: Monomial) -> bool:
    moving = list(split_velocities(key)[1])
    return len(moving) <= 1 and all(isinstance(letter, Velocity) and e == 1 for letter, e in moving)


def _answers(names: Sequence[str], i: int, key: Monomial) -> list[Monomial]:
    """B with dB/dq_i = T for a term T of E_i; B v_i with dB/dq_j = T and B v_j with dB/dq_i = T for a term T v_j."""
    position, moving = split_velocities(key)
    q, v = Symbol(names[i]), Velocity(names[i])
    if not moving:
        return list(antiderivatives(position, q))
    ((rate, _),) = moving
    assert isinstance(rate, Velocity)
    pairs: list[tuple[Monomial, Expression]] = [(m, v) for m in antiderivatives(position, Symbol(rate.coordinate))]
    pairs += [(m, rate) for m in antiderivatives(position, q)]
    return [times(m, monomial(w)) for m, w in pairs]
