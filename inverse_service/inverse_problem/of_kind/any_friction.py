"""Lagrangians with any friction: E_i = dD/dv_i along f for some D(t, q, v), decided by the rows of kinds/restricted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import combinations, combinations_with_replacement, product

from inverse_service.algebra.semidefinite import kernel
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    Expression,
    Symbol,
    Velocity,
    add,
    substitute,
)
from inverse_service.inverse_problem.decision import certify
from inverse_service.inverse_problem.decision.analysis import Analysis
from inverse_service.inverse_problem.kinds.restricted import LagrangianKind, kind_named
from inverse_service.inverse_problem.of_kind.kind_answers import KindAnswer, decided, is_valid
from inverse_service.inverse_problem.search.as_given import lagrangian_as_given
from inverse_service.inverse_problem.search.protocol import describe
from inverse_service.inverse_problem.search.terms import EMPTY, Terms, TooManyTerms, collected, terms_of, tree_of
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual
from inverse_service.mechanics.legendre.homogeneous import homogeneous_degree
from inverse_service.mechanics.second_order_system import SecondOrderSystem

FAMILY = "natural, with friction"
HALF = Fraction(1, 2)


def answer_general(
    analysis: Analysis, known: Sequence[Expression], given: Sequence[Expression], seed: int, deadline: float
) -> KindAnswer:
    """With any D(t, q, v): yes, with L and D where they were found, or no."""
    system = analysis.system
    as_given = (lagrangian_as_given(one, equations) for one in (system, without_friction(system))
                for equations in (given, ()))  # fmt: skip
    kind = kind_named("rayleigh_general", system.coordinates)
    for tree in (*known, *constant_metrics(system), *as_given):
        push = () if tree is None else euler_lagrange_residual(tree, system.coordinates, system.accelerations)
        drag = _primitive(system.coordinates, push)
        if tree is not None and drag is not None:
            answer = confirmed(analysis, kind, tree, drag, deadline)
            if answer is not None:
                return answer
    return decided(analysis, kind, seed, deadline)


def constant_metrics(system: SecondOrderSystem) -> Iterator[Expression]:
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
        parts = [whole[k] / (1 + (i == j)) * v[i] * v[j] for k, (i, j) in enumerate(pairs)]
        turns = [whole[len(pairs) + i * n + j] * sign * q[b] * v[a]
                 for i, j in combinations(range(n), 2) for a, b, sign in ((i, j, 1), (j, i, -1))]  # fmt: skip
        yield add(*parts, *turns)


def _primitive(names: Sequence[str], push: Sequence[Expression]) -> Expression | None:
    """D with dD/dv = push, if there is one: v_i push_i by its degrees in v; None where it is no sum of such terms."""
    v, found = [Velocity(name) for name in names], Terms()
    try:
        whole = terms_of(add(*(w * part for w, part in zip(v, push, strict=False))))
    except TooManyTerms:
        return None
    for key, value in whole.items():
        degree = homogeneous_degree(tree_of({key: value}), names)
        if not degree:
            return None
        found[key] = value / degree
    return tree_of(found)


def confirmed(
    analysis: Analysis, kind: LagrangianKind, tree: Expression, drag: Expression, deadline: float
) -> KindAnswer | None:
    found = certify.of_lagrangian(analysis, tree, analysis.system.depends_on_time, kind)
    certificate = found | {"dissipation": to_text(drag)}
    if not is_valid(certificate, deadline):
        return None
    return KindAnswer("variational", "", certificate, describe(analysis, tree, FAMILY), drag)


def without_friction(system: SecondOrderSystem) -> SecondOrderSystem:
    even = tuple(parts_of_parity(f, system.coordinates)[0] for f in system.accelerations)
    return replace(system, accelerations=even, branch=None)


def parts_of_parity(formula: Expression, names: Sequence[str]) -> tuple[Expression, Expression]:
    """Its parts that are even and odd in the velocities."""
    turned = substitute(formula, {Velocity(name): -Velocity(name) for name in names})
    found: Iterator[Expression] = (HALF * (formula + other) for other in (turned, -turned))
    even, odd = (collected(part) for part in found)
    return even, odd
