"""Quantities of a kernel in the user's names: what vanishes is said as a formula."""

from __future__ import annotations

from fractions import Fraction

import symengine

from inverse_service.codegen.algebra import STEP, Formula, symbol
from inverse_service.codegen.planning import limit_at_zero_step
from inverse_service.codegen.program import Program, Solve
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    Apply,
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    number,
    power,
)
from inverse_service.simulation.formulas import Formulas

_LONGEST = 160
_FUNCTIONS = {"sin", "cos", "tan", "exp", "log", "sinh", "cosh", "tanh", "asin", "acos", "atan"}


def limit_text(f: Formulas, program: Program, block: int) -> tuple[str, int] | None:
    """The determinant of an implicit block as h -> 0, over q, q' and the momenta, with the sign it was multiplied by.

    The sign makes a constant term -1 into 1. None where the limit is not known or too long to be read.
    """
    solves = [one for one in program.blocks if isinstance(one, Solve)]
    if block >= len(solves):
        return None
    limit = limit_at_zero_step(solves[block].jacobian, [symbol(name) for name in solves[block].unknowns])
    if limit is None:
        return None
    formula = limit.subs({symbol(f"d{k}"): STEP * symbol(f"v{k}") for k in range(f.size)}).expand()
    sign = -1 if isinstance(formula, symengine.Add) and symengine.Integer(-1) in formula.args else 1
    tree = _tree((sign * formula).expand(), _names(f))
    text = to_text(collect(tree)) if tree is not None else ""
    return (text, sign) if 0 < len(text) <= _LONGEST else None


def _names(f: Formulas) -> dict[str, Expression]:
    coordinates, parameters = f.problem.coordinates, f.problem.parameters
    table: dict[str, Expression] = {f"c{k}": Symbol(name) for k, name in enumerate(parameters)}
    for k, name in enumerate(coordinates):
        table |= {f"q{k}": Symbol(name), f"v{k}": Velocity(name), f"p{k}": Symbol(f"p_{name}")}
    return table


def _tree(formula: Formula, names: dict[str, Expression]) -> Expression | None:
    """A formula of symengine as a tree; None where it holds something else."""
    if formula.is_Symbol:
        return names.get(str(formula))
    if isinstance(formula, symengine.Rational):
        return number(Fraction(str(formula)))
    if not formula.args:
        return None
    parts = [_tree(part, names) for part in formula.args]
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return None
    if isinstance(formula, symengine.Add):
        return add(*known)
    if isinstance(formula, symengine.Mul):
        return multiply(*known)
    if isinstance(formula, symengine.Pow):
        return power(known[0], known[1])
    name = type(formula).__name__.lower()
    return Apply(name, known[0]) if name in _FUNCTIONS and len(known) == 1 else None
