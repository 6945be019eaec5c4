"""What leaves as an answer: the checker confirms each Lagrangian and certificate first."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from inverse_service.certificate.checker import CheckResult
from inverse_service.deadline import left, now
from inverse_service.decision import certify
from inverse_service.decision.solutions import Answer, Lagrangian, Solution, Step
from inverse_service.errors import CertificateRefused
from inverse_service.explanation.positive import hamiltonian_of, legendre_steps, verification_steps
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Arbitrary, Expression, walk
from inverse_service.search.protocol import Found, SearchOutcome, describe, is_multiple, why_shown

if TYPE_CHECKING:
    from inverse_service.decision.deciding import Analysis, Decision
    from inverse_service.decision.solutions import Conditions, SoFar, SolveOptions
    from inverse_service.mechanics.second_order_system import SecondOrderSystem

Progress = Callable[[str], None]
# Work that takes longer tells what is confirmed meanwhile, s.
_AT_ONCE = 0.05
NOT_YET = "This is not settled yet."
log = logging.getLogger(__name__)


@dataclass(slots=True)
class Work:
    """What the stages of one solve share."""

    analysis: Analysis
    options: SolveOptions
    progress: Progress
    deadline: float
    seconds: dict[str, float] = field(default_factory=dict)
    points: list[Mapping[str, int]] = field(default_factory=list)
    outcome: SearchOutcome | None = None
    autonomous: Decision | None = None
    reasons: tuple[Step, ...] = ()
    refused: set[tuple[str, bool]] = field(default_factory=set)
    began: float = field(default_factory=now)
    # The conditions written out, what is confirmed of each question (with t: True), and the
    # parts for which the time was over.
    printed: Conditions | None = None
    answers: dict[bool, Answer] = field(default_factory=dict)
    cut: dict[str, str] = field(default_factory=dict)

    def add_seconds(self, stage: str, began: float) -> None:
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now() - began

    def left(self) -> float:
        return self.deadline - now()

    def open_answer(self) -> Answer:
        """That of a question which is not settled."""
        return Answer("undetermined", reason=NOT_YET)


def _placed(work: Work, answer: Answer) -> Answer:
    """The answer with the set on which the checker proved it."""
    if answer.certificate is None:
        return answer
    certificate, proof = certify.proved(work.analysis, dict(answer.certificate), left(work.deadline, 1.0))
    names = work.analysis.system.names
    integrals = {name: tuple(one["arguments"]) for name, one in certificate.get("integrals", {}).items()}
    where = certify.where_of(proof.cell, replace(names, functions={**names.functions, **integrals}))
    return replace(
        answer,
        certificate=certificate,
        positive=where.positive,
        nonzero=where.nonzero,
        sides=where.sides,
        one_side=where.one_side,
        exceptions=proof.exceptions,
    )


def telling(work: Work, decision: Decision) -> Progress:
    """The progress of a search; one that takes longer tells that there is a Lagrangian, once the checker agrees."""

    def report(stage: str) -> None:
        is_known = decision.with_time in work.answers
        if work.options.hand_over is not None and not is_known and now() - work.began > _AT_ONCE:
            work.answers[decision.with_time] = work.open_answer()  # once, also where the checker does not agree
            certificate = certify.of_decision(work.analysis, decision, 1, work.options.seed)
            if check(work, certificate).verdict == "valid":
                tell(work, Answer("variational", certificate=certificate, checked="valid"), decision.with_time)
        work.progress(stage)

    return report


def tell(work: Work, answer: Answer, with_time: bool) -> None:
    """Hand over a confirmed answer while there is more to find."""
    found = answer.lagrangian
    work.answers[with_time] = answer = _placed(work, answer)
    is_main = with_time is (work.analysis.system.depends_on_time or work.options.time_dependent is True)
    parts = [named("existence", with_time), "certificate"]
    # L(q, q') answers both questions, without L(t, q, q') there is no L(q, q'), and one question has both names.
    if with_time is (answer.verdict == "not_variational") or (with_time and is_main):
        parts.append(named("existence", not with_time))
    parts += [named("lagrangian", not is_main)] if found is not None else []
    parts += ["hamiltonian"] if answer.hamiltonian is not None and is_main else []
    hand_over(work, *parts)


def hand_over(work: Work, *parts: str) -> None:
    """Say that these parts are finished and checked."""
    if work.options.hand_over is not None:
        work.options.hand_over(parts, lambda: _so_far(work))


def named(part: str, with_time: bool) -> str:
    """The name of a part of the one question or the other."""
    return f"{part}_with_time" if with_time else part


def _so_far(work: Work) -> SoFar:
    """What is confirmed; a question that is not settled is undetermined."""
    system, wanted = work.analysis.system, work.options.time_dependent
    depends = system.depends_on_time
    autonomous = None if depends or wanted is True else work.answers.get(False, work.open_answer())
    with_time = None if wanted is False and not depends else work.answers.get(True, work.open_answer())
    if autonomous is not None and with_time is not None:
        if autonomous.verdict == "variational" and with_time.lagrangian is None:
            with_time = autonomous
        elif with_time.verdict == "not_variational" and autonomous.verdict == "undetermined":
            autonomous = with_time
    return (Solution(system, autonomous, with_time, work.printed),), ()


def is_confirmed(work: Work, tree: Expression, with_time: bool) -> bool:
    """Whether the checker finds the Lagrangian valid; one that it refused is logged, counted and not offered again."""
    certificate = certify.of_lagrangian(work.analysis, tree, with_time)
    offered = (certificate["lagrangian"], with_time)
    if offered in work.refused:
        return False
    found = check(work, certificate)
    if found.verdict != "valid":
        work.refused.add(offered)
        log.warning("The checker refused the Lagrangian %s: %s", to_text(tree), "; ".join(found.reasons))
    return found.verdict == "valid"


def completed(work: Work, answer: Answer, others: Found | None, with_time: bool) -> Answer:
    """With the Hamiltonian, and those Lagrangians besides its own that were found and the checker confirms."""
    answer = _placed(work, answer)
    assert answer.lagrangian is not None
    tell(work, answer, with_time)
    began = now()
    work.progress("Hamiltonian")
    names = work.analysis.system.coordinates
    hamiltonian = hamiltonian_of(answer.lagrangian.expression, names, answer.lagrangian.positive)
    steps = (*answer.details, *verification_steps(work.analysis, answer.lagrangian), *legendre_steps(hamiltonian))
    work.add_seconds("Hamiltonian", began)
    answer = replace(answer, hamiltonian=hamiltonian, details=steps)
    tell(work, answer, with_time)
    assert answer.lagrangian is not None
    described: list[Lagrangian] = []
    for other in () if others is None else others.lagrangians:
        known = [answer.lagrangian, *described]
        if any(is_multiple(one.expression, other, names, work.analysis.real_point) for one in known):
            continue
        why = why_shown(answer.lagrangian.expression, other, names, work.analysis.real_point)
        if why and all(why != one.reason for one in described) and is_confirmed(work, other, with_time):
            described.append(replace(describe(work.analysis, other, others.family if others else ""), reason=why))
    return replace(answer, other_lagrangians=tuple(described))


def check(work: Work, certificate: Mapping[str, Any]) -> CheckResult:
    began = now()
    work.progress("check")
    _, found = certify.proved(work.analysis, dict(certificate), left(work.deadline, 1.0))
    work.add_seconds("check", began)
    return found


def confirmed(work: Work, answer: Answer) -> Answer:
    """The answer with the checker's verdict; one that it cannot confirm is undetermined."""
    assert answer.certificate is not None
    found = check(work, answer.certificate)
    if found.verdict == "invalid" and not _has_signed_functions(work.analysis.system):
        raise CertificateRefused("; ".join(found.reasons))
    if found.verdict != "valid":
        reason = f"found {answer.verdict}, but the checker could not confirm it: {'; '.join(found.reasons)}"
        if work.left() <= 0:
            work.cut["certificate"] = reason
        return Answer("undetermined", reason=reason)
    return replace(_placed(work, answer), checked="valid")


def _has_signed_functions(system: SecondOrderSystem) -> bool:
    """Whether the sign of an arbitrary function belongs to the branch: a checker may draw it otherwise."""
    return any(isinstance(node, Arbitrary) for tree in system.positive for node in walk(tree))
