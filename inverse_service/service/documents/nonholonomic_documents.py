"""Use cases for Nonholonomic documents, as they run inside a worker process."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from api_schemas import nonholonomic
from api_schemas.result import AdvicePart
from inverse_service import errors
from inverse_service.constrained import answering, nonholonomic_study
from inverse_service.constrained.reduced import Decided
from inverse_service.deadline import now
from inverse_service.decision.solutions import Answer, Solution, SolveOptions
from inverse_service.expressions import collecting
from inverse_service.mechanics import constrained_motion, method_advice
from inverse_service.mechanics.first_integrals import FirstIntegral
from inverse_service.mechanics.paper_class import AssociatedSystem
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.service.documents import (
    accepting,
    derived,
    documents,
    reduced_documents,
    translate,
    translate_nonholonomic,
)
from inverse_service.service.documents.growing import Growing
from inverse_service.solving import confirming

# Of the time for all, what finding the motion and what it keeps may take.
SHARE_OF_MOTION = 0.3
# Of what is left then, what the associated systems may take; of what is left then, the question about any one.
SHARE_OF_SYSTEMS = 0.45
SHARE_OF_ANY = 0.7
# What is said of the motion before it was asked.
OPEN = answering.MotionAnswer("undetermined", "undetermined", confirming.NOT_YET)
# What first integrals may take, s and of the time.
FOR_INTEGRALS, SHARE_OF_INTEGRALS = 5.0, 0.1
# What looking at a document again may take for an associated system that is only shown, s.
SHOWN_AT_ONCE = 0.3
# And what is left for checking all answers at the end.
SHARE_LEFT = 0.1


def solve_nonholonomic(document: Any, options: SolveOptions, grow: Growing | None = None) -> dict[str, Any]:
    """The result document of a Nonholonomic document; the main fields answer one associated system.

    Raises InputError for a document that cannot be accepted, CertificateRefused where the checker
    finds our own certificate invalid.
    """
    grow, end = grow or Growing(None), now() + options.time_limit
    schema = translate_nonholonomic.to_nonholonomic_schema(document)
    system = translate_nonholonomic.to_nonholonomic(schema)
    families = translate_nonholonomic.to_families(schema, system)
    grow.begin("motion")
    report = nonholonomic_study.motion_report(
        system, min(constrained_motion.TIME_LIMIT, SHARE_OF_MOTION * options.time_limit)
    )
    kind = schema.associated
    if kind == "any":
        return _about_the_motion(report, schema, options, end, grow)
    systems = nonholonomic_study.associated_systems(report, None if kind == "search" else kind, families)
    defined = next((one for one in systems if one.system is not None), None)
    if defined is None or defined.system is None:
        raise errors.InputError(
            f'{systems[0].explanation} Ask for "any", which decides the motion alone.', "/associated"
        )
    questions = ("existence", *["existence_with_time"] * (schema.time_dependent_lagrangian is not False))
    grow.wanted = (
        "motion",
        "first_integrals",
        *questions,
        "any_associated",
        "reduced",
        "lagrangian",
        "hamiltonian",
        "explanation",
    )
    last = end - SHARE_LEFT * options.time_limit
    made = _Made(schema, report, grow, last)
    first = [nonholonomic_study.Study(report, (_unasked(defined, confirming.NOT_YET),), 0)]
    made.tell(("motion",), first)
    made.find_first_integrals(options)
    made.tell(("first_integrals",), first)
    asked = dataclasses.replace(
        options,
        time_dependent=schema.time_dependent_lagrangian,
        time_limit=_share(schema) * (end - now()),
        ansatz=accepting.to_ansatz(schema, defined.system),
        series_order=schema.series_order,
    )
    grow.begin("existence")
    studies = list(nonholonomic_study.study_branches(report, systems, asked, grow.stage))
    main = studies[0].answers[studies[0].main]
    if main.solution is not None:
        grow.cut |= main.solution.cut
    made.tell((*questions, "lagrangian", "hamiltonian", "explanation"), studies)
    own = made.begin_reduced(options.seed)
    for place, study in enumerate(studies):
        grow.begin("any_associated")
        share = now() + (last - now()) * SHARE_OF_ANY / (len(studies) - place)
        made.ask(study, asked, share, own, lambda: made.tell((), studies) if len(studies) == 1 else None)
    made.tell(("any_associated",), studies)
    made.end_reduced(options.seed)
    whole = made.whole(studies)
    if schema.special_cases:
        assert main.associated.system is not None
        grow.begin("special_cases")
        cases = documents.special_cases(main.associated.system, asked, end, grow)
        whole = whole.model_copy(update={"special_cases": cases})
    if whole.verdict == "not_variational" and not whole.branches and made.answers[0].verdict != "variational":
        whole = whole.model_copy(update={"instead": derived.of_reduced(whole.reduced)})
    grow.begin("certificate")
    return documents.with_one_verdict(documents.ordered(grow.end(documents.checked(whole, end - now()))))


@dataclasses.dataclass(slots=True)
class _Made:
    """What is known of a motion: `answers` about any associated system by branch, the `reduced` system."""

    schema: nonholonomic.NonholonomicDocument
    report: nonholonomic_study.MotionReport
    grow: Growing
    last: float
    answers: list[answering.MotionAnswer] = dataclasses.field(default_factory=list)
    plain: Decided | None = None
    reduced: nonholonomic.ReducedPart | None = None
    kept: tuple[FirstIntegral, ...] = ()

    def find_first_integrals(self, options: SolveOptions) -> None:
        """What is constant along the motion."""
        if self.schema.first_integrals:
            self.grow.begin("first_integrals")
            limit = min(FOR_INTEGRALS, SHARE_OF_INTEGRALS * options.time_limit)
            self.kept = nonholonomic_study.first_integrals(self.report, options.seed, limit)

    def tell(self, parts: Sequence[str], studies: Sequence[nonholonomic_study.Study]) -> None:
        """Hand over these parts, and with them all that is known."""
        self.grow.hand_over(parts, lambda: documents.checked(self.whole(studies), max(1.0, self.last - now())))

    def begin_reduced(self, seed: int) -> Answer | None:
        """The answer for the reduced system as it is, which answers for the motion too where it is a yes."""
        self.grow.begin("reduced")
        motion, limit = self.report.motion, reduced_documents.SHARE_OF_REDUCED * (self.last - now())
        self.plain = reduced_documents.decided_reduced(motion, motion.system.lagrangian, seed, limit)
        return None if self.plain is None else self.plain.answer

    def end_reduced(self, seed: int) -> None:
        """With other clocks, in the time that is left."""
        self.grow.begin("reduced")
        self.reduced = reduced_documents.reduced_part(self.report, self.plain, seed, self.last - now())

    def ask(
        self,
        study: nonholonomic_study.Study,
        asked: SolveOptions,
        deadline: float,
        own: Answer | None,
        tell: Callable[[], None],
    ) -> None:
        """Whether any associated system has a Lagrangian; `tell` is called with a verdict before its Lagrangian.

        `own` is the answer for the reduced system.
        """
        place = len(self.answers)

        def told(answer: answering.MotionAnswer) -> None:
            self.answers[place:] = [answer]
            tell()

        found = nonholonomic_study.answer_about(study, asked, deadline, self.grow.stage, own, told)
        self.answers[place:] = [found]
        if answering.OUT_OF_TIME in found.reason or (found.verdict == "undetermined" and now() >= deadline):
            self.grow.cut["any_associated"] = found.reason

    def whole(self, studies: Sequence[nonholonomic_study.Study]) -> nonholonomic.NonholonomicResult:
        """The result of an associated system with what is known of the motion, which is what one simulates."""
        solutions = [_with_images(each.answers[each.main]) for each in studies]
        result = translate.to_result(solutions[0], self.schema, solutions[1:])
        system = self.report.motion.system
        taken = method_advice.for_constraints(system.lagrangian, system.constraints, system.coordinates)
        motions = [translate_nonholonomic.to_any_associated(answer) for answer in self.answers or (OPEN,)]
        parts = zip(result.branches, motions * (1 if self.answers else len(studies)), strict=False)
        branches = [nonholonomic.NonholonomicBranch(**dict(branch), any_associated=motion) for branch, motion in parts]
        part = translate_nonholonomic.to_nonholonomic_part(studies[0], self.kept)
        told = {"advice": AdvicePart(**taken), "branches": branches, "first_integrals": part.first_integrals}
        return nonholonomic.NonholonomicResult(
            **dict(result) | told,
            nonholonomic=part,
            any_associated=motions[0],
            reduced=self.reduced,
        )


def _about_the_motion(
    report: nonholonomic_study.MotionReport,
    schema: nonholonomic.NonholonomicDocument,
    options: SolveOptions,
    end: float,
    grow: Growing,
) -> dict[str, Any]:
    """The result where only the motion was asked about: the main fields leave open what was not asked.

    Each branch of the first associated system has its share of the time.
    """
    one = nonholonomic_study.associated_systems(report, "first")[0]
    if one.system is None:
        raise errors.InputError(one.explanation, "/associated")
    last = end - SHARE_LEFT * options.time_limit
    grow.wanted, made = ("motion", "first_integrals", "any_associated", "reduced"), _Made(schema, report, grow, last)
    answered = map(_unasked, nonholonomic_study.on_branches(one))
    studies = [nonholonomic_study.Study(report, (each,), 0) for each in answered]
    grow.hand_over(("motion",), lambda: reduced_documents.compared(made.whole(studies), 1.0))
    made.find_first_integrals(options)
    grow.hand_over(("first_integrals",), lambda: reduced_documents.compared(made.whole(studies), 1.0))
    asked = dataclasses.replace(options, time_dependent=schema.time_dependent_lagrangian)
    own = made.begin_reduced(options.seed)
    told = partial(grow.hand_over, (), lambda: reduced_documents.compared(made.whole(studies), 1.0))
    for left, study in zip(range(len(studies), 0, -1), studies, strict=True):
        grow.begin("any_associated")
        # Other clocks of the reduced system, which come after, have a floor too.
        share = now() + (1 - reduced_documents.SHARE_OF_REDUCED) * (last - now()) / left
        made.ask(study, asked, share, own, told if len(studies) == 1 else lambda: None)
    grow.hand_over(("any_associated",), lambda: reduced_documents.compared(made.whole(studies), max(1.0, end - now())))
    made.end_reduced(options.seed)
    grow.begin("certificate")
    return grow.end(reduced_documents.compared(made.whole(studies), end - now()))


def _unasked(
    one: AssociatedSystem, reason: str = reduced_documents.ONLY_THE_MOTION
) -> nonholonomic_study.AssociatedAnswer:
    """The answer that leaves open whether a system has a Lagrangian."""
    assert one.system is not None
    answer = Answer("undetermined", reason=reason, positive=tuple(map(collecting.collect, one.system.positive)))
    return nonholonomic_study.AssociatedAnswer(one, Solution(one.system, answer, None, None))


def _share(schema: nonholonomic.NonholonomicDocument) -> float:
    return SHARE_OF_SYSTEMS / 2 if schema.special_cases else SHARE_OF_SYSTEMS


def _with_images(main: nonholonomic_study.AssociatedAnswer) -> Solution:
    """The solution, its Hamiltonian with the constraints in phase space."""
    solution = main.solution
    assert solution is not None
    autonomous, with_time = _imaged(main, solution.autonomous), _imaged(main, solution.with_time)
    return dataclasses.replace(solution, autonomous=autonomous, with_time=with_time)


def _imaged(main: nonholonomic_study.AssociatedAnswer, answer: Answer | None) -> Answer | None:
    if answer is None or answer.lagrangian is None or answer.hamiltonian is None:
        return answer
    expression = answer.lagrangian.expression
    images = next((each.found.images for each in main.reports if each.found.lagrangian == expression), None)
    if images is None or answer.hamiltonian.implicit:  # without momenta there is no image in phase space
        return answer
    return dataclasses.replace(answer, hamiltonian=dataclasses.replace(answer.hamiltonian, constraints=images))


def parse(schema: nonholonomic.NonholonomicDocument) -> nonholonomic.NonholonomicParseAnswer:
    """What was understood of a Nonholonomic document; raises InputError."""
    system = translate_nonholonomic.to_nonholonomic(schema)
    translate_nonholonomic.to_families(schema, system)
    return translate_nonholonomic.to_nonholonomic_parse_answer(
        system, constrained_motion.equations_of_motion(system), schema
    )


def parse_associated(schema: nonholonomic.NonholonomicDocument) -> dict[str, Any] | None:
    """The equations of the one associated system that is asked for, or why it is not defined; None for another
    question."""
    if schema.associated not in ("first", "second", "third"):
        return None
    system = translate_nonholonomic.to_nonholonomic(schema)
    report = nonholonomic_study.motion_report(system, SHOWN_AT_ONCE)
    one = nonholonomic_study.associated_systems(
        report, schema.associated, translate_nonholonomic.to_families(schema, system)
    )[0]
    found = one.system
    pairs = zip(found.coordinates, found.accelerations, strict=True) if found else ()
    equations = {name: translate.parsed(f).model_dump() for name, f in pairs}
    return {"kind": one.kind, "explanation": "" if found else one.explanation, "equations": equations}


def system_of(schema: nonholonomic.NonholonomicDocument) -> SecondOrderSystem:
    """The first associated system; raises InputError."""
    first, *_ = nonholonomic_study.associated_systems(
        nonholonomic_study.motion_report(translate_nonholonomic.to_nonholonomic(schema)), "first"
    )
    assert first.system is not None
    return first.system
