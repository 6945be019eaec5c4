"""The pipeline that a user would write with SymPy, for comparison.

Phi, nabla Phi and R are derived with a simplification of each entry, the linear conditions on a
symmetric matrix of symbols g_ij are solved, and the verdict is whether a regular g survives. It
knows no differential conditions, so its "variational" only means "not excluded".

    python -m benchmarks.plain cancel < system.json
"""

from __future__ import annotations

import itertools
import json
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import sympy

from benchmarks.sympy_form import SympyExpression, to_sympy, velocity
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system

Simplification = Callable[[SympyExpression], SympyExpression]
SIMPLIFICATIONS: dict[str, Simplification] = {"simplify": sympy.simplify, "cancel": sympy.cancel}


@dataclass(frozen=True, slots=True)
class Field:
    """Coordinates, velocities, f and the simplification: what Gamma needs."""

    coordinates: tuple[SympyExpression, ...]
    velocities: tuple[SympyExpression, ...]
    forces: SympyExpression
    simplify: Simplification

    def along(self, expression: SympyExpression) -> SympyExpression:
        """Gamma = d/dt + v d/dq + f d/dv."""
        total = sympy.diff(expression, sympy.Symbol("t"))
        for q, v, f in zip(self.coordinates, self.velocities, self.forces, strict=True):
            total += v * sympy.diff(expression, q) + f * sympy.diff(expression, v)
        return total


def field_of(system: SecondOrderSystem, simplify: Simplification) -> Field:
    """The system in SymPy's terms."""
    return Field(
        tuple(sympy.Symbol(name) for name in system.coordinates),
        tuple(velocity(name) for name in system.coordinates),
        sympy.Matrix([to_sympy(f) for f in system.accelerations]),
        simplify,
    )


def endomorphism(field: Field) -> tuple[SympyExpression, SympyExpression]:
    """Return (N, Phi): N = -1/2 df/dv, Phi = Gamma(df/dv) - 2 df/dq - 1/2 (df/dv)(df/dv), each (n,
    n).
    """
    slope = field.forces.jacobian(field.velocities)
    Phi = (
        slope.applyfunc(field.along)
        - 2 * field.forces.jacobian(field.coordinates)
        - slope * slope / 2
    )
    return -slope / 2, Phi.applyfunc(field.simplify)


def conditions(field: Field) -> list[SympyExpression]:
    """The expressions that must vanish: g Phi and g nabla_Phi minus their transposes, and the
    cyclic sum of g R.
    """
    n = len(field.coordinates)
    N, Phi = endomorphism(field)
    nabla = (Phi.applyfunc(field.along) + N * Phi - Phi * N).applyfunc(field.simplify)
    g = multiplier(n)
    found = [
        (g * A - (g * A).T)[i, j] for A in (Phi, nabla) for i in range(n) for j in range(i + 1, n)
    ]
    simplified = map(field.simplify, found + _cyclic(field, Phi, g))
    return [entry for entry in simplified if entry != 0]


def multiplier(n: int) -> SympyExpression:
    """The symmetric matrix of unknown symbols, (n, n)."""
    return sympy.Matrix(n, n, lambda i, j: sympy.Symbol(f"g_{min(i, j)}{max(i, j)}"))


def _cyclic(field: Field, Phi: SympyExpression, g: SympyExpression) -> list[SympyExpression]:
    """g_ij R^j_kl + g_lj R^j_ik + g_kj R^j_li for all i, k, l, from the whole array R[j][k][l]."""
    size, v = range(len(field.coordinates)), field.velocities
    R = [
        [
            [
                field.simplify(sympy.diff(Phi[j, k], v[m]) - sympy.diff(Phi[j, m], v[k]))
                for m in size
            ]
            for k in size
        ]
        for j in size
    ]
    return [
        sum(g[i, j] * R[j][k][m] + g[m, j] * R[j][i][k] + g[k, j] * R[j][m][i] for j in size)
        for i, k, m in itertools.product(size, repeat=3)
    ]


def plain_verdict(system: SecondOrderSystem, simplify: Simplification) -> str:
    """ "variational" if a regular g survives the algebraic conditions, else "not_variational"."""
    field = field_of(system, simplify)
    g = multiplier(len(system.coordinates))
    unknowns = sorted(g.free_symbols, key=str)
    equations = conditions(field)
    solutions = sympy.solve(equations, unknowns, dict=True) if equations else [{}]
    left = g.subs(solutions[0]) if solutions else sympy.zeros(*g.shape)
    return "not_variational" if sympy.simplify(left.det()) == 0 else "variational"


def measured(document: dict[str, Any], simplification: str) -> dict[str, Any]:
    """Verdict, processor seconds without imports and parsing, peak memory of this process in MB."""
    system = read_system(
        document["coordinates"],
        document["equations"],
        document.get("parameters", ()),
        document.get("functions"),
    )
    began = time.process_time()
    verdict = plain_verdict(system, SIMPLIFICATIONS[simplification])
    seconds = time.process_time() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"verdict": verdict, "seconds": seconds, "megabytes": peak}


if __name__ == "__main__":
    print(json.dumps(measured(json.load(sys.stdin), sys.argv[1])))
