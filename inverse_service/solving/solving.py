"""Answer both questions about one system: decide, find a Lagrangian, certify, check, explain.

Regions where other formulas are valid have separate answers, so a system is answered cell by cell.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice, product
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from inverse_service import bounds, deadline, errors
from inverse_service.certificate import checker
from inverse_service.decision import certify, deciding
from inverse_service.decision.solutions import (
    AllIntegrals,
    Conditions,
    Lagrangian,
    Left,
    Solution,
    SolveOptions,
    Statement,
    Step,
    implied,
)
from inverse_service.explanation import explaining
from inverse_service.expressions import collecting, notation, printing, terms, tree as ex
from inverse_service.field import exact_field, real_branch, tower
from inverse_service.linear_pde import involution
from inverse_service.mechanics import second_order_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search import antiderivatives, row_factors, tidy
from inverse_service.search.tidy import Found, SearchOutcome, describe, is_multiple, why_shown
from inverse_service.solving import beyond
from inverse_service.statements import questions, reasons, stages
from inverse_service.statements.domains import Domain
from inverse_service.statements.questions import PLAIN, TIMED, Question, narrowest
from inverse_service.statements.stages import DECISION, Part, Progress, Stage

if TYPE_CHECKING:
    from inverse_service.decision.solutions import SoFar
    from inverse_service.mechanics.first_integrals import FirstIntegral
    from inverse_service.search.reductions import Smaller
# The share of the time after the decision that the search for a closed form may use.
_SEARCH_SHARE = 0.5
# The shares of the remaining time for the decision on the first of two questions, and for factors
# of the equations as written.
_SHARE_OF_FIRST, _SHARE_AS_GIVEN = 0.6, 0.3
AS_GIVEN = "the equations as given"
# The seconds, and the share of the time, that first integrals may use.
_FOR_INTEGRALS, _FOR_ALL_INTEGRALS, _SHARE_FOR_INTEGRALS = 1.0, 4.0, 0.1
# The number of unknowns up to which the freedom in L is counted if a Lagrangian is known: nine
# coordinates.
_MOST_FOR_FREEDOM = 30_000
# The `reading_class` of rational functions of the velocities; larger values are harder to read.
_RATIONAL = 2
# The costs up to which the search looks for a simpler answer if a complete one is known, and if one
# without H in closed form is known.
_QUICK, _FAIR = 1.9, 3.65
# The seconds after which a search reports the results confirmed so far; before that, the Lagrangian
# itself is expected.
AT_ONCE = 1.0
log = logging.getLogger(__name__)
Result = TypeVar("Result")
_MOST_OUTSIDE = 64  # combinations of one side of each cell
_OTHER_POINTS = range(2, 8)  # seeds of points on other parts of a cell
_FAR = 8


def solve_branches(
    system: SecondOrderSystem, options: SolveOptions, progress: Progress | None = None
) -> tuple[tuple[Solution, ...], tuple[Left, ...]]:
    """The answers on all cells of the system, and the cells without one.

    The first cells are the open sets on which roots of squares, |u|, and the like are single
    formulas. If the proof of an answer depends on a side, the set beyond it is a separate cell.
    Each cell gets a share of the time. More than `MOST_BRANCHES` sets give one undetermined answer;
    for one coordinate, that many sets are answered.
    """
    branches = second_order_system.branches_of(system)
    if (
        len(branches) > second_order_system.MOST_BRANCHES and len(system.coordinates) > 1
    ):  # with one coordinate, each cell has a Lagrangian
        number = (
            f"{len(branches)} or more"
            if len(branches) == second_order_system.MOST_COUNTED
            else str(len(branches))
        )
        reason = reasons.many_cells(number, second_order_system.MOST_BRANCHES)
        return (_unreduced(system, options, None, reason),), ()
    told, end, solutions = options.hand_over, deadline.now() + options.time_limit, list[Solution]()

    def answer(
        branch: SecondOrderSystem, waiting: Sequence[SecondOrderSystem]
    ) -> tuple[Solution, Sequence[ex.Expression]]:
        alone = not waiting and not solutions
        share = (end - deadline.now()) / (1 + len(waiting))
        chosen = options if alone else replace(options, hand_over=None)
        found = solve(branch, replace(chosen, time_limit=max(0.1, share)), progress)
        solutions.append(found)
        if told is not None and not alone:
            open_ones = tuple(
                Left(Domain(tuple(map(collecting.collect, each.positive))), None, reasons.NOT_YET)
                for each in waiting
            )
            known = tuple(solutions)
            told((), lambda: (known, open_ones))
        return found, sides_of(found)

    open_cells = cell_by_cell(system, answer, end).left
    for found in solutions:
        for one in found.statements:
            if one.domain.connected and one.certificate is not None:
                analysis = deciding.analyze(found.system)
                other = other_part(analysis, one.certificate, one.domain.sides, end)
                if other is not None:
                    cell = Domain(sides_of(found))
                    open_cells.append(Left(cell, other.point, reasons.UNCONNECTED))
                    break
    is_alone = len(solutions) == 1 and not open_cells
    for found in solutions:
        if found.main.domain.positive:
            sides = () if is_alone else sides_of(found)
            open_cells += beyond.left_out(found.system, found.main, sides, options.given)
    return tuple(solutions), tuple(open_cells)


def sides_of(solution: Solution) -> tuple[ex.Expression, ...]:
    """The trees that are positive on the cell of an answer and on whose signs its proofs depend."""
    sides = [
        *map(collecting.collect, solution.system.positive),
        *(side for one in solution.statements for side in one.domain.sides),
    ]
    return tuple(dict.fromkeys(sides))


class ByCell(NamedTuple, Generic[Result]):
    """The answers on cells of a system, and the sets `left` without an answer."""

    answers: list[Result]
    left: list[Left]


def cell_by_cell(
    system: SecondOrderSystem,
    answer: Callable[
        [SecondOrderSystem, Sequence[SecondOrderSystem]],
        tuple[Result, Sequence[ex.Expression]],
    ],
    end: float = math.inf,
) -> ByCell[Result]:
    """The answers on all cells, and the sets without an answer.

    `answer` is called with the system on a cell and the systems still waiting; it returns the
    answer and the trees that are positive on its cell. The other side of each tree, within the same
    branch, is a separate cell. No new cell is begun after the time `end`. Branches without a known
    point, and points in no cell, have no answer either.
    """
    branches = second_order_system.branches_of(system)
    waiting, found, left, known_sides = (
        [*branches],
        list[Result](),
        list[Left](),
        list[Sequence[ex.Expression]](),
    )
    while waiting:
        cell = waiting.pop(0)
        if len(found) == second_order_system.MOST_BRANCHES or (
            cell not in branches and deadline.now() > end
        ):
            most = second_order_system.MOST_BRANCHES
            reason = reasons.more_cells(most) if len(found) == most else reasons.NO_TIME
            left.append(
                Left(Domain(tuple(map(collecting.collect, cell.positive))), point_of(cell), reason)
            )
            continue
        one, sides = answer(cell, waiting)
        found.append(one)
        known_sides.append(sides)
        known = {collecting.collect(tree) for tree in cell.positive}
        fresh = [side for side in sides if side not in known]
        for k, side in enumerate(fresh):
            other = second_order_system.on_side(cell, [*fresh[:k], collecting.collect(-side)])
            if other is not None and point_of(other) is not None:
                waiting.append(other)
    unreached = second_order_system.unreached(system)
    left += [
        Left(Domain(tuple(map(collecting.collect, one.positive))), None, reasons.NO_POINT)
        for one in unreached
    ]
    if system.branch is None:
        left += _in_no_cell(system, known_sides)
    return ByCell(found, left)


def _in_no_cell(system: SecondOrderSystem, sides: Sequence[Sequence[ex.Expression]]) -> list[Left]:
    """The sets with a known point that no cell contains: of the trees positive on each cell, one is
    negative there.
    """
    found = list[Left]()
    for outside in islice(product(*sides), _MOST_OUTSIDE):
        beyond = second_order_system.on_side(
            system, [collecting.collect(-side) for side in outside]
        )
        point = None if beyond is None else point_of(beyond)
        if (
            beyond is None
            or point is None
            or any(real_branch.are_positive(one.domain.positive, point) for one in found)
        ):
            continue
        found.append(Left(Domain(beyond.positive), point, reasons.IN_NO_CELL))
    return found


class OtherPart(NamedTuple):
    """A point on another connected part of a cell, and what the checker says of a claim there."""

    point: real_branch.RealTable
    proof: checker.CheckResult


def other_part(
    analysis: deciding.Analysis,
    certificate: Mapping[str, Any],
    sides: Sequence[ex.Expression],
    end: float,
    wanted: Sequence[str] = ("invalid", "incomplete"),
) -> OtherPart | None:
    """Repeat the check of a claim at points on other connected parts of its cell, where all `sides`
    are > 0.

    Earlier entries of the `wanted` verdicts take precedence; None if no tried point has one.
    """
    found = dict[str, OtherPart]()
    for point in (one for seed in _OTHER_POINTS for one in _points(analysis.system, seed)):
        if (
            wanted[0] not in found
            and real_branch.are_positive(sides, point)
            and deadline.now() < end
        ):
            moved = {**certificate, "near": certify.moved_to(certificate["near"], point)}
            proof = certify.prove(
                replace(analysis, real_point=point), moved, deadline.left(end, 1.0)
            )[1]
            found.setdefault(proof.verdict, OtherPart(point, proof))
    return next((found[verdict] for verdict in wanted if verdict in found), None)


def _points(system: SecondOrderSystem, seed: int) -> list[real_branch.RealTable]:
    """A point where f is defined, and one farther in its direction, beyond other zeros of periodic
    functions.
    """
    near = point_of(system, seed)
    if near is None:
        return []
    far = near | {name: _FAR * near[name] for name in deciding.variables_of(system) if name in near}
    kernels = tuple(map(tower.to_kernels, system.accelerations))
    return [near, far] if real_branch.is_defined(kernels, far) else [near]


def point_of(system: SecondOrderSystem, seed: int = 1) -> real_branch.RealTable | None:
    """A real point at which f has a value and everything in `system.positive` is > 0."""
    kernels = tuple(map(tower.to_kernels, system.accelerations))
    return real_branch.find_real_point(
        kernels, deciding.variables_of(system), seed, system.positive
    )


def solve(
    system: SecondOrderSystem, options: SolveOptions, progress: Progress | None = None
) -> Solution:
    """The answers on the first branch of the system; an undecidable question is a regular outcome.

    Raises CertificateRefused if the checker finds a certificate invalid, which is an internal
    error.
    """
    with notation.multiplier_beside(system.names.declared()):
        return _solve(system, options, progress)


def with_reasons(
    solution: Solution, options: SolveOptions, progress: Progress | None = None
) -> Solution:
    """The solution, with reasons added to each no that lacks them."""
    system = solution.system

    def lacks_reasons(one: Statement) -> bool:
        return one.verdict == "not_variational" and not one.explanation

    if not any(map(lacks_reasons, solution.statements)):
        return solution
    with notation.multiplier_beside(system.names.declared()):
        work = Work(deciding.analyze(system), options, progress or (lambda _: None), math.inf)
        return solution.changed(
            lambda one: (
                _explained(_with_its_reasons(work, one), system) if lacks_reasons(one) else one
            )
        )


def _solve(system: SecondOrderSystem, options: SolveOptions, progress: Progress | None) -> Solution:
    began = deadline.now()
    system = second_order_system.branches_of(system)[0]
    if max(len(printing.to_text(tree)) for tree in system.accelerations) > checker.MAX_TEXT:
        return _unreduced(system, options, None, reasons.too_long(checker.MAX_TEXT))
    report = progress or (lambda _: None)
    try:
        analysis = deciding.analyze(system)
    except errors.IrreducibleAtoms as problem:
        written = _conditions(system, options, report)[0]
        return _unreduced(system, options, written, reasons.irreducible(problem.detail))
    work = Work(
        analysis,
        options,
        report,
        began + options.time_limit,
        {"analysis": deadline.now() - began},
        began=began,
    )
    found = [] if _is_excluded(work) else _as_given(work)
    began = deadline.now()
    work.printed, left_out = _conditions(system, options, report)
    work.add_seconds("conditions", began)
    report_parts(work, Part.CONDITIONS)
    statements = tuple(_explained(one, system) for one in _settle_all(work, found))
    provenance: dict[str, Any] = {
        "seed": options.seed,
        "time_limit": round(options.time_limit, 4),
        "points": [
            dict(point) for k, point in enumerate(work.points) if point not in work.points[:k]
        ],
        "conditions_left_out": left_out,
    }
    if work.refused:
        provenance["refused_lagrangians"] = len(work.refused)
    kept, complete = _all_integrals(work, _first_integrals(work, statements))
    provenance["seconds"] = {stage: round(value, 3) for stage, value in work.seconds.items()}
    return Solution(
        system, work.asked, statements, work.printed, provenance, work.cut, kept, complete
    )


def _conditions(
    system: SecondOrderSystem, options: SolveOptions, report: Progress
) -> tuple[Conditions | None, str]:
    """The conditions written out, or None with the reason for omitting them ("" if they were not
    requested).
    """
    if system.is_unsolved:
        return None, "the equations are not solved for the accelerations"
    if len(system.coordinates) > explaining.MOST_COORDINATES:
        return (
            None,
            f"a system of more than {explaining.MOST_COORDINATES} coordinates has them by the thousand",
        )
    if not options.conditions:
        return None, ""
    report(Stage("conditions"))
    return explaining.printed_conditions(system)


def _first_integrals(work: Work, found: Sequence[Statement]) -> tuple[FirstIntegral, ...]:
    """The first integrals, from the Lagrangian if there is one, otherwise from the equations
    alone.
    """
    system = work.analysis.system
    if not work.options.first_integrals or system.is_unsolved:
        return ()
    from inverse_service.mechanics.first_integrals import first_integrals, unconstrained_motion

    began = deadline.now()
    work.progress(Stage("first integrals"))
    answers = (implied(question, found) for question in work.asked)
    known = next((one.lagrangian for one in answers if one and one.lagrangian), None)
    limit = min(_FOR_INTEGRALS, _SHARE_FOR_INTEGRALS * work.options.time_limit, work.left())
    tree = None if known is None else second_order_system.on_branch(known.expression, system)
    integrals = first_integrals(unconstrained_motion(system), tree, work.options.seed, limit)
    work.add_seconds("first integrals", began)
    return integrals


def _all_integrals(
    work: Work, found: tuple[FirstIntegral, ...]
) -> tuple[tuple[FirstIntegral, ...], AllIntegrals | None]:
    """These and higher ones, and whether they are all that are polynomials in the velocities, to a
    proven degree.
    """
    system = work.analysis.system
    if (
        not work.options.first_integrals
        or system.is_unsolved
        or len(system.coordinates) > bounds.FEW
    ):
        return found, None
    from inverse_service.solving.complete_integrals import with_higher

    began = deadline.now()
    work.progress(Stage("first integrals", "all that there are"))
    limit = min(_FOR_ALL_INTEGRALS, _SHARE_FOR_INTEGRALS * work.options.time_limit, work.left())
    every = with_higher(work.analysis, found, work.options.seed, limit)
    work.add_seconds("first integrals", began)
    return every


def _unreduced(
    system: SecondOrderSystem, options: SolveOptions, found: Conditions | None, reason: reasons.Open
) -> Solution:
    asked = questions.asked(options.time_dependent, system.depends_on_time)
    domain = Domain(tuple(map(collecting.collect, system.positive)))
    statements = (Statement(one, "undetermined", reason, domain=domain) for one in asked)
    return Solution(system, asked, tuple(statements), found, {"seed": options.seed})


def _settle_all(work: Work, given: Sequence[Statement]) -> list[Statement]:
    """The statements that answer all questions, each proved once; those that are `given` come
    first.
    """
    found = [*given]
    for question in work.asked:
        known = implied(question, found)
        if known is None:
            found.append(_settle(work, question, found))
        elif known.question != question and known.verdict == "variational" and not given:
            better = _simpler(work, question, known)
            found = [one for one in found if one.question != better.question] + [better]
    return found


def _settle(work: Work, question: Question, found: Sequence[Statement]) -> Statement:
    """The statement about a question that no other answers; a no also answers narrower
    questions, so that of a wider one comes first.
    """
    decision = _decide(work, question)
    if decision.verdict == "not_variational":
        wider = (one for one in work.asked if one != question and one.includes(question))
        for one in wider:
            again = None if implied(one, found) else _decide(work, one, order=decision.order)
            if again is not None and again.verdict == "not_variational":
                refused = _negative(work, again)
                if refused.verdict == "not_variational":
                    return refused
    return _answer(work, decision)


def _is_excluded(work: Work) -> bool:
    """Whether accelerations that do not come from the document, such as those of a reduced system,
    have no Lagrangian.

    Factors of written lines cannot help then, and the decision is needed anyway to count the
    freedom.
    """
    system, options = work.analysis.system, work.options
    if options.given or system.is_unsolved or len(system.coordinates) > explaining.MOST_COORDINATES:
        return False
    return _decide(work, work.asked[-1], _SHARE_AS_GIVEN).verdict == "not_variational"


def _as_given(work: Work) -> list[Statement]:
    """The statement from factors of the equations as written, by preference without t; requires no
    decision.
    """
    system, table = work.analysis.system, work.analysis.real_point
    began = deadline.now()
    work.progress(Stage("the equations as given"))
    written = tuple(
        second_order_system.on_branch(equation, system) for equation in work.options.given
    )
    best: ex.Expression | None = None
    with (
        suppress(deadline.OutOfTime),
        deadline.until(deadline.now() + _SHARE_AS_GIVEN * work.left()),
    ):
        for integral_signs in (False, True):
            for tree in row_factors.lagrangians_of_lines(system, written, table, integral_signs):
                if ex.holds(tree, ex.TIME) and (best is not None or TIMED not in work.asked):
                    continue
                real = tree if table is None else antiderivatives.real_form(tree, table)
                forms = dict.fromkeys((tidy.shorten_lagrangian(real, system), real, tree))
                best = next(
                    (
                        form
                        for form in forms
                        if checker_accepts(work, form, narrowest(ex.holds(form, ex.TIME)))
                    ),
                    best,
                )
                if best is not None and not ex.holds(best, ex.TIME):
                    break
            if best is not None:
                break
    work.add_seconds("search", began)
    if best is None:
        return []
    question = narrowest(ex.holds(best, ex.TIME))
    short = not (system.is_unsolved or len(system.coordinates) > explaining.MOST_COORDINATES)
    short = short and sum(map(ex.node_count, system.accelerations)) <= bounds.TERMS
    decision = _decide(work, question, _SHARE_AS_GIVEN, _MOST_FOR_FREEDOM) if short else None
    found = explaining.of_lagrangian(
        work.analysis, question, best, AS_GIVEN, explaining.as_given_steps(), decision
    )
    return [with_hamiltonian(work, replace(found, checked="valid"), None)]


def _holds_time(one: Statement) -> bool:
    return one.lagrangian is not None and ex.holds(one.lagrangian.expression, ex.TIME)


def _explained(answer: Statement, system: SecondOrderSystem) -> Statement:
    """The answer with a note on ambiguous names, and with the set where it holds if it has an
    explanation.
    """
    answer = explaining.with_shared_letters(answer, system)
    if not answer.explanation:
        return answer
    steps = explaining.branch_steps(system, answer.domain.positive, answer.domain.nonzero)
    known, found = {*answer.domain.trees}, answer.lagrangian
    if len(system.coordinates) == 1 and found and not known.issuperset(found.domain.trees):
        steps += (
            explaining.of_one_coordinate(system.coordinates[0], narrowest(_holds_time(answer))),
        )
    return replace(answer, explanation=(*steps, *answer.explanation))


def _is_complete(answer: Statement) -> bool:
    """Whether the answer has a Lagrangian and a Hamiltonian in closed form."""
    return (
        answer.lagrangian is not None
        and answer.hamiltonian is not None
        and not answer.hamiltonian.transform.implicit
    )


def _simpler(work: Work, question: Question, autonomous: Statement) -> Statement:
    """If L(q, v) was not found, has no closed H, or is hard to read: a better L of a wider
    question, if there is one; else the same statement.

    One without t is an L(q, v) and answers the narrower question.
    """
    from inverse_service.search import families

    if _is_complete(autonomous) and ex.reading_class(_expression(autonomous), ex.TIME) < _RATIONAL:
        return autonomous
    system, known = work.analysis.system, work.analysis.proposals
    found = (
        autonomous.lagrangian is not None and len(system.coordinates) > 1 and "material" in known
    )
    if families.excludes_factor_of_time(system) or (
        found and not families.has_factors_of_time(known["material"])
    ):
        return autonomous  # without a factor e^(ct), the search would be the same
    decision = _decide(work, question)
    if decision.verdict != "variational":
        return autonomous
    complete = _is_complete(autonomous)

    def nicer(tree: ex.Expression) -> bool:
        if autonomous.lagrangian is None:
            return True
        known = _expression(autonomous)
        return tree != known and (
            not complete or ex.reading_class(tree, ex.TIME) < ex.reading_class(known, ex.TIME)
        )

    answer = _by_lagrangian(work, decision, _highest(autonomous), nicer)
    if answer is None or (autonomous.lagrangian is not None and not _is_complete(answer)):
        return autonomous
    return answer if _holds_time(answer) else _narrowed(work, autonomous.question, answer) or answer


def _highest(autonomous: Statement) -> float:
    """The cost up to which to search for a better L(t, q, v); the large rows of several velocities
    have found none.
    """
    if autonomous.lagrangian is None:
        return math.inf
    one = len(autonomous.lagrangian.multiplier) == 1
    return _QUICK if _is_complete(autonomous) else math.inf if one else _FAIR


def _expression(answer: Statement) -> ex.Expression:
    assert answer.lagrangian is not None
    return answer.lagrangian.expression


def _narrowed(work: Work, question: Question, wider: Statement) -> Statement | None:
    """The statement about a narrower question by the Lagrangian of a wider one, which answers
    it.
    """
    decision = work.decided[question]
    found = _proposed(work, decision, _expression(wider))
    if judged_by_checker(work, found.certificate or {}).verdict != "valid":
        return None
    return with_hamiltonian(work, replace(found, checked="valid"), None)


def _answer(work: Work, decision: deciding.Decision) -> Statement:
    if decision.verdict == "undetermined":
        if decision.open is not None and decision.open.reason is reasons.Reason.TIME:
            work.cut[stages.existence(decision.question)] = decision.open
        return Statement(decision.question, "undetermined", decision.open)
    if decision.verdict == "not_variational":
        return _negative(work, decision)
    found = _by_lagrangian(work, decision)
    if found is None:
        found = confirm(work, _by_existence(work, decision))
        if found.verdict == "variational":
            report_statement(work, found)
    return found


def _decide(
    work: Work,
    question: Question,
    part: float | None = None,
    unknowns: int = involution.MOST_UNKNOWNS,
    order: int = involution.Limits().order,
) -> deciding.Decision:
    if work.analysis.system.is_unsolved:
        return deciding.Decision("undetermined", question, 0, reasons.UNSOLVED)
    if question in work.decided:
        return work.decided[question]
    stage = Stage(DECISION, timed=question.timed)
    work.progress(stage)
    is_first = question != work.asked[-1]  # the other question needs time, too
    limit = deadline.share(part or (_SHARE_OF_FIRST if is_first else 1.0), work.end)
    limits = involution.Limits(order, limit, unknowns)
    decision = deciding.decide(
        work.analysis.system,
        question,
        work.options.seed,
        limits,
        work.progress,
        analysis=work.analysis,
    )
    work.seconds[stage.kind] = decision.seconds
    work.points.extend(decision.points)
    if decision.verdict != "undetermined":
        work.decided[question] = decision
    return decision


def _negative(work: Work, decision: deciding.Decision) -> Statement:
    """The answer no with the proof that the checker confirms, and then the proof in sentences."""
    certificate = certify.of_decision(work.analysis, decision)
    answer = confirm(work, Statement(decision.question, "not_variational", certificate=certificate))
    if answer.verdict == "undetermined":
        return answer
    report_statement(work, answer)
    return _with_its_reasons(work, answer) if work.options.reasons else answer


def _with_its_reasons(work: Work, answer: Statement) -> Statement:
    began = deadline.now()
    work.progress(Stage("explanation"))
    try:
        steps = _reasons(work, answer.question)
    except errors.IrreducibleAtoms as problem:
        steps = (
            explaining.said(
                f"The conditions could not be printed: {problem.detail}.".replace("`", "")
            ),
        )
    work.add_seconds("explanation", began)
    return replace(answer, explanation=steps)


def _reasons(work: Work, question: Question) -> tuple[Step, ...]:
    """Why there is no Lagrangian; algebraic conditions exclude L with and without t alike and are
    explained once.
    """
    from inverse_service.explanation.hierarchy import smallest_sufficient_set
    from inverse_service.explanation.negative import explain_negative

    if work.explained:
        return work.explained
    chosen = smallest_sufficient_set(work.analysis, work.options.seed)
    steps = explain_negative(work.analysis, chosen, question, work.options.seed)
    if chosen is not None:
        work.explained = steps
    return steps


def _by_existence(work: Work, decision: deciding.Decision) -> Statement:
    certificate = certify.of_decision(
        work.analysis, decision, work.options.series_order, work.options.seed
    )
    series = explaining.series_steps(work.analysis, decision, work.options.series_order)
    steps, known = (
        (explaining.not_found(work.analysis.system, decision.space), *series),
        explaining.existence_steps(decision),
    )
    construction = None
    if len(work.analysis.system.coordinates) == 1:
        name = work.analysis.system.coordinates[0]
        construction = explaining.by_quadrature(name, decision.question)
        steps = (explaining.of_one_coordinate(name, decision.question), construction)
        known = (explaining.not_found(work.analysis.system, decision.space), *series)
    elif (single := _single_equations(work)) is not None:
        construction = explaining.of_single_equations(
            single.systems, single.numbers, single.forms, decision.question
        )
        steps = (construction, *steps)
    elif (construction := _roots(work)) is not None:
        steps = (construction, *steps)
    return Statement(
        decision.question,
        "variational",
        space=decision.space,
        certificate=certificate,
        construction=construction,
        explanation=steps,
        details=known,
    )


def _roots(work: Work) -> Step | None:
    """What L is for q'' = C q' with constant C whose eigenvalues have no formulas."""
    from inverse_service.search import linear_systems

    system = work.analysis.system
    taken = {*system.coordinates, *system.parameters}
    letter = ex.Symbol(next(name for name in ("lambda", "lambda_0", "mu") if name not in taken))
    with suppress(exact_field.TooLarge, errors.InputError, ArithmeticError):
        found = linear_systems.characteristic_of(system, letter)
        if found is not None:
            shown = collecting.collect(found)
            return explaining.of_roots(shown, letter, system.coordinates)
    return None


