"""Study a nonholonomic system: its motion, conserved quantities, associated systems, and
Hamiltonization.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress
from typing import Literal, TypeVar

from inverse_service import errors
from inverse_service.certificate import checker
from inverse_service.constrained import answering
from inverse_service.constrained.hamiltonise import Hamiltonisation, hamiltonise
from inverse_service.constrained.reduced import checker_accepts_each, solution_with
from inverse_service.deadline import now
from inverse_service.decision import solutions
from inverse_service.explanation import explaining
from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field, real_branch
from inverse_service.mechanics import (
    constrained_motion,
    first_integrals as kept,
    nonholonomic_integrals,
    paper_class,
    second_order_system,
)
from inverse_service.mechanics.legendre import LegendreTransform
from inverse_service.solving import solving
from inverse_service.statements.stages import Progress

# The share of the time for the associated systems; the remaining time is for the Hamiltonization
# report.
_SHARE_OF_SOLVING = 0.85
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class MotionReport:
    """The motion and its conserved quantities; `reason` says why the system is outside the paper's
    class, if it is.
    """

    exact: constrained_motion.EliminatedMotion
    motion: constrained_motion.EquationsOfMotion
    integrability: nonholonomic_integrals.Integrability | None
    density: nonholonomic_integrals.MeasureDensity
    member: paper_class.PaperClass | None
    reason: str


@dataclass(frozen=True, slots=True)
class Report:
    """The Hamiltonization by one Lagrangian; `checked` is the checker's verdict on that
    Lagrangian.
    """

    kind: str
    label: str
    checked: Literal["valid", "incomplete", "invalid"]
    found: Hamiltonisation


@dataclass(frozen=True, slots=True)
class AssociatedAnswer:
    """An associated system, its solution (None if it is not defined), and its Hamiltonizations."""

    associated: paper_class.AssociatedSystem
    solution: solutions.Solution | None
    reports: tuple[Report, ...] = ()

    @property
    def answer(self) -> solutions.Statement | None:
        """The answer for L(q, q'), or for L(t, q, q') if that is the only question."""
        return None if self.solution is None else self.solution.main


@dataclass(frozen=True, slots=True)
class Study:
    """All results; `main` is the index in `answers` of the associated system shown in the main
    fields.
    """

    report: MotionReport
    answers: tuple[AssociatedAnswer, ...]
    main: int


def motion_report(
    system: constrained_motion.NonholonomicSystem, time_limit: float = constrained_motion.TIME_LIMIT
) -> MotionReport:
    """The motion and its conserved quantities, in the coordinates of the paper's class if the
    system belongs to it.

    Results not found in `time_limit` seconds are omitted; LimitError if the motion itself is not
    found.
    """
    parts = constrained_motion.geometry(system, time_limit)
    try:
        member, reason = paper_class.recognized(parts)
        exact = constrained_motion.eliminate_multipliers(
            parts, member.frame if member is not None else constrained_motion.frames(parts)[0]
        )
        motion = constrained_motion.motion_as_trees(exact)
    except exact_field.TooLarge as error:
        raise constrained_motion.too_large(error) from None
    found = MotionReport(
        exact,
        motion,
        or_none(lambda: nonholonomic_integrals.integrability(parts, exact.frame)),
        or_none(lambda: nonholonomic_integrals.measure_density(exact))
        or nonholonomic_integrals.MeasureDensity("not_found"),
        member,
        reason,
    )
    # Later work over the same ring is short and may happen at any time.
    parts.ring.field.budget.deadline = math.inf
    return found


def first_integrals(
    report: MotionReport, seed: int, time_limit: float
) -> tuple[kept.FirstIntegral, ...]:
    """The first integrals of the motion; velocities with proportional rates are proposed."""
    motion, exact = report.motion, report.exact
    proposed = or_none(lambda: tuple(nonholonomic_integrals.scaled_velocities(exact))) or ()
    return kept.first_integrals(motion, motion.system.lagrangian, seed, time_limit, proposed)


def or_none(work: Callable[[], T]) -> T | None:
    """The result of the work; None if it exceeds the budget for exact expressions or divides by
    0.
    """
    try:
        return work()
    except (exact_field.TooLarge, ZeroDivisionError):
        return None


def associated_systems(
    report: MotionReport,
    kind: paper_class.Kind | None,
    families: Sequence[Sequence[ex.Expression]] = (),
) -> tuple[paper_class.AssociatedSystem, ...]:
    """The requested systems: one kind, all three, or one kind with each family of multiples added.

    InputError if a multiple does not vanish on the constraints.
    """
    if not families:
        return tuple(_associated(report, each) for each in ([kind] if kind else paper_class.KINDS))
    base = _associated(report, kind or "first")
    if base.system is None:
        raise errors.InputError(base.explanation, "/associated")
    return tuple(
        paper_class.with_multiples(
            base,
            _require_vanishing(report.motion, family, place, len(families)),
            f"family {place + 1}",
        )
        for place, family in enumerate(families)
    )


def _associated(report: MotionReport, kind: paper_class.Kind) -> paper_class.AssociatedSystem:
    try:
        return paper_class.associated(report.exact, report.member, report.reason, kind)
    except exact_field.TooLarge as problem:
        return paper_class.AssociatedSystem(
            kind, None, f"The {kind} system is too large to be written out: {problem}."
        )


def _require_vanishing(
    motion: constrained_motion.EquationsOfMotion,
    family: Sequence[ex.Expression],
    place: int,
    count: int,
) -> Sequence[ex.Expression]:
    """The family, whose members vanish on the constraints; InputError if one does not, or this
    cannot be decided.
    """
    system = motion.system
    for name, tree in zip(system.coordinates, family, strict=True):
        pointer = "/multiples" + (f"/{place}" if count > 1 else "") + f"/{name}"
        names: list[ex.Symbol | ex.Velocity] = [*map(ex.Velocity, system.coordinates)]
        names += map(ex.Symbol, (*system.coordinates, *system.parameters, "t"))
        found = tree == ex.ZERO or real_branch.vanish(
            [ex.substitute(tree, motion.on_constraints)], names
        )
        if not found:
            what = "does not vanish" if found is False else "could not be shown to vanish"
            raise errors.InputError(
                f"the multiple for {name} {what} on the constraints: write a sum of multiples of them, such as "
                "mu*(constraint).",
                pointer,
            )
    return family


def study(
    report: MotionReport,
    systems: Sequence[paper_class.AssociatedSystem],
    options: solutions.SolveOptions,
    progress: Progress | None = None,
    told: Callable[[Study], None] = lambda _: None,
) -> Study:
    """Decide each system and, if it is variational, compute H and the constraints in phase space.

    The conditions are written out for the main system only. `told` receives the study before its
    reasons are explained.
    """
    quiet = replace(options, conditions=False, reasons=False)
    end = now() + options.time_limit
    answers = []
    for place, system in enumerate(systems):
        waiting = sum(other.system is not None for other in systems[place:])
        share = (end - now()) / max(waiting, 1)
        answers.append(
            _answer_system(report, system, replace(quiet, time_limit=max(share, 0.1)), progress)
        )
    main = _main(answers)
    told(Study(report, tuple(map(_for_general, answers)), main))
    for place, one in enumerate(answers):
        if one.solution is not None:
            named = _name_progress(progress, one.associated.kind)
            answers[place] = replace(one, solution=solving.with_reasons(one.solution, quiet, named))
    solution = answers[main].solution
    if solution is not None and options.conditions:
        answers[main] = replace(answers[main], solution=explaining.with_conditions(solution))
    return Study(report, tuple(answers), main)


def _for_general(one: AssociatedAnswer) -> AssociatedAnswer:
    """The answer before the search for parameter values that its proofs exclude."""
    if one.solution is None:
        return one
    left_out = checker.not_found(one.solution.system.parameters)
    general = one.solution.changed(
        lambda answer: replace(answer, exceptions=left_out if answer.certificate else ())
    )
    return replace(one, solution=general)


def study_branches(
    report: MotionReport,
    systems: Sequence[paper_class.AssociatedSystem],
    options: solutions.SolveOptions,
    progress: Progress | None = None,
    told: Callable[[Study], None] = lambda _: None,
) -> Iterator[Study]:
    """A study on each branch of the system that is the main one on the first branch; each gets a
    share of the time.

    On other branches, only systems that have the branch too are decided. `told` receives a study
    without other branches.
    """
    branches = [on_branches(one) for one in systems]
    share = replace(options, time_limit=options.time_limit / max(map(len, branches)))
    alone = max(map(len, branches)) == 1
    found = study(
        report, [each[0] for each in branches], share, progress, told if alone else lambda _: None
    )
    yield found
    for main in branches[found.main][1:]:
        assert main.system is not None
        here = main.system.positive
        fitting = [
            one
            for each in branches
            for one in each[1:]
            if one.system and one.system.positive == here
        ]
        yield replace(study(report, fitting, share, progress), main=fitting.index(main))


def on_branches(one: paper_class.AssociatedSystem) -> tuple[paper_class.AssociatedSystem, ...]:
    """The system on each of its branches, starting with the first answer's; the system itself if
    there are too many.
    """
    branches = () if one.system is None else second_order_system.branches_of(one.system)
    return tuple(
        replace(one, system=each)
        for each in branches
        if len(branches) <= second_order_system.MOST_BRANCHES
    ) or (one,)


def answer_about(
    found: Study,
    options: solutions.SolveOptions,
    deadline: float,
    progress: Progress | None,
    reduced: solutions.Statement | None = None,
    tell: Callable[[tuple[solutions.Statement, ...]], None] = lambda _: None,
    integrals: Callable[[], Sequence[ex.Expression]] = lambda: (),
) -> tuple[solutions.Statement, ...]:
    """Whether any associated system has a Lagrangian; Lagrangians found for the known systems are
    used.

    `reduced` is the answer for the reduced system; `integrals` finds the first integrals.
    """
    motion, main = found.report.motion, found.answers[found.main].solution
    return answering.answer_motion(
        motion,
        tuple(_known_lagrangians(found)),
        options.time_dependent,
        options.seed,
        deadline,
        progress or (lambda _: None),
        () if main is None else main.system.positive,
        reduced,
        tell,
        integrals,
    )


def _known_lagrangians(found: Study) -> Iterator[answering.KnownLagrangian]:
    for one in found.answers:
        system, solution = one.associated.system, one.solution
        if system is None or solution is None:
            continue
        for answer in solution.statements:
            if answer.lagrangian is None or answer.checked != "valid":
                continue
            tree = answer.lagrangian.expression
            report = next(
                (each.found for each in one.reports if each.found.lagrangian == tree), None
            )
            yield answering.KnownLagrangian(
                one.associated.kind, system, answer.lagrangian, answer.question, report
            )


def _main(answers: Sequence[AssociatedAnswer]) -> int:
    """The first variational one with a Lagrangian, else the first variational one, else the first
    that is defined.
    """

    def rank(place: int) -> int:
        answer = answers[place].answer
        if answer is None:
            return 3
        if answer.verdict != "variational":
            return 2
        return 0 if answer.lagrangian is not None else 1

    return min(range(len(answers)), key=rank)


def _answer_system(
    report: MotionReport,
    one: paper_class.AssociatedSystem,
    options: solutions.SolveOptions,
    progress: Progress | None,
) -> AssociatedAnswer:
    if one.system is None:
        return AssociatedAnswer(one, None)
    if one.system.branch is None:  # too many of them
        return AssociatedAnswer(one, solving.solve(one.system, options))
    end = now() + options.time_limit
    free = options.time_dependent is not True and not options.ansatz
    known = _confirm_known(report, one, end) if free else ()
    if known:
        solution = solution_with(one.system, known, options)
        return AssociatedAnswer(
            one, solution, tuple(_report_known(report, one, each, options.seed) for each in known)
        )
    asked = replace(options, time_limit=_SHARE_OF_SOLVING * options.time_limit)
    found = AssociatedAnswer(
        one, solving.solve(one.system, asked, _name_progress(progress, one.kind))
    )
    answer = found.answer
    if answer is None or answer.lagrangian is None or now() > end:
        return found
    made = hamiltonise(
        _motion_on_branch(report, one), one.system, answer.lagrangian.expression, options.seed
    )
    return replace(
        found, reports=(Report(one.kind, "Lagrangian found", answer.checked or "incomplete", made),)
    )


def _confirm_known(
    report: MotionReport, one: paper_class.AssociatedSystem, end: float
) -> tuple[paper_class.Proposal, ...]:
    """The Lagrangians of the paper's class that the checker confirms for this system."""
    if report.member is None or one.system is None:
        return ()
    here = partial(second_order_system.on_branch, system=one.system)
    proposals = [
        replace(
            each,
            transform=_map_transform(each.transform, here),
            images=tuple(map(here, each.images)),
        )
        for each in paper_class.propose_lagrangians(report.member, one.kind)
    ]
    if not proposals:
        return ()
    return tuple(
        compress(
            proposals,
            checker_accepts_each(
                one.system, [each.transform.lagrangian for each in proposals], end
            ),
        )
    )


