"""A third opinion on L and H, by SymPy's own derivatives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy

if TYPE_CHECKING:
    from inverse_service.sympy.result import Answer, Verification


def verification(answer: Answer) -> Verification:
    """The residuals of an answer, simplified; ValueError where it has no Lagrangian."""
    from inverse_service.sympy.result import Verification

    lagrangian = answer.lagrangian
    if lagrangian is None:
        raise ValueError("there is no Lagrangian to verify")
    table = answer._table
    pairs = [(table.coordinates[name], table.velocity(name)) for name in table.coordinates]
    motion = {table.acceleration(name): f for name, f in zip(table.coordinates, answer.equations.values(), strict=True)}
    residuals = [_residual(lagrangian, q, v, pairs, motion, table.time) for q, v in pairs]
    return Verification(tuple(residuals), _of_hamiltonian(answer, [v for _, v in pairs]))


def _residual(lagrangian: Any, q: Any, v: Any, pairs: Any, motion: Any, time: Any) -> Any:
    """d/dt dL/dv - dL/dq along q'' = f, every name held apart from the time."""
    plain = {each: sympy.Dummy(f"a{place}", real=True) for place, pair in enumerate(pairs) for each in pair}
    ordered = dict(sorted(plain.items(), key=lambda item: not isinstance(item[0], sympy.Derivative)))
    written = _put(lagrangian, ordered)
    slopes = [_put(f, ordered) for f in motion.values()]
    momentum = written.diff(plain[v])
    total = momentum.diff(time) - written.diff(plain[q])
    for (name, speed), slope in zip(pairs, slopes, strict=True):
        total += momentum.diff(plain[name]) * plain[speed] + momentum.diff(plain[speed]) * slope
    back = {dummy: each for each, dummy in plain.items()}
    return sympy.simplify(total.doit()).subs(back)


def _put(expression: Any, ordered: Any) -> Any:
    """Derivatives first, so that none is left of a function that was replaced."""
    for each, dummy in ordered.items():
        expression = expression.subs(each, dummy)
    return expression


def _of_hamiltonian(answer: Answer, velocities: list[Any]) -> Any:
    found = answer.hamiltonian
    if found is None:
        return None
    energy = sum((p * v for p, v in zip(found.momenta.values(), velocities, strict=True)), -answer.lagrangian)
    written = found.expr if found.implicit else found.expr.subs(dict(found.momenta))
    return sympy.simplify(written - energy)


def is_zero(expression: Any) -> bool | None:
    """True, False, or None where SymPy cannot tell."""
    if expression == 0:
        return True
    found: bool | None = expression.equals(0)
    return found