def _single_equations(work: Work) -> Smaller | None:
    """The system as equations of one coordinate each, after a search that found nothing."""
    from inverse_service.search import reductions

    material = work.analysis.proposals.get("material")
    if material is None:
        return None
    with suppress(exact_field.TooLarge, terms.TooManyTerms, errors.InputError, ArithmeticError):
        return reductions.single_equations(material, work.options.seed)
    return None


def _by_lagrangian(
    work: Work,
    decision: deciding.Decision,
    highest: float = math.inf,
    wanted: Callable[[ex.Expression], bool] = lambda _: True,
) -> Statement | None:
    """The answer with a wanted, confirmed Lagrangian and its Hamiltonian; None if none is found up
    to that cost.
    """
    work.outcome = _searched(work, decision, highest)
    if work.outcome.found is None:
        return None
    found = work.outcome.found
    lagrangian = _as_written(work, decision, found.lagrangians[0])
    if not wanted(lagrangian):
        return None
    answer = replace(_proposed(work, decision, lagrangian), checked="valid")
    return with_hamiltonian(work, answer, replace(found, lagrangians=found.lagrangians[1:]))


def _as_written(work: Work, decision: deciding.Decision, tree: ex.Expression) -> ex.Expression:
    """The confirmed multiple of L with the masses and roots of the equations as written if there is
    one, else L.
    """
    system = work.analysis.system
    given = tuple(
        second_order_system.on_branch(equation, system) for equation in work.options.given
    )
    multiple = row_factors.with_written_masses(tree, system, given)
    form = tree if multiple is None else tidy.shorten_lagrangian(multiple, system)
    with suppress(terms.TooManyTerms):
        form = tidy.with_written_roots(form, system, work.analysis.real_point or {}) or form
    return form if form != tree and checker_accepts(work, form, decision.question) else tree


