"""Parse formulas of the corpus with SymPy, without the package."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mpmath
import sympy

TIME = sympy.Symbol("t")
DIGITS = 60


@dataclass(frozen=True)
class Formulas:
    """f in SymPy; a velocity is the symbol named x'."""

    coordinates: tuple[sympy.Symbol, ...]
    velocities: tuple[sympy.Symbol, ...]
    parameters: tuple[sympy.Symbol, ...]
    functions: dict[str, list[str]]
    accelerations: tuple[sympy.Expr, ...]


def formulas(document: dict[str, Any], equations: dict[str, str]) -> Formulas:
    """The equations, an object of texts in the canonical grammar, as SymPy expressions."""
    names = document.get("coordinates") or list(equations)
    functions = document.get("functions") or {}
    parameters = list(document.get("parameters") or [])
    read = [expression(equations[name], names, parameters, functions) for name in names]
    return Formulas(
        tuple(map(sympy.Symbol, names)),
        tuple(sympy.Symbol(name + "'") for name in names),
        tuple(map(sympy.Symbol, parameters)),
        functions,
        tuple(concrete(f, functions) for f in read),
    )


def expression(
    text: str, names: Sequence[str], parameters: Sequence[str], functions: dict[str, list[str]]
) -> sympy.Expr:
    """Parse our own texts only, because SymPy's parser evaluates its input."""
    table: dict[str, Any] = {name: sympy.Symbol(name) for name in (*names, *parameters, "t")}
    table |= {f"{name}_rate": sympy.Symbol(f"{name}'") for name in names}
    for name in functions:
        table[name] = sympy.Function(name)
        text = re.sub(rf"(?<!\w){name}('+)\((\w+)\)", _derivative, text)
    for name in sorted(names, key=len, reverse=True):
        text = re.sub(rf"(?<!\w){re.escape(name)}'", f"{name}_rate", text)
    return sympy.sympify(
        text.replace("^", "**"), locals={**table, "diff": sympy.diff}, rational=True
    )


def _derivative(match: re.Match[str]) -> str:
    """A''(x) as diff(A(x), x, 2)."""
    name = match[0].split("'", 1)[0]
    return f"diff({name}({match[2]}), {match[2]}, {len(match[1])})"


def concrete(given: sympy.Expr, functions: dict[str, list[str]]) -> sympy.Expr:
    """Replace arbitrary functions by particular ones: a failure for these is a failure in
    general.
    """
    for k, (name, arguments) in enumerate(functions.items(), start=1):
        symbols = [sympy.Symbol(argument) for argument in arguments]
        linear = sum(
            (weight * symbol for weight, symbol in enumerate(symbols, start=2)), sympy.Integer(0)
        )
        body = sympy.sin(linear + k) + sympy.exp(-linear / 7) * (3 + symbols[0] ** 3 * sum(symbols))
        given = given.subs(sympy.Function(name), sympy.Lambda(tuple(symbols), body)).doit()
    return given


def point(given: Formulas, seed: int) -> dict[sympy.Symbol, Any]:
    """Random positive numbers, velocities below those of positions."""
    generator = random.Random(seed)
    ranges = [
        (given.coordinates, 3, 6),
        (given.velocities, 1, 4),
        (given.parameters, 3, 9),
        ([TIME], 3, 6),
    ]
    with mpmath.workdps(DIGITS):
        return {
            symbol: mpmath.mpf(generator.randint(low * 10**8, high * 10**8)) / 10**9
            for symbols, low, high in ranges
            for symbol in symbols
        }


def values(expressions: Sequence[sympy.Expr], place: dict[sympy.Symbol, Any]) -> list[Any]:
    """Their numbers to 60 digits."""
    plain = {symbol: sympy.Symbol(f"a{k}") for k, symbol in enumerate(place)}
    function = sympy.lambdify(
        list(plain.values()), [e.xreplace(plain) for e in expressions], "mpmath", cse=True
    )
    with mpmath.workdps(DIGITS):
        return [mpmath.mpmathify(value) for value in function(*place.values())]
