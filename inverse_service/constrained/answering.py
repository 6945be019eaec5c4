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
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from math import comb
from typing import Any

from inverse_service import bounds, errors
from inverse_service.certificate.checker import CheckResult, check_certificate
from inverse_service.certificate.exceptions import Exceptions, not_found
from inverse_service.constrained import existence, lagrangian as on_constraints
from inverse_service.constrained.hamiltonise import Hamiltonisation, hamiltonise
from inverse_service.deadline import OutOfTime, now, share, until
from inverse_service.decision import certify, deciding
from inverse_service.decision.solutions import Lagrangian, Statement, Step, Verdict
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
from inverse_service.statements import reasons
from inverse_service.statements.questions import About
from inverse_service.statements.stages import Progress, Stage

# The shares of the time that the decisions may use; the remaining time is for a closed form, H, and
# the checks.
_SHARE_OF_DECISION, _SHARE_OF_REDUCED, _SHARE_OF_ANSATZ = 0.4, 0.3, 0.5
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

_QUESTION = {False: "L(q, q')", True: "L(t, q, q')"}


@dataclass(frozen=True, slots=True)
class KnownLagrangian:
    """A Lagrangian of an associated system, with its report."""

    kind: str
    system: second_order_system.SecondOrderSystem
    lagrangian: Lagrangian
    with_time: bool
    report: Hamiltonisation | None


@dataclass(frozen=True, slots=True)
class MotionLagrangian:
    """L on the tangent bundle, its 1-jet along the constraints, its associated system, and its
    report.
    """

    lagrangian: Lagrangian
    jet: on_constraints.JetOnConstraints
    kind: str
    system: second_order_system.SecondOrderSystem | None
    report: Hamiltonisation | None

    def on_its_set(self, certificate: Mapping[str, Any], proof: CheckResult) -> MotionLagrangian:
        """The same Lagrangian with the set on which the checker proved L."""
        where = certify.where_of(
            proof.formulas, certify.names_of(certificate["system"], certificate)
        )
        return replace(
            self,
            lagrangian=replace(self.lagrangian, positive=where.positive, nonzero=where.nonzero),
        )


@dataclass(frozen=True, slots=True)
class MotionAnswer:
    """The verdicts, with `certificates` that prove them, the one for L(q, q') first; one may prove
    both.

    The proofs are valid for general parameters: `exceptions` are equations between parameters for
    which one fails.
    """

    verdict: Verdict
    verdict_with_time: Verdict
    open: reasons.Open | None = None
    certificates: tuple[Mapping[str, Any], ...] = ()
    lagrangian: MotionLagrangian | None = None
    freedom: str = ""
    explanation: tuple[Step, ...] = ()
    exceptions: Sequence[str] = ()


@dataclass(slots=True)
class _Work:
    motion: second_order_system.ConstrainedMotion
    known: Sequence[KnownLagrangian]
    # The answer about L(q, q') for the reduced system.
    reduced: Statement | None
    seed: int
    deadline: float
    progress: Progress
    tell: Callable[[MotionAnswer], None]
    # The answer for L(q, q') while L(t, q, q') is decided, and the last reported answer.
    first: MotionAnswer | None = None
    told: MotionAnswer | None = None

    def left(self) -> float:
        return self.deadline - now()


def answer_motion(
    motion: second_order_system.ConstrainedMotion,
    known: Sequence[KnownLagrangian] = (),
    time_dependent: bool | None = None,
    seed: int = 1,
    deadline: float = float("inf"),
    progress: Progress = lambda _: None,
    positive: Sequence[Expression] = (),
    reduced: Statement | None = None,
    tell: Callable[[MotionAnswer], None] = lambda _: None,
) -> MotionAnswer:
    """Answer both questions where all of `positive` are > 0; `known` are Lagrangians of associated
    systems.

    `reduced` is the answer for the equations of the free coordinates if these contain no others.
    EquationsOfMotion get a report on H. `tell` receives a confirmed verdict while the search for a
    Lagrangian continues; this verdict remains if the time expires.
    """
    deadline = max(deadline, now() + _FOR_KNOWN) if known else deadline
    work = _Work(
        motion, known, None if time_dependent is True else reduced, seed, deadline, progress, tell
    )
    try:
        with until(deadline):
            return _answer_both_questions(
                work, time_dependent, existence.analyze_motion(motion, positive)
            )
    except errors.IrreducibleAtoms as problem:
        return MotionAnswer("undetermined", "undetermined", reasons.irreducible(problem.detail))
    except OutOfTime:
        return work.told or MotionAnswer("undetermined", "undetermined", reasons.TIME_WAS_OVER)


