"""Rewrite a formula as another text for the same function on its whole domain.

Every rule holds on the whole real domain of its left side, so a verdict may not change.
"""

from __future__ import annotations

import random
from fractions import Fraction

from inverse_service.expressions import tree as ex
from inverse_service.mechanics.second_order_system import SecondOrderSystem

# u is replaced by the argument, already written and in brackets.
FUNCTION_RULES: dict[str, tuple[str, ...]] = {
    "sin": (
        "2*sin(u/2)*cos(u/2)",
        "(sin(u+1)*cos(1)-cos(u+1)*sin(1))",
        "(3*sin(u/3)-4*sin(u/3)^3)",
        "cos(u-pi/2)",
    ),
    "cos": (
        "(1-2*sin(u/2)^2)",
        "(2*cos(u/2)^2-1)",
        "(cos(u+1)*cos(1)+sin(u+1)*sin(1))",
        "sin(u+pi/2)",
    ),
    "exp": ("exp(u/2)^2", "(cosh(u)+sinh(u))", "exp(u+1)/exp(1)", "1/exp(-u)", "sqrt(exp(2*u))"),
    "log": ("(log(2*u)-log(2))", "2*log(sqrt(u))", "(-log(1/u))", "log(u^3)/3"),
}
ROOT_RULES = ("exp(log(u)/2)", "u/sqrt(u)", "sqrt(4*u)/2", "sqrt(2)*sqrt(u/2)", "(u^3)^(1/6)")
ONES = (
    "(sin(u)^2+cos(u)^2)",
    "(cosh(u)^2-sinh(u)^2)",
    "exp(u)*exp(-u)",
    "tan(u)*cot(u)",
    "(sec(u)^2-tan(u)^2)",
    "((u^2+u)/(u*(u+1)))",
)
SQUARES = "((a+b)^2-(a-b)^2)/4"


def rewritten(system: SecondOrderSystem, seed: int) -> dict[str, str]:
    """The equations with some parts rewritten, including at least one factor 1."""
    rng = random.Random(f"rewritten/{seed}")
    names = [*system.coordinates, *(f"{name}'" for name in system.coordinates)]
    equations = {
        name: written(f, rng)
        for name, f in zip(system.coordinates, system.accelerations, strict=True)
    }
    chosen = rng.choice(system.coordinates)
    one = _put(rng.choice(ONES), u=rng.choice(names))
    equations[chosen] = f"({equations[chosen]})*{one}"
    return equations


def written(expression: ex.Expression, rng: random.Random) -> str:
    """The text of the formula, in brackets if needed."""
    match expression:
        case ex.Number(value):
            return f"({value})"
        case ex.Symbol(name):
            return name
        case ex.Velocity(coordinate):
            return f"{coordinate}'"
        case ex.Sum(terms):
            return "(" + "+".join(_shuffled(terms, rng)) + ")"
        case ex.Product(factors):
            return _product(_shuffled(factors, rng), rng)
        case ex.Power(base, exponent):
            return _power(base, exponent, rng)
        case ex.Apply(function, argument):
            inside = f"({written(argument, rng)})"
            rules = FUNCTION_RULES.get(function, ())
            return (
                _put(rng.choice(rules), u=inside)
                if rules and rng.random() < 0.7
                else f"{function}{inside}"
            )
        case _:
            raise ValueError(f"{type(expression).__name__} is not rewritten")


def _shuffled(parts: tuple[ex.Expression, ...], rng: random.Random) -> list[str]:
    texts = [written(part, rng) for part in parts]
    rng.shuffle(texts)
    return texts


def _product(factors: list[str], rng: random.Random) -> str:
    if rng.random() < 0.15 and len(factors) > 1:
        a, b, *rest = factors
        factors = [f"({_put(SQUARES, a=a, b=b)})", *rest]
    return "(" + "*".join(factors) + ")"


def _power(base: ex.Expression, exponent: ex.Expression, rng: random.Random) -> str:
    inside = f"({written(base, rng)})"
    if not isinstance(exponent, ex.Number):
        return f"{inside}^({written(exponent, rng)})"
    if exponent.value == Fraction(1, 2):
        return f"({_put(rng.choice(ROOT_RULES), u=inside)})"
    if exponent.value == 2 and rng.random() < 0.5:
        return f"({inside}*{inside})"
    return f"{inside}^({exponent.value})"


def _put(rule: str, **parts: str) -> str:
    """The rule with texts substituted for its one-letter names (not inside function names)."""
    pieces = []
    for k, letter in enumerate(rule):
        alone = not (rule[k - 1 : k].isalpha() or rule[k + 1 : k + 2].isalpha())
        pieces.append(f"({parts[letter]})" if letter in parts and alone else letter)
    return "".join(pieces)
