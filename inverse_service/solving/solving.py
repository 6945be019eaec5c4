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
from typing import TYPE_CHECKING, Any, TypeVar

from inverse_service import bounds, deadline, errors
from inverse_service.certificate import checker, formulas
from inverse_service.decision import certify, deciding
from inverse_service.decision.solutions import (
    AllIntegrals,
    Answer,
    Conditions,
    Lagrangian,
    Left,
    Solution,
    SolveOptions,
    Step,
)
from inverse_service.explanation import explaining
from inverse_service.expressions import collecting, notation, printing, tree as ex
from inverse_service.field import real_branch, tower
from inverse_service.linear_pde import involution
from inverse_service.mechanics import second_order_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search import antiderivatives, row_factors, terms, tidy
from inverse_service.search.tidy import Found, SearchOutcome, describe, is_multiple, why_shown
from inverse_service.solving import beyond
from inverse_service.statements import parts, reasons
from inverse_service.statements.parts import Part
from inverse_service.statements.stages import DECISION, Progress, Stage

if TYPE_CHECKING:
    from inverse_service.decision.solutions import SoFar
    from inverse_service.mechanics.first_integrals import FirstIntegral
# The share of the time after the decision that the search for a closed form may use.
_SEARCH_SHARE = 0.5
# The shares of the remaining time for the decision on the first of two questions, and for factors
# of the equations as written.
_SHARE_OF_FIRST, _SHARE_AS_GIVEN = 0.6, 0.3
AS_GIVEN = "the equations as given"
# The seconds, and the share of the time, that first integrals may use.
_FOR_INTEGRALS, _FOR_ALL_INTEGRALS, _SHARE_FOR_INTEGRALS = 1.0, 3.0, 0.1
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
OPEN = Answer("undetermined", reasons.NOT_YET)  # for a question that is not yet decided
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
                Left(tuple(map(collecting.collect, each.positive)), None, reasons.NOT_YET)
                for each in waiting
            )
            known = tuple(solutions)
            told((), lambda: (known, open_ones))
        return found, sides_of(found)

    _, open_cells = cell_by_cell(system, answer, end)
    for found in solutions:
        for one in (found.autonomous, found.with_time):
            if one is not None and one.one_side and one.certificate is not None:
                analysis = deciding.analyze(found.system)
                other = other_part(analysis, one.certificate, one.sides, end)
                if other is not None:
                    open_cells.append(Left(sides_of(found), other[0], reasons.UNCONNECTED))
                    break
    is_alone = len(solutions) == 1 and not open_cells
    for found in solutions:
        main = found.first(options.time_dependent)
        if main is not None:
            sides = () if is_alone else sides_of(found)
            open_cells += beyond.left_out(found.system, main, sides, options.given)
    return tuple(solutions), tuple(open_cells)


def sides_of(solution: Solution) -> tuple[ex.Expression, ...]:
    """The trees that are positive on the cell of an answer and on whose signs its proofs depend."""
    answers = [one for one in (solution.autonomous, solution.with_time) if one is not None]
    sides = [
        *map(collecting.collect, solution.system.positive),
        *(side for one in answers for side in one.sides),
    ]
    return tuple(dict.fromkeys(sides))


def cell_by_cell(
    system: SecondOrderSystem,
    answer: Callable[
        [SecondOrderSystem, Sequence[SecondOrderSystem]],
        tuple[Result, Sequence[ex.Expression]],
    ],
    end: float = math.inf,
) -> tuple[list[Result], list[Left]]:
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
            left.append(Left(tuple(map(collecting.collect, cell.positive)), point_of(cell), reason))
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
        Left(tuple(map(collecting.collect, one.positive)), None, reasons.NO_POINT)
        for one in unreached
    ]
    return found, left + (_in_no_cell(system, known_sides) if system.branch is None else [])


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
            or any(real_branch.are_positive(one.positive, point) for one in found)
        ):
            continue
        found.append(Left(beyond.positive, point, reasons.IN_NO_CELL))
    return found


