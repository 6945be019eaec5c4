"""Random formulas in every supported SymPy print style parse to the same value, or are rejected."""

from __future__ import annotations

import random
import re
from collections import Counter
from typing import Any

import pytest
import sympy as sp
from sympy.printing.maple import maple_code
from sympy.printing.mathematica import mathematica_code

from inverse_service.errors import InputError
from inverse_service.expressions.tree import Expression
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.sympy.from_sympy import Table, to_sympy

t = sp.Symbol("t")
x, y, theta = (sp.Function(name)(t) for name in ("x", "y", "theta"))
k, m, alpha = sp.symbols("k m alpha")
A, B = sp.Function("A"), sp.Function("B")
ARGUMENTS = {"A": ("x",), "B": ("x", "y")}
NAMES = Names(("x", "y", "theta"), ("k", "m", "alpha"), ARGUMENTS)
CONSTANTS = {"k": k, "m": m, "alpha": alpha}
TABLE = Table(t, "t", {"x": x, "y": y, "theta": theta}, {}, CONSTANTS, {"A": A, "B": B}, ARGUMENTS)
OF_FUNCTIONS = {
    A(x).diff(x): 0.77, A(x): 1.61, B(x, y).diff(x, 2): 1.13, B(x, y).diff(y): 0.91, B(x, y): 1.37,
}  # fmt: skip
LEAVES = [x, y, theta, k, m, alpha, t, x.diff(t), y.diff(t), theta.diff(t), sp.pi, *OF_FUNCTIONS]
FUNCTIONS = [
    sp.sin,
    sp.cos,
    sp.tan,
    sp.exp,
    sp.log,
    sp.sqrt,
    sp.atan,
    sp.asin,
    sp.sinh,
    sp.cosh,
    sp.tanh,
]
VALUES = {x: 1.3, y: 0.7, theta: 0.45, k: 1.9, m: 2.3, alpha: 0.61, t: 0.37}
RATES = {x.diff(t): 0.83, y.diff(t): 1.17, theta.diff(t): 0.29}


def tree(maker: random.Random, depth: int) -> Any:
    """A random expression; numbers may be rational and negative."""
    kind = maker.random()
    if depth == 0 or kind < 0.15:
        number = sp.Rational(maker.randint(-9, 9), maker.choice((1, 1, 2, 3, 7)))
        return maker.choice([*LEAVES, number, sp.Integer(maker.randint(2, 99))])
    if kind < 0.45:
        return sp.Add(*(tree(maker, depth - 1) for _ in range(maker.randint(2, 3))))
    if kind < 0.75:
        return sp.Mul(*(tree(maker, depth - 1) for _ in range(maker.randint(2, 3))))
    if kind < 0.88:
        exponents = [2, 3, -1, -2, sp.Rational(1, 2), sp.Rational(-3, 2), sp.Rational(2, 3)]
        return sp.Pow(tree(maker, depth - 1), maker.choice(exponents))
    return maker.choice(FUNCTIONS)(tree(maker, depth - 1))


def maxima(expression: Any) -> str:
    """SymPy has no printer for Maxima: its text with ^, %e and 'diff."""
    text = str(expression).replace("**", "^").replace("pi", "%pi")
    return re.sub(r"Derivative\(", "'diff(", text)


STYLES = {
    "str": str,
    "srepr": sp.srepr,
    "latex": sp.latex,
    "mathematica": mathematica_code,
    "maple": maple_code,
    "maxima": maxima,
}


def value(expression: Any) -> complex | None:
    """A number for comparison, or None if the expression has no value at the point."""
    put = sp.sympify(expression).doit()
    for table in (OF_FUNCTIONS, RATES, VALUES):
        put = put.xreplace({each: sp.Float(number) for each, number in table.items()})
    try:
        found = complex(put.evalf(18))
    except (TypeError, ValueError):
        return None
    return found if abs(found) < 1e12 else None


def outcome(
    expression: Any, style: str, expected: complex, values: dict[Expression, complex | None]
) -> str:
    """ "same", "refused", "no value", or the two values that differ; `values` are those of earlier
    trees.
    """
    try:
        read = read_formula(STYLES[style](expression), NAMES)
    except InputError:
        return "refused"
    if read not in values:
        values[read] = value(to_sympy(read, TABLE.leaf))
    found = values[read]
    if found is None:
        return "no value"
    same = abs(found - expected) <= 1e-7 * max(1.0, abs(expected))
    return (
        "same"
        if same
        else f"{style}: {STYLES[style](expression)!r} is {expected}, read as {read} = {found}"
    )


def count(number: int, seed: int) -> tuple[Counter[tuple[str, str]], list[str]]:
    maker = random.Random(seed)
    seen: Counter[tuple[str, str]] = Counter()
    wrong: list[str] = []
    for _ in range(number):
        expression = tree(maker, 3)
        if expression.has(sp.zoo, sp.nan, sp.oo, sp.I):
            continue
        expected = value(expression)
        if expected is None or abs(expected.imag) > 1e-9:
            continue
        values: dict[Expression, complex | None] = {}
        for style in STYLES:
            found = outcome(expression, style, expected, values)
            if found not in ("same", "refused", "no value"):
                wrong.append(found)
            seen[style, found.partition(":")[0]] += 1
    return seen, wrong


@pytest.mark.slow
def test_printed_formulas_are_parsed_as_meant_or_rejected() -> None:
    seen, wrong = count(80, 1)
    assert wrong == []
    for style in STYLES:
        assert seen[style, "same"] > seen[style, "refused"], seen


@pytest.mark.slow
def test_what_others_print_is_read_as_it_was_meant_500_times() -> None:
    assert count(500, 2)[1] == []


@pytest.mark.nightly
def test_what_others_print_is_read_as_it_was_meant_20000_times() -> None:
    seen, wrong = count(20_000, 3)
    assert wrong == []
    assert all(seen[style, "same"] > 10 * seen[style, "refused"] for style in STYLES), seen