def _proposed(work: Work, decision: deciding.Decision, tree: ex.Expression) -> Statement:
    assert work.outcome is not None
    assert work.outcome.found is not None
    how = explaining.search_steps(work.outcome)
    return explaining.of_lagrangian(
        work.analysis, decision.question, tree, work.outcome.found.family, how, decision
    )


def _searched(work: Work, decision: deciding.Decision, highest: float) -> SearchOutcome:
    """The outcome of the search for Lagrangians that the checker confirms, including the checker's
    time.
    """
    from inverse_service.search.ladder import search

    began, checked = deadline.now(), work.seconds.get("check", 0.0)
    limit = deadline.now() + _SEARCH_SHARE * work.left()
    with deadline.until(limit):
        outcome = search(
            work.analysis,
            decision.question,
            work.options.seed,
            report_while_searching(work, decision),
            work.options.ansatz,
            lambda tree: checker_accepts(work, tree, decision.question),
            highest,
        )
    work.add_seconds("search", began + work.seconds.get("check", 0.0) - checked)
    if outcome.found is None and deadline.now() >= limit:
        work.cut[stages.lagrangian(decision.question)] = reasons.SEARCH_EXPIRED
    return outcome


# Returned answers: the checker first confirms each Lagrangian and certificate.


@dataclass(slots=True)
class Work:
    """The state that the stages of one solve share."""

    analysis: deciding.Analysis
    options: SolveOptions
    progress: Progress
    end: float
    seconds: dict[str, float] = field(default_factory=dict)
    points: list[Mapping[str, int]] = field(default_factory=list)
    decided: dict[Question, deciding.Decision] = field(default_factory=dict)
    outcome: SearchOutcome | None = None
    explained: tuple[Step, ...] = ()
    refused: set[tuple[str, Question]] = field(default_factory=set)
    began: float = field(default_factory=deadline.now)
    # The conditions written out, what is confirmed so far about each question, and the parts for
    # which the time limit expired.
    printed: Conditions | None = None
    told: dict[Question, Statement] = field(default_factory=dict)
    cut: dict[Part, reasons.Open] = field(default_factory=dict)

    @property
    def asked(self) -> tuple[Question, ...]:
        return questions.asked(self.options.time_dependent, self.analysis.system.depends_on_time)

    def add_seconds(self, stage: str, began: float) -> None:
        self.seconds[stage] = self.seconds.get(stage, 0.0) + deadline.now() - began

    def left(self) -> float:
        return self.end - deadline.now()