def other_part(
    analysis: deciding.Analysis,
    certificate: Mapping[str, Any],
    sides: Sequence[ex.Expression],
    end: float,
    wanted: Sequence[str] = ("invalid", "incomplete"),
) -> tuple[real_branch.RealTable, checker.CheckResult] | None:
    """Repeat the check of a claim at points on other connected parts of its cell, where all `sides`
    are > 0.

    The point with the wanted verdict and the checker's result; earlier entries of `wanted` take
    precedence. None if no tried point has such a verdict.
    """
    found = dict[str, tuple[real_branch.RealTable, checker.CheckResult]]()
    for point in (one for seed in _OTHER_POINTS for one in _points(analysis.system, seed)):
        if (
            wanted[0] not in found
            and real_branch.are_positive(sides, point)
            and deadline.now() < end
        ):
            moved = {**certificate, "near": certify.moved_to(certificate["near"], point)}
            proof = certify.proved(
                replace(analysis, real_point=point), moved, deadline.left(end, 1.0)
            )[1]
            found.setdefault(proof.verdict, (point, proof))
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
    system, answers = solution.system, (solution.autonomous, solution.with_time)

    def lacks_reasons(answer: Answer | None) -> bool:
        return answer is not None and answer.verdict == "not_variational" and not answer.explanation

    if not any(map(lacks_reasons, answers)):
        return solution
    with notation.multiplier_beside(system.names.declared()):
        work = Work(deciding.analyze(system), options, progress or (lambda _: None), math.inf)

        def explained(answer: Answer, with_time: bool) -> Answer:
            if not lacks_reasons(answer):
                return answer
            return _explained(_with_its_reasons(work, answer, with_time), system)

        autonomous, with_time = _changed(answers, explained)
    return replace(solution, autonomous=autonomous, with_time=with_time)


def _changed(
    answers: tuple[Answer | None, Answer | None], change: Callable[[Answer, bool], Answer]
) -> tuple[Answer | None, Answer | None]:
    """`change` of each answer and its `with_time`; an answer to both questions is changed once and
    stays one object.
    """
    autonomous, with_time = answers
    plain = None if autonomous is None or autonomous is with_time else change(autonomous, False)
    timed = None if with_time is None else change(with_time, True)
    return timed if autonomous is with_time else plain, timed