def _answer_both_questions(
    work: _Work, time_dependent: bool | None, analyzed: existence.AnalyzedMotion
) -> MotionAnswer:
    """What one check proves comes first, then each question: L(q, q') and, if there is none, L(t,
    q, q').
    """
    motion = work.motion
    both = time_dependent is None and not motion.depends_on_time
    with_time = not both and (time_dependent is not False or motion.depends_on_time)
    known = _first_confirmed(work, analyzed, _propose_known(work, with_time), with_time)
    if known is not None:
        _tell(work, known)
        return _with_freedom(work, analyzed, known, with_time)
    if not both:
        found = _decide_in_share(work, analyzed, with_time)
        return _answer_question(work, analyzed, found, with_time, _of_reduced(work))
    plain = _decide_in_share(work, analyzed, with_time=False)
    if plain.exists is False:  # one proof for both questions, where there is no L(t, q, q') either
        timed = _decide_in_share(work, analyzed, with_time=True)
        if (
            timed.exists is False
            and (other := _answer_question(work, analyzed, timed, with_time=True)).verdict
            != "undetermined"
        ):
            return other
    else:
        timed = None
    first = _answer_question(work, analyzed, plain, with_time=False, proven=_of_reduced(work))
    if first.verdict == "variational":
        return first
    work.first, work.told = (
        first,
        _of_both(first, MotionAnswer("undetermined", "undetermined", reasons.TIME_WAS_OVER)),
    )
    known = _first_confirmed(work, analyzed, _propose_known(work, with_time=True), with_time=True)
    if known is not None:
        return _of_both(first, _with_freedom(work, analyzed, known, with_time=True))
    timed = timed or _decide_in_share(work, analyzed, with_time=True)
    other = _answer_question(work, analyzed, timed, with_time=True)
    return (
        other if other.verdict == "not_variational" else _of_both(first, other)
    )  # no L(t, q, q'), so no L(q, q')


def _of_both(first: MotionAnswer, other: MotionAnswer) -> MotionAnswer:
    """The answers for L(q, q') and for L(t, q, q') as one."""
    return MotionAnswer(
        first.verdict,
        other.verdict,
        first.open or other.open,
        (*first.certificates, *other.certificates),
        other.lagrangian,
        first.freedom or other.freedom,
        (*first.explanation, *(other.explanation if other.verdict == "variational" else ())),
        Exceptions(lambda: tuple(dict.fromkeys([*first.exceptions, *other.exceptions]))),
    )


def _of_reduced(work: _Work) -> MotionAnswer | None:
    """The yes of the reduced system for the motion, by a certificate that is about the free
    coordinates only.
    """
    reduced = work.reduced
    if (
        reduced is None
        or reduced.verdict != "variational"
        or reduced.checked != "valid"
        or not reduced.certificate
    ):
        return None
    steps = reduced_steps(work.motion.free)
    return MotionAnswer(
        "variational",
        "variational",
        None,
        (reduced.certificate,),
        None,
        "",
        steps,
        reduced.exceptions,
    )


def _decide_in_share(work: _Work, analyzed: existence.AnalyzedMotion, with_time: bool) -> Finding:
    limit = share(_SHARE_OF_DECISION, work.deadline)
    return existence.decide_motion(
        analyzed, with_time, work.seed, limit, lambda stage: work.progress(stage.of(ANY))
    )


def _with_freedom(
    work: _Work, analyzed: existence.AnalyzedMotion, answer: MotionAnswer, with_time: bool
) -> MotionAnswer:
    """The answer with the size of the set of Lagrangians, if the decision, which is not needed,
    takes little time.
    """
    limit = min(share(_SHARE_OF_DECISION, work.deadline), now() + _FOR_FREEDOM)
    found = existence.decide_motion(
        analyzed, with_time, work.seed, limit, lambda stage: work.progress(stage.of(ANY))
    )
    return replace(
        answer,
        freedom=freedom(found, len(work.motion.coordinates), with_time) if found.exists else "",
    )


