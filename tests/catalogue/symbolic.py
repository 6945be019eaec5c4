"""Convert documents of the catalog to SymPy expressions, and evaluate them with 40 digits."""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from typing import Any

import mpmath
import sympy

from benchmarks.sympy_form import to_sympy
from inverse_service.reading.declarations import parameter_values, with_values
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

Point = dict[sympy.Expr, mpmath.mpf]
DIGITS = 40


class Reader:
    """Formulas of one document; parameters with a value are replaced by it."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.coordinates = tuple(document["coordinates"])
        parameters = document.get("parameters", ())
        functions = {
            name: tuple(arguments) for name, arguments in document.get("functions", {}).items()
        }
        self.names = Names(self.coordinates, tuple(parameters), functions)
        self.values = parameter_values(parameters)

    def __call__(self, formula: str) -> sympy.Expr:
        return to_sympy(with_values(read_formula(formula, self.names), self.values))


def opaque_atoms(expressions: Iterable[sympy.Expr]) -> set[sympy.Expr]:
    """Symbols, arbitrary functions, and their derivatives: everything that needs a value at a
    point.
    """
    found: set[sympy.Expr] = set()
    for expression in expressions:
        found |= (
            expression.atoms(sympy.Derivative, sympy.core.function.AppliedUndef)
            | expression.free_symbols
        )
    return found


def random_point(atoms: Iterable[sympy.Expr], seed: int) -> Point:
    """Independent values between 0.1 and 0.4 for all atoms."""
    rng = random.Random(seed)
    ordered = sorted(atoms, key=str)
    return {atom: mpmath.mpf(rng.randint(10**9, 4 * 10**9)) / 10**10 for atom in ordered}
