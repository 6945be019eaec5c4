"""One case: a set of parameter values, the system there, its verdicts, and where these may change."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from flint import fmpq, fmpq_mpoly

from inverse_service import bounds, errors
from inverse_service.deadline import now, until
from inverse_service.decision import deciding
from inverse_service.decision.solutions import Verdict
from inverse_service.explanation import hierarchy
from inverse_service.expressions import collecting, printing
from inverse_service.expressions import tree as ex
from inverse_service.field import exact_field
from inverse_service.linear_pde.involution import Limits
from inverse_service.mechanics.conditions import motion_in_ring
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.solving.special_cases import side_conditions
from inverse_service.solving.special_cases.strata import ParameterSpace, Stratum

Progress = Callable[[str], None]
# Names of the functions that are polynomials: linear ones of one argument, else constants.
FunctionCase = frozenset[str]

_EXACT_SECONDS, _SEARCH_SECONDS, _DEPTH = 3.0, 6.0, 2
UNDEFINED = "undefined"
_DIFFERENTIAL = "the {} rests on differential conditions, whose side conditions are not known"
_DOUBTFUL = "the functions of f that contain parameters may become dependent for further values"
_WITHOUT_LAGRANGIAN = "variational by existence alone, no closed form shows for which values this may fail"


@dataclass(frozen=True)
class Question:
    """The system with letters, what is asked, the random numbers, and when to stop (`now`).

    `constants` names the coefficients of each function where it is a polynomial; they are in `space`.
    """

    system: SecondOrderSystem
    space: ParameterSpace
    constants: Mapping[str, tuple[str, ...]]
    time_dependent: bool | None
    seed: int
    deadline: float
    progress: Progress


@dataclass(frozen=True)
class Case:
    """The system on a stratum with its verdicts for L(q, v) and L(t, q, v); None where not asked.

    `ideals` say where a verdict may change within the case; where `unsettled` is empty nowhere else,
    else it says what is not known, with `time_settled` of L(q, v) alone.
    """

    question: Question
    stratum: Stratum
    functions: FunctionCase
    system: SecondOrderSystem
    autonomous: Verdict | None
    with_time: Verdict | None
    statement: str = ""
    reason: str = ""
    ideals: tuple[side_conditions.Ideal, ...] = ()
    unsettled: str = ""
    time_settled: bool = False

    @property
    def hidden(self) -> frozenset[str]:
        """Coefficients that are no parameters of the case: of arbitrary functions, and slopes of constants."""
        constants = self.question.constants
        unused = {c for name, found in constants.items() if name not in self.functions for c in found}
        return frozenset(unused | {c for found in constants.values() for c in found[1:]})

    @property
    def verdicts(self) -> tuple[Verdict | None, Verdict | None]:
        return self.autonomous, self.with_time


def specialised(question: Question, stratum: Stratum, functions: FunctionCase) -> SecondOrderSystem:
    """The system with the values of the stratum and the polynomials for the functions put in."""
    table = stratum.trees()
    polynomials = {name: question.constants[name] for name in functions}
    accelerations = tuple(
        collecting.collect(ex.substitute(_with_polynomials(f, polynomials), table))
        for f in question.system.accelerations
    )
    kept = tuple(function for function in question.system.functions if function[0] not in functions)
    return replace(question.system, accelerations=accelerations, parameters=stratum.free, functions=kept, branch=None)


def _with_polynomials(tree: ex.Expression, polynomials: Mapping[str, tuple[str, ...]]) -> ex.Expression:
    if isinstance(tree, ex.Arbitrary) and tree.name in polynomials:
        return _polynomial(tree, [ex.Symbol(name) for name in polynomials[tree.name]])
    return ex.rebuild(tree, lambda part: _with_polynomials(part, polynomials)) if polynomials else tree


def _polynomial(node: ex.Arbitrary, constants: Sequence[ex.Symbol]) -> ex.Expression:
    """A_0 + A_1 u + A_2 u^2 with as many terms as there are constants, or a derivative of it."""
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
    """Decide the system on a stratum and find where its verdict may change."""
    system = specialised(question, stratum, functions)
    try:
        if any(_has_no_value(node) for f in system.accelerations for node in ex.walk(f)):
            raise ZeroDivisionError
        motion_in_ring(system, 0, exact_field.Budget())  # refuses a division by zero
        analysis = deciding.analyze(system)
        case = _decided(question, analysis, Case(question, stratum, functions, system, None, None))
    except errors.IrreducibleAtoms as problem:
        return Case(question, stratum, functions, system, *_undetermined(question), reason=problem.detail,
                    unsettled=problem.detail)  # fmt: skip
    except exact_field.TooLarge as problem:
        return Case(question, stratum, functions, system, *_undetermined(question), reason=str(problem),
                    unsettled=str(problem))  # fmt: skip
    except ZeroDivisionError:
        detail = "the equations have no value here"
        return Case(question, stratum, functions, system, *_undetermined(question), reason=detail, unsettled=UNDEFINED)
    if not system.parameters and not system.functions:
        return case
    return _with_ideals(question, analysis, case)


def _has_no_value(node: ex.Expression) -> bool:
    """1/0, a root of a negative number, or the logarithm of a number that is not positive."""
    match node:
        case ex.Power(ex.Number(base), ex.Number(exponent)):
            return (base == 0 and exponent < 0) or (base < 0 and exponent.denominator % 2 == 0)
        case ex.Apply("log", ex.Number(value)):
            return value <= 0
    return False


def _undetermined(question: Question) -> tuple[Verdict | None, Verdict | None]:
    return (
        None if question.time_dependent is True else "undetermined",
        None if question.time_dependent is False else "undetermined",
    )


def _decided(question: Question, analysis: deciding.Analysis, case: Case) -> Case:
    """Both verdicts as far as asked; an L(q, v) is an L(t, q, v)."""
    limits = Limits(deadline=question.deadline)
    depends = analysis.system.depends_on_time
    wants_time = question.time_dependent is not False or depends
    autonomous: Verdict | None = None
    with_time: Verdict | None = None
    statement = reason = ""
    if question.time_dependent is not True and not depends:
        decision = deciding.decide(analysis.system, False, question.seed, limits, analysis=analysis)
        autonomous = decision.verdict
        statement, reason = "" if decision.space is None else decision.space.statement, decision.reason
        if decision.verdict == "variational" and wants_time:
            with_time = "variational"
    if wants_time and with_time is None:
        decision = deciding.decide(analysis.system, True, question.seed, limits, analysis=analysis)
        with_time = decision.verdict
        statement = statement or ("" if decision.space is None else decision.space.statement)
        reason = reason or decision.reason
    return replace(case, autonomous=autonomous, with_time=with_time, statement=statement, reason=reason)


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
    """The divisors of the elimination that proves it; without one, those of all algebraic conditions."""
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
    """Where the algebraic conditions leave more multipliers than at generic values."""
    try:
        names = side_conditions.all_conditions(analysis, _DEPTH, question.seed)
        return side_conditions.of_conditions(analysis, question.space, names, _budget(question), question.seed).ideals
    except (exact_field.TooLarge, ZeroDivisionError, errors.IrreducibleAtoms):
        return ()


def _positive(
    question: Question, analysis: deciding.Analysis, with_time: bool
) -> tuple[Sequence[side_conditions.Ideal], bool]:
    """The ideals of a Lagrangian with letters, and whether they are all; (), False where none is found."""
    from inverse_service.search.ladder import search

    with until(min(question.deadline, now() + _SEARCH_SECONDS)):
        outcome = search(analysis, with_time, question.seed, question.deadline, lambda _: None)
    if outcome.found is None:
        return (), False
    try:
        found = side_conditions.regularity(
            analysis.system, outcome.found.lagrangians[0], question.space, _budget(question)
        )
    except (exact_field.TooLarge, ZeroDivisionError, KeyError):
        return (), False
    return found.ideals, found.proved


Equation = tuple[ex.Expression, ex.Expression]


def conditions(case: Case) -> list[Equation]:
    """(left, right) of each equation that defines the case: functions first, then parameters."""
    functions = [function for function in case.question.system.functions if function[0] in case.functions]
    return [_polynomial_conditions(*function, case) for function in functions] + _of_parameters(case)


def condition_texts(case: Case) -> list[str]:
    """The conditions as texts."""
    return [f"{printing.to_text(left)} = {printing.to_text(right)}" for left, right in conditions(case)]


def equation_texts(stratum: Stratum, equations: Sequence[fmpq_mpoly]) -> list[str]:
    """Polynomial equations as texts."""
    return [
        f"{printing.to_text(left)} = {printing.to_text(right)}"
        for left, right in (sides(stratum, e) for e in equations)
    ]


def sides(stratum: Stratum, equation: fmpq_mpoly) -> Equation:
    """The equation with positive terms on both sides; integers without a common factor."""
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
    """Values of the solved parameters where these are polynomials, else the equations."""
    stratum, hidden = case.stratum, case.hidden
    if not stratum.roots and all(value.denominator.is_constant() for value in stratum.values.values()):
        table = {name: tree for name, tree in stratum.trees().items() if isinstance(name, ex.Symbol)}
        order = [ex.Symbol(name) for name in stratum.space.names if name not in hidden]
        return [(name, table[name]) for name in order if name in table]
    generators = [stratum.space.context.gen(stratum.space.names.index(name)) for name in hidden]
    shown = [e for e in stratum.equations if not any(e == g for g in generators)]
    return [sides(stratum, equation) for equation in shown]
