"""Use cases as they run inside a worker process: document in, document out."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from inverse_service.certificate.checker import check_result
from inverse_service.deadline import now
from inverse_service.errors import CertificateRefused
from inverse_service.inverse_problem.solving import solve_branches
from inverse_service.service.documents import accepting, translate
from inverse_service.service.documents.checking import compare_before_leaving

if TYPE_CHECKING:
    from api_schemas.base import ParseAnswer
    from api_schemas.result import ResultDocument
    from api_schemas.system import SystemDocument
    from inverse_service.expressions.tree import Expression
    from inverse_service.inverse_problem.kinds.restricted import LagrangianKind
    from inverse_service.inverse_problem.options import SolveOptions
    from inverse_service.inverse_problem.solutions import Solution
    from inverse_service.mechanics.second_order_system import SecondOrderSystem

# Stages are told by name, an answer so far as {"so_far": result}.
Progress = Callable[[Any], None]
# The solver stops by itself a little before its process is killed, so that it can say how far it came.
SHARE_OF_SOLVER = 0.8
# What the solver may take where special cases or kinds are wanted too.
SHARE_BESIDE_CASES = 0.4
# What a system without a Lagrangian has instead is looked for so long, in s of processor time.
QUICKLY = 2.0
FIRST_FIELDS = ("format", "system", "question", "verdict", "verdict_with_time", "reason", "checked")


def solve_document(document: Any, options: SolveOptions, progress: Progress | None = None) -> dict[str, Any]:
    """The result document of a System document, its certificates checked.

    `options.time_limit` is the time for all of it; `time_dependent` is taken from the document.
    Raises InputError for a document that cannot be accepted, CertificateRefused where the checker
    finds our own certificate invalid.
    """
    end = now() + options.time_limit
    schema = accepting.to_schema(document)
    system = accepting.to_solvable(schema)
    share = SHARE_BESIDE_CASES if schema.special_cases or schema.kinds or schema.clock else SHARE_OF_SOLVER
    asked = dataclasses.replace(
        options,
        time_dependent=schema.time_dependent_lagrangian,
        time_limit=share * (end - now()),
        ansatz=accepting.to_ansatz(schema, system),
        given=accepting.to_given(schema).residuals,
        series_order=schema.series_order,
    )
    kinds, factor = _kinds(schema, system), _clock(schema, system)
    so_far = None if progress is None else lambda solution: _tell(solution, schema, progress)
    solution, *others = solve_branches(system, dataclasses.replace(asked, so_far=so_far), progress)
    result = translate.to_result(solution, schema, others)
    limit = now() + SHARE_OF_SOLVER * (end - now())
    # What follows is loaded when asked for, so that others start sooner.
    if result.verdict == "not_variational":
        from inverse_service.service.documents.instead import with_instead

        result = with_instead(result, solution, asked, min(limit, now() + QUICKLY))
    if kinds:
        from inverse_service.service.documents.kinds_part import with_kinds

        result = with_kinds(result, solution, schema, kinds, asked, limit)
    if schema.clock is not None:
        from inverse_service.service.documents.clock_part import clock_part

        part = clock_part(system, factor, asked, SHARE_OF_SOLVER * (end - now()))
        result = result.model_copy(update={"with_clock": part})
    if schema.special_cases:
        result = with_special_cases(result, system, asked, (end, progress))
    return ordered(checked(result, end - now()))


def _tell(solution: Solution, schema: SystemDocument, progress: Progress) -> None:
    """Report a confirmed answer of which more is sought, compared with the document as every answer."""
    found = checked(translate.to_result(solution, schema), 1.0)
    if found["verdict"] == "variational":
        lean = dict.fromkeys(("conditions", "certificate", "advice", "provenance"))
        more = {"explanation": [], "searching": True, "system": found["system"] | {"given": None}}
        progress({"so_far": found | lean | more})


def _kinds(schema: SystemDocument, system: SecondOrderSystem) -> tuple[LagrangianKind, ...]:
    if not schema.kinds and not schema.near:
        return ()
    from inverse_service.service.documents.kinds_part import to_kinds

    return to_kinds(schema, system)


def _clock(schema: SystemDocument, system: SecondOrderSystem) -> Expression | None:
    if schema.clock is None:
        return None
    from inverse_service.service.documents.clock_part import to_clock

    return to_clock(schema, system)


def with_special_cases(
    result: ResultDocument,
    system: SecondOrderSystem,
    asked: SolveOptions,
    limits: tuple[float, Progress | None],
) -> ResultDocument:
    """The result with the tree of special cases, found in the time that is left."""
    # Loaded when asked for, so that others start sooner.
    from inverse_service.inverse_problem.special_cases.case_tree import special_cases
    from inverse_service.service.documents.translate_cases import to_special_cases

    end, progress = limits
    deadline = now() + SHARE_OF_SOLVER * (end - now())
    found = special_cases(system, asked.time_dependent, deadline, progress, asked.seed)
    return result.model_copy(update={"special_cases": to_special_cases(found)})


def parse(schema: SystemDocument) -> ParseAnswer:
    """What was understood of a System document; raises InputError."""
    system = accepting.to_solvable(schema)
    accepting.to_ansatz(schema, system)
    _kinds(schema, system), _clock(schema, system)
    return translate.to_parse_answer(system, schema)


def checked(result: ResultDocument, time_limit: float) -> dict[str, Any]:
    """The document with the checker's verdict on each definite answer.

    The solver has its certificates checked itself; only what it left unchecked is checked here. An
    answer that the checker finds incomplete becomes undetermined: no verdict leaves unchecked, nor
    before its system was compared with the document as given.
    """
    end = now() + time_limit
    document = _certified(result.model_dump(mode="json"), time_limit)
    compare_before_leaving(document, end - now())
    return document


def _certified(document: dict[str, Any], time_limit: float) -> dict[str, Any]:
    """The document, each answer with the checker's verdict; those of `branches` as the main ones."""
    for place, branch in enumerate(document["branches"]):
        found = _judged({**document, **branch, "branches": []}, time_limit)
        document["branches"][place] = {key: found[key] for key in branch}
    if document["branches"]:
        return {**document, **document["branches"][0]}
    return _judged(document, time_limit)


