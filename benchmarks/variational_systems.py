"""Thirty systems with a known L = e^s (q' G q'/2 + A q' - V), s = g0 t + g q, for the nearest-member
benchmark; their equations are derived by SymPy, not by this package.
"""

from __future__ import annotations

import importlib
import itertools
from dataclasses import dataclass
from typing import Any

sp: Any = importlib.import_module("sympy")  # which has no types


@dataclass(frozen=True, slots=True)
class Known:
    """G, the rates (g0, g_1, ...), A and V as texts in the coordinates; the smallest kind that has it.

    `further`: terms that the fit had too, whose true coefficients are 0.
    """

    name: str
    coordinates: str
    kind: str
    masses: str
    potential: str
    vector: str = ""
    rates: str = ""
    further: str = ""


SYSTEMS = (
    Known("pendulum", "x", "natural", "1", "-9.81*cos(x)", further="v1, v1**2"),
    Known("Duffing", "x", "natural", "1", "x**4/4 - x**2/2", further="1, x**2, v1, v1*x"),
    Known("Morse", "x", "natural", "1", "exp(-2*x) - 2*exp(-x)", further="v1, v1**2"),
    Known("damped pendulum", "x", "damped", "1", "-4*cos(x)", rates="0.3", further="v1**2"),
    Known("damped Duffing", "x", "damped", "1", "x**4/4 + x**2", rates="0.2", further="v1*x, v1**2"),
    Known("mass that grows", "x", "exponential", "1", "x**2", rates="0, 0.5", further="v1, v1*x"),
    Known("double spring", "x, y", "equal_masses", "1, 1", "x**2 - x*y + y**2", further="v1, v2"),
    Known("springs, masses 1:2", "x, y", "natural", "1, 2", "x**2/2 - x*y/2 + y**2", further="v1, v2"),
    Known("Henon and Heiles", "x, y", "equal_masses", "1, 1", "x**2/2 + y**2/2 + x**2*y - y**3/3",
          further="v1, v2"),
    Known("cubic coupling, masses 1:3", "x, y", "natural", "1, 3", "x**2 + y**2 + x**2*y/2 - x*y**2/3"),
    Known("charge", "x, y", "equal_masses", "1, 1", "x**2/2 + y**2/2", "-y*0.7, 0.7*x"),
    Known("charge, masses 1:2, B = 1 + x/2", "x, y", "natural", "1, 2", "x**2/2 + y**2",
          "0, x + x**2/4", further="v1, v2"),
    Known("damped springs, masses 1:2", "x, y", "damped", "1, 2", "x**2 - x*y/2 + y**2", rates="0.2"),
    Known("damped Henon and Heiles", "x, y", "damped", "1, 1", "x**2/2 + y**2/2 + x**2*y - y**3/3",
          rates="0.1"),
    Known("conformal oscillator", "x, y", "exponential", "1, 1", "x**2/2 + y**2/2",
          rates="0, 0.5, 0", further="v1, v2"),
    Known("damped conformal oscillator", "x, y", "damped_exponential", "1, 1", "x**2/2 + y**2",
          rates="0.3, 0.5, 0"),
    Known("Bateman pair", "x, y", "natural", "0, 1, 0", "x*y + x**3/5", "-0.1*y, 0.1*x"),
    Known("double pendulum, small", "x, y", "natural", "2, 1, 1", "x**2 + y**2/2 + x**3/4"),
    Known("quartic", "x, y", "equal_masses", "1, 1", "(x**2 + y**2)**2/4", further="v1, v2"),
    Known("Foucault", "x, y", "equal_masses", "1, 1", "2*x**2 + 2*y**2", "-0.3*y, 0.3*x"),
    Known("coupled pendulums, masses 1:2", "x, y", "natural", "1, 2",
          "-3*cos(x) - 2*cos(y) - cos(x - y)", further="v1, v2"),
    Known("driven springs, masses 1:2", "x, y", "natural", "1, 2",
          "(1 + cos(t)/2)*x**2 + y**2 - x*y/2", further="v1, v2"),
    Known("damped charge", "x, y", "damped", "1, 1", "x**2/2 + y**2", "-0.5*y, 0.5*x", "0.2"),
    Known("chain of three", "x, y, z", "equal_masses", "1, 1, 1",
          "(x**2 + (y - x)**2 + (z - y)**2 + z**2)/2", further="v1, v2, v3"),
    Known("chain, masses 1:2:3", "x, y, z", "natural", "1, 2, 3",
          "(x**2 + (y - x)**2 + (z - y)**2 + z**2)/2", further="v1, v2, v3"),
    Known("charge in space", "x, y, z", "equal_masses", "1, 1, 1", "x**2 + y**2/2 + z**2/3",
          "-0.5*y, 0.5*x, 0", further="v3"),
    Known("damped chain, masses 1:2:3", "x, y, z", "damped", "1, 2, 3",
          "(x**2 + (y - x)**2 + (z - y)**2 + z**2)/2", rates="0.2"),
    Known("trap with cubic coupling, masses 2:1:1", "x, y, z", "natural", "2, 1, 1",
          "x**2 + y**2 + z**2/2 + x*y*z"),
    Known("rotating frame", "x, y, z", "equal_masses", "1, 1, 1", "x**2/4 + y**2/4 + z**2 + x**2*z/3",
          "-0.6*y, 0.6*x, 0"),
    Known("two springs and one apart", "x, y, z", "natural", "1, 2, 1", "x**2 + y**2 - x*y + z**2",
          further="v1, v3"),
)  # fmt: skip


