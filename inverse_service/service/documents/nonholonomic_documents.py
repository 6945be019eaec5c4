"""Use cases for Nonholonomic documents, as they run inside a worker process."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

from api_schemas.nonholonomic import (
    NonholonomicBranch,
    NonholonomicDocument,
    NonholonomicParseAnswer,
    NonholonomicResult,
)
from api_schemas.result import AdvicePart, ResultDocument
from inverse_service.deadline import now
from inverse_service.errors import InputError
from inverse_service.expressions.collecting import collect
from inverse_service.inverse_problem.constrained.answering import MotionAnswer
from inverse_service.inverse_problem.hamiltonisation import nonholonomic_study
from inverse_service.inverse_problem.hamiltonisation.reduced import Decided
from inverse_service.inverse_problem.solutions import Answer, Solution, SolveOptions
from inverse_service.mechanics.method_advice import for_constraints
from inverse_service.mechanics.nonholonomic.associated_systems import AssociatedSystem
from inverse_service.mechanics.nonholonomic.geometry import TIME_LIMIT
from inverse_service.mechanics.nonholonomic.motion import equations_of_motion
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.service.documents import accepting, documents, translate, translate_nonholonomic
from inverse_service.service.documents.checking import compare_motion
from inverse_service.service.documents.instead import of_reduced
from inverse_service.service.documents.reduced_documents import (
    ONLY_THE_MOTION,
    SHARE_OF_REDUCED,
    decided_reduced,
    reduced_part,
)

# Of the time for all, what finding the motion and what it keeps may take.
SHARE_OF_MOTION = 0.3
# And what the question about any associated system may take, after the others.
SHARE_OF_ANY = 1 / 3
# What looking at a document again may take for an associated system that is only shown, s.
SHOWN_AT_ONCE = 0.3
# And what is left for checking all answers at the end.
SHARE_LEFT = 0.1


def solve_nonholonomic(
    document: Any, options: SolveOptions, progress: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """The result document of a Nonholonomic document; the main fields answer one associated system.

    Raises InputError for a document that cannot be accepted, CertificateRefused where the checker
    finds our own certificate invalid.
    """
    end = now() + options.time_limit
    schema = translate_nonholonomic.to_nonholonomic_schema(document)
    system = translate_nonholonomic.to_nonholonomic(schema)
    families = translate_nonholonomic.to_families(schema, system)
    report = nonholonomic_study.motion_report(system, min(TIME_LIMIT, SHARE_OF_MOTION * options.time_limit))
    kind = schema.associated
    if kind == "any":
        return _about_the_motion(report, schema, options, end, progress)
    systems = nonholonomic_study.associated_systems(report, None if kind == "search" else kind, families)
    defined = next((one.system for one in systems if one.system is not None), None)
    if defined is None:
        raise InputError(f'{systems[0].explanation} Ask for "any", which decides the motion alone.', "/associated")
    asked = dataclasses.replace(
        options,
        time_dependent=schema.time_dependent_lagrangian,
        time_limit=_share(schema) * (end - now()),
        ansatz=() if defined is None else accepting.to_ansatz(schema, defined),
        series_order=schema.series_order,
    )
    found, *others = studies = list(nonholonomic_study.study_branches(report, systems, asked, progress))
    main = found.answers[found.main]
    last, answers = end - SHARE_LEFT * options.time_limit, []
    plain, own = _reduced(report, options.seed, SHARE_OF_REDUCED * (last - now()))
    for study in studies:
        third = now() + SHARE_OF_ANY * options.time_limit / len(studies)
        answers.append(nonholonomic_study.answer_about(study, asked, min(last, third), progress, own))
    result = translate.to_result(_with_images(main), schema, [_with_images(each.answers[each.main]) for each in others])
    if schema.special_cases:
        assert main.associated.system is not None
        result = documents.with_special_cases(result, main.associated.system, asked, (end, progress))
    whole = _whole(result, found, answers, plain, options, end)
    if whole.verdict == "not_variational" and not whole.branches and answers[0].verdict != "variational":
        whole = whole.model_copy(update={"instead": of_reduced(whole.reduced)})
    return documents.ordered(documents.checked(whole, end - now()))


def _whole(
    result: ResultDocument,
    found: nonholonomic_study.Study,
    answers: Sequence[MotionAnswer],
    plain: Decided | None,
    options: SolveOptions,
    end: float,
) -> NonholonomicResult:
    """The result of an associated system with what is known of the motion, which is what one simulates.

    Other clocks of the reduced system have the time that is left, some of which is for checking.
    """
    system, left = found.report.motion.system, end - now() - SHARE_LEFT * options.time_limit
    taken = for_constraints(system.lagrangian, system.constraints, system.coordinates)
    motions = [translate_nonholonomic.to_any_associated(answer) for answer in answers]
    parts = zip(result.branches, motions, strict=False)
    branches = [NonholonomicBranch(**dict(branch), any_associated=motion) for branch, motion in parts]
    return NonholonomicResult(
        **dict(result) | {"advice": AdvicePart(**taken), "branches": branches},
        nonholonomic=translate_nonholonomic.to_nonholonomic_part(found),
        any_associated=motions[0],
        reduced=reduced_part(found.report.motion, system.lagrangian, found.report.density, plain, options.seed, left),
    )


def _about_the_motion(
    report: nonholonomic_study.MotionReport,
    schema: NonholonomicDocument,
    options: SolveOptions,
    end: float,
    progress: Callable[[str], None] | None,
) -> dict[str, Any]:
    """The result where only the motion was asked about: the main fields leave open what was not asked.

    Each branch of the first associated system has its share of the time.
    """
    one = nonholonomic_study.associated_systems(report, "first")[0]
    if one.system is None:
        raise InputError(one.explanation, "/associated")
    branches = nonholonomic_study.on_branches(one)
    solutions = [_unasked(each) for each in branches]
    answered = map(nonholonomic_study.AssociatedAnswer, branches, solutions)
    studies = [nonholonomic_study.Study(report, (each,), 0) for each in answered]
    asked = dataclasses.replace(options, time_dependent=schema.time_dependent_lagrangian)
    answers = []
    plain, own = _reduced(report, options.seed, SHARE_OF_REDUCED * (end - now()))
    for left, study in zip(range(len(studies), 0, -1), studies, strict=True):
        share = now() + (end - now()) / left
        answers.append(nonholonomic_study.answer_about(study, asked, share, progress, own))
    result = translate.to_result(solutions[0], schema, solutions[1:])
    document = _whole(result, studies[0], answers, plain, options, end).model_dump(mode="json")
    compare_motion(document, end - now())
    return documents.ordered(document)


def _reduced(
    report: nonholonomic_study.MotionReport, seed: int, time_limit: float
) -> tuple[Decided | None, Answer | None]:
    """The reduced system with its answer, which answers for the motion too where it is a yes."""
    plain = decided_reduced(report.motion, report.motion.system.lagrangian, seed, time_limit)
    return plain, None if plain is None else plain.answer


def _unasked(one: AssociatedSystem) -> Solution:
    """The solution that leaves open whether a system has a Lagrangian."""
    assert one.system is not None
    positive = tuple(map(collect, one.system.positive))
    return Solution(one.system, Answer("undetermined", reason=ONLY_THE_MOTION, positive=positive), None, None)


def _share(schema: NonholonomicDocument) -> float:
    return documents.SHARE_BESIDE_CASES if schema.special_cases else documents.SHARE_OF_SOLVER


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
    if images is None:
        return answer
    return dataclasses.replace(answer, hamiltonian=dataclasses.replace(answer.hamiltonian, constraints=images))


def parse(schema: NonholonomicDocument) -> NonholonomicParseAnswer:
    """What was understood of a Nonholonomic document; raises InputError."""
    system = translate_nonholonomic.to_nonholonomic(schema)
    translate_nonholonomic.to_families(schema, system)
    return translate_nonholonomic.to_nonholonomic_parse_answer(system, equations_of_motion(system), schema)


def parse_associated(schema: NonholonomicDocument) -> dict[str, Any] | None:
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


def system_of(schema: NonholonomicDocument) -> SecondOrderSystem:
    """The first associated system; raises InputError."""
    first, *_ = nonholonomic_study.associated_systems(
        nonholonomic_study.motion_report(translate_nonholonomic.to_nonholonomic(schema)), "first"
    )
    assert first.system is not None
    return first.system
