"""The tree of special cases: the generic case, then each case in which the verdict may change.

`decide` decides each case on the system with the case's values substituted; the side conditions of the verdict lead to
smaller cases. A case whose verdicts equal those of the smallest kept cases containing it is implied and not listed. The
tree is complete when every case is decided: its verdicts are valid on the whole case except for the cases below it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from flint import fmpq, fmpq_mpoly

from inverse_service import bounds, errors
from inverse_service.deadline import now, until
from inverse_service.decision import deciding
from inverse_service.decision.solutions import Verdict
from inverse_service.explanation import hierarchy
from inverse_service.expressions import printing, tree as ex
from inverse_service.field import exact_field
from inverse_service.linear_pde.involution import Limits
from inverse_service.mechanics import second_order_system
from inverse_service.mechanics.conditions import motion_in_ring
from inverse_service.solving import side_conditions, strata
from inverse_service.solving.strata import ParameterSpace, Stratum

MOST_CASES = 120
DEEPEST = 8
Progress = Callable[[str], None]
# The names of the functions that are polynomials: linear if they have one argument, otherwise constant.
FunctionCase = frozenset[str]
_EXACT_SECONDS, _SEARCH_SECONDS, _DEPTH = 3.0, 6.0, 2
UNDEFINED = "undefined"
_DIFFERENTIAL = "the {} depends on differential conditions with unknown side conditions"
_DOUBTFUL = "the functions of f that contain parameters may become dependent for other values"
_WITHOUT_LAGRANGIAN = "variational by an existence proof alone; no closed form shows for which values this may fail"
Equation = tuple[ex.Expression, ex.Expression]


@dataclass(frozen=True)
class Node:
    """A kept case with the kept cases inside it whose verdicts differ."""

    case: Case
    children: tuple[Node, ...] = ()


@dataclass(frozen=True)
class SpecialCases:
    """The tree, the cases examined, and the open questions."""

    question: Question
    root: Node
    examined: tuple[Case, ...]
    reasons: tuple[str, ...]
    complete_with_time: bool

    @property
    def complete(self) -> bool:
        """Whether no unlisted case has a different verdict on any question asked."""
        return not self.reasons


@dataclass(slots=True)
class _Exploration:
    """The cases found so far, and those still waiting with their depth."""

    question: Question
    waiting: list[tuple[Stratum, FunctionCase, int]]
    seen: list[tuple[Stratum, FunctionCase]]
    cases: list[Case] = field(default_factory=list)
    # Open questions and where they occur; whether they concern L(q, v) only.
    reasons: list[tuple[str, str]] = field(default_factory=list)
    time_is_open: bool = False


def special_cases(
    system: second_order_system.SecondOrderSystem,
    time_dependent: bool | None,
    deadline: float = float("inf"),
    progress: Progress | None = None,
    seed: int = 1,
    most: int = MOST_CASES,
) -> SpecialCases:
    """The tree of cases in which the system is, or is not, variational.

    `time_dependent` is as in `SolveOptions`. At most `most` cases are examined, until `deadline` (`now`); the reasons
    name what is omitted.
    """
    constants = _constants(system)
    space = ParameterSpace((*system.parameters, *itertools.chain.from_iterable(constants.values())))
    question = Question(system, space, constants, time_dependent, seed, deadline, progress or (lambda _: None))
    starts = _starts(question)
    work = _Exploration(question, [(s, f, 0) for s, f in starts], list(starts))
    _advance(work)  # the generic case is examined regardless of the limits
    while work.waiting and not _stopped(work, most):
        _advance(work)
    root = _tree(question, work.cases)
    return SpecialCases(question, root, tuple(work.cases), tuple(_grouped(work.reasons)), not work.time_is_open)


def _grouped(reasons: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Each reason once, with the first of its cases."""
    table: dict[str, list[str]] = {}
    for text, where in reasons:
        table.setdefault(text, []).append(where)
    for text, places in table.items():
        named = [place for place in places if place]
        others = f" and {len(named) - 1} more" if len(named) > 1 else ""
        yield f"{text} ({named[0]}{others})" if named else text


def _constants(system: second_order_system.SecondOrderSystem) -> dict[str, tuple[str, ...]]:
    """For each function that occurs, unused names for its polynomial coefficients."""
    occurring = {node.name for f in system.accelerations for node in ex.walk(f) if isinstance(node, ex.Arbitrary)}
    used = {*system.parameters, *system.coordinates}
    found: dict[str, tuple[str, ...]] = {}
    for name, arguments in system.functions:
        if name in occurring:
            stem = name + "_"
            while any(f"{stem}{k}" in used for k in range(3)):
                stem += "_"
            degree = (2 if len(occurring) == 1 else 1) if len(arguments) == 1 else 0
            found[name] = tuple(f"{stem}{k}" for k in range(degree + 1))
    return found


