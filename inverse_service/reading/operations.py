"""Operations on trees while a formula is parsed, each within the limits: numbers that are too long,
powers without a real value, and trees that are too deep are refused at a column.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce

from inverse_service import errors
from inverse_service.expressions import calculus, printing, refusals, tree as ex
from inverse_service.expressions.refusals import LIMITS, at_most, fault, limit_passed, refusal
from inverse_service.reading import names as nm

_BITS_PER_DIGIT = 3.3219280948873626
EXPONENTIAL = ex.Apply("exp", ex.ONE)
OF_SECOND_ORDER = (
    "write equations of second order. Those of a Lagrangian L(t, q, q') have no higher derivatives"
)


def checked(value: Fraction, column: int) -> Fraction:
    """The number; LimitError for too many digits, so that every accepted formula can be parsed
    again.
    """
    if max(abs(value.numerator), value.denominator) >= 10**LIMITS.digits:
        raise limit_passed(
            "a number that is computed here has too many digits", column, LIMITS.digits
        )
    return value


def product(factors: Sequence[ex.Expression], column: int) -> ex.Expression:
    """The product; LimitError if its coefficient becomes too long at any step."""
    reduce(
        lambda total, factor: checked(total * ex.coefficient(factor), column), factors, Fraction(1)
    )
    return ex.multiply(*factors)


def sum_of(terms: Sequence[ex.Expression], column: int) -> ex.Expression:
    """The sum; LimitError if its constant becomes too long at any step."""
    parts = [
        part for term in terms for part in (term.terms if isinstance(term, ex.Sum) else (term,))
    ]
    numbers = [part.value for part in parts if isinstance(part, ex.Number)]
    reduce(lambda total, number: checked(total + number, column), numbers, Fraction(0))
    found = ex.add(*terms)
    if printing.keeps_order() and isinstance(found, ex.Sum):
        return _with_number_in_place(found, parts)
    return found


def _with_number_in_place(total: ex.Sum, parts: Sequence[ex.Expression]) -> ex.Sum:
    """The sum of the parts with its number where the first of them stands."""
    *terms, last = total.terms
    if not isinstance(last, ex.Number):
        return total
    place = next(place for place, part in enumerate(parts) if isinstance(part, ex.Number))
    return ex.Sum((*terms[:place], last, *terms[place:]))


def reciprocal(expression: ex.Expression, column: int) -> ex.Expression:
    """1/u; InputError if u is the number 0."""
    if expression == ex.Number(Fraction(0)):
        raise fault("division by zero", column)
    return expression**-1


def raised(base: ex.Expression, exponent: ex.Expression, column: int) -> ex.Expression:
    """base ^ exponent, with e^u as exp(u); InputError or LimitError if it is too large or has no
    real value.
    """
    if base == EXPONENTIAL:
        return ex.Apply("exp", exponent)
    if isinstance(base, ex.Number) and base.value < 0 and not isinstance(exponent, ex.Number):
        raise fault("symbolic power of a negative number", column)
    if isinstance(exponent, ex.Number):
        _check_exponent(exponent.value, column)
        if isinstance(base, ex.Number):
            _check_numbers(base.value, exponent.value, column)
    result = base**exponent
    checked(ex.coefficient(result), column)
    if isinstance(result, ex.Power) and isinstance(result.exponent, ex.Number):
        _check_exponent(result.exponent.value, column)
    return result


def _check_exponent(exponent: Fraction, column: int) -> None:
    if abs(exponent.numerator) > LIMITS.exponent or exponent.denominator > LIMITS.exponent:
        instead = f"the limit is {LIMITS.exponent:,}; declare a parameter and write it in its place"
        raise refusal("the exponent is too large", column, instead, kind=errors.LimitError)


def _check_numbers(base: Fraction, exponent: Fraction, column: int) -> None:
    if base == 0 and exponent <= 0:
        raise fault("power of zero", column)
    if base < 0 and exponent.denominator != 1:
        base, sign = -base, "-" if exponent.numerator % 2 else ""
        root = f"write {sign}{base if base.denominator == 1 else f'({base})'}^({exponent})"
        instead = root if exponent.denominator % 2 else "write another base or exponent"
        raise fault("power of a negative number", column, instead=instead)
    bits = max(base.numerator.bit_length(), base.denominator.bit_length()) - 1
    if (
        bits * float(abs(exponent)) > LIMITS.digits * _BITS_PER_DIGIT
    ):  # known before the power is computed
        raise limit_passed(
            "a number that is computed here has too many digits", column, LIMITS.digits
        )


def check_depth(expression: ex.Expression, column: int = 1) -> ex.Expression:
    """The same tree; LimitError if it is deeper than `limits.depth`."""
    level, depth = [expression], 0
    while level:
        depth += 1
        at_most(depth, LIMITS.depth, "the formula is nested too deeply", column)
        # A part that occurs many times, as definitions do, is walked once a level.
        level = list(dict.fromkeys(part for node in level for part in ex.children(node)))
    return expression


def check_size(expression: ex.Expression) -> ex.Expression:
    """The same tree, into which definitions were put; LimitError if it is larger or deeper than
    what may be typed.
    """
    parts, most = ex.node_count(expression), refusals.most_characters()
    at_most(parts, most, "the formula with its definitions put in has too many parts", 1)
    return check_depth(expression)


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of differentiation, the order, and the column."""

    node: ex.Expression
    times: int
    column: int


