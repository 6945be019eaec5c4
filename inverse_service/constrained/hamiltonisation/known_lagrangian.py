"""The answer where Lagrangians are known beforehand: decided, confirmed by the checker, no search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from inverse_service.certificate.checker import check_certificate
from inverse_service.deadline import left, now
from inverse_service.decision import certify
from inverse_service.decision.analysis import Analysis, analyze
from inverse_service.decision.deciding import Decision, decide
from inverse_service.decision.solutions import Answer, Hamiltonian, Solution, SolveOptions, Step
from inverse_service.errors import IrreducibleAtoms
from inverse_service.explanation.finding import existence_steps, legendre_steps, verification_steps
from inverse_service.explanation.wording import printed_conditions, said
from inverse_service.expressions.notation import row
from inverse_service.expressions.tree import Expression
from inverse_service.linear_pde.involutive_form import Limits
from inverse_service.mechanics.legendre.transform import LegendreTransform
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search.protocol import describe

# Characters of the verification that a person may still read.
_LONGEST_STEPS = 12_000


_LONGEST_CHECK = 60.0  # s, of a Lagrangian that was confirmed before


@dataclass(frozen=True, slots=True)
class Known:
    """A Lagrangian L(q, v) with its Legendre transform, the constraints' images, and where it comes from."""

    lagrangian: Expression
    transform: LegendreTransform
    images: tuple[Expression, ...]
    source: str


def confirmed(system: SecondOrderSystem, proposals: Sequence[Known], deadline: float) -> tuple[Known, ...]:
    """Those that the independent checker finds to be Lagrangians of the system."""
    try:
        analysis = analyze(system)
    except IrreducibleAtoms:
        return ()
    return tuple(known for known in proposals if _is_valid(analysis, known.lagrangian, deadline))


def _is_valid(analysis: Analysis, lagrangian: Expression, deadline: float) -> bool:
    certificate = certify.of_lagrangian(analysis, lagrangian, with_time=False)
    return check_certificate(certificate, time_limit=left(deadline, 1.0)).verdict == "valid"


def solution_with(system: SecondOrderSystem, known: Sequence[Known], options: SolveOptions) -> Solution:
    """The solution whose Lagrangian is the first of `known`; all of them must be confirmed.

    The decision is made all the same: it says how large the space of multipliers is.
    """
    began = now()
    found, left_out = printed_conditions(system) if options.conditions else (None, "")
    analysis = analyze(system)
    decision = decide(system, False, options.seed, Limits(deadline=began + options.time_limit), analysis=analysis)
    answer = _answer(analysis, decision, known)
    provenance = {
        "seed": options.seed,
        "time_limit": options.time_limit,
        "points": [dict(point) for point in decision.points],
        "seconds": {"decision": round(decision.seconds, 4), "all": round(now() - began, 4)},
        "conditions_left_out": left_out,
    }
    return Solution(system, answer, None if options.time_dependent is False else answer, found, provenance)


def _answer(analysis: Analysis, decision: Decision, known: Sequence[Known]) -> Answer:
    chosen, *others = known
    lagrangian = describe(analysis, chosen.lagrangian, chosen.source)
    where = certify.where_proved(analysis, chosen.lagrangian, _LONGEST_CHECK)
    hamiltonian = Hamiltonian.of(chosen.transform, chosen.images)
    decided = decision.verdict == "variational" and decision.space is not None and decision.symbol is not None
    steps = (
        *(existence_steps(decision) if decided else ()),
        said(f"The {chosen.source} is a regular Lagrangian of the system: ", row("L = ", chosen.lagrangian), "."),
        *_short(verification_steps(analysis, lagrangian)),
        *legendre_steps(hamiltonian),
    )
    return Answer(
        "variational",
        lagrangian=lagrangian,
        other_lagrangians=tuple(describe(analysis, other.lagrangian, other.source) for other in others),
        hamiltonian=hamiltonian,
        space=decision.space if decided else None,
        certificate=certify.of_lagrangian(analysis, chosen.lagrangian, with_time=False),
        checked="valid",
        explanation=steps,
        positive=where.positive,
        nonzero=where.nonzero,
        sides=where.sides,
        one_side=where.one_side,
    )


def _short(steps: Sequence[Step]) -> tuple[Step, ...]:
    """The steps, unless they fill pages; the checker has confirmed the same."""
    length = sum(len(step.text) for step in steps)
    if length <= _LONGEST_STEPS:
        return tuple(steps)
    return (said("Worked out, its Helmholtz conditions fill pages; the independent checker has confirmed them."),)
