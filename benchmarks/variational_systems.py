"""Thirty systems with a known L = e^s (q' G q'/2 + A q' - V), s = g0 t + g q, for the
nearest-member benchmark; their equations are derived by SymPy, not by this package.
"""

from __future__ import annotations

import importlib
import itertools
from dataclasses import dataclass
from typing import Any

sp: Any = importlib.import_module("sympy")  # which has no types


@dataclass(frozen=True, slots=True)
class Known:
    """G, the rates (g0, g_1, ...), A and V as texts in the coordinates; the smallest kind that has
    it.

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


@dataclass(frozen=True, slots=True)
class Parts:
    """L = e^s (v G v/2 + A v - V), s = rates (t, q), in expressions of SymPy; velocities are v1, v2, ..."""

    names: list[str]
    time: Any
    positions: list[Any]
    velocities: list[Any]
    matrix: Any
    rates: list[Any]
    vector: list[Any]
    potential: Any
    further: list[Any]

    @property
    def exponent(self) -> Any:
        """s."""
        pairs = zip(self.rates, [self.time, *self.positions], strict=True)
        return sum((rate * one for rate, one in pairs), sp.S(0))

    @property
    def lagrangian(self) -> Any:
        v = sp.Matrix(self.velocities)
        linear = sum(a * one for a, one in zip(self.vector, self.velocities, strict=True))
        return sp.exp(self.exponent) * ((v.T * self.matrix * v)[0] / 2 + linear - self.potential)


def parts_of(known: Known) -> Parts:
    """A known system, read."""
    names = known.coordinates.split(", ")
    n = len(names)
    time, q = sp.Symbol("t"), [sp.Symbol(name) for name in names]
    table = {**dict(zip(names, q, strict=True)), "t": time}

    def read(text: str) -> Any:
        return sp.sympify(text, locals=table, rational=True)

    def listed(text: str) -> list[Any]:
        return [read(part) for part in text.split(", ")] if text else []

    numbers = listed(known.masses)
    matrix = sp.zeros(n, n)
    if len(numbers) == n:
        matrix = sp.diag(*numbers)
    else:
        places = list(itertools.combinations_with_replacement(range(n), 2))
        for value, (row, column) in zip(numbers, places, strict=True):
            matrix[row, column] = matrix[column, row] = value
    rates = listed(known.rates)
    return Parts(
        names,
        time,
        q,
        list(sp.symbols(f"v1:{n + 1}")),
        matrix,
        rates + [sp.S(0)] * (1 + n - len(rates)),
        listed(known.vector) or [sp.S(0)] * n,
        read(known.potential),
        listed(known.further),
    )


def accelerations(known: Known) -> tuple[list[str], list[Any], list[Any]]:
    """The coordinates, f, and the further terms."""
    parts = parts_of(known)
    q, v, lagrangian = parts.positions, parts.velocities, parts.lagrangian
    momenta = [sp.diff(lagrangian, one) for one in v]
    right = [
        sp.diff(lagrangian, position)
        - sp.diff(momentum, parts.time)
        - sum(sp.diff(momentum, one) * rate for one, rate in zip(q, v, strict=True))
        for position, momentum in zip(q, momenta, strict=True)
    ]
    found = parts.matrix.LUsolve(sp.Matrix(right)) * sp.exp(-parts.exponent)
    return parts.names, [sp.expand(sp.simplify(one)) for one in found], parts.further


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
