"""Certificates about a motion on constraints (see certificate/FORMAT.md); nothing is judged here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mpmath

from inverse_service.algebra.components import component
from inverse_service.algebra.elementary import to_kernels
from inverse_service.algebra.real_point import find_real_point, is_defined, requirements
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.inequalities import inequality_text
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, substitute
from inverse_service.inverse_problem.constrained.existence import AnalysedMotion, variables_of
from inverse_service.inverse_problem.decision.certify import FORMAT, MOST_CONDITIONS
from inverse_service.inverse_problem.kinds.bivectors import last_of
from inverse_service.inverse_problem.kinds.constrained import Shape
from inverse_service.linear_pde.involutive_form import Finding

_DIGITS = 20
_SEED = 3


def of_lagrangian(analysed: AnalysedMotion, lagrangian: Expression, with_time: bool) -> dict[str, Any]:
    """L itself is the proof, near a point at which it is defined."""
    on = substitute(
        to_kernels(lagrangian), dict(zip(map(Velocity, analysed.motion.dependent), analysed.velocities, strict=True))
    )
    table = analysed.real_point
    if table is not None and not is_defined([on], table):
        formulas = [*analysed.velocities, *analysed.forces, on]
        table = find_real_point(formulas, variables_of(analysed.motion), _SEED) or table
    head = _head(replace(analysed, real_point=table), with_time, "variational", "lagrangian", [lagrangian])
    return head | {"lagrangian": to_text(lagrangian)}


def of_finding(analysed: AnalysedMotion, found: Finding, with_time: bool) -> dict[str, Any]:
    """The rows used for a no, the involution data of a yes."""
    if found.exists is None:
        raise ValueError("only what was settled has a certificate")
    if found.symbol is None:
        head = _head(analysed, with_time, "not_variational", "nonexistence")
        if found.along is not None:
            return head | {"along": found.along}
        rows = [[*row[:-1], list(row[-1])] for row in found.rows if isinstance(row[-1], tuple)]
        return head | _bivectors(analysed, with_time) | {"order": found.order, "rows": rows}
    # The dimension stopped falling between order - 1 and order.
    order, symbol = found.order - 1, found.symbol
    return (
        _head(analysed, with_time, "variational", "existence")
        | _bivectors(analysed, with_time)
        | {
            "order": order,
            "degree": found.degree,
            "dimensions": list(found.history[order][: found.degree + 1]),
            "symbol": {
                "dimension": symbol.dimension,
                "prolonged": symbol.prolonged,
                "characters": list(symbol.characters),
            },
        }
    )


def _bivectors(analysed: AnalysedMotion, with_time: bool) -> dict[str, int]:
    last = last_of(Shape(len(analysed.motion.free), len(analysed.motion.dependent), with_time))
    return {"bivectors": last} if last else {}


def _head(
    analysed: AnalysedMotion, with_time: bool, claim: str, kind: str, more: Sequence[Expression] = ()
) -> dict[str, Any]:
    head = {
        "format": FORMAT,
        "system": _system(analysed),
        "question": "time_dependent" if with_time else "autonomous",
        "claim": claim,
        "kind": kind,
    }
    parts = {"near": _near(analysed), "conditions": _conditions(analysed, more)}
    return head | {key: part for key, part in parts.items() if part}


def _conditions(analysed: AnalysedMotion, more: Sequence[Expression]) -> list[str]:
    """What cuts out the connected set of D on which the motion, and L on D, are one analytic function each."""
    motion, table = analysed.motion, analysed.real_point
    if table is None:
        return []
    placed = (substitute(tree, motion.on_constraints) for tree in more)
    formulas = [*motion.dependent_velocities, *motion.free_accelerations, *placed]
    try:
        positive = component(requirements(formulas, table), table, [Symbol(name) for name in motion.parameters])
    except IrreducibleAtoms:
        return []
    return [*dict.fromkeys(map(inequality_text, positive))][:MOST_CONDITIONS]


def _system(analysed: AnalysedMotion) -> dict[str, Any]:
    """As of a second-order system, with velocities of the dependent coordinates besides the accelerations."""
    motion = analysed.motion
    return {
        "coordinates": list(analysed.names),
        "equations": {name: to_text(f) for name, f in zip(motion.free, motion.free_accelerations, strict=True)},
        "velocities": {name: to_text(w) for name, w in zip(motion.dependent, motion.dependent_velocities, strict=True)},
        "parameters": list(motion.parameters),
        "functions": {name: list(arguments) for name, arguments in motion.functions},
    }


def _near(analysed: AnalysedMotion) -> dict[str, str]:
    """A real point of the constraints that the verdict speaks of."""
    table = analysed.real_point or {}
    names: list[tuple[str, Symbol | Velocity]] = [(name, Symbol(name)) for name in analysed.names]
    names += [("t", TIME), *((name, Symbol(name)) for name in analysed.motion.parameters)]
    names += [(f"{name}'", Velocity(name)) for name in analysed.motion.free]
    return {name: mpmath.nstr(table[key], _DIGITS) for name, key in names if key in table}
