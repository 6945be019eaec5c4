"""diff(…) and Derivative(…) in formulas, carried out on the tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from inverse_service.errors import InputError
from inverse_service.expressions.checked import check_depth
from inverse_service.expressions.derivative import differentiate, differentiate_in_time
from inverse_service.expressions.limits import Limits
from inverse_service.expressions.names import Names
from inverse_service.expressions.tokens import limit_passed, refusal
from inverse_service.expressions.tree import TIME, Expression, walk


@dataclass(frozen=True, slots=True)
class Variable:
    """What is differentiated by, how many times, and where that stands."""

    node: Expression
    times: int
    column: int


def carry_out(expression: Expression, variables: Sequence[Variable], names: Names, limits: Limits) -> Expression:
    """The derivative; by t it is the one along the motion (x -> x' -> x''), else a partial one."""
    if sum(variable.times for variable in variables) > limits.derivative_order:
        raise limit_passed("a derivative is too high", variables[0].column, limits.derivative_order)
    for variable in variables:
        for _ in range(variable.times):
            expression = _once(expression, variable, names, limits)
    return expression


def _once(expression: Expression, variable: Variable, names: Names, limits: Limits) -> Expression:
    if sum(1 for _ in walk(expression)) > limits.derivative_nodes:
        raise limit_passed("the formula to differentiate is too large", variable.column, limits.derivative_nodes)
    if variable.node != TIME:
        result = differentiate(expression, variable.node)
    else:
        result = _along_motion(expression, variable, names)
    return check_depth(result, limits, variable.column)


def _along_motion(expression: Expression, variable: Variable, names: Names) -> Expression:
    try:
        return differentiate_in_time(expression, names.coordinates)
    except ValueError:
        raise _third(variable.column) from None


def _third(column: int) -> InputError:
    return refusal("a third derivative stands", column, "write equations of second order")