def _on_its_set(work: Work, answer: Statement) -> Statement:
    """The answer, with the set on which the checker proved it."""
    if answer.certificate is None:
        return answer
    certificate, proof = certify.prove(
        work.analysis, dict(answer.certificate), deadline.left(work.end, 1.0)
    )
    shown = answer.lagrangian if proof.cell == proof.formulas else None
    formulas = (*certify.forces_of(work.analysis.system), *([shown.expression] if shown else []))
    names = certify.names_of_certificate(certificate["system"], certificate)
    where = certify.where_of(proof.cell, names, formulas)
    return replace(
        answer,
        certificate=certificate,
        domain=where,
        exceptions=proof.exceptions,
    )


def report_while_searching(work: Work, decision: deciding.Decision) -> Progress:
    """The progress callback of a search; a longer search reports that a Lagrangian exists once the
    checker agrees.
    """
    began, question = deadline.now(), decision.question

    def report(stage: Stage) -> None:
        is_known = question in work.told
        if work.options.hand_over is not None and not is_known and deadline.now() - began > AT_ONCE:
            work.told[question] = _not_yet(question)  # once, even if the checker does not agree
            certificate = certify.of_decision(work.analysis, decision, 1, work.options.seed)
            if judged_by_checker(work, certificate).verdict == "valid":
                report_statement(
                    work,
                    Statement(question, "variational", certificate=certificate, checked="valid"),
                )
        work.progress(stage)

    return report


