"""An equation as c_1 x_1'' + … + c_n x_n'' + rest = 0."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from inverse_service.errors import InputError
from inverse_service.expressions.tree import (
    ONE,
    ZERO,
    Acceleration,
    Expression,
    Product,
    Sum,
    add,
    multiply,
    walk,
)


@dataclass(frozen=True, slots=True)
class LinearEquation:
    """Coefficient of each coordinate's acceleration (missing: 0) and what is left; `pointer` is its place."""

    coefficients: Mapping[str, Expression]
    rest: Expression
    pointer: str = ""


def linear_equation(residual: Expression, pointer: str = "") -> LinearEquation:
    """The parts of residual = 0; InputError where an acceleration enters otherwise than linearly."""
    coefficients, rest = _parts(residual, pointer)
    return LinearEquation(coefficients, rest, pointer)


def has_acceleration(expression: Expression) -> bool:
    return any(isinstance(node, Acceleration) for node in walk(expression))


def _parts(expression: Expression, pointer: str) -> tuple[dict[str, Expression], Expression]:
    if not has_acceleration(expression):
        return {}, expression
    match expression:
        case Acceleration(coordinate):
            return {coordinate: ONE}, ZERO
        case Sum(terms):
            return _parts_of_sum(terms, pointer)
        case Product(factors):
            return _parts_of_product(factors, pointer)
        case _:
            raise _nonlinear(expression, pointer)


def _parts_of_sum(terms: tuple[Expression, ...], pointer: str) -> tuple[dict[str, Expression], Expression]:
    collected: dict[str, list[Expression]] = {}
    rests = []
    for term in terms:
        coefficients, rest = _parts(term, pointer)
        rests.append(rest)
        for coordinate, coefficient in coefficients.items():
            collected.setdefault(coordinate, []).append(coefficient)
    return {coordinate: add(*found) for coordinate, found in collected.items()}, add(*rests)


def _parts_of_product(factors: tuple[Expression, ...], pointer: str) -> tuple[dict[str, Expression], Expression]:
    holders = [factor for factor in factors if has_acceleration(factor)]
    if len(holders) != 1:
        raise _nonlinear(Product(factors), pointer)
    others = [factor for factor in factors if factor is not holders[0]]
    coefficients, rest = _parts(holders[0], pointer)
    scaled = {coordinate: multiply(*others, found) for coordinate, found in coefficients.items()}
    return scaled, multiply(*others, rest)


def _nonlinear(expression: Expression, pointer: str) -> InputError:
    name = next(node.coordinate for node in walk(expression) if isinstance(node, Acceleration))
    return InputError(
        f"the acceleration {name}'' does not enter linearly: write the equation solved for {name}''; "
        f"an index stands below its name, as in {name}_2.",
        pointer,
    )
