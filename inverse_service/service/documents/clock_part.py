"""The key `clock` of a System document: has the system a Lagrangian with dtau = N(q) dt?"""

from __future__ import annotations

from typing import Any

from api_schemas.result import ClockPart
from api_schemas.system import SystemDocument
from inverse_service import deadline, errors
from inverse_service.certificate import checker
from inverse_service.decision.solutions import Answer, SolveOptions
from inverse_service.expressions import printing
from inverse_service.expressions import tree as ex
from inverse_service.field import real_point
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.service.documents import accepting, preparing, translate
from inverse_service.solving import solving
from inverse_service.solving.of_kind import clock

SEARCH = "search"


def to_clock(schema: SystemDocument, system: SecondOrderSystem) -> ex.Expression | None:
    """N(q), None where it is looked for; InputError where it is no function of coordinates, or f holds t."""
    if system.depends_on_time:
        raise errors.InputError("the equations contain t, so no other clock can be put in its place.", "/clock")
    return None if schema.clock == SEARCH else read_clock(system, schema.clock or "", schema)


def read_clock(system: SecondOrderSystem, text: str, schema: SystemDocument | None = None) -> ex.Expression:
    """N(q) of a text, parameters with values in the document put in; InputError as above."""
    factor = accepting.formula_about(text, system.names, schema, "/clock")
    if any(node == ex.TIME or isinstance(node, ex.Velocity | ex.Acceleration) for node in ex.walk(factor)):
        raise errors.InputError("a clock N in dtau = N dt may contain coordinates and parameters only.", "/clock")
    if clock.with_clock(system, factor) is None:
        raise errors.InputError("a clock N needs real values other than 0 where the equations have values.", "/clock")
    return factor


def clock_part(
    system: SecondOrderSystem, factor: ex.Expression | None, asked: SolveOptions, time_limit: float
) -> ClockPart:
    """The answer for L(q, q') of the system with the other clock, on its first branch; found where there is none."""
    end = deadline.now() + time_limit
    if factor is None:
        factor, tried = clock.find_clock(system, asked.seed, deadline.now() + time_limit / 2)
        if factor is None:
            listed = ", ".join(map(printing.to_text, tried))
            reason = f"No Lagrangian was found with dtau = N dt for N = {listed}; others were not tried."
            return ClockPart(factor="", equations={}, verdict="undetermined", reason=reason)
    changed = clock.with_clock(system, factor)
    assert changed is not None
    options = SolveOptions(time_dependent=False, seed=asked.seed, time_limit=deadline.left(end), conditions=False)
    solution = solving.solve(changed, options)
    assert solution.autonomous is not None
    return clocked_part(factor, solution.system, solution.autonomous)


def clocked_part(factor: ex.Expression, system: SecondOrderSystem, answer: Answer) -> ClockPart:
    """An answer for the system with this clock."""
    return ClockPart(factor=printing.to_text(factor), **answered(system, answer))


def answered(system: SecondOrderSystem, answer: Answer) -> dict[str, Any]:
    """The equations and the answer as fields."""
    fields = translate.answer_fields(answer, system) | translate.equation_fields(system)
    return {key: fields[key] for key in ClockPart.model_fields if key in fields}


def compared_clock(document: Any, part: dict[str, Any], time_limit: float) -> checker.CheckResult | None:
    """The checker's verdict on `with_clock`, whose system has to be that of the document with its clock."""
    wrong = checker.CheckResult("invalid", ("with_clock is not the document's system with its clock.",))
    try:
        schema = accepting.to_schema(preparing.prepared(document).document)
        system = accepting.to_system(schema)
        if to_clock(schema, system) is None and part.get("verdict") == "undetermined":
            return None
        factor = to_clock(schema, system) or read_clock(system, str(part.get("factor")), schema)
    except errors.InputError:
        return wrong
    return compared_clocked(part, system, factor, wrong, time_limit)


def compared_clocked(
    part: dict[str, Any],
    system: SecondOrderSystem,
    factor: ex.Expression,
    wrong: checker.CheckResult,
    time_limit: float,
) -> checker.CheckResult | None:
    """The same for an answer with this clock."""
    changed = clock.with_clock(system, factor)
    if changed is None or part.get("factor") != printing.to_text(factor):
        return wrong
    return compared_answer(part, changed, wrong, time_limit)


def compared_answer(
    part: dict[str, Any], system: SecondOrderSystem, wrong: checker.CheckResult, time_limit: float
) -> checker.CheckResult | None:
    """The checker's verdict on an answer for this system, `wrong` where it is for another; None where it is open."""
    equations, certificate = translate.equation_fields(system)["equations"], part.get("certificate")
    if part.get("equations") != equations:
        return wrong
    if not isinstance(certificate, dict):
        return None if part.get("verdict") == "undetermined" else wrong
    shown, named = part.get("lagrangian"), certificate.get("system")
    named = named if isinstance(named, dict) else {}
    good = named.get("equations") == equations and certificate.get("among") is None
    good = good and named.get("parameters") == list(system.parameters)
    question = "time_dependent" if system.depends_on_time else "autonomous"
    good = good and (certificate.get("claim"), certificate.get("question")) == (part.get("verdict"), question)
    text = shown.get("text") if isinstance(shown, dict) else None
    good = good and (not system.positive or _is_inside(system, certificate.get("near") or {}))
    if not good or text != certificate.get("lagrangian"):
        return wrong
    return checker.check_certificate(certificate, time_limit=max(1.0, time_limit))


def _is_inside(system: SecondOrderSystem, near: dict[str, str]) -> bool:
    """Whether the point is one of the case of signs that the formulas of the system are for."""
    try:
        return real_point.are_positive(system.positive, real_point.table_at(near)) or any(
            isinstance(node, ex.Arbitrary) for tree in system.positive for node in ex.walk(tree)
        )
    except (KeyError, ValueError, TypeError, AttributeError):
        return False
