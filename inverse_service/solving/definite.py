"""Is there a Lagrangian whose Hessian is definite at a real point?

Among the Lagrangians found, a combination with a definite Hessian there is a yes. Else, for rational f, the values W
that g = d2L/dv dv can take at the point follow from the prolonged Helmholtz conditions with this very point put in: a
definite matrix in W is a yes where the system is involutive there, Y >= 0 with tr(Y w) = 0 on W a no.
"""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, cast

import mpmath
import numpy as np

from inverse_service import bounds, errors
from inverse_service.deadline import now
from inverse_service.decision import certify, deciding, solutions
from inverse_service.decision.kinds import helmholtz
from inverse_service.expressions import collecting, tree as ex
from inverse_service.field import matrices, modular, null_vectors, real_point
from inverse_service.field.point import Point, SingularPoint, number_value
from inverse_service.linear_pde import equations, involution
from inverse_service.mechanics import euler_lagrange
from inverse_service.search import members, protocol
from inverse_service.solving import kind_answers

Near = Mapping[ex.Symbol | ex.Velocity, Fraction]


def values_at(
    analysis: deciding.Analysis, near: Near, with_time: bool, order: int
) -> tuple[list[matrices.Matrix] | None, tuple[deciding.RowName, ...]]:
    """A basis of the g that the rows to this order leave at the point, and the rows that say so."""
    rows: list[tuple[deciding.RowName, ...]] = []

    def residues(seed: int) -> tuple[int, dict[tuple[int, int], int] | None]:
        prime = modular.safe_prime(seed)
        values = {name: number_value(value, prime) for name, value in near.items()}
        prolongation = deciding.prolonged(analysis, Point(prime, seed, variables=values), with_time, order)
        within = involution.consequences(prolongation, 0)
        used = sorted({row for basis in within for row in prolongation.echelon.trace({basis: 1})})
        rows.append(tuple(cast(deciding.RowName, prolongation.row_name(row)) for row in used))
        reduced, rank = null_vectors.table_of(within.values(), prolongation.width(0), prime).rref()
        width = reduced.ncols()
        return prime, {(i, j): int(reduced[i, j]) for i in range(rank) for j in range(width)} | {(-1, 0): rank}

    try:
        found = deciding.reconstructed(residues)
    except SingularPoint:
        return None, ()
    if found is None:
        return None, ()
    n, size = len(analysis.system.coordinates), 2 * len(analysis.system.coordinates) + with_time
    unknowns = helmholtz.unknowns_of(n, size)
    places = [[equations.column_of(unknowns, entry) for entry in row] for row in helmholtz.matrix_of(n, size).entries]
    width = n * (n + 1) // 2
    table = [[found[i, j] for j in range(width)] for i in range(int(found[-1, 0]))]
    basis = (
        matrices.kernel(table, width)
        if table
        else [[Fraction(int(i == j)) for j in range(width)] for i in range(width)]
    )
    return [tuple(tuple(v[column] * factor for column, factor in row) for row in places) for v in basis], rows[0]


FAMILY = "a sum with a definite Hessian"
IRRATIONAL = "f is not rational, and none of the Lagrangians found has a definite Hessian at this point"
_OPEN = (
    "no matrix of rational numbers was found that decides this; matrices of algebraic numbers may, but are not tried"
)
OUTSIDE = "f has no value at this point, or the point belongs to another branch of signs"
_SPECIAL = "the check could not confirm that g takes the same values at this point as at a generic one"
_DIGITS = 2


