"""RosenfeldGroebner of the package DifferentialAlgebra (Boulier): is there a solution with det g !=
0?

pip install DifferentialAlgebra
python -m benchmarks.peers.differential_algebra < system.json
"""

from __future__ import annotations

import importlib
import itertools
import json
import sys
import time
from typing import Any

import sympy

from benchmarks.decision_benchmark import read
from benchmarks.peers.helmholtz import UNDERIVED, LinearSystem, linear_system


def measured(document: dict[str, Any]) -> dict[str, Any]:
    """Verdict and processor seconds of the completion alone; {"missing": True} if it is not
    installed.
    """
    try:
        package = importlib.import_module("DifferentialAlgebra")
    except ImportError:
        return {"missing": True}
    problem = linear_system(read(document))
    unknown = _unknowns(problem)
    ring = package.DifferentialRing(
        derivations=list(problem.variables), blocks=[[g.func for g in unknown.values()]]
    )
    equations = [_written(equation, unknown, problem.variables) for equation in problem.equations]
    size = range(problem.size)
    determinant = sympy.Matrix([[unknown[min(i, j), max(i, j)] for j in size] for i in size]).det()
    began = time.process_time()
    chains = ring.RosenfeldGroebner([*equations, sympy.Ne(determinant, 0)])
    return {
        "verdict": "variational" if chains else "not_variational",
        "seconds": time.process_time() - began,
    }


def _unknowns(problem: LinearSystem) -> dict[tuple[int, int], Any]:
    pairs = itertools.combinations_with_replacement(range(problem.size), 2)
    return {(i, j): sympy.Function(f"g{i + 1}{j + 1}")(*problem.variables) for i, j in pairs}


def _written(equation: Any, unknown: dict[tuple[int, int], Any], variables: tuple[Any, ...]) -> Any:
    terms = []
    for (i, j, axis), coefficient in equation.items():
        g = unknown[i, j]
        terms.append(
            coefficient * (g if axis == UNDERIVED else sympy.Derivative(g, variables[axis]))
        )
    return sympy.Add(*terms)


if __name__ == "__main__":
    print(json.dumps(measured(json.load(sys.stdin))))