def _answer_question(
    work: _Work,
    analyzed: existence.AnalyzedMotion,
    found: Finding,
    with_time: bool,
    proven: MotionAnswer | None = None,
) -> MotionAnswer:
    """The answer by short searches for L, then a proof of existence, unless `proven` is one, then
    long searches.
    """
    if found.exists is False:
        refused = _prove_verdict(work, analyzed, found, with_time, "not_variational")
        if with_time:
            _tell(work, refused)
        return refused
    size, steps = (
        freedom(found, len(work.motion.coordinates), with_time),
        finding_steps(analyzed, found, with_time),
    )

    def by_lagrangian(proposals: Iterable[_Proposal]) -> MotionAnswer | None:
        answer = _first_confirmed(work, analyzed, proposals, with_time)
        return answer and replace(answer, freedom=size, explanation=(*steps, *answer.explanation))

    answer = by_lagrangian(_propose_in_short(work, with_time))
    if answer is not None:
        return answer
    if proven is not None:
        proven = replace(proven, freedom=size)
    elif found.exists:
        proven = _prove_verdict(work, analyzed, found, with_time, "variational")
    if proven is not None:
        _tell(work, proven if work.first is None else _of_both(work.first, proven))
    answer = by_lagrangian(_propose_at_length(work, with_time))
    return answer or proven or MotionAnswer("undetermined", "undetermined", open_reason(found))


@dataclass(frozen=True, slots=True)
class _Proposal:
    """A Lagrangian of the motion that is not confirmed yet, what it is known from, and the steps
    that explain it.
    """

    lagrangian: Lagrangian
    known: KnownLagrangian | None = None
    steps: tuple[Step, ...] = ()


def _first_confirmed(
    work: _Work, analyzed: existence.AnalyzedMotion, proposals: Iterable[_Proposal], with_time: bool
) -> MotionAnswer | None:
    """A yes by the first proposal that the checker confirms, with H."""
    for proposal in proposals:
        tree = proposal.lagrangian.expression
        confirmed = _confirm_certificate(
            work, analyzed, existence.of_lagrangian(analyzed, tree, with_time), [tree]
        )
        if confirmed is None:
            continue
        certificate, checked = confirmed
        known, jet = proposal.known, on_constraints.jet_of(tree, work.motion)
        if known is not None:
            found = MotionLagrangian(
                proposal.lagrangian, jet, known.kind, known.system, known.report
            )
        else:
            found = _complete_lagrangian(work, proposal.lagrangian, jet)
        found = found.on_its_set(certificate, checked)
        steps = (*proposal.steps, *lagrangian_steps(tree, jet))
        return MotionAnswer(
            "variational", "variational", None, (certificate,), found, "", steps, checked.exceptions
        )
    return None


def _tell(work: _Work, answer: MotionAnswer) -> None:
    """Report what is proven, before the search for parameter values that the proof excludes."""
    work.told = replace(answer, exceptions=not_found(work.motion.parameters))
    if answer.certificates:
        work.tell(work.told)


def _prove_verdict(
    work: _Work,
    analyzed: existence.AnalyzedMotion,
    found: Finding,
    with_time: bool,
    verdict: Verdict,
) -> MotionAnswer:
    proven = _confirm_certificate(work, analyzed, existence.of_finding(analyzed, found, with_time))
    size = freedom(found, len(work.motion.coordinates), with_time)
    if proven is None:
        reason = reasons.unconfirmed_motion(verdict, found.order)
        return MotionAnswer("undetermined", "undetermined", reason, (), None, size)
    steps = finding_steps(analyzed, found, with_time)
    steps += series_steps(analyzed, found, with_time) if found.exists else ()
    return MotionAnswer(verdict, verdict, None, proven[:1], None, size, steps, proven[1].exceptions)


def _confirm_certificate(
    work: _Work,
    analyzed: existence.AnalyzedMotion,
    certificate: dict[str, Any],
    more: Sequence[Expression] = (),
) -> tuple[dict[str, Any], CheckResult] | None:
    """The certificate that the checker finds valid, unchanged or restricted to one side of roots,
    and the result.
    """
    found = check_certificate(certificate, time_limit=max(1.0, work.left()))
    if found.verdict == "incomplete":
        certificate = existence.on_one_side(analyzed, certificate, more)
        found = check_certificate(certificate, time_limit=max(1.0, work.left()))
    return (certificate, found) if found.verdict == "valid" else None