def _starts(question: Question) -> list[tuple[Stratum, FunctionCase]]:
    """Every combination of arbitrary and polynomial functions; high degrees before low ones."""
    names = list(question.constants)
    found = []
    for size in range(len(names) + 1):
        for chosen in itertools.combinations(names, size):
            functions = frozenset(chosen)
            plain = _unused(question, functions)
            lengths = [range(len(question.constants[name]), 0, -1) for name in chosen]
            for kept in itertools.product(*lengths):
                zero = [c for name, k in zip(chosen, kept, strict=True) for c in question.constants[name][k:]]
                generators = [*map(question.space.generator, [*plain, *zero])]
                found.append((strata.split(question.space, generators)[0], functions))
    return found


def _unused(question: Question, functions: FunctionCase) -> list[str]:
    """The coefficients of functions that remain arbitrary; they are not parameters of the case and are set to zero."""
    return [c for name, constants in question.constants.items() if name not in functions for c in constants]


def _stopped(work: _Exploration, most: int) -> bool:
    over = now() > work.question.deadline
    if len(work.cases) < most and not over:
        return False
    work.time_is_open = True
    limit = "the time limit" if over else f"the limit of {most} cases"
    work.reasons.append((f"{limit} came with {len(work.waiting)} cases not yet examined", ""))
    return True


def _advance(work: _Exploration) -> None:
    """Examine the next case; breadth first, so that large cases come before the small ones inside them."""
    stratum, functions, depth = work.waiting.pop(0)
    work.question.progress(f"special cases: {len(work.cases)} examined, {len(work.waiting)} waiting")
    if stratum.unsolved:
        work.time_is_open = True
        text = ", ".join(equation_text(sides(stratum, one)) for one in stratum.unsolved)
        work.reasons.append((f"not solved for a parameter: {text}", ""))
        return
    case = examine(work.question, stratum, functions)
    if case.unsettled == UNDEFINED and work.cases:
        return
    work.cases.append(case)
    reasons = _reasons(case)
    work.reasons += reasons
    work.time_is_open |= bool(reasons[case.time_settled :])
    inner = _inside(work.question, case)
    if inner and depth == DEEPEST:
        work.time_is_open = True
        work.reasons.append((f"there are more cases beyond the depth {DEEPEST}", _where(case)))
        return
    for piece in inner:
        if not any(functions == f and piece.contains(s) and s.contains(piece) for s, f in work.seen):
            work.seen.append((piece, functions))
            work.waiting.append((piece, functions, depth + 1))


def _inside(question: Question, case: Case) -> list[Stratum]:
    """The parts of a case on which a divisor vanishes."""
    stratum, space = case.stratum, question.space
    ideals = [ideal.polynomials for ideal in case.ideals if ideal.polynomials]
    ideals += [(factor,) for factor in stratum.excluded]
    if case.unsettled:
        occurring = {node.name for f in case.system.accelerations for node in ex.walk(f) if isinstance(node, ex.Symbol)}
        ideals += [(space.generator(name),) for name in stratum.free if name in occurring]
    found = [strata.split(space, [*stratum.equations, *polynomials]) for polynomials in ideals]
    return [inner for pieces in found for inner in pieces if not inner.contains(stratum)]


def _reasons(case: Case) -> list[tuple[str, str]]:
    """Why parts of a case are undecided; reasons that concern L(q, v) only come first."""
    about = "for L(q, q') alone: " if case.time_settled else ""
    found = [(f"{about}{case.unsettled}", _where(case))] if case.unsettled else []
    for ideal in case.ideals:
        if ideal.functional and not any(_is_covered(case.question, tree) for tree in ideal.functional):
            found.append((f"not examined where {_together(ideal.functional)}", _where(case)))
    return found


def _together(trees: Sequence[ex.Expression]) -> str:
    """The equations as one sentence; only the first one if they are long."""
    texts = sorted((f"{printing.to_text(tree)} = 0" for tree in trees), key=len)
    whole = " and ".join(texts)
    if len(whole) <= bounds.SHOWN:
        return whole
    shown = texts[0] if len(texts[0]) <= bounds.SHOWN else "a long condition on the functions holds"
    return shown if len(texts) == 1 else f"{shown} and {len(texts) - 1} more equations hold with it"


