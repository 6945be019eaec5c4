"""Use cases for a Lagrangian alone: its Euler-Lagrange equations, momenta, Hamiltonian and conserved quantities."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from api_schemas.forward import ConservedQuantity, ForwardParseAnswer, ForwardResult, LagrangianDocument
from api_schemas.problem import ParsedFormula
from api_schemas.result import Formula, HamiltonianPart
from api_schemas.sizes import MAX_FORWARD
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.names import Names
from inverse_service.expressions.printing import to_latex, to_mathml, to_text
from inverse_service.expressions.tree import (
    TIME,
    Acceleration,
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    negate,
    walk,
)
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.mechanics.document_names import Declared, known_names
from inverse_service.mechanics.euler_lagrange import euler_lagrange_sums, momenta
from inverse_service.mechanics.implicit_equations import solve_accelerations
from inverse_service.mechanics.legendre.transform import legendre
from inverse_service.mechanics.linear_parts import linear_equation
from inverse_service.mechanics.nonholonomic.reading import read_lagrangian
from inverse_service.mechanics.second_order_system import FunctionDeclaration, SecondOrderSystem
from inverse_service.service.documents import translate
from inverse_service.service.documents.refusals import DocumentRefused, places_of


@dataclass(frozen=True, slots=True)
class _Motion:
    """A Lagrangian with the system q'' = f of its Euler-Lagrange equations."""

    schema: LagrangianDocument
    lagrangian: Expression
    system: SecondOrderSystem


def look_forward(document: Any) -> LagrangianDocument:
    """The document in its schema; raises DocumentRefused with every fault found."""
    try:
        return LagrangianDocument.model_validate(document)
    except ValidationError as error:
        raise DocumentRefused(places_of(error, LagrangianDocument)) from None


def solve_forward(
    document: Any, options: SolveOptions, progress: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """The forward result; raises InputError, also where the Hessian of L is singular."""
    motion = _motion(look_forward(document))
    names = motion.system.coordinates
    functions = dict(zip(names, momenta(motion.lagrangian, names), strict=True))
    result = ForwardResult(
        system=translate.to_understood(motion.system, motion.schema),
        lagrangian=_formula(motion.lagrangian),
        equations={name: _formula(f) for name, f in zip(names, motion.system.accelerations, strict=True)},
        momenta={name: _formula(tree) for name, tree in functions.items()},
        hamiltonian=_hamiltonian(motion, options.time_limit),
        conserved=_conserved(motion.lagrangian, functions),
        guessed=translate.guessed_names(motion.schema, motion.system),
    )
    return result.model_dump(mode="json")


def parse_forward(document: Any) -> dict[str, Any]:
    """What was understood; raises InputError."""
    motion = _motion(look_forward(document))
    answer = translate.to_parse_answer(motion.system, motion.schema)
    tree = motion.lagrangian
    shown = ParsedFormula(text=to_text(tree), latex=to_latex(tree), mathml=to_mathml(tree))
    fields = {name: getattr(answer, name) for name in type(answer).model_fields}
    return ForwardParseAnswer(**fields, lagrangian=shown).model_dump(mode="json")


def understand_forward(document: Any) -> dict[str, Any]:
    """The `system` part of a result; raises InputError."""
    motion = _motion(look_forward(document))
    return translate.to_understood(motion.system, motion.schema).model_dump(mode="json")


def _motion(schema: LagrangianDocument) -> _Motion:
    declared = Declared(schema.coordinates, schema.parameters, schema.functions, schema.where, most=MAX_FORWARD)
    known = known_names(declared, {"/lagrangian": schema.lagrangian}, order=1)
    lagrangian, names = known.put_in(read_lagrangian(schema.lagrangian, known.names)), known.remaining()
    sums = euler_lagrange_sums(lagrangian, names.coordinates, [Acceleration(name) for name in names.coordinates])
    equations = [linear_equation(tree, "/lagrangian") for tree in sums]
    accelerations = solve_accelerations(equations, names.coordinates)
    return _Motion(schema, lagrangian, _system(schema, names, tuple(map(collect, accelerations))))


def _system(schema: LagrangianDocument, names: Names, accelerations: tuple[Expression, ...]) -> SecondOrderSystem:
    functions = tuple(FunctionDeclaration(name, arguments) for name, arguments in names.functions.items())
    return SecondOrderSystem(names.coordinates, accelerations, names.parameters, functions, schema.name)


def _hamiltonian(motion: _Motion, time_limit: float) -> HamiltonianPart:
    found = legendre(motion.lagrangian, motion.system.coordinates, time_limit / 2)
    written = _formula(found.hamiltonian)
    pairs = zip(found.symbols, found.momenta, strict=True)
    return HamiltonianPart(
        text=written.text,
        latex=written.latex,
        momenta={symbol.name: to_text(tree) for symbol, tree in pairs},
        implicit=found.implicit,
    )


def _conserved(lagrangian: Expression, functions: dict[str, Expression]) -> list[ConservedQuantity]:
    """The momenta of the coordinates that are not in L, and the energy where t is not (Noether)."""
    letters = {node for node in walk(lagrangian) if isinstance(node, Symbol)}
    found = {f"momentum of {name}": tree for name, tree in functions.items() if Symbol(name) not in letters}
    if TIME not in letters:
        terms = [multiply(Velocity(name), tree) for name, tree in functions.items()]
        found["energy"] = collect(add(*terms, negate(lagrangian)))
    return [ConservedQuantity(name=name, text=to_text(tree), latex=to_latex(tree)) for name, tree in found.items()]


def _formula(tree: Expression) -> Formula:
    return Formula(text=to_text(tree), latex=to_latex(tree))