def _propose_known(work: _Work, with_time: bool) -> Iterator[_Proposal]:
    """Lagrangians of associated systems, the given one if it is one of the motion, and that of the
    reduced system.
    """
    for one in work.known:
        if with_time or not one.with_time:
            yield _Proposal(one.lagrangian, one)
    for free in on_constraints.of_free_motion(work.motion):
        yield _Proposal(free, steps=(said(_FREE_MOTION),))
    if not with_time and work.reduced is not None and work.reduced.lagrangian is not None:
        for closed in on_constraints.closed_coordinates(work.motion):
            whole = on_constraints.on_whole_motion(work.motion, closed, work.reduced.lagrangian)
            yield _Proposal(whole, steps=reduced_steps(closed.system.coordinates))


def _propose_in_short(work: _Work, with_time: bool) -> Iterator[_Proposal]:
    """Lagrangians of the reduced system, unless it is answered already, and from the ansatz along
    the constraints.
    """
    if work.left() < _LEAST_FOR_ANSATZ:
        return
    if with_time or work.reduced is None:
        work.progress(Stage("reduced system", about=ANY))
        reduced = _find_for_closed(work, on_constraints.closed_coordinates(work.motion), with_time)
        if reduced is not None:
            yield _Proposal(reduced)
    work.progress(Stage("ansatz along the constraints", about=ANY))
    found = on_constraints.find_lagrangians(
        work.motion, with_time, work.seed, now() + _SHARE_OF_ANSATZ * work.left()
    )
    yield from map(_Proposal, found[:1])


def _propose_at_length(work: _Work, with_time: bool) -> Iterator[_Proposal]:
    """Lagrangians of other closed functions of position."""
    if work.left() < _LEAST_FOR_ANSATZ:
        return
    work.progress(Stage("functions of position with equations of their own", about=ANY))
    others = on_constraints.closed_functions(work.motion, now() + _SHARE_OF_REDUCED * work.left())
    reduced = _find_for_closed(work, others, with_time)
    if reduced is not None:
        yield _Proposal(reduced)


def _find_for_closed(
    work: _Work, closed: Iterable[on_constraints.ClosedFunctions], with_time: bool
) -> Lagrangian | None:
    return on_constraints.lagrangian_of_closed(
        work.motion, closed, with_time, work.seed, _SHARE_OF_REDUCED * work.left()
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
    return MotionLagrangian(lagrangian, jet, "own", system, report)


def finding_steps(
    analyzed: existence.AnalyzedMotion, found: Finding, with_time: bool
) -> tuple[Step, ...]:
    """The steps that state the question and prove the answer."""
    k = len(analyzed.motion.free)
    steps = [
        said(
            f"A regular {_QUESTION[with_time]} has this motion on the constraints exactly if `l` and `lambda_a`, in "
            "`L = l + lambda_a mu^a + ...` along the constraints, make its Euler-Lagrange expressions vanish there, a "
            f"linear system. The second derivatives of `l` by the free velocities and the first of `lambda_a` must "
            f"have rank {k} together."
        )
    ]
    if found.exists is False:
        steps += _bivector_steps(found)
        alone = "At a point, by power series along one solution"
        how = f"Prolonged to order {found.order}" if found.along is None else alone
        steps.append(
            said(
                f"{how}, {len(found.rows)} equations leave a rank below {k} in every solution. This is a "
                "contradiction, so no associated system is variational.",
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


def freedom(found: Finding, n: int, with_time: bool) -> str:
    """The number of functions and variables on which L along the constraints depends, up to total
    derivatives.

    The dimension of the symbol in degree d + j is sum alpha_k C(k - 1 + j, k - 1); `_gauge` is the
    part due to F.
    """
    if found.symbol is None:
        return ""
    characters, degree, variables = found.symbol.characters, found.degree, n + with_time

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
    analyzed: existence.AnalyzedMotion, found: Finding, with_time: bool
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
        *[TIME] * with_time,
        *map(Symbol, analyzed.names),
        *map(Velocity, motion.free),
    ]
    symbols = [*variables, *map(Symbol, motion.parameters)]
    for first in range(1, 1 + bounds.ATTEMPTS):
        values = {symbol: first + k for k, symbol in enumerate(symbols)}
        try:
            coefficients = _coefficients(analyzed, found, with_time, values)
        except modular.SingularPoint:
            continue
        if coefficients is not None and len(coefficients) <= bounds.SHOWN:
            return (_written(variables, values, coefficients, len(motion.dependent)),)
    return ()


def _coefficients(
    analyzed: existence.AnalyzedMotion,
    found: Finding,
    with_time: bool,
    values: Mapping[modular.Variable, int],
) -> dict[Unknown, Fraction] | None:
    card = existence.ConstrainedAt(
        analyzed,
        with_time,
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