def _map_transform(
    found: LegendreTransform, here: Callable[[ex.Expression], ex.Expression]
) -> LegendreTransform:
    return replace(
        found,
        lagrangian=here(found.lagrangian),
        hamiltonian=here(found.hamiltonian),
        momenta=tuple(map(here, found.momenta)),
        velocities=None if found.velocities is None else tuple(map(here, found.velocities)),
    )


def _report_known(
    report: MotionReport, one: paper_class.AssociatedSystem, known: paper_class.Proposal, seed: int
) -> Report:
    assert one.system is not None
    tree = known.transform.lagrangian
    made = hamiltonise(
        _motion_on_branch(report, one), one.system, tree, seed, known.transform, known.images
    )
    return Report(one.kind, known.source, "valid", made)


def _motion_on_branch(
    report: MotionReport, one: paper_class.AssociatedSystem
) -> constrained_motion.EquationsOfMotion:
    """The motion with its roots as they are on the branch of the associated system."""
    assert one.system is not None
    motion, here = report.motion, partial(second_order_system.on_branch, system=one.system)
    return replace(
        motion,
        dependent_velocities=tuple(map(here, motion.dependent_velocities)),
        free_accelerations=tuple(map(here, motion.free_accelerations)),
        accelerations=tuple(map(here, motion.accelerations)),
        multipliers=tuple(map(here, motion.multipliers)),
    )


def _name_progress(progress: Progress | None, kind: str) -> Progress | None:
    return None if progress is None else lambda stage: progress(stage.of(kind))