def _is_covered(question: Question, tree: ex.Expression) -> bool:
    """Whether the tree vanishes only for polynomials with degrees that are separate cases."""
    match tree:
        case ex.Product(parts):
            return all(isinstance(part, ex.Number) or _is_covered(question, part) for part in parts)
        case ex.Power(base, ex.Number()):
            return _is_covered(question, base)
        case ex.Arbitrary(name, _, orders):
            return len(orders) == 1 and orders[0] <= len(question.constants.get(name, ()))
    return False


def _where(case: Case) -> str:
    texts = [*map(equation_text, conditions(case))]
    return "in general" if not texts else "where " + ", ".join(texts)


def _tree(question: Question, cases: Sequence[Case]) -> Node:
    """The tree of the cases whose verdicts differ from those of the smallest kept cases that contain them."""
    kept: list[Case] = []
    parents: list[int] = []
    for case in sorted(cases, key=lambda c: (len(c.functions), -c.stratum.dimension)):
        around = [k for k, other in enumerate(kept) if _contains(question, other, case)]
        smallest = [k for k in around if not any(k != m and _contains(question, kept[k], kept[m]) for m in around)]
        other = [k for k in smallest if kept[k].verdicts != case.verdicts]
        if not smallest or other:
            kept.append(case)
            parents.append(other[0] if other else -1)
    return _node(kept, parents, 0)


def _node(kept: Sequence[Case], parents: Sequence[int], place: int) -> Node:
    inner = [k for k, parent in enumerate(parents) if parent == place]
    return Node(kept[place], tuple(_node(kept, parents, k) for k in inner))


def _contains(question: Question, large: Case, small: Case) -> bool:
    """Whether the small case is part of the closure of the large one."""
    equations = _without(large.stratum, _unused(question, large.functions))
    whole = replace(large.stratum, equations=tuple(equations))
    return large.functions <= small.functions and whole.contains(small.stratum)


def _without(stratum: Stratum, names: Iterable[str]) -> list[fmpq_mpoly]:
    """The equations of a stratum except those that set one of these names to 0."""
    generators = [*map(stratum.space.generator, names)]
    return [e for e in stratum.equations if not any(e == g for g in generators)]


# One case: a set of parameter values, the system there, its verdicts, and where the verdicts may change.


@dataclass(frozen=True)
class Question:
    """The system with symbols, the question, the random seed, and the deadline (`now`).

    `constants` names the polynomial coefficients of each function; they are in `space`.
    """

    system: second_order_system.SecondOrderSystem
    space: ParameterSpace
    constants: Mapping[str, tuple[str, ...]]
    time_dependent: bool | None
    seed: int
    deadline: float
    progress: Progress


@dataclass(frozen=True)
class Case:
    """The system on a stratum with its verdicts for L(q, v) and L(t, q, v); None where not asked.

    `ideals` say where a verdict may change within the case. If `unsettled` is empty, it changes nowhere else; otherwise
    `unsettled` says what is unknown (with `time_settled`, about L(q, v) only).
    """

    question: Question
    stratum: Stratum
    functions: FunctionCase
    system: second_order_system.SecondOrderSystem
    autonomous: Verdict | None
    with_time: Verdict | None
    statement: str = ""
    reason: str = ""
    ideals: tuple[side_conditions.Ideal, ...] = ()
    unsettled: str = ""
    time_settled: bool = False

    @property
    def hidden(self) -> frozenset[str]:
        """The coefficients that are not parameters of the case: of arbitrary functions, and slopes of constants."""
        constants = self.question.constants
        unused = {c for name, found in constants.items() if name not in self.functions for c in found}
        return frozenset(unused | {c for found in constants.values() for c in found[1:]})

    @property
    def verdicts(self) -> tuple[Verdict | None, Verdict | None]:
        return self.autonomous, self.with_time


def specialised(question: Question, stratum: Stratum, functions: FunctionCase) -> second_order_system.SecondOrderSystem:
    """The system with the values of the stratum and the polynomials substituted."""
    system, polynomials = question.system, {name: question.constants[name] for name in functions}
    forces = tuple(_with_polynomials(f, polynomials) for f in system.accelerations)
    kept = tuple(function for function in system.functions if function[0] not in functions)
    whole = replace(system, accelerations=forces, parameters=stratum.space.names, functions=kept, branch=None)
    return second_order_system.with_values(whole, stratum.trees())