def carry_out(
    expression: ex.Expression, variables: Sequence[Variable], names: nm.Names
) -> ex.Expression:
    """The derivative: along the motion (x -> x' -> x'') if the variable is t, otherwise partial."""
    order = sum(variable.times for variable in variables)
    at_most(order, LIMITS.derivative_order, "a derivative is too high", variables[0].column)
    expression = _defined(expression, variables, names)
    for variable in variables:
        for _ in range(variable.times):
            expression = _once(expression, variable, names)
    return expression


def _defined(
    expression: ex.Expression, variables: Sequence[Variable], names: nm.Names
) -> ex.Expression:
    """The operand with the formulas of its names substituted; InputError for the derivative of a
    constant.
    """
    for variable in variables:
        if isinstance(variable.node, ex.Symbol) and variable.node in names.definitions:
            raise fault("derivative by a defined name", variable.column, name=variable.node.name)
    others = {*names.definitions, *(variable.node for variable in variables)}
    if (
        isinstance(expression, ex.Symbol)
        and expression.name in names.parameters
        and expression not in others
    ):
        raise fault("derivative of a constant", variables[0].column, name=expression.name)
    return ex.substitute(expression, dict(names.definitions)) if names.definitions else expression


def _once(expression: ex.Expression, variable: Variable, names: nm.Names) -> ex.Expression:
    nodes = ex.node_count(expression)
    at_most(
        nodes, LIMITS.derivative_nodes, "the formula to differentiate is too large", variable.column
    )
    if variable.node != ex.TIME:
        return check_depth(calculus.differentiate(expression, variable.node), variable.column)
    try:
        return check_depth(
            calculus.differentiate_in_time(expression, names.coordinates), variable.column
        )
    except ValueError:
        raise fault("third derivative", variable.column, instead=OF_SECOND_ORDER) from None


def refuse_two_meanings(function: ex.Arbitrary, column: int, names: nm.Names) -> None:
    """InputError for the derivative of V(t, x) by t, which may be partial or along the motion; not
    for that of P(n, t) with a constant n, where these agree.
    """
    moving = map(ex.Symbol, names.coordinates)
    if ex.TIME not in function.arguments or not (
        ex.holds(function, *moving) or ex.has(function, ex.Velocity)
    ):
        return
    orders = ",".join(str(int(argument == ex.TIME)) for argument in function.arguments)
    arguments = ", ".join(node.name for node in function.arguments if isinstance(node, ex.Symbol))
    raise fault(
        "partial or total derivative",
        column,
        name=function.name,
        orders=orders,
        arguments=arguments,
    )
