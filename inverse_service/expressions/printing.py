"""Trees to canonical plain text, a small part of what `reader.py` reads:

    formula   = ["-"] term {(" + " | " - ") term}
    term      = factors ["/" (factor | "(" factors ")")]
    factors   = factor {"*" factor}
    factor    = atom ["^" exponent]
    exponent  = integer | name | "(" formula ")"
    atom      = integer | name | name "'" | name "''" | function | "(" formula ")"
    function  = name {"'"} "(" formula {", " formula} ")"
              | "diff(" name "(" name {", " name} "), " name {", " name} ")"
              | name "[" integer {"," integer} "](" formula {", " formula} ")"

`sqrt` is the only function besides `tree.ELEMENTARY` and the declared ones; integers have no sign;
rational numbers are written as quotients. A'(u) is the derivative of a declared function of one
argument; for several, diff(B(x, y), x) where the arguments are different names, else B[1,0](u, w),
with the order of the derivative in each argument. The text reads back to the same value, and the
text of what was read back is the same text.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from inverse_service.expressions.printing_latex import to_latex
from inverse_service.expressions.printing_layout import (
    Ratio,
    has_plain_arguments,
    signed,
    variables,
)
from inverse_service.expressions.printing_mathml import to_mathml
from inverse_service.expressions.tree import (
    HALF,
    Acceleration,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Symbol,
    Velocity,
)

__all__ = ["to_latex", "to_mathml", "to_text"]


# What is printed is printed in several places, and most of it is made of few parts.
@lru_cache(maxsize=2048)
def to_text(expression: Expression, within: bool = False) -> str:
    """The canonical text; deterministic, with no more brackets than reading needs."""
    return signed(expression, _ratio, within)


def _ratio(term: Ratio) -> str:
    number, divisor = term.numbers
    over = _factors(number, term.numerators)
    if divisor == "1" and not term.denominators:
        return over
    under = _factors(divisor, term.denominators)
    alone = len(term.denominators) + (divisor != "1") == 1
    return f"{over}/{under}" if alone else f"{over}/({under})"


def _factors(coefficient: str, factors: Sequence[Expression]) -> str:
    first = [coefficient] if coefficient != "1" or not factors else []
    return "*".join(first + [_factor(factor) for factor in factors])


def _factor(factor: Expression) -> str:
    match factor:
        case Power(base, exponent) if exponent != HALF:
            return f"{_atom(base)}^{_exponent(exponent)}"
        case _:
            return _atom(factor)


def _exponent(exponent: Expression) -> str:
    match exponent:
        case Number(value) if value >= 0 and value.denominator == 1:
            return str(value)
        case Symbol(name):
            return name
        case _:
            return f"({to_text(exponent, within=True)})"


def _atom(expression: Expression) -> str:
    match expression:
        case Number(value) if value >= 0 and value.denominator == 1:
            return str(value)
        case Symbol(name):
            return name
        case Velocity(name):
            return f"{name}'"
        case Acceleration(name):
            return f"{name}''"
        case Apply(function, argument):
            return f"{function}({to_text(argument, within=True)})"
        case Power(base, exponent) if exponent == HALF:
            return f"sqrt({to_text(base, within=True)})"
        case Arbitrary():
            return _arbitrary(expression)
        case _:
            return f"({to_text(expression, within=True)})"


def _arbitrary(function: Arbitrary) -> str:
    arguments = ", ".join(to_text(argument, within=True) for argument in function.arguments)
    if len(function.orders) == 1:
        return f"{function.name}{chr(39) * function.orders[0]}({arguments})"
    if not any(function.orders):
        return f"{function.name}({arguments})"
    if has_plain_arguments(function):
        by = ", ".join(to_text(variable) for variable in variables(function))
        return f"diff({function.name}({arguments}), {by})"
    return f"{function.name}[{','.join(map(str, function.orders))}]({arguments})"
