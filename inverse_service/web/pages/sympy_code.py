"""Formulas of a result as SymPy code that a reader can paste and run."""

from __future__ import annotations

import keyword
from collections.abc import Mapping
from typing import Any

from inverse_service.expressions.names import Names
from inverse_service.expressions.reader import read_formula
from inverse_service.expressions.tree import (
    HALF,
    Acceleration,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
)
from inverse_service.web.pages.typesetting import names_of

# Names of the code itself; a coordinate of the same name gets an underscore.
TAKEN = frozenset(("sp", "L", "H", "q", "d", "qi", "motion", "equations", "residual", "equation", "print"))


def variable(name: str) -> str:
    """The Python name of a symbol."""
    return f"{name}_" if name in TAKEN or keyword.iskeyword(name) else name


def to_sympy(expression: Expression) -> str:
    """The expression as Python text; coordinates are functions of t."""
    match expression:
        case Number(value):
            whole = value.denominator == 1
            return str(value) if whole else f"sp.Rational({value.numerator}, {value.denominator})"
        case Symbol("pi"):
            return "sp.pi"
        case Symbol(name):
            return variable(name)
        case Velocity(name):
            return f"{variable(name)}.diff(t)"
        case Acceleration(name):
            return f"{variable(name)}.diff(t, 2)"
        case Sum(terms):
            return " + ".join(to_sympy(term) for term in terms).replace("+ -", "- ")
        case Product(factors):
            return "*".join(_factor(factor) for factor in factors)
        case Power(base, exponent) if exponent == HALF:
            return f"sp.sqrt({to_sympy(base)})"
        case Power(base, exponent):
            return f"{_base(base)}**{_base(exponent)}"
        case Apply(function, argument):
            return f"sp.{function}({to_sympy(argument)})"
        case Arbitrary():
            return _arbitrary(expression)
        case _:
            raise TypeError(type(expression).__name__)


def _factor(expression: Expression) -> str:
    text = to_sympy(expression)
    is_bare = not isinstance(expression, Sum) and not text.startswith("-")
    return text if is_bare else f"({text})"


def _base(expression: Expression) -> str:
    text = to_sympy(expression)
    is_bare = isinstance(expression, Symbol | Velocity | Apply) or text.isdigit()
    return text if is_bare else f"({text})"


def _arbitrary(function: Arbitrary) -> str:
    """A derivative is taken at dummies d0, d1, ... and then put at the arguments."""
    name = variable(function.name)
    arguments = ", ".join(to_sympy(argument) for argument in function.arguments)
    if not any(function.orders):
        return f"{name}({arguments})"
    dummies = [f"d[{place}]" for place in range(len(function.arguments))]
    by = ", ".join(f"{dummy}, {order}" for dummy, order in zip(dummies, function.orders, strict=True) if order)
    inner = f"sp.Derivative({name}({', '.join(dummies)}), {by})"
    return f"sp.Subs({inner}, ({', '.join(dummies)},), ({arguments},))"


def sympy_program(result: Mapping[str, Any]) -> str:
    """Symbols, the motion, L, its Euler-Lagrange equations along the motion, and H."""
    system = result["system"]
    names = names_of(system)
    lines = [*_declarations(system), "", *_motion(system, names)]
    answer = result if result["lagrangian"] else (result.get("with_time") or result)
    if answer["lagrangian"]:
        lines += ["", f"L = {_code(answer['lagrangian']['text'], names)}", *_check(system)]
    hamiltonian = answer.get("hamiltonian")
    if hamiltonian:
        if not hamiltonian["implicit"]:
            lines += ["", *(f"{variable(name)} = sp.Symbol({name!r})" for name in hamiltonian["momenta"])]
        lines += [f"H = {_code(hamiltonian['text'], names)}"]
    return "\n".join(lines) + "\n"


def _code(text: str, names: Names) -> str:
    return to_sympy(read_formula(text, names))


def _declarations(system: Mapping[str, Any]) -> list[str]:
    lines = ["import sympy as sp", "", 't = sp.Symbol("t")']
    lines += [f'{variable(name)} = sp.Function("{name}")(t)' for name in system["coordinates"]]
    lines += [f'{variable(name)} = sp.Symbol("{name}")' for name in system["parameters"]]
    lines += [f'{variable(name)} = sp.Function("{name}")' for name in system["functions"]]
    most = max((len(arguments) for arguments in system["functions"].values()), default=0)
    return lines + ([f'd = sp.symbols("d:{most}")'] if most else [])


def _motion(system: Mapping[str, Any], names: Names) -> list[str]:
    q = ", ".join(variable(name) for name in system["coordinates"])
    entries = [f"    {variable(name)}.diff(t, 2): {_code(text, names)}," for name, text in system["equations"].items()]
    return [f"q = [{q}]", "motion = {", *entries, "}"]


def _check(system: Mapping[str, Any]) -> list[str]:
    return [
        "equations = [L.diff(qi.diff(t)).diff(t) - L.diff(qi) for qi in q]",
        "residual = [sp.simplify(equation.doit().subs(motion)) for equation in equations]",
        "print(residual)  # the Euler-Lagrange equations hold along the motion: all zero",
    ]
