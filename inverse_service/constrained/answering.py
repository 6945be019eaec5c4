"""Answer whether any Lagrangian has a motion, with the Lagrangian, its Hamiltonian, and a checked proof.

The decision comes first, for L(q, q') and, if there is none, for L(t, q, q'). Then the module looks for a Lagrangian in
closed form, from an associated system known to have one or by an ansatz. The checker confirms every verdict. If a
Lagrangian exists but none is known in closed form, the sentences show the beginning of the power series of l and
lambda_a.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
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
from inverse_service.decision.solutions import Answer, Lagrangian, Step, Verdict
from inverse_service.explanation.explaining import said, separated
from inverse_service.expressions.notation import row
from inverse_service.expressions.tree import TIME, Expression, Number, Power, Symbol, Velocity, walk
from inverse_service.field import modular
from inverse_service.linear_pde.involution import Finding, Unknown, halved_squares, prolonged, solution_of
from inverse_service.mechanics import constrained_motion, second_order_system
from inverse_service.mechanics.legendre import legendre

# The shares of the time that the decisions may use; the remaining time is for a closed form, H, and the checks.
_SHARE_OF_DECISION, _SHARE_OF_REDUCED, _SHARE_OF_ANSATZ = 0.4, 0.3, 0.5
_STEEP = -3
# The least time, in seconds, for a closed form, because its parts do not check the time at every step.
_LEAST_FOR_ANSATZ = 6.0
OUT_OF_TIME = "The time for this question was over."
_NOT_CONFIRMED = "the independent check could not confirm it"

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
    """L on the tangent bundle, its 1-jet along the constraints, its associated system, and its report."""

    lagrangian: Lagrangian
    jet: on_constraints.JetOnConstraints
    kind: str
    system: second_order_system.SecondOrderSystem | None
    report: Hamiltonisation | None

    def on_its_set(self, certificate: Mapping[str, Any], proof: CheckResult) -> MotionLagrangian:
        """The same Lagrangian with the set on which the checker proved L."""
        where = certify.where_of(proof.formulas, certify.names_of(certificate["system"], certificate))
        return replace(self, lagrangian=replace(self.lagrangian, positive=where.positive, nonzero=where.nonzero))


@dataclass(frozen=True, slots=True)
class MotionAnswer:
    """The verdicts, with `certificates` that prove them, the one for L(q, q') first; one may prove both.

    The proofs are valid for general parameters: `exceptions` are equations between parameters for which one fails.
    """

    verdict: Verdict
    verdict_with_time: Verdict
    reason: str = ""
    certificates: tuple[Mapping[str, Any], ...] = ()
    lagrangian: MotionLagrangian | None = None
    freedom: str = ""
    explanation: tuple[Step, ...] = ()
    exceptions: Sequence[str] = ()


@dataclass(slots=True)
class _Work:
    motion: second_order_system.ConstrainedMotion
    known: Sequence[KnownLagrangian]
    seed: int
    deadline: float
    progress: Callable[[str], None]
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
    progress: Callable[[str], None] = lambda _: None,
    positive: Sequence[Expression] = (),
    reduced: Answer | None = None,
    tell: Callable[[MotionAnswer], None] = lambda _: None,
) -> MotionAnswer:
    """Answer both questions where all of `positive` are > 0; `known` are Lagrangians of associated systems.

    `reduced` is the answer for the equations of the free coordinates if these contain no others. EquationsOfMotion get
    a report on H. `tell` receives a confirmed verdict while the search for a Lagrangian continues; this verdict remains
    if the time expires.
    """
    work = _Work(motion, known, seed, deadline, progress, tell)
    try:
        with until(deadline):
            return _answer_both_questions(work, time_dependent, existence.analyze_motion(motion, positive), reduced)
    except errors.IrreducibleAtoms as problem:
        return MotionAnswer("undetermined", "undetermined", problem.detail)
    except OutOfTime:
        return work.told or MotionAnswer("undetermined", "undetermined", OUT_OF_TIME)


def _answer_both_questions(
    work: _Work, time_dependent: bool | None, analyzed: existence.AnalyzedMotion, reduced: Answer | None
) -> MotionAnswer:
    motion = work.motion
    both = time_dependent is None and not motion.depends_on_time
    fitting = any(not one.with_time for one in work.known)
    if reduced is not None and not fitting and time_dependent is not True:
        carried = _carry_reduced_answer(work, analyzed, reduced)
        if carried is not None:
            return carried
    if not both:
        with_time = time_dependent is not False or motion.depends_on_time
        return _answer_question(work, analyzed, _decide_in_share(work, analyzed, with_time), with_time)
    plain = _decide_in_share(work, analyzed, with_time=False)
    if plain.exists is False:  # one proof for both questions, where there is no L(t, q, q') either
        timed = _decide_in_share(work, analyzed, with_time=True)
        if (
            timed.exists is False
            and (other := _answer_question(work, analyzed, timed, with_time=True)).verdict != "undetermined"
        ):
            return other
    else:
        timed = None
    first = _answer_question(work, analyzed, plain, with_time=False)
    if first.verdict == "variational":
        return first
    work.first, work.told = first, _of_both(first, MotionAnswer("undetermined", "undetermined", OUT_OF_TIME))
    timed = timed or _decide_in_share(work, analyzed, with_time=True)
    other = _answer_question(work, analyzed, timed, with_time=True)
    return other if other.verdict == "not_variational" else _of_both(first, other)  # no L(t, q, q'), so no L(q, q')


def _of_both(first: MotionAnswer, other: MotionAnswer) -> MotionAnswer:
    """The answers for L(q, q') and for L(t, q, q') as one."""
    return MotionAnswer(
        first.verdict,
        other.verdict,
        first.reason or other.reason,
        (*first.certificates, *other.certificates),
        other.lagrangian,
        first.freedom or other.freedom,
        (*first.explanation, *(other.explanation if other.verdict == "variational" else ())),
        Exceptions(lambda: tuple(dict.fromkeys([*first.exceptions, *other.exceptions]))),
    )


def _carry_reduced_answer(work: _Work, analyzed: existence.AnalyzedMotion, reduced: Answer) -> MotionAnswer | None:
    """The yes of the reduced system transferred to the motion, if the checker agrees.

    Without a Lagrangian in closed form, the certificate is about the free coordinates only.
    """
    if reduced.verdict != "variational" or reduced.checked != "valid" or reduced.certificate is None:
        return None
    (closed,) = on_constraints.closed_coordinates(work.motion)
    steps = reduced_steps(closed.system.coordinates)
    if reduced.lagrangian is None:
        proof = (reduced.certificate,)
        return MotionAnswer("variational", "variational", "", proof, None, "", steps, reduced.exceptions)
    whole = on_constraints.on_whole_motion(work.motion, closed, reduced.lagrangian)
    plain = existence.of_lagrangian(analyzed, whole.expression, False)
    proven = _confirm_certificate(work, analyzed, plain, [whole.expression])
    if proven is None:
        return None
    certificate, checked = proven
    found = _complete_lagrangian(work, whole).on_its_set(certificate, checked)
    steps += lagrangian_steps(whole.expression, found.jet)
    return MotionAnswer("variational", "variational", "", (certificate,), found, "", steps, checked.exceptions)


def _decide_in_share(work: _Work, analyzed: existence.AnalyzedMotion, with_time: bool) -> Finding:
    limit = share(_SHARE_OF_DECISION, work.deadline)
    return existence.decide_motion(analyzed, with_time, work.seed, limit, lambda stage: work.progress(f"any: {stage}"))


def _answer_question(work: _Work, analyzed: existence.AnalyzedMotion, found: Finding, with_time: bool) -> MotionAnswer:
    if found.exists is False:
        refused = _prove_verdict(work, analyzed, found, with_time, "not_variational")
        if with_time:
            _tell(work, refused)
        return refused
    proven = None
    if found.exists and not any(with_time or not one.with_time for one in work.known):
        proven = _prove_verdict(work, analyzed, found, with_time, "variational")
        _tell(work, proven if work.first is None else _of_both(work.first, proven))
    for lagrangian in _propose_lagrangians(work, with_time):
        tree = lagrangian.lagrangian.expression
        confirmed = _confirm_certificate(work, analyzed, existence.of_lagrangian(analyzed, tree, with_time), [tree])
        if confirmed is not None:
            certificate, proof = confirmed
            steps = (
                *finding_steps(analyzed, found, with_time),
                *lagrangian_steps(lagrangian.lagrangian.expression, lagrangian.jet),
            )
            size = freedom(found, len(work.motion.coordinates), with_time)
            found_here = lagrangian.on_its_set(certificate, proof)
            proofs = (certificate,)
            return MotionAnswer("variational", "variational", "", proofs, found_here, size, steps, proof.exceptions)
    if found.exists is None:
        return MotionAnswer("undetermined", "undetermined", open_reason(found))
    return proven or _prove_verdict(work, analyzed, found, with_time, "variational")


def _tell(work: _Work, answer: MotionAnswer) -> None:
    """Report what is proven, before the search for parameter values that the proof excludes."""
    work.told = replace(answer, exceptions=not_found(work.motion.parameters))
    if answer.certificates:
        work.tell(work.told)


def _prove_verdict(
    work: _Work, analyzed: existence.AnalyzedMotion, found: Finding, with_time: bool, verdict: Verdict
) -> MotionAnswer:
    proven = _confirm_certificate(work, analyzed, existence.of_finding(analyzed, found, with_time))
    size = freedom(found, len(work.motion.coordinates), with_time)
    if proven is None:
        reason = f"the solver found {verdict.replace('_', ' ')} at order {found.order}, but {_NOT_CONFIRMED}"
        return MotionAnswer("undetermined", "undetermined", reason, (), None, size)
    steps = finding_steps(analyzed, found, with_time)
    steps += series_steps(analyzed, found, with_time) if found.exists else ()
    return MotionAnswer(verdict, verdict, "", proven[:1], None, size, steps, proven[1].exceptions)


def _confirm_certificate(
    work: _Work, analyzed: existence.AnalyzedMotion, certificate: dict[str, Any], more: Sequence[Expression] = ()
) -> tuple[dict[str, Any], CheckResult] | None:
    """The certificate that the checker finds valid, unchanged or restricted to one side of roots, and the result."""
    found = check_certificate(certificate, time_limit=max(1.0, work.left()))
    if found.verdict == "incomplete":
        certificate = existence.on_one_side(analyzed, certificate, more)
        found = check_certificate(certificate, time_limit=max(1.0, work.left()))
    return (certificate, found) if found.verdict == "valid" else None


def _propose_lagrangians(work: _Work, with_time: bool) -> Sequence[MotionLagrangian]:
    """Lagrangians of associated systems, else of the reduced system, of other closed functions, or from an ansatz."""
    fitting = [one for one in work.known if with_time or not one.with_time]
    if fitting:
        jets = [on_constraints.jet_of(one.lagrangian.expression, work.motion) for one in fitting]
        pairs = zip(fitting, jets, strict=True)
        return [MotionLagrangian(one.lagrangian, jet, one.kind, one.system, one.report) for one, jet in pairs]
    if work.left() < _LEAST_FOR_ANSATZ:
        return []
    work.progress("any: reduced system")
    reduced = _find_for_closed(work, on_constraints.closed_coordinates(work.motion), with_time)
    if reduced is not None:
        return [_complete_lagrangian(work, reduced)]
    work.progress("any: functions of position with equations of their own")
    others = on_constraints.closed_functions(work.motion, now() + _SHARE_OF_REDUCED * work.left())
    reduced = _find_for_closed(work, others, with_time)
    if reduced is not None:
        return [_complete_lagrangian(work, reduced)]
    if work.left() < _LEAST_FOR_ANSATZ:
        return []
    work.progress("any: ansatz along the constraints")
    found = on_constraints.find_lagrangians(work.motion, with_time, work.seed, now() + _SHARE_OF_ANSATZ * work.left())
    return [_complete_lagrangian(work, tree) for tree in found[:1]]


def _find_for_closed(
    work: _Work, closed: Iterable[on_constraints.ClosedFunctions], with_time: bool
) -> Lagrangian | None:
    return on_constraints.lagrangian_of_closed(
        work.motion, closed, with_time, work.seed, _SHARE_OF_REDUCED * work.left()
    )


def _is_steep(lagrangian: Expression) -> bool:
    """Whether velocities have large negative powers, in which case no closed form of H is attempted."""
    return any(
        isinstance(node, Power) and isinstance(node.exponent, Number) and node.exponent.value <= _STEEP
        for node in walk(lagrangian)
        if isinstance(node, Power) and isinstance(node.base, Velocity)
    )


def _complete_lagrangian(work: _Work, lagrangian: Lagrangian) -> MotionLagrangian:
    """Add its own equations, H, and the constraints in phase space."""
    tree, report = lagrangian.expression, None
    system = on_constraints.own_system(tree, work.motion, now() + _SHARE_OF_ANSATZ * work.left())
    if system is not None and isinstance(work.motion, constrained_motion.EquationsOfMotion) and work.left() > 0:
        known = legendre(tree, system.coordinates, 0.0) if _is_steep(tree) else None
        with suppress(OutOfTime), until(now() + _SHARE_OF_ANSATZ * work.left()):
            report = hamiltonise(work.motion, system, tree, work.seed, known)
    return MotionLagrangian(lagrangian, on_constraints.jet_of(tree, work.motion), "own", system, report)


def finding_steps(analyzed: existence.AnalyzedMotion, found: Finding, with_time: bool) -> tuple[Step, ...]:
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
                f"{how}, {len(found.rows)} equations leave a rank below {k} in every solution: no associated system is "
                "variational.",
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
    # Without derivatives these are equations for the values of the 2-form, which are otherwise arbitrary.
    alone = rows == list(found.rows) and not any(any(row[-1]) for row in rows if isinstance(row[-1], tuple))
    return [
        said(
            "The 2-form of such a Lagrangian vanishes on the Lie derivatives along the motion of the bivectors of the "
            f"free velocities: equations of first order, of which {len(orders)} are used, to order {max(orders)}."
            f"{' Each 2-form that does has a vertical vector in its kernel.' * alone}"
        )
    ]


def lagrangian_steps(lagrangian: Expression, jet: on_constraints.JetOnConstraints) -> tuple[Step, ...]:
    """The steps that show L and its 1-jet along the constraints."""
    momenta = [row(f"lambda_{k} = ", tree) for k, tree in enumerate(jet.transverse_momenta, 1)]
    return (
        said("A Lagrangian, found by an ansatz or known for an associated system: ", shown=[row("L = ", lagrangian)]),
        said("Along the constraints it is ", *separated([row("l = ", jet.on_constraints), *momenta]), "."),
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


def open_reason(found: Finding) -> str:
    """A sentence on how far the decision got."""
    if not found.history:
        return found.reason
    dimensions = ", ".join(map(str, found.history[-1][:3]))
    return (
        f"{found.reason}: at order {found.order} rank {found.ranks[0] if found.ranks else 'unknown'} is possible, "
        f"dimensions {dimensions} in degrees 0, 1, 2"
    )


def freedom(found: Finding, n: int, with_time: bool) -> str:
    """The number of functions and variables on which L along the constraints depends, up to total derivatives.

    The dimension of the symbol in degree d + j is sum alpha_k C(k - 1 + j, k - 1); `_gauge` is the part due to F.
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
    """The dimension of l = Gamma(F), lambda_a = dF/ds^a, F of so many variables, in unknowns up to a degree.

    It counts the F of degree up to d + 1 except F = 1, and the derivatives along Gamma, in l, of those of degree d + 2.
    """
    return comb(variables + degree + 1, variables) - 1 + comb(variables + degree, variables - 1)


def series_steps(analyzed: existence.AnalyzedMotion, found: Finding, with_time: bool) -> tuple[Step, ...]:
    """One step with l and lambda_a to the degree at which the system is involutive; none if they are not rational.

    Every solution of the projected system to this degree is the beginning of an analytic one.
    """
    motion = analyzed.motion
    if any(deciding.is_irrational(node) for tree in (*analyzed.velocities, *analyzed.forces) for node in walk(tree)):
        return ()
    variables: list[modular.Variable] = [*[TIME] * with_time, *map(Symbol, analyzed.names), *map(Velocity, motion.free)]
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
    analyzed: existence.AnalyzedMotion, found: Finding, with_time: bool, values: Mapping[modular.Variable, int]
) -> dict[Unknown, Fraction] | None:
    card = existence.ConstrainedAt(
        analyzed, with_time, lambda seed: modular.Point(modular.safe_prime(seed), seed, variables=dict(values))
    )
    return deciding.reconstructed(lambda seed: _residues(card, found, seed))


def _residues(card: existence.ConstrainedAt, found: Finding, seed: int) -> tuple[int, dict[Unknown, int] | None]:
    """A solution of full rank modulo a prime; squares have the coefficient 1/2, all other free coefficients are 0."""
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
