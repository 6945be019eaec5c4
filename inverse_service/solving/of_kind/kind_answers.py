"""The answers about kinds of Lagrangians, each with a certificate that the checker confirms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from inverse_service import errors
from inverse_service.certificate import checker
from inverse_service.deadline import left, now
from inverse_service.decision import certify, deciding, solutions
from inverse_service.decision.kinds.helmholtz import LagrangianKind
from inverse_service.expressions.tree import Expression
from inverse_service.linear_pde.involution import Limits
from inverse_service.mechanics.second_order_system import SecondOrderSystem

_NO_TIME = "the time limit came before this question"
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
    exceptions: tuple[str, ...] = ()


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
