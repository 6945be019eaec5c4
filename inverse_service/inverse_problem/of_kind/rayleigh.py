"""Natural Lagrangians with friction: E_i = dD/dv_i along f for L = T + A v - V, D = D_ij(q) v_i v_j/2.

E_i is g_ij f^j and terms of degree 2, 1, 0 in v, so f is quadratic in v. With f = f_e + f_o, even and odd in v, T - V
is a Lagrangian of f_e, and g f_o = C v with D the symmetric part of C and dA its antisymmetric part (Mestdag, Sarlet,
Crampin, arXiv:1004.0674, with D homogeneous).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Expression, Velocity, add, multiply, negate, number, substitute, subtract
from inverse_service.inverse_problem.decision import certify
from inverse_service.inverse_problem.decision.analysis import Analysis
from inverse_service.inverse_problem.decision.deciding import Decision, decide
from inverse_service.inverse_problem.kinds.restricted import BUILDERS, LagrangianKind
from inverse_service.inverse_problem.of_kind.answering import NOT_FOUND, KindAnswer, is_valid
from inverse_service.inverse_problem.search.as_given import lagrangian_as_given
from inverse_service.inverse_problem.search.completion import completed
from inverse_service.inverse_problem.search.protocol import describe
from inverse_service.inverse_problem.search.terms import TooManyTerms, terms_of, tree_of
from inverse_service.linear_pde.deciding import Limits
from inverse_service.mechanics.euler_lagrange import hessian
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
            forces = [_parts(f, names)[1] for f in analysis.system.accelerations]
            pushes = [[negate(part) for part in odd], list(odd)] if matching else [_times(tree, names, forces)]
            for push in pushes:
                answer = _with_friction(analysis, tree, push, deadline)
                if answer is not None:
                    return answer
    return None


def answer_rayleigh(
    analysis: Analysis, given: Sequence[Expression], search: Search, seed: int, deadline: float
) -> KindAnswer:
    """Yes with L and D, or no: f is not quadratic in v, or no natural L belongs to its even part."""
    if analysis.system.depends_on_time:
        return KindAnswer("undetermined", "f contains t: no Lagrangian with friction is looked for")
    found = quick_rayleigh(analysis, given, deadline) or _refuted(analysis, seed, deadline)
    return found or _searched(analysis, search, deadline) or KindAnswer("undetermined", NOT_FOUND)


def with_rayleigh(names: Sequence[str]) -> LagrangianKind:
    """Natural with friction; its derivations are those of T - V, a Lagrangian of the even part of f."""
    return LagrangianKind("rayleigh", BUILDERS["natural"](names), "rayleigh")


def _kind(analysis: Analysis) -> LagrangianKind:
    return with_rayleigh(analysis.system.coordinates)


def _refuted(analysis: Analysis, seed: int, deadline: float) -> KindAnswer | None:
    n, kind = len(analysis.system.coordinates), _kind(analysis)
    cubic = Decision("not_variational", False, 0, rows=tuple(("S0", i, i, (0,) * (2 * n)) for i in range(n)))
    certificate = certify.of_decision(analysis, cubic, kind=kind)
    if is_valid(certificate, deadline):
        return KindAnswer("not_variational", "f is not quadratic in the velocities", certificate)
    system, limits = _without_friction(analysis.system), Limits(deadline=deadline)
    found = decide(system, False, seed, limits, among=kind.derivations)
    if found.verdict != "not_variational":
        return None
    certificate = certify.of_decision(analysis, found, kind=kind)
    return KindAnswer("not_variational", "", certificate) if is_valid(certificate, deadline) else None


def _searched(analysis: Analysis, search: Search, deadline: float) -> KindAnswer | None:
    names, forces = analysis.system.coordinates, analysis.system.accelerations
    for tree in search(_without_friction(analysis.system)) if time.monotonic() < deadline else ():
        push = _times(tree, names, [_parts(f, names)[1] for f in forces])
        answer = _with_friction(analysis, tree, push, deadline)
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
    whole = add(tree, linear)
    certificate = certify.of_lagrangian(analysis, whole, False, _kind(analysis)) | {"dissipation": to_text(drag)}
    if not is_valid(certificate, deadline):
        return None
    return KindAnswer("variational", "", certificate, describe(analysis, whole, FAMILY), drag)


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


def _times(tree: Expression, names: Sequence[str], forces: Sequence[Expression]) -> list[Expression]:
    return [add(*(multiply(g, f) for g, f in zip(row, forces, strict=True))) for row in hessian(tree, tuple(names))]


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
