"""Values of parameters, put in exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from inverse_service.errors import InputError
from inverse_service.expressions.names import Names, declared_name
from inverse_service.expressions.reader import read_formula
from inverse_service.expressions.tree import (
    Apply,
    Expression,
    Number,
    Power,
    Symbol,
    substitute,
    walk,
)
from inverse_service.expressions.vocabulary import check_domain

ParameterValue = str | int | float | None


def parameter_values(parameters: Sequence[str] | Mapping[str, ParameterValue]) -> dict[str, Expression]:
    """The values given, as trees; a parameter without a value (None) stays generic and is left out.

    A value is a number or a constant such as "1/2", "sqrt(2)" or "2*pi"; a float stands for its
    shortest decimal form. InputError with the pointer of the parameter for anything else.
    """
    if not isinstance(parameters, Mapping):
        return {}
    values = {}
    for name, value in parameters.items():
        pointer = "/parameters/" + name.replace("~", "~0").replace("/", "~1")
        if value is not None:
            values[declared_name(name, pointer, "parameter")] = _constant(value, pointer)
    return values


def _constant(value: str | int | float, pointer: str) -> Expression:
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise InputError('the value of a parameter is not a number: write it as in "1/2".', pointer)
    text = value if isinstance(value, str) else repr(value) if isinstance(value, float) else _digits(value, pointer)
    try:
        return read_formula(text, Names(time=False))
    except InputError as error:
        if "is not declared" in error.detail:
            detail = 'the value of a parameter holds a name that is not declared: write a number as in "1/2" or "2*pi".'
            raise InputError(detail, pointer, error.column) from None
        raise error.at(pointer) from None


def _digits(value: int, pointer: str) -> str:
    if value.bit_length() > 4_000:  # str of a huge integer is slow, and refused by Python
        raise InputError("the value of a parameter has too many digits: write a smaller number.", pointer)
    return str(value)


def with_values(expression: Expression, values: Mapping[str, Expression]) -> Expression:
    """The tree with the values put in; InputError where it then has no value (1/0, log of 0)."""
    if not values:
        return expression
    result = substitute(expression, {Symbol(name): value for name, value in values.items()})
    for node in walk(result):
        _check_defined(node)
    return result


def _check_defined(node: Expression) -> None:
    match node:
        case Power(Number(base), Number(exponent)):
            undefined = (base == 0 and exponent < 0) or (base < 0 and exponent.denominator != 1)
        case Apply(function, argument):
            try:
                check_domain(function, argument, 1)
                undefined = False
            except InputError:
                undefined = True
        case _:
            undefined = False
    if undefined:
        raise InputError(
            "with these values of the parameters a formula has no real value (a division by zero, a root or a "
            "logarithm): give other values.",
            "/parameters",
        )