def answer_definite(
    solution: solutions.Solution, kind: helmholtz.LagrangianKind, given: Near, seed: int, deadline: float
) -> kind_answers.KindAnswer:
    """Yes, with L where one was found, or no, at the point `given`, which is ours where it says nothing.

    Definite is positive definite for L or for -L.
    """
    main = solution.main
    if main is not None and main.verdict == "not_variational" and main.checked == "valid":
        return kind_answers.of_no(main)
    try:
        analysis = deciding.analyze(solution.system)
    except errors.IrreducibleAtoms as problem:
        return kind_answers.KindAnswer("undetermined", problem.detail)
    near, known = point_near(analysis, given), kind_answers.lagrangians_of(main)
    there = _real(analysis, near)
    if not real_point.is_defined(analysis.accelerations, there) or not real_point.are_positive(
        analysis.system.positive, there
    ):
        return kind_answers.KindAnswer("undetermined", OUTSIDE)
    found = _of_known(analysis, kind, known, near, deadline)
    if found is not None:
        return found
    if len(analysis.system.coordinates) > matrices.MOST:
        return kind_answers.KindAnswer("undetermined", f"this is decided for at most {matrices.MOST} coordinates")
    if not deciding.is_rational(analysis) or ex.PI in deciding.symbols_of(analysis):
        return kind_answers.KindAnswer("undetermined", IRRATIONAL)
    with_time, decision, member, order = analysis.system.depends_on_time, None, None, 1
    while now() < deadline:  # first what two orders say, which mostly refutes
        space, rows = values_at(analysis, near, with_time, order)
        member, orthogonal = (
            (None, None) if space is None else matrices.definite_or_orthogonal(space, len(analysis.system.coordinates))
        )
        if orthogonal is not None:
            refuted = deciding.Decision("not_variational", with_time, order, rows=rows)
            certificate = certify.of_decision(analysis, refuted, kind=kind) | _claim(near, "orthogonal", orthogonal)
            return _confirmed(certificate, "not_variational", deadline)
        if decision is not None:
            break
        decision = deciding.decide(
            analysis.system, with_time, seed, involution.Limits(deadline=deadline), analysis=analysis
        )
        order = decision.order
        if order <= 1 or decision.history[1][:1] == decision.history[order][:1]:  # the values are those of two orders
            break
    if member is not None and decision is not None and decision.verdict == "variational":
        certificate = certify.of_decision(analysis, decision, kind=kind) | _claim(near, "multiplier", member)
        return _confirmed(certificate, "variational", deadline)
    return kind_answers.KindAnswer("undetermined", _OPEN if decision is None else decision.reason or _OPEN)


def point_near(analysis: deciding.Analysis, given: Near) -> Near:
    """The given point, completed by values of our choice, with few digits where f is defined there."""
    table = analysis.real_point or {}
    found: dict[ex.Symbol | ex.Velocity, Fraction] = {}
    for digits in (_DIGITS, 20):
        ours = ((name, table.get(name, mpmath.mpf(1))) for name in deciding.variables_of(analysis.system))
        found = {name: Fraction(mpmath.nstr(value, digits)) for name, value in ours} | dict(given)
        if real_point.is_defined(analysis.accelerations, _real(analysis, found)):
            break
    return found


def _real(analysis: deciding.Analysis, near: Near) -> real_point.RealTable:
    """The point in floating numbers, with our values of arbitrary functions."""
    return dict(analysis.real_point or {}) | {s: mpmath.mpf(x.numerator) / x.denominator for s, x in near.items()}


def _claim(near: Near, key: str, matrix: matrices.Matrix | None = None) -> dict[str, Any]:
    point = {s.name if isinstance(s, ex.Symbol) else f"{s.coordinate}'": str(value) for s, value in near.items()}
    return {"near": point} | ({key: [[str(x) for x in row] for row in matrix]} if matrix else {})


def _confirmed(certificate: dict[str, Any], verdict: solutions.Verdict, deadline: float) -> kind_answers.KindAnswer:
    found = kind_answers.confirmed(kind_answers.KindAnswer(verdict, "", certificate), deadline)
    return found or kind_answers.KindAnswer("undetermined", _SPECIAL)


def _of_known(
    analysis: deciding.Analysis,
    kind: helmholtz.LagrangianKind,
    known: Sequence[solutions.Lagrangian],
    near: Near,
    deadline: float,
) -> kind_answers.KindAnswer | None:
    """The first Lagrangian with a definite Hessian at the point, or a sum of them."""
    with_time, names, table = analysis.system.depends_on_time, analysis.system.coordinates, _real(analysis, near)
    hessians = []
    for lagrangian in known:
        form = euler_lagrange.hessian_at(lagrangian.expression, names, table)
        if form is None:
            return None
        hessians.append(np.array(form.tolist(), float))
    for weights in members.definite_weights(hessians[: bounds.COLUMNS]):
        parts = [(w, one) for w, one in zip(weights, known, strict=False) if w]
        alone = parts[0][1] if len(parts) == 1 and parts[0][0] == 1 else None
        whole = alone.expression if alone else collecting.collect(ex.add(*(w * one.expression for w, one in parts)))
        certificate = certify.of_lagrangian(analysis, whole, with_time, kind) | _claim(near, "")
        shown = alone or protocol.describe(analysis, whole, FAMILY)
        answer = kind_answers.KindAnswer("variational", "", certificate, shown)
        if (found := kind_answers.confirmed(answer, deadline)) is not None:
            return found
    return None
