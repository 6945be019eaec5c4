"""Documents to results: which use case a document belongs to, and that of systems of equations.

Only what is asked for is imported: motions on constraints, families, and fitted systems take 0.05 to
0.1 s each, which a single call notices. Processes that serve many import all before the first (`tasks.load_engine`).
"""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from api_schemas.base import ParseAnswer
from api_schemas.system import LagrangianDocument, MotionDocument, SystemDocument
from inverse_service import errors, garbage
from inverse_service.deadline import now, whole
from inverse_service.decision.solutions import SolveOptions
from inverse_service.expressions import printing
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading import reader
from inverse_service.service.documents import (
    accepting,
    answers,
    comparison,
    derived,
    echo,
    growing,
    translate,
)
from inverse_service.service.documents.older_keys import Told, result_of
from inverse_service.solving import solving
from inverse_service.statements import questions, reasons
from inverse_service.statements.questions import TIMED
from inverse_service.statements.stages import Part

if TYPE_CHECKING:
    from inverse_service.decision.solutions import Left, Solution

# Errors in the mathematics of a valid document, and the reason that the result then gives.
REASONS = {
    OverflowError: reasons.TOO_LARGE_NUMBER,
    errors.CertificateRefused: reasons.REFUSED,
}
Progress = Callable[[Any], None]
# What the solver may take where a family or kinds are wanted too.
SHARE_BESIDE_CASES = 0.4
# What a system without a Lagrangian has instead is looked for so long, in s of processor time.
QUICKLY = 2.0
ENDED: tuple[type[Exception], ...] = tuple(REASONS)
log = logging.getLogger(__name__)


def solve_document(
    document: Any, options: SolveOptions, progress: Progress | None = None
) -> dict[str, Any]:
    """The result of a document of any kind. Raises InputError for one that cannot be accepted.

    `progress` receives the name of each stage, and what is finished and checked while more is
    sought (see `growing`).

    Where the mathematics fails on it the answer is undetermined and says why; `provenance.fault`
    names the error.
    """
    with printing.with_decimals(accepting.typed_decimals(document)), garbage.seldom():
        return _solved(document, options, progress)


def _solved(document: Any, options: SolveOptions, progress: Progress | None) -> dict[str, Any]:
    try:
        ready = accepting.prepared(document)
        grow = growing.Growing(
            progress, lambda told: _finished(ready.outward(result_of(told)), document)
        )
        with whole(options.time_limit):
            found = _in_own_words(ready, lambda cases: cases.solve(ready.document, options, grow))
    except ENDED as error:
        if accepting.is_forward(document):
            raise
        return _undetermined(document, error, options)
    return _finished(found, document)


def _finished(found: dict[str, Any], document: Any) -> dict[str, Any]:
    """The result with the document as it was given."""
    if isinstance(found.get("system"), dict):
        found["system"] = found["system"] | {"given": translate.as_plain_data(document)}
    return found


def _undetermined(document: Any, error: Exception, options: SolveOptions) -> dict[str, Any]:
    understood = None
    with contextlib.suppress(*ENDED):
        understood = understand_document(document)
    reason = next(one for kind, one in REASONS.items() if isinstance(error, kind))
    result = answers.undetermined(understood, reason, options)
    trace = "".join(traceback.format_exception(error))[-4000:]
    result["provenance"] |= {"fault": type(error).__name__}
    log.error("no verdict: %s", trace)
    return result


def parse_document(document: Any) -> dict[str, Any]:
    """The interpretation of a document; raises InputError."""
    ready = accepting.prepared(document)
    with printing.with_decimals(accepting.typed_decimals(document)):
        return _in_own_words(
            ready, lambda cases: cases.parse(cases.look(ready.document)).model_dump(mode="json")
        )


def refuse_unreadable(document: Any) -> None:
    """`parse_document` without its value."""
    ready = accepting.prepared(document)
    _in_own_words(ready, lambda cases: {"read": cases.parse(cases.look(ready.document))})


