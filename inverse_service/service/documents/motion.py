"""Use cases for a motion on constraints that is given as it is: which Lagrangians, if any, have it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from api_schemas.nonholonomic import MotionDocument, NonholonomicResult
from api_schemas.problem import ParseAnswer
from inverse_service.deadline import now
from inverse_service.errors import InputError
from inverse_service.inverse_problem.constrained.ansatz import first_system
from inverse_service.inverse_problem.constrained.answering import answer_motion
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.inverse_problem.outcome import Answer, Solution
from inverse_service.mechanics.nonholonomic.motion import ConstrainedMotion
from inverse_service.mechanics.nonholonomic.reading import read_motion
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.service.documents import solving, translate
from inverse_service.service.documents.checking import compare_motion
from inverse_service.service.documents.refusals import validated
from inverse_service.service.documents.translate_nonholonomic import to_any_associated

ONLY_THE_MOTION = "Only the motion was asked about: see any_associated."


def look_motion(document: Any) -> MotionDocument:
    """The document in its schema; raises DocumentRefused with every fault found."""
    return validated(document, MotionDocument)


def solve_motion(document: Any, options: SolveOptions, progress: Callable[[str], None] | None = None) -> dict[str, Any]:
    """The result, all of it in `any_associated`; raises InputError."""
    end = now() + solving.SHARE_OF_SOLVER * options.time_limit
    schema = look_motion(document)
    if schema.special_cases:
        raise InputError(
            "special cases are not looked for where the motion itself is given: leave it out.", "/special_cases"
        )
    motion = read(schema)
    question = schema.time_dependent_lagrangian
    answer = answer_motion(motion, None, (), question, options.seed, end, progress or (lambda _: None))
    from inverse_service.service.documents.reduced import reduced_of_motion  # which reads motions too

    reduced = reduced_of_motion(motion, options.seed, end - now())
    open_answer = Answer("undetermined", reason=ONLY_THE_MOTION)
    result = translate.to_result(Solution(first_system(motion), open_answer, None, None), schema)
    whole = NonholonomicResult(
        **dict(result), nonholonomic=None, any_associated=to_any_associated(answer), reduced=reduced
    )
    found = whole.model_dump(mode="json")
    compare_motion(found, end - now())
    return solving.ordered(found)


def system_of(schema: MotionDocument) -> SecondOrderSystem:
    """The accelerations on the constraints, by the free velocities, as a system; raises InputError."""
    return first_system(read(schema))


def parse(schema: MotionDocument) -> ParseAnswer:
    """What was understood; raises InputError."""
    return translate.to_parse_answer(system_of(schema), schema)


def read(schema: MotionDocument) -> ConstrainedMotion:
    """The motion that a document describes; raises InputError."""
    return read_motion(
        schema.coordinates, schema.motion, schema.constraints, schema.parameters, schema.functions, schema.where
    )
