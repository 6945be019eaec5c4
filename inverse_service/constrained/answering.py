"""Answer whether any Lagrangian has a motion, with the Lagrangian, its Hamiltonian, and a checked
proof.

A Lagrangian that is known from another question comes first, since its own check is the proof: that
of an associated system, the given L, or that of the reduced system. Then each question is decided,
for L(q, q') and, if there is none, for L(t, q, q'). After a yes, short searches for a Lagrangian
come before the proof of existence, which takes long, and long ones after it. The checker confirms
every verdict. If a Lagrangian exists but none is known in closed form, the sentences show the
beginning of the power series of l and lambda_a.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from itertools import pairwise
from math import comb
from typing import Any

from inverse_service import bounds, errors
from inverse_service.certificate import checker
from inverse_service.constrained import (
    closed_forms,
    existence,
    lagrangian as on_constraints,
    refusal,
)
from inverse_service.constrained.hamiltonise import Hamiltonisation, hamiltonise
from inverse_service.deadline import OutOfTime, now, share, until
from inverse_service.decision import certify, deciding
from inverse_service.decision.solutions import Lagrangian, Statement, Step, Verdict, implied
from inverse_service.explanation.explaining import said, separated
from inverse_service.expressions.notation import row
from inverse_service.expressions.tree import TIME, Expression, Number, Power, Symbol, Velocity, walk
from inverse_service.field import modular
from inverse_service.linear_pde.involution import (
    Finding,
    Unknown,
    halved_squares,
    prolonged,
    solution_of,
)
from inverse_service.mechanics import constrained_motion, second_order_system
from inverse_service.mechanics.legendre import legendre
from inverse_service.statements import questions, reasons
from inverse_service.statements.questions import About, Question
from inverse_service.statements.stages import Progress, Stage

# The shares of the time that the decisions may use; the remaining time is for a closed form, H, and
# the checks.
_SHARE_OF_DECISION, _SHARE_OF_REDUCED, _SHARE_OF_ANSATZ = 0.4, 0.5, 0.5
_STEEP = -3
# The least time, in seconds, for a closed form, because its parts do not check the time at every
# step.
_LEAST_FOR_ANSATZ = 6.0
# The least seconds for the check of a known Lagrangian, and those for the number of functions on
# which it depends, which no proof needs.
_FOR_KNOWN, _FOR_FREEDOM = 2.0, 1.0
ANY = About.ANY.value
_FREE_MOTION = (
    "The forces of constraint vanish along the motion, so the Euler-Lagrange expressions of the given `L` do, too. "
    "With half the squares of the constraints it is regular."
)


@dataclass(frozen=True, slots=True)
class KnownLagrangian:
    """A Lagrangian of an associated system, with its report."""

    kind: str
    system: second_order_system.SecondOrderSystem
    lagrangian: Lagrangian
    question: Question
    report: Hamiltonisation | None


@dataclass(frozen=True, slots=True)
class MotionLagrangian(Lagrangian):
    """L on the tangent bundle, its 1-jet along the constraints, its associated system, and its
    report.
    """

    jet: on_constraints.JetOnConstraints | None = None
    kind: str = "own"
    system: second_order_system.SecondOrderSystem | None = None
    report: Hamiltonisation | None = None

    def on_its_set(
        self, certificate: Mapping[str, Any], proof: checker.CheckResult
    ) -> MotionLagrangian:
        """The same Lagrangian with the set on which the checker proved L."""
        names = certify.names_of_certificate(certificate["system"], certificate)
        where = certify.where_of(proof.formulas, names, [self.expression])
        return replace(self, domain=where)


@dataclass(slots=True)
class _Work:
    motion: second_order_system.ConstrainedMotion
    known: Sequence[KnownLagrangian]
    asked: tuple[Question, ...]
    # The statement about the reduced system.
    reduced: Statement | None
    seed: int
    deadline: float
    progress: Progress
    tell: Callable[[tuple[Statement, ...]], None]
    # All first integrals that are known.
    integrals: Callable[[], Sequence[Expression]]
    # What is settled, what is reported besides, and decisions.
    found: list[Statement] = field(default_factory=list)
    told: tuple[Statement, ...] = ()
    decided: dict[Question, Finding] = field(default_factory=dict)

    def left(self) -> float:
        return self.deadline - now()

    def answers(self, found: Sequence[Statement]) -> tuple[Statement, ...]:
        """The answer to each question that is asked; where there is none, the time is over."""
        return tuple(
            implied(one, found) or Statement(one, "undetermined", reasons.TIME_WAS_OVER)
            for one in self.asked
        )


def answer_motion(
    motion: second_order_system.ConstrainedMotion,
    known: Sequence[KnownLagrangian] = (),
    time_dependent: bool | None = None,
    seed: int = 1,
    deadline: float = float("inf"),
    progress: Progress = lambda _: None,
    positive: Sequence[Expression] = (),
    reduced: Statement | None = None,
    tell: Callable[[tuple[Statement, ...]], None] = lambda _: None,
    integrals: Callable[[], Sequence[Expression]] = lambda: (),
) -> tuple[Statement, ...]:
    """The answer to each question about any associated system where all of `positive` are > 0;
    `known` are Lagrangians of associated systems.

    `reduced` is the answer for the equations of the free coordinates if these contain no others.
    EquationsOfMotion get a report on H. `tell` receives confirmed answers while the search for a
    Lagrangian continues; these remain if the time expires. `integrals` finds the first integrals,
    where a Lagrangian without a formula has to be explained.
    """
    deadline = max(deadline, now() + _FOR_KNOWN) if known else deadline
    asked = tuple(
        replace(one, about=About.ANY)
        for one in questions.asked(time_dependent, motion.depends_on_time)
    )
    reduced = None if time_dependent is True else reduced
    work = _Work(motion, known, asked, reduced, seed, deadline, progress, tell, integrals)
    try:
        with until(deadline):
            analyzed = existence.analyze_motion(motion, positive)
            for question in asked:
                if implied(question, work.found) is None:
                    work.found.append(_settle(work, analyzed, question))
        return work.answers(work.found)
    except errors.IrreducibleAtoms as problem:
        why = reasons.irreducible(problem.detail)
        return tuple(Statement(one, "undetermined", why) for one in asked)
    except OutOfTime:
        return work.told or work.answers(work.found)


def _settle(work: _Work, analyzed: existence.AnalyzedMotion, question: Question) -> Statement:
    """What one check proves comes first, then the decision; a no also answers narrower questions,
    so that of a wider one comes first.
    """
    known = _first_confirmed(work, analyzed, _propose_known(work, question), question)
    if known is not None:
        _tell(work, known)
        return _with_freedom(work, analyzed, known)
    if _decide_in_share(work, analyzed, question).exists is False:
        wider = (one for one in work.asked if one != question and one.includes(question))
        for one in wider:
            if _decide_in_share(work, analyzed, one).exists is False:
                refused = _answer_question(work, analyzed, one)
                if refused.verdict != "undetermined":
                    return refused
    return _answer_question(work, analyzed, question)


def _of_reduced(work: _Work, question: Question) -> Statement | None:
    """The yes of the reduced system for the motion, by a certificate that is about the free
    coordinates only.
    """
    reduced = work.reduced
    if reduced is None or reduced.checked != "valid" or not reduced.certificate:
        return None
    about = replace(reduced, question=replace(reduced.question, about=About.REDUCED))
    if reduced.verdict != "variational" or not about.answers(question):
        return None
    return Statement(
        question,
        "variational",
        certificate=reduced.certificate,
        checked="valid",
        explanation=reduced_steps(work.motion.free),
        exceptions=reduced.exceptions,
    )


def _decide_in_share(
    work: _Work, analyzed: existence.AnalyzedMotion, question: Question
) -> Finding:
    """The decision on a question, made once; a no by brackets along a solution is one for both."""
    along = next((found for found in work.decided.values() if found.along is not None), None)
    if along is not None:
        return along
    if question not in work.decided:
        limit = share(_SHARE_OF_DECISION, work.deadline)
        work.decided[question] = existence.decide_motion(
            analyzed,
            question,
            work.seed,
            limit,
            lambda stage: work.progress(stage.of(question.about)),
        )
    return work.decided[question]


def _with_freedom(work: _Work, analyzed: existence.AnalyzedMotion, answer: Statement) -> Statement:
    """The answer with the size of the set of Lagrangians, if the decision, which is not needed,
    takes little time.
    """
    limit = min(share(_SHARE_OF_DECISION, work.deadline), now() + _FOR_FREEDOM)
    found = existence.decide_motion(
        analyzed, answer.question, work.seed, limit, lambda stage: work.progress(stage.of(ANY))
    )
    size = freedom(found, len(work.motion.coordinates), answer.question) if found.exists else ""
    return replace(answer, freedom=size)


def _answer_question(
    work: _Work, analyzed: existence.AnalyzedMotion, question: Question
) -> Statement:
    """The answer by short searches for L, then a proof of existence, unless the reduced system has
    one, then long searches.
    """
    found = _decide_in_share(work, analyzed, question)
    if found.exists is False:
        refused = _prove_verdict(work, analyzed, found, question, "not_variational")
        if question == work.asked[-1]:
            _tell(work, refused)
        return refused
    size, steps = (
        freedom(found, len(work.motion.coordinates), question),
        finding_steps(analyzed, found, question),
    )

    def by_lagrangian(proposals: Iterable[_Proposal]) -> Statement | None:
        answer = _first_confirmed(work, analyzed, proposals, question)
        return answer and replace(answer, freedom=size, explanation=(*steps, *answer.explanation))

    answer = by_lagrangian(_propose_in_short(work, question))
    if answer is not None:
        return answer
    proven = _of_reduced(work, question) if question == work.asked[0] else None
    if proven is not None:
        proven = replace(proven, freedom=size)
    elif found.exists:
        proven = _prove_verdict(work, analyzed, found, question, "variational")
    if proven is not None:
        _tell(work, proven)
    answer = by_lagrangian(_propose_at_length(work, question))
    if answer is None and proven is not None and proven.verdict == "variational":
        needed = closed_forms.needed(work.motion, work.integrals())
        steps = (*proven.explanation, *([needed] if needed else []))
        proven = replace(proven, construction=needed, explanation=steps)
    return answer or proven or Statement(question, "undetermined", open_reason(found))


@dataclass(frozen=True, slots=True)
class _Proposal:
    """A Lagrangian of the motion that is not confirmed yet, what it is known from, and the steps
    that explain it.
    """

    lagrangian: Lagrangian
    known: KnownLagrangian | None = None
    steps: tuple[Step, ...] = ()


def _first_confirmed(
    work: _Work,
    analyzed: existence.AnalyzedMotion,
    proposals: Iterable[_Proposal],
    question: Question,
) -> Statement | None:
    """A yes by the first proposal that the checker confirms, with H."""
    for proposal in proposals:
        tree = proposal.lagrangian.expression
        confirmed = _confirm_certificate(
            work, analyzed, existence.certificate_of_lagrangian(analyzed, tree, question), [tree]
        )
        if confirmed is None:
            continue
        certificate, checked = confirmed
        known, jet = proposal.known, on_constraints.jet_of(tree, work.motion)
        if known is not None:
            found = _of_motion(proposal.lagrangian, jet, known.kind, known.system, known.report)
        else:
            found = _complete_lagrangian(work, proposal.lagrangian, jet)
        return Statement(
            question,
            "variational",
            lagrangian=found.on_its_set(certificate, checked),
            certificate=certificate,
            checked="valid",
            explanation=(*proposal.steps, *lagrangian_steps(tree, jet)),
            exceptions=checked.exceptions,
        )
    return None


def _of_motion(
    lagrangian: Lagrangian,
    jet: on_constraints.JetOnConstraints,
    kind: str,
    system: second_order_system.SecondOrderSystem | None,
    report: Hamiltonisation | None,
) -> MotionLagrangian:
    own = {one.name: getattr(lagrangian, one.name) for one in fields(Lagrangian)}
    return MotionLagrangian(**own, jet=jet, kind=kind, system=system, report=report)


def _tell(work: _Work, answer: Statement) -> None:
    """Report what is proven, before the search for parameter values that the proof excludes."""
    general = replace(answer, exceptions=checker.not_found(work.motion.parameters))
    work.told = work.answers([*work.found, general])
    if answer.certificate:
        work.tell(work.told)


def _prove_verdict(
    work: _Work,
    analyzed: existence.AnalyzedMotion,
    found: Finding,
    question: Question,
    verdict: Verdict,
) -> Statement:
    proven = _confirm_certificate(work, analyzed, existence.of_finding(analyzed, found, question))
    size = freedom(found, len(work.motion.coordinates), question)
    if proven is None:
        reason = reasons.unconfirmed_motion(verdict, found.order)
        return Statement(question, "undetermined", reason, freedom=size)
    certificate, checked = proven
    steps = finding_steps(analyzed, found, question)
    steps += series_steps(analyzed, found, question) if found.exists else ()
    return Statement(
        question,
        verdict,
        certificate=certificate,
        checked="valid",
        freedom=size,
        explanation=steps,
        exceptions=checked.exceptions,
    )


def _confirm_certificate(
    work: _Work,
    analyzed: existence.AnalyzedMotion,
    certificate: dict[str, Any],
    more: Sequence[Expression] = (),
) -> tuple[dict[str, Any], checker.CheckResult] | None:
    """The certificate that the checker finds valid, unchanged or restricted to one side of roots,
    and the result.
    """
    found = checker.check_certificate(certificate, time_limit=max(1.0, work.left()))
    if found.verdict == "incomplete":
        certificate = existence.on_one_side(analyzed, certificate, more)
        found = checker.check_certificate(certificate, time_limit=max(1.0, work.left()))
    return (certificate, found) if found.verdict == "valid" else None


def _propose_known(work: _Work, question: Question) -> Iterator[_Proposal]:
    """Lagrangians of associated systems, the given one if it is one of the motion, and that of the
    reduced system.
    """
    for one in work.known:
        if question.timed or not one.question.timed:
            yield _Proposal(one.lagrangian, one)
    for free in on_constraints.of_free_motion(work.motion):
        yield _Proposal(free, steps=(said(_FREE_MOTION),))
    if not question.timed and work.reduced is not None and work.reduced.lagrangian is not None:
        for closed in on_constraints.closed_coordinates(work.motion):
            whole = on_constraints.on_whole_motion(work.motion, closed, work.reduced.lagrangian)
            yield _Proposal(whole, steps=reduced_steps(closed.system.coordinates))


def _propose_in_short(work: _Work, question: Question) -> Iterator[_Proposal]:
    """Lagrangians of the reduced system, unless it is answered already, and from the ansatz along
    the constraints.
    """
    if work.left() < _LEAST_FOR_ANSATZ:
        return
    if question.timed or work.reduced is None:
        work.progress(Stage("reduced system", about=ANY))
        reduced = _find_for_closed(work, on_constraints.closed_coordinates(work.motion), question)
        if reduced is not None:
            yield _Proposal(reduced)
    work.progress(Stage("ansatz along the constraints", about=ANY))
    found = on_constraints.find_lagrangians(
        work.motion, question, work.seed, now() + _SHARE_OF_ANSATZ * work.left()
    )
    yield from map(_Proposal, found[:1])


def _propose_at_length(work: _Work, question: Question) -> Iterator[_Proposal]:
    """Lagrangians from the ansatz with other free coordinates, and of other closed functions of
    position.
    """
    if work.left() < _LEAST_FOR_ANSATZ:
        return
    for other in on_constraints.with_forces_free(work.motion):
        end = now() + _SHARE_OF_ANSATZ * work.left()
        found = on_constraints.find_lagrangians(other, question, work.seed, end)
        yield from map(_Proposal, found[:1])
    work.progress(Stage("functions of position with equations of their own", about=ANY))
    others = on_constraints.closed_functions(work.motion, now() + _SHARE_OF_REDUCED * work.left())
    reduced = _find_for_closed(work, others, question)
    if reduced is not None:
        yield _Proposal(reduced)


def _find_for_closed(
    work: _Work, closed: Iterable[on_constraints.ClosedFunctions], question: Question
) -> Lagrangian | None:
    return on_constraints.lagrangian_of_closed(
        work.motion, closed, question, work.seed, _SHARE_OF_REDUCED * work.left()
    )


def _is_steep(lagrangian: Expression) -> bool:
    """Whether velocities have large negative powers, in which case no closed form of H is
    attempted.
    """
    return any(
        isinstance(node, Power)
        and isinstance(node.exponent, Number)
        and node.exponent.value <= _STEEP
        for node in walk(lagrangian)
        if isinstance(node, Power) and isinstance(node.base, Velocity)
    )


def _complete_lagrangian(
    work: _Work, lagrangian: Lagrangian, jet: on_constraints.JetOnConstraints
) -> MotionLagrangian:
    """Add its own equations, H, and the constraints in phase space."""
    tree, report = lagrangian.expression, None
    system = on_constraints.own_system(tree, work.motion, now() + _SHARE_OF_ANSATZ * work.left())
    if (
        system is not None
        and isinstance(work.motion, constrained_motion.EquationsOfMotion)
        and work.left() > 0
    ):
        known = legendre(tree, system.coordinates, 0.0) if _is_steep(tree) else None
        with suppress(OutOfTime), until(now() + _SHARE_OF_ANSATZ * work.left()):
            report = hamiltonise(work.motion, system, tree, work.seed, known)
    return _of_motion(lagrangian, jet, "own", system, report)


def finding_steps(
    analyzed: existence.AnalyzedMotion, found: Finding, question: Question
) -> tuple[Step, ...]:
    """The steps that state the question and prove the answer."""
    if found.along is not None:
        return refusal.refusal_steps(analyzed, found, question)
    k = len(analyzed.motion.free)
    steps = [
        said(
            f"A regular {question.form} has this motion on the constraints exactly if `l` and `lambda_a`, in "
            "`L = l + lambda_a mu^a + ...` along the constraints, make its Euler-Lagrange expressions vanish there, a "
            f"linear system. The second derivatives of `l` by the free velocities and the first of `lambda_a` must "
            f"have rank {k} together."
        )
    ]
    if found.exists is False:
        steps += _bivector_steps(found)
        none = "is variational" if question.timed else f"has a regular {question.form}"
        steps.append(
            said(
                f"Prolonged to order {found.order}, {len(found.rows)} equations leave a rank below {k} in "
                f"every solution. This is a contradiction, so no associated system {none}.",
            )
        )
    elif found.symbol is not None:
        steps.append(
            said(
                f"Prolonged to order {found.order} the system is involutive at degree {found.degree}, with solutions "
                f"of rank {found.ranks[0]}; the derivatives of l alone have rank {found.ranks[1]}. "
                "So there is such a Lagrangian near the generic point.",
            )
        )
    return tuple(steps)


def _bivector_steps(found: Finding) -> list[Step]:
    """The steps that justify the bivector equations, if the proof uses them."""
    rows = [row for row in found.rows if str(row[0]).startswith("B")]
    orders = [int(str(name)[1:].partition("_")[0]) for name, *_ in rows]
    if not orders:
        return []
    # Without derivatives these are equations for the values of the 2-form, which are otherwise
    # arbitrary.
    alone = rows == list(found.rows) and not any(
        any(row[-1]) for row in rows if isinstance(row[-1], tuple)
    )
    return [
        said(
            "The 2-form of such a Lagrangian vanishes on the Lie derivatives along the motion of the bivectors of the "
            f"free velocities: equations of first order, of which {len(orders)} are used, to order {max(orders)}."
            f"{' Each 2-form that does has a vertical vector in its kernel.' * alone}"
        )
    ]


def lagrangian_steps(
    lagrangian: Expression, jet: on_constraints.JetOnConstraints
) -> tuple[Step, ...]:
    """The steps that show L and its 1-jet along the constraints."""
    momenta = [row(f"lambda_{k} = ", tree) for k, tree in enumerate(jet.transverse_momenta, 1)]
    return (
        said(
            "A Lagrangian, found by an ansatz or known for an associated system: ",
            shown=[row("L = ", lagrangian)],
        ),
        said(
            "Along the constraints it is ",
            *separated([row("l = ", jet.on_constraints), *momenta]),
            ".",
        ),
    )


def reduced_steps(names: Sequence[str]) -> tuple[Step, ...]:
    """The step that explains why a Lagrangian of the free coordinates gives one of the motion."""
    listed = ", ".join(names)
    return (
        said(
            f"The equations of {listed} contain no other coordinate. A Lagrangian of theirs and half the squares of "
            "the constraints together give the whole motion on the constraints."
        ),
    )


def open_reason(found: Finding) -> reasons.Open | None:
    """Why the decision did not end, and how far it got."""
    if not found.history or found.open is None:
        return found.open
    dimensions = ", ".join(map(str, found.history[-1][:3]))
    rank = found.ranks[0] if found.ranks else "unknown"
    reached = f"at order {found.order} rank {rank} is possible, dimensions {dimensions} in degrees 0, 1, 2"
    return reasons.Open(found.open.reason, f"{found.open.words}: {reached}")


def freedom(found: Finding, n: int, question: Question) -> str:
    """The number of functions and variables on which L along the constraints depends, up to total
    derivatives.

    The dimension of the symbol in degree d + j is sum alpha_k C(k - 1 + j, k - 1); `_gauge` is the
    part due to F.
    """
    if found.symbol is None:
        return ""
    characters, degree, variables = found.symbol.characters, found.degree, n + question.timed

    def size(j: int) -> int:
        total = sum(a * comb(k - 1 + j, k - 1) for k, a in enumerate(characters, 1))
        return total - _gauge(degree + j, variables) + _gauge(degree + j - 1, variables)

    values, power, leading = [size(j) for j in range(len(characters) + 1)], -1, 0
    while any(values):
        power, leading = power + 1, values[0]
        values = [b - a for a, b in pairwise(values)]
    if power < 0:
        constants = found.history[found.order][degree] - _gauge(degree, variables)
        return f"{constants} constant{'s' * (constants != 1)}"
    return f"{leading} function{'s' * (leading != 1)} of {power + 1} variable{'s' * (power > 0)}"


def _gauge(degree: int, variables: int) -> int:
    """The dimension of l = Gamma(F), lambda_a = dF/ds^a, F of so many variables, in unknowns up to
    a degree.

    It counts the F of degree up to d + 1 except F = 1, and the derivatives along Gamma, in l, of
    those of degree d + 2.
    """
    return comb(variables + degree + 1, variables) - 1 + comb(variables + degree, variables - 1)


def series_steps(
    analyzed: existence.AnalyzedMotion, found: Finding, question: Question
) -> tuple[Step, ...]:
    """One step with l and lambda_a to the degree at which the system is involutive; none if they
    are not rational.

    Every solution of the projected system to this degree is the beginning of an analytic one.
    """
    motion = analyzed.motion
    if any(
        deciding.is_irrational(node)
        for tree in (*analyzed.velocities, *analyzed.forces)
        for node in walk(tree)
    ):
        return ()
    variables: list[modular.Variable] = [
        *[TIME] * question.timed,
        *map(Symbol, analyzed.names),
        *map(Velocity, motion.free),
    ]
    symbols = [*variables, *map(Symbol, motion.parameters)]
    for first in range(1, 1 + bounds.ATTEMPTS):
        values = {symbol: first + k for k, symbol in enumerate(symbols)}
        try:
            coefficients = _coefficients(analyzed, found, question, values)
        except modular.SingularPoint:
            continue
        if coefficients is not None and len(coefficients) <= bounds.SHOWN:
            return (_written(variables, values, coefficients, len(motion.dependent)),)
    return ()


def _coefficients(
    analyzed: existence.AnalyzedMotion,
    found: Finding,
    question: Question,
    values: Mapping[modular.Variable, int],
) -> dict[Unknown, Fraction] | None:
    card = existence.ConstrainedAt(
        analyzed,
        question,
        lambda seed: modular.Point(modular.safe_prime(seed), seed, variables=dict(values)),
    )
    return deciding.reconstructed(lambda seed: _residues(card, found, seed))


def _residues(
    card: existence.ConstrainedAt, found: Finding, seed: int
) -> tuple[int, dict[Unknown, int] | None]:
    """A solution of full rank modulo a prime; squares have the coefficient 1/2, all other free
    coefficients are 0.
    """
    prolongation = prolonged(card, seed, found.order)
    prime, generic = prolongation.local.prime, found.history[found.order][found.degree]
    if prolongation.dimension(found.degree) != generic:
        return prime, None
    return prime, solution_of(card, prolongation, found.degree, halved_squares)


def _written(
    variables: list[modular.Variable],
    values: Mapping[modular.Variable, int],
    found: Mapping[Unknown, Fraction],
    dependent: int,
) -> Step:
    def series(function: int) -> Expression:
        chosen = {index: a for (which, index), a in found.items() if which == function and a}
        return deciding.as_tree(deciding.RationalSeries(0, tuple(variables), values, chosen))

    where = separated([row(symbol, f" = {value}") for symbol, value in values.items()])
    shown = [row(f"lambda_{a} = ", series(a), " + ...") for a in range(1, dependent + 1)]
    return said(
        "No closed form was found. Near ", *where, " a solution of full rank begins ",
        shown=[row("l = ", series(0), " + ..."), *shown],
    )  # fmt: skip