def understand_document(document: Any) -> dict[str, Any]:
    """The `system` part of a result, with the document as JSON has it; raises InputError."""
    ready = accepting.prepared(document)

    def understood(cases: UseCases) -> dict[str, Any]:
        schema = cases.look(ready.document)
        return translate.to_understood(cases.system(schema), schema).model_dump(mode="json")

    with printing.with_decimals(accepting.typed_decimals(document)):
        return {**_in_own_words(ready, understood), "given": translate.as_plain_data(document)}


@dataclasses.dataclass(frozen=True, slots=True)
class UseCases:
    """What is done with a document of one kind: read into its schema, answered, parsed, seen as a
    system, solved.
    """

    look: Callable[[Any], Any]
    parse: Callable[[Any], ParseAnswer]
    system: Callable[[Any], SecondOrderSystem]
    solve: Callable[[Any, SolveOptions, growing.Growing], dict[str, Any]]


def use_cases(document: Any) -> UseCases:
    """Those of the kind that a prepared document is of, imported now."""
    if accepting.is_motion(document):
        from inverse_service.service.documents import (
            motion_documents as read,
            nonholonomic_documents as solved,
        )

        look: Callable[[Any], Any] = partial(accepting.validated, schema=MotionDocument)
        return UseCases(look, read.parse_motion, read.system_of_motion, solved.solve_motion)
    if accepting.is_forward(document):
        from inverse_service.service.documents import own_lagrangian as alone

        look = partial(accepting.validated, schema=LagrangianDocument)
        return UseCases(look, alone.parse, alone.system_of, alone.solve_forward)
    if accepting.is_nonholonomic(document):
        from inverse_service.service.documents import (
            motion_documents as read,
            nonholonomic_documents as solved,
        )

        return UseCases(
            read.to_nonholonomic_schema, read.parse, read.system_of, solved.solve_nonholonomic
        )
    return UseCases(accepting.to_schema, parse_system, accepting.to_system, solve_system)


def _in_own_words(
    ready: accepting.Prepared, work: Callable[[UseCases], dict[str, Any]]
) -> dict[str, Any]:
    """The answer, or the refusal, in the names that the writer of the document uses."""
    try:
        with reader.noted() as notes:
            found = work(use_cases(ready.document))
        if "readings" in found:
            found["readings"] = [
                meant.document(text) for text, meant in {**ready.readings, **notes}.items()
            ]
        return ready.outward(found)
    except errors.InputError as error:
        raise ready.error(error) from None


def look(document: Any) -> None:
    """Raise DocumentRefused where a document has not the shape of one that is solved."""
    plain = accepting.prepared(document).document
    use_cases(plain).look(plain)