def _with_polynomials(tree: ex.Expression, polynomials: Mapping[str, tuple[str, ...]]) -> ex.Expression:
    if isinstance(tree, ex.Arbitrary) and tree.name in polynomials:
        return _polynomial(tree, [ex.Symbol(name) for name in polynomials[tree.name]])
    return ex.rebuild(tree, lambda part: _with_polynomials(part, polynomials)) if polynomials else tree


def _polynomial(node: ex.Arbitrary, constants: Sequence[ex.Symbol]) -> ex.Expression:
    """A_0 + A_1 u + A_2 u^2 with one term per constant, or a derivative of it."""
    order = sum(node.orders)
    if order and len(node.arguments) > 1:
        return ex.ZERO
    terms = []
    for degree, constant in enumerate(constants):
        if degree >= order:
            falling = ex.number(math.perm(degree, order))
            terms.append(falling * constant * node.arguments[0] ** (degree - order))
    return ex.add(*terms)


def examine(question: Question, stratum: Stratum, functions: FunctionCase) -> Case:
    """Decide the system on a stratum, and find where its verdict may change."""
    system = specialised(question, stratum, functions)
    try:
        if any(_has_no_value(node) for f in system.accelerations for node in ex.walk(f)):
            raise ZeroDivisionError
        motion_in_ring(system, 0, exact_field.Budget())  # raises an error for a division by zero
        analysis = deciding.analyze(system)
        case = _decided(question, analysis, Case(question, stratum, functions, system, None, None))
    except errors.IrreducibleAtoms as problem:
        reason = unsettled = problem.detail
    except exact_field.TooLarge as problem:
        reason = unsettled = str(problem)
    except ZeroDivisionError:
        reason, unsettled = "the equations have no value here", UNDEFINED
    else:
        return _with_ideals(question, analysis, case) if system.parameters or system.functions else case
    unknown: Verdict = "undetermined"
    autonomous, with_time = (
        unknown if asked else None for asked in deciding.questions(question.time_dependent, system)
    )
    return Case(question, stratum, functions, system, autonomous, with_time, reason=reason, unsettled=unsettled)


def _has_no_value(node: ex.Expression) -> bool:
    """Whether this is 1/0, a root of a negative number, or the logarithm of a number that is not positive."""
    match node:
        case ex.Power(ex.Number(base), ex.Number(exponent)):
            return (base == 0 and exponent < 0) or (base < 0 and exponent.denominator % 2 == 0)
        case ex.Apply("log", ex.Number(value)):
            return value <= 0
    return False


def _decided(question: Question, analysis: deciding.Analysis, case: Case) -> Case:
    """The case with the requested verdicts; an L(q, v) is also an L(t, q, v)."""
    limits = Limits(deadline=question.deadline)
    wants_plain, wants_time = deciding.questions(question.time_dependent, analysis.system)
    found = dict[bool, deciding.Decision]()
    for timed in [False] * wants_plain + [True] * wants_time:
        if False not in found or found[False].verdict != "variational":
            found[timed] = deciding.decide(analysis.system, timed, question.seed, limits, analysis=analysis)
    made = found.values()
    return replace(
        case,
        autonomous=found[False].verdict if wants_plain else None,
        with_time=(found.get(True) or found[False]).verdict if wants_time else None,
        statement=next((one.space.statement for one in made if one.space is not None), ""),
        reason=next((one.reason for one in made if one.reason), ""),
    )


def _with_ideals(question: Question, analysis: deciding.Analysis, case: Case) -> Case:
    asked = [verdict for verdict in case.verdicts if verdict is not None]
    if "undetermined" in asked:
        return replace(case, ideals=_of_rank(question, analysis), unsettled=case.reason or "undetermined")
    if set(asked) == {"not_variational"}:
        return _negative(question, analysis, case)
    if "not_variational" not in asked and side_conditions.has_one_everywhere(analysis.system):
        return replace(case, time_settled=True)
    ideals = list(_of_rank(question, analysis))
    sure = {False: False, True: False}
    if case.autonomous == "variational":
        more, sure[False] = _positive(question, analysis, with_time=False)
        ideals += more
    if case.with_time == "variational" and not sure[False]:
        more, sure[True] = _positive(question, analysis, with_time=True)
        ideals += more
    settled = sure[case.autonomous is None] or (sure[False] and case.autonomous == "variational")
    text = _WITHOUT_LAGRANGIAN if case.autonomous != "not_variational" else _DIFFERENTIAL.format("verdict on L(q, q')")
    return replace(case, ideals=tuple(ideals), unsettled="" if settled else text, time_settled=sure[True])


def _budget(question: Question) -> exact_field.Budget:
    return exact_field.Budget(bounds.TERMS, min(question.deadline, now() + _EXACT_SECONDS))