def accelerations(known: Known) -> tuple[list[str], list[Any], list[Any]]:
    """The coordinates, f, and the further terms; velocities are v1, v2, ..."""
    names = known.coordinates.split(", ")
    n = len(names)
    time, q = sp.Symbol("t"), [sp.Symbol(name) for name in names]
    v = list(sp.symbols(f"v1:{n + 1}"))
    table = {**dict(zip(names, q, strict=True)), "t": time}

    def read(text: str) -> Any:
        return sp.sympify(text, locals=table, rational=True)

    numbers = [read(part) for part in known.masses.split(", ")]
    matrix = sp.zeros(n, n)
    if len(numbers) == n:
        matrix = sp.diag(*numbers)
    else:
        places = list(itertools.combinations_with_replacement(range(n), 2))
        for value, (row, column) in zip(numbers, places, strict=True):
            matrix[row, column] = matrix[column, row] = value
    vector = [read(part) for part in known.vector.split(", ")] if known.vector else [sp.S(0)] * n
    rates = [read(part) for part in known.rates.split(", ")] if known.rates else []
    rates += [sp.S(0)] * (1 + n - len(rates))
    s = rates[0] * time + sum(rate * one for rate, one in zip(rates[1:], q, strict=True))
    kinetic = (sp.Matrix(v).T * matrix * sp.Matrix(v))[0] / 2
    inner = kinetic + sum(a * one for a, one in zip(vector, v, strict=True)) - read(known.potential)
    lagrangian = sp.exp(s) * inner
    momenta = [sp.diff(lagrangian, one) for one in v]
    right = [
        sp.diff(lagrangian, q[i])
        - sp.diff(momenta[i], time)
        - sum(sp.diff(momenta[i], q[j]) * v[j] for j in range(n))
        for i in range(n)
    ]
    found = matrix.LUsolve(sp.Matrix(right)) * sp.exp(-s)
    further = [read(part) for part in known.further.split(", ")] if known.further else []
    return names, [sp.expand(sp.simplify(one)) for one in found], further


def terms_of(expression: Any) -> dict[Any, Any]:
    """The numbers before the terms of a sum."""
    found = dict[Any, Any]()
    for term in sp.Add.make_args(sp.expand(expression)):
        number, rest = term.as_coeff_Mul()
        if number:
            found[rest] = number
    return found


def text_of(term: Any, names: list[str]) -> str:
    """The term in the notation of documents."""
    table = {sp.Symbol(f"v{k}"): sp.Symbol(f"{name}'") for k, name in enumerate(names, 1)}
    return str(term.subs(table)).replace("**", "^")
