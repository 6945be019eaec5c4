"""Certificates written from decisions and Lagrangians (see certificate/FORMAT.md); nothing is judged here."""

from __future__ import annotations

from typing import Any

import mpmath

from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Expression, Symbol, Velocity
from inverse_service.inverse_problem.analysis import Analysis
from inverse_service.inverse_problem.decision import Decision
from inverse_service.mechanics.second_order_system import SecondOrderSystem

FORMAT = "inverse-service/certificate/1"
_DIGITS = 20


def of_lagrangian(analysis: Analysis, lagrangian: Expression, with_time: bool) -> dict[str, Any]:
    """L itself is the proof."""
    return _head(analysis, with_time, "variational", "lagrangian") | {"lagrangian": to_text(lagrangian)}


def of_decision(analysis: Analysis, decision: Decision) -> dict[str, Any]:
    """The rows used for a negative verdict, the involution data of a positive one."""
    if decision.verdict == "not_variational":
        rows = [[kind, i, j, list(alpha)] for kind, i, j, alpha in decision.rows]
        head = _head(analysis, decision.with_time, "not_variational", "nonexistence")
        return head | {"order": decision.order, "rows": rows}
    if decision.verdict != "variational" or decision.symbol is None:
        raise ValueError("only a definite decision has a certificate")
    # The dimension stopped falling between order - 1 and order.
    order = decision.order - 1
    head = _head(analysis, decision.with_time, "variational", "existence")
    return head | {
        "order": order,
        "degree": decision.degree,
        "dimensions": list(decision.history[order][: decision.degree + 1]),
        "symbol": {
            "dimension": decision.symbol.dimension,
            "prolonged": decision.symbol.prolonged,
            "characters": list(decision.symbol.characters),
        },
    }


def _head(analysis: Analysis, with_time: bool, claim: str, kind: str) -> dict[str, Any]:
    head = {
        "format": FORMAT,
        "system": _system(analysis.system),
        "question": "time_dependent" if with_time else "autonomous",
        "claim": claim,
        "kind": kind,
    }
    near = _near(analysis)
    return head | {"near": near} if near else head


def _system(system: SecondOrderSystem) -> dict[str, Any]:
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    return {
        "coordinates": list(system.coordinates),
        "equations": {name: to_text(f) for name, f in pairs},
        "parameters": list(system.parameters),
        "functions": {function.name: list(function.arguments) for function in system.functions},
    }


def _near(analysis: Analysis) -> dict[str, str]:
    """A real point of the domain that the verdict speaks of."""
    table, system = analysis.real_point, analysis.system
    if table is None:
        return {}
    names: list[tuple[str, Symbol | Velocity]] = [(name, Symbol(name)) for name in (*system.coordinates, "t")]
    names += [(f"{name}'", Velocity(name)) for name in system.coordinates]
    names += [(name, Symbol(name)) for name in system.parameters]
    return {name: mpmath.nstr(table[key], _DIGITS) for name, key in names if key in table}