def _negative(question: Question, analysis: deciding.Analysis, case: Case) -> Case:
    """The case with the divisors of the elimination that proves the no, or else those of all algebraic conditions."""
    try:
        chosen = hierarchy.smallest_sufficient_set(analysis, question.seed)
        if chosen is not None:
            found = side_conditions.of_conditions(
                analysis, question.space, chosen.equations, _budget(question), question.seed
            )
            return replace(case, ideals=found.ideals, unsettled=_DOUBTFUL if found.doubtful else "")
    except (exact_field.TooLarge, errors.IrreducibleAtoms) as problem:
        detail = f"the side conditions could not be computed: {problem}"
        return replace(case, ideals=_of_rank(question, analysis), unsettled=detail)
    return replace(case, ideals=_of_rank(question, analysis), unsettled=_DIFFERENTIAL.format("negative verdict"))


def _of_rank(question: Question, analysis: deciding.Analysis) -> tuple[side_conditions.Ideal, ...]:
    """Where the algebraic conditions allow more multipliers than at generic values."""
    try:
        names = side_conditions.all_conditions(analysis, _DEPTH, question.seed)
        return side_conditions.of_conditions(analysis, question.space, names, _budget(question), question.seed).ideals
    except (exact_field.TooLarge, ZeroDivisionError, errors.IrreducibleAtoms):
        return ()


def _positive(
    question: Question, analysis: deciding.Analysis, with_time: bool
) -> tuple[Sequence[side_conditions.Ideal], bool]:
    """The ideals of a Lagrangian with symbols, and whether they are complete; (), False if none is found."""
    from inverse_service.search.ladder import search

    with until(min(question.deadline, now() + _SEARCH_SECONDS)):
        outcome = search(analysis, with_time, question.seed, lambda _: None)
    if outcome.found is None:
        return (), False
    try:
        found = side_conditions.regularity(
            analysis.system, outcome.found.lagrangians[0], question.space, _budget(question)
        )
    except (exact_field.TooLarge, ZeroDivisionError, KeyError):
        return (), False
    return found.ideals, not found.doubtful


def conditions(case: Case) -> list[Equation]:
    """(left, right) of each equation that defines the case: functions first, then parameters."""
    functions = [function for function in case.question.system.functions if function[0] in case.functions]
    return [_polynomial_conditions(*function, case) for function in functions] + _of_parameters(case)


def equation_text(equation: Equation, write: Callable[[ex.Expression], str] = printing.to_text) -> str:
    """left = right."""
    return " = ".join(map(write, equation))


def sides(stratum: Stratum, equation: fmpq_mpoly) -> Equation:
    """The equation with positive terms on both sides and integer coefficients without a common factor."""
    content = fmpq(*exact_field.factor_polynomial(equation)[0].as_integer_ratio()) if not equation.is_zero() else 1
    terms = {exponents: value / content for exponents, value in (equation).terms()}
    owner = equation.context()
    left = owner.from_dict({e: v for e, v in terms.items() if exact_field.as_fraction(v) > 0})
    right = owner.from_dict({e: -v for e, v in terms.items() if exact_field.as_fraction(v) < 0})
    if left.is_zero():
        left, right = right, left
    return stratum.space.tree(left), stratum.space.tree(right)


def _polynomial_conditions(name: str, arguments: tuple[str, ...], case: Case) -> Equation:
    """A = A_0 for a constant function, A = A_0 + A_1 u for a linear one, and so on."""
    solved = case.stratum.trees()
    constants = list(enumerate(map(ex.Symbol, case.question.constants[name])))
    kept = [(degree, constant) for degree, constant in constants if not degree or solved.get(constant) != ex.ZERO]
    terms = [constant * ex.Symbol(arguments[0]) ** degree for degree, constant in kept]
    return ex.Arbitrary(name, tuple(map(ex.Symbol, arguments)), (0,) * len(arguments)), ex.add(*terms)


def _of_parameters(case: Case) -> list[Equation]:
    """The values of the solved parameters if these are polynomials, else the equations."""
    stratum, hidden = case.stratum, case.hidden
    if not stratum.roots and not any(value.exponents for value in stratum.values.values()):
        table = {name: tree for name, tree in stratum.trees().items() if isinstance(name, ex.Symbol)}
        order = [ex.Symbol(name) for name in stratum.space.names if name not in hidden]
        return [(name, table[name]) for name in order if name in table]
    return [sides(stratum, equation) for equation in _without(stratum, hidden)]
