"""The conditions of a case as equations for people."""

from __future__ import annotations

from collections.abc import Sequence

from flint import fmpq_mpoly

from inverse_service.algebra.rational_functions import as_fraction
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import ZERO, Arbitrary, Expression, Symbol, add, multiply, power
from inverse_service.inverse_problem.special_cases.cases import Case
from inverse_service.inverse_problem.special_cases.strata import Stratum

Equation = tuple[Expression, Expression]


def conditions(case: Case) -> list[Equation]:
    """(left, right) of each equation that defines the case: functions first, then parameters."""
    functions = {f.name: f.arguments for f in case.declared if f.name in case.functions}
    found = [_polynomial(name, arguments, case) for name, arguments in functions.items()]
    return found + _of_parameters(case)


def condition_texts(case: Case) -> list[str]:
    """The conditions as texts."""
    return [f"{to_text(left)} = {to_text(right)}" for left, right in conditions(case)]


def equation_texts(stratum: Stratum, equations: Sequence[fmpq_mpoly]) -> list[str]:
    """Polynomial equations as texts."""
    return [f"{to_text(left)} = {to_text(right)}" for left, right in (sides(stratum, e) for e in equations)]


def sides(stratum: Stratum, equation: fmpq_mpoly) -> Equation:
    """The equation with positive terms on both sides; whole numbers without a common factor."""
    content = equation.factor()[0] if not equation.is_zero() else 1
    terms = {exponents: value / content for exponents, value in (equation).terms()}
    owner = equation.context()
    left = owner.from_dict({e: v for e, v in terms.items() if as_fraction(v) > 0})
    right = owner.from_dict({e: -v for e, v in terms.items() if as_fraction(v) < 0})
    if left.is_zero():
        left, right = right, left
    return stratum.space.tree(left), stratum.space.tree(right)


def _polynomial(name: str, arguments: tuple[str, ...], case: Case) -> Equation:
    """A = A_0 for a constant function, A = A_0 + A_1 u for a linear one, and so on."""
    solved = case.stratum.trees()
    constants = list(enumerate(map(Symbol, case.question.constants[name])))
    kept = [(degree, constant) for degree, constant in constants if not degree or solved.get(constant) != ZERO]
    terms = [multiply(constant, power(Symbol(arguments[0]), degree)) for degree, constant in kept]
    return Arbitrary(name, tuple(map(Symbol, arguments)), (0,) * len(arguments)), add(*terms)


def _of_parameters(case: Case) -> list[Equation]:
    """Values of the solved parameters where these are polynomials, else the equations."""
    stratum, hidden = case.stratum, case.hidden
    if not stratum.roots and all(value.denominator.is_constant() for value in stratum.values.values()):
        table = {name: tree for name, tree in stratum.trees().items() if isinstance(name, Symbol)}
        order = [Symbol(name) for name in stratum.space.names if name not in hidden]
        return [(name, table[name]) for name in order if name in table]
    generators = [stratum.space.context.gen(stratum.space.names.index(name)) for name in hidden]
    shown = [e for e in stratum.equations if not any(e == g for g in generators)]
    return [sides(stratum, equation) for equation in shown]
