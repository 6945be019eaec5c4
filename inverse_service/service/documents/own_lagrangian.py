"""A Lagrangian of the user against equations: does it have exactly these motions, and if not, what is wrong?"""

from __future__ import annotations

from typing import Any

from inverse_service.certificate.checker import check_certificate
from inverse_service.errors import InputError
from inverse_service.expressions.tree import TIME, Acceleration, Expression, walk
from inverse_service.inverse_problem.decision import certify
from inverse_service.inverse_problem.decision.analysis import analyse
from inverse_service.mechanics.document_names import Declared, known_names
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual, euler_lagrange_sums
from inverse_service.mechanics.implicit_equations import solve_accelerations
from inverse_service.mechanics.linear_parts import linear_equation
from inverse_service.mechanics.nonholonomic.reading import read_lagrangian
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.service.documents import translate

POINTER = "/lagrangian"


def check_lagrangian(document: Any, text: str, time_limit: float = 60.0) -> dict[str, Any]:
    """{verdict, reasons, residual, equations}: whether q'' = f of the document are the equations of L.

    `residual` has E_i = d/dt(dL/dq_i') - dL/dq_i along q'' = f for each coordinate, {text, latex}; all zero for a
    right L. `equations` has the accelerations that L gives instead, where it is regular and wrong. The verdict is that
    of the independent checker: "valid", "invalid" or "incomplete". Raises InputError.
    """
    schema = translate.to_schema(document)
    system = translate.to_system(schema)
    lagrangian = _read(schema, system, text)
    residual = euler_lagrange_residual(lagrangian, system.coordinates, system.accelerations)
    own = _equations_of(lagrangian, system)
    analysis = analyse(system)
    with_time = system.depends_on_time or TIME in walk(lagrangian)
    found = check_certificate(certify.of_lagrangian(analysis, lagrangian, with_time), time_limit=time_limit)
    verdict = "invalid" if own is None else found.verdict
    reasons = ["The Hessian of L in the velocities is singular: L does not determine the accelerations."]
    return {
        "verdict": verdict,
        "reasons": reasons if own is None else list(found.reasons),
        "residual": _formulas(system, residual),
        "equations": None if own is None or verdict == "valid" else _formulas(system, own),
    }


def _read(schema: Any, system: SecondOrderSystem, text: str) -> Expression:
    """L with the names of the system and no others."""
    declared = Declared(system.coordinates, schema.parameters, system.names.functions, schema.where)
    known = known_names(declared, {POINTER: text}, order=1)
    return known.put_in(read_lagrangian(text, known.names))


def _equations_of(lagrangian: Expression, system: SecondOrderSystem) -> tuple[Expression, ...] | None:
    """The accelerations that L gives, None where it is not regular."""
    names = system.coordinates
    sums = euler_lagrange_sums(lagrangian, names, [Acceleration(name) for name in names])
    try:
        return solve_accelerations([linear_equation(tree, POINTER) for tree in sums], names)
    except InputError:
        return None


def _formulas(system: SecondOrderSystem, trees: tuple[Expression, ...]) -> dict[str, dict[str, str]]:
    return {name: translate.formula_fields(tree) for name, tree in zip(system.coordinates, trees, strict=True)}
