"""The Helmholtz conditions as a linear PDE system for g_ij(q, v), as an expert would hand it to a
peer.

Each equation is {(i, j, axis): coefficient} for the sum of coefficient * d_axis g_ij, where axis -1
means g_ij itself and 0 … 2n - 1 mean (q, v). The coefficients are polynomials: each equation is
multiplied by its denominators.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import sympy

from benchmarks.sympy_form import to_sympy
from inverse_service.mechanics.second_order_system import SecondOrderSystem

Key = tuple[int, int, int]
Equation = dict[Key, Any]
UNDERIVED = -1


@dataclass(frozen=True, slots=True)
class LinearSystem:
    """Variables (q, v) as plain symbols x1 … x2n, and the equations."""

    variables: tuple[Any, ...]
    equations: tuple[Equation, ...]

    @property
    def size(self) -> int:
        return len(self.variables) // 2


def linear_system(system: SecondOrderSystem) -> LinearSystem:
    """(H1), (H2), (H3) of a system with rational f. Raises ValueError if f is not rational."""
    n = len(system.coordinates)
    x = tuple(sympy.Symbol(f"x{k + 1}") for k in range(2 * n))
    names = {sympy.Symbol(name): x[k] for k, name in enumerate(system.coordinates)}
    names |= {sympy.Symbol(f"{name}'"): x[n + k] for k, name in enumerate(system.coordinates)}
    forces = sympy.Matrix([to_sympy(f) for f in system.accelerations]).subs(
        names, simultaneous=True
    )
    if not all(f.is_rational_function(*x) for f in forces) or forces.free_symbols - set(x):
        raise ValueError("only rational systems without parameters are given to the peers")
    found = [*_closed(n), *_along(forces, x), *_symmetric(forces, x)]
    return LinearSystem(x, tuple(equation for raw in found if (equation := _polynomial(raw))))


def _pair(i: int, j: int) -> tuple[int, int]:
    return (i, j) if i <= j else (j, i)


def _add(equation: Equation, i: int, j: int, axis: int, coefficient: Any) -> None:
    key = (*_pair(i, j), axis)
    equation[key] = equation.get(key, 0) + coefficient


def _closed(n: int) -> list[Equation]:
    """(H1): d g_ij / d v_k = d g_ik / d v_j."""
    found = []
    for i, j, k in itertools.product(range(n), repeat=3):
        if j < k:
            equation: Equation = {}
            _add(equation, i, j, n + k, 1)
            _add(equation, i, k, n + j, -1)
            found.append(equation)
    return found


def _along(forces: Any, x: tuple[Any, ...]) -> list[Equation]:
    """(H2): Gamma(g) = g N + (g N)^T with N = -1/2 df/dv."""
    n = len(forces)
    slope = forces.jacobian(x[n:])
    found = []
    for i, j in itertools.combinations_with_replacement(range(n), 2):
        equation: Equation = {}
        for axis, speed in enumerate((*x[n:], *forces)):
            _add(equation, i, j, axis, speed)
        for k in range(n):
            _add(equation, i, k, UNDERIVED, slope[k, j] / 2)
            _add(equation, j, k, UNDERIVED, slope[k, i] / 2)
        found.append(equation)
    return found


def _symmetric(forces: Any, x: tuple[Any, ...]) -> list[Equation]:
    """(H3): g Phi is symmetric."""
    n = len(forces)
    slope = forces.jacobian(x[n:])
    drift = slope.applyfunc(
        lambda entry: sum(
            speed * sympy.diff(entry, name)
            for speed, name in zip((*x[n:], *forces), x, strict=True)
        )
    )
    Phi = drift - 2 * forces.jacobian(x[:n]) - slope * slope / 2
    found = []
    for i, j in itertools.combinations(range(n), 2):
        equation: Equation = {}
        for k in range(n):
            _add(equation, i, k, UNDERIVED, Phi[k, j])
            _add(equation, j, k, UNDERIVED, -Phi[k, i])
        found.append(equation)
    return found


def _polynomial(equation: Equation) -> Equation:
    """The equation times its common denominator, without zero coefficients."""
    parts = {key: sympy.together(sympy.sympify(value)) for key, value in equation.items()}
    common = sympy.Integer(1)
    for value in parts.values():
        common = sympy.lcm(common, sympy.denom(value))
    cleared = {key: sympy.expand(sympy.cancel(value * common)) for key, value in parts.items()}
    return {key: value for key, value in cleared.items() if value != 0}
