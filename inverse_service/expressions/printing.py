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

from inverse_service.expressions import printing_layout
from inverse_service.expressions import tree as ex
from inverse_service.expressions.printing_latex import to_latex
from inverse_service.expressions.printing_mathml import to_mathml

__all__ = ["to_latex", "to_mathml", "to_text"]


# What is printed is printed in several places, and most of it is made of few parts.
@lru_cache(maxsize=2048)
def to_text(expression: ex.Expression, within: bool = False) -> str:
    """The canonical text; deterministic, with no more brackets than reading needs."""
    return printing_layout.signed(expression, _ratio, within)


def _ratio(term: printing_layout.Ratio) -> str:
    number, divisor = term.numbers
    over = _factors(number, term.numerators)
    if divisor == "1" and not term.denominators:
        return over
    under = _factors(divisor, term.denominators)
    alone = len(term.denominators) + (divisor != "1") == 1
    return f"{over}/{under}" if alone else f"{over}/({under})"


def _factors(coefficient: str, factors: Sequence[ex.Expression]) -> str:
    first = [coefficient] if coefficient != "1" or not factors else []
    return "*".join(first + [_factor(factor) for factor in factors])


def _factor(factor: ex.Expression) -> str:
    match factor:
        case ex.Power(base, exponent) if exponent != ex.HALF:
            return f"{_atom(base)}^{_exponent(exponent)}"
        case _:
            return _atom(factor)


def _exponent(exponent: ex.Expression) -> str:
    match exponent:
        case ex.Number(value) if value >= 0 and value.denominator == 1:
            return str(value)
        case ex.Symbol(name):
            return name
        case _:
            return f"({to_text(exponent, within=True)})"


def _atom(expression: ex.Expression) -> str:
    match expression:
        case ex.Number(value) if value >= 0 and value.denominator == 1:
            return str(value)
        case ex.Symbol(name):
            return name
        case ex.Velocity(name):
            return f"{name}'"
        case ex.Acceleration(name):
            return f"{name}''"
        case ex.Apply(function, argument):
            return f"{function}({to_text(argument, within=True)})"
        case ex.Power(base, exponent) if exponent == ex.HALF:
            return f"sqrt({to_text(base, within=True)})"
        case ex.Arbitrary():
            return _arbitrary(expression)
        case _:
            return f"({to_text(expression, within=True)})"


def _arbitrary(function: ex.Arbitrary) -> str:
    arguments = ", ".join(to_text(argument, within=True) for argument in function.arguments)
    if len(function.orders) == 1:
        return f"{function.name}{chr(39) * function.orders[0]}({arguments})"
    if not any(function.orders):
        return f"{function.name}({arguments})"
    if printing_layout.has_plain_arguments(function):
        by = ", ".join(to_text(variable) for variable in printing_layout.variables(function))
        return f"diff({function.name}({arguments}), {by})"
    return f"{function.name}[{','.join(map(str, function.orders))}]({arguments})"
