"""Whether a Lagrangian of the user has the equations of a document."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from inverse_service.certificate.checker import CheckResult, check_certificate
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.inequalities import inequality_text
from inverse_service.expressions.tree import TIME, ZERO, Acceleration, Arbitrary, Expression, Symbol, walk
from inverse_service.inverse_problem.decision import certify
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.mechanics.euler_lagrange import euler_lagrange_residual, euler_lagrange_sums
from inverse_service.mechanics.implicit_equations import linear_equation, solve_accelerations
from inverse_service.mechanics.second_order_system import MOST_BRANCHES, SecondOrderSystem, branches_of
from inverse_service.reading.document_names import Declared, known_names
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
    found = _judged(_branches(system, lagrangian), time_limit)
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


def _branches(system: SecondOrderSystem, lagrangian: Expression) -> list[tuple[SecondOrderSystem, Expression]]:
    """The system and L where the roots of both are single formulas; L = (x'^2 + x^2)/2 gives |x| on one side only."""
    if system.branch is not None:
        return [(system, lagrangian)]
    found: list[tuple[SecondOrderSystem, Expression]] = []
    for one in branches_of(replace(system, accelerations=(*system.accelerations, lagrangian))):
        branch = one.branch and replace(one.branch, given=one.branch.given[:-1])
        found.append((replace(one, accelerations=one.accelerations[:-1], branch=branch), one.accelerations[-1]))
    return found


def _judged(branches: list[tuple[SecondOrderSystem, Expression]], time_limit: float) -> CheckResult:
    """Valid where L is right on every branch; else the reasons of each."""
    found: list[CheckResult] = []
    for system, lagrangian in branches[:MOST_BRANCHES]:
        with_time = system.depends_on_time or TIME in walk(lagrangian)
        claim = certify.of_lagrangian(analyze(system), lagrangian, with_time)
        found.append(check_certificate(claim, time_limit=time_limit / len(branches)))
    verdicts = {each.verdict for each in found} | ({"incomplete"} if len(branches) > MOST_BRANCHES else set())
    worst = next(verdict for verdict in ("invalid", "incomplete", "valid") if verdict in verdicts)
    if len(verdicts) == 1:
        return found[0]
    where = [" and ".join(map(inequality_text, map(collect, system.positive))) for system, _ in branches]
    reasons = [f"Where {place}: {reason}" for place, each in zip(where, found, strict=False) for reason in each.reasons]
    return CheckResult(worst, tuple(reasons))


def _residual(lagrangian: Expression, system: SecondOrderSystem, is_valid: bool) -> tuple[Expression, ...]:
    """E_i along the motion; of equations that are not solved for the accelerations, what E_i adds to the i-th."""
    if is_valid:
        return (ZERO,) * len(system.coordinates)
    if not system.is_unsolved:
        return euler_lagrange_residual(lagrangian, system.coordinates, system.accelerations)
    sums = euler_lagrange_sums(lagrangian, system.coordinates, [Acceleration(name) for name in system.coordinates])
    return tuple(collect(e - given) for e, given in zip(sums, system.given, strict=True))


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