def _judged(document: dict[str, Any], time_limit: float) -> dict[str, Any]:
    other = document["with_time"]
    if other is None:
        _check_answer(document, document, time_limit)
        if document["verdict"] == "undetermined" and document["verdict_with_time"] is not None:
            document["verdict_with_time"] = "undetermined"
        return document
    # Two answers: the checker judges a document as a whole, so each is shown to it alone.
    alone = {"verdict_with_time": None, "with_time": None}
    _check_answer(document, document | alone, time_limit)
    _check_answer(other, document | other | alone | {"question": "L(t, q, q')"}, time_limit)
    document["verdict_with_time"] = other["verdict"]
    return document


def ordered(document: dict[str, Any]) -> dict[str, Any]:
    """The fields in the order of the contract, which is the order in which a person reads them."""
    return {key: document[key] for key in FIRST_FIELDS} | document


def _check_answer(answer: dict[str, Any], shown: dict[str, Any], time_limit: float) -> None:
    if answer["verdict"] == "undetermined" or answer["checked"] == "valid":
        return
    found = check_result(shown, time_limit=max(1.0, time_limit))
    answer["checked"] = found.verdict
    if found.verdict == "invalid":
        raise CertificateRefused("our checker refused our certificate: " + "; ".join(found.reasons)[:500])
    if found.verdict == "incomplete":
        verdict, reasons = answer["verdict"].replace("_", " "), "; ".join(found.reasons)
        answer["verdict"] = "undetermined"
        answer["reason"] = f"The solver found {verdict}, but the independent check could not confirm it: {reasons}"