def _solve(system: SecondOrderSystem, options: SolveOptions, progress: Progress | None) -> Solution:
    began = deadline.now()
    system = second_order_system.branches_of(system)[0]
    if max(len(printing.to_text(tree)) for tree in system.accelerations) > formulas.MAX_TEXT:
        return _unreduced(system, options, None, reasons.too_long(formulas.MAX_TEXT))
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
    given = None if _is_excluded(work) else _as_given(work)
    began = deadline.now()
    work.printed, left_out = _conditions(system, options, report)
    work.add_seconds("conditions", began)
    hand_over(work, Part.CONDITIONS)
    autonomous, with_time = _changed(
        _answers(work, given), lambda answer, _: _explained(answer, system)
    )
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
    kept, complete = _all_integrals(work, _first_integrals(work, autonomous, with_time))
    provenance["seconds"] = {stage: round(value, 3) for stage, value in work.seconds.items()}
    return Solution(
        system, autonomous, with_time, work.printed, provenance, work.cut, kept, complete
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


def _first_integrals(work: Work, *answers: Answer | None) -> tuple[FirstIntegral, ...]:
    """The first integrals, from the Lagrangian if there is one, otherwise from the equations
    alone.
    """
    system = work.analysis.system
    if not work.options.first_integrals or system.is_unsolved:
        return ()
    from inverse_service.mechanics.first_integrals import first_integrals, motion_of

    began = deadline.now()
    work.progress(Stage("first integrals"))
    known = next(
        (one.lagrangian for one in answers if one is not None and one.lagrangian is not None), None
    )
    limit = min(_FOR_INTEGRALS, _SHARE_FOR_INTEGRALS * work.options.time_limit, work.left())
    tree = None if known is None else second_order_system.on_branch(known.expression, system)
    found = first_integrals(motion_of(system), tree, work.options.seed, limit)
    work.add_seconds("first integrals", began)
    return found


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
    limit = min(_FOR_ALL_INTEGRALS, _SHARE_FOR_INTEGRALS * work.options.time_limit, work.left())
    every = with_higher(work.analysis, found, work.options.seed, limit)
    work.add_seconds("first integrals", began)
    return every


def _unreduced(
    system: SecondOrderSystem, options: SolveOptions, found: Conditions | None, reason: reasons.Open
) -> Solution:
    answer = Answer(
        "undetermined", reason, positive=tuple(map(collecting.collect, system.positive))
    )
    autonomous, with_time = (
        answer if asked else None for asked in deciding.questions(options.time_dependent, system)
    )
    return Solution(system, autonomous, with_time, found, {"seed": options.seed})


def _answers(work: Work, given: Answer | None) -> tuple[Answer | None, Answer | None]:
    """(L(q, v), L(t, q, v)); an autonomous Lagrangian, as the `given` one can be, answers the
    second question too.
    """
    wants_plain, wants_time = deciding.questions(work.options.time_dependent, work.analysis.system)
    if given is not None and not _holds_time(given):
        return given if wants_plain else None, given if wants_time else None
    if given is not None:
        return _answer(work, _decide(work, with_time=False)) if wants_plain else None, given
    first = _decide(work, with_time=False) if wants_plain else None
    if first is not None and first.verdict == "not_variational" and wants_time:
        timed = _decide(work, with_time=True, order=first.order)
        both = _negative(work, timed) if timed.verdict == "not_variational" else None
        if both is not None and both.verdict == "not_variational":
            return both, both  # one proof
    autonomous = None if first is None else _answer(work, first)
    if not wants_time:
        return autonomous, None
    if autonomous is not None and autonomous.verdict == "variational":
        plain = (
            _is_complete(autonomous)
            and ex.reading_class(_expression(autonomous), ex.TIME) < _RATIONAL
        )
        with_time = autonomous if plain else _with_time_instead(work, autonomous)
        same = _without_time(work, with_time) if with_time is not autonomous else None
        return (same, same) if same is not None else (autonomous, with_time)
    return autonomous, _answer(work, _decide(work, with_time=True))


def _is_excluded(work: Work) -> bool:
    """Whether accelerations that do not come from the document, such as those of a reduced system,
    have no Lagrangian.

    Factors of written lines cannot help then, and the decision is needed anyway to count the
    freedom.
    """
    system, options = work.analysis.system, work.options
    if options.given or system.is_unsolved or len(system.coordinates) > explaining.MOST_COORDINATES:
        return False
    with_time = deciding.questions(options.time_dependent, system)[1]
    return _decide(work, with_time, _SHARE_AS_GIVEN).verdict == "not_variational"


def _as_given(work: Work) -> Answer | None:
    """The answer from factors of the equations as written, by preference without t; requires no
    decision.
    """
    system, table = work.analysis.system, work.analysis.real_point
    began = deadline.now()
    work.progress(Stage("the equations as given"))
    written = tuple(
        second_order_system.on_branch(equation, system) for equation in work.options.given
    )
    wants_time = deciding.questions(work.options.time_dependent, system)[1]
    best: ex.Expression | None = None
    with (
        suppress(deadline.OutOfTime),
        deadline.until(deadline.now() + _SHARE_AS_GIVEN * work.left()),
    ):
        for integral_signs in (False, True):
            for tree in row_factors.lagrangians_of_lines(system, written, table, integral_signs):
                if ex.holds(tree, ex.TIME) and (best is not None or not wants_time):
                    continue
                real = tree if table is None else antiderivatives.real_form(tree, table)
                forms = dict.fromkeys((tidy.tidied(real, system), real, tree))
                best = next(
                    (form for form in forms if is_confirmed(work, form, ex.holds(form, ex.TIME))),
                    best,
                )
                if best is not None and not ex.holds(best, ex.TIME):
                    break
            if best is not None:
                break
    work.add_seconds("search", began)
    if best is None:
        return None
    with_time = ex.holds(best, ex.TIME)
    short = not (system.is_unsolved or len(system.coordinates) > explaining.MOST_COORDINATES)
    short = short and sum(map(ex.node_count, system.accelerations)) <= bounds.TERMS
    decision = _decide(work, with_time, _SHARE_AS_GIVEN, _MOST_FOR_FREEDOM) if short else None
    found = explaining.of_lagrangian(
        work.analysis, with_time, best, AS_GIVEN, explaining.as_given_steps(), decision
    )
    return completed(work, replace(found, checked="valid"), None, with_time)


def _holds_time(answer: Answer) -> bool:
    return answer.lagrangian is not None and ex.holds(answer.lagrangian.expression, ex.TIME)


def _explained(answer: Answer, system: SecondOrderSystem) -> Answer:
    """The answer with a note on ambiguous names, and with the set where it holds if it has an
    explanation.
    """
    answer = explaining.with_shared_letters(answer, system)
    if not answer.explanation:
        return answer
    steps = explaining.branch_steps(system, answer.positive, answer.nonzero)
    known, found = {*answer.positive, *answer.nonzero}, answer.lagrangian
    if (
        len(system.coordinates) == 1
        and found
        and not known.issuperset((*found.positive, *found.nonzero))
    ):
        steps += (
            explaining.of_one_coordinate(system.coordinates[0], _holds_time(answer), is_found=True),
        )
    return replace(answer, explanation=(*steps, *answer.explanation))


def _is_complete(answer: Answer) -> bool:
    """Whether the answer has a Lagrangian and a Hamiltonian in closed form."""
    return (
        answer.lagrangian is not None
        and answer.hamiltonian is not None
        and not answer.hamiltonian.transform.implicit
    )


def _with_time_instead(work: Work, autonomous: Answer) -> Answer:
    """If L(q, v) was not found, has no closed H, or is hard to read: a better L(t, q, v), if there
    is one.
    """
    from inverse_service.search import families

    system, known = work.analysis.system, work.analysis.proposals
    found = (
        autonomous.lagrangian is not None and len(system.coordinates) > 1 and "material" in known
    )
    if families.excludes_factor_of_time(system) or (
        found and not families.has_factors_of_time(known["material"])
    ):
        return autonomous  # without a factor e^(ct), the search would be the same
    decision = _decide(work, with_time=True)
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
    return answer


def _highest(autonomous: Answer) -> float:
    """The cost up to which to search for a better L(t, q, v); the large rows of several velocities
    have found none.
    """
    if autonomous.lagrangian is None:
        return math.inf
    one = len(autonomous.lagrangian.multiplier) == 1
    return _QUICK if _is_complete(autonomous) else math.inf if one else _FAIR


def _expression(answer: Answer) -> ex.Expression:
    assert answer.lagrangian is not None
    return answer.lagrangian.expression


def _without_time(work: Work, answer: Answer) -> Answer | None:
    """The answer to the question for L(q, v) if the search for L(t, q, v) found a Lagrangian
    without t.
    """
    if answer.lagrangian is None or _holds_time(answer) or work.autonomous is None:
        return None
    found = _proposed(work, work.autonomous, answer.lagrangian.expression)
    if check(work, found.certificate or {}).verdict != "valid":
        return None
    return completed(work, replace(found, checked="valid"), None, with_time=False)


def _answer(work: Work, decision: deciding.Decision) -> Answer:
    work.autonomous = work.autonomous if decision.with_time else decision
    if decision.verdict == "undetermined":
        if decision.open is not None and decision.open.reason is reasons.Reason.TIME:
            work.cut[parts.existence(decision.with_time)] = decision.open
        return Answer("undetermined", decision.open)
    if decision.verdict == "not_variational":
        return _negative(work, decision)
    return _by_lagrangian(work, decision) or confirmed(work, _by_existence(work, decision))


def _decide(
    work: Work,
    with_time: bool,
    part: float | None = None,
    unknowns: int = involution.MOST_UNKNOWNS,
    order: int = involution.Limits().order,
) -> deciding.Decision:
    if work.analysis.system.is_unsolved:
        return deciding.Decision("undetermined", with_time, 0, reasons.UNSOLVED)
    if with_time in work.decided:
        return work.decided[with_time]
    stage = Stage(DECISION, timed=with_time)
    work.progress(stage)
    is_first = (
        not with_time and work.options.time_dependent is None
    )  # the other question needs time, too
    limit = deadline.share(part or (_SHARE_OF_FIRST if is_first else 1.0), work.end)
    limits = involution.Limits(order, limit, unknowns)
    decision = deciding.decide(
        work.analysis.system,
        with_time,
        work.options.seed,
        limits,
        work.progress,
        analysis=work.analysis,
    )
    work.seconds[stage.kind] = decision.seconds
    work.points.extend(decision.points)
    if decision.verdict != "undetermined":
        work.decided[with_time] = decision
    return decision


def _negative(work: Work, decision: deciding.Decision) -> Answer:
    """The answer no with the proof that the checker confirms, and then the proof in sentences."""
    certificate = certify.of_decision(work.analysis, decision)
    answer = confirmed(work, Answer("not_variational", certificate=certificate))
    if answer.verdict == "undetermined":
        return answer
    tell(work, answer, decision.with_time)
    return _with_its_reasons(work, answer, decision.with_time) if work.options.reasons else answer


def _with_its_reasons(work: Work, answer: Answer, with_time: bool) -> Answer:
    began = deadline.now()
    work.progress(Stage("explanation"))
    try:
        steps = _reasons(work, with_time)
    except errors.IrreducibleAtoms as problem:
        steps = (
            explaining.said(
                f"The conditions could not be printed: {problem.detail}.".replace("`", "")
            ),
        )
    work.add_seconds("explanation", began)
    return replace(answer, explanation=steps)


def _reasons(work: Work, with_time: bool) -> tuple[Step, ...]:
    """Why there is no Lagrangian; algebraic conditions exclude L with and without t alike and are
    explained once.
    """
    from inverse_service.explanation.hierarchy import smallest_sufficient_set
    from inverse_service.explanation.negative import explain_negative

    if work.explained:
        return work.explained
    chosen = smallest_sufficient_set(work.analysis, work.options.seed)
    steps = explain_negative(work.analysis, chosen, with_time, work.options.seed)
    if chosen is not None:
        work.explained = steps
    return steps


def _by_existence(work: Work, decision: deciding.Decision) -> Answer:
    certificate = certify.of_decision(
        work.analysis, decision, work.options.series_order, work.options.seed
    )
    series = explaining.series_steps(work.analysis, decision, work.options.series_order)
    steps, known = (
        (explaining.not_found(work.analysis.system, decision.space), *series),
        explaining.existence_steps(decision),
    )
    if len(work.analysis.system.coordinates) == 1:
        name = work.analysis.system.coordinates[0]
        steps = (explaining.of_one_coordinate(name, decision.with_time, is_found=False),)
        known = (explaining.not_found(work.analysis.system, decision.space), *series)
    return Answer(
        "variational",
        space=decision.space,
        certificate=certificate,
        explanation=steps,
        details=known,
    )


def _by_lagrangian(
    work: Work,
    decision: deciding.Decision,
    highest: float = math.inf,
    wanted: Callable[[ex.Expression], bool] = lambda _: True,
) -> Answer | None:
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
    return completed(
        work, answer, replace(found, lagrangians=found.lagrangians[1:]), decision.with_time
    )


def _as_written(work: Work, decision: deciding.Decision, tree: ex.Expression) -> ex.Expression:
    """The confirmed multiple of L with the masses and roots of the equations as written if there is
    one, else L.
    """
    system = work.analysis.system
    given = tuple(
        second_order_system.on_branch(equation, system) for equation in work.options.given
    )
    multiple = row_factors.with_written_masses(tree, system, given)
    form = tree if multiple is None else tidy.tidied(multiple, system)
    with suppress(terms.TooManyTerms):
        form = tidy.with_written_roots(form, system, work.analysis.real_point or {}) or form
    return form if form != tree and is_confirmed(work, form, decision.with_time) else tree


def _proposed(work: Work, decision: deciding.Decision, tree: ex.Expression) -> Answer:
    assert work.outcome is not None
    assert work.outcome.found is not None
    how = explaining.search_steps(work.outcome)
    return explaining.of_lagrangian(
        work.analysis, decision.with_time, tree, work.outcome.found.family, how, decision
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
            decision.with_time,
            work.options.seed,
            telling(work, decision),
            work.options.ansatz,
            lambda tree: is_confirmed(work, tree, decision.with_time),
            highest,
        )
    work.add_seconds("search", began + work.seconds.get("check", 0.0) - checked)
    if outcome.found is None and deadline.now() >= limit:
        work.cut[parts.lagrangian(decision.with_time)] = reasons.SEARCH_EXPIRED
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
    decided: dict[bool, deciding.Decision] = field(default_factory=dict)  # by `with_time`
    outcome: SearchOutcome | None = None
    autonomous: deciding.Decision | None = None
    explained: tuple[Step, ...] = ()
    refused: set[tuple[str, bool]] = field(default_factory=set)
    began: float = field(default_factory=deadline.now)
    # The conditions written out, the confirmed answer to each question (with t: True), and the
    # parts for which the time limit expired.
    printed: Conditions | None = None
    answers: dict[bool, Answer] = field(default_factory=dict)
    cut: dict[Part, reasons.Open] = field(default_factory=dict)

    def add_seconds(self, stage: str, began: float) -> None:
        self.seconds[stage] = self.seconds.get(stage, 0.0) + deadline.now() - began

    def left(self) -> float:
        return self.end - deadline.now()


def _on_its_set(work: Work, answer: Answer) -> Answer:
    """The answer, with the set on which the checker proved it."""
    if answer.certificate is None:
        return answer
    certificate, proof = certify.proved(
        work.analysis, dict(answer.certificate), deadline.left(work.end, 1.0)
    )
    where = certify.where_of(proof.cell, certify.names_of(certificate["system"], certificate))
    return replace(
        answer,
        certificate=certificate,
        positive=where.positive,
        nonzero=where.nonzero,
        sides=where.sides,
        one_side=where.one_side,
        exceptions=proof.exceptions,
    )


def telling(work: Work, decision: deciding.Decision) -> Progress:
    """The progress callback of a search; a longer search reports that a Lagrangian exists once the
    checker agrees.
    """
    began = deadline.now()

    def report(stage: Stage) -> None:
        is_known = decision.with_time in work.answers
        if work.options.hand_over is not None and not is_known and deadline.now() - began > AT_ONCE:
            work.answers[decision.with_time] = OPEN  # only once, even if the checker does not agree
            certificate = certify.of_decision(work.analysis, decision, 1, work.options.seed)
            if check(work, certificate).verdict == "valid":
                tell(
                    work,
                    Answer("variational", certificate=certificate, checked="valid"),
                    decision.with_time,
                )
        work.progress(stage)

    return report


def tell(work: Work, answer: Answer, with_time: bool) -> None:
    """Hand over a confirmed answer while work continues."""
    found = answer.lagrangian
    work.answers[with_time] = answer = _on_its_set(work, answer)
    is_main = (
        with_time is not deciding.questions(work.options.time_dependent, work.analysis.system)[0]
    )
    finished = [parts.existence(with_time), Part.CERTIFICATE]
    # L(q, q') answers both questions, without L(t, q, q') there is no L(q, q'), and one question
    # has both names.
    if with_time is (answer.verdict == "not_variational") or (with_time and is_main):
        finished.append(parts.existence(not with_time))
    finished += [parts.lagrangian(not is_main)] if found is not None else []
    finished += [Part.HAMILTONIAN] if answer.hamiltonian is not None and is_main else []
    hand_over(work, *finished)


def hand_over(work: Work, *finished: Part) -> None:
    """Report that these parts are finished and checked."""
    if work.options.hand_over is not None:
        work.options.hand_over(finished, lambda: _so_far(work))


def _so_far(work: Work) -> SoFar:
    """The confirmed answers; an undecided question is undetermined."""
    system = work.analysis.system
    wants_plain, wants_time = deciding.questions(work.options.time_dependent, system)
    autonomous = work.answers.get(False, OPEN) if wants_plain else None
    with_time = work.answers.get(True, OPEN) if wants_time else None
    if autonomous is not None and with_time is not None:
        if autonomous.verdict == "variational" and with_time.lagrangian is None:
            with_time = autonomous
        elif with_time.verdict == "not_variational" and autonomous.verdict == "undetermined":
            autonomous = with_time
    return (Solution(system, autonomous, with_time, work.printed),), ()


def is_confirmed(work: Work, tree: ex.Expression, with_time: bool) -> bool:
    """Whether the checker finds the Lagrangian valid; a refused one is logged, counted, and not
    offered again.
    """
    certificate = certify.of_lagrangian(work.analysis, tree, with_time)
    offered = (certificate["lagrangian"], with_time)
    if offered in work.refused:
        return False
    found = check(work, certificate)
    if found.verdict != "valid":
        work.refused.add(offered)
        log.info(
            "The checker refused the Lagrangian %s: %s",
            printing.to_text(tree),
            "; ".join(found.reasons),
        )
    return found.verdict == "valid"


def completed(work: Work, answer: Answer, others: Found | None, with_time: bool) -> Answer:
    """The answer with the Hamiltonian and the other Lagrangians that the checker confirms."""
    answer = _on_its_set(work, answer)
    assert answer.lagrangian is not None
    tell(work, answer, with_time)
    began = deadline.now()
    work.progress(Stage("Hamiltonian"))
    names = work.analysis.system.coordinates
    hamiltonian = explaining.hamiltonian_of(
        answer.lagrangian.expression, names, answer.lagrangian.positive
    )
    verified = explaining.verification_steps(work.analysis.system, answer.lagrangian.multiplier)
    steps = (*answer.details, *verified, *explaining.legendre_steps(hamiltonian))
    work.add_seconds("Hamiltonian", began)
    answer = replace(answer, hamiltonian=hamiltonian, details=steps)
    tell(work, answer, with_time)
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
            and is_confirmed(work, other, with_time)
        ):
            described.append(
                replace(describe(work.analysis, other, others.family if others else ""), reason=why)
            )
    return replace(answer, other_lagrangians=tuple(described))


def check(work: Work, certificate: Mapping[str, Any]) -> checker.CheckResult:
    began = deadline.now()
    work.progress(Stage("check"))
    _, found = certify.proved(work.analysis, dict(certificate), deadline.left(work.end, 1.0))
    work.add_seconds("check", began)
    return found


def confirmed(work: Work, answer: Answer) -> Answer:
    """The answer with the checker's verdict; undetermined if the checker cannot confirm it."""
    assert answer.certificate is not None
    found = check(work, answer.certificate)
    # Where the branch fixes the sign of an arbitrary function, a checker may draw another sign.
    if found.verdict == "invalid" and not any(
        ex.has(tree, ex.Arbitrary) for tree in work.analysis.system.positive
    ):
        raise errors.CertificateRefused("; ".join(found.reasons))
    if found.verdict != "valid":
        reason = reasons.unconfirmed(answer.verdict, "; ".join(found.reasons))
        if work.left() <= 0:
            work.cut[Part.CERTIFICATE] = reason
        return Answer("undetermined", reason)
    return replace(_on_its_set(work, answer), checked="valid")
