"""One system, both questions: decide, find a Lagrangian, certify, check, explain."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from inverse_service.certificate.checker import check_certificate
from inverse_service.errors import CertificateRefused, IrreducibleAtoms
from inverse_service.expressions.printing_latex import to_latex
from inverse_service.inverse_problem import certify
from inverse_service.inverse_problem.analysis import Analysis, analyse
from inverse_service.inverse_problem.decision import Decision, Limits, decide
from inverse_service.inverse_problem.explanation import explain_negative
from inverse_service.inverse_problem.hierarchy import smallest_sufficient_set
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.inverse_problem.outcome import Answer, Conditions, Solution, Step
from inverse_service.inverse_problem.search.describe import describe
from inverse_service.inverse_problem.search.ladder import SearchOutcome, search
from inverse_service.mechanics.conditions import conditions
from inverse_service.mechanics.second_order_system import SecondOrderSystem

Progress = Callable[[str], None]
# Of the time left after the decision, the part that the search for a closed form may take.
_SEARCH_SHARE = 0.5


@dataclass(slots=True)
class _Work:
    """What the stages of one solve share."""

    analysis: Analysis
    options: SolveOptions
    progress: Progress
    deadline: float
    seconds: dict[str, float] = field(default_factory=dict)
    points: list[Mapping[str, int]] = field(default_factory=list)

    def left(self) -> float:
        return self.deadline - time.monotonic()


def solve(system: SecondOrderSystem, options: SolveOptions, progress: Progress | None = None) -> Solution:
    """The answers to the questions asked; mathematics that cannot be settled is an outcome.

    Raises CertificateRefused where our own checker finds our certificate invalid: a fault of ours.
    """
    began = time.monotonic()
    report = progress or (lambda _: None)
    report("conditions")
    tensors = conditions(system)
    seconds = {"conditions": time.monotonic() - began}
    try:
        analysis = analyse(system)
    except IrreducibleAtoms as problem:
        return _unreduced(system, options, _conditions(tensors), problem.detail)
    seconds["analysis"] = time.monotonic() - began - seconds["conditions"]
    work = _Work(analysis, options, report, began + options.time_limit, seconds)
    autonomous, with_time = _answers(work)
    provenance = {
        "seed": options.seed,
        "time_limit": options.time_limit,
        "points": [dict(point) for point in work.points],
        "seconds": {stage: round(value, 4) for stage, value in seconds.items()},
        "conditions_left_out": tensors.reason,
    }
    return Solution(system, autonomous, with_time, _conditions(tensors), provenance)


def _conditions(tensors: Any) -> Conditions | None:
    if tensors.Phi is None or tensors.nabla_Phi is None or tensors.R is None:
        return None
    return Conditions(tensors.Phi, tensors.nabla_Phi, tensors.R)


def _unreduced(
    system: SecondOrderSystem, options: SolveOptions, found: Conditions | None, reason: str
) -> Solution:
    answer = Answer("undetermined", reason=reason)
    autonomous = None if system.depends_on_time or options.time_dependent is True else answer
    with_time = None if options.time_dependent is False and not system.depends_on_time else answer
    return Solution(system, autonomous, with_time, found, {"seed": options.seed})


def _answers(work: _Work) -> tuple[Answer | None, Answer | None]:
    """(L(q, v), L(t, q, v)); an autonomous Lagrangian answers the second question too."""
    wanted, depends = work.options.time_dependent, work.analysis.system.depends_on_time
    autonomous = None if depends or wanted is True else _answer(work, with_time=False)
    if wanted is False and not depends:
        return autonomous, None
    if autonomous is not None and autonomous.verdict == "variational":
        return autonomous, autonomous
    return autonomous, _answer(work, with_time=True)


def _answer(work: _Work, with_time: bool) -> Answer:
    decision = _decide(work, with_time)
    if decision.verdict == "undetermined":
        return Answer("undetermined", reason=decision.reason)
    answer = _positive(work, decision) if decision.verdict == "variational" else _negative(work, decision)
    return _checked(work, answer)


def _decide(work: _Work, with_time: bool) -> Decision:
    stage = "decision with time" if with_time else "decision"
    work.progress(stage)
    limits = Limits(deadline=work.deadline)
    decision = decide(
        work.analysis.system, with_time, work.options.seed, limits, work.progress, analysis=work.analysis
    )
    work.seconds[stage] = decision.seconds
    work.points.extend(decision.points)
    return decision


def _negative(work: _Work, decision: Decision) -> Answer:
    began = time.monotonic()
    work.progress("explanation")
    chosen = smallest_sufficient_set(work.analysis, work.options.seed)
    found = explain_negative(work.analysis, chosen, decision.with_time, work.options.seed)
    work.seconds["explanation"] = work.seconds.get("explanation", 0.0) + time.monotonic() - began
    return Answer(
        "not_variational",
        certificate=certify.of_decision(work.analysis, decision),
        explanation=found.steps,
    )


def _positive(work: _Work, decision: Decision) -> Answer:
    """A Lagrangian where one is found, else the existence proof."""
    began = time.monotonic()
    deadline = began + _SEARCH_SHARE * work.left()
    outcome = search(work.analysis, decision.with_time, work.options.seed, deadline, work.progress)
    work.seconds["search"] = work.seconds.get("search", 0.0) + time.monotonic() - began
    existence = _existence_steps(decision)
    if outcome.found is None:
        return Answer(
            "variational",
            space=decision.space,
            certificate=certify.of_decision(work.analysis, decision),
            explanation=(*existence, _not_found(outcome)),
        )
    described = [describe(work.analysis, tree, outcome.found.family) for tree in outcome.found.lagrangians]
    return Answer(
        "variational",
        lagrangian=described[0],
        other_lagrangians=tuple(described[1:]),
        space=decision.space,
        certificate=certify.of_lagrangian(work.analysis, described[0].expression, decision.with_time),
        explanation=(*existence, *_search_steps(outcome)),
    )


def _not_found(outcome: SearchOutcome) -> Step:
    tried = "; ".join(f"{name} ({count} terms)" for name, count in outcome.tried) or "none fits f"
    return Step(f"No closed form was found. Families tried: {tried}.")


def _search_steps(outcome: SearchOutcome) -> tuple[Step, ...]:
    assert outcome.found is not None
    name, count = outcome.tried[-1]
    first = Step(
        f"In the family '{name}' ({count} candidate terms) the Euler-Lagrange equations are linear in the "
        "coefficients; solved, they leave the Lagrangian",
        to_latex(outcome.found.lagrangians[0]),
    )
    if len(outcome.found.parts) < 2:
        return (first,)
    parts = " + ".join(f"C_{k} ({to_latex(part)})" for k, part in enumerate(outcome.found.parts, start=1))
    return (first, Step("More generally, with constants C_k that keep the Hessian regular,", parts))


def _existence_steps(decision: Decision) -> tuple[Step, ...]:
    assert decision.space is not None
    assert decision.symbol is not None
    order, degree = decision.order, decision.degree
    dimensions = ", ".join(map(str, decision.history[order][: degree + 1]))
    return (
        Step(
            f"The Helmholtz conditions, prolonged to order {order}, leave a space of Taylor polynomials of the "
            f"multiplier of dimensions {dimensions} in degrees 0 to {degree}; it no longer shrinks."
        ),
        Step(
            f"Its symbol in degree {degree} has dimension {decision.symbol.dimension} and passes Cartan's test "
            f"(characters {', '.join(map(str, decision.symbol.characters))}): the system is involutive."
        ),
        Step(f"A regular g is left at a generic point, so a regular Lagrangian exists; {decision.space.statement}."),
    )


def _checked(work: _Work, answer: Answer) -> Answer:
    """The answer with the checker's verdict; one that it cannot confirm is undetermined."""
    assert answer.certificate is not None
    began = time.monotonic()
    work.progress("check")
    found = check_certificate(answer.certificate, time_limit=max(1.0, work.left()))
    work.seconds["check"] = work.seconds.get("check", 0.0) + time.monotonic() - began
    if found.verdict == "invalid":
        raise CertificateRefused("; ".join(found.reasons))
    if found.verdict == "incomplete":
        reason = f"found {answer.verdict}, but the checker could not confirm it: {'; '.join(found.reasons)}"
        return Answer("undetermined", reason=reason)
    return replace(answer, checked="valid")
