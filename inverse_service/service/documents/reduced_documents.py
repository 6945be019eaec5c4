"""The key `reduced` of a nonholonomic result, and the use cases of a motion on constraints that is given as it is."""

from __future__ import annotations

from typing import Any

from api_schemas import nonholonomic
from api_schemas.base import ParseAnswer
from inverse_service import deadline, errors
from inverse_service.certificate.checker import CheckResult
from inverse_service.constrained import answering, nonholonomic_study
from inverse_service.constrained import reduced as deciding
from inverse_service.constrained.lagrangian import first_system
from inverse_service.decision import solutions
from inverse_service.expressions import printing
from inverse_service.expressions.tree import Expression
from inverse_service.mechanics import constrained_motion
from inverse_service.mechanics.first_integrals import first_integrals
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.service.documents import (
    accepting,
    checking,
    derived,
    documents,
    preparing,
    translate,
    translate_nonholonomic,
)
from inverse_service.service.documents.growing import Growing

# Of the time, what the equations of the free coordinates alone may take.
SHARE_OF_REDUCED = 0.25
MOST_FOR_INTEGRALS = 2.0  # s
ONLY_THE_MOTION = "Only the motion was asked about: see any_associated."


def look_motion(document: Any) -> nonholonomic.MotionDocument:
    """The document in its schema; raises DocumentRefused with every fault found."""
    return accepting.validated(document, nonholonomic.MotionDocument)


def solve_motion(document: Any, options: solutions.SolveOptions, grow: Growing) -> dict[str, Any]:
    """The result, all of it in `any_associated`; raises InputError."""
    end = deadline.now() + documents.SHARE_OF_SOLVER * options.time_limit
    schema = look_motion(document)
    if schema.special_cases:
        raise errors.InputError(
            "special cases are not looked for where the motion itself is given: leave it out.", "/special_cases"
        )
    motion = read(schema)
    question = schema.time_dependent_lagrangian
    grow.wanted = ("any_associated", "reduced")
    grow.begin("reduced")
    plain = decided_reduced(motion, None, options.seed, SHARE_OF_REDUCED * (end - deadline.now()))
    own = None if plain is None else plain.answer
    grow.begin("any_associated")
    answer = answering.answer_motion(motion, (), question, options.seed, end, grow.stage, reduced=own)
    open_answer = solutions.Answer("undetermined", reason=ONLY_THE_MOTION)
    result = translate.to_result(solutions.Solution(first_system(motion), open_answer, None, None), schema)
    kept = first_integrals(motion, None, options.seed, MOST_FOR_INTEGRALS) if schema.first_integrals else ()
    told = dict(result) | {"first_integrals": [translate.integral_part(one) for one in kept]}
    about = translate_nonholonomic.to_any_associated(answer)
    whole = nonholonomic.NonholonomicResult(**told, nonholonomic=None, any_associated=about)
    grow.hand_over(("any_associated",), lambda: compared(whole, end - deadline.now()))
    grow.begin("reduced")
    reduced = reduced_part_of_motion(motion, plain, options.seed, end - deadline.now())
    grow.begin("certificate")
    return grow.end(compared(whole.model_copy(update={"reduced": reduced}), end - deadline.now()))


def compared(whole: nonholonomic.NonholonomicResult, time_limit: float) -> dict[str, Any]:
    """A result whose main fields leave open what was not asked; its motion is that of the document."""
    found = whole.model_dump(mode="json")
    checking.compare_motion(found, time_limit)
    return documents.ordered(found)


def system_of(schema: nonholonomic.MotionDocument) -> SecondOrderSystem:
    """The accelerations on the constraints, by the free velocities, as a system; raises InputError."""
    return first_system(read(schema))


def parse(schema: nonholonomic.MotionDocument) -> ParseAnswer:
    """What was understood; raises InputError."""
    return translate.to_parse_answer(system_of(schema), schema)


