"""What SymPy says itself: the Helmholtz tensors as matrices and arrays, and a third opinion on L and H."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import sympy

from inverse_service.errors import InputError
from inverse_service.mechanics.conditions import conditions
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading.sympy_trees import to_sympy
from inverse_service.service.documents.accepting import to_schema, to_system
from inverse_service.service.documents.preparing import Prepared, prepared
from inverse_service.sympy import asked
from inverse_service.sympy.symbol_names import Table, expression, table_of_result

if TYPE_CHECKING:
    from inverse_service.sympy.result_objects import Answer, Verification


@dataclass(frozen=True)
class Conditions:
    """N, Phi and nabla Phi as n x n matrices, R as an n x n x n array (R[j, k, l] = R^j_kl).

    g is a multiplier only if g Phi and g nabla Phi are symmetric and the cyclic sums of g R vanish. `reason` says
    why one of them is None.
    """

    Phi: Any
    nabla_Phi: Any
    R: Any
    N: Any = None
    reason: str = ""


def conditions_of(system: Any, coordinates: Sequence[Any] | None, keys: Mapping[str, Any]) -> Conditions:
    """The tensors of a system, whatever `solve` takes."""
    document, names = asked(system, coordinates, **keys)
    ready = prepared(document)
    try:
        motion = to_system(to_schema(ready.document))
    except InputError as error:
        raise ready.error(error) from None
    table, tensors = _inside(names, ready, motion), conditions(motion)

    def plain(part: Any) -> Any:
        return [plain(each) for each in part] if isinstance(part, tuple) else to_sympy(part, table.leaf)

    def matrix(rows: Any) -> Any:
        return None if rows is None else sympy.ImmutableMatrix(plain(rows))

    blocks = None if tensors.R is None else sympy.ImmutableDenseNDimArray(plain(tensors.R))
    return Conditions(matrix(tensors.Phi), matrix(tensors.nabla_Phi), blocks, matrix(tensors.N), tensors.reason)


def _inside(names: Table | None, ready: Prepared, motion: SecondOrderSystem) -> Table:
    """The objects by the names that the system has inside, where its time is t; new ones for those of a text."""
    functions = dict(motion.functions)
    parts = {"coordinates": motion.coordinates, "parameters": motion.parameters, "functions": functions}
    table = names or table_of_result(ready.outward({"system": parts}))
    own = [dict(zip(parts[key], getattr(table, key).values(), strict=True)) for key in parts]
    velocities = dict(zip(motion.coordinates, table.velocities.values(), strict=False))
    return Table(table.time, "t", own[0], velocities, own[1], own[2], functions)


def conditions_of_texts(parts: Mapping[str, Any], table: Table) -> Conditions:
    """The key `conditions` of a result."""

    def matrix(rows: Any) -> Any:
        return sympy.ImmutableMatrix([[expression(text, table) for text in row] for row in rows])

    blocks = [[[expression(text, table) for text in row] for row in block] for block in parts["R"]]
    return Conditions(matrix(parts["Phi"]), matrix(parts["nabla_Phi"]), sympy.ImmutableDenseNDimArray(blocks))


def verification(answer: Answer) -> Verification:
    """The residuals of an answer, simplified; ValueError where it has no Lagrangian."""
    from inverse_service.sympy.result_objects import Verification

    lagrangian = answer.lagrangian
    if lagrangian is None:
        raise ValueError("there is no Lagrangian to verify")
    table = answer._table
    pairs = [(table.coordinates[name], table.velocity(name)) for name in table.coordinates]
    motion = {table.acceleration(name): f for name, f in zip(table.coordinates, answer.accelerations, strict=True)}
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
    if found is None or answer.lagrangian is None:
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
