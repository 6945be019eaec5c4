"""Trees as symengine expressions with generated names.

No name of a user reaches symengine: coordinate i is q{i}, its velocity v{i}, its momentum p{i},
parameter j c{j}.
"""

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import symengine

from inverse_service import errors
from inverse_service.expressions import functions, tree as ex

Formula = Any  # symengine has no types
HALF = symengine.Rational(1, 2)
_INFINITE = (symengine.zoo, symengine.oo, -symengine.oo, symengine.nan)


def symbol(name: str) -> Formula:
    return symengine.Symbol(name)


def number(value: int | float) -> Formula:
    return symengine.Integer(value) if isinstance(value, int) else symengine.RealDouble(value)


ZERO, ONE = number(0), number(1)
_FAR_BELOW = number(1e-300)
STEP, ALPHA = symbol("h"), symbol("a")
WHOLE_STEP = symbol(
    "whole"
)  # from one point of the grid to the next, in kernels that choose their steps


def table_of_leaves(
    coordinates: Sequence[str], parameters: Sequence[str]
) -> dict[ex.Expression, Formula]:
    """The table of leaves: Symbol and Velocity of each coordinate, Symbol("p_x"), Symbol of each
    parameter.
    """
    table: dict[ex.Expression, Formula] = {ex.PI: symengine.pi}
    for place, name in enumerate(parameters):
        table[ex.Symbol(name)] = symbol(f"c{place}")
    for place, name in enumerate(coordinates):
        table[ex.Symbol(f"p_{name}")] = symbol(f"p{place}")
    for place, name in enumerate(coordinates):
        table[ex.Symbol(name)] = symbol(f"q{place}")
        table[ex.Velocity(name)] = symbol(f"v{place}")
    return table


def translate(tree: ex.Expression, table: Mapping[ex.Expression, Formula]) -> Formula:
    """The tree in symengine; InputError for a name without a value, an arbitrary function, an
    acceleration, and for a formula that is infinite for all values.
    """
    known = table.get(tree)
    if known is not None:
        return known
    match tree:
        case ex.Number(value):
            return symengine.Rational(value.numerator, value.denominator)
        case ex.Sum(terms):
            return symengine.Add(*(translate(term, table) for term in terms))
        case ex.Product(factors):
            return symengine.Mul(*(translate(factor, table) for factor in factors))
        case ex.Power(base, exponent):
            return _finite(symengine.Pow(translate(base, table), translate(exponent, table)))
        case ex.Apply(function) if function in functions.SPECIAL:
            return _special(tree, table)
        case ex.Apply(function, argument):
            return _finite(_applied(function, translate(argument, table)))
        case ex.Arbitrary(name, _, _):
            detail = (
                f"The function {name} has no formula: a simulation needs one, such as {name} = x^2."
            )
            raise errors.InputError(detail)
        case ex.Symbol(name):
            raise errors.InputError(
                f"{name} is neither a coordinate nor a parameter with a value of this simulation."
            )
        case _:
            raise errors.InputError(
                "A simulation takes formulas of positions and velocities, without accelerations."
            )


def _special(node: ex.Apply, table: Mapping[ex.Expression, Formula]) -> Formula:
    """A special function of C, or a refusal of one whose derivatives have no machine code."""
    if functions.has_no_machine_code(node.function):
        raise errors.InputError(f"A simulation cannot compute the function {node.function}.")
    return getattr(symengine, node.function)(translate(node.argument, table))


def _finite(formula: Formula) -> Formula:
    """The formula; InputError if it is infinite for all values, as 1/sin(0) and log(0) are."""
    if formula in _INFINITE:
        what = "divides by 0 (or takes the logarithm of 0)"
        raise errors.InputError(f"A formula of this system {what} for all values of its variables.")
    return formula


def _applied(function: str, argument: Formula) -> Formula:
    """tan and similar functions by sin and cos, so that a factor cos u cancels."""
    if function in functions.CIRCULAR and function in functions.FRACTIONS:
        pair, powers = functions.FRACTIONS[function]
        return math.prod(
            getattr(symengine, name)(argument) ** e for name, e in zip(pair, powers, strict=True)
        )
    return getattr(symengine, function)(argument)


def free_names(formula: Formula) -> frozenset[str]:
    return frozenset(str(leaf) for leaf in formula.free_symbols)


def contains(formula: Formula, variable: Formula) -> bool:
    return variable in formula.free_symbols


@functools.lru_cache(maxsize=32)
def closure(names: tuple[str, ...], formulas: tuple[Formula, ...]) -> Any:
    """A function of rows of numbers; making it costs a twentieth of machine code, and the last ones
    are kept.
    """
    return symengine.Lambdify([symbol(name) for name in names], list(formulas), backend="lambda")


def slope(formula: Formula, variable: Formula) -> Formula:
    """The derivative for an iteration, with a value where a root in the formula is 0, as for v |v|
    at v = 0.

    There u/sqrt(u^2) is 0/0, while each number from -1 to 1 would serve: it gets 0. Elsewhere
    nothing changes.
    """
    found = formula.diff(variable)
    roots = [power.args[0] for power in formula.atoms(symengine.Pow) if power.args[1] == HALF]
    return (
        found.subs({base**-HALF: (base + _FAR_BELOW) ** -HALF for base in roots})
        if roots
        else found
    )
