"""The values of formulas along a trajectory: one numpy operation for each node of the tree."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from inverse_service.errors import InputError
from inverse_service.expressions.functions import RECIPROCALS
from inverse_service.expressions.tree import (
    PI,
    TIME,
    Apply,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
)
from inverse_service.integrators.trajectory import Array

# NumPy's names, where they are not ours.
_NUMPY = {name: f"arc{name[1:]}" for name in ("asin", "acos", "atan", "asinh", "acosh", "atanh")}


def array_function(name: str, values: Any) -> Any:
    below = RECIPROCALS.get(name)
    return 1 / array_function(below, values) if below else getattr(np, _NUMPY.get(name, name))(values)


class NoValue(InputError):
    """A formula holds a name that was given no value."""

    code = "no-value"


def table_of(
    coordinates: tuple[str, ...],
    positions: Array,
    velocities: Array | None,
    values: Mapping[str, float | Array],
    times: Array | None = None,
) -> dict[Expression, Any]:
    """Names to arrays: `positions` and `velocities` are (m, n), each column a coordinate; parameters numbers or (m,).

    `times` (m,) are values of t; left out, t is 0, as at the start.
    """
    table: dict[Expression, Any] = {TIME: 0.0 if times is None else times}
    table |= {Symbol(name): value for name, value in values.items()}
    table |= {Symbol(name): positions[:, k] for k, name in enumerate(coordinates)}
    if velocities is not None:
        table |= {Velocity(name): velocities[:, k] for k, name in enumerate(coordinates)}
    return table


def array_value(expression: Expression, table: Mapping[Expression, Any]) -> Array:
    """The formula at every row of the table, as (m,); nan or infinite where it has no real value.

    Raises NoValue for a name or an arbitrary function that the table does not hold.
    """
    sizes = [np.shape(value) for value in table.values() if np.ndim(value)]
    with np.errstate(all="ignore"):
        value = _value(expression, dict(table))
    return np.broadcast_to(np.asarray(value, dtype=float), sizes[0] if sizes else (1,))


def _value(expression: Expression, known: dict[Expression, Any]) -> Any:
    if expression not in known:
        known[expression] = _computed(expression, known)
    return known[expression]


def _computed(expression: Expression, known: dict[Expression, Any]) -> Any:
    match expression:
        case Number(value):
            return float(value)
        case Sum(terms):
            return sum(_value(term, known) for term in terms)
        case Product(factors):
            product: Any = 1.0
            for factor in factors:
                product = product * _value(factor, known)
            return product
        case Power(base, exponent):
            return _power(_value(base, known), exponent, known)
        case Apply(function, argument):
            return array_function(function, _value(argument, known))
        case _ if expression == PI:
            return np.pi
        case _:
            raise NoValue(f"a formula has no value here: {getattr(expression, 'name', 'a name')} is not given.")


def _power(base: Any, exponent: Expression, known: dict[Expression, Any]) -> Any:
    if isinstance(exponent, Number) and exponent.value.denominator == 1 and abs(exponent.value) <= 8:
        whole = int(exponent.value)
        product = np.asarray(base, dtype=float) ** abs(whole)
        return product if whole >= 0 else 1 / product
    if isinstance(exponent, Number) and exponent.value.denominator == 2 and abs(exponent.value.numerator) == 1:
        root = np.sqrt(base)
        return root if exponent.value > 0 else 1 / root
    return np.power(np.asarray(base, dtype=float), _value(exponent, known))
