"""The answers about kinds of Lagrangians, each with a certificate that the checker confirms.

Natural Lagrangians with friction, the lower half: E_i = dD/dv_i along f for L = T + A v - V, D = D_ij(q) v_i v_j/2.

E_i is g_ij f^j and terms of degree 2, 1, 0 in v, so f is quadratic in v. With f = f_e + f_o, even and odd in v, T - V
is a Lagrangian of f_e, and g f_o = C v with D the symmetric part of C and dA its antisymmetric part (Mestdag, Sarlet,
Crampin, arXiv:1004.0674, with D homogeneous).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, combinations, combinations_with_replacement, product
from typing import Any

from inverse_service import errors
from inverse_service.certificate import checker
from inverse_service.deadline import left, now
from inverse_service.decision import certify, deciding, solutions
from inverse_service.decision.deciding import Analysis, Decision
from inverse_service.decision.kinds.helmholtz import ANY_FRICTION, LagrangianKind, kind_named
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Acceleration, Expression, Symbol, Velocity, add, substitute, walk
from inverse_service.field.matrices import kernel
from inverse_service.linear_pde.involution import Limits
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search import protocol, row_factors
from inverse_service.search.gradients import Integrator
from inverse_service.search.terms import EMPTY, TooManyTerms, collected, terms_of, tree_of

_NO_TIME = "the time limit was reached before this question"
NOT_FOUND = "the conditions on the multiplier leave such a Lagrangian possible, but none was found"
_HOMOGENEOUS = ("riemannian", "finsler")


@dataclass(frozen=True, slots=True)
class KindAnswer:
    """Whether there is a regular Lagrangian of a kind; `dissipation` is D where it is one with friction.

    The proof is one for general parameters: `exceptions` are equations between them where it is none.
    """

    verdict: solutions.Verdict
    reason: str = ""
    certificate: Mapping[str, Any] | None = None
    lagrangian: solutions.Lagrangian | None = None
    dissipation: Expression | None = None
    exceptions: Sequence[str] = ()


def answer_kind(
    solution: solutions.Solution, kind: LagrangianKind, asked: solutions.SolveOptions, deadline: float
) -> KindAnswer:
    """The answer on the first branch, of L(q, q'), of L(t, q, q') where f contains t.

    A Lagrangian that was found already and is of the kind is a yes; else the conditions on all multipliers of the
    kind are decided.
    """
    main = solution.main
    if solution.system.depends_on_time and kind.name in _HOMOGENEOUS:
        return KindAnswer("undetermined", "f contains t: no homogeneous Lagrangian is looked for")
    if main is not None and main.verdict == "not_variational" and main.checked == "valid":
        return of_no(main)
    try:
        analysis = deciding.analyze(solution.system)
        return _of_known(analysis, main, kind, deadline) or decided(analysis, kind, asked.seed, deadline)
    except errors.IrreducibleAtoms as problem:
        return KindAnswer("undetermined", problem.detail)


def _of_known(
    analysis: deciding.Analysis, main: solutions.Answer | None, kind: LagrangianKind, deadline: float
) -> KindAnswer | None:
    """The first Lagrangian of an answer that the checker finds to be of the kind."""
    with_time = analysis.system.depends_on_time
    for lagrangian in lagrangians_of(main):
        certificate = certify.of_lagrangian(analysis, lagrangian.expression, with_time, kind)
        found = confirmed(KindAnswer("variational", "", certificate, lagrangian), deadline)
        if found is not None:
            return found
    return None


def lagrangians_of(main: solutions.Answer | None) -> Sequence[solutions.Lagrangian]:
    return () if main is None or main.lagrangian is None else (main.lagrangian, *main.other_lagrangians)


def decided(
    analysis: deciding.Analysis, kind: LagrangianKind, seed: int, deadline: float, even: SecondOrderSystem | None = None
) -> KindAnswer:
    """By the conditions on all multipliers of the kind; those of a system `even` where the kind speaks of that."""
    if now() > deadline:
        return KindAnswer("undetermined", _NO_TIME)
    with_time, limits = analysis.system.depends_on_time, Limits(deadline=deadline)
    own = None if even is not None else analysis
    found = deciding.decide(even or analysis.system, with_time, seed, limits, analysis=own, among=kind.derivations)
    if found.verdict == "undetermined":
        return KindAnswer("undetermined", found.reason)
    answer = KindAnswer(found.verdict, "", certify.of_decision(analysis, found, kind=kind))
    if (proven := confirmed(answer, deadline)) is not None:
        return proven
    words = found.verdict.replace("_", " ")
    return KindAnswer(
        "undetermined",
        NOT_FOUND if found.verdict == "variational" else f"found {words}, but the check could not confirm it",
    )


def of_no(main: solutions.Answer) -> KindAnswer:
    """Where there is no Lagrangian there is none of a kind."""
    reason = "no Lagrangian of any kind exists"
    return KindAnswer("not_variational", reason, main.certificate, exceptions=main.exceptions)


def confirmed(answer: KindAnswer, deadline: float) -> KindAnswer | None:
    """The answer, where the checker confirms its certificate in the time that is left."""
    proof = checker.check_certificate(answer.certificate, time_limit=left(deadline, 1.0))
    return replace(answer, exceptions=proof.exceptions) if proof.verdict == "valid" else None


# Natural Lagrangians with friction.

FAMILY = "natural, with friction"
HALF = Fraction(1, 2)
# Natural Lagrangians of a system without friction; a search for them takes its time.
Search = Callable[[SecondOrderSystem], Sequence[Expression]]


def quick_rayleigh(analysis: Analysis, given: Sequence[Expression], deadline: float) -> KindAnswer | None:
    """By the equations as they were written: E = M q'' + b with M the Hessian of T; None where that gives none."""
    names = analysis.system.coordinates
    even, odd = zip(*(parts_of_parity(equation, names) for equation in given), strict=True) if given else ((), ())
    if any(isinstance(node, Acceleration) for part in odd for node in walk(part)):
        even = odd = ()  # what multiplies an acceleration is no force
    system = without_friction(analysis.system)
    for matching in (even, ()):
        tree = row_factors.lagrangian_as_given(system, matching)
        if tree is not None:
            pushes = [[-part for part in odd], list(odd)] if matching else [_push(analysis, tree)]
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


def _kind(analysis: Analysis) -> LagrangianKind:
    return kind_named("rayleigh", analysis.system.coordinates)


def _refuted(analysis: Analysis, seed: int, deadline: float) -> KindAnswer | None:
    """By the degree of f, the natural Lagrangians of its even part, or those with any friction."""
    system, kind, with_time = analysis.system, _kind(analysis), analysis.system.depends_on_time
    n = len(system.coordinates)
    rows = tuple(("S0", i, i, (0,) * (2 * n + with_time)) for i in range(n))
    certificate = certify.of_decision(analysis, Decision("not_variational", with_time, 0, rows=rows), kind=kind)
    answer = KindAnswer("not_variational", "f is not quadratic in the velocities", certificate)
    if (proven := confirmed(answer, deadline)) is not None:
        return proven
    found = None if with_time else decided(analysis, kind, seed, deadline, even=without_friction(system))
    if (found is None or found.certificate is None) and (n > 2 or with_time):
        found = decided(analysis, replace(kind, derivations=(ANY_FRICTION, *kind.derivations)), seed, deadline)
    return found if found is not None and found.verdict == "not_variational" else None


def _searched(analysis: Analysis, search: Search, deadline: float) -> KindAnswer | None:
    system = analysis.system
    searched = search(without_friction(system)) if now() < deadline else ()
    for tree in chain(constant_metrics(system), searched):
        answer = _with_friction(analysis, tree, _push(analysis, tree), deadline)
        if answer is not None:
            return answer
    return None


def _with_friction(
    analysis: Analysis, tree: Expression, push: Sequence[Expression], deadline: float
) -> KindAnswer | None:
    """L and D for T - V = `tree` and E_i(T - V) = push_i along f, if the checker confirms them."""
    try:
        split = _split(analysis.system, push)
    except TooManyTerms:
        return None
    if split is None:
        return None
    drag, linear = split
    return with_drag(analysis, _kind(analysis), tree + linear, drag, deadline)


def _split(system: SecondOrderSystem, push: Sequence[Expression]) -> tuple[Expression, Expression] | None:
    """D and A v for C v = push; None where the antisymmetric part of C is not closed."""
    v = [Velocity(name) for name in system.coordinates]
    slopes = [[differentiate(part, w) for w in v] for part in push]
    pairs = [(i, j) for i in range(len(v)) for j in range(len(v))]
    drag = tree_of(terms_of(add(*(HALF * slopes[i][j] * v[i] * v[j] for i, j in pairs))))
    rest = [differentiate(drag, w) - part for w, part in zip(v, push, strict=True)]
    terms = [terms_of(part) for part in rest]
    linear = Integrator(system).linear_terms(terms)
    return None if linear is None else (drag, tree_of(linear))


def _push(analysis: Analysis, tree: Expression) -> list[Expression]:
    """E_i of a natural Lagrangian of the even part of f; what E has of degree 0 and 2 in v vanishes."""
    names = analysis.system.coordinates
    found = euler_lagrange_residual(tree, names, analysis.system.accelerations)
    return [parts_of_parity(each, names)[1] for each in found]


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


def with_drag(
    analysis: Analysis, kind: LagrangianKind, tree: Expression, drag: Expression, deadline: float
) -> KindAnswer | None:
    found = certify.of_lagrangian(analysis, tree, analysis.system.depends_on_time, kind)
    certificate = found | {"dissipation": to_text(drag)}
    return confirmed(
        KindAnswer("variational", "", certificate, protocol.describe(analysis, tree, FAMILY), drag), deadline
    )


def without_friction(system: SecondOrderSystem) -> SecondOrderSystem:
    even = tuple(parts_of_parity(f, system.coordinates)[0] for f in system.accelerations)
    return replace(system, accelerations=even, branch=None)


def parts_of_parity(formula: Expression, names: Sequence[str]) -> tuple[Expression, Expression]:
    """Its parts that are even and odd in the velocities."""
    turned = substitute(formula, {Velocity(name): -Velocity(name) for name in names})
    found: Iterator[Expression] = (HALF * (formula + other) for other in (turned, -turned))
    even, odd = (collected(part) for part in found)
    return even, odd