def report_statement(work: Work, answer: Statement) -> None:
    """Hand over a confirmed statement while work continues."""
    found = answer.lagrangian
    work.told[answer.question] = answer = _on_its_set(work, answer)
    is_main = answer.question == work.asked[0]
    other = PLAIN if answer.question.timed else TIMED
    finished = [stages.existence(answer.question), Part.CERTIFICATE]
    # L(q, q') answers both questions, without L(t, q, q') there is no L(q, q'), and one question
    # has both names.
    if (is_main and answer.question.timed) or answer.answers(other):
        finished.append(stages.existence(other))
    if found is not None:
        finished.append(Part.LAGRANGIAN if is_main else Part.LAGRANGIAN_WITH_TIME)
    finished += [Part.HAMILTONIAN] if answer.hamiltonian is not None and is_main else []
    report_parts(work, *finished)


def report_parts(work: Work, *finished: Part) -> None:
    """Report that these parts are finished and checked."""
    if work.options.hand_over is not None:
        work.options.hand_over(finished, lambda: _so_far(work))


def _so_far(work: Work) -> SoFar:
    """The confirmed statements; an undecided question is undetermined."""
    known = tuple(one for one in work.told.values() if one.verdict != "undetermined")
    open_ones = (_not_yet(one) for one in work.asked if implied(one, known) is None)
    statements = (*known, *open_ones)
    return (Solution(work.analysis.system, work.asked, statements, work.printed),), ()


