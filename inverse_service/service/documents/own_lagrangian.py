"""Whether a Lagrangian of the user has the equations of a document."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from inverse_service.certificate.checker import CheckResult, check_certificate
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.tree import TIME, ZERO, Acceleration, Arbitrary, Expression, Symbol, walk
from inverse_service.inverse_problem.decision import certify
from inverse_service.inverse_problem.decision.analysis import analyse
from inverse_service.mechanics.document_names import Declared, known_names
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual, euler_lagrange_sums
from inverse_service.mechanics.implicit_equations import linear_equation, solve_accelerations
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.service.documents import accepting, translate

POINTER = "/lagrangian"
AS_WRITTEN = (
    "The accelerations are too long to be solved for, and L does not give the equations as they are written, "
    "up to their signs."
)


def check_lagrangian(document: Any, text: str, time_limit: float = 60.0) -> dict[str, Any]:
    """{verdict, reasons, residual, equations}: whether q'' = f of the document are the equations of L.

    `residual` has E_i = d/dt(dL/dq_i') - dL/dq_i along q'' = f for each coordinate, {text, latex}; all zero for a
    right L. `equations` has the accelerations that L gives instead, where it is regular and wrong. The verdict is that
    of the independent checker: "valid", "invalid" or "incomplete". Raises InputError.
    """
    schema = accepting.to_schema(document)
    system = accepting.to_solvable(schema)
    lagrangian, system = _read(schema, system, text)
    own, is_singular = _equations_of(lagrangian, system)
    analysis = analyse(system)
    with_time = system.depends_on_time or TIME in walk(lagrangian)
    found = check_certificate(certify.of_lagrangian(analysis, lagrangian, with_time), time_limit=time_limit)
    if system.is_unsolved and found.verdict == "invalid":  # the checker compares E_i with the i-th equation alone
        found = CheckResult("incomplete", (AS_WRITTEN,))
    verdict = "invalid" if is_singular else found.verdict
    residual = _residual(lagrangian, system, verdict == "valid")
    reasons = ["The Hessian of L in the velocities is singular: L does not determine the accelerations."]
    return {
        "verdict": verdict,
        "reasons": reasons if is_singular else list(found.reasons),
        "residual": _formulas(system, residual),
        "equations": None if own is None or verdict == "valid" else _formulas(system, own),
    }


def _read(schema: Any, system: SecondOrderSystem, text: str) -> tuple[Expression, SecondOrderSystem]:
    """L, and the system with the constants and functions that occur in L alone, where the document asks to guess."""
    from inverse_service.mechanics.nonholonomic.constraint_reading import read_lagrangian

    declared = Declared(system.coordinates, schema.parameters, system.names.functions, schema.where)
    known = known_names(declared, {POINTER: text}, order=1)
    found = known.put_in(read_lagrangian(text, known.names))
    used = {node.name for node in walk(found) if isinstance(node, Symbol | Arbitrary)}
    more = [name for name in known.names.parameters if name in used and name not in system.parameters]
    named = known.names.functions.items()
    functions = [function for function in named if function[0] in used and function not in system.functions]
    wider = replace(system, parameters=(*system.parameters, *more), functions=(*system.functions, *functions))
    return found, wider if more or functions else system


def _residual(lagrangian: Expression, system: SecondOrderSystem, is_valid: bool) -> tuple[Expression, ...]:
    """E_i along the motion; of equations that are not solved for the accelerations, what E_i adds to the i-th."""
    if not system.is_unsolved:
        return euler_lagrange_residual(lagrangian, system.coordinates, system.accelerations)
    sums = euler_lagrange_sums(lagrangian, system.coordinates, [Acceleration(name) for name in system.coordinates])
    left = [collect(e - given) for e, given in zip(sums, system.given, strict=True)]
    return tuple(ZERO for _ in left) if is_valid else tuple(left)


def _equations_of(lagrangian: Expression, system: SecondOrderSystem) -> tuple[tuple[Expression, ...] | None, bool]:
    """The accelerations that L gives, None where they are not solved for; whether L is not regular."""
    names = system.coordinates
    sums = euler_lagrange_sums(lagrangian, names, [Acceleration(name) for name in names])
    try:
        equations = [linear_equation(tree, POINTER) for tree in sums]
        return (None, False) if system.is_unsolved else (solve_accelerations(equations, names), False)
    except LimitError:
        return None, False
    except InputError:
        return None, True


def _formulas(system: SecondOrderSystem, trees: tuple[Expression, ...]) -> dict[str, dict[str, str]]:
    return {name: translate.formula_fields(tree) for name, tree in zip(system.coordinates, trees, strict=True)}
