"""Certificates about a motion on constraints (see certificate/FORMAT.md); nothing is judged here."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from inverse_service.constrained.existence import AnalyzedMotion, variables_of
from inverse_service.decision.certify import conditions_of, head_of, involution_data, near_of
from inverse_service.decision.kinds.bivectors import last_of
from inverse_service.decision.kinds.constrained import Shape
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.evaluation import NoRealValue
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Expression, Symbol, Velocity, substitute
from inverse_service.field.elementary import to_kernels
from inverse_service.field.real_point import find_real_point, is_defined, requirements
from inverse_service.field.sign_cases import signed_factors
from inverse_service.linear_pde.involutive_form import Finding

_SEED = 3


def of_lagrangian(analyzed: AnalyzedMotion, lagrangian: Expression, with_time: bool) -> dict[str, Any]:
    """L itself is the proof, near a point at which it is defined."""
    on = substitute(
        to_kernels(lagrangian), dict(zip(map(Velocity, analyzed.motion.dependent), analyzed.velocities, strict=True))
    )
    table = analyzed.real_point
    if table is not None and not is_defined([on], table):
        formulas = [*analyzed.velocities, *analyzed.forces, on]
        table = find_real_point(formulas, variables_of(analyzed.motion), _SEED) or table
    head = _head(replace(analyzed, real_point=table), with_time, "variational", "lagrangian")
    return head | {"lagrangian": to_text(lagrangian)}


def of_finding(analyzed: AnalyzedMotion, found: Finding, with_time: bool) -> dict[str, Any]:
    """The rows used for a no, the involution data of a yes."""
    if found.exists is None:
        raise ValueError("only what was settled has a certificate")
    if found.symbol is None:
        head = _head(analyzed, with_time, "not_variational", "nonexistence")
        if found.along is not None:
            return head | {"along": found.along}
        rows = [[*row[:-1], list(row[-1])] for row in found.rows if isinstance(row[-1], tuple)]
        return head | _bivectors(analyzed, with_time) | {"order": found.order, "rows": rows}
    head = _head(analyzed, with_time, "variational", "existence")
    return head | _bivectors(analyzed, with_time) | involution_data(found, found.symbol)


def _bivectors(analyzed: AnalyzedMotion, with_time: bool) -> dict[str, int]:
    last = last_of(Shape(len(analyzed.motion.free), len(analyzed.motion.dependent), with_time))
    return {"bivectors": last} if last else {}


def _head(analyzed: AnalyzedMotion, with_time: bool, claim: str, kind: str) -> dict[str, Any]:
    motion = analyzed.motion
    symbols = map(Symbol, (*analyzed.names, "t", *motion.parameters))
    near = near_of(analyzed.real_point, [*symbols, *map(Velocity, motion.free)])
    return head_of(_system(analyzed), with_time, claim, kind, near, ())


def on_one_side(
    analyzed: AnalyzedMotion, certificate: dict[str, Any], more: Sequence[Expression] = ()
) -> dict[str, Any]:
    """The certificate with the signs that all that is under roots has at its point, for those that depend on them."""
    motion, table = analyzed.motion, analyzed.real_point
    if table is None:
        return certificate
    placed = (substitute(tree, motion.on_constraints) for tree in more)
    formulas = [*motion.dependent_velocities, *motion.free_accelerations, *placed]
    with suppress(IrreducibleAtoms, NoRealValue):
        return certificate | {"conditions": conditions_of(signed_factors(requirements(formulas, table), table))}
    return certificate


def _system(analyzed: AnalyzedMotion) -> dict[str, Any]:
    """As of a second-order system, with velocities of the dependent coordinates besides the accelerations."""
    motion = analyzed.motion
    return {
        "coordinates": list(analyzed.names),
        "equations": {name: to_text(f) for name, f in zip(motion.free, motion.free_accelerations, strict=True)},
        "velocities": {name: to_text(w) for name, w in zip(motion.dependent, motion.dependent_velocities, strict=True)},
        "parameters": list(motion.parameters),
        "functions": {name: list(arguments) for name, arguments in motion.functions},
    }
