"""Answer questions about kinds of Lagrangians, each with a certificate that the checker confirms.

A Lagrangian whose Hessian is definite at a real point: a combination of the Lagrangians found with
a definite Hessian there proves a yes. Otherwise, for rational f, the prolonged Helmholtz conditions
at this point determine the space W of values of g = d2L/dv dv. A definite matrix in W proves a yes
if the system is involutive there; Y >= 0 with tr(Y w) = 0 on W proves a no.

A natural Lagrangian with friction (Mestdag, Sarlet, Crampin, arXiv:1004.0674, with D homogeneous):
E_i = dD/dv_i along f for L = T + A v - V and D = D_ij(q) v_i v_j/2. E_i is g_ij f^j plus terms of
degree 2, 1, 0 in v, so f is quadratic in v. With f = f_e + f_o, even and odd in v, T - V is a
Lagrangian of f_e, and g f_o = C v, where D is the symmetric and dA the antisymmetric part of C.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import chain, combinations, combinations_with_replacement, islice, product
from typing import Any, NamedTuple, cast

import mpmath
import numpy as np

from inverse_service import bounds, errors
from inverse_service.certificate import checker
from inverse_service.deadline import left, now
from inverse_service.decision import certify, deciding, helmholtz, solutions
from inverse_service.decision.deciding import Analysis, Decision
from inverse_service.decision.helmholtz import ANY_FRICTION, LagrangianKind
from inverse_service.decision.solutions import Statement, implied
from inverse_service.expressions import calculus, collecting, printing, terms as tm, tree as ex
from inverse_service.field import exact_field, matrices, modular, real_branch
from inverse_service.linear_pde import equations, involution
from inverse_service.mechanics import euler_lagrange, second_order_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search import ansatz, antiderivatives, row_factors, tidy
from inverse_service.solving import solving
from inverse_service.statements import reasons
from inverse_service.statements.questions import WITH_FRICTION, Question

_HOMOGENEOUS = ("riemannian", "finsler")
FAMILY = "natural, with friction"
HALF = Fraction(1, 2)
# The share of the time for a Lagrangian with friction that the search for one without friction may
# use.
_SHARE_OF_SEARCH = 0.7
Near = Mapping[ex.Symbol | ex.Velocity, Fraction]
DEFINITE_SUM = "a sum with a definite Hessian"
_DIGITS = 2


def question_about_kind(system: SecondOrderSystem, kind: LagrangianKind) -> Question:
    """The question about a kind: for L(q, q'), or for L(t, q, q') if f contains t."""
    return Question(timed=system.depends_on_time, kind=kind.name)


def answer_kind(
    solution: solutions.Solution,
    kind: LagrangianKind,
    near: Near,
    asked: solutions.SolveOptions,
    deadline: float,
) -> Statement:
    """The answer on the first branch for L(q, q'), or for L(t, q, q') if f contains t, at the
    requested point `near`.

    A known Lagrangian of this kind proves a yes; otherwise the conditions on all multipliers of the
    kind are decided.
    """
    main, system = solution.main, solution.system
    question = question_about_kind(system, kind)
    if system.depends_on_time and kind.name in _HOMOGENEOUS:
        return _open(question, reasons.NOT_HOMOGENEOUS)
    known = implied(question, solution.statements)
    if known is not None and known.checked == "valid":
        why = "no Lagrangian of any kind exists"
        return replace(known, question=question, why=why)
    try:
        analysis = deciding.analyze(system)
        if kind.name == WITH_FRICTION:
            given = tuple(
                second_order_system.on_branch(equation, system) for equation in asked.given
            )
            return answer_rayleigh(analysis, given, asked.seed, deadline)
        if kind.name == "positive_definite":
            return answer_definite(analysis, main, kind, near, asked.seed, deadline)
        return _of_known(analysis, main, kind, deadline) or decided(
            analysis, kind, asked.seed, deadline
        )
    except errors.IrreducibleAtoms as problem:
        return _open(question, reasons.irreducible(problem.detail))


def _of_known(
    analysis: deciding.Analysis,
    main: solutions.Statement,
    kind: LagrangianKind,
    deadline: float,
) -> Statement | None:
    """A yes by the first Lagrangian of an answer that, according to the checker, is of the kind."""
    question = question_about_kind(analysis.system, kind)
    answers = (
        Statement(
            question,
            "variational",
            lagrangian=one,
            certificate=certify.of_lagrangian(analysis, one.expression, question, kind),
        )
        for one in lagrangians_of(main)
    )
    return _first(confirm(answer, deadline) for answer in answers)


def _first(answers: Iterable[Statement | None]) -> Statement | None:
    return next((answer for answer in answers if answer is not None), None)


def lagrangians_of(main: solutions.Statement) -> Sequence[solutions.Lagrangian]:
    return () if main.lagrangian is None else (main.lagrangian, *main.other_lagrangians)


def decided(
    analysis: deciding.Analysis,
    kind: LagrangianKind,
    seed: int,
    deadline: float,
    even: SecondOrderSystem | None = None,
) -> Statement:
    """The answer from the conditions on all multipliers of the kind, for the system `even` if the
    kind refers to it.
    """
    question = question_about_kind(analysis.system, kind)
    if now() > deadline:
        return _open(question, reasons.NO_TIME_TO_BEGIN)
    limits = involution.Limits(deadline=deadline)
    own = None if even is not None else analysis
    found = deciding.decide(
        even or analysis.system, question, seed, limits, analysis=own, among=kind.derivations
    )
    if found.verdict == "undetermined":
        return _open(question, found.open)
    certificate = certify.of_decision(analysis, found, kind=kind)
    answer = Statement(question, found.verdict, certificate=certificate)
    if (proven := confirm(answer, deadline)) is not None:
        return proven
    is_possible = found.verdict == "variational"
    why = reasons.KIND_NOT_FOUND if is_possible else reasons.unconfirmed_kind(found.verdict)
    return _open(question, why)


def _open(question: Question, why: reasons.Open | None) -> Statement:
    return Statement(question, "undetermined", why)


def confirm(answer: Statement, deadline: float) -> Statement | None:
    """The answer if the checker confirms its certificate in the remaining time, else None."""
    proof = checker.check_certificate(answer.certificate, time_limit=left(deadline, 1.0))
    if proof.verdict != "valid":
        return None
    return replace(answer, exceptions=proof.exceptions, checked="valid")


# Natural Lagrangians with friction.


def quick_rayleigh(
    analysis: Analysis, given: Sequence[ex.Expression], deadline: float
) -> Statement | None:
    """The answer from the equations as written, E = M q'' + b with M the Hessian of T; None if they
    give none.
    """
    names = analysis.system.coordinates
    even, odd = (
        zip(*(parts_of_parity(equation, names) for equation in given), strict=True)
        if given
        else ((), ())
    )
    if any(isinstance(node, ex.Acceleration) for part in odd for node in ex.walk(part)):
        even = odd = ()  # factors of accelerations are not forces
    system = without_friction(analysis.system)
    for matching in (even, ()):
        found = list[Statement]()
        for tree in islice(row_factors.lagrangians_of_lines(system, matching), 2):
            pushes = [[-part for part in odd], list(odd)] if matching else [_push(analysis, tree)]
            answer = _first(_with_friction(analysis, tree, push, deadline) for push in pushes)
            found += [] if answer is None else [answer]
            # Where friction turns L by terms A v, that of another L may be a D alone.
            if answer is None or not _size(answer).turns:
                break
        if found:
            return min(found, key=_size)
    return None


class _Size(NamedTuple):
    """The numbers of terms of L and D together, and of those of L linear in the velocities."""

    terms: int
    turns: int


def _size(answer: Statement) -> _Size:
    assert answer.lagrangian is not None
    assert answer.dissipation is not None
    try:
        whole, drag = map(tm.terms_of, (answer.lagrangian.expression, answer.dissipation))
    except tm.TooManyTerms:
        return _Size(bounds.EXPANSION, 0)
    return _Size(len(whole) + len(drag), sum(tm.velocity_degree(key) == 1 for key in whole))


def answer_rayleigh(
    analysis: Analysis, given: Sequence[ex.Expression], seed: int, deadline: float
) -> Statement:
    """Yes with L and D, or no because f is not quadratic in v or its even part has no natural L."""
    found = quick_rayleigh(analysis, given, deadline) or _refuted(analysis, seed, deadline)
    return (
        found
        or _searched(analysis, seed, deadline)
        or _open(question_about_kind(analysis.system, _kind(analysis)), reasons.KIND_NOT_FOUND)
    )


def _kind(analysis: Analysis) -> LagrangianKind:
    return helmholtz.kind_named("rayleigh", analysis.system.coordinates)


def _refuted(analysis: Analysis, seed: int, deadline: float) -> Statement | None:
    """A no from the degree of f, the natural Lagrangians of its even part, or those with any
    friction.
    """
    system, kind = analysis.system, _kind(analysis)
    question, n = question_about_kind(system, kind), len(system.coordinates)
    rows = tuple(("S0", i, i, (0,) * (2 * n + question.timed)) for i in range(n))
    certificate = certify.of_decision(
        analysis, Decision("not_variational", question, 0, rows=rows), kind=kind
    )
    why = "f is not quadratic in the velocities"
    answer = Statement(question, "not_variational", why=why, certificate=certificate)
    if (proven := confirm(answer, deadline)) is not None:
        return proven
    found = (
        None
        if question.timed
        else decided(analysis, kind, seed, deadline, even=without_friction(system))
    )
    if (found is None or found.certificate is None) and (n > 2 or question.timed):
        found = decided(
            analysis, replace(kind, derivations=(ANY_FRICTION, *kind.derivations)), seed, deadline
        )
    return found if found is not None and found.verdict == "not_variational" else None


def _searched(analysis: Analysis, seed: int, deadline: float) -> Statement | None:
    """A yes from a natural Lagrangian of the even part of f, with a constant metric or found by the
    search.
    """
    system = analysis.system
    trees = chain(constant_metrics(system), _lagrangians_without_friction(system, seed, deadline))
    return _first(_with_friction(analysis, tree, _push(analysis, tree), deadline) for tree in trees)


def _lagrangians_without_friction(
    system: SecondOrderSystem, seed: int, deadline: float
) -> Iterator[ex.Expression]:
    """The Lagrangians L(q, q') found for the system without friction."""
    if now() < deadline:
        limit = _SHARE_OF_SEARCH * left(deadline)
        options = solutions.SolveOptions(
            time_dependent=False, seed=seed, time_limit=limit, conditions=False
        )
        found = solving.solve(without_friction(system), options).main
        yield from (one.expression for one in lagrangians_of(found))


def _with_friction(
    analysis: Analysis, tree: ex.Expression, push: Sequence[ex.Expression], deadline: float
) -> Statement | None:
    """A yes with L and D for T - V = `tree` and E_i(T - V) = push_i along f, if the checker
    confirms them.
    """
    try:
        split = _split(analysis.system, push)
    except tm.TooManyTerms:
        return None
    if split is None:
        return None
    drag, whole = split[0], tree + split[1]
    question = question_about_kind(analysis.system, _kind(analysis))
    found = certify.of_lagrangian(analysis, whole, question, _kind(analysis))
    certificate = found | {"dissipation": printing.to_text(drag)}
    shown = tidy.describe(analysis, whole, FAMILY)
    answer = Statement(
        question, "variational", lagrangian=shown, certificate=certificate, dissipation=drag
    )
    return confirm(answer, deadline)


def _split(
    system: SecondOrderSystem, push: Sequence[ex.Expression]
) -> tuple[ex.Expression, ex.Expression] | None:
    """D and A v for C v = push; None if the antisymmetric part of C is not closed."""
    v = [ex.Velocity(name) for name in system.coordinates]
    slopes = [[calculus.differentiate(part, w) for w in v] for part in push]
    pairs = [(i, j) for i in range(len(v)) for j in range(len(v))]
    drag = tm.tree_of(tm.terms_of(ex.add(*(HALF * slopes[i][j] * v[i] * v[j] for i, j in pairs))))
    rest = [calculus.differentiate(drag, w) - part for w, part in zip(v, push, strict=True)]
    terms = [tm.terms_of(part) for part in rest]
    linear = antiderivatives.Integrator(system).linear_terms(terms)
    return None if linear is None else (drag, tm.tree_of(linear))


def _push(analysis: Analysis, tree: ex.Expression) -> list[ex.Expression]:
    """E_i of a natural Lagrangian of the even part of f; the terms of degree 0 and 2 in v
    vanish.
    """
    names = analysis.system.coordinates
    found = euler_lagrange.euler_lagrange_residual(tree, names, analysis.system.accelerations)
    return [parts_of_parity(each, names).odd for each in found]


def constant_metrics(system: SecondOrderSystem) -> Iterator[ex.Expression]:
    """L = G_ij v_i v_j/2 + b_ij q_j v_i with rational coefficients for which g df/dv + b - b^T
    is symmetric.
    """
    names, n = system.coordinates, len(system.coordinates)
    pairs = [*combinations_with_replacement(range(n), 2)]
    metric, width = {pair: place for place, pair in enumerate(pairs)}, len(pairs) + n * n
    rows: dict[object, list[Fraction]] = {}
    try:
        slopes = [
            [tm.terms_of(calculus.differentiate(f, ex.Velocity(name))) for name in names]
            for f in system.accelerations
        ]
    except tm.TooManyTerms:
        return
    for i, j in combinations(range(n), 2):
        rows[i, j, tm.EMPTY] = [Fraction(4 * (k == len(pairs) + i * n + j)) for k in range(width)]
        for (a, b, sign), k in product(((i, j, 1), (j, i, -1)), range(n)):
            for key, value in slopes[k][b].items():
                row = rows.setdefault((i, j, key), [Fraction(0)] * width)
                row[metric[min(a, k), max(a, k)]] += sign * value
    v, q = [ex.Velocity(name) for name in names], [ex.Symbol(name) for name in names]
    basis = matrices.kernel([*rows.values()] or [[Fraction(0)] * width], width)
    for weights in ([1] * len(basis), [k + 1 for k in range(len(basis))]):
        whole = [
            sum((w * x for w, x in zip(weights, column, strict=True)), Fraction(0))
            for column in zip(*basis, strict=True)
        ]
        parts = [whole[k] / (1 + (i == j)) * v[i] * v[j] for k, (i, j) in enumerate(pairs)]
        turns = [whole[len(pairs) + i * n + j] * sign * q[b] * v[a]
                 for i, j in combinations(range(n), 2) for a, b, sign in ((i, j, 1), (j, i, -1))]  # fmt: skip
        yield ex.add(*parts, *turns)


def without_friction(system: SecondOrderSystem) -> SecondOrderSystem:
    even = tuple(parts_of_parity(f, system.coordinates).even for f in system.accelerations)
    return replace(system, accelerations=even, branch=None)


class ByParity(NamedTuple):
    """The even and the odd part of a formula in the velocities."""

    even: ex.Expression
    odd: ex.Expression


def parts_of_parity(formula: ex.Expression, names: Sequence[str]) -> ByParity:
    """The even and the odd part in the velocities."""
    turned = ex.substitute(formula, {ex.Velocity(name): -ex.Velocity(name) for name in names})
    found: Iterator[ex.Expression] = (HALF * (formula + other) for other in (turned, -turned))
    return ByParity(*map(tm.collected, found))


def values_at(
    analysis: deciding.Analysis, near: Near, question: Question, order: int
) -> tuple[list[matrices.Matrix] | None, tuple[deciding.RowName, ...]]:
    """A basis of the g at the point that the rows up to this order allow, and the rows used."""
    rows: list[tuple[deciding.RowName, ...]] = []

    def residues(seed: int) -> tuple[int, dict[tuple[int, int], int] | None]:
        prime = modular.safe_prime(seed)
        values = {name: modular.number_value(value, prime) for name, value in near.items()}
        prolongation = deciding.prolonged(
            analysis, modular.Point(prime, seed, variables=values), question, order
        )
        within = involution.consequences(prolongation, 0)
        used = sorted({row for basis in within for row in prolongation.echelon.trace({basis: 1})})
        rows.append(tuple(cast(deciding.RowName, prolongation.row_name(row)) for row in used))
        reduced, rank = matrices.matrix_of_rows(
            within.values(), prolongation.width(0), prime
        ).rref()
        width = reduced.ncols()
        return prime, {(i, j): int(reduced[i, j]) for i in range(rank) for j in range(width)} | {
            (-1, 0): rank
        }

    try:
        found = deciding.reconstructed(residues)
    except (modular.SingularPoint, exact_field.TooLarge):
        return None, ()
    if found is None:
        return None, ()
    n, size = (
        len(analysis.system.coordinates),
        2 * len(analysis.system.coordinates) + question.timed,
    )
    unknowns = helmholtz.unknowns_of(n, size)
    places = [
        [equations.column_of(unknowns, entry) for entry in row]
        for row in helmholtz.multiplier_matrix(n, size).entries
    ]
    width = n * (n + 1) // 2
    table = [[found[i, j] for j in range(width)] for i in range(int(found[-1, 0]))]
    basis = matrices.kernel(table or [[Fraction(0)] * width], width)
    return [
        tuple(tuple(v[column] * factor for column, factor in row) for row in places) for v in basis
    ], rows[0]


def answer_definite(
    analysis: Analysis,
    main: solutions.Statement,
    kind: LagrangianKind,
    given: Near,
    seed: int,
    deadline: float,
) -> Statement:
    """Whether L or -L can have a positive definite Hessian at the point `given`, completed by
    chosen values.

    Yes, with L if one was found, or no.
    """
    near, known = point_near(analysis, given), lagrangians_of(main)
    question = question_about_kind(analysis.system, kind)
    there = _real(analysis, near)
    if not real_branch.is_defined(analysis.accelerations, there) or not real_branch.are_positive(
        analysis.system.positive, there
    ):
        return _open(question, reasons.POINT_OUTSIDE)
    found = _definite_of_known(analysis, kind, known, near, deadline)
    if found is not None:
        return found
    if len(analysis.system.coordinates) > matrices.MOST:
        return _open(question, reasons.many_coordinates(matrices.MOST))
    if not deciding.is_rational(analysis) or ex.PI in deciding.symbols_of(analysis):
        return _open(question, reasons.NOT_RATIONAL)
    decision, member, order = None, None, 1
    while now() < deadline:  # start with two orders, which usually refute
        space, rows = values_at(analysis, near, question, order)
        member, orthogonal = (
            (None, None)
            if space is None
            else matrices.definite_or_orthogonal(space, len(analysis.system.coordinates))
        )
        if orthogonal is not None:
            refuted = deciding.Decision("not_variational", question, order, rows=rows)
            certificate = certify.of_decision(analysis, refuted, kind=kind) | _claim(
                near, "orthogonal", orthogonal
            )
            return _confirmed(question, certificate, "not_variational", deadline)
        if decision is not None:
            break
        decision = deciding.decide(
            analysis.system,
            question,
            seed,
            involution.Limits(deadline=deadline),
            analysis=analysis,
        )
        order = decision.order
        if (
            order <= 1 or decision.history[1][:1] == decision.history[order][:1]
        ):  # the same values as for two orders
            break
    if member is not None and decision is not None and decision.verdict == "variational":
        certificate = certify.of_decision(analysis, decision, kind=kind) | _claim(
            near, "multiplier", member
        )
        return _confirmed(question, certificate, "variational", deadline)
    return _open(question, (decision and decision.open) or reasons.NO_RATIONAL_MATRIX)


def point_near(analysis: deciding.Analysis, given: Near) -> Near:
    """The given point, completed by chosen values, with few digits if f is defined there."""
    table = analysis.real_point or {}
    found: dict[ex.Symbol | ex.Velocity, Fraction] = {}
    for digits in (_DIGITS, 20):
        ours = (
            (name, table.get(name, mpmath.mpf(1)))
            for name in deciding.variables_of(analysis.system)
        )
        found = {name: Fraction(mpmath.nstr(value, digits)) for name, value in ours} | dict(given)
        if real_branch.is_defined(analysis.accelerations, _real(analysis, found)):
            break
    return found


def _real(analysis: deciding.Analysis, near: Near) -> real_branch.RealTable:
    """The point in floating-point numbers, with chosen values of arbitrary functions."""
    return dict(analysis.real_point or {}) | {
        s: mpmath.mpf(x.numerator) / x.denominator for s, x in near.items()
    }


def _claim(near: Near, key: str, matrix: matrices.Matrix | None = None) -> dict[str, Any]:
    point = {
        s.name if isinstance(s, ex.Symbol) else f"{s.coordinate}'": str(value)
        for s, value in near.items()
    }
    return {"near": point} | ({key: [[str(x) for x in row] for row in matrix]} if matrix else {})


def _confirmed(
    question: Question, certificate: dict[str, Any], verdict: solutions.Verdict, deadline: float
) -> Statement:
    found = confirm(Statement(question, verdict, certificate=certificate), deadline)
    return found or _open(question, reasons.POINT_IS_SPECIAL)


def _definite_of_known(
    analysis: deciding.Analysis,
    kind: helmholtz.LagrangianKind,
    known: Sequence[solutions.Lagrangian],
    near: Near,
    deadline: float,
) -> Statement | None:
    """A yes by the first Lagrangian with a definite Hessian at the point, or by a sum of
    Lagrangians.
    """
    question, names, table = (
        question_about_kind(analysis.system, kind),
        analysis.system.coordinates,
        _real(analysis, near),
    )
    hessians = []
    for lagrangian in known:
        form = euler_lagrange.hessian_at(lagrangian.expression, names, table)
        if form is None:
            return None
        hessians.append(np.array(form.tolist(), float))
    for weights in ansatz.short_definite_weights(hessians[: bounds.COLUMNS]):
        parts = [(w, one) for w, one in zip(weights, known, strict=False) if w]
        alone = parts[0][1] if len(parts) == 1 and parts[0][0] == 1 else None
        whole = (
            alone.expression
            if alone
            else collecting.collect(ex.add(*(w * one.expression for w, one in parts)))
        )
        certificate = certify.of_lagrangian(analysis, whole, question, kind) | _claim(near, "")
        shown = alone or tidy.describe(analysis, whole, DEFINITE_SUM)
        answer = Statement(question, "variational", lagrangian=shown, certificate=certificate)
        if (found := confirm(answer, deadline)) is not None:
            return found
    return None
