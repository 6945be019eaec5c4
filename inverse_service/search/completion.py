"""Terms A_i(t, q) v_i - V(t, q) with given Euler-Lagrange expressions, by exact linear algebra.

What has to come out is affine in the velocities: a term T of E_i is answered by B with dB/dq_i = T, a term T v_j by
B v_i with dB/dq_j = T. What the derivatives of these leave over is answered again.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from itertools import combinations, combinations_with_replacement
from typing import Any

from inverse_service import bounds
from inverse_service.deadline import check
from inverse_service.errors import InputError
from inverse_service.expressions.tree import (
    HALF,
    TIME,
    ZERO,
    Apply,
    Expression,
    Symbol,
    Velocity,
    add,
    square_root,
    substitute,
    walk,
)
from inverse_service.field.exact_atoms import exact_ring, factored
from inverse_service.field.exact_ring import quotient_tree
from inverse_service.field.rational_functions import Budget, TooLarge
from inverse_service.field.semidefinite import echelon_of
from inverse_service.mechanics.implicit_equations import vanishes
from inverse_service.mechanics.quotient_matrices import reduced_rows
from inverse_service.search.material import antiderivatives
from inverse_service.search.motion_terms import split_velocities
from inverse_service.search.terms import (
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


def solution(columns: Sequence[Mapping[Any, Fraction]], right: Mapping[Any, Fraction]) -> list[Fraction] | None:
    """x with sum_k x_k columns[k] = right, later columns where earlier ones do not suffice; None if there is none."""
    if any(not any(key in column for column in columns) for key in right):
        return None
    sides = [*columns, right]
    rows = list(dict.fromkeys(key for side in sides for key in side))
    table = echelon_of([[side.get(key, Fraction(0)) for side in sides] for key in rows], len(sides))
    found = [Fraction(0)] * len(columns)
    for pivot, row in table:
        if pivot == len(columns):
            return None
        found[pivot] = row[-1]
    return found


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
        found.append(_in_one_square(total))
    return found


# p^2 = a + b q^2 for the pairs of functions p, q of one argument.
_SQUARES = {"sin": ("cos", 1, -1), "cos": ("sin", 1, -1), "sinh": ("cosh", -1, 1), "cosh": ("sinh", 1, 1)}


def _in_one_square(terms: Terms) -> Terms:
    """sin(u)^2/cos(u)^k as 1/cos(u)^k - 1/cos(u)^(k - 2) and so on, so that what is equal looks so."""
    result: Terms = {}
    for key, value in terms.items():
        result = add_terms(result, _of_one_square(key), value)
    return result


def _of_one_square(key: Monomial) -> Terms:
    powers = dict(key)
    for letter, e in key:
        if e >= 2 and isinstance(letter, Apply) and letter.function in _SQUARES:
            name, a, b = _SQUARES[letter.function]
            partner = Apply(name, letter.argument)
            if powers.get(partner, 0) < 0:
                less = times(key, monomial(letter), -2)
                parts = {less: Fraction(a), times(less, monomial(partner), 2): Fraction(b)}
                return _in_one_square(parts)
    return {key: Fraction(1)}


def completed(names: Sequence[str], wanted: Sequence[Terms]) -> Expression | None:
    """A_i v_i - V with the Euler-Lagrange expressions `wanted`, one for each coordinate; None where none is found.

    The coefficients of its terms are rational where that is enough, else they hold parameters.
    """
    if not _is_self_adjoint(names, wanted):
        return None
    total, rest = [], list(wanted)
    with suppress(TooLarge, ZeroDivisionError):
        for i, j in combinations(range(len(names)), 2):
            magnetic = round_potential(names, rest, i, j)
            if magnetic is not None:
                rest = _less(names, rest, terms_of(magnetic))
                total.append(magnetic)
    found = linear_completion(names, rest)
    return None if found is None else add(*total, found)


def _is_self_adjoint(names: Sequence[str], wanted: Sequence[Terms]) -> bool:
    """Whether E_i = B_ij v_j + C_i can be that of some A_i v_i - V: B_ij = -B_ji and C_i,j - C_j,i = B_ij,t.

    What does not cancel term by term is tried at random points: letters can be related.
    """
    rates, left = [Velocity(name) for name in names], list[Terms]()
    for (i, q), (j, r) in combinations_with_replacement(enumerate(map(Symbol, names)), 2):
        field = _beside(wanted[i], rates[j])
        left.append(add_terms(field, _beside(wanted[j], rates[i])))
        forces = (_at_rest(wanted[i]), _at_rest(wanted[j]))
        turning = add_terms(derivative_of_terms(forces[0], r), derivative_of_terms(forces[1], q), -1)
        left.append(add_terms(turning, derivative_of_terms(field, TIME), -1))
    try:
        return all(vanishes(tree_of(terms)) for terms in left if terms)
    except InputError:
        return True


def _less(names: Sequence[str], wanted: Sequence[Terms], known: Terms) -> list[Terms]:
    """What is still wanted beside known terms; what vanishes by relations among its letters is left out."""
    own = expressions_without_acceleration(names, known)
    trees = [tree_of(add_terms(dict(terms), part, -1)) for terms, part in zip(wanted, own, strict=True)]
    symbols: list[Symbol | Velocity] = [TIME, *map(Symbol, names), *map(Velocity, names)]
    return [terms_of(tree) for tree in factored(trees, symbols, Budget.short())]


def round_potential(names: Sequence[str], wanted: Sequence[Terms], i: int, j: int) -> Expression | None:
    """A(s) (x y' - y x') for the terms B y' of E_x, -B x' of E_y where B depends on x and y by s = x^2 + y^2 alone.

    It is regular where B is, but for the axis: B = -2 (s A)', and s A is the integral of -x B by x at y = 0.
    """
    x, y, v, w = Symbol(names[i]), Symbol(names[j]), Velocity(names[i]), Velocity(names[j])
    field = _beside(wanted[i], w)
    if not field or not _is_round(field, x, y) or add_terms(field, _beside(wanted[j], v)):
        return None
    radial = multiply_terms(terms_of(substitute(tree_of(field), {y: ZERO})), {monomial(x): Fraction(1)})
    flux = linear_completion([x.name], [radial])
    if flux is None:
        return None
    square = x**2 + y**2
    table = {x**2: square, Apply("log", x): HALF * Apply("log", square), x: square_root(square)}
    return substitute(flux, table) * square**-1 * (x * w - y * v)


def _is_round(field: Terms, x: Symbol, y: Symbol) -> bool:
    """Whether it depends on x^2 + y^2, and on x and y in no other way: x B_y = y B_x."""
    slopes = [derivative_of_terms(field, variable) for variable in (x, y)]
    turned = [multiply_terms(slope, {monomial(q): Fraction(1)}) for slope, q in zip(slopes, (y, x), strict=True)]
    return bool(slopes[0]) and turned[0] == turned[1]


def _beside(terms: Terms, velocity: Velocity) -> Terms:
    """The coefficient of a velocity."""
    return {key - monomial(velocity): a for key, a in terms.items() if split_velocities(key)[1] == monomial(velocity)}


def _at_rest(terms: Terms) -> Terms:
    """What holds no velocity."""
    return {key: a for key, a in terms.items() if not split_velocities(key)[1]}


def linear_completion(names: Sequence[str], wanted: Sequence[Terms]) -> Expression | None:
    columns: dict[Monomial, list[Terms]] = {}
    wanted = [_in_one_square(terms) for terms in wanted]
    fresh = [(i, key) for i, terms in enumerate(wanted) for key in terms]
    if any(not _is_affine(key) for _, key in fresh):
        return None
    right, most = _numbered(wanted), 2 * bounds.COLUMNS + 4 * len(fresh)
    for _ in range(bounds.FEW):
        raised = dict.fromkeys(m for i, key in fresh for m in _answers(names, i, key) if m not in columns)
        fresh, added = [], sorted(raised, key=rank)[: most - len(columns)]
        if columns and not added:
            return None
        for m in added:
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
    if not varying or len(varying) > bounds.COLUMNS:
        return None
    plain = {m: expressions_without_acceleration(names, {m: Fraction(1)}) for m in varying if m}
    sides = [_by_varying(names, expressions) for expressions in (*plain.values(), wanted)]
    keys = list(dict.fromkeys(key for side in sides for key in side))
    trees = [[tree_of(side.get(key, {})) for side in sides] for key in keys]
    try:
        budget = Budget.short()
        ring = exact_ring([tree for row in trees for tree in row], [], 0, budget, slopes=False)
        found = reduced_rows([[ring.value(tree) for tree in row] for row in trees], range(len(sides)))
    except (TooLarge, ZeroDivisionError):
        return None
    if len(plain) in found.pivots:
        return None
    parts = [
        quotient_tree(ring, row[-1]) * monomial_tree(m)
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