def read(schema: nonholonomic.MotionDocument) -> constrained_motion.ConstrainedMotion:
    """The motion that a document describes; raises InputError."""
    return constrained_motion.read_motion(
        schema.coordinates, schema.motion, schema.constraints, schema.parameters, schema.functions, schema.where
    )


QUADRATURE = "Along a solution of these equations the other coordinates are integrals over t of the right sides."
CLOSED = "The equations of these coordinates hold no others; the others follow from the equations of motion."
_WRONG = CheckResult("invalid", ("reduced is not the reduced system of the document, or has another clock.",))


def decided_reduced(
    motion: constrained_motion.ConstrainedMotion, lagrangian: Expression | None, seed: int, time_limit: float
) -> deciding.Decided | None:
    """The reduced system with its answer, None where the motion does not reduce."""
    options = solutions.SolveOptions(seed=seed, time_limit=max(0.1, time_limit), conditions=False)
    return deciding.decide_reduced(motion, lagrangian, options)


def reduced_part(
    report: nonholonomic_study.MotionReport, plain: deciding.Decided | None, seed: int, time_limit: float
) -> nonholonomic.ReducedPart | None:
    """With another clock besides; where the free coordinates hold others, the answer of a closed subsystem."""
    options = solutions.SolveOptions(seed=seed, time_limit=max(0.1, time_limit), conditions=False)
    motion = report.motion
    if plain is not None:
        return _part(deciding.answer_reduced(motion, motion.system.lagrangian, report.density, options, plain))
    closed = deciding.closed_subsystem(report.exact, motion)
    return None if closed is None else _part(deciding.answer_closed(closed, options))


def reduced_part_of_motion(
    motion: constrained_motion.ConstrainedMotion, plain: deciding.Decided | None, seed: int, time_limit: float
) -> nonholonomic.ReducedPart | None:
    """The same of a motion that is given as it is: there is no measure that would give a clock."""
    options = solutions.SolveOptions(seed=seed, time_limit=max(0.1, time_limit), conditions=False)
    return None if plain is None else _part(deciding.answer_reduced(motion, None, None, options, plain))


def _part(found: deciding.Reduced) -> nonholonomic.ReducedPart:
    factor, clocked = found.factor, found.clocked
    return nonholonomic.ReducedPart(
        coordinates=list(found.plain.system.coordinates),
        **derived.answered(found.plain.system, found.plain.answer),
        reconstruction={name: printing.to_text(rate) for name, rate in found.others},
        statement=QUADRATURE if found.others else CLOSED,
        with_clock=None
        if clocked is None or factor is None
        else derived.clocked_part(factor, clocked.system, clocked.answer),
        without_clock=found.reason,
    )


def compared_reduced(document: Any, part: dict[str, Any], time_limit: float) -> CheckResult | None:
    """The checker's verdicts on `reduced` and its `with_clock`, whose systems have to be those of the document."""
    end = deadline.now() + time_limit
    try:
        system = _of_document(preparing.prepared(document).document)
    except errors.InputError:
        return _WRONG
    if system is None:
        return _WRONG
    found = derived.compared_answer(part, system, end - deadline.now())
    clock = part.get("with_clock")
    if (found is not None and found.verdict != "valid") or not isinstance(clock, dict):
        return found
    try:
        factor = derived.read_clock(system, str(clock.get("factor")))
    except errors.InputError:
        return _WRONG
    return derived.compared_clocked(clock, system, factor, end - deadline.now()) or found


def _of_document(document: Any) -> SecondOrderSystem | None:
    if preparing.is_motion(document):
        return deciding.reduced_system(read(look_motion(document)))
    report = nonholonomic_study.motion_report(
        translate_nonholonomic.to_nonholonomic(translate_nonholonomic.to_nonholonomic_schema(document))
    )
    return deciding.reduced_system(report.motion) or deciding.closed_subsystem(report.exact, report.motion)