def _not_yet(question: Question) -> Statement:
    return Statement(question, "undetermined", reasons.NOT_YET)


def checker_accepts(work: Work, tree: ex.Expression, question: Question) -> bool:
    """Whether the checker finds the Lagrangian valid; a refused one is logged, counted, and not
    offered again.
    """
    certificate = certify.of_lagrangian(work.analysis, tree, question)
    offered = (certificate["lagrangian"], question)
    if offered in work.refused:
        return False
    found = judged_by_checker(work, certificate)
    if found.verdict != "valid":
        work.refused.add(offered)
        log.info(
            "The checker refused the Lagrangian %s: %s",
            printing.to_text(tree),
            "; ".join(found.reasons),
        )
    return found.verdict == "valid"


def with_hamiltonian(work: Work, answer: Statement, others: Found | None) -> Statement:
    """The answer with the Hamiltonian and the other Lagrangians that the checker confirms."""
    answer = _on_its_set(work, answer)
    assert answer.lagrangian is not None
    report_statement(work, answer)
    began = deadline.now()
    work.progress(Stage("Hamiltonian"))
    names = work.analysis.system.coordinates
    hamiltonian = explaining.hamiltonian_of(
        answer.lagrangian.expression, names, answer.lagrangian.domain.positive
    )
    verified = explaining.verification_steps(work.analysis.system, answer.lagrangian.multiplier)
    steps = (*answer.details, *verified, *explaining.legendre_steps(hamiltonian))
    work.add_seconds("Hamiltonian", began)
    answer = replace(answer, hamiltonian=hamiltonian, details=steps)
    report_statement(work, answer)
    assert answer.lagrangian is not None
    described: list[Lagrangian] = []
    for other in () if others is None else others.lagrangians:
        known = [answer.lagrangian, *described]
        if any(
            is_multiple(one.expression, other, names, work.analysis.real_point) for one in known
        ):
            continue
        why = why_shown(answer.lagrangian.expression, other, names, work.analysis.real_point)
        if (
            why
            and all(why != one.reason for one in described)
            and checker_accepts(work, other, answer.question)
        ):
            described.append(
                replace(describe(work.analysis, other, others.family if others else ""), reason=why)
            )
    return replace(answer, other_lagrangians=tuple(described))


def judged_by_checker(work: Work, certificate: Mapping[str, Any]) -> checker.CheckResult:
    began = deadline.now()
    work.progress(Stage("check"))
    _, found = certify.prove(work.analysis, dict(certificate), deadline.left(work.end, 1.0))
    work.add_seconds("check", began)
    return found


def confirm(work: Work, answer: Statement) -> Statement:
    """The answer with the checker's verdict; undetermined if the checker cannot confirm it."""
    assert answer.certificate is not None
    found = judged_by_checker(work, answer.certificate)
    # Where the branch fixes the sign of an arbitrary function, a checker may draw another sign.
    if found.verdict == "invalid" and not any(
        ex.has(tree, ex.Arbitrary) for tree in work.analysis.system.positive
    ):
        raise errors.CertificateRefused("; ".join(found.reasons))
    if found.verdict != "valid":
        reason = reasons.unconfirmed(answer.verdict, "; ".join(found.reasons))
        if work.left() <= 0:
            work.cut[Part.CERTIFICATE] = reason
        return Statement(answer.question, "undetermined", reason)
    return replace(_on_its_set(work, answer), checked="valid")
