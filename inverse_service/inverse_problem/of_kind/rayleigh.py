"""Natural Lagrangians with friction: E_i = dD/dv_i along f for L = T + A v - V, D = D_ij(q) v_i v_j/2.

E_i is g_ij f^j and terms of degree 2, 1, 0 in v, so f is quadratic in v. With f = f_e + f_o, even and odd in v, T - V
is a Lagrangian of f_e, and g f_o = C v with D the symmetric part of C and dA its antisymmetric part (Mestdag, Sarlet,
Crampin, arXiv:1004.0674, with D homogeneous). With any D (rayleigh_general) the rows C and D decide: kinds/restricted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import chain, combinations, combinations_with_replacement, product

from inverse_service.algebra.semidefinite import kernel
from inverse_service.deadline import now
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    multiply,
    negate,
    number,
    substitute,
    subtract,
    walk,
)
from inverse_service.inverse_problem.decision import certify
from inverse_service.inverse_problem.decision.analysis import Analysis
from inverse_service.inverse_problem.decision.deciding import Decision
from inverse_service.inverse_problem.kinds.restricted import ANY_FRICTION, LagrangianKind, kind_named
from inverse_service.inverse_problem.of_kind.answering import NOT_FOUND, KindAnswer, decided, is_valid
from inverse_service.inverse_problem.search.as_given import lagrangian_as_given
from inverse_service.inverse_problem.search.completion import completed
from inverse_service.inverse_problem.search.protocol import describe
from inverse_service.inverse_problem.search.terms import EMPTY, Terms, TooManyTerms, terms_of, tree_of
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual
from inverse_service.mechanics.second_order_system import SecondOrderSystem

FAMILY = "natural, with friction"
_HALF = Fraction(1, 2)
# Natural Lagrangians of a system without friction; a search for them takes its time.
Search = Callable[[SecondOrderSystem], Sequence[Expression]]


def quick_rayleigh(analysis: Analysis, given: Sequence[Expression], deadline: float) -> KindAnswer | None:
    """By the equations as they were written: E = M q'' + b with M the Hessian of T; None where that gives none."""
    names = analysis.system.coordinates
    even, odd = zip(*(_parts(equation, names) for equation in given), strict=True) if given else ((), ())
    system = _without_friction(analysis.system)
    for matching in (even, ()):
        tree = lagrangian_as_given(system, matching)
        if tree is not None:
            pushes = [[negate(part) for part in odd], list(odd)] if matching else [_push(analysis, tree)]
            for push in pushes:
                answer = _with_friction(analysis, tree, push, deadline)
                if answer is not None:
                    return answer
    return None


def answer_rayleigh(
    analysis: Analysis, given: Sequence[Expression], search: Search, seed: int, deadline: float
) -> KindAnswer:
    """Yes with L and D, or no: f is not quadratic in v, or no natural L belongs to its even part."""
    found = quick_rayleigh(analysis, given, deadline) or _refuted(analysis, seed, deadline)
    return found or _searched(analysis, search, deadline) or KindAnswer("undetermined", NOT_FOUND)


def answer_general(
    analysis: Analysis, known: Sequence[Expression], given: Sequence[Expression], seed: int, deadline: float
) -> KindAnswer:
    """With any D(t, q, v): yes, with L and D where they were found, or no."""
    system = analysis.system
    as_given = (lagrangian_as_given(one, equations) for one in (system, _without_friction(system))
                for equations in (given, ()))  # fmt: skip
    kind = kind_named("rayleigh_general", system.coordinates)
    for tree in (*known, *_constant_metrics(system), *as_given):
        push = () if tree is None else euler_lagrange_residual(tree, system.coordinates, system.accelerations)
        drag = _primitive(system.coordinates, push)
        if tree is not None and drag is not None:
            answer = _confirmed(analysis, kind, tree, drag, deadline)
            if answer is not None:
                return answer
    return decided(analysis, kind, seed, deadline)


def _constant_metrics(system: SecondOrderSystem) -> Iterator[Expression]:
    """L = G_ij v_i v_j/2 + b_ij q_j v_i with rational numbers: g df/dv + 2 b - 2 b^T is symmetric."""
    names, n = system.coordinates, len(system.coordinates)
    pairs = [*combinations_with_replacement(range(n), 2)]
    metric, width = {pair: place for place, pair in enumerate(pairs)}, len(pairs) + n * n
    rows: dict[object, list[Fraction]] = {}
    try:
        slopes = [[terms_of(differentiate(f, Velocity(name))) for name in names] for f in system.accelerations]
    except TooManyTerms:
        return
    for i, j in combinations(range(n), 2):
        rows[i, j, EMPTY] = [Fraction(4 * (k == len(pairs) + i * n + j)) for k in range(width)]
        for (a, b, sign), k in product(((i, j, 1), (j, i, -1)), range(n)):
            for key, value in slopes[k][b].items():
                row = rows.setdefault((i, j, key), [Fraction(0)] * width)
                row[metric[min(a, k), max(a, k)]] += sign * value
    v, q = [Velocity(name) for name in names], [Symbol(name) for name in names]
    basis = kernel([*rows.values()] or [[Fraction(0)] * width], width)
    for weights in ([1] * len(basis), [k + 1 for k in range(len(basis))]):
        whole = [
            sum((w * x for w, x in zip(weights, column, strict=True)), Fraction(0))
            for column in zip(*basis, strict=True)
        ]
        parts = [multiply(number(whole[k] / (1 + (i == j))), v[i], v[j]) for k, (i, j) in enumerate(pairs)]
        turns = [multiply(number(whole[len(pairs) + i * n + j] * sign), q[b], v[a])
                 for i, j in combinations(range(n), 2) for a, b, sign in ((i, j, 1), (j, i, -1))]  # fmt: skip
        yield add(*parts, *turns)


def _primitive(names: Sequence[str], push: Sequence[Expression]) -> Expression | None:
    """D with dD/dv = push, if there is one: v_i push_i by its degrees in v; None where it is no sum of such terms."""
    v, found = [Velocity(name) for name in names], Terms()
    try:
        whole = terms_of(add(*(multiply(w, part) for w, part in zip(v, push, strict=False))))
    except TooManyTerms:
        return None
    for key, value in whole.items():
        degree = _degree(tree_of({key: value}))
        if not degree:
            return None
        found[key] = value / degree
    return tree_of(found)


def _degree(tree: Expression) -> Fraction | None:
    """In the velocities, of which the tree is a homogeneous function; None where that is not seen."""
    match tree:
        case Velocity():
            return Fraction(1)
        case Sum(parts):
            degrees = {*map(_degree, parts)}
            return degrees.pop() if len(degrees) == 1 else None
        case Product(parts):
            found = [*map(_degree, parts)]
            return None if None in found else sum((each for each in found if each is not None), Fraction(0))
        case Power(base, Number(exponent)) if (degree := _degree(base)) is not None:
            return degree * exponent
        case _:
            return None if any(isinstance(node, Velocity) for node in walk(tree)) else Fraction(0)


def _kind(analysis: Analysis) -> LagrangianKind:
    return kind_named("rayleigh", analysis.system.coordinates)


def _refuted(analysis: Analysis, seed: int, deadline: float) -> KindAnswer | None:
    """By the degree of f, the natural Lagrangians of its even part, or those with any friction."""
    system, kind, with_time = analysis.system, _kind(analysis), analysis.system.depends_on_time
    n = len(system.coordinates)
    rows = tuple(("S0", i, i, (0,) * (2 * n + with_time)) for i in range(n))
    certificate = certify.of_decision(analysis, Decision("not_variational", with_time, 0, rows=rows), kind=kind)
    if is_valid(certificate, deadline):
        return KindAnswer("not_variational", "f is not quadratic in the velocities", certificate)
    found = None if with_time else decided(analysis, kind, seed, deadline, even=_without_friction(system))
    if (found is None or found.certificate is None) and (n > 2 or with_time):
        found = decided(analysis, replace(kind, derivations=(ANY_FRICTION, *kind.derivations)), seed, deadline)
    return found if found is not None and found.verdict == "not_variational" else None


def _searched(analysis: Analysis, search: Search, deadline: float) -> KindAnswer | None:
    system = analysis.system
    searched = search(_without_friction(system)) if now() < deadline else ()
    for tree in chain(_constant_metrics(system), searched):
        answer = _with_friction(analysis, tree, _push(analysis, tree), deadline)
        if answer is not None:
            return answer
    return None


def _with_friction(
    analysis: Analysis, tree: Expression, push: Sequence[Expression], deadline: float
) -> KindAnswer | None:
    """L and D for T - V = `tree` and E_i(T - V) = push_i along f, if the checker confirms them."""
    try:
        split = _split(analysis.system.coordinates, push)
    except TooManyTerms:
        return None
    if split is None:
        return None
    drag, linear = split
    return _confirmed(analysis, _kind(analysis), add(tree, linear), drag, deadline)


def _confirmed(
    analysis: Analysis, kind: LagrangianKind, tree: Expression, drag: Expression, deadline: float
) -> KindAnswer | None:
    found = certify.of_lagrangian(analysis, tree, analysis.system.depends_on_time, kind)
    certificate = found | {"dissipation": to_text(drag)}
    if not is_valid(certificate, deadline):
        return None
    return KindAnswer("variational", "", certificate, describe(analysis, tree, FAMILY), drag)


def _split(names: Sequence[str], push: Sequence[Expression]) -> tuple[Expression, Expression] | None:
    """D and A v for C v = push; None where the antisymmetric part of C is not closed."""
    v = [Velocity(name) for name in names]
    slopes = [[differentiate(part, w) for w in v] for part in push]
    pairs = [(i, j) for i in range(len(v)) for j in range(len(v))]
    drag = tree_of(terms_of(add(*(multiply(number(_HALF), slopes[i][j], v[i], v[j]) for i, j in pairs))))
    rest = [subtract(differentiate(drag, w), part) for w, part in zip(v, push, strict=True)]
    terms = [terms_of(part) for part in rest]
    linear = completed(tuple(names), terms) if any(terms) else number(0)
    return None if linear is None else (drag, linear)


def _push(analysis: Analysis, tree: Expression) -> list[Expression]:
    """E_i of a natural Lagrangian of the even part of f; what E has of degree 0 and 2 in v vanishes."""
    names = analysis.system.coordinates
    found = euler_lagrange_residual(tree, names, analysis.system.accelerations)
    return [_parts(each, names)[1] for each in found]


def _without_friction(system: SecondOrderSystem) -> SecondOrderSystem:
    even = tuple(_parts(f, system.coordinates)[0] for f in system.accelerations)
    return replace(system, accelerations=even, branch=None)


def _parts(formula: Expression, names: Sequence[str]) -> tuple[Expression, Expression]:
    """Its parts that are even and odd in the velocities."""
    turned = substitute(formula, {Velocity(name): negate(Velocity(name)) for name in names})
    found: Iterator[Expression] = (multiply(number(_HALF), add(formula, other)) for other in (turned, negate(turned)))
    even, odd = (collected(part) for part in found)
    return even, odd


def collected(tree: Expression) -> Expression:
    """The tree as a sum of monomials, unless there are too many."""
    try:
        return tree_of(terms_of(tree))
    except TooManyTerms:
        return tree
