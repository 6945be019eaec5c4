"""The answer about a motion: whether any Lagrangian has it, which one, its Hamiltonian, the proof, checked.

First the decision, for L(q, q') and where that has none for L(t, q, q'); then a Lagrangian in closed form, of
an associated system that is known to have one, or by an ansatz. No verdict leaves unconfirmed by the checker.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from inverse_service.certificate.checker import check_certificate
from inverse_service.constrained import motion_certificate
from inverse_service.constrained.ansatz import find_lagrangians
from inverse_service.constrained.existence import AnalyzedMotion, analyze_motion, decide_motion
from inverse_service.constrained.hamiltonisation.hamiltonise import Hamiltonisation, hamiltonise
from inverse_service.constrained.lagrangian import (
    ClosedFunctions,
    JetOnConstraints,
    closed_coordinates,
    closed_functions,
    jet_of,
    lagrangian_of_closed,
    on_whole_motion,
    own_system,
)
from inverse_service.constrained.motion_sentences import (
    finding_steps,
    freedom,
    lagrangian_steps,
    open_reason,
    reduced_steps,
    series_steps,
)
from inverse_service.deadline import OutOfTime, now, until
from inverse_service.decision.solutions import Answer, Lagrangian, Step, Verdict
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import Expression, Number, Power, Velocity, walk
from inverse_service.linear_pde.involutive_form import Finding
from inverse_service.mechanics.legendre.transform import legendre
from inverse_service.mechanics.nonholonomic.motion import ConstrainedMotion, EquationsOfMotion
from inverse_service.mechanics.second_order_system import SecondOrderSystem

# Of the time, what the decisions may take; the rest is for a closed form, H and the checks.
_SHARE_OF_DECISION, _SHARE_OF_REDUCED, _SHARE_OF_ANSATZ = 0.4, 0.3, 0.5
_STEEP = -3
# Seconds without which no closed form is looked for: its parts do not look at the clock at every step.
_LEAST_FOR_ANSATZ = 6.0
OUT_OF_TIME = "The time for this question was over."
_NOT_CONFIRMED = "the independent check could not confirm it"


@dataclass(frozen=True, slots=True)
class KnownLagrangian:
    """A Lagrangian of an associated system, with its report."""

    kind: str
    system: SecondOrderSystem
    lagrangian: Lagrangian
    with_time: bool
    report: Hamiltonisation | None


@dataclass(frozen=True, slots=True)
class MotionLagrangian:
    """L on the tangent bundle, its 1-jet along the constraints, the associated system it belongs to, its report."""

    lagrangian: Lagrangian
    jet: JetOnConstraints
    kind: str
    system: SecondOrderSystem | None
    report: Hamiltonisation | None


@dataclass(frozen=True, slots=True)
class MotionAnswer:
    """`certificates` prove the verdicts, that of L(q, q') first; one may prove both."""

    verdict: Verdict
    verdict_with_time: Verdict
    reason: str = ""
    certificates: tuple[Mapping[str, Any], ...] = ()
    lagrangian: MotionLagrangian | None = None
    freedom: str = ""
    explanation: tuple[Step, ...] = ()


@dataclass(slots=True)
class _Work:
    motion: ConstrainedMotion
    known: Sequence[KnownLagrangian]
    seed: int
    deadline: float
    progress: Callable[[str], None]
    tell: Callable[[MotionAnswer], None] | None = None

    def left(self) -> float:
        return self.deadline - now()


def answer_motion(
    motion: ConstrainedMotion,
    known: Sequence[KnownLagrangian] = (),
    time_dependent: bool | None = None,
    seed: int = 1,
    deadline: float = float("inf"),
    progress: Callable[[str], None] = lambda _: None,
    positive: Sequence[Expression] = (),
    reduced: Answer | None = None,
    tell: Callable[[MotionAnswer], None] | None = None,
) -> MotionAnswer:
    """Both questions where all of `positive` are > 0; `known` are Lagrangians of associated systems.

    `reduced` answers for the equations of the free coordinates, where these contain no others. There is a report on
    H for EquationsOfMotion. `tell` hears of a verdict that the checker confirmed while a Lagrangian is looked for; it
    stands where the time for that is over.
    """
    told: list[MotionAnswer] = []
    work = _Work(motion, known, seed, deadline, progress, None if tell is None else _noting(told, tell))
    try:
        with until(deadline):
            return _both(work, time_dependent, analyze_motion(motion, positive), reduced)
    except IrreducibleAtoms as problem:
        return MotionAnswer("undetermined", "undetermined", problem.detail)
    except OutOfTime:
        return told[-1] if told else MotionAnswer("undetermined", "undetermined", OUT_OF_TIME)


def _noting(told: list[MotionAnswer], tell: Callable[[MotionAnswer], None]) -> Callable[[MotionAnswer], None]:
    def both(answer: MotionAnswer) -> None:
        told.append(answer)
        tell(answer)

    return both


def _both(work: _Work, time_dependent: bool | None, analyzed: AnalyzedMotion, reduced: Answer | None) -> MotionAnswer:
    motion = work.motion
    both = time_dependent is None and not motion.depends_on_time
    fitting = any(not one.with_time for one in work.known)
    if reduced is not None and not fitting and time_dependent is not True:
        carried = _of_reduced(work, analyzed, reduced)
        if carried is not None:
            return carried
    if not both:
        with_time = time_dependent is not False or motion.depends_on_time
        return _answer(work, analyzed, _decided(work, analyzed, with_time), with_time)
    plain = _decided(work, analyzed, with_time=False)
    if plain.exists is False:  # one proof for both questions, where there is no L(t, q, q') either
        timed = _decided(work, analyzed, with_time=True)
        if (
            timed.exists is False
            and (other := _answer(work, analyzed, timed, with_time=True)).verdict != "undetermined"
        ):
            return other
    else:
        timed = None
    first = _answer(work, analyzed, plain, with_time=False)
    if first.verdict == "variational":
        return first
    timed = timed or _decided(work, analyzed, with_time=True)
    other = _answer(work, analyzed, timed, with_time=True)
    if other.verdict == "not_variational":
        return other  # no L(t, q, q'), so no L(q, q')
    return MotionAnswer(
        first.verdict,
        other.verdict,
        first.reason or other.reason,
        (*first.certificates, *other.certificates),
        other.lagrangian,
        first.freedom or other.freedom,
        (*first.explanation, *(other.explanation if other.verdict == "variational" else ())),
    )


def _of_reduced(work: _Work, analyzed: AnalyzedMotion, reduced: Answer) -> MotionAnswer | None:
    """The yes of the reduced system carried on to the motion, once the checker agrees.

    Without a Lagrangian in closed form the certificate is that of the free coordinates alone.
    """
    if reduced.verdict != "variational" or reduced.checked != "valid" or reduced.certificate is None:
        return None
    (closed,) = closed_coordinates(work.motion)
    steps = reduced_steps(closed.system.coordinates)
    if reduced.lagrangian is None:
        return MotionAnswer("variational", "variational", "", (reduced.certificate,), None, "", steps)
    whole = on_whole_motion(work.motion, closed, reduced.lagrangian)
    plain = motion_certificate.of_lagrangian(analyzed, whole.expression, False)
    certificate = _confirmed(work, analyzed, plain, [whole.expression])
    if certificate is None:
        return None
    found = _carried_on(work, whole)
    steps += lagrangian_steps(whole.expression, found.jet)
    return MotionAnswer("variational", "variational", "", (certificate,), found, "", steps)


def _decided(work: _Work, analyzed: AnalyzedMotion, with_time: bool) -> Finding:
    limit = now() + _SHARE_OF_DECISION * work.left()
    return decide_motion(analyzed, with_time, work.seed, limit, lambda stage: work.progress(f"any: {stage}"))


def _answer(work: _Work, analyzed: AnalyzedMotion, found: Finding, with_time: bool) -> MotionAnswer:
    if found.exists is False:
        return _proven(work, analyzed, found, with_time, "not_variational")
    if found.exists and work.tell is not None and not any(with_time or not one.with_time for one in work.known):
        work.tell(_proven(work, analyzed, found, with_time, "variational"))
    for lagrangian in _lagrangians(work, with_time):
        tree = lagrangian.lagrangian.expression
        certificate = _confirmed(work, analyzed, motion_certificate.of_lagrangian(analyzed, tree, with_time), [tree])
        if certificate is not None:
            steps = (
                *finding_steps(analyzed, found, with_time),
                *lagrangian_steps(lagrangian.lagrangian.expression, lagrangian.jet),
            )
            size = freedom(found, len(work.motion.coordinates), with_time)
            return MotionAnswer("variational", "variational", "", (certificate,), lagrangian, size, steps)
    if found.exists is None:
        return MotionAnswer("undetermined", "undetermined", open_reason(found))
    return _proven(work, analyzed, found, with_time, "variational")


def _proven(work: _Work, analyzed: AnalyzedMotion, found: Finding, with_time: bool, verdict: Verdict) -> MotionAnswer:
    certificate = _confirmed(work, analyzed, motion_certificate.of_finding(analyzed, found, with_time))
    size = freedom(found, len(work.motion.coordinates), with_time)
    if certificate is None:
        reason = f"the solver found {verdict.replace('_', ' ')} at order {found.order}, but {_NOT_CONFIRMED}"
        return MotionAnswer("undetermined", "undetermined", reason, (), None, size)
    steps = finding_steps(analyzed, found, with_time)
    steps += series_steps(analyzed, found, with_time) if found.exists else ()
    return MotionAnswer(verdict, verdict, "", (certificate,), None, size, steps)


def _confirmed(
    work: _Work, analyzed: AnalyzedMotion, certificate: dict[str, Any], more: Sequence[Expression] = ()
) -> dict[str, Any] | None:
    """The certificate that the checker finds valid: as it is, or about one side of what is under roots."""
    found = check_certificate(certificate, time_limit=max(1.0, work.left()))
    if found.verdict == "incomplete":
        certificate = motion_certificate.on_one_side(analyzed, certificate, more)
        found = check_certificate(certificate, time_limit=max(1.0, work.left()))
    return certificate if found.verdict == "valid" else None


def _lagrangians(work: _Work, with_time: bool) -> Sequence[MotionLagrangian]:
    """Those of associated systems, else of the reduced system, what an ansatz finds, other closed functions."""
    fitting = [one for one in work.known if with_time or not one.with_time]
    if fitting:
        return [
            MotionLagrangian(
                one.lagrangian, jet_of(one.lagrangian.expression, work.motion), one.kind, one.system, one.report
            )
            for one in fitting
        ]
    if work.left() < _LEAST_FOR_ANSATZ:
        return []
    work.progress("any: reduced system")
    reduced = _of_closed(work, closed_coordinates(work.motion), with_time)
    if reduced is not None:
        return [_carried_on(work, reduced)]
    work.progress("any: ansatz along the constraints")
    limit = now() + _SHARE_OF_ANSATZ * work.left()
    found = find_lagrangians(work.motion, with_time, work.seed, limit)[:1]
    if not found and work.left() > _LEAST_FOR_ANSATZ:
        work.progress("any: functions of position with equations of their own")
        others = closed_functions(work.motion, now() + _SHARE_OF_REDUCED * work.left())
        further = _of_closed(work, others, with_time)
        found = [] if further is None else [further]
    return [_carried_on(work, tree) for tree in found]


def _of_closed(work: _Work, closed: Iterable[ClosedFunctions], with_time: bool) -> Lagrangian | None:
    return lagrangian_of_closed(work.motion, closed, with_time, work.seed, _SHARE_OF_REDUCED * work.left())


def _is_steep(lagrangian: Expression) -> bool:
    """Whether velocities stand under large powers: no closed form of H is attempted then."""
    return any(
        isinstance(node, Power) and isinstance(node.exponent, Number) and node.exponent.value <= _STEEP
        for node in walk(lagrangian)
        if isinstance(node, Power) and isinstance(node.base, Velocity)
    )


def _carried_on(work: _Work, lagrangian: Lagrangian) -> MotionLagrangian:
    """To its own equations, H, and the constraints in phase space."""
    tree, report = lagrangian.expression, None
    system = own_system(tree, work.motion, now() + _SHARE_OF_ANSATZ * work.left())
    if system is not None and isinstance(work.motion, EquationsOfMotion) and work.left() > 0:
        known = legendre(tree, system.coordinates, 0.0) if _is_steep(tree) else None
        with suppress(OutOfTime), until(now() + _SHARE_OF_ANSATZ * work.left()):
            report = hamiltonise(work.motion, system, tree, work.seed, known)
    return MotionLagrangian(lagrangian, jet_of(tree, work.motion), "own", system, report)