def solve_system(
    document: Any, options: SolveOptions, grow: growing.Growing | None = None
) -> dict[str, Any]:
    """The result document of a System document, its certificates checked.

    `options.time_limit` is the time for all of it; `time_dependent` is taken from the document.
    Raises InputError for a document that cannot be accepted, CertificateRefused where the checker
    finds our own certificate invalid.
    """
    grow, end = grow or growing.Growing(None), now() + options.time_limit
    schema = accepting.to_schema(document)
    given = accepting.to_given(schema)
    system = accepting.to_solvable(schema, given)
    asks_family = bool(schema.family) or schema.special_cases
    if asks_family:
        from inverse_service.service.documents import family_parts

        family_parts.names_of_family(schema, system)
    fitted = None
    if schema.nearest:
        from inverse_service.service.documents import nearest_parts

        fitted = nearest_parts.fitted_system(schema)
    share = (
        SHARE_BESIDE_CASES
        if asks_family or schema.kinds or schema.clock or schema.nearest
        else comparison.SHARE_OF_SOLVER
    )
    asked = dataclasses.replace(
        options,
        time_dependent=schema.time_dependent_lagrangian,
        time_limit=share * (end - now()),
        ansatz=accepting.to_ansatz(schema, system),
        given=system.given if system.is_unsolved else given.residuals,
        series_order=schema.series_order,
        first_integrals=schema.first_integrals,
    )
    kinds = derived.to_kinds(schema, system) if schema.kinds or schema.near else ()
    factor = None if schema.clock is None else derived.to_clock(schema, system)
    grow.wanted = _wanted(schema, system, bool(kinds))
    to_told = partial(translate.to_told, schema=schema, understood=translate.understanding(schema))

    def tell(
        parts: Sequence[str], make: Callable[[], tuple[tuple[Solution, ...], tuple[Left, ...]]]
    ) -> None:
        def so_far() -> Told | None:
            known, open_ones = make()
            return comparison.checked_so_far(
                to_told(known[0], others=known[1:], left=open_ones), 1.0
            )

        grow.hand_over(parts, so_far)

    solutions, left = solving.solve_branches(
        system, dataclasses.replace(asked, hand_over=tell), grow.stage
    )
    solution, grow.cut = (
        solutions[0],
        {part: why for each in solutions for part, why in each.cut.items()},
    )
    told = to_told(solution, others=solutions[1:], left=left)
    limit = now() + comparison.SHARE_OF_SOLVER * (end - now())
    if any(one.part["exceptions"] for one in told.about_equations()):
        quickly = min(limit, now() + QUICKLY)
        told = derived.with_left_out(told, solution, asked, quickly, asks_family)
    if told.first.verdict == "not_variational":
        grow.begin(Part.KINDS)
        told = derived.with_instead(told, solution, asked, min(limit, now() + QUICKLY))
    if kinds:
        grow.begin(Part.KINDS)
        told = derived.with_kinds(told, solution, schema, kinds, asked, limit)
        grow.hand_over(
            (Part.EXPLANATION, Part.KINDS), partial(comparison.checked_so_far, told, 1.0)
        )
    if schema.clock is not None:
        grow.begin(Part.CLOCK)
        limit = comparison.SHARE_OF_SOLVER * (end - now())
        told = derived.with_clock(told, system, factor, asked, limit)
        grow.hand_over(
            (Part.EXPLANATION, Part.CLOCK), partial(comparison.checked_so_far, told, 1.0)
        )
    if asks_family:
        told = family_parts.with_family(told, system, schema, asked, grow, end)
    if fitted is not None:
        told = nearest_parts.with_nearest(
            told, schema, fitted, options, grow, end, _answer_about_member
        )
    grow.begin(Part.CERTIFICATE)
    return result_of(grow.end(comparison.checked(told, end - now())))


def _answer_about_member(document: dict[str, Any], options: SolveOptions) -> dict[str, Any]:
    """The result of a document that this program wrote."""
    with printing.with_decimals(accepting.typed_decimals(document)):
        return _finished(solve_system(document, options), document)


def _wanted(schema: SystemDocument, system: SecondOrderSystem, kinds: bool) -> tuple[Part, ...]:
    """The parts of the result that is asked for, in the order of wanting."""
    asked = questions.asked(schema.time_dependent_lagrangian, system.depends_on_time)
    wanted = {
        Part.CONDITIONS: True,
        Part.EXISTENCE: True,
        Part.EXISTENCE_WITH_TIME: TIMED in asked,
        Part.CERTIFICATE: True,
        Part.LAGRANGIAN: True,
        Part.LAGRANGIAN_WITH_TIME: len(asked) > 1,
        Part.HAMILTONIAN: True,
        Part.FIRST_INTEGRALS: schema.first_integrals,
        Part.KINDS: kinds,
        Part.CLOCK: bool(schema.clock),
        Part.FAMILY: bool(schema.family or schema.special_cases),
        Part.EXPLANATION: True,
    }
    return tuple(part for part, is_wanted in wanted.items() if is_wanted)


def parse_system(schema: SystemDocument) -> ParseAnswer:
    """The interpretation of a System document; raises InputError."""
    system = accepting.to_solvable(schema)
    accepting.to_ansatz(schema, system)
    derived.to_kinds(schema, system)
    if schema.clock is not None:
        derived.to_clock(schema, system)
    shown = echo.accelerations_with_extremes(schema, system)
    return translate.to_parse_answer(shown, schema)
